"""What sensors see: the collision shapes of all entities, in an engine of their own.

In it every link is a body, so that rays can pass through the link that carries the sensor; and
robots that glide are present too, which have no contacts in the engine that moves them.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from holozen.robot.model import RobotModel
from holozen.robot.rigid import Frame, placed_shape
from holozen.rotation import XYZ, XYZW, rotate

from ..link_states import LinkState
from .engine import Array, Rays

Placement = tuple[XYZ, XYZW]
# m; nearer links count as touching: the engine that moves them keeps them apart by less
TOUCHING = 2e-3
GROUND = ("ground_plane", "link")


class Touch(NamedTuple):
    """The contacts of a link with the entity and link `other`: points (m) on that, unit normals out
    of it, and depths (m).
    """

    other: tuple[str, str]
    points: list[XYZ]
    normals: list[XYZ]
    depths: list[float]


class RayCaster:
    """The collision shapes of all entities, by the entities' names."""

    def __init__(self, rays: Rays) -> None:
        self._rays = rays
        self._bodies: dict[str, dict[str, int]] = {}  # entity -> link -> number
        self._at: dict[tuple[str, str], Placement] = {}  # (entity, link) -> pose
        self._roots: dict[str, Placement] = {}

    def add(self, name: str, model: RobotModel) -> None:
        """Add an entity."""
        self._bodies[name] = {}
        for link in model.links.values():
            parts = (
                placed_shape(link.name, shape, Frame.of(shape.pose)) for shape in link.collisions
            )
            self._bodies[name][link.name] = self._rays.add(tuple(parts))

    def remove(self, name: str) -> None:
        """Remove an entity."""
        self._roots.pop(name, None)
        for link, body in self._bodies.pop(name).items():
            self._at.pop((name, link), None)
            self._rays.remove(body)

    def has_moved(self, name: str, root: Placement) -> bool:
        """Whether the root of an entity is not where it was last placed."""
        return self._roots.get(name) != root

    def place(self, name: str, root: Placement, links: Mapping[str, LinkState]) -> None:
        """Move the links of an entity."""
        self._roots[name] = root
        for link, body in self._bodies[name].items():
            at = links[link].xyz, links[link].rotation
            if self._at.get((name, link)) != at:
                self._at[name, link] = at
                self._rays.place(body, *at)

    def ranges(
        self,
        origin: XYZ,
        rotation: XYZW,
        directions: Array,
        near: float,
        far: float,
        own: tuple[str, str],
    ) -> Array:
        """The distances (n,) in m from `origin` to the first hits between `near` and `far`;
        infinite without a hit.

        `directions` (n, 3) are unit vectors in a frame with that rotation. Rays pass through `own`,
        an entity's link.
        """
        turned = directions @ np.array(
            [rotate(rotation, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        )
        return self._rays.cast(origin, turned, near, far, self._bodies[own[0]][own[1]])

    def touches(self, name: str, link: str) -> list[Touch]:
        """The contacts of an entity's link, except those with other links of the same entity."""
        own = self._bodies[name]
        owners = {
            body: (entity, part)
            for entity, links in self._bodies.items()
            for part, body in links.items()
        }
        found: dict[tuple[str, str], Touch] = {}
        for number, point, normal, distance in self._rays.touched(
            own[link], TOUCHING, own.values()
        ):
            other = owners.get(number, GROUND)
            touch = found.setdefault(other, Touch(other, [], [], []))
            touch.points.append(point)
            touch.normals.append(normal)
            touch.depths.append(max(0.0, -distance))
        return list(found.values())

    def close(self) -> None:
        """Free the engine."""
        self._rays.close()
