"""Which of many keys have something to read."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from holozen.transport.samples import Dealer, Ring


class Moment(NamedTuple):
    """When keys are read. What waits there came at or after `since`; its stamps may be measured by any of `clocks`. All
    in seconds.
    """

    now: float
    since: float
    clocks: tuple[float, ...]


class Reader(NamedTuple):
    """Of a `channel` of Zenoh, or a Ring. `read` processes the first sample or request that waits there, if there is
    one, and all others; it returns whether it has to be called again even if nothing more arrives.
    """

    channel: Any
    read: Callable[[Any, Moment], bool]


class WaitSet:
    """The readers of many keys, of which few have anything to read at a time."""

    def __init__(self) -> None:
        self._polled: list[Reader] = []
        self._dealt: dict[Ring, Reader] = {}
        self._dealers: dict[Dealer, None] = {}
        self._unfinished: list[Reader] = []

    def add(self, readers: Iterable[Reader]) -> None:
        """Read these from now on."""
        for reader in readers:
            if isinstance(reader.channel, Ring):
                self._dealt[reader.channel] = reader
                self._dealers[reader.channel.dealer] = None
            else:
                self._polled.append(reader)

    def remove(self, readers: Iterable[Reader]) -> None:
        """Read these no longer."""
        gone = {id(reader.channel) for reader in readers}
        self._polled = [reader for reader in self._polled if id(reader.channel) not in gone]
        self._dealt = {ring: reader for ring, reader in self._dealt.items() if id(ring) not in gone}
        self._dealers = dict.fromkeys(ring.dealer for ring in self._dealt)
        self._unfinished = [reader for reader in self._unfinished if id(reader.channel) not in gone]

    def read(self, moment: Moment) -> None:
        """Read what waits, in the order in which the keys were added. Each is read as it is found: a request may depend
        on another that arrives in between.
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
