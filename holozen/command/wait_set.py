"""Which of many keys have something to read, and since when it may have waited."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from holozen.transport.samples import Dealer, Ring

STALL = 0.1  # s without reading; commands may have waited this long
DISTRUST = 0.1  # s after a stall in which the network's buffers may still bring old commands


class ReadTimes:
    """Tells since when the commands that wait may have arrived, by the times at which commands were
    read. Reading begins at `now` (s).
    """

    def __init__(self, now: float) -> None:
        self._last = self._before_stall = now
        self._trusted_from = 0.0

    def since(self, now: float) -> float:
        """Record that commands are read at `now` (s). Returns the earliest time at which they can
        have arrived.
        """
        if now - self._last > STALL:
            self._before_stall, self._trusted_from = self._last, now + DISTRUST
        since = self._last if now >= self._trusted_from else self._before_stall
        self._last = now
        return since


class Moment(NamedTuple):
    """The time `now` at which keys are read. What waits there arrived at or after `since`; a stamp
    in its header may be of any of the `clocks`, given by their present times. All in s.
    """

    now: float
    since: float
    clocks: tuple[float, ...]


class Reader(NamedTuple):
    """Reads a `channel`: Zenoh's, or a Ring. `read` is called with the first sample or request that
    waits there, or None, and processes it with all others. It returns whether it has to be called
    again even if nothing more arrives.
    """

    channel: Any
    read: Callable[[Any, Moment], bool]


class WaitSet:
    """The readers of many keys, few of which have anything to read at a time."""

    def __init__(self) -> None:
        self._polled: list[Reader] = []
        self._dealt: dict[Ring, Reader] = {}
        self._dealers: dict[Dealer, None] = {}
        self._unfinished: list[Reader] = []

    def add(self, readers: Iterable[Reader]) -> None:
        """Add readers."""
        for reader in readers:
            if isinstance(reader.channel, Ring):
                self._dealt[reader.channel] = reader
                self._dealers[reader.channel.dealer] = None
            else:
                self._polled.append(reader)

    def remove(self, readers: Iterable[Reader]) -> None:
        """Remove readers."""
        gone = {id(reader.channel) for reader in readers}
        self._polled = [reader for reader in self._polled if id(reader.channel) not in gone]
        self._dealt = {ring: reader for ring, reader in self._dealt.items() if id(ring) not in gone}
        self._dealers = dict.fromkeys(ring.dealer for ring in self._dealt)
        self._unfinished = [reader for reader in self._unfinished if id(reader.channel) not in gone]

    def read(self, moment: Moment) -> None:
        """Read what waits, in the order in which the keys were added. A key is read as soon as it
        is found to have something, since a request may depend on another one that arrives
        meanwhile.
        """
        self._unfinished = [reader for reader in self._unfinished if reader.read(None, moment)]
        for dealer in list(self._dealers):
            dealer.deal()
            for ring in [ring for ring in dealer.ready if ring in self._dealt]:
                del dealer.ready[ring]
                self._read(self._dealt[ring], moment)
        for reader in self._polled:
            self._read(reader, moment)

    def _read(self, reader: Reader, moment: Moment) -> None:
        first = reader.channel.try_recv()
        if first is not None and reader.read(first, moment) and reader not in self._unfinished:
            self._unfinished.append(reader)
