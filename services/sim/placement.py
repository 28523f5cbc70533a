"""Where a body may be put: nowhere in the ground, nor in another body, since the engine would throw
it out.
"""

import math
from collections.abc import Iterable
from functools import partial

from holozen.messages.simulation_interfaces import SpawnEntityReply as Spawn
from holozen.rotation import XYZ, XYZW

from .entity import Entity
from .errors import EntityError
from .identity import Identity
from .physics.body import Body, Placement
from .physics.world import SUNK, World

MAX_DISTANCE = 1e4  # m from the origin; beyond, the engine's numbers get too coarse for contacts


def checked_place(position: XYZ, rotation: XYZW) -> Placement:
    """A place that came over the wire, with its rotation normalized. Raises EntityError."""
    is_finite = all(map(math.isfinite, (*position, *rotation)))
    if not is_finite or max(map(abs, position)) > MAX_DISTANCE:
        problem = f"position {position}: use finite numbers up to {MAX_DISTANCE:g} m"
        raise EntityError(Spawn.INVALID_POSE, problem)
    length = math.hypot(*rotation)
    if not 0.9 < length < 1.1:
        problem = f"orientation {rotation} is not a unit quaternion x, y, z, w"
        raise EntityError(Spawn.INVALID_POSE, problem)
    x, y, z, w = (part / length for part in rotation)
    return position, (x, y, z, w)


class Room:
    """The room that entities leave in a world.

    An entity of the name of what is placed does not count: either the name is refused, or that
    entity is replaced.
    """

    def __init__(self, world: World, entities: Iterable[Entity]) -> None:
        self._world, self._entities = world, entities

    def fit(self, identity: Identity, body: Body, code: int = Spawn.INVALID_POSE) -> float:
        """Lift a body onto the floor that it is in, if it is in one: programs that give no height
        send 0, wherever the root frame is. For the same reason a root frame on the ground may have
        its body in that. Returns by how much it was lifted, in m. Raises EntityError with the
        `code` if a body is deep in the ground or in another one, and leaves it where it was.
        """
        self._check_ground(identity, body, code)
        at, rotation = body.pose()
        fixed = partial(self.overlapped, identity, body, only_static=True)
        lifted, floor = 0.0, fixed()
        if floor:
            free_z = self._world.lift(body, fixed)
            if free_z is None or not self._world.is_floor(body, free_z - at[2], fixed):
                body.put(at, rotation, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
                raise self._no_room(identity, body, floor, code, free_z)
            lifted = free_z - at[2]
        other = self.overlapped(identity, body)
        if other:
            raise self._no_room(identity, body, other, code)
        return lifted

    def _check_ground(self, identity: Identity, body: Body, code: int) -> None:
        at = body.pose()[0]
        if identity.model.static or at[2] >= -SUNK:
            return
        depth = self._world.sunk(body)
        if depth:
            problem = f"there is no room for {identity.name!r} at {_at(at)} z {_metres(at[2])}"
            why = f"it would be {_metres(depth)} m below the ground"
            advice = f"the lowest free z is {_metres(at[2] + depth)}"
            raise EntityError(code, f"{problem}: {why}; {advice}")

    def overlapped(
        self,
        identity: Identity,
        body: Body,
        only_static: bool = False,
    ) -> Entity | None:
        """The entity that a body overlaps, if either of them can move; of all, or only of the
        static ones.
        """
        numbers = self._world.overlapped(body)
        if not numbers:
            return None
        others = (entity for entity in self._entities if entity.name != identity.name)
        by_number = {entity.body.number: entity for entity in others}
        for number in numbers:
            entity = by_number.get(number)
            if entity is None or (only_static and not entity.model.static):
                continue
            if not (entity.model.static and identity.model.static):
                return entity
        return None

    def _no_room(
        self, identity: Identity, body: Body, other: Entity, code: int, free_z: float | None = None
    ) -> EntityError:
        """The error for a body in another one, which names the nearest free place; and the free
        height above, if it is known.
        """
        at, free = body.pose()[0], self._world.free_place(body)
        places = [_at(free)] if free else []
        places += [] if free_z is None else [f"z {_metres(free_z)} above it"]
        advice = "use another place"
        if places:
            advice = f"the nearest free place is {' or '.join(places)}"
        problem = f"there is no room for {identity.name!r} at {_at(at)}"
        return EntityError(code, f"{problem}: it would be inside {other.name!r}; {advice}")


def _at(position: XYZ) -> str:
    return f"x {_metres(position[0])} y {_metres(position[1])}"


def _metres(length: float) -> str:
    return f"{round(length, 2) + 0.0:.10g}"  # no -0
