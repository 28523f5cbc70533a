"""Readers of a key: all waiting messages (`Subscription`), or the newest with its age (`Latest`)."""

import threading
import time
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar

from holozen.errors import BusError

if TYPE_CHECKING:
    from holozen.messages import Message

M = TypeVar("M", bound="Message")

PRIORITIES = ("REAL_TIME", "INTERACTIVE_HIGH", "INTERACTIVE_LOW", "DATA_HIGH", "DATA", "DATA_LOW", "BACKGROUND")
"""Zenoh's priorities, the strongest first; Zenoh counts them from 1."""


class Sample(NamedTuple):
    """What arrived. `priority` is the Zenoh priority's name, `source` who says to have sent it, `size` in bytes.

    `payload` is empty where `size` is over the reader's limit.
    """

    key: str
    payload: bytes
    encoding: str
    priority: str
    source: str
    size: int

    @classmethod
    def of(cls, sample: Any, limit: int = 0) -> "Sample":
        """Zenoh's sample as ours. A payload over `limit` bytes is left out (0: none is)."""
        size = len(sample.payload)
        return cls(
            key=str(sample.key_expr),
            payload=b"" if limit and size > limit else bytes(sample.payload),
            encoding=str(sample.encoding),
            priority=PRIORITIES[int(sample.priority) - 1],
            source=bytes(sample.attachment).decode(errors="replace")[:80] if sample.attachment else "",
            size=size,
        )


class Samples(Protocol):
    """A stream of samples, such as bus.Tap."""

    def try_recv(self) -> Sample | None: ...
    def recv(self) -> Sample: ...
    def close(self) -> None: ...


class Received(NamedTuple, Generic[M]):
    """A sample with its message, or with the one line that says why it has none."""

    sample: Sample
    message: M | None
    error: str = ""


class Subscription(Generic[M]):
    """Messages in the order they came, the newest of them if there were too many."""

    def __init__(self, samples: Samples, kinds: tuple[type[M], ...]) -> None:
        from holozen import codec

        self._samples, self._kinds = samples, kinds
        self._decode, self._error = codec.decode, codec.CodecError

    def try_recv(self) -> Received[M] | None:
        """The next waiting message, or None."""
        sample = self._samples.try_recv()
        return None if sample is None else self._received(sample)

    def recv(self) -> Received[M]:
        """The next message; waits for it. Raises BusError once the bus is closed."""
        return self._received(self._samples.recv())

    def close(self) -> None:
        """Stop listening."""
        self._samples.close()

    def _received(self, sample: Sample) -> Received[M]:
        if len(sample.payload) != sample.size:
            return Received(sample, None, f"oversized: {sample.size} bytes")
        try:
            return Received(sample, self._decode(sample.payload, sample.encoding, self._kinds))
        except self._error as error:
            return Received(sample, None, str(error))


class Latest(Generic[M]):
    """The newest message of a key and when it arrived, kept by a thread that does nothing else."""

    def __init__(self, subscription: Subscription[M]) -> None:
        self._subscription = subscription
        self._newer = threading.Condition()
        self._value: M | None = None
        self._arrived = -float("inf")
        self.count = 0  # messages since the start
        self.bad = 0  # samples that were no such message
        threading.Thread(target=self._keep, daemon=True).start()

    def read(self) -> tuple[M | None, float]:
        """The newest message (None before the first) and its age in seconds since it arrived."""
        with self._newer:
            return self._value, time.monotonic() - self._arrived

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
                self._value, self._arrived = received.message, time.monotonic()
                self.count += 1
                self._newer.notify_all()
