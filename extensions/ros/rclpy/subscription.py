"""Subscription: runs a callback for each message on a topic. wait_for_message: receives one without
spinning.
"""

import inspect
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from holozen import wire
from holozen.bus import Bus
from holozen.messages import codec
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.handle import NodeHandle, Owned
from holozen.ros.rclpy.names import key
from holozen.ros.rclpy.qos import DurabilityPolicy, QoSProfile, as_profile, queue_length
from holozen.ros.rclpy.waitable import Inbox, Waitable, Waker, check_callback, deadline
from holozen.transport.errors import BusError
from holozen.transport.samples import Sample

__all__ = ["Subscription", "wait_for_message"]

REPLY_TIMEOUT = 1.0  # s for publishers to answer
# s between queries to a new publisher, to which the route may not be ready yet
RETRIES = (0.0, 0.03, 0.1, 0.5)
REMEMBERED = 100  # hashes of messages that have arrived, not the messages: a map may have megabytes
POLL = 0.1  # s between two checks whether rclpy was shut down


class Subscription(Owned, Waitable):
    """Created by `Node.create_subscription`. Keeps the newest `depth` messages, in order, until its
    node is spun.

    A message that cannot be decoded is logged and not given to the callback; `bad` counts them.
    """

    def __init__(
        self,
        handle: NodeHandle,
        msg_type: Any,
        topic: str,
        callback: Callable[..., Any],
        callback_group: CallbackGroup | None,
        qos_profile: QoSProfile,
        raw: bool,
    ) -> None:
        self.msg_type, self.topic, self.qos_profile, self.raw = msg_type, topic, qos_profile, raw
        self.callback_group = callback_group
        self.callback = callback
        self.bad = 0
        self._handle = handle
        self._tolerant = not wire.is_command(key(topic), (msg_type.ROS,))
        depth = queue_length(qos_profile)
        self._reader = handle.bus.subscribe(key(topic), msg_type, depth=depth)
        raw_subscriber = self._reader.raw
        self.inbox: Inbox[Sample] = Inbox(raw_subscriber.recv, raw_subscriber.try_recv, depth)
        self._closed = False
        is_transient = qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self.latched = _LatchedMessages(handle.bus, key(topic)) if is_transient else None

    @property
    def callback(self) -> Callable[..., Any]:
        """Called with each message, and with a dict of its timestamps if it takes two arguments."""
        return self._callback

    @callback.setter
    def callback(self, value: Callable[..., Any]) -> None:
        """Raises RuntimeError for a callback that does not take a message."""
        self._callback, self._with_info = value, _argument_count(value) == 2

    @property
    def topic_name(self) -> str:
        """Its topic, absolute and remapped."""
        return self.topic

    def get_publisher_count(self) -> int:
        """How many publishers of holozen nodes its topic has."""
        return len(self._handle.endpoints_on(self.topic, "pub"))

    def arm(self, waker: Waker) -> None:
        """Wake `waker` for the next message."""
        self.inbox.arm(waker)
        if self.latched:
            self.latched.arm(waker)

    def detach(self) -> None:
        """Let its threads end with the bus, which is about to close."""
        self.inbox.close()
        if self.latched:
            self.latched.detach()

    def destroy(self) -> None:
        """Stop receiving."""
        if not self._closed:
            self._closed = True
            self._reader.close()
            if self.latched:
                self.latched.close()
            self.inbox.close()

    def take(self) -> Callable[[], Any] | None:
        """The callback with the next message, or None."""
        while (sample := self._next()) is not None:
            try:
                message = sample.payload
                if not self.raw:
                    message = codec.decode(
                        sample.payload, sample.encoding, (self.msg_type,), self._tolerant
                    )
            except codec.CodecError as error:
                self.bad += 1
                source = sample.source or "an unknown sender"
                text = f"{self.topic}: dropped a message from {source} ({self.bad} so far): {error}"
                self._handle.logger.warning(text, throttle_duration_sec=1.0)
                continue
            if self._with_info:
                now = time.time_ns()
                return partial(
                    self._callback, message, {"source_timestamp": now, "received_timestamp": now}
                )
            return partial(self._callback, message)
        return None

    def _next(self) -> Sample | None:
        sample = self.inbox.take()
        if self.latched is None:
            return sample
        return self.latched.saw(sample) if sample else self.latched.take()


class _LatchedMessages:
    """The last message of each publisher of a key: of those that exist, and of each that appears
    later.

    One that appears later may have published before its route to this process was established. A
    message that has arrived the usual way is not delivered again.
    """

    def __init__(self, bus: Bus, key: str) -> None:
        self._bus, self._key = bus, key
        self._late: deque[Sample] = deque(maxlen=REMEMBERED)
        self.seen: deque[int] = deque(maxlen=REMEMBERED)
        self._waker = Waker()
        self._closed = threading.Event()
        self.writers = bus.writers(key)
        # the bus waits for it
        self.writers.thread = threading.Thread(target=self._keep_asking, daemon=True)
        self.writers.thread.start()

    def saw(self, sample: Sample) -> Sample:
        """The sample, which counts as seen from now on."""
        self.seen.append(hash(sample.payload))
        return sample

    def take(self) -> Sample | None:
        """The next sample that was not seen, or None."""
        while self._late:
            sample = self._late.popleft()
            if hash(sample.payload) not in self.seen:
                return self.saw(sample)
        return None

    def arm(self, waker: Waker) -> None:
        """Wake `waker` for the next one."""
        self._waker = waker

    def detach(self) -> None:
        """Let the thread end with the bus."""
        self._closed.set()

    def close(self) -> None:
        """Stop asking."""
        self.detach()
        self.writers.close()

    def _keep_asking(self) -> None:
        try:
            while not self._closed.is_set():
                for pause in RETRIES:
                    self._closed.wait(pause)
                    for reply in self._bus.ask_all(self._key, REPLY_TIMEOUT):
                        if isinstance(reply, Sample):
                            self._late.append(reply)
                            self._waker.wake()
                self.writers.recv()
        except BusError:
            return


def wait_for_message(
    msg_type: Any,
    node: Any,
    topic: str,
    *,
    qos_profile: QoSProfile | int = 1,
    time_to_wait: float = -1,
) -> tuple[bool, Any]:
    """(True, the next message), or (False, None) after `time_to_wait` seconds; a negative time
    waits for ever.

    Raises ExternalShutdownException when a signal shuts down rclpy while it waits, RCLError after
    `rclpy.shutdown()`.
    """
    end = deadline(time_to_wait)
    handle, received, waker = node._holozen, list[Any](), Waker()
    full = handle.resolve(topic, "topic")
    waker.waiting = True
    handle.check_open()
    # The node does not own it: an executor that spins the node would take the message.
    subscription = Subscription(
        handle, msg_type, full, received.append, None, as_profile(qos_profile), raw=False
    )
    try:
        while not received:
            handle.context.check_running(f"wait for a message on {full}")
            subscription.arm(waker)
            if (work := subscription.take()) is not None:
                work()
                continue
            left = min(POLL, end - time.monotonic())
            if left <= 0:
                return False, None
            waker.wait(left)
    finally:
        subscription.destroy()
    return True, received[0]


def _argument_count(callback: Callable[..., Any]) -> int:
    """Whether a callback takes a message (1) or a message and its info (2). Raises RuntimeError for
    any other.
    """
    check_callback(callback)
    try:
        signature = inspect.signature(callback)
    except (TypeError, ValueError):  # a built-in function
        return 1
    for count in (1, 2):
        try:
            signature.bind(*[None] * count)
        except TypeError:
            continue
        return count
    raise RuntimeError(
        f"{callback!r} takes {signature}; a subscription's callback takes one argument, the message"
    )
