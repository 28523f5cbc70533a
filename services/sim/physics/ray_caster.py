"""What sensors see: the collision shapes of all entities, in an engine of their own.

There every link is a body, so that a sensor learns which link of its own robot it would hit, and so are those of
robots that glide, which touch nothing in the engine that moves them.
"""

from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np
import numpy.typing as npt

from holozen.robot.model import RobotModel
from holozen.robot.rigid import Frame, PlacedShape
from holozen.robot.shapes import solid
from holozen.rotation import XYZ, XYZW, rotate

from .engine import UPRIGHT, Bodies, bullet

Array = npt.NDArray[np.float64]
Pose = tuple[XYZ, XYZW]
ORIGIN: Pose = ((0.0, 0.0, 0.0), UPRIGHT)
MOST_KEPT = 1000  # removed bodies; nothing steps here
OTHERS, OWN, ALL = 1, 1024, -1  # groups of shapes: 1024 is none of the engine's own, those of the sensor that looks


class Placed(Protocol):
    """Where a link is."""

    @property
    def xyz(self) -> XYZ:
        """Its position in metres."""
        ...

    @property
    def rotation(self) -> XYZW:
        """Its rotation."""
        ...


class RayCaster:
    """The shapes, by the name of their entity. `ground`: a level plane at z = 0."""

    def __init__(self, ground: bool) -> None:
        self._world: int = bullet.connect(bullet.DIRECT)
        self._made = Bodies(self._world, MOST_KEPT)
        self._bodies: dict[str, dict[str, list[int]]] = {}
        self._at: dict[tuple[str, str], Pose] = {}  # of each link that has shapes
        self._roots: dict[str, Pose] = {}
        if ground:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=self._world)
            bullet.createMultiBody(0, plane, self._made.shapes.unseen, physicsClientId=self._world)

    def add(self, name: str, model: RobotModel) -> None:
        """Add an entity."""
        self._bodies[name] = {}
        for link in model.links.values():
            parts = []
            for shape in link.collisions:
                frame = Frame.of(shape.pose)
                parts.append(PlacedShape(link.name, solid(shape), frame.xyz, frame.quaternion))
            self._bodies[name][link.name] = [
                self._made.add(shape, ORIGIN, 0.0, shape) for shape in self._made.shapes.of(tuple(parts))
            ]

    def remove(self, name: str) -> None:
        """Remove an entity."""
        self._roots.pop(name, None)
        for link, bodies in self._bodies.pop(name).items():
            self._at.pop((name, link), None)
            for body in bodies:
                self._made.remove(body)

    def has_moved(self, name: str, root: Pose) -> bool:
        """Whether the root of an entity is not where it was when it was placed."""
        return self._roots.get(name) != root

    def place(self, name: str, root: Pose, links: Mapping[str, Placed]) -> None:
        """Move the links of an entity."""
        self._roots[name] = root
        for link, bodies in self._bodies[name].items():
            at = links[link].xyz, links[link].rotation
            if bodies and self._at.get((name, link)) != at:
                self._at[name, link] = at
                for body in bodies:
                    bullet.resetBasePositionAndOrientation(body, *at, self._world)

    def ranges(
        self, origin: XYZ, rotation: XYZW, directions: Array, near: float, far: float, own: tuple[str, str]
    ) -> Array:
        """The distances (n,) in m from `origin` to what is hit first between `near` and `far`; infinite for nothing.

        `directions` (n, 3) are unit vectors in a frame of that rotation. The link `own` of an entity is not hit.
        """
        turned = directions @ np.array([rotate(rotation, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))])
        start = np.array(origin)
        bodies = self._bodies[own[0]][own[1]]
        self._group(bodies, OWN)
        hits = bullet.rayTestBatch(
            start + near * turned, start + far * turned, collisionFilterMask=~OWN, physicsClientId=self._world
        )
        self._group(bodies, OTHERS)
        bodies_hit, fractions = np.array([(hit[0], hit[2]) for hit in hits]).reshape(-1, 2).T
        return np.where(bodies_hit < 0, np.inf, near + fractions * (far - near))

    def _group(self, bodies: Iterable[int], group: int) -> None:
        for body in bodies:
            bullet.setCollisionFilterGroupMask(body, -1, group, ALL, self._world)

    def close(self) -> None:
        """Free the engine."""
        bullet.disconnect(self._world)
