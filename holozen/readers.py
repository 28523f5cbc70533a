"""Readers of a key: all waiting messages (`Subscription`), or the newest with its age (`Latest`)."""

import math
import threading
import time
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from holozen.errors import BusError
from holozen.tap import PRIORITIES, Sample, Tap

if TYPE_CHECKING:
    from holozen.messages import Message

__all__ = ["PRIORITIES", "Arrivals", "Latest", "Received", "Sample", "Subscription", "Tap"]

M = TypeVar("M", bound="Message")

SLOWEST = 5.0  # s; nothing is waited for longer than this before it is called stale


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
