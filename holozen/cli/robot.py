"""`holozen list` and `delete`: the robots and objects in the running sim."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from holozen.bus import Bus
from holozen.cli.verb import Verb, by_name, no_arguments, open_bus
from holozen.console import printable, report
from holozen.flags import refused
from holozen.process import deferred_interrupt
from holozen.transport.errors import NoReply, ServiceError

if TYPE_CHECKING:
    from holozen.messages import Pose

SIMS = "@holozen/*/*/srv/*/*/*/get_entities"  # the tokens of their services
TILTED = 5.0  # degrees; a robot on a slope or a balancing one has less


def list_entities(args: argparse.Namespace) -> int:
    """Print the name and the pose of each entity; nothing if the world is empty."""
    with open_bus(args) as bus:
        found = list(_entities(bus))
        sims = len(bus.endpoints(SIMS))
    if args.json:
        from msgspec import to_builtins

        for name, pose in found:
            print(json.dumps({"name": name, "pose": to_builtins(pose)}))
        return 0
    width = max((len(name) for name, _ in found), default=0)
    for name, pose in found:
        print(printable(f"{name:<{width}}  {_where(pose)}"))
    if sims > 1 and found:
        report(f"they are in {sims} sims; robots of different sims do not collide")
    if not found:
        report("the world is empty; holozen spawn FILE --name NAME puts a robot there")
    return 0


def _where(pose: Pose) -> str:
    at, yaw = pose.position, math.degrees(pose.orientation.yaw())
    x, y, z, turn = (round(value, 3) + 0.0 for value in (at.x, at.y, at.z, yaw))  # + 0.0: shows -0 as 0
    return f"x {x:.3f}  y {y:.3f}  z {z:.3f} m  yaw {turn:.1f} deg{_lean(pose)}"


def _lean(pose: Pose) -> str:
    """Its tilt, if it is visible."""
    q = pose.orientation
    up = 1 - 2 * (q.x * q.x + q.y * q.y)  # the z part of its z axis
    lean = math.degrees(math.acos(max(-1.0, min(1.0, up))))
    return f"  tilted by {lean:.0f} deg" if lean > TILTED else ""


def _entities(bus: Bus) -> Iterator[tuple[str, Pose]]:
    with deferred_interrupt():
        from holozen import entities

    def where(name: str) -> Pose | None:
        try:
            return entities.pose(bus, name)
        except NoReply:
            raise
        except ServiceError:  # it was deleted in the meantime
            return None

    names = entities.names(bus)
    yield from ((name, pose) for name, pose in zip(names, entities.for_each(where, names), strict=True) if pose)


def delete(args: argparse.Namespace) -> int:
    """Delete each entity from the sim; 1 if one could not be."""
    with deferred_interrupt():
        from holozen import entities

    failed = 0
    with open_bus(args) as bus:
        entities.names(bus)  # fails once if there is no sim
        for name in args.names:
            reason = ""
            try:
                entities.delete(bus, name)
            except ServiceError as error:
                report(f"holozen delete: {error}")
                failed, reason = 1, str(error)
            if args.json:
                print(json.dumps({"name": name, "deleted": not reason, "reason": reason}))
            elif not reason:
                print(f"{name} is deleted")
    return failed


def _name(text: str) -> str:
    from holozen.wire import robot_name

    try:
        return robot_name(text)
    except ValueError as error:
        raise refused(str(error)) from None


def _delete_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", nargs="+", type=_name, metavar="NAME", help="as `holozen list` shows them")


VERBS = by_name(
    Verb("list", "Show the robots and objects in the sim.", "--json", no_arguments, list_entities,
        "name and pose as one JSON object a line"),
    Verb("delete", "Remove robots or objects from the sim.", "Fred", _delete_arguments, delete),
)  # fmt: skip
