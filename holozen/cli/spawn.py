"""`holozen spawn`: put a robot or object into the running sim."""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import connection, flags
from holozen.bus import Bus
from holozen.cli.spawned import Spawned
from holozen.errors import ServiceError
from holozen.robot.errors import RobotError
from holozen.tell import say

if TYPE_CHECKING:
    from holozen.messages import Pose
    from holozen.robot.model import RobotModel

FAR = 1e6  # m
PATIENCE = 3.0  # s for a router, and for a sim to say that it is there
ROUND = 6.2832  # rad; whoever writes more means degrees
PLUGIN = '<gazebo><plugin name="planar_move" filename="libgazebo_ros_planar_move.so"/></gazebo>'
ENDS = {"</robot>": PLUGIN, "</model>": PLUGIN.removeprefix("<gazebo>").removesuffix("</gazebo>")}
"""The end of a URDF's and of an SDF's robot, and what goes before it for a drive."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where to put it: metres, and radians about the world's x, y, z. None: as the file says, and on the ground."""

    x: float | None = None
    y: float | None = None
    z: float | None = None
    roll: float | None = None
    pitch: float | None = None
    yaw: float | None = None


@dataclass(frozen=True, slots=True)
class Candidate:
    """A robot that was read without error: its name to be, what is sent, and what it is.

    Its keys are below `namespace`: by default its name, the root for a slash.
    """

    name: str
    text: str
    model: "RobotModel"
    namespace: str = ""


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen spawn",
        usage="%(prog)s [options] FILE [name:=value ...]",
        description="Put a robot or object (xacro, URDF or SDF) into the running sim.",
        epilog="example: holozen spawn urdf/hb_bot.urdf.xacro --name Fred -x 1 -Y 1.57",
    )
    parser.add_argument("words", nargs="*", metavar="FILE [name:=value]", help="the file, and values of its xacro:arg")
    parser.add_argument("-file", "--file", metavar="FILE", help="the file, as spawn_model wants it")
    parser.add_argument("--name", "-model", "-entity", type=flags.robot, default="", help="default: as in the file")
    for flag in "xyz":
        parser.add_argument(f"-{flag}", type=flags.number(-FAR, FAR, "m"), metavar="m", help=PLACES[flag])
    for flag in "RPY":
        parser.add_argument(f"-{flag}", type=flags.number(-ROUND, ROUND, "rad"), metavar="rad", help=PLACES[flag])
    parser.add_argument("--namespace", "-robot_namespace", default="", metavar="NAME",
        help="its keys are below this; / is the root (default: its name)")  # fmt: skip
    parser.add_argument("--timeout", "-timeout", type=flags.number(0.1, 3600, "s"), default=0.0, metavar="S",
        help=f"wait as long for a sim (default: {PATIENCE:g})")  # fmt: skip
    parser.add_argument("--replace", action="store_true", help="put it in the place of the one with that name")
    parser.add_argument("--drive", choices=("planar_move",), help="how to move a robot whose file has no drive")
    parser.add_argument("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR",
        help="the folder of package NAME, for $(find NAME) and package://NAME")  # fmt: skip
    parser.add_argument("--strict", action="store_true", help="a missing or bad mesh is an error")
    parser.add_argument("-urdf", "-sdf", action="store_true", help=argparse.SUPPRESS)  # the file says which it is
    parser.add_argument("--json", action="store_true", help="its name, key and pose as one JSON object")
    connection.add_arguments(parser)
    return parser


PLACES = {
    "x": "position", "y": "position", "z": "height (default: it stands on the ground)",
    "R": "roll, not in degrees", "P": "pitch, not in degrees", "Y": "yaw, not in degrees",
}  # fmt: skip


def main(argv: list[str]) -> int:
    options = parser()
    args = options.parse_intermixed_args(_joined(argv))  # plain parse_args takes no name:=value after a flag
    file, values = _words(options, args)
    place = Place(args.x, args.y, args.z, args.R, args.P, args.Y)
    try:
        candidate = read(file, args.name, values, dict(args.package), args.drive or "", args.strict)
        candidate = replace(candidate, namespace=args.namespace)
        with Bus("spawn", connection.from_arguments(args), patience=args.timeout or PATIENCE) as bus:
            spawned = put(bus, candidate, place, args.replace, args.timeout)
        print(spawned.as_json() if args.json else spawned)
    except RobotError as error:
        say(f"holozen spawn: {error}")
        return 1
    return 0


def spawn_file(
    bus: Bus,
    path: Path,
    name: str = "",
    place: Place | None = None,
    replace: bool = False,
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    drive: str = "",
    strict: bool = False,
) -> Spawned:
    """Read a file, tell its warnings, and spawn it.

    With `replace` one with that name is deleted, after the new file was read without error; the new one takes its
    pose unless a `place` is given. Raises RobotError for the file and ServiceError for what the sim says.
    """
    return put(bus, read(path, name, args, packages, drive, strict), place or Place(), replace)


def read(
    path: Path, name: str, args: Mapping[str, str], packages: Mapping[str, Path], drive: str, strict: bool
) -> Candidate:
    """A file, checked here where its lines are known; warnings are told. Raises RobotError."""
    from holozen.robot.model import load
    from holozen.robot.portable import portable
    from holozen.wire import robot_name

    model = load(path, args, packages, strict)
    for warning in model.warnings:
        say(f"holozen spawn: {warning}")
    try:
        name = robot_name(name or model.name)
    except ValueError as error:
        raise RobotError(f"{path}: {error}; give one with --name") from None
    if not any(link.collisions for link in model.links.values()):
        say(f"holozen spawn: {path}: has no collision shape and falls through the ground; see: holozen check {path}")
    text, _ = portable(path, args, packages)  # its warnings are among the model's
    if drive and model.drive is None:
        return _driven(Candidate(name, text, model))
    if drive:
        say(f"holozen spawn: {path}: has a drive of its own, which is used; --drive {drive} is not")
    return Candidate(name, text, model)


def put(bus: Bus, candidate: Candidate, place: Place, replace: bool, notice: float = 0.0) -> Spawned:
    """Spawn what was read; waits `notice` seconds for a sim. Raises ServiceError."""
    from holozen import entities

    there = candidate.name in entities.names(bus, notice)
    old = entities.pose(bus, candidate.name) if replace and there else None
    pose = _kept(candidate.model, old) if old and place == Place() else _chosen(candidate.model, place)
    try:
        name = entities.spawn(bus, candidate.name, candidate.text, pose, candidate.namespace)
    except ServiceError as error:
        # The sim finds what is wrong with a robot before it looks at the name: the old one goes only for a good one.
        if entities.is_taken(error) and not replace:
            raise ServiceError(f"{error}; --replace takes its place, --name gives another") from None
        if not old or not entities.is_taken(error):
            raise
        entities.delete(bus, candidate.name)
        name = entities.spawn(bus, candidate.name, candidate.text, pose, candidate.namespace)
    return _told(name, candidate, pose)


def _joined(words: list[str]) -> list[str]:
    """`-x -1e-3` as `-x=-1e-3`: argparse takes such a number for a flag."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1][1:] in PLACES and word[:1] == "-" and word[1:2] in "0123456789.":
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _words(options: argparse.ArgumentParser, args: argparse.Namespace) -> tuple[Path, dict[str, str]]:
    values = dict(word.split(":=", 1) for word in args.words if not word.startswith(":=") and ":=" in word)
    files = [word for word in (*args.words, *([args.file] if args.file else ())) if ":=" not in word]
    if len(files) != 1:
        options.error(f"give one FILE, not {len(files)}" + (f": {' '.join(files)}" if files else ""))
    return Path(files[0]), values


def _driven(candidate: Candidate) -> Candidate:
    """With a planar_move plugin, which drives the root when it names no link."""
    from holozen.robot.model import planar_drive

    end = next(end for end in ENDS if end in candidate.text)
    head, _, tail = candidate.text.rpartition(end)
    return Candidate(candidate.name, f"{head}{ENDS[end]}{end}{tail}", planar_drive(candidate.model))


def _chosen(model: "RobotModel", place: Place) -> "Pose":
    """The pose that is asked for, else that of the file; on the ground unless either says a height."""
    from holozen.robot.standing import lowest

    own = Place(*model.pose.xyz, *model.pose.rpy)
    x, y, z, *angles = (_first(getattr(place, part.name), getattr(own, part.name)) for part in fields(Place))
    roll, pitch, yaw = angles
    if place.z is None and own.z == 0:
        z = -lowest(model, (roll, pitch, yaw))
    return _message((x, y, z), (roll, pitch, yaw))


def _kept(model: "RobotModel", old: "Pose") -> "Pose":
    """The pose of the one before, lifted if the new one would stick in the ground."""
    from holozen.robot.rotation import matrix_of_quaternion, rpy_of
    from holozen.robot.standing import lowest

    q, p = old.orientation, old.position
    rpy = rpy_of(matrix_of_quaternion((q.x, q.y, q.z, q.w)))
    return _message((p.x, p.y, max(p.z, -lowest(model, rpy))), rpy)


def _message(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> "Pose":
    from holozen.messages import Point, Pose, Quaternion
    from holozen.robot.rotation import matrix_of, quaternion_of

    return Pose(Point(*xyz), Quaternion(*quaternion_of(matrix_of(rpy))))


def _first(value: float | None, other: float | None) -> float:
    return value if value is not None else other or 0.0


def _told(name: str, candidate: Candidate, pose: "Pose") -> Spawned:
    from holozen.wire import key_for

    model, prefix = candidate.model, candidate.namespace.strip("/") if candidate.namespace else name
    if model.drive is not None:
        return Spawned(name, key_for(model.drive.command_topic, prefix), pose)
    wheels = any(joint.kind == "continuous" for joint in model.joints.values())
    hint = "nothing drives it: spawn it with --drive planar_move to move it as a whole" if wheels else ""
    return Spawned(name, "", pose, hint)
