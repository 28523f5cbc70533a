"""What sensors see of the entities."""

from collections.abc import Iterable

from holozen.messages import SeenEntity

from .entity import Entity
from .physics.ray_caster import RayCaster
from .physics.world import World


class Scene:
    """The entities of one world as sensors see them."""

    def __init__(self, world: World, entities: Iterable[Entity]) -> None:
        self._world, self._entities = world, entities
        self._rays: RayCaster | None = None  # made when the first sensor measures
        self._traced: dict[str, int] = {}  # the numbers of the entities in `_rays`, by name

    def look(self) -> RayCaster:
        """The ray caster, with all entities where they are now."""
        rays = self._rays = self._rays or self._world.ray_caster()
        there = {entity.name: entity for entity in self._entities}
        for name, number in list(self._traced.items()):
            if name not in there or there[name].number != number:
                rays.remove(name)
                del self._traced[name]
        for name, entity in there.items():
            if name not in self._traced:
                rays.add(name, entity.model)
                self._traced[name] = entity.number
            pose = entity.body.pose()
            if rays.has_moved(name, pose) or entity.robot:
                rays.place(name, pose, entity.link_states())
        return rays

    def seen(self) -> list[SeenEntity]:
        """All entities with the poses of their links, for cameras."""
        return [entity.seen() for entity in self._entities]
