"""`holozen list` and `delete`: the robots and objects in the running sim."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from holozen.bus import Bus
from holozen.cli.verb import Verb, argument, by_name, no_arguments, open_bus
from holozen.console import printable, report, tell
from holozen.flags import refused
from holozen.process import deferred_interrupt
from holozen.suggest import listed
from holozen.transport.errors import NoReply, ServiceError
from holozen.transport.graph import SIMS

if TYPE_CHECKING:
    from holozen.messages import Pose

TILTED = 5.0  # degrees; a robot on a slope or a balancing one has less


def list_entities(args: argparse.Namespace) -> int:
    """Print the name and the pose of each entity in the sims; returns 1 if a sim does not
    answer.
    """
    with open_bus(args) as bus:
        with deferred_interrupt():
            from holozen import entities
        found = list(_entities(bus))
        sims = len(bus.endpoints(SIMS))
        silent = entities.silent_sims(bus)
    for sim in silent:
        report(f"holozen list: {sim} does not answer; {entities.HANGS}")
    if args.json:
        from msgspec import to_builtins

        for name, pose in found:
            print(json.dumps({"name": name, "pose": to_builtins(pose)}))
        return 1 if silent else 0
    width = max((len(name) for name, _ in found), default=0)
    for name, pose in found:
        print(printable(f"{name:<{width}}  {_where(pose)}"))
    if sims > 1 and found:
        report(f"they are in {sims} sims; robots of different sims do not collide")
    if not found:
        report("the world is empty; holozen spawn FILE --name NAME puts a robot there")
    return 1 if silent else 0


def _where(pose: Pose) -> str:
    at, yaw = pose.position, math.degrees(pose.orientation.yaw())
    # + 0.0: shows -0 as 0
    x, y, z, turn = (round(value, 3) + 0.0 for value in (at.x, at.y, at.z, yaw))
    return f"x {x:.3f}  y {y:.3f}  z {z:.3f} m  yaw {turn:.1f} deg{_lean(pose)}"


def _lean(pose: Pose) -> str:
    """A note on the tilt of a pose; empty up to TILTED."""
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
    yield from (
        (name, pose)
        for name, pose in zip(names, entities.for_each(where, names), strict=True)
        if pose
    )


def delete(args: argparse.Namespace) -> int:
    """Delete each entity from the sim; returns 1 if one could not be deleted."""
    with deferred_interrupt():
        from holozen import entities

    def remove(name: str) -> str:
        """Delete one entity; returns why it could not be deleted, else an empty string."""
        if is_pattern(name):
            return f"no name matches {name!r}; there are {listed(known)}"
        try:
            entities.delete(bus, name)
        except ServiceError as error:
            return str(error)
        return ""

    failed = 0
    with open_bus(args) as bus:
        known = entities.names(bus)  # so that without a sim it fails once, not for each name
        for word in args.names:
            names = (is_pattern(word) and [name for name in known if fnmatchcase(name, word)]) or [
                word
            ]
            for name, reason in zip(names, entities.for_each(remove, names), strict=True):
                if reason:
                    report(f"holozen delete: {reason}")
                    failed = 1
                if args.json:
                    tell(json.dumps({"name": name, "deleted": not reason, "reason": reason}))
                elif not reason:
                    tell(f"{name} is deleted")
    return failed


def is_pattern(text: str) -> bool:
    """Whether a name has wildcards of the shell."""
    return bool(set(text) & set("*?["))


def _name(text: str) -> str:
    from holozen.wire import robot_name

    try:
        return text if is_pattern(text) else robot_name(text)
    except ValueError as error:
        raise refused(str(error)) from None


NAMES = "names as `holozen list` shows them, or wildcards such as 'bot*'"
VERBS = by_name(
    Verb(
        "list",
        "list the robots and objects in the sim, and where they are",
        "--json",
        no_arguments,
        list_entities,
        "print name and pose as JSON, one object per line",
    ),
    Verb(
        "delete",
        "remove robots or objects from the sim",
        "Fred",
        argument("names", nargs="+", type=_name, metavar="NAME", help=NAMES),
        delete,
    ),
)
