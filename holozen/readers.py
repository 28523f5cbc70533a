"""Readers of a key: all waiting messages (`Subscription`), or the newest with its age (`Latest`)."""

import math
import threading
import time
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from holozen.errors import BusError

if TYPE_CHECKING:
    from holozen.messages import Message

M = TypeVar("M", bound="Message")

PRIORITIES = ("REAL_TIME", "INTERACTIVE_HIGH", "INTERACTIVE_LOW", "DATA_HIGH", "DATA", "DATA_LOW", "BACKGROUND")
"""Zenoh's priorities, the strongest first; Zenoh counts them from 1."""

SLOWEST = 5.0  # s; nothing is waited for longer than this before it is called stale


class Sample:
    """What arrived. `payload` is empty where `size`, in bytes, is over the reader's limit (0: there is none).

    Most readers want no more than the payload, so the rest is looked up in Zenoh's sample when it is asked for.
    """

    __slots__ = ("_sample", "encoding", "payload", "size")

    def __init__(self, sample: Any, limit: int = 0) -> None:
        payload = sample.payload
        self._sample, self.encoding, self.size = sample, str(sample.encoding), len(payload)
        self.payload = b"" if limit and self.size > limit else bytes(payload)

    @property
    def key(self) -> str:
        """The key it came on."""
        return str(self._sample.key_expr)

    @property
    def priority(self) -> str:
        """The name of its Zenoh priority."""
        return PRIORITIES[int(self._sample.priority) - 1]

    @property
    def source(self) -> str:
        """Who says to have sent it; empty if nobody does."""
        told = self._sample.attachment
        return bytes(told).decode(errors="replace")[:80] if told else ""


class Tap:
    """Raw samples, the newest of them if there were too many to read."""

    def __init__(self, subscriber: Any, limit: int = 0) -> None:
        # Reading from the handler leaves the subscriber free to be undeclared meanwhile.
        self.ends = [subscriber]  # what stands on the wire for this reader
        self._samples, self._limit = subscriber.handler, limit
        self.thread: threading.Thread | None = None  # the one that waits in `recv`

    def try_recv(self) -> Sample | None:
        """The next waiting sample, or None."""
        sample = self._samples.try_recv()
        return sample and Sample(sample, self._limit)

    def recv(self) -> Sample:
        """The next sample; waits for it. Raises BusError once the bus or this tap is closed."""
        self.thread = threading.current_thread()
        try:
            sample = self._samples.recv()
        except Exception:  # zenoh's own error type, which only bus.py may name: the session is closed
            raise BusError("closed") from None
        return Sample(sample, self._limit)

    def close(self) -> None:
        """Stop listening."""
        for end in self.ends:
            end.undeclare()


class Received(NamedTuple, Generic[M]):
    """A sample with its message, or with the one line that says why it has none."""

    sample: Sample
    message: M | None
    error: str = ""


class Subscription(Generic[M]):
    """Messages in the order they came, the newest of them if there were too many."""

    def __init__(self, samples: Tap, kinds: tuple[type[M], ...]) -> None:
        from holozen import codec

        self.tap, self._kinds = samples, kinds
        self._decode, self._error = codec.decode, codec.CodecError

    def try_recv(self) -> Received[M] | None:
        """The next waiting message, or None."""
        sample = self.tap.try_recv()
        return None if sample is None else self._received(sample)

    def recv(self) -> Received[M]:
        """The next message; waits for it. Raises BusError once the bus is closed."""
        return self._received(self.tap.recv())

    def close(self) -> None:
        """Stop listening."""
        self.tap.close()

    def _received(self, sample: Sample) -> Received[M]:
        if len(sample.payload) != sample.size:
            return Received(sample, None, f"oversized: {sample.size} bytes")
        try:
            return Received(sample, self._decode(sample.payload, sample.encoding, self._kinds))
        except self._error as error:
            return Received(sample, None, str(error))


class Arrivals(Generic[M]):
    """The newest of a stream of messages, when it came, and how often they come. Times in seconds."""

    def __init__(self) -> None:
        self.newest: M | None = None
        self.count = 0
        self._at = -math.inf
        self._gaps = (0.0, 0.0)  # the last two; one hiccup is no rate

    def see(self, message: M, now: float) -> None:
        """A message came."""
        self._gaps = (self._gaps[1], now - self._at if self.count else 0.0)
        self.newest, self._at = message, now
        self.count += 1

    def age(self, now: float) -> float:
        """Seconds since the newest came; infinite before the first."""
        return now - self._at

    def patience(self, silence: float) -> float:
        """The age from which the newest is stale: `silence`, or three periods of a stream that is slower than that."""
        return max(silence, min(3 * min(self._gaps), SLOWEST))


class Latest(Generic[M]):
    """The newest message of a key and when it arrived, kept by a thread that does nothing else."""

    def __init__(self, subscription: Subscription[M]) -> None:
        self._subscription = subscription
        self._newer = threading.Condition()
        self._arrivals: Arrivals[M] = Arrivals()
        self.bad = 0  # samples that were no such message
        threading.Thread(target=self._keep, daemon=True).start()

    @property
    def count(self) -> int:
        """How many messages have come."""
        return self._arrivals.count

    def read(self) -> tuple[M | None, float]:
        """The newest message (None before the first) and its age in seconds since it arrived."""
        with self._newer:
            return self._arrivals.newest, self._arrivals.age(time.monotonic())

    def patience(self, silence: float) -> float:
        """The age from which the newest is stale, see Arrivals."""
        with self._newer:
            return self._arrivals.patience(silence)

    def wait(self, after: int, timeout: float) -> bool:
        """Wait until more than `after` messages have come, at most `timeout` seconds; whether they have."""
        with self._newer:
            return self._newer.wait_for(lambda: self.count > after, timeout)

    def close(self) -> None:
        """Stop listening."""
        self._subscription.close()

    def _keep(self) -> None:
        while True:
            try:
                received: Received[Any] = self._subscription.recv()
            except BusError:
                return
            with self._newer:
                if received.message is None:
                    self.bad += 1
                    continue
                self._arrivals.see(received.message, time.monotonic())
                self._newer.notify_all()
