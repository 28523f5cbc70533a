"""`holozen spawn`: put a robot or object into the running sim."""

import argparse
import math
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import flags
from holozen.bus import Bus
from holozen.cli.verb import Verb, by_name
from holozen.console import report
from holozen.spawning import Candidate, Spawned, SpawnPose, describe, put, read, requested_pose
from holozen.suggest import listed
from holozen.transport import connection
from holozen.transport.errors import ServiceError

if TYPE_CHECKING:
    pass

FAR = 1e6  # m
PATIENCE = 3.0  # s to wait for a router and for a sim
TURN = 6.2832  # rad; a larger angle was probably given in degrees
PLACES = {
    "x": "position",
    "y": "position",
    "z": "height (default: it stands on the ground)",
    "R": "roll in radians",
    "P": "pitch in radians",
    "Y": "yaw in radians",
}


def run(args: argparse.Namespace) -> int:
    """Read a file and spawn it, or a fleet of copies."""
    file, values = _words(args)
    if args.count and (args.replace or args.namespace):
        args.error("--count gives names of its own: leave out --replace and --namespace")
    place = SpawnPose(args.x, args.y, args.z, args.R, args.P, args.Y)
    candidate = read(
        file,
        args.name or "",
        values,
        dict(args.package),
        args.drive or "",
        args.strict,
        args.allow_env,
    )
    candidate = candidate._replace(namespace=args.namespace)
    with Bus("spawn", connection.from_arguments(args), patience=args.timeout or None) as bus:
        if args.count:
            return _put_fleet(bus, candidate, place, args)
        spawned = put(bus, candidate, place, args.replace, args.timeout)
    print(spawned.as_json() if args.json else spawned)
    return 0


def _put_fleet(bus: Bus, candidate: Candidate, place: SpawnPose, args: argparse.Namespace) -> int:
    """Spawn many copies on a square grid, called bot0, bot1 and so on, or by the name given.
    Several requests are under way at a time. Raises ServiceError; those that were spawned, or were
    before Ctrl-C, stay.
    """
    from holozen import entities
    from holozen.messages import Point, Pose

    side, base = math.ceil(math.sqrt(args.count)), args.name or "bot"
    _check_room(entities.names_by_sim(bus, args.timeout), base, args.count)
    first = requested_pose(candidate.model, place)

    crowded: dict[str, ServiceError] = {}

    def spawn(number: int) -> Spawned | None:
        at = first.position
        pose = Pose(
            Point(at.x + args.grid * (number % side), at.y + args.grid * (number // side), at.z),
            first.orientation,
        )
        try:
            name, _ = entities.spawn(bus, f"{base}{number}", candidate.text, pose)
        except ServiceError as error:
            if not entities.has_no_room(error):
                raise
            crowded[f"{base}{number}"] = error
            return None
        return describe(name, candidate, pose)

    fleet = list[Spawned]()
    try:
        for spawned in entities.for_each(spawn, range(args.count)):
            if spawned:
                fleet.append(spawned)
    except KeyboardInterrupt:
        names = f" ({fleet[0].name} .. {fleet[-1].name})" if fleet else ""
        report(
            f"holozen spawn: spawned {len(fleet)} of {args.count}{names}; `holozen delete "
            f"'{base}[0-9]*'` removes them"
        )
        raise
    if crowded:
        raise ServiceError(
            f"{len(fleet)} of {args.count} were spawned, without {listed(crowded)}: "
            f"{crowded[min(crowded)]}; "
            f"-x, -y and -z choose the first place, and --grid more than {args.grid:g} m between "
            "two"
        )
    _print_fleet(fleet, args.json)
    return 0


def _check_room(sims: list[list[str]], base: str, count: int) -> None:
    """Raise ServiceError if the sims, given by the names of their entities, cannot take `count`
    copies called `base` and a number.
    """
    from holozen.wire import MAX_ENTITIES

    now = sum(map(len, sims))
    if now + count > len(sims) * MAX_ENTITIES:
        raise ServiceError(
            f"--count {count} is too many: a sim holds {MAX_ENTITIES} entities, and there are "
            f"{now} in {len(sims)} sim{'s'[: len(sims) != 1]}; `holozen up --shards N` runs N sims"
        )
    taken = {f"{base}{number}" for number in range(count)}.intersection(chain.from_iterable(sims))
    if taken:
        raise ServiceError(
            f"{len(taken)} of these exist already, such as {min(taken)}; --name gives another name"
        )


def _print_fleet(fleet: list[Spawned], as_json: bool) -> None:
    if as_json:
        print(*(one.as_json() for one in fleet), sep="\n")
        return
    first, last = fleet[0], fleet[-1]
    listen = f"listen on {first.key} .. {last.key}" if first.key else first.hint or "were added"
    print(f"{first.name} .. {last.name} {listen}")


def _words(args: argparse.Namespace) -> tuple[Path, dict[str, str]]:
    """The file, and the values of its xacro arguments. Exits with code 2 for anything else."""
    try:
        values = dict(flags.pair(word) for word in args.words if ":=" in word)
    except argparse.ArgumentTypeError as error:
        args.error(str(error))
    files = [
        word for word in (*args.words, *([args.file] if args.file else ())) if ":=" not in word
    ]
    if len(files) > 1 and (meant := flags.assigned(files)):
        args.error(f"{meant.replace(':=', '=', 1)!r}: write {meant}")
    if len(files) != 1:
        args.error(
            f"give one FILE, not {len(files)}: {' '.join(files)}"
            if files
            else "give the FILE of a robot or object"
        )
    return Path(files[0]), values


def _name(text: str) -> str:
    """Parses the name of a new robot."""
    if not text:
        raise flags.refused(
            "'': a name has one character or more; leave the flag out to take the file's"
        )
    return flags.robot(text)


def _namespace(text: str) -> str:
    """Parses a robot's namespace; a slash is the root."""
    flags.robot(text.strip("/"))
    return text


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "words",
        nargs="*",
        metavar="FILE [name:=value]",
        help="the file, and values of its xacro:arg",
    )
    add("-file", "--file", metavar="FILE", help="the file, as for spawn_model")
    add("--name", "-model", "-entity", type=_name, help="default: as in the file")
    for flag in "xyz":
        add(f"-{flag}", type=flags.number(-FAR, FAR, "m"), metavar="m", help=PLACES[flag])
    for flag in "RPY":
        add(f"-{flag}", type=flags.number(-TURN, TURN, "rad"), metavar="rad", help=PLACES[flag])
    add(
        "--namespace",
        "-robot_namespace",
        type=_namespace,
        default="",
        metavar="NAME",
        help="its keys are below this; / is the root (default: its name)",
    )
    add(
        "--timeout",
        "-timeout",
        type=flags.number(0.1, 3600, "s"),
        default=0.0,
        metavar="S",
        help=f"seconds to wait for a sim (default: {PATIENCE:g})",
    )
    add(
        "--count",
        type=flags.count(1),
        default=0,
        metavar="N",
        help="a fleet of N copies on a grid: bot0, bot1 ..., or NAME0, NAME1 ...",
    )
    add(
        "--grid",
        type=flags.number(0.01, 100, "m"),
        default=2.0,
        metavar="M",
        help="metres between two of --count (default: %(default)g)",
    )
    add("--replace", action="store_true", help="replace the entity with that name")
    add("--drive", choices=flags.DRIVES, help=flags.DRIVE)
    flags.add_robot_sources(parser)
    add("--strict", action="store_true", help="a missing or bad mesh is an error")
    add("-urdf", "-sdf", action="store_true", help=argparse.SUPPRESS)  # detected from the file
    for flag in ("-param", "-topic", "-string", "-stdin"):
        add(
            flag,
            action=flags.Instead,
            advice="give the robot's file: holozen spawn my_bot.urdf.xacro --name Fred",
        )


VERBS = by_name(
    Verb(
        "spawn",
        "put a robot or object (xacro, URDF or SDF) into the running sim",
        "urdf/hb_bot.urdf.xacro --name Fred -x 1 -Y 1.57",
        _arguments,
        run,
        "print name, key and pose as JSON, one object per line",
        usage="%(prog)s [options] FILE [name:=value ...]",
    ),
)
