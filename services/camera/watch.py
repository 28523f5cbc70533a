"""Which camera's picture is rendered, for the process that starts the renderer again if that ends
it.
"""

import mmap
import signal
from collections.abc import Iterator
from contextlib import contextmanager

MAX_PICTURE_TIME = 5.0  # s of processor time for a picture; of full HD it takes about one
END = b"\0"


class Watch:
    """A note in memory that processes share, and the cameras that are dropped."""

    def __init__(self, note: mmap.mmap | None = None) -> None:
        self._note = note
        self.dropped = set[str]()

    @property
    def name(self) -> str:
        """The camera whose picture is rendered; empty between two pictures."""
        return self._note[:].partition(END)[0].decode() if self._note else ""

    def drop(self) -> None:
        """Drop the camera whose picture is rendered."""
        self.dropped.add(self.name)
        self._write("")

    @contextmanager
    def picture(self, name: str) -> Iterator[None]:
        """Note a camera's name while a picture is rendered. If that takes MAX_PICTURE_TIME, SIGPROF
        ends this process, whatever its C code does.
        """
        if self._note is None:
            yield
            return
        self._write(name)
        signal.setitimer(signal.ITIMER_PROF, MAX_PICTURE_TIME)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
            self._write("")

    def _write(self, name: str) -> None:
        assert self._note is not None
        data = name.encode()[: len(self._note) - 1] + END
        self._note[: len(data)] = data
