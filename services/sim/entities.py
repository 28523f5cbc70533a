"""The entities of the world, robots and objects by name: added, looked up, moved and removed."""

import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, count

from msgspec.structs import replace

from holozen.bus import Bus
from holozen.console import report
from holozen.messages.simulation_interfaces import Result
from holozen.messages.simulation_interfaces import SpawnEntityReply as Spawn
from holozen.robot.errors import RobotError
from holozen.robot.model import Camera, RobotModel
from holozen.robot.rigid import check_shapes
from holozen.rotation import XYZ
from holozen.suggest import listed, suggest
from holozen.wire import MAX_ENTITIES

from .cameras import Cameras
from .entity import Entity
from .errors import EntityError
from .fleet import Fleet
from .identity import Identity
from .io.sensor_topics import Surroundings
from .key_registry import KeyRegistry, check_names
from .other_nodes import OtherNodes
from .physics.body import Placement
from .physics.movers import Mover, mover_for
from .physics.world import World
from .placement import Room
from .robot import Robot
from .scene import Scene


class Entities:
    """The entities of one world.

    Attributes:
        fleet: The robots among them.
        others: The other nodes on the wire.
    """

    def __init__(
        self,
        bus: Bus,
        world: World,
        limits: tuple[float, float],
        seed: int = 0,
        cameras: Cameras | None = None,
    ) -> None:
        """Commands beyond `limits` (m/s, rad/s) are clamped; `seed` is that of all noise."""
        self._bus, self._world, self._cameras = bus, world, cameras
        self._all: dict[str, Entity] = {}
        self._first: list[Entity] = []  # those that a reset restores
        graph = bus.graph()
        self.others = OtherNodes(bus, graph)
        self.fleet = Fleet(bus, graph, *limits)
        self._keys = KeyRegistry(self.others)
        self._room = Room(world, self)
        scene = Scene(world, self)
        self._around = Surroundings(world.spec, scene.look, scene.seen, seed, cameras)

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._world.time

    @property
    def robots(self) -> list[Robot]:
        """The robots, in the order of the entities."""
        return [entity.robot for entity in self if entity.robot]

    def __iter__(self) -> Iterator[Entity]:
        return iter(self._all.values())

    def __contains__(self, name: object) -> bool:
        return name in self._all

    def named(self, name: str) -> Entity:
        """The entity called `name`. Raises EntityError, which lists the names."""
        if name not in self._all:
            near = suggest(name, self._all)
            problem = (
                f"there is no entity {name[:80]!r}{near}; the entities are {listed(self._all)}"
            )
            raise EntityError(Result.NOT_FOUND, problem)
        return self._all[name]

    def free_name(self, wanted: str, owns: Callable[[str], bool] | None = None) -> str:
        """`wanted`, or if that is taken, with the first free number appended. With `owns`, only
        names of this sim.
        """
        taken = {entity.name for entity in self} | {entity.identity.prefix for entity in self}
        names = chain([wanted], (f"{wanted}_{number}" for number in count(1)))
        return next(name for name in names if name not in taken and (owns is None or owns(name)))

    def add(
        self,
        name: str,
        model: RobotModel,
        place: Placement,
        prefix: str | None = None,
        may_overlap: bool = False,
    ) -> Entity:
        """Put a robot or object into the world, with its root frame at `place`, where nothing else
        may be unless it `may_overlap`; it is lifted onto a floor that it is in. Its keys begin with
        `prefix`, by default its name. Raises EntityError: that the name is taken only if nothing
        else is wrong, since a caller then replaces the other entity.
        """
        model = replace(model, drive=None, forces=()) if model.static else model
        identity = Identity(name, name if prefix is None else prefix, model)
        mover = self._mover(model, place)
        try:
            check_names(identity)
            if not may_overlap:
                (x, y, z), rotation = place
                place = (x, y, z + self._room.fit(identity, mover.body)), rotation
            self._keys.check(identity, self._all)
            self._check_count(name)
            entity = Entity(identity, mover.body, place, self._robot(identity, mover))
        except Exception:
            mover.body.remove()
            raise
        self._all[name] = entity
        if entity.robot:
            self._keys.add(identity)
            self.fleet.add(entity.robot, time.monotonic())
        return entity

    def _mover(self, model: RobotModel, place: Placement) -> Mover:
        try:
            check_shapes(model)
            return mover_for(self._world, model, *place)
        except RobotError as error:
            raise EntityError(Spawn.RESOURCE_PARSE_ERROR, str(error)) from None

    def _check_count(self, name: str) -> None:
        """Raise EntityError if the name is taken, or there are too many entities."""
        if name in self._all:
            there = listed(self._all)
            problem = f"there is an entity {name!r} already; the entities are {there}"
            raise EntityError(Spawn.NAME_NOT_UNIQUE, problem)
        if len(self._all) >= MAX_ENTITIES:
            problem = f"there are {MAX_ENTITIES} entities, the most that are simulated; delete some"
            raise EntityError(Result.OPERATION_FAILED, problem)

    def _robot(self, identity: Identity, mover: Mover) -> Robot | None:
        """What is on the wire of an entity; None if it has neither drive, joints nor sensors."""
        model, fleet = identity.model, self.fleet
        if not (model.drive or mover.names or model.sensors):
            return None
        if self._cameras and any(isinstance(sensor.device, Camera) for sensor in model.sensors):
            self._cameras.start()
        keep_stop = partial(fleet.stops.keep, identity.wire_name)
        phase = fleet.next_phase
        return Robot(self._bus, identity, mover, fleet.rules, self._around, phase, keep_stop)

    def put(self, name: str, place: Placement, linear: XYZ, angular: XYZ) -> None:
        """Move an entity to a free place, and set its velocity (m/s) and rotation rate (rad/s) in
        the world. Raises EntityError, and then it stays where it is.
        """
        entity = self.named(name)
        before = *entity.body.pose(), *entity.body.twist()
        self._world.put(entity.body, place, linear, angular)
        try:
            self._room.fit(entity.identity, entity.body, Result.OPERATION_FAILED)
        except EntityError:
            self._world.put(entity.body, before[:2], *before[2:])
            raise

    def remove(self, name: str) -> None:
        """Remove an entity from the world, and its keys from the wire. Raises EntityError."""
        entity = self.named(name)
        del self._all[name]
        if entity.robot:
            self.fleet.remove(entity.robot)
            self._keys.remove(name)
        entity.body.remove()

    def remove_failed(self, robot: Robot, error: Exception) -> None:
        """Remove a robot that can no longer be simulated, if it is still there, so that the others
        go on.
        """
        for entity in list(self):
            if entity.robot is robot:
                report(f"sim: {entity.name} was removed from the world: {error}")
                self.remove(entity.name)

    def remove_lost(self, error: Exception) -> None:
        """After a step failed with `error`, remove all entities whose pose or velocity is not
        finite. Raises the error if there are none.
        """
        lost = [entity.name for entity in self if not entity.is_finite]
        if not lost:
            raise error
        for name in lost:
            why = f"its pose or velocity is not finite: {error}"
            report(f"sim: {name} was removed from the world: {why}")
            self.remove(name)

    def set_start(self) -> None:
        """Let a reset restore the entities that there are now."""
        self._first = list(self)

    def remove_spawned(self) -> None:
        """Remove all entities that were added after `set_start`."""
        for entity in [entity for entity in self if entity not in self._first]:
            self.remove(entity.name)

    def rebuild(self, from_start: bool) -> None:
        """Put every entity, or with `from_start` those of the start, where it was added, in an
        empty world.
        """
        self._world.clear()
        before, self._all = self._all, {}
        for index, entity in enumerate(self._first if from_start else list(before.values())):
            if before.get(entity.name) is entity:
                self._rebuild(entity)
                continue
            prefix = entity.identity.prefix
            try:  # it has been deleted since the start
                restored = self.add(
                    entity.name, entity.model, entity.place, prefix, may_overlap=True
                )
                self._first[index] = restored
            except EntityError as error:
                report(f"sim: {entity.name} did not come back: {error}")

    def _rebuild(self, entity: Entity) -> None:
        mover = self._mover(entity.model, entity.place)
        entity.body = mover.body
        if entity not in self._first:
            other = self._room.overlapped(entity.identity, entity.body)
            if other:
                self._world.free_place(entity.body)
                where = f"was added where {other.name} is now; it is put beside that"
                report(f"sim: {entity.name} {where}")
        self._all[entity.name] = entity
        if entity.robot:
            entity.robot.rebuild(mover)
