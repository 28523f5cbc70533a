"""pybullet, loaded without its greeting, and collision shapes that are made once and shared.

Of the sim only this folder imports pybullet. Metres, kilograms, seconds; quaternions are x, y, z, w.
"""

from typing import Any

from holozen.process import quiet
from holozen.robot.rigid import PlacedShape
from holozen.rotation import rotate

__all__ = ["NOTHING", "UPRIGHT", "Rotation", "Shapes", "Vector", "bullet"]

Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]

UPRIGHT: Rotation = (0.0, 0.0, 0.0, 1.0)
MAX_IN_ONE = 16  # pybullet's MAX_COMPOUND_COLLISION_SHAPES; it silently drops the rest
NOTHING = -1  # pybullet's shape that touches nothing


with quiet():  # it prints its build time from C while it loads; no flag stops it
    import pybullet as bullet

KINDS = {"box": bullet.GEOM_BOX, "cylinder": bullet.GEOM_CYLINDER, "sphere": bullet.GEOM_SPHERE}


class Shapes:
    """The collision shapes of one world. The engine never frees one, so equal shapes are shared."""

    def __init__(self, world: int) -> None:
        self._world = world
        self._made: dict[Any, int] = {}
        # Without a visual the engine makes one of every collision shape: 0.5 ms and 14 KB each.
        self.unseen: int = bullet.createVisualShape(bullet.GEOM_BOX, halfExtents=[1e-3] * 3, physicsClientId=world)

    def of(self, placed: tuple[PlacedShape, ...]) -> list[int]:
        """The engine's ids of shapes in the frame of their part, as few as possible."""
        simple = [part for part in placed if part.shape.kind in KINDS]
        chunks = [simple[start : start + MAX_IN_ONE] for start in range(0, len(simple), MAX_IN_ONE)]
        single = [part for part in placed if part.shape.kind in ("hull", "plane")]
        return [self._shared(chunk) for chunk in chunks] + [self._shared([part]) for part in single]

    def _shared(self, placed: list[PlacedShape]) -> int:
        key = tuple((p.shape.kind, p.shape.size, p.shape.points, p.xyz, p.quaternion) for p in placed)
        if key not in self._made:
            self._made[key] = _compound(self._world, placed) if placed[0].shape.kind in KINDS else self._one(placed[0])
        return self._made[key]

    def _one(self, part: PlacedShape) -> int:
        if part.shape.kind == "plane":
            normal = rotate(part.quaternion, (0.0, 0.0, 1.0))
            return int(bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=normal, physicsClientId=self._world))
        return int(
            bullet.createCollisionShape(
                bullet.GEOM_MESH,
                vertices=part.shape.points,
                collisionFramePosition=part.xyz,
                collisionFrameOrientation=part.quaternion,
                physicsClientId=self._world,
            )
        )


def _compound(world: int, placed: list[PlacedShape]) -> int:
    arguments: dict[str, Any] = {
        "shapeTypes": [KINDS[part.shape.kind] for part in placed],
        "radii": [part.shape.size[0] for part in placed],
        "lengths": [part.shape.size[-1] for part in placed],
        "halfExtents": [[edge / 2 for edge in (*part.shape.size, 0, 0)[:3]] for part in placed],
        "collisionFramePositions": [part.xyz for part in placed],
        "collisionFrameOrientations": [part.quaternion for part in placed],
    }
    return int(bullet.createCollisionShapeArray(**arguments, physicsClientId=world))
