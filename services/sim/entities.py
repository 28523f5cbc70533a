"""The entities of the world, robots and objects by name: added, looked up, moved and removed."""

import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, count

from msgspec import Struct, field
from msgspec.structs import replace

from holozen.bus import Bus
from holozen.command.arbiter import CommandTime
from holozen.command.stop_files import StopFiles
from holozen.command.stop_services import RobotServices
from holozen.command.wait_set import Moment, WaitSet
from holozen.console import report
from holozen.messages import Pose, SeenEntity
from holozen.messages.simulation_interfaces import Result
from holozen.messages.simulation_interfaces import SpawnEntityReply as Spawn
from holozen.robot.errors import RobotError
from holozen.robot.keys import command_key, keys_of, shared
from holozen.robot.model import MOVING, Camera, RobotModel
from holozen.robot.rigid import check_shapes
from holozen.rotation import XYZ, XYZW
from holozen.suggest import listed
from holozen.transport.errors import ServiceError
from holozen.transport.graph import Endpoint, on_key
from holozen.wire import COMMAND_SILENCE, MAX_ENTITIES, SERVICES, key_for, robot_name

from .cameras import Cameras
from .io.sensor_topics import LinkStates, Surroundings
from .link_states import LinkState, link_tree
from .physics.body import Body
from .physics.movers import Mover, mover_for
from .physics.ray_caster import RayCaster
from .physics.world import SUNK, World
from .robot import Memory, Robot
from .schedule import Agenda

MAX_REASON = 300  # characters
GRAPH_SCAN = 0.02  # s between two scans of all tokens for the senders of commands
MAX_DISTANCE = 1e4  # m from the origin; far beyond, the engine's numbers are too coarse for contacts
BURSTS = 4  # in which the robots' telemetry of a period is sent: Zenoh takes less time for many messages at once
KEYS = {"clock", "simulation_status"}  # of the sim itself
Place = tuple[XYZ, XYZW]


class EntityError(ServiceError):
    """A request about an entity that cannot be granted, with its `Result` code of simulation_interfaces."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text, result={"result": code, "error_message": text})
        self.code = code


class Entity(Struct, eq=False):
    """A robot or object by its name. Without a `robot` it has no keys. A robot's keys begin with `prefix`. `number`
    distinguishes it from all others that have had its name.
    """

    name: str
    model: RobotModel
    body: Body
    place: Place  # where it was added
    robot: Robot | None = None
    prefix: str = ""
    number: int = field(default_factory=time.time_ns)


class Entities:
    """The entities of one world. Commands beyond `limits` (m/s, rad/s) are clamped; `seed` is that of all noise."""

    def __init__(
        self, bus: Bus, world: World, limits: tuple[float, float], seed: int = 0, cameras: Cameras | None = None
    ) -> None:
        self._bus, self._world, self.limits = bus, world, limits
        self._graph = bus.graph()
        self._clocks = bus.peer_clocks(self._graph.has)
        self.command_time = CommandTime()
        self._first: list[Entity] = []  # those that a reset restores
        self.max_age = COMMAND_SILENCE  # s; a command that may be older is refused, unless it is a stop
        self._scanned = -1  # the graph's count of changes when it was last scanned for senders of commands
        self._scanned_at = 0.0  # s; when that was
        self._clocks_seen = -1  # the graph's count of changes when it was last scanned for clocks
        self._all: dict[str, Entity] = {}
        self.memories: dict[str, Memory] = {}  # place on the wire -> state of the last robot there
        self._stops: StopFiles | None = None
        self._keys: dict[str, str] = {}  # of all robots: key -> robot's name
        self.robots: list[Robot] = []
        self.agenda: Agenda[Robot] = Agenda()
        self._rays: RayCaster | None = None  # made when the first sensor measures
        self._traced: dict[str, int] = {}  # numbers of the entities in `_rays`, by name
        self._cameras = cameras
        self._around = Surroundings(world.spec, self.look, self.seen, seed, cameras)
        # What moves or stops the robots, and all other requests.
        self.commands, self.requests = WaitSet(), WaitSet()

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._world.time

    def __iter__(self) -> Iterator[Entity]:
        return iter(self._all.values())

    def has(self, name: str) -> bool:
        """Whether there is an entity called `name`."""
        return name in self._all

    def named(self, name: str) -> Entity:
        """The entity called `name`. Raises EntityError, which lists the names."""
        if name not in self._all:
            raise EntityError(
                Result.NOT_FOUND, f"there is no entity {name[:80]!r}; the entities are {listed(self._all)}"
            )
        return self._all[name]

    def add(
        self, name: str, model: RobotModel, place: Place, prefix: str | None = None, may_overlap: bool = False
    ) -> Entity:
        """Put a robot or object into the world, with its root frame at `place`, where nothing else may be unless it
        `may_overlap`. Its keys begin with `prefix`, by default its name. Raises EntityError: that the name is taken
        only if nothing else is wrong, since a caller then replaces the other entity.
        """
        prefix = name if prefix is None else prefix
        model = replace(model, drive=None, forces=()) if model.static else model
        mover = self._mover(model, place)
        try:
            self._check_names(name, prefix)
            if not may_overlap:
                self._check_place(name, model, mover.body)
            self._check_unique(name, prefix, model)
            entity = Entity(name, model, mover.body, place, prefix=prefix)
            if model.drive or mover.names or model.sensors:
                phase = len(self.robots) % BURSTS / BURSTS
                keep_stop = partial(self._keep_stop, _place_of(model, prefix))
                entity.robot = Robot(
                    self._bus, name, prefix, model, mover, self.limits, self._clocks, phase, self.command_time,
                    keep_stop,
                )  # fmt: skip
                entity.robot.require_age(self.max_age)
                if self._cameras and any(isinstance(sensor.device, Camera) for sensor in model.sensors):
                    self._cameras.start()
                if model.sensors:
                    entity.robot.add_sensors(self._bus, name, self._around, phase)
        except Exception:
            mover.body.remove()
            raise
        self._all[name] = entity
        if entity.robot:
            self._keys |= dict.fromkeys((key for key, _ in keys_of(model, prefix)), name)
            self._remember(_place_of(model, prefix), entity.robot)
            self.robots.append(entity.robot)
            entity.robot.schedule_on(self.agenda)
            self.commands.add(entity.robot.command_readers)
            self.requests.add(entity.robot.request_readers)
        return entity

    def put(self, name: str, place: Place, linear: XYZ, angular: XYZ) -> None:
        """Move an entity to a free place, and set its velocity (m/s) and rotation rate (rad/s) in the world. Raises
        EntityError, and then it stays where it is.
        """
        entity = self.named(name)
        before = *entity.body.pose(), *entity.body.twist()
        self._world.put(entity.body, place, linear, angular)
        try:
            self._check_place(name, entity.model, entity.body, Result.OPERATION_FAILED)
        except EntityError:
            self._world.put(entity.body, before[:2], *before[2:])
            raise

    def limit(self, linear: float, angular: float) -> None:
        """Clamp the commands of all robots to these limits, in m/s and rad/s, from the next command on."""
        self.limits = (linear, angular)
        for robot in self.robots:
            robot.limit(linear, angular)

    def stop(self, by: str) -> None:
        """Set the software stop of all robots."""
        for robot in self.robots:
            for arbiter in robot.memory:
                arbiter.stop(by, time.monotonic())
        for place in self.memories:
            self._keep_stop(place)

    def keep_stops_in(self, stops: StopFiles) -> None:
        """From now on, stop each robot that is added if its file says so, and keep the files up to date."""
        self._stops = stops

    def _keep_stop(self, place: str) -> str:
        """Write to its file who stopped a robot. Returns why it is not kept, or ""."""
        return self._stops.write(place, self.memories[place][0].software_stop.setter) if self._stops else ""

    def require_age(self, limit: float) -> None:
        """From now on, refuse commands that may be older than `limit` seconds, except stops."""
        self.max_age = limit
        for robot in self.robots:
            robot.require_age(limit)

    def watch_senders(self, moment: Moment) -> None:
        """Stop every robot whose driver's process is gone, and measure the clocks of all senders of commands."""
        now = moment.now
        left = list(self._graph.left())
        if left:
            self.commands.read(moment)  # the last commands of those that left
        for node in left:
            for robot in self.robots:
                robot.forget(node.source, node.session)
        if self._graph.changes != self._scanned and now - self._scanned_at > GRAPH_SCAN:
            self._scanned, self._scanned_at = self._graph.changes, now
            keys = {key for robot in self.robots for key in robot.command_keys}
            self._clocks.track({session for key in keys for session in self._graph.publishers(key)}, now)
        self._clocks.poll(now)

    def has_new_clock(self) -> bool:
        """Whether another node publishes `clock`, and the graph has changed since the last call."""
        clocks, seen = self._graph.publishers("clock"), self._clocks_seen
        self._clocks_seen = self._graph.changes
        return seen != self._graph.changes and any(session != self._bus.id for session in clocks)

    def others_on(self, key: str, kind: str) -> list[Endpoint]:
        """The endpoints of a kind that other nodes have on a key."""
        return [end for end in on_key(self._graph.endpoints(), key, kind) if end.session != self._bus.id]

    def fail(self, robot: Robot, error: Exception) -> None:
        """Remove a robot that can no longer be simulated, so that the others go on."""
        name = next(entity.name for entity in self if entity.robot is robot)
        report(f"sim: {name} was removed from the world: {error}")
        self.remove(name)

    def remove_lost(self, error: Exception) -> None:
        """After a step failed with `error`, remove all entities whose pose or velocity is not finite. Raises the error
        if there are none.
        """
        lost = [entity.name for entity in self if not _is_finite(entity.body)]
        if not lost:
            raise error
        for name in lost:
            report(f"sim: {name} was removed from the world: its pose or velocity is not finite: {error}")
            self.remove(name)

    def _mover(self, model: RobotModel, place: Place) -> Mover:
        try:
            check_shapes(model)
            return mover_for(self._world, model, *place)
        except RobotError as error:
            raise EntityError(Spawn.RESOURCE_PARSE_ERROR, str(error)) from None

    def _check_place(self, name: str, model: RobotModel, body: Body, code: int = Spawn.INVALID_POSE) -> None:
        """Raise EntityError if a body is deep in the ground or in another one: the engine would throw it out. An entity
        of the same name does not count: either the name is refused, or that entity is replaced. With its root frame on
        the ground a body may be in it: programs that give no height send 0, wherever the root frame is.
        """
        at = body.pose()[0]
        if not model.static and at[2] < -SUNK and (depth := self._world.sunk(body)):
            problem = f"there is no room for {name!r} at {_at(at)} z {_metres(at[2])}"
            advice = f"the lowest free z is {_metres(at[2] + depth)}"
            raise EntityError(code, f"{problem}: it would be {_metres(depth)} m below the ground; {advice}")
        if not (other := self._overlapped(name, model, body)):
            return
        problem = f"there is no room for {name!r} at {_at(at)}: it would be inside {other.name!r}"
        free = self._world.free_place(body)
        advice = f"the nearest free place is {_at(free)}" if free else "use another place"
        raise EntityError(code, f"{problem}; {advice}")

    def _overlapped(self, name: str, model: RobotModel, body: Body) -> Entity | None:
        """The entity that a body overlaps, if either of them can move."""
        if not (numbers := self._world.overlapped(body)):
            return None
        entities = {entity.body.number: entity for entity in self if entity.name != name}
        found = (entities[number] for number in numbers if number in entities)
        return next((entity for entity in found if not (entity.model.static and model.static)), None)

    def _remember(self, place: str, robot: Robot) -> None:
        """A respawned robot inherits held sources and the software stop; one that was in another sim, the stop."""
        if old := self.memories.pop(place, None):
            robot.inherit(old, time.monotonic())
        self.memories[place] = robot.memory
        if self._stops and (by := self._stops.read(place)):
            for arbiter in robot.memory:
                arbiter.stop(by, time.monotonic())
        self._keep_stop(place)
        if setter := robot.arbiter.software_stop.setter:
            report(f"sim: {place or 'the robot'} is still stopped by {setter}; `holozen release` lets it drive again")
        if len(self.memories) > MAX_ENTITIES:
            live = {robot.arbiter, *(robot.arbiter for robot in self.robots)}
            gone = [place for place, (arbiter, *_) in self.memories.items() if arbiter not in live]
            not_stopped = (place for place in gone if not self.memories[place][0].software_stop.setter)
            del self.memories[forgotten := next(not_stopped, gone[0])]  # a stop is forgotten last
            if self._stops:
                self._stops.forget(forgotten)

    def remove(self, name: str) -> None:
        """Remove an entity from the world, and its keys from the wire. Raises EntityError."""
        entity = self.named(name)
        del self._all[name]
        if entity.robot:
            self.robots.remove(entity.robot)
            self.commands.remove(entity.robot.command_readers)
            self.requests.remove(entity.robot.request_readers)
            entity.robot.close()
            self._keys = {key: owner for key, owner in self._keys.items() if owner != name}
        entity.body.remove()

    def set_start(self) -> None:
        """Let a reset restore the entities that there are now."""
        self._first = list(self)

    def remove_spawned(self) -> None:
        """Remove all entities that were added after `set_start`."""
        for entity in [entity for entity in self if entity not in self._first]:
            self.remove(entity.name)

    def rebuild(self, from_start: bool) -> None:
        """Put every entity, or with `from_start` those of the start, where it was added, in an empty world."""
        self._world.clear()
        before, self._all = self._all, {}
        for index, entity in enumerate(self._first if from_start else list(before.values())):
            if before.get(entity.name) is entity:
                mover = self._mover(entity.model, entity.place)
                entity.body = mover.body
                if entity not in self._first and (other := self._overlapped(entity.name, entity.model, entity.body)):
                    self._world.free_place(entity.body)
                    report(f"sim: {entity.name} was added where {other.name} is now; it is put beside that")
                self._all[entity.name] = entity
                if entity.robot:
                    entity.robot.rebuild(mover)
                continue
            try:  # it has been deleted since the start
                self._first[index] = self.add(entity.name, entity.model, entity.place, entity.prefix, may_overlap=True)
            except EntityError as error:
                report(f"sim: {entity.name} did not come back: {error}")
        self.robots[:] = [entity.robot for entity in self if entity.robot]

    def look(self) -> RayCaster:
        """The ray caster, with all entities where they are now."""
        if self._rays is None:
            self._rays = self._world.ray_caster()
        for name, number in list(self._traced.items()):
            if name not in self._all or self._all[name].number != number:
                self._rays.remove(name)
                del self._traced[name]
        for entity in self:
            if entity.name not in self._traced:
                self._rays.add(entity.name, entity.model)
                self._traced[entity.name] = entity.number
            if self._rays.has_moved(entity.name, pose := entity.body.pose()) or entity.robot:
                self._rays.place(entity.name, pose, _link_states(entity))
        return self._rays

    def seen(self) -> list[SeenEntity]:
        """All entities with the poses of their links, for cameras."""
        return [_seen(entity) for entity in self]

    def free_name(self, wanted: str, owns: Callable[[str], bool] | None = None) -> str:
        """`wanted`, or if that is taken, with the first free number appended. With `owns`, only names of this sim."""
        taken = {entity.name for entity in self} | {entity.prefix for entity in self}
        names = chain([wanted], (f"{wanted}_{number}" for number in count(1)))
        return next(name for name in names if name not in taken and (owns is None or owns(name)))

    def _check_names(self, name: str, prefix: str) -> None:
        for text, code in ((name, Spawn.NAME_INVALID), (prefix, Spawn.NAMESPACE_INVALID)):
            try:
                robot_name(text or "root")
            except ValueError as error:
                raise EntityError(code, str(error)[:MAX_REASON]) from None

    def _check_unique(self, name: str, prefix: str, model: RobotModel) -> None:
        if has_keys(model):
            self._check_keys(name, model, prefix)
        if model.drive:
            self._check_alone(name, key_for(model.drive.odometry_topic, prefix))
        if name in self._all:
            there = listed(self._all)
            raise EntityError(Spawn.NAME_NOT_UNIQUE, f"there is an entity {name!r} already; the entities are {there}")
        if len(self._all) >= MAX_ENTITIES:
            raise EntityError(
                Result.OPERATION_FAILED, f"there are {MAX_ENTITIES} entities, the most that are simulated; delete some"
            )

    def _check_keys(self, name: str, model: RobotModel, prefix: str) -> None:
        """Raise EntityError if another robot, or the sim, has one of the keys: each would get the other's commands."""
        taken = {row.key for row in SERVICES if row.server == "sim"} - {*RobotServices.VERBS} | KEYS
        keys = dict(keys_of(model, prefix))
        problem = shared(model, prefix)[1]
        if of_sim := taken & keys.keys():
            key = min(of_sim)
            problem = f"the robot's file puts {keys[key]} on the sim's own key {key!r}; give it another topic there"
        if problem:
            raise EntityError(Spawn.NAMESPACE_INVALID, problem)
        if both := {key for key in self._keys.keys() & keys.keys() if self._keys[key] != name}:
            advice = f"delete that one, or use {'another' if prefix else 'a'} namespace"
            advice = "use another name" if prefix == name else advice
            problem = f"{min(both)} is the key of {self._keys[min(both)]!r}; {advice}"
            raise EntityError(self._conflict(name), problem)

    def _conflict(self, name: str) -> int:
        """The code where another robot has a key. It is not that of a name that is taken where an entity of that name
        would be replaced, since that one stays.
        """
        return Spawn.NAMESPACE_INVALID if name in self._all else Spawn.NAME_NOT_UNIQUE

    def _check_alone(self, name: str, key: str) -> None:
        """Raise EntityError if another node publishes on the key: two sims would each get the other's commands."""
        if not self._graph.publishers(key):  # nearly always, and the graph of a fleet is large
            return
        for other in self.others_on(key, "pub"):
            problem = f"{key} is published by {other.node} ({other.session[:6]}) already"
            raise EntityError(self._conflict(name), f"{problem}; end that one, or use another name: --robot FILE=NAME")


def _at(position: XYZ) -> str:
    return f"x {_metres(position[0])} y {_metres(position[1])}"


def _metres(length: float) -> str:
    return f"{round(length, 2) + 0.0:.10g}"  # no -0


def _place_of(model: RobotModel, prefix: str) -> str:
    """The place of a robot on the wire: its prefix, or without one the namespace in its file."""
    return prefix or command_key(model, prefix).rpartition("/")[0]


def has_keys(model: RobotModel) -> bool:
    """Whether a model has keys: it has a drive, sensors, or moving joints."""
    return bool(model.drive or model.sensors) or any(joint.kind in MOVING for joint in model.joints.values())


def checked_place(position: XYZ, rotation: XYZW) -> Place:
    """A place that came over the wire, with its rotation normalized. Raises EntityError."""
    if not all(map(math.isfinite, (*position, *rotation))) or max(map(abs, position)) > MAX_DISTANCE:
        raise EntityError(Spawn.INVALID_POSE, f"position {position}: use finite numbers up to {MAX_DISTANCE:g} m")
    length = math.hypot(*rotation)
    if not 0.9 < length < 1.1:
        raise EntityError(Spawn.INVALID_POSE, f"orientation {rotation} is not a unit quaternion x, y, z, w")
    x, y, z, w = (part / length for part in rotation)
    return position, (x, y, z, w)


def _is_finite(body: Body) -> bool:
    return all(math.isfinite(sum(part)) for part in (*body.pose(), *body.twist()))


def _link_states(entity: Entity) -> LinkStates:
    """The states of its links; for an object without joints they follow from its root, which is taken to stand."""
    if entity.robot:
        return entity.robot.link_states()
    return link_tree(entity.model).states(LinkState(*entity.body.pose()))


def _seen(entity: Entity) -> SeenEntity:
    links = _link_states(entity)
    poses = [Pose.of(at.xyz, at.rotation) for at in links.values()]
    return SeenEntity(entity.name, entity.number, list(links), poses)
