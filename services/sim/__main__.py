"""The simulator: robots with planar drives in a world, on Zenoh keys."""

import argparse
import contextlib
import sys
import threading
from functools import partial
from pathlib import Path

from holozen import data, engines, flags
from holozen.bus import Bus
from holozen.command import inputs
from holozen.console import Failure, report
from holozen.process import stop_event
from holozen.robot.errors import RobotError
from holozen.transport import connection
from holozen.transport.errors import BusError

from . import schedule, shard
from .joining import standing

DISCOVERY = 0.5  # s for the sim that this one joins


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen sim",
        description="simulate robots in a world; `holozen sim pause|play|step|reset` control one "
        "that runs",
        epilog="example: holozen sim --robot my_bot.urdf.xacro=Fred",
    )
    add = parser.add_argument
    add(
        "--world",
        type=Path,
        default=data.find("worlds", "gazebo.world"),
        help="an SDF file (default: gazebo.world)",
    )
    add(
        "--robot",
        type=flags.robot_file,
        action="append",
        metavar="FILE[=NAME]",
        help="a xacro or URDF file, and the robot's name (default: hb_bot, on keys without a name)",
    )
    add("--empty", action="store_true", help="start without robots; add them with `holozen spawn`")
    add(
        "--join",
        action="store_true",
        help="start beside another sim, with named robots; those of two sims do not collide",
    )
    shard.add_argument(parser)
    add("--paused", action="store_true", help="start paused, until `holozen sim play` or `step`")
    add(
        "--stopped",
        action="store_true",
        help="start with the robots stopped, until `holozen release`",
    )
    add(
        "--state",
        type=Path,
        metavar="DIR",
        help="keep software stops in files there, for the next sim (default: HOLOZEN_STATE, else "
        "none)",
    )
    add("--drive", choices=flags.DRIVES, help=flags.DRIVE)
    add("--engine", choices=(flags.AUTO, *flags.ENGINES), default=flags.AUTO, help=flags.ENGINE)
    flags.add_robot_sources(parser)
    add(
        "--rtf",
        type=flags.number(*schedule.FACTORS),
        help="real-time factor; 0: as fast as possible (default: the world's)",
    )
    add(
        "--seed",
        type=flags.count(),
        default=0,
        metavar="N",
        help="seed for sensor noise: the same seed gives the same values (default: 0)",
    )
    add(
        "--max-linear",
        type=flags.number(*inputs.LINEAR, "m/s"),
        default=inputs.MAX_LINEAR,
        metavar="M/S",
        help="faster commands are clamped (default: %(default)s)",
    )
    add(
        "--max-angular",
        type=flags.number(*inputs.ANGULAR, "rad/s"),
        default=inputs.MAX_ANGULAR,
        metavar="RAD/S",
        help="(default: %(default)s)",
    )
    for names, advice in (
        (("--name", "-model", "-entity"), flags.NAMED),
        (("--gui", "--headless"), "no sim has a window; `holozen view` shows it in a browser"),
    ):
        add(*names, action=flags.Instead, advice=advice)
    flags.add_json(parser)
    connection.add_arguments(parser, role="sim")
    return parser


def main(argv: list[str] | None = None) -> int:
    options = parser()
    args = options.parse_args(argv)
    if args.shard and (args.join or any(not name for _, name in args.robot or ())):
        options.error(
            "--shard gives each robot to the shard of its name: use --robot FILE=NAME, and no "
            "--join"
        )
    stop = stop_event()
    try:
        _run(args, stop)
    except (BusError, Failure, RobotError) as error:
        report(f"sim: {error}")
        return 1
    return 0


def _run(args: argparse.Namespace, stop: threading.Event) -> None:
    """Build a sim and run it until `stop` is set. Raises BusError, RobotError, and Failure if the
    engine is missing.
    """
    # These load numpy, which --help does not need.
    from holozen.robot.files import loading, reader
    from holozen.robot.files.sdf_world import load_world

    reader.start(loading)
    choice = engines.choose(args.engine)
    spec = load_world(args.world, dict(args.package))
    mine, bus = _open(args, stop)
    with bus:
        with bus.graph() as graph:
            # it loads the engine, which takes long: a wrong flag is reported first
            from .build import build

            # tokens of another sim may be on their way
            graph.settled(bus.connected, max(DISCOVERY, bus.took))
            where = standing(args, mine, graph)
        with contextlib.closing(build(args, choice, spec, bus, where, stop)) as sim:
            sim.run(stop)


def _open(args: argparse.Namespace, stop: threading.Event) -> tuple[shard.Shard | None, Bus]:
    """The shard that this sim is, if it is one, and its bus. Raises BusError."""
    where = connection.from_arguments(args)
    opened = partial(Bus, connection=where, lasting=True, stop=stop, at_address=True)
    return shard.claim(args.shard, where, opened) if args.shard else (None, opened("sim"))


if __name__ == "__main__":
    sys.exit(main())
