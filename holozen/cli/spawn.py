"""`holozen spawn`: put a robot or object into the running sim."""

import argparse
import json
import math
import re
from collections.abc import Collection, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from holozen import flags
from holozen.bus import Bus
from holozen.cli.verb import Verb, by_name
from holozen.console import report
from holozen.robot.errors import RobotError
from holozen.suggest import listed
from holozen.transport import connection
from holozen.transport.errors import ServiceError

if TYPE_CHECKING:
    from holozen.messages import Pose
    from holozen.robot.model import RobotModel

FAR = 1e6  # m
PATIENCE = 3.0  # s to wait for a router and for a sim
SUNK = 5e-3  # m; a robot that is less deep in the ground does not hop
TURN = 6.2832  # rad; a larger angle was probably given in degrees
PLUGINS = {"planar_move": "libgazebo_ros_planar_move.so", "omni": "libholozen_omni_drive.so"}
ENDS = {"</robot>": "<gazebo>{}</gazebo></robot>", "</model>": "{}</model>"}
"""The end tag of a robot in URDF and in SDF -> its replacement, with the plugin of a drive for {}."""


class Place(NamedTuple):
    """The pose to spawn at: metres, and radians about the world's x, y, z. None: that of the file; for z the height at
    which it stands on the ground, unless the file gives one.
    """

    x: float | None = None
    y: float | None = None
    z: float | None = None
    roll: float | None = None
    pitch: float | None = None
    yaw: float | None = None


ANYWHERE = Place()


class Candidate(NamedTuple):
    """A valid robot to spawn: its name, the text to send, and its model.

    Its keys are below `namespace`: empty for its name, a slash for the root.
    """

    name: str
    text: str
    model: "RobotModel"
    namespace: str = ""


class Spawned(NamedTuple):
    """A spawned entity: its name, the key of its commands (empty if it takes none), its pose, and advice."""

    name: str
    key: str
    pose: "Pose"
    hint: str = ""

    def __str__(self) -> str:
        at = self.pose.position
        where = f"listens on {self.key}" if self.key else f"stands at {at.x:.3f} {at.y:.3f} {at.z:.3f}"
        return f"{self.name} {where}{self.hint and f'; {self.hint}'}"

    def as_json(self) -> str:
        """The same as one JSON object."""
        from msgspec import to_builtins

        return json.dumps({"name": self.name, "key": self.key, "pose": to_builtins(self.pose), "hint": self.hint})


PLACES = {
    "x": "position", "y": "position", "z": "height (default: it stands on the ground)",
    "R": "roll in radians", "P": "pitch in radians", "Y": "yaw in radians",
}  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Read a file and spawn it, or a fleet of copies."""
    file, values = _words(args)
    if args.count and (args.replace or args.namespace):
        args.error("--count gives names of its own: leave out --replace and --namespace")
    place = Place(args.x, args.y, args.z, args.R, args.P, args.Y)
    candidate = read(file, args.name or "", values, dict(args.package), args.drive or "", args.strict, args.allow_env)
    candidate = candidate._replace(namespace=args.namespace)
    with Bus("spawn", connection.from_arguments(args), patience=args.timeout or None) as bus:
        if args.count:
            return _put_fleet(bus, candidate, place, args)
        spawned = put(bus, candidate, place, args.replace, args.timeout)
    print(spawned.as_json() if args.json else spawned)
    return 0


def _put_fleet(bus: Bus, candidate: Candidate, place: Place, args: argparse.Namespace) -> int:
    """Spawn many copies on a square grid, called bot0, bot1 and so on, or by the name given. Several requests are under
    way at a time. Raises ServiceError; those that were spawned, or were before Ctrl-C, stay.
    """
    from holozen import entities
    from holozen.messages import Point, Pose
    from holozen.wire import MAX_ENTITIES

    side, base = math.ceil(math.sqrt(args.count)), args.name or "bot"
    sims = entities.names_by_sim(bus, args.timeout)
    now = sum(map(len, sims))
    if now + args.count > len(sims) * MAX_ENTITIES:
        raise ServiceError(
            f"--count {args.count} is too many: a sim holds {MAX_ENTITIES} entities, and there are {now} in "
            f"{len(sims)} sim{'s'[: len(sims) != 1]}; `holozen up --shards N` runs N sims"
        )
    taken = {f"{base}{number}" for number in range(args.count)}.intersection(chain.from_iterable(sims))
    if taken:
        raise ServiceError(f"{len(taken)} of these exist already, such as {min(taken)}; --name gives another name")
    first = _requested_pose(candidate.model, place)

    crowded: dict[str, ServiceError] = {}

    def spawn(number: int) -> Spawned | None:
        at = first.position
        pose = Pose(
            Point(at.x + args.grid * (number % side), at.y + args.grid * (number // side), at.z), first.orientation
        )
        try:
            name, _ = entities.spawn(bus, f"{base}{number}", candidate.text, pose)
        except ServiceError as error:
            if not entities.has_no_room(error):
                raise
            crowded[f"{base}{number}"] = error
            return None
        return _spawned(name, candidate, pose)

    fleet = list[Spawned]()
    try:
        for spawned in entities.for_each(spawn, range(args.count)):
            if spawned:
                fleet.append(spawned)
    except KeyboardInterrupt:
        names = f" ({fleet[0].name} .. {fleet[-1].name})" if fleet else ""
        report(
            f"holozen spawn: spawned {len(fleet)} of {args.count}{names}; `holozen delete '{base}[0-9]*'` removes them"
        )
        raise
    if crowded:
        raise ServiceError(
            f"{len(fleet)} of {args.count} were spawned, without {listed(crowded)}: {crowded[min(crowded)]}; "
            f"-x, -y and -z choose the first place, and --grid more than {args.grid:g} m between two"
        )
    if args.json:
        print(*(one.as_json() for one in fleet), sep="\n")
    else:
        listen = f"listen on {fleet[0].key} .. {fleet[-1].key}" if fleet[0].key else fleet[0].hint or "were added"
        print(f"{fleet[0].name} .. {fleet[-1].name} {listen}")
    return 0


def spawn_file(bus: Bus, path: Path, name: str = "", place: Place = ANYWHERE, replace: bool = False) -> Spawned:
    """`read` a file and `put` it into the sim."""
    return put(bus, read(path, name), place, replace)


def read(
    path: Path,
    name: str = "",
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    drive: str = "",
    strict: bool = False,
    allow_env: Collection[str] = (),
) -> Candidate:
    """Read and check a file here, where its lines are known; warnings are reported. Raises RobotError."""
    from holozen.robot.loading import both
    from holozen.robot.model import takes
    from holozen.robot.rigid import FALLS, falls_through
    from holozen.wire import robot_name

    model, text = both(path, args, packages, strict, allow_env)
    for warning in model.warnings:
        report(f"holozen spawn: warning: {warning}")
    try:
        name = robot_name(name or model.name)
    except ValueError as error:
        raise RobotError(f"{path}: {error}; give one with --name") from None
    if falls_through(model):
        report(f"holozen spawn: warning: {path}: {FALLS}; give a link a <collision>")
    if drive and takes(model, drive):
        return _driven(Candidate(name, text, model), drive)
    if drive:
        report(f"holozen spawn: warning: {path}: has a drive of its own, which is used; --drive {drive} is not")
    return Candidate(name, text, model)


def put(
    bus: Bus, candidate: Candidate, place: Place = ANYWHERE, replace: bool = False, timeout: float = 0.0
) -> Spawned:
    """Spawn a candidate; waits up to `timeout` seconds for a sim. Raises ServiceError if the sim refuses.

    With `replace` an entity with that name is deleted once the sim accepts the new one, which takes its pose unless a
    `place` is given.
    """
    from holozen import entities

    exists = candidate.name in entities.names(bus, timeout)
    old = entities.pose(bus, candidate.name) if replace and exists else None
    if old and place == ANYWHERE:
        pose = _inherited_pose(candidate.model, old)
    else:
        pose = _requested_pose(candidate.model, place)
    try:
        name, warnings = entities.spawn(bus, candidate.name, candidate.text, pose, candidate.namespace)
    except ServiceError as error:
        # The sim checks a robot before its name, so the old one is deleted only for a valid one.
        if entities.is_taken(error) and not exists and candidate.namespace:
            raise ServiceError(f"{error}; --namespace NAME (-robot_namespace NAME) gives one") from None
        if entities.is_taken(error) and not replace:
            own = "--replace takes its place, " if exists else ""
            raise ServiceError(f"{error}; {own}--name gives another") from None
        if entities.has_no_room(error):
            raise ServiceError(f"{error}; -x, -y and -z choose the place") from None
        if not old or not entities.is_taken(error):
            raise
        entities.delete(bus, candidate.name)
        name, warnings = entities.spawn(bus, candidate.name, candidate.text, pose, candidate.namespace)
    known = {_complaint(warning) for warning in candidate.model.warnings}
    for warning in warnings:
        if _complaint(warning) not in known:
            report(f"holozen spawn: warning: the sim: {warning}")
    if place.z is not None:
        _warn_if_sunk(candidate.model, pose)
    return _spawned(name, candidate, pose)


def _complaint(warning: str) -> str:
    """A warning without its line, and without why a mesh is replaced: the sim looks for meshes in other folders."""
    return re.sub(r"^.*?, line \d+: |( is replaced by a box).*", r"\1", warning)


def _words(args: argparse.Namespace) -> tuple[Path, dict[str, str]]:
    """The file, and the values of its xacro arguments. Exits with code 2 for anything else."""
    try:
        values = dict(flags.pair(word) for word in args.words if ":=" in word)
    except argparse.ArgumentTypeError as error:
        args.error(str(error))
    files = [word for word in (*args.words, *([args.file] if args.file else ())) if ":=" not in word]
    if len(files) > 1 and (meant := flags.assigned(files)):
        args.error(f"{meant.replace(':=', '=', 1)!r}: write {meant}")
    if len(files) != 1:
        args.error(
            f"give one FILE, not {len(files)}: {' '.join(files)}" if files else "give the FILE of a robot or object"
        )
    return Path(files[0]), values


def _driven(candidate: Candidate, drive: str) -> Candidate:
    """The candidate, with the plugin of a drive added."""
    from holozen.robot.model import driven

    end = next(end for end in ENDS if end in candidate.text)
    head, _, tail = candidate.text.rpartition(end)
    plugin = f'<plugin name="{drive}" filename="{PLUGINS[drive]}"/>'
    return Candidate(candidate.name, f"{head}{ENDS[end].format(plugin)}{tail}", driven(candidate.model, drive))


def _requested_pose(model: "RobotModel", place: Place) -> "Pose":
    """The requested pose, else that of the file; on the ground unless either gives a height."""
    from holozen.messages import Pose
    from holozen.robot.rigid import lowest
    from holozen.rotation import from_rpy

    own = (*model.pose.xyz, *model.pose.rpy)
    x, y, z, roll, pitch, yaw = (mine if given is None else given for given, mine in zip(place, own, strict=True))
    if place.z is None and z == 0:
        z = -lowest(model, (roll, pitch, yaw))
    return Pose.of((x, y, z), from_rpy(roll, pitch, yaw))


def _warn_if_sunk(model: "RobotModel", pose: "Pose") -> None:
    """Report a robot that was spawned in the ground, which the sim allows while its root frame is on it."""
    from holozen.robot.rigid import lowest
    from holozen.rotation import Transform, to_rpy

    at = Transform.of(pose.position, pose.orientation)
    depth = -lowest(model, to_rpy(at.rotation)) - pose.position.z
    if depth > SUNK and not model.static:
        report(
            f"holozen spawn: warning: at -z {pose.position.z:g} it is {depth:.3f} m deep in the ground, which pushes "
            "it out; without -z it stands on the ground"
        )


def _inherited_pose(model: "RobotModel", old: "Pose") -> "Pose":
    """The pose of the replaced entity, raised if the new one would intersect the ground."""
    from holozen.robot.rigid import lowest
    from holozen.rotation import Transform, to_rpy

    at = Transform.of(old.position, old.orientation)
    x, y, z = at.translation
    return old.of((x, y, max(z, -lowest(model, to_rpy(at.rotation)))), at.rotation)


def _spawned(name: str, candidate: Candidate, pose: "Pose") -> Spawned:
    from holozen.robot.model import MOVING
    from holozen.wire import key_for

    model, prefix = candidate.model, candidate.namespace.strip("/") if candidate.namespace else name
    if model.drive is not None:
        return Spawned(name, key_for(model.drive.command_topic, prefix), pose)
    moves = any(joint.kind in MOVING for joint in model.joints.values())
    hint = "nothing drives it: spawn it with --drive planar_move to move it as a whole" if moves else ""
    return Spawned(name, "", pose, hint)


def _name(text: str) -> str:
    """Parses the name of a new robot."""
    if not text:
        raise flags.refused("'': a name has one character or more; leave the flag out to take the file's")
    return flags.robot(text)


def _namespace(text: str) -> str:
    """Parses a robot's namespace; a slash is the root."""
    flags.robot(text.strip("/"))
    return text


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("words", nargs="*", metavar="FILE [name:=value]", help="the file, and values of its xacro:arg")
    add("-file", "--file", metavar="FILE", help="the file, as for spawn_model")
    add("--name", "-model", "-entity", type=_name, help="default: as in the file")
    for flag in "xyz":
        add(f"-{flag}", type=flags.number(-FAR, FAR, "m"), metavar="m", help=PLACES[flag])
    for flag in "RPY":
        add(f"-{flag}", type=flags.number(-TURN, TURN, "rad"), metavar="rad", help=PLACES[flag])
    add("--namespace", "-robot_namespace", type=_namespace, default="", metavar="NAME",
        help="its keys are below this; / is the root (default: its name)")  # fmt: skip
    add("--timeout", "-timeout", type=flags.number(0.1, 3600, "s"), default=0.0, metavar="S",
        help=f"seconds to wait for a sim (default: {PATIENCE:g})")  # fmt: skip
    add("--count", type=flags.count(1), default=0, metavar="N",
        help="a fleet of N copies on a grid: bot0, bot1 ..., or NAME0, NAME1 ...")  # fmt: skip
    add("--grid", type=flags.number(0.01, 100, "m"), default=2.0, metavar="M",
        help="metres between two of --count (default: %(default)g)")  # fmt: skip
    add("--replace", action="store_true", help="replace the entity with that name")
    add("--drive", choices=flags.DRIVES, help=flags.DRIVE)
    flags.add_robot_sources(parser)
    add("--strict", action="store_true", help="a missing or bad mesh is an error")
    add("-urdf", "-sdf", action="store_true", help=argparse.SUPPRESS)  # detected from the file
    for flag in ("-param", "-topic", "-string", "-stdin"):
        add(flag, action=flags.Instead, advice="give the robot's file: holozen spawn my_bot.urdf.xacro --name Fred")


VERBS = by_name(
    Verb("spawn", "put a robot or object (xacro, URDF or SDF) into the running sim",
        "urdf/hb_bot.urdf.xacro --name Fred -x 1 -Y 1.57", _arguments, run,
        "print name, key and pose as JSON, one object per line", usage="%(prog)s [options] FILE [name:=value ...]"),
)  # fmt: skip
