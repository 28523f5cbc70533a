"""Subscription: runs a callback for each message on a topic."""

import inspect
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from holozen import codec
from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.inbox import Inbox, Waker
from holozen.ros.latched import Latched
from holozen.ros.missing import Told
from holozen.ros.qos import DurabilityPolicy, QoSProfile, kept
from holozen.tap import Sample

if TYPE_CHECKING:
    from holozen.ros.node import Node

__all__ = ["Subscription"]


class Subscription(Told):
    """Made by `Node.create_subscription`. Keeps the newest `depth` messages until its node is spun, in order.

    What cannot be read is told and not given to the callback; `bad` counts it.
    """

    def __init__(
        self,
        node: "Node",
        msg_type: Any,
        topic: str,
        key: str,
        callback: Callable[..., Any],
        callback_group: CallbackGroup | None,
        qos_profile: QoSProfile,
        raw: bool,
    ) -> None:
        self.msg_type, self.topic, self.qos_profile, self.raw = msg_type, topic, qos_profile, raw
        self.callback_group = callback_group
        self.callback = callback
        self.bad = 0
        self._node, self._kinds = node, (msg_type,)
        depth = kept(qos_profile)
        self._reader = node._holozen.bus.subscribe(key, msg_type, depth=depth)
        tap = self._reader.tap
        self._inbox: Inbox[Sample] = Inbox(tap.recv, tap.try_recv, depth)
        self._closed = False
        is_late = qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self._latched = Latched(node._holozen.bus, key) if is_late else None

    @property
    def callback(self) -> Callable[..., Any]:
        """What is called with each message, and with a dict of its times if it takes two arguments."""
        return self._callback

    @callback.setter
    def callback(self, value: Callable[..., Any]) -> None:
        """Raises RuntimeError for one that takes no message."""
        self._callback, self._with_info = value, _arguments(value) == 2

    @property
    def topic_name(self) -> str:
        """Its topic, absolute and remapped."""
        return self.topic

    @property
    def logger_name(self) -> str:
        """The name of its node's logger."""
        return str(self._node.get_logger().name)

    def get_publisher_count(self) -> int:
        """How many of our nodes' publishers write on its topic."""
        return self._node.count_publishers(self.topic)

    def arm(self, waker: Waker) -> None:
        """Wake `waker` for the next message."""
        self._inbox.arm(waker)
        if self._latched:
            self._latched.arm(waker)

    def silence(self) -> None:
        """Let its threads end with the bus."""
        self._inbox.close()
        if self._latched:
            self._latched.silence()

    def destroy(self) -> None:
        """Listen no more."""
        if not self._closed:
            self._closed = True
            self._node._holozen.bus.drop(self._reader)
            if self._latched:
                self._latched.close()
            self._inbox.close()

    def take(self) -> Callable[[], Any] | None:
        """The callback with the next message, or None."""
        while (sample := self._next()) is not None:
            try:
                message = sample.payload if self.raw else codec.decode(sample.payload, sample.encoding, self._kinds)
            except codec.CodecError as error:
                self._refuse(sample, error)
                continue
            if self._with_info:
                now = time.time_ns()
                return partial(self._callback, message, {"source_timestamp": now, "received_timestamp": now})
            return partial(self._callback, message)
        return None

    def _next(self) -> Sample | None:
        sample = self._inbox.take()
        if self._latched is None:
            return sample
        return self._latched.saw(sample) if sample else self._latched.take()

    def _refuse(self, sample: Sample, error: Exception) -> None:
        self.bad += 1
        told = f"{self.topic}: a message of {sample.source or 'a stranger'} is left out ({self.bad} by now): {error}"
        self._node.get_logger().warning(told, throttle_duration_sec=1.0)


def _arguments(callback: Callable[..., Any]) -> int:
    """Whether a callback takes a message (1) or one and what is known of it (2). Raises RuntimeError for others."""
    try:
        signature = inspect.signature(callback)
    except (TypeError, ValueError):  # it is built in, or no function
        if callable(callback):
            return 1
        raise TypeError(f"a callback is a function, and {callback!r} is a {type(callback).__name__}") from None
    for count in (1, 2):
        try:
            signature.bind(*[None] * count)
        except TypeError:
            continue
        return count
    raise RuntimeError(f"{callback!r} takes {signature}; a subscription's callback takes one argument, the message")
