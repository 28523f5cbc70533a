"""All that is in the world: robots and objects by their names, put in, looked up, moved and taken out."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from holozen import simulation_interfaces as si
from holozen.bus import Bus
from holozen.errors import ServiceError
from holozen.graph import on_key
from holozen.robot.assembly import MOVING
from holozen.robot.errors import RobotError, listed
from holozen.robot.model import RobotModel
from holozen.tell import say
from holozen.wire import SERVICES, key_for, robot_name

from .body import Body
from .calls import Calls
from .drives import Mover, mover_for
from .engine import Rotation, Vector
from .vehicle import Memory, Vehicle, keys_of
from .world import World

MOST = 1000  # entities; each takes time of every step
MOST_SHAPES = 500  # of one entity: each that touches the ground takes the engine 50 us of every step
LONGEST = 300  # characters of a reason
FARTHEST = 1e4  # m from the origin; far beyond, the engine's numbers are too coarse to stand on
Place = tuple[Vector, Rotation]


class EntityError(ServiceError):
    """A request about an entity that cannot be granted, with the `Result` code of simulation_interfaces."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text, result={"result": code, "error_message": text})


@dataclass(slots=True)
class Entity:
    """A robot or object by its name. Without a `vehicle` it has no keys. `prefix` is where the keys of one are."""

    name: str
    model: RobotModel
    body: Body
    vehicle: Vehicle | None = None
    prefix: str = ""


class Entities:
    """The entities of one world. `limits` are the fastest commands in m/s and rad/s."""

    def __init__(self, bus: Bus, world: World, limits: tuple[float, float]) -> None:
        self._bus, self._world, self.limits = bus, world, limits
        self._graph = bus.graph()
        self._all: dict[str, Entity] = {}
        self._before: dict[str, Memory] = {}  # prefix -> whom the last robot there held, and who stopped it
        self.vehicles: list[Vehicle] = []

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._world.time

    def __iter__(self) -> Iterator[Entity]:
        return iter(self._all.values())

    def named(self, name: str) -> Entity:
        """The entity called `name`. Raises EntityError that says which there are."""
        if name not in self._all:
            raise EntityError(si.NOT_FOUND, f"there is no entity {name[:80]!r}; there are {listed(list(self._all))}")
        return self._all[name]

    def add(self, name: str, model: RobotModel, place: Place, prefix: str | None = None) -> Entity:
        """Put a robot or object into the world, its root frame at `place`. Its keys are below `prefix`, by default its
        name. What is wrong with the robot is found before its name is looked at. Raises EntityError.
        """
        prefix = name if prefix is None else prefix
        model = replace(model, drive=None) if model.static else model
        mover = self._mover(model, place)
        try:
            self._check(name, prefix, model)
            entity = Entity(name, model, mover.body, prefix=prefix)
            if model.drive or mover.names:
                entity.vehicle = Vehicle(self._bus, prefix, model, mover, self.limits)
        except Exception:
            mover.body.remove()
            raise
        self._all[name] = entity
        if entity.vehicle:
            self._remember(prefix, entity.vehicle)
            self.vehicles.append(entity.vehicle)
        return entity

    def limit(self, linear: float, angular: float) -> None:
        """Clamp the next commands of all robots to these limits, in m/s and rad/s."""
        self.limits = (linear, angular)
        for vehicle in self.vehicles:
            vehicle.limit(linear, angular)

    def hear_who_left(self) -> None:
        """Stop every robot that is driven by a node whose process is gone."""
        for source in self._graph.left():
            for vehicle in self.vehicles:
                vehicle.forget(source)

    def fail(self, vehicle: Vehicle, error: Exception) -> None:
        """Take a robot out that cannot go on, so that the others can."""
        name = next(entity.name for entity in self if entity.vehicle is vehicle)
        say(f"sim: {name} was taken out of the world: {error}")
        self.remove(name)

    def _mover(self, model: RobotModel, place: Place) -> Mover:
        if (shapes := sum(len(link.collisions) for link in model.links.values())) > MOST_SHAPES:
            problem = f"{model.name[:80]!r} has {shapes} collision shapes; at most {MOST_SHAPES} are simulated"
            raise EntityError(si.RESOURCE_PARSE_ERROR, problem)
        try:
            return mover_for(self._world, model, *place)
        except RobotError as error:
            raise EntityError(si.RESOURCE_PARSE_ERROR, str(error)) from None

    def _remember(self, prefix: str, vehicle: Vehicle) -> None:
        """A robot in the place of another one obeys nobody whom that one did not, and is stopped if that was."""
        if old := self._before.pop(prefix, None):
            vehicle.inherit(old)
        self._before[prefix] = vehicle.memory
        if setter := vehicle.arbiter.latch.setter:
            say(f"sim: {prefix or 'the robot'} is stopped by {setter}, as the one before it was; `holozen release`")
        while len(self._before) > MOST:
            free = (prefix for prefix, (arbiter, _) in self._before.items() if not arbiter.latch.setter)
            del self._before[next(free, next(iter(self._before)))]  # a stop is forgotten last

    def remove(self, name: str) -> None:
        """Take an entity out of the world, and its keys off the wire. Raises EntityError."""
        entity = self.named(name)
        del self._all[name]
        if entity.vehicle:
            self.vehicles.remove(entity.vehicle)
            entity.vehicle.close()
        entity.body.remove()

    def free_name(self, wanted: str) -> str:
        """`wanted`, or with the first number behind it that makes it free."""
        taken = {entity.name for entity in self} | {entity.prefix for entity in self}
        names = (wanted, *(f"{wanted}_{number}" for number in range(1, MOST + 2)))
        return next(name for name in names if name not in taken)

    def _check(self, name: str, prefix: str, model: RobotModel) -> None:
        for text, code in ((name, si.NAME_INVALID), (prefix, si.NAMESPACE_INVALID)):
            try:
                robot_name(text or "root")
            except ValueError as error:
                raise EntityError(code, str(error)[:LONGEST]) from None
        if name in self._all:
            there = listed(list(self._all))
            raise EntityError(si.NAME_NOT_UNIQUE, f"there is an entity {name!r} already; there are {there}")
        if len(self._all) >= MOST:
            raise EntityError(si.OPERATION_FAILED, f"there are {MOST} entities, as many as there may be; delete some")
        if speaks(model):
            self._check_keys(keys_of(model, prefix))
        if model.drive:
            self._check_alone(key_for(model.drive.odometry_topic, prefix))

    def _check_keys(self, keys: list[str]) -> None:
        """Two robots on the same keys would each get the other's commands; so would one on a key of the sim's."""
        taken = {row.key for row in SERVICES if row.server == "sim"} - {*Calls.VERBS} | {"clock"}
        for key in keys:
            if keys.count(key) > 1 or key in taken:
                raise EntityError(si.NAMESPACE_INVALID, f"the robot's file puts two things on the key {key[:80]!r}")
        for other in (other for other in self if other.vehicle):
            if both := set(keys) & set(keys_of(other.model, other.prefix)):
                raise EntityError(si.NAME_NOT_UNIQUE, f"{min(both)} is the key of {other.name!r}; use another name")

    def _check_alone(self, key: str) -> None:
        """Two sims on the same keys would each get the other's commands."""
        others = on_key(self._graph.endpoints(), key, "pub")
        for other in (other for other in others if other.session != self._bus.id):
            problem = f"{key} is published by {other.node} ({other.session[:6]}) already"
            raise EntityError(si.NAME_NOT_UNIQUE, f"{problem}; end that one, or use another name: --robot FILE=NAME")


def speaks(model: RobotModel) -> bool:
    """Whether a robot has keys: a drive, or joints to tell of."""
    return bool(model.drive) or any(joint.kind in MOVING for joint in model.joints.values())


def checked_place(position: Vector, rotation: Rotation) -> Place:
    """A place from the wire, its rotation made a unit quaternion. Raises EntityError."""
    if not all(map(math.isfinite, (*position, *rotation))) or max(map(abs, position)) > FARTHEST:
        raise EntityError(si.INVALID_POSE, f"position {position}: use finite numbers up to {FARTHEST:g} m")
    length = math.hypot(*rotation)
    if not 0.9 < length < 1.1:
        raise EntityError(si.INVALID_POSE, f"orientation {rotation} is no unit quaternion x, y, z, w")
    x, y, z, w = (part / length for part in rotation)
    return position, (x, y, z, w)
