"""All that is in the world: robots and objects by their names, put in, looked up, moved and taken out."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from holozen import simulation_interfaces as si
from holozen.bus import Bus
from holozen.errors import ServiceError
from holozen.graph import on_key
from holozen.robot.errors import RobotError, listed
from holozen.robot.model import RobotModel
from holozen.wire import key_for, robot_name

from .body import Body
from .drives import FreeMover, mover_for
from .engine import Rotation, Vector
from .vehicle import Vehicle
from .world import World

MOST = 1000  # entities; each takes time of every step
MOST_SHAPES = 500  # of one entity: each that touches the ground takes the engine 50 us of every step
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
        self._bus, self._world, self._limits = bus, world, limits
        self._graph = bus.graph()
        self._all: dict[str, Entity] = {}
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
            raise EntityError(si.NOT_FOUND, f"there is no entity {name!r}; there are {listed(list(self._all))}")
        return self._all[name]

    def add(self, name: str, model: RobotModel, place: Place, prefix: str | None = None) -> Entity:
        """Put a robot or object into the world, its root frame at `place`. Its keys are below `prefix`, by default its
        name. Raises EntityError.
        """
        prefix = name if prefix is None else prefix
        self._check(name, prefix, model)
        try:
            mover = mover_for(self._world, model, *place)
        except RobotError as error:
            raise EntityError(si.RESOURCE_PARSE_ERROR, str(error)) from None
        entity = Entity(name, model, mover.body, prefix=prefix)
        if not isinstance(mover, FreeMover) or mover.names:
            entity.vehicle = Vehicle(self._bus, prefix, model, mover, self._limits)
            self.vehicles.append(entity.vehicle)
        self._all[name] = entity
        return entity

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
                raise EntityError(code, str(error)) from None
        if name in self._all:
            there = listed(list(self._all))
            raise EntityError(si.NAME_NOT_UNIQUE, f"there is an entity {name!r} already; there are {there}")
        if len(self._all) >= MOST:
            raise EntityError(si.OPERATION_FAILED, f"there are {MOST} entities, as many as there may be; delete some")
        if (shapes := sum(len(link.collisions) for link in model.links.values())) > MOST_SHAPES:
            problem = (
                f"{model.name!r} has {shapes} collision shapes; at most {MOST_SHAPES} are simulated: leave some out"
            )
            raise EntityError(si.RESOURCE_PARSE_ERROR, problem)
        self._check_keys(keys_of(model, prefix))
        if model.drive:
            self._check_alone(key_for(model.drive.odometry_topic, prefix))

    def _check_keys(self, keys: set[str]) -> None:
        """Two robots on the same keys would each get the other's commands."""
        for other in self:
            if taken := keys & keys_of(other.model, other.prefix):
                raise EntityError(si.NAME_NOT_UNIQUE, f"{min(taken)} is the key of {other.name!r}; use another name")

    def _check_alone(self, key: str) -> None:
        """Two sims on the same keys would each get the other's commands."""
        others = on_key(self._graph.endpoints(), key, "pub")
        for other in (other for other in others if other.session != self._bus.id):
            problem = f"{key} is published by {other.node} ({other.session[:6]}) already"
            raise EntityError(si.NAME_NOT_UNIQUE, f"{problem}; end that one, or use another name: --robot FILE=NAME")


def keys_of(model: RobotModel, prefix: str) -> set[str]:
    """The keys of a robot's drive, which no other may have too."""
    drive = model.drive
    return {key_for(topic, prefix) for topic in (drive.command_topic, drive.odometry_topic)} if drive else set()


def checked_place(position: Vector, rotation: Rotation) -> Place:
    """A place from the wire, its rotation made a unit quaternion. Raises EntityError."""
    if not all(map(math.isfinite, (*position, *rotation))) or max(map(abs, position)) > FARTHEST:
        raise EntityError(si.INVALID_POSE, f"position {position}: use finite numbers up to {FARTHEST:g} m")
    length = math.hypot(*rotation)
    if not 0.9 < length < 1.1:
        raise EntityError(si.INVALID_POSE, f"orientation {rotation} is no unit quaternion x, y, z, w")
    x, y, z, w = (part / length for part in rotation)
    return position, (x, y, z, w)
