"""Shards: several sims on one bus that share the robots by name, each on a core or a machine of its
own.

A hash of its name assigns each robot to one shard, so that two shards never have the same name. A
shard is a node with a name such as `sim_2_of_3`.
"""

import argparse
import re
import time
import zlib
from collections.abc import Callable, Collection, Iterable

from msgspec import Struct

from holozen.bus import Bus
from holozen.flags import refused
from holozen.transport.connection import Connection
from holozen.transport.errors import BusError, Elsewhere
from holozen.transport.graph import Endpoint
from holozen.transport.node import Node

MAX_SHARDS = 64  # shards
AUTO = 0  # the number that stands for any free one
TRIES = 20  # to take a number, while others that start at the same time take the same one
SCAN = 1.0  # s between two scans of all tokens for other shards
_NODE = re.compile(r"sim_(\d{1,2})_of_(\d{1,2})")


class Shard(Struct, frozen=True):
    """One of `count` sims; `number` is from 1 to `count`."""

    number: int
    count: int

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @property
    def node(self) -> str:
        """The node name of this shard."""
        return f"sim_{self.number}_of_{self.count}"

    def owner(self, name: str) -> "Shard":
        """The shard that the entity with a name belongs to."""
        return Shard(zlib.crc32(name.encode()) % self.count + 1, self.count)

    def owns(self, name: str) -> bool:
        """Whether the entity with a name belongs to this shard."""
        return self.owner(name) == self


def shard(text: str) -> Shard:
    """The value of `--shard`, for argparse."""
    number, _, count = text.partition("/")
    if (number != "auto" and not number.isdecimal()) or not count.isdecimal():
        raise refused(f"{text!r} is no shard; give K/N, such as 1/3, or auto/3 for any free number")
    made = Shard(AUTO if number == "auto" else int(number), int(count))
    if not 1 <= made.count <= MAX_SHARDS or not (
        number == "auto" or 1 <= made.number <= made.count
    ):
        raise refused(f"{text!r}: give K/N with K from 1 to N and N up to {MAX_SHARDS}")
    return made


def shards_of(endpoints: Iterable[Endpoint]) -> dict[Shard, list[str]]:
    """The shards among all nodes, and the sessions of each."""
    found: dict[Shard, list[str]] = {}
    for end in endpoints:
        if end.kind == "node" and (match := _NODE.fullmatch(end.node)):
            found.setdefault(Shard(int(match[1]), int(match[2])), []).append(end.session)
    return found


def is_shard(node: str) -> bool:
    """Whether a node's name is that of a shard."""
    return bool(_NODE.fullmatch(node))


def claim(
    wanted: Shard, connection: Connection, open_bus: Callable[[str], Bus]
) -> tuple[Shard, Bus]:
    """Take a number, and open the bus as the node of that shard. Raises BusError if it is taken, or
    none is free.
    """
    for _ in range(TRIES):
        with Node("sim", connection) as node:
            mine = _free(wanted, shards_of(node.endpoints()))
        bus = open_bus(mine.node)
        try:
            rivals = shards_of(bus.endpoints()).get(mine, [])
        except BaseException:
            bus.close()
            raise
        if min([bus.id, *rivals]) == bus.id:
            return mine, bus
        bus.close()
        if wanted.number != AUTO:
            raise BusError(
                f"shard {mine} runs already ({min(rivals)[:6]}); take another: --shard "
                f"auto/{mine.count}"
            )
    raise BusError(
        f"no free shard of {wanted.count} was found in {TRIES} tries; start this one again"
    )


def _free(wanted: Shard, running: Collection[Shard]) -> Shard:
    if other := next((one for one in running if one.count != wanted.count), None):
        raise BusError(
            f"shard {other} runs here: all shards have the same N; use --shard auto/{other.count}"
        )
    if wanted.number == AUTO:
        free = (Shard(number, wanted.count) for number in range(1, wanted.count + 1))
        if not (mine := next((one for one in free if one not in running), None)):
            raise BusError(
                f"all {wanted.count} shards run already; end them all before you start more of them"
            )
        return mine
    if wanted in running:
        raise BusError(f"shard {wanted} runs already; take another: --shard auto/{wanted.count}")
    return wanted


class Share:
    """Which entities belong to this shard, and which to the others."""

    def __init__(self, mine: Shard, bus: Bus) -> None:
        self.mine, self._bus = mine, bus
        self._graph = bus.graph("@holozen/*/*/node")
        self._running: Collection[Shard] = ()
        self._scanned = -SCAN

    def refusal(self, name: str) -> str:
        """Why no running shard has the entity with a name; empty if it belongs to this one. Raises
        Elsewhere if it belongs to another one that runs.
        """
        owner = self.mine.owner(name)
        if owner == self.mine:
            return ""
        if (now := time.monotonic()) - self._scanned >= SCAN or owner not in self._running:
            self._running, self._scanned = shards_of(self._graph.endpoints()), now
        if owner in self._running:
            raise Elsewhere
        return (
            f"{name[:80]!r} belongs to shard {owner}, which does not run; start it: holozen "
            f"sim --shard {owner}"
        )


def add_argument(parser: argparse.ArgumentParser) -> None:
    """Add the flag `--shard`."""
    parser.add_argument(
        "--shard",
        type=shard,
        metavar="K/N",
        help="be the K-th of N sims that share the robots by name; auto/N: any that is free",
    )
