"""What publishers sent before a TRANSIENT_LOCAL subscription was there."""

import threading
from collections import deque

from holozen.bus import Bus
from holozen.errors import BusError
from holozen.ros.inbox import Waker
from holozen.tap import Sample

PATIENCE = 1.0  # s for the publishers to answer
AGAIN = (0.0, 0.03, 0.1, 0.5)  # s between the questions after somebody came; the way to him may be longer than news
KEPT = 100  # messages of which it is known that they came, by their hashes: a map may have megabytes


class Latched:
    """Asks the publishers of a key for their last message: those that are there, and each that comes later.

    One that comes later may have published before anybody read it. What came the usual way is not given twice.
    """

    def __init__(self, bus: Bus, key: str) -> None:
        self._bus, self._key = bus, key
        self._late: deque[Sample] = deque(maxlen=KEPT)
        self._seen: deque[int] = deque(maxlen=KEPT)
        self._waker = Waker()
        self._closed = threading.Event()
        self._writers = bus.writers(key)
        self._writers.thread = threading.Thread(target=self._keep_asking, daemon=True)  # which the bus waits for
        self._writers.thread.start()

    def saw(self, sample: Sample) -> Sample:
        """The sample, which is known from now on."""
        self._seen.append(hash(sample.payload))
        return sample

    def take(self) -> Sample | None:
        """The next that is not known, or None."""
        while self._late:
            sample = self._late.popleft()
            if hash(sample.payload) not in self._seen:
                return self.saw(sample)
        return None

    def arm(self, waker: Waker) -> None:
        """Wake `waker` for the next one."""
        self._waker = waker

    def silence(self) -> None:
        """Let the thread end with the bus."""
        self._closed.set()

    def close(self) -> None:
        """Ask no more."""
        self.silence()
        self._bus.drop(self._writers)

    def _keep_asking(self) -> None:
        try:
            while not self._closed.is_set():
                for pause in AGAIN:
                    self._closed.wait(pause)
                    self._ask()
                self._writers.recv()
        except BusError:
            return

    def _ask(self) -> None:
        for reply in self._bus.ask_all(self._key, PATIENCE):
            if isinstance(reply, Sample):
                self._late.append(reply)
                self._waker.wake()
