"""Topics: publishers and subscribers of messages."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from holozen.console import printable
from holozen.messages import CodecError
from holozen.transport.samples import Answers, Declared, RawSubscriber, Sample, until_closed
from holozen.wire import is_command, stops

if TYPE_CHECKING:
    from holozen.messages import Message
    from holozen.transport.beat import Echoes

M = TypeVar("M", bound="Message")

# s that a get waits for the next message of a publisher that sends only what is wanted
GET_PATIENCE = 1.0
MATCH_CHECK_EVERY = 16  # polls between checks that a subscriber remains
SLOWEST = 5.0  # s; after this long any stream is stale


class RawPublisher(Declared):
    """Writes encoded payloads; a `get` on its key is answered with the last one, see Gets. Made by
    `Bus.publisher_raw`.

    Each carries the attachment that `stamp` makes, with the sender, and a number by which readers
    count lost samples; that of a command also has the `echoes` of its receivers' beats. `sign`
    makes a command's attachment of a stamp, the encoding and the payload. `watch` declares a
    listener of whether anyone subscribes.
    """

    def __init__(
        self,
        publisher: Any,
        stamp: Callable[..., bytes],
        watch: Callable[[], Any],
        sign: Callable[[bytes, str, bytes], bytes] | None,
        echoes: Echoes | None = None,
    ) -> None:
        super().__init__(publisher)
        self.key: Any = publisher.key_expr
        self.gets: Gets | None = None  # set by the bus
        self.echoes = echoes  # of commands alone
        self._publisher = publisher
        self._put = publisher.put
        self._stamp = stamp
        self._sign = sign
        self._encoding = publisher.encoding
        # with its Encoding, where that is not this publisher's
        self._last: tuple[bytes, str | None] | None = None
        self._statuses: Any = None
        self._watch = watch
        self._is_matched = False  # whether anyone subscribed at the last check
        self._polls = 0
        # set by the next message; there once `poll_wanted` was called
        self._next: threading.Event | None = None

    @property
    def matched(self) -> bool:
        """Whether anyone subscribes to this key. Raises BusError once it, or the bus, is closed."""
        with self.unless_closed():
            return bool(self._publisher.matching_status.matching)

    def poll_wanted(self) -> bool:
        """Look whether anyone subscribes, or a get waits. The caller may leave out messages that
        are not wanted: from the first poll on, a get is answered with the next message.
        """
        if self._next is None:
            with self.unless_closed():
                listener = self._watch()
            self._next = threading.Event()
            self.ends.append(listener)
            self._statuses = listener.handler
        self._polls += 1
        # A subscriber that has left costs some messages that go nowhere; one that came is looked
        # for at each poll.
        if not self._is_matched or self._polls % MATCH_CHECK_EVERY == 0:
            status = self._statuses.try_recv()
            if status is not None:
                self._is_matched = status.matching
        return self._is_matched or not self._next.is_set()

    def put_bytes(
        self,
        payload: bytes,
        encoding: str | None = None,
        waited: float = 0.0,
        echoed: bytes | None = None,
    ) -> None:
        """Send an encoded payload, by default in the encoding of this publisher. Raises BusError
        once it, or the bus, is closed.

        A command goes with the echoes of its receivers' beats, less the seconds that it has
        `waited` since it was made; or with those that its maker has `echoed`, as from
        `Echoes.attached`. A motion without any is refused by a robot that beats: ask
        `Echoes.may_command` first.
        """
        self._last = payload, encoding
        if self.echoes is None:
            attachment = self._stamp()
        else:
            if echoed is None:
                echoed = self.echoes.vouched(waited) if waited else self.echoes.attached()
            attachment = self._stamp(echoed)
            if self._sign:
                attachment = self._sign(attachment, str(encoding or self._encoding), payload)
        try:  # `unless_closed` would take longer
            if encoding:
                self._put(payload, encoding=encoding, attachment=attachment)
            else:  # to pass a None takes Zenoh a fifth longer
                self._put(payload, attachment=attachment)
        except Exception:
            with self.unless_closed():
                raise
        if self._next is not None and not self._next.is_set():
            self._next.set()

    def put_plain(self, payload: bytes) -> None:
        """Send a command as a foreign program does, with a name alone: it counts for 0.5 s from its
        arrival. In the secure set-up it is signed as any other.
        """
        if self._sign:
            return self.put_bytes(payload)
        self._last = payload, None
        with self.unless_closed():
            self._put(payload, attachment=self._stamp().partition(b";")[0])
        return None

    def leave_to_parent(self, refuse: Callable[..., Any]) -> None:
        """Send no more."""
        self._put = self._stamp = refuse

    def want(self) -> None:
        """Let the next message be sent also without subscribers: a get waits for it."""
        if self._next is not None:
            self._next.clear()

    def reply(self, query: Any, deadline: float) -> None:
        """Answer a get with the last message; after `want`, wait for the next until `deadline` (s,
        monotonic).
        """
        if self._next is not None:
            self._next.wait(max(0.0, deadline - time.monotonic()))
        if self._last is not None:
            payload, encoding = self._last
            query.reply(self.key, payload, encoding=encoding or self._encoding)

    def close(self) -> None:
        """Stop publishing and answering; all declarations are removed."""
        super().close()
        if self.gets:
            self.gets.remove(self)
        if self.echoes:
            self.echoes.close()


class Publisher(RawPublisher, Generic[M]):
    """Writes messages, in the encoding of its `wire`. Those in `queued` wait for `Bus.send_queued`.
    Made by `Bus.publisher`.
    """

    def __init__(
        self,
        kind: type[M],
        wire: str,
        queued: list[tuple[RawPublisher, bytes, str | None]],
        *declared: Any,
    ) -> None:
        from holozen.messages import codec

        super().__init__(*declared)
        self._kind = kind
        # A command that nobody can read would leave the robot to its watchdog.
        self._write = codec.writer(kind, wire, checks=is_command(str(self.key), (kind.ROS,)))
        self._queued = queued

    def put(self, message: M, waited: float = 0.0, echoed: bytes | None = None) -> None:
        """Send one message. With a number that is not finite it raises codec.CodecError, or is sent
        as CDR, depending on its type; a command with a value of a wrong type raises it too. Raises
        TypeError for a message of another type, and BusError once it, or the bus, is closed.

        A command moves a robot only with an echo of its beat, see beat.py. So as long as a robot is
        there of which no beat has come, motions are not sent, which is reported. `waited`: the
        seconds since the command was made.
        """
        if not isinstance(message, self._kind):
            raise self._mistaken(message)
        written = self._write(message)
        if (
            not self.echoes
            or (self.echoes.was_heard if echoed is None else echoed)
            or stops(message, self._kind.ROS)
            or self.echoes.may_command()
        ):
            self.put_bytes(*written, waited, echoed)

    def queue(self, message: M) -> None:
        """As `put`, but `Bus.send_queued` sends it: many messages that are sent at once take Zenoh
        less time.
        """
        if not isinstance(message, self._kind):
            raise self._mistaken(message)
        self._queued.append((self, *self._write(message)))

    def _mistaken(self, message: object) -> TypeError:
        from holozen.suggest import article

        given = article(type(message).__name__)
        return TypeError(f"{self.key}: {given}, but this publisher sends {self._kind.__name__}")


class Gets(Answers):
    """Answers each get on a key expression with the last messages of some publishers there, from
    one thread.
    """

    def __init__(self, queryable: Any) -> None:
        self._publishers = set[RawPublisher]()
        self._lock = threading.Lock()
        super().__init__(queryable, self._reply)

    def add(self, publisher: RawPublisher) -> bool:
        """Answer for this publisher too; returns whether it can: it ended with the last one that
        was removed.
        """
        with self._lock:
            if self.ends:
                self._publishers.add(publisher)
            return bool(self.ends)

    def remove(self, publisher: RawPublisher) -> None:
        """Answer for a publisher no longer."""
        with self._lock:
            self._publishers.discard(publisher)
            if not self._publishers:
                self.close()

    def _reply(self, query: Any) -> None:
        with self._lock:
            asked = [one for one in self._publishers if query.key_expr.intersects(one.key)]
        for publisher in asked:
            publisher.want()
        deadline = time.monotonic() + GET_PATIENCE
        for publisher in asked:
            publisher.reply(query, deadline)


class Received(Sample, Generic[M]):
    """A sample with its `message`, or with the reason in one line why it has none, its `error`."""

    __slots__ = ()

    message: M | None


class Subscription(Generic[M]):
    """Messages in order of arrival; if too many wait, the oldest are dropped.

    `decode` makes a message of a sample, or raises CodecError. `refusal` returns why a sample is
    not read, or "".
    """

    def __init__(
        self,
        samples: RawSubscriber,
        decode: Callable[[Sample], M],
        refusal: Callable[[Sample], str] | None = None,
    ) -> None:
        self.raw, self._decode, self._refusal = samples, decode, refusal

    def try_recv(self) -> Received[M] | None:
        """The next waiting message, or None. Raises BusError once the bus is closed."""
        with self.raw.unless_closed():
            sample = self.raw.channel.try_recv()
        return None if sample is None else self._received(sample)

    def waiting(self, first: Any) -> list[Received[M]]:
        """The messages that wait, after the sample `first` of `raw.channel`; None: nothing
        waited.
        """
        samples = [] if first is None else [first, *iter(self.raw.channel.try_recv, None)]
        return [self._received(sample) for sample in samples]

    def recv(self) -> Received[M]:
        """The next message; waits for it. Raises BusError once the bus is closed."""
        return self._received(self.raw.wait())

    def close(self) -> None:
        """Stop listening."""
        self.raw.close()

    def _received(self, sample: Any) -> Received[M]:
        received: Received[M] = Received(sample, self.raw.limit)
        if received.oversize:
            received.error = f"oversized: {received.size} bytes"
        elif self._refusal and (reason := self._refusal(received)):
            received.error = reason
        else:
            try:
                received.message = self._decode(received)
            except CodecError as error:
                received.error = str(error)
        return received


class Arrivals(Generic[M]):
    """The newest message of a stream, its time of arrival, and the period. Times in seconds."""

    def __init__(self) -> None:
        self.newest: M | None = None
        self.count = 0
        self._at: float | None = None  # when the newest arrived
        self._gaps = (0.0, 0.0)  # the last two, to ignore a single hiccup

    def record(self, message: M, now: float) -> None:
        """Record a message."""
        gap = 0.0 if self._at is None else now - self._at
        self._gaps = (self._gaps[1], gap)
        self.newest = message
        self._at = now
        self.count += 1

    def age(self, now: float) -> float:
        """Seconds since the newest arrived; infinite before the first."""
        return math.inf if self._at is None else now - self._at

    def patience(self, silence: float) -> float:
        """The age from which the newest is stale: `silence`, or three periods of a stream that is
        slower than that.
        """
        return max(silence, min(3 * min(self._gaps), SLOWEST))


class Latest(Generic[M]):
    """The newest message of a key and when it arrived, kept by a dedicated thread."""

    def __init__(self, subscription: Subscription[M]) -> None:
        self._subscription, self.raw = subscription, subscription.raw
        # Ctrl-C just after a Condition has taken its lock would leave it locked
        self._lock = threading.Lock()
        self._newer = threading.Condition(self._lock)
        self._arrivals: Arrivals[M] = Arrivals()
        self.error = ""  # why the newest of the samples that cannot be decoded cannot
        threading.Thread(target=self._keep, daemon=True).start()

    @property
    def count(self) -> int:
        """The number of messages so far."""
        return self._arrivals.count

    def read(self) -> tuple[M | None, float]:
        """The newest message (None before the first; `error` may say why) and its age in seconds
        since it arrived.
        """
        with self._lock:
            return self._arrivals.newest, self._arrivals.age(time.monotonic())

    def patience(self, silence: float) -> float:
        """The age from which the newest is stale, see Arrivals."""
        with self._lock:
            return self._arrivals.patience(silence)

    def wait(self, after: int, timeout: float) -> bool:
        """Wait until more than `after` messages have arrived, at most `timeout` seconds; returns
        whether they have.
        """
        with self._lock:
            return self._newer.wait_for(lambda: self.count > after, timeout)

    def close(self) -> None:
        """Stop listening."""
        self._subscription.close()

    def _keep(self) -> None:
        for received in until_closed(self._subscription.recv):
            with self._lock:
                if received.message is None:
                    self.error = printable(f"{received.key}: {received.error}")
                    continue
                self._arrivals.record(received.message, time.monotonic())
                self._newer.notify_all()
