"""The simulator: robots with planar drives in a world, on Zenoh keys."""

import argparse
import sys
from pathlib import Path

from holozen import connection, data, flags
from holozen.bus import Bus
from holozen.errors import BusError
from holozen.process import stop_event
from holozen.robot.model import RobotError
from holozen.tell import say

from . import intake, pace, worldfile


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen sim",
        description="Simulate robots in a world.",
        epilog="example: holozen sim --robot my_bot.urdf.xacro=Fred",
    )
    add = parser.add_argument
    add("--world", type=Path, default=data.find("worlds", "gazebo.world"), help="an SDF file (default: gazebo.world)")
    add("--robot", type=flags.robot_file, action="append", metavar="FILE[=NAME]",
        help="a xacro or URDF file, and the robot's name (default: hb_bot at the root of the keys)")  # fmt: skip
    add("--empty", action="store_true", help="no robot at the start; `holozen spawn` puts some in")
    add("--drive", choices=["planar_move"], help="for robots that have no drive of their own")
    add("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR", help="for $(find NAME)")
    add(
        "--rtf", type=flags.number(*pace.FACTORS), help="real-time factor; 0: as fast as it goes (default: the world's)"
    )
    add("--max-linear", type=flags.number(*intake.LINEAR, "m/s"), default=intake.MAX_LINEAR, metavar="M/S",
        help="faster commands are clamped (default: %(default)s)")  # fmt: skip
    add("--max-angular", type=flags.number(*intake.ANGULAR, "rad/s"), default=intake.MAX_ANGULAR, metavar="RAD/S",
        help="(default: %(default)s)")  # fmt: skip
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    try:
        spec = worldfile.load(args.world, dict(args.package))
        with Bus("sim", connection.from_arguments(args), lasting=True, stop=stop) as bus:
            # The engine takes the longest to load, and a wrong flag should not wait for it.
            from holozen.parameters import Parameters

            from .entities import Entities
            from .entity_services import EntityServices
            from .loop import Loop
            from .parameters import declared
            from .spawn import furnish, spawn_all
            from .world import World

            world = World(spec)
            entities = Entities(bus, world, (args.max_linear, args.max_angular))
            furnish(entities, spec.models)
            if args.robot or not args.empty:
                spawn_all(entities, args)
            for warning in spec.warnings:
                say(f"sim: {warning}")
            services = EntityServices(bus, entities, dict(args.package))
            if not entities.vehicles:
                say("sim: no robot yet; `holozen spawn FILE` puts one in")
            loop = Loop(bus, world, entities, spec.rtf if args.rtf is None else args.rtf, services)
            loop.answers.append(Parameters(bus, "sim", lambda: declared(entities, loop.pace)).answer)
            loop.run(stop)
    except (BusError, RobotError, worldfile.WorldError) as error:
        say(f"sim: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
