"""The simulator: robots with planar drives in a world, on Zenoh keys."""

import argparse
import sys
from pathlib import Path

from holozen import data, flags
from holozen.bus import Bus
from holozen.console import report
from holozen.process import stop_event
from holozen.robot.errors import RobotError
from holozen.transport import connection
from holozen.transport.errors import BusError
from holozen.transport.graph import Graph, on_key
from holozen.wire import key_for

from . import pace
from .command import inputs


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen sim",
        description="Simulate robots in a world.",
        epilog="example: holozen sim --robot my_bot.urdf.xacro=Fred",
    )
    add = parser.add_argument
    add("--world", type=Path, default=data.find("worlds", "gazebo.world"), help="an SDF file (default: gazebo.world)")
    add("--robot", type=flags.robot_file, action="append", metavar="FILE[=NAME]",
        help="a xacro or URDF file, and the robot's name (default: hb_bot, on keys without a name)")  # fmt: skip
    add("--empty", action="store_true", help="start without robots; add them with `holozen spawn`")
    add("--join", action="store_true",
        help="start beside another sim, with named robots; those of two sims do not collide")  # fmt: skip
    add("--stopped", action="store_true", help="start with the robots stopped, until `holozen release`")
    add("--drive", choices=["planar_move"], help="a drive for robots whose file has none")
    add("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR",
        help="where $(find NAME) is")  # fmt: skip
    add("--allow-env", type=flags.variable, action="append", default=[], metavar="NAME",
        help="an environment variable that a robot's file may read as $(env NAME)")  # fmt: skip
    add(
        "--rtf",
        type=flags.number(*pace.FACTORS),
        help="real-time factor; 0: as fast as possible (default: the world's)",
    )
    add("--max-linear", type=flags.number(*inputs.LINEAR, "m/s"), default=inputs.MAX_LINEAR, metavar="M/S",
        help="faster commands are clamped (default: %(default)s)")  # fmt: skip
    add("--max-angular", type=flags.number(*inputs.ANGULAR, "rad/s"), default=inputs.MAX_ANGULAR, metavar="RAD/S",
        help="(default: %(default)s)")  # fmt: skip
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    try:
        from holozen.robot.sdf_world import load_world  # loads numpy, which --help does not need

        spec = load_world(args.world, dict(args.package))
        with Bus("sim", connection.from_arguments(args), lasting=True, stop=stop) as bus:
            graph = bus.graph()
            # The engine is slow to load: a wrong flag is reported first.
            from holozen.transport.parameters import Parameters

            from .entities import Entities
            from .io.entity_services import EntityServices
            from .loop import Loop
            from .parameters import declared
            from .physics.world import World
            from .spawn import add_models, spawn_all

            joins = bool(other := _other_sim(graph))
            graph.close()
            if joins and (reason := _cannot_join(args)):
                report(f"sim: {other} simulates here already; {reason}")
                return 1
            world = World(spec)
            entities = Entities(bus, world, (args.max_linear, args.max_angular))
            add_models(entities, spec.models)
            if args.robot or not args.empty:
                spawn_all(entities, args)
            if args.stopped:
                entities.stop("the start of this sim")
            for warning in spec.warnings:
                report(f"sim: {warning}")
            services = EntityServices(bus, entities, dict(args.package), spawns=not joins)
            if not entities.robots:
                report("sim: no robot yet; add one with `holozen spawn FILE`")
            loop = Loop(bus, world, entities, spec.rtf if args.rtf is None else args.rtf, services, is_clock=not joins)
            name = key_for("sim", args.robot[0][1] if joins else "")
            loop.answers.append(Parameters(bus, name, lambda: declared(entities, loop.pace)).answer)
            loop.run(stop)
    except (BusError, RobotError) as error:
        report(f"sim: {error}")
        return 1
    return 0


def _other_sim(graph: Graph) -> str:
    """The sim that serves the keys of the world already; empty if there is none."""
    return next((end.source for end in on_key(graph.endpoints(), "clock", "pub")), "")


def _cannot_join(args: argparse.Namespace) -> str:
    """Why a sim with these flags cannot run beside another, and what to do; empty if it can."""
    if args.join and args.robot and all(name for _, name in args.robot):
        return ""
    missing = "name the robots" if args.join else "end it, or join it with named robots"
    return f"{missing}: holozen sim --join --robot FILE=NAME"


if __name__ == "__main__":
    sys.exit(main())
