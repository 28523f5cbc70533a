"""How a sim stands among those that run on its bus already."""

import argparse

from msgspec import Struct

from holozen.transport.errors import BusError
from holozen.transport.graph import Graph, on_key
from holozen.wire import key_for

from . import shard
from .shard import Shard

HOW = "holozen sim --join --robot FILE=NAME"
JOIN = f"end it, choose another --domain, or join it with named robots: {HOW}"


class Standing(Struct, frozen=True):
    """How a sim stands among those on its bus.

    Attributes:
        serves_world: Whether it publishes the clock and takes the requests about the world. One sim
            does.
        shard: Which share of the robots it simulates; None if it has all of its own.
        robot: The name of its first robot; empty if that has none.
    """

    serves_world: bool
    shard: Shard | None = None
    robot: str = ""

    @property
    def is_alone(self) -> bool:
        """Whether no other sim may run beside it unless that joins it."""
        return self.serves_world and self.shard is None

    @property
    def spawns(self) -> bool:
        """Whether it takes requests to spawn. A sim that joined another one does not."""
        return self.serves_world or self.shard is not None

    @property
    def parameter_node(self) -> str:
        """The node whose parameters are those of the sim."""
        return self.shard.node if self.shard else key_for("sim", self._namespace)

    @property
    def exposures_key(self) -> str:
        """The key of what its cameras expose."""
        shard_node = self.shard.node if self.shard and not self.serves_world else ""
        return key_for("exposures", shard_node or self._namespace)

    @property
    def _namespace(self) -> str:
        return "" if self.serves_world else self.robot


def standing(args: argparse.Namespace, mine: Shard | None, graph: Graph) -> Standing:
    """How the sim with these flags stands among those in the graph. Raises BusError if it cannot
    run beside them.
    """
    clocks = on_key(graph.endpoints(), "clock", "pub")
    other = next((end.source for end in clocks if not (mine and shard.is_shard(end.node))), None)
    if other:
        _check_joins(args, mine, other)
    serves_world = other is None and (mine is None or mine.number == 1)
    return Standing(serves_world, mine, args.robot[0][1] if args.robot else "")


def _check_joins(args: argparse.Namespace, mine: Shard | None, other: str) -> None:
    if mine:
        advice = "end it, or leave out --shard"
    elif not args.join:
        advice = JOIN
    elif not (args.robot and all(name for _, name in args.robot)):
        advice = f"name the robots: {HOW}"
    else:
        return
    raise BusError(f"{other} simulates here already; {advice}")
