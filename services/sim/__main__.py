"""The simulator: robots with planar drives in a world, on Zenoh keys."""

import argparse
import contextlib
import os
import sys
import threading
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import data, flags
from holozen.bus import Bus
from holozen.command import inputs
from holozen.console import report
from holozen.process import stop_event
from holozen.robot.errors import RobotError
from holozen.transport import connection
from holozen.transport.errors import BusError
from holozen.transport.graph import Graph, on_key
from holozen.wire import key_for

from . import schedule, shard

if TYPE_CHECKING:
    from .entities import Entities


HOW = "holozen sim --join --robot FILE=NAME"
DISCOVERY = 0.5  # s for the sim that this one joins
JOIN = f"end it, choose another --domain, or join it with named robots: {HOW}"


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen sim",
        description="simulate robots in a world; `holozen sim pause|play|step|reset` control one that runs",
        epilog="example: holozen sim --robot my_bot.urdf.xacro=Fred",
    )
    add = parser.add_argument
    add("--world", type=Path, default=data.find("worlds", "gazebo.world"), help="an SDF file (default: gazebo.world)")
    add("--robot", type=flags.robot_file, action="append", metavar="FILE[=NAME]",
        help="a xacro or URDF file, and the robot's name (default: hb_bot, on keys without a name)")  # fmt: skip
    add("--empty", action="store_true", help="start without robots; add them with `holozen spawn`")
    add("--join", action="store_true",
        help="start beside another sim, with named robots; those of two sims do not collide")  # fmt: skip
    shard.add_argument(parser)
    add("--paused", action="store_true", help="start paused, until `holozen sim play` or `step`")
    add("--stopped", action="store_true", help="start with the robots stopped, until `holozen release`")
    add("--state", type=Path, metavar="DIR",
        help="keep software stops in files there, for the next sim (default: HOLOZEN_STATE, else none)")  # fmt: skip
    add("--drive", choices=flags.DRIVES, help=flags.DRIVE)
    add("--engine", choices=flags.ENGINES, default=flags.ENGINES[0], help=flags.ENGINE)
    flags.add_robot_sources(parser)
    add(
        "--rtf",
        type=flags.number(*schedule.FACTORS),
        help="real-time factor; 0: as fast as possible (default: the world's)",
    )
    add("--seed", type=flags.count(), default=0, metavar="N",
        help="seed for sensor noise: the same seed gives the same values (default: 0)")  # fmt: skip
    add("--max-linear", type=flags.number(*inputs.LINEAR, "m/s"), default=inputs.MAX_LINEAR, metavar="M/S",
        help="faster commands are clamped (default: %(default)s)")  # fmt: skip
    add("--max-angular", type=flags.number(*inputs.ANGULAR, "rad/s"), default=inputs.MAX_ANGULAR, metavar="RAD/S",
        help="(default: %(default)s)")  # fmt: skip
    for names, advice in (
        (("--name", "-model", "-entity"), flags.NAMED),
        (("--gui", "--headless"), "no sim has a window; `holozen view` shows it in a browser"),
    ):
        add(*names, action=flags.Instead, advice=advice)
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    options = parser()
    args = options.parse_args(argv)
    if args.shard and (args.join or any(not name for _, name in args.robot or ())):
        options.error("--shard gives each robot to the shard of its name: use --robot FILE=NAME, and no --join")
    stop = stop_event()
    try:
        from holozen.robot import loading, reader  # they load numpy, which --help does not need
        from holozen.robot.sdf_world import load_world

        reader.start(loading)
        spec = load_world(args.world, dict(args.package))
        mine, bus = _open(args, stop)
        with bus, contextlib.ExitStack() as ending:
            graph = bus.graph()
            # The engine is slow to load: a wrong flag is reported first.
            from holozen.command.stop_files import StopFiles
            from holozen.transport.parameters import Parameters

            from .cameras import Cameras
            from .entities import Entities
            from .io.entity_services import EntityServices
            from .io.simulation_services import SimulationServices
            from .loop import Loop
            from .parameters import declared
            from .physics.world import World
            from .spawn import add_models, spawn_all

            if args.join:  # the tokens of the other one may still be on their way; without it, this is the first sim
                graph.settled(bus.connected, max(DISCOVERY, bus.took))
            other = _other_sim(graph, mine)
            joins = bool(other) or (mine is not None and mine.number != 1)
            graph.close()
            if other and (reason := _cannot_join(args, mine)):
                report(f"sim: {other} simulates here already; {reason}")
                return 1
            world = World(spec, args.engine)
            where = connection.from_arguments(args).arguments()
            cameras = Cameras(
                bus, key_for("exposures", "" if not joins else mine.node if mine else args.robot[0][1]), where
            )
            ending.callback(cameras.close)
            entities = Entities(bus, world, (args.max_linear, args.max_angular), args.seed, cameras)
            name = mine.node if mine else key_for("sim", args.robot[0][1] if joins else "")
            if folder := args.state or os.environ.get("HOLOZEN_STATE"):
                entities.keep_stops_in(StopFiles(Path(folder), bus.networks))
            add_models(entities, spec.models)
            added = spawn_all(entities, args, mine) if args.robot or not (args.empty or mine) else []
            if args.stopped:
                entities.stop("the start of this sim")
            for warning in spec.warnings:
                report(f"sim: warning: {warning}")
            share = shard.Share(mine, bus) if mine else None
            services = EntityServices(bus, entities, dict(args.package), spawns=not joins or bool(mine), share=share)
            entities.set_start()
            loop = Loop(bus, world, entities, spec.rtf if args.rtf is None else args.rtf, is_clock=not joins)
            loop.answers.append(services.answer)
            loop.answers.append(SimulationServices(bus, loop.simulation, stop.set).answer)
            if args.paused:
                loop.simulation.pause(time.monotonic())
            loop.answers.append(Parameters(bus, name, lambda: declared(entities, loop.pace)).answer)
            rivals = Rivals(entities, bus.id, stop)
            if not joins and not mine:
                loop.answers.append(rivals.answer)
            # Last: a program that waits for this line may ask for all of the above.
            for robot in added:
                report(f"sim: {robot}")
            if mine:
                robots = "its robots do not collide with those of other shards"
                report(f"sim: this is shard {mine}; {robots}; add some with `holozen spawn FILE`")
            elif not entities.robots:
                report("sim: no robot yet; add one with `holozen spawn FILE`")
            loop.run(stop)
            if rivals.first:
                report(f"sim: {rivals.first} simulates here too; {JOIN}")
                return 1
    except (BusError, RobotError) as error:
        report(f"sim: {error}")
        return 1
    return 0


class Rivals:
    """Looks for other sims that serve the keys of the world: one that started in the same instant, or that did not
    discover this one. Of them all, the one with the lowest session id goes on. If that is another one, `first` is its
    source, and `stop` is set.
    """

    def __init__(self, entities: "Entities", session: str, stop: threading.Event) -> None:
        self._entities, self._session, self._stop = entities, session, stop
        self.first = ""

    def answer(self) -> bool:
        """Look, if the graph has changed and another node publishes a clock. Returns False: it answers nothing."""
        if not self.first and self._entities.has_new_clock():
            others = self._entities.others_on("spawn_entity", "srv")
            if first := next((one for one in others if one.session < self._session), None):
                self.first = first.source
                self._stop.set()
        return False


def _open(args: argparse.Namespace, stop: threading.Event) -> tuple[shard.Shard | None, Bus]:
    """The shard that this sim is, if it is one, and its bus. Raises BusError."""
    where = connection.from_arguments(args)
    opened = partial(Bus, connection=where, lasting=True, stop=stop)
    return shard.claim(args.shard, where, opened) if args.shard else (None, opened("sim"))


def _other_sim(graph: Graph, mine: shard.Shard | None) -> str:
    """The source of a sim that already serves the keys of the world; empty if there is none but other shards."""
    clocks = on_key(graph.endpoints(), "clock", "pub")
    return next((end.source for end in clocks if not (mine and shard.is_shard(end.node))), "")


def _cannot_join(args: argparse.Namespace, mine: shard.Shard | None) -> str:
    """Why a sim with these flags cannot run beside another, and what to do; empty if it can."""
    if mine:
        return "end it, or leave out --shard"
    if args.join and args.robot and all(name for _, name in args.robot):
        return ""
    return f"name the robots: {HOW}" if args.join else JOIN


if __name__ == "__main__":
    sys.exit(main())
