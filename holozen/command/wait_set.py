"""Which of many keys have something to read."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple


class Moment(NamedTuple):
    """When keys are read. What waits there came at or after `since`; its stamps may be measured by any of `clocks`. All
    in seconds.
    """

    now: float
    since: float
    clocks: tuple[float, ...]


class Reader(NamedTuple):
    """`listen` takes the first sample or request that waits at a key, or returns None. `read` processes it, if there is
    one, and all others; it returns whether it has to be called again even if nothing more arrives.
    """

    listen: Callable[[], Any]
    read: Callable[[Any, Moment], bool]


class WaitSet:
    """The readers of many keys, of which few have anything to read at a time.

    Each key has a ring of its own, so that a flood at one pushes nothing out of another.
    """

    def __init__(self) -> None:
        self._readers: list[Reader] = []
        self._listens: list[Callable[[], Any]] = []  # theirs, apart: hundreds are called every few milliseconds
        self._unfinished: list[Reader] = []

    def add(self, readers: Iterable[Reader]) -> None:
        """Read these from now on."""
        self._set([*self._readers, *readers])

    def remove(self, readers: Iterable[Reader]) -> None:
        """Read these no longer."""
        gone = set(readers)
        self._set([reader for reader in self._readers if reader not in gone])
        self._unfinished = [reader for reader in self._unfinished if reader not in gone]

    def _set(self, readers: list[Reader]) -> None:
        self._readers, self._listens = readers, [reader.listen for reader in readers]

    def read(self, moment: Moment) -> None:
        """Read what waits, in the order of the readers. Each is read as it is found: a request may depend on another
        that arrives in between.
        """
        self._unfinished = [reader for reader in self._unfinished if reader.read(None, moment)]
        for index, listen in enumerate(self._listens):
            if (first := listen()) is not None:
                reader = self._readers[index]
                if reader.read(first, moment) and reader not in self._unfinished:
                    self._unfinished.append(reader)
