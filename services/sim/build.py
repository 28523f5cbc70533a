"""Puts a sim together from its flags."""

import argparse
import contextlib
import os
import threading
import time
from pathlib import Path

from holozen import flags
from holozen.bus import Bus
from holozen.command.stop_files import StopFiles
from holozen.console import report
from holozen.engines import Choice
from holozen.robot.model import WorldSpec
from holozen.transport import connection
from holozen.transport.errors import BusError
from holozen.transport.parameters import Parameters

from .cameras import Cameras
from .entities import Entities
from .falling import Falling
from .io.entity_services import EntityServices
from .io.simulation_services import SimulationServices
from .joining import JOIN, Standing
from .loop import Loop
from .other_nodes import Rivals
from .parameters import declared
from .physics.world import World
from .safeguards import Safeguards
from .shard import Share
from .spawn import add_models, spawn_all


class Sim:
    """A sim that is ready to run.

    Attributes:
        loop: What steps its world.
    """

    def __init__(self, loop: Loop, rivals: Rivals, cameras: Cameras) -> None:
        self.loop = loop
        self._rivals, self._cameras = rivals, cameras

    def run(self, stop: threading.Event) -> None:
        """Run until `stop` is set. Raises BusError if another sim goes on in its place."""
        self.loop.run(stop)
        if self._rivals.winner:
            raise BusError(f"{self._rivals.winner} simulates here too; {JOIN}")

    def close(self) -> None:
        """End what runs beside it."""
        self._cameras.close()


def build(
    args: argparse.Namespace,
    choice: Choice,
    spec: WorldSpec,
    bus: Bus,
    standing: Standing,
    stop: threading.Event,
) -> Sim:
    """A sim with these flags on the engine of `choice`, and its robots; what can be asked of it is
    served from now on. `stop` is set when it is to end. Raises RobotError, and then leaves no
    process behind.
    """
    world = World(spec, choice.engine)
    cameras = Cameras(bus, standing.exposures_key, connection.from_arguments(args).arguments())
    with contextlib.ExitStack() as undo:
        undo.callback(cameras.close)
        entities = Entities(bus, world, (args.max_linear, args.max_angular), args.seed, cameras)
        files = entities.fleet.stops.files = _stop_files(args, bus)
        added = _populate(entities, args, spec, standing)
        share = Share(standing.shard, bus) if standing.shard else None
        services = EntityServices(bus, entities, dict(args.package), standing.spawns, share)
        pace = spec.rtf if args.rtf is None else args.rtf
        loop = Loop(bus, world, entities, pace, standing.serves_world, str(choice))
        loop.safeguard = Safeguards(bus, entities.fleet, files.write if files else None).poll
        loop.answers += [services.answer, Falling(entities, spec.gravity[2]).look]
        loop.answers.append(SimulationServices(bus, loop.simulation, stop.set).answer)
        if args.paused:
            loop.simulation.pause(time.monotonic())
        parameters = Parameters(bus, standing.parameter_node, lambda: declared(entities, loop.pace))
        loop.answers.append(parameters.answer)
        rivals = Rivals(entities.others, stop)
        if standing.is_alone:
            loop.answers.append(rivals.look)
        if args.engine == flags.AUTO:
            report(f"sim: the engine is {choice}")
        _announce(added, entities, standing)
        undo.pop_all()
    return Sim(loop, rivals, cameras)


def _stop_files(args: argparse.Namespace, bus: Bus) -> StopFiles | None:
    folder = args.state or os.environ.get("HOLOZEN_STATE")
    return StopFiles(Path(folder), bus.networks) if folder else None


def _populate(
    entities: Entities,
    args: argparse.Namespace,
    spec: WorldSpec,
    standing: Standing,
) -> list[str]:
    """Add what a reset restores: the models of the world and the robots of the flags. Returns what
    is to be announced of the robots.
    """
    add_models(entities, spec.models)
    has_robots = args.robot or not (args.empty or standing.shard)
    added = spawn_all(entities, args, standing.shard) if has_robots else []
    if args.stopped:
        entities.fleet.stop_all("the start of this sim")
    for warning in spec.warnings:
        report(f"sim: warning: {warning}")
    entities.set_start()
    return added


def _announce(added: list[str], entities: Entities, standing: Standing) -> None:
    """Report what runs. A program that waits for these lines may ask for all that is served."""
    for robot in added:
        report(f"sim: {robot}")
    if standing.shard:
        robots = "its robots do not collide with those of other shards"
        report(f"sim: this is shard {standing.shard}; {robots}; add some with `holozen spawn FILE`")
    elif not entities.robots:
        report("sim: no robot yet; add one with `holozen spawn FILE`")
