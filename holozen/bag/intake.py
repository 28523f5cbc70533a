"""Takes samples in as fast as they come, for one who writes them when he can."""

import threading
import time
from collections import deque
from typing import NamedTuple, Self

from holozen.tap import Sample, Tap

DEPTH = 8192  # samples that a tap holds while its thread waits for its turn
ROOM = 256 << 20  # bytes that may wait for the writer, so that a slow disk does not take all memory
PUBLISHERS = 65_536  # whose numbers are remembered
LARGEST = 128 << 20  # bytes of a sample; a bag with larger ones would not be read again
BATCH = 1000  # samples
OVERHEAD = 300  # bytes that a waiting sample takes besides its payload
PATIENCE = 0.5  # s


class Waiting(NamedTuple):
    """A sample that is not written yet. `at`: when it came, in ns since 1970; `number`: its publisher counts, or -1."""

    at: int
    key: str
    payload: bytes
    encoding: str
    number: int = -1


class Intake:
    """Samples of several taps, in the order they came. What finds no room is dropped and counted.

    Use it in `with`, inside that of the bus.
    """

    def __init__(self, room: int = ROOM) -> None:
        self.received = self.dropped = 0
        self.lost = 0  # samples that never came, by the numbers that publishers give them
        self._numbers: dict[str, int] = {}  # the last one of each publisher
        self._room, self._held = room, 0
        self._waiting: deque[Waiting] = deque()
        self._lock = threading.Lock()
        self._listeners: list[_Listener] = []
        # The clock of the day may be set meanwhile; the times in a bag never go back.
        self._epoch = time.time_ns() - time.monotonic_ns()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    @property
    def overran(self) -> int:
        """How often a tap was full, so that it may have pushed out samples that nobody saw."""
        return sum(listener.overran for listener in self._listeners)

    def listen(self, tap: Tap) -> None:
        """Take what comes from `tap`, which is `DEPTH` deep."""
        self._listeners.append(_Listener(self, tap))

    def take(self) -> list[Waiting]:
        """The next samples to write, the oldest first; at most BATCH."""
        with self._lock:
            batch = [self._waiting.popleft() for _ in range(min(BATCH, len(self._waiting)))]
            self._held -= sum(len(sample.payload) + OVERHEAD for sample in batch)
        return batch

    def drop(self, count: int) -> None:
        """Samples that were taken could not be written."""
        with self._lock:
            self.dropped += count

    def close(self) -> None:
        """Stop listening. What came before is still there to take."""
        for listener in self._listeners:
            listener.close()

    def add(self, key: str, payload: bytes, encoding: str, number: tuple[str, int] | None = None) -> None:
        """A sample came. `number`: its publisher, and which of the publisher's samples it is."""
        size = len(payload) + OVERHEAD
        with self._lock:
            self.received += 1
            if number:
                self._count(*number)
            if self._held + size > self._room or size > LARGEST:
                self.dropped += 1
                return
            self._held += size
            at = self._epoch + time.monotonic_ns()
            self._waiting.append(Waiting(at, key, payload, encoding, number[1] if number else -1))

    def _count(self, publisher: str, number: int) -> None:
        if len(self._numbers) >= PUBLISHERS:
            self._numbers.clear()
        self.lost += max(0, number - self._numbers.get(publisher, number - 1) - 1)
        self._numbers[publisher] = number


class _Listener:
    """The thread that reads one tap."""

    def __init__(self, intake: Intake, tap: Tap) -> None:
        self.overran = 0
        self._intake, self._tap = intake, tap
        self._idle = self._closing = False
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """A tap loses what is in it when it is closed, so wait for the moment when it is empty."""
        if self._closing:
            return
        deadline = time.monotonic() + PATIENCE
        while not self._idle and self._thread.is_alive() and time.monotonic() < deadline:
            time.sleep(0.0005)
        self._closing = True
        self._tap.close()
        self._thread.join(PATIENCE)

    def _listen(self) -> None:
        in_a_row = 0
        try:
            while True:
                waiting = self._tap.try_recv()
                in_a_row = in_a_row + 1 if waiting else 1
                if in_a_row == DEPTH:
                    self.overran, in_a_row = self.overran + 1, 0
                self._add(waiting or self._wait())
        except Exception:  # what a closed tap raises; anything else is no end to be quiet about
            if not self._closing:
                raise

    def _wait(self) -> Sample:
        self._idle = True
        sample = self._tap.recv()
        self._idle = False
        return sample

    def _add(self, sample: Sample) -> None:
        self._intake.add(sample.key, sample.payload, sample.encoding, sample.number)
