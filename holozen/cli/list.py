"""`holozen list`: the robots and objects in the running sim, and where they are."""

import argparse
import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from holozen import connection
from holozen.bus import Bus
from holozen.errors import NoReply, ServiceError
from holozen.flags import Parser
from holozen.tell import printable, say

if TYPE_CHECKING:
    from holozen.messages import Pose


TILTED = 5.0  # degrees; less is a robot on a slope, or one that balances


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen list",
        description="Show the robots and objects in the sim.",
        epilog="example: holozen list --json",
    )
    parser.add_argument("--json", action="store_true", help="name and pose as one JSON object a line")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    with Bus("list", connection.from_arguments(args), patience=3.0) as bus:
        found = list(_entities(bus))
    if args.json:
        from msgspec import to_builtins

        for name, pose in found:
            print(json.dumps({"name": name, "pose": to_builtins(pose)}))
        return 0
    width = max((len(name) for name, _ in found), default=0)
    for name, pose in found:
        print(printable(f"{name:<{width}}  {_where(pose)}"))
    if not found:
        say("the world is empty; holozen spawn FILE --name NAME puts a robot there")
    return 0


def _where(pose: "Pose") -> str:
    at, yaw = pose.position, math.degrees(pose.orientation.yaw())
    x, y, z, turn = (round(value, 3) + 0.0 for value in (at.x, at.y, at.z, yaw))  # + 0.0: a -0 is 0 for people
    return f"x {x:.3f}  y {y:.3f}  z {z:.3f} m  yaw {turn:.1f} deg{_lean(pose)}"


def _lean(pose: "Pose") -> str:
    """By how much it is tilted, where one would see it."""
    q = pose.orientation
    up = 1 - 2 * (q.x * q.x + q.y * q.y)  # the z part of its z axis
    lean = math.degrees(math.acos(max(-1.0, min(1.0, up))))
    return f"  tilted by {lean:.0f} deg" if lean > TILTED else ""


def _entities(bus: Bus) -> "Iterator[tuple[str, Pose]]":
    from holozen import entities

    for name in entities.names(bus):
        try:
            yield name, entities.pose(bus, name)
        except NoReply:
            raise
        except ServiceError:  # it was deleted meanwhile
            continue
