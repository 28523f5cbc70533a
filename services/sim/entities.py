"""The entities of the world, robots and objects by name: added, looked up, moved and removed."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

from holozen.bus import Bus
from holozen.console import report
from holozen.messages import simulation_interfaces as si
from holozen.robot.errors import RobotError
from holozen.robot.model import RobotModel
from holozen.robot.rigid import MOVING
from holozen.suggest import listed
from holozen.transport.errors import ServiceError
from holozen.transport.graph import on_key
from holozen.wire import COMMAND_SILENCE, SERVICES, key_for, robot_name

from .io.robot_services import RobotServices
from .physics.body import Body
from .physics.engine import Rotation, Vector
from .physics.movers import Mover, mover_for
from .physics.world import World
from .robot import Memory, Robot, keys_of

MAX_ENTITIES = 1000  # each takes time at every step
MAX_SHAPES = 500  # of one entity: each that touches the ground costs the engine 50 us at every step
MAX_REASON = 300  # characters
GRAPH_SCAN = 0.02  # s between two scans of all tokens for the senders of commands
MAX_DISTANCE = 1e4  # m from the origin; far beyond, the engine's numbers are too coarse for contacts
SPREAD = 0.618  # of a period between the telemetry of a robot and that of the next; the golden ratio spreads any number
Place = tuple[Vector, Rotation]


class EntityError(ServiceError):
    """A request about an entity that cannot be granted, with its `Result` code of simulation_interfaces."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text, result={"result": code, "error_message": text})


@dataclass(slots=True)
class Entity:
    """A robot or object by its name. Without a `robot` it has no keys. `prefix` goes before the keys of a robot."""

    name: str
    model: RobotModel
    body: Body
    robot: Robot | None = None
    prefix: str = ""


class Entities:
    """The entities of one world. `limits` are the fastest commands in m/s and rad/s."""

    def __init__(self, bus: Bus, world: World, limits: tuple[float, float]) -> None:
        self._bus, self._world, self.limits = bus, world, limits
        self._graph = bus.graph()
        self._clocks = bus.peer_clocks(self._graph.has)
        self.max_age = COMMAND_SILENCE  # s; a command that may be older is refused, unless it is a stop
        self._seen = -1  # changes of the graph at its last scan, and the time of that
        self._seen_at = 0.0
        self._all: dict[str, Entity] = {}
        self.before: dict[str, Memory] = {}  # prefix -> held sources and software stop of the last robot there
        self._keys: dict[str, str] = {}  # those of all robots, with the robot's name
        self.robots: list[Robot] = []

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._world.time

    def __iter__(self) -> Iterator[Entity]:
        return iter(self._all.values())

    def named(self, name: str) -> Entity:
        """The entity called `name`. Raises EntityError, which lists the names."""
        if name not in self._all:
            raise EntityError(
                si.Result.NOT_FOUND, f"there is no entity {name[:80]!r}; the entities are {listed(list(self._all))}"
            )
        return self._all[name]

    def add(self, name: str, model: RobotModel, place: Place, prefix: str | None = None) -> Entity:
        """Put a robot or object into the world, its root frame at `place`. Its keys are below `prefix`, by default its
        name. Errors of the robot are reported before those of its name. Raises EntityError.
        """
        prefix = name if prefix is None else prefix
        model = replace(model, drive=None) if model.static else model
        mover = self._mover(model, place)
        try:
            self._check(name, prefix, model)
            entity = Entity(name, model, mover.body, prefix=prefix)
            if model.drive or mover.names:
                phase = len(self.robots) * SPREAD % 1.0
                entity.robot = Robot(self._bus, name, prefix, model, mover, self.limits, self._clocks, phase)
                entity.robot.require_age(self.max_age)
        except Exception:
            mover.body.remove()
            raise
        self._all[name] = entity
        if entity.robot:
            self._keys |= dict.fromkeys(keys_of(model, prefix), name)
            self._remember(prefix, entity.robot)
            self.robots.append(entity.robot)
        return entity

    def limit(self, linear: float, angular: float) -> None:
        """Clamp the next commands of all robots to these limits, in m/s and rad/s."""
        self.limits = (linear, angular)
        for robot in self.robots:
            robot.limit(linear, angular)

    def stop(self, by: str) -> None:
        """Set the software stop of all robots."""
        for robot in self.robots:
            for arbiter in robot.memory:
                arbiter.stop(by, time.monotonic())

    def require_age(self, limit: float) -> None:
        """Refuse commands that may be older than `limit` seconds, except stops, from now on."""
        self.max_age = limit
        for robot in self.robots:
            robot.require_age(limit)

    def watch_senders(self, now: float) -> None:
        """Stop every robot whose driver's process is gone, and measure the clocks of the others."""
        for node in self._graph.left():
            for robot in self.robots:
                robot.forget(node.source, node.session)
        if self._graph.changes != self._seen and now - self._seen_at > GRAPH_SCAN:
            self._seen, self._seen_at = self._graph.changes, now
            keys = {key for robot in self.robots for key in robot.command_keys}
            self._clocks.track({session for key in keys for session in self._graph.publishers(key)}, now)
        self._clocks.poll(now)

    def fail(self, robot: Robot, error: Exception) -> None:
        """Remove a robot that cannot be simulated any more, so that the others go on."""
        name = next(entity.name for entity in self if entity.robot is robot)
        report(f"sim: {name} was removed from the world: {error}")
        self.remove(name)

    def _mover(self, model: RobotModel, place: Place) -> Mover:
        if (shapes := sum(len(link.collisions) for link in model.links.values())) > MAX_SHAPES:
            problem = f"{model.name[:80]!r} has {shapes} collision shapes; at most {MAX_SHAPES} are simulated"
            raise EntityError(si.SpawnEntityReply.RESOURCE_PARSE_ERROR, problem)
        try:
            return mover_for(self._world, model, *place)
        except RobotError as error:
            raise EntityError(si.SpawnEntityReply.RESOURCE_PARSE_ERROR, str(error)) from None

    def _remember(self, prefix: str, robot: Robot) -> None:
        """A respawned robot inherits held sources and the software stop."""
        if old := self.before.pop(prefix, None):
            robot.inherit(old)
        self.before[prefix] = robot.memory
        if setter := robot.arbiter.software_stop.setter:
            report(
                f"sim: {prefix or 'the robot'} is still stopped by {setter}, as the robot before it; `holozen release`"
            )
        while len(self.before) > MAX_ENTITIES:
            free = (prefix for prefix, (arbiter, _) in self.before.items() if not arbiter.software_stop.setter)
            del self.before[next(free, next(iter(self.before)))]  # a stop is forgotten last

    def remove(self, name: str) -> None:
        """Remove an entity from the world, and its keys from the wire. Raises EntityError."""
        entity = self.named(name)
        del self._all[name]
        if entity.robot:
            self.robots.remove(entity.robot)
            entity.robot.close()
            self._keys = {key: owner for key, owner in self._keys.items() if owner != name}
        entity.body.remove()

    def free_name(self, wanted: str) -> str:
        """`wanted`, with the first free number appended if it is taken."""
        taken = {entity.name for entity in self} | {entity.prefix for entity in self}
        names = (wanted, *(f"{wanted}_{number}" for number in range(1, MAX_ENTITIES + 2)))
        return next(name for name in names if name not in taken)

    def _check(self, name: str, prefix: str, model: RobotModel) -> None:
        for text, code in ((name, si.SpawnEntityReply.NAME_INVALID), (prefix, si.SpawnEntityReply.NAMESPACE_INVALID)):
            try:
                robot_name(text or "root")
            except ValueError as error:
                raise EntityError(code, str(error)[:MAX_REASON]) from None
        if name in self._all:
            there = listed(list(self._all))
            raise EntityError(
                si.SpawnEntityReply.NAME_NOT_UNIQUE, f"there is an entity {name!r} already; the entities are {there}"
            )
        if len(self._all) >= MAX_ENTITIES:
            raise EntityError(
                si.Result.OPERATION_FAILED,
                f"there are {MAX_ENTITIES} entities, the most that are simulated; delete some",
            )
        if has_keys(model):
            self._check_keys(keys_of(model, prefix))
        if model.drive:
            self._check_alone(key_for(model.drive.odometry_topic, prefix))

    def _check_keys(self, keys: list[str]) -> None:
        """Two robots on the same keys would each get the other's commands, and so would one on a key of the sim."""
        taken = {row.key for row in SERVICES if row.server == "sim"} - {*RobotServices.VERBS} | {"clock"}
        for key in keys:
            if keys.count(key) > 1 or key in taken:
                raise EntityError(
                    si.SpawnEntityReply.NAMESPACE_INVALID, f"the robot's file puts two things on the key {key[:80]!r}"
                )
        if both := self._keys.keys() & keys:
            problem = f"{min(both)} is the key of {self._keys[min(both)]!r}; use another name"
            raise EntityError(si.SpawnEntityReply.NAME_NOT_UNIQUE, problem)

    def _check_alone(self, key: str) -> None:
        """Two sims on the same keys would each get the other's commands."""
        if not self._graph.publishers(key):  # nearly always, and the graph of a fleet is large
            return
        others = on_key(self._graph.endpoints(), key, "pub")
        for other in (other for other in others if other.session != self._bus.id):
            problem = f"{key} is published by {other.node} ({other.session[:6]}) already"
            raise EntityError(
                si.SpawnEntityReply.NAME_NOT_UNIQUE, f"{problem}; end that one, or use another name: --robot FILE=NAME"
            )


def has_keys(model: RobotModel) -> bool:
    """Whether a robot has keys: one with a drive, or with moving joints."""
    return bool(model.drive) or any(joint.kind in MOVING for joint in model.joints.values())


def checked_place(position: Vector, rotation: Rotation) -> Place:
    """A place from the wire, with its rotation normalized. Raises EntityError."""
    if not all(map(math.isfinite, (*position, *rotation))) or max(map(abs, position)) > MAX_DISTANCE:
        raise EntityError(
            si.SpawnEntityReply.INVALID_POSE, f"position {position}: use finite numbers up to {MAX_DISTANCE:g} m"
        )
    length = math.hypot(*rotation)
    if not 0.9 < length < 1.1:
        raise EntityError(
            si.SpawnEntityReply.INVALID_POSE, f"orientation {rotation} is not a unit quaternion x, y, z, w"
        )
    x, y, z, w = (part / length for part in rotation)
    return position, (x, y, z, w)
