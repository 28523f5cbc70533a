"""pybullet, loaded without its greeting, and its shapes and bodies, which are made once and used again.

Of the sim only this folder imports pybullet. Metres, kilograms, seconds; quaternions are x, y, z, w.
"""

from typing import Any

from holozen.process import quiet
from holozen.robot.rigid import PlacedShape
from holozen.rotation import XYZ, XYZW, multiply, rotate

__all__ = ["NOTHING", "UPRIGHT", "Bodies", "Shapes", "bullet"]

UPRIGHT: XYZW = (0.0, 0.0, 0.0, 1.0)
MAX_IN_ONE = 16  # pybullet's MAX_COMPOUND_COLLISION_SHAPES; it silently drops the rest
NOTHING = -1  # pybullet's shape that touches nothing
MOST_KEPT = 64  # removed bodies; each takes 0.6 us a step
FAR_AWAY: XYZ = (0.0, 0.0, 1e6)
ASLEEP, AWAKE = 1 | 8, 2 | 4  # of pybullet's flags: it may sleep, and does; it may not, and is awake
FREE, FIXED = (1, -1), (2, ~2)  # group, and groups that it touches; the engine's own for bodies and fixed bases


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


class Bodies:
    """The bodies of one world. The engine keeps 1 to 4 KB of each that it removed, for ever. So a removed body is only
    put to sleep, far away and touching nothing, until another one like it is added; `most` of them are kept.
    """

    def __init__(self, world: int, most: int = MOST_KEPT) -> None:
        self.world, self.shapes, self._most = world, Shapes(world), most
        self._kinds: dict[int, object] = {}  # of those that are there
        self._kept: dict[int, object] = {}  # of those that are not; the first was removed first

    def add(
        self, kind: object, place: tuple[XYZ, XYZW], mass: float, shape: int,
        inertial: tuple[XYZ, XYZW] = ((0.0, 0.0, 0.0), UPRIGHT), **arguments: Any,
    ) -> int:  # fmt: skip
        """A body that stands, its root frame at `place` and its inertial frame at `inertial` in that; the rest are
        arguments of createMultiBody. `kind` equals that of another only if both are made, and have their dynamics set,
        in the same way. Returns the engine's number.
        """
        number = next((number for number, kept in self._kept.items() if kept == kind), None)
        if number is None:
            number = int(
                bullet.createMultiBody(
                    mass, shape, self.shapes.unseen, basePosition=place[0], baseOrientation=place[1],
                    baseInertialFramePosition=inertial[0], baseInertialFrameOrientation=inertial[1],
                    physicsClientId=self.world, **arguments,
                )
            )  # fmt: skip
        else:
            del self._kept[number]
            ((x, y, z), rotation), (centre, axes) = place, inertial
            cx, cy, cz = rotate(rotation, centre)
            self._place(number, (x + cx, y + cy, z + cz), multiply(rotation, axes))
            self._touch(number, FREE if mass else FIXED, FREE)
            bullet.changeDynamics(number, -1, activationState=AWAKE, physicsClientId=self.world)
        self._kinds[number] = kind
        return number

    def remove(self, number: int) -> None:
        """Take a body out of the world."""
        self._touch(number, (0, 0), (0, 0))
        self._place(number, FAR_AWAY, UPRIGHT)
        bullet.changeDynamics(number, -1, activationState=ASLEEP, physicsClientId=self.world)
        self._kept[number] = self._kinds.pop(number)
        if len(self._kept) > self._most:
            oldest = next(iter(self._kept))
            del self._kept[oldest]
            bullet.removeBody(oldest, self.world)

    def _place(self, number: int, at: XYZ, rotation: XYZW) -> None:
        """Let it stand, its centre of mass at a pose, and its joints at zero."""
        bullet.resetBasePositionAndOrientation(number, at, rotation, self.world)
        bullet.resetBaseVelocity(number, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), self.world)
        for joint in range(bullet.getNumJoints(number, self.world)):
            bullet.resetJointState(number, joint, 0.0, 0.0, self.world)

    def _touch(self, number: int, base: tuple[int, int], links: tuple[int, int]) -> None:
        """Set the groups of the shapes of a body's base and links."""
        bullet.setCollisionFilterGroupMask(number, -1, *base, self.world)
        for link in range(bullet.getNumJoints(number, self.world)):
            bullet.setCollisionFilterGroupMask(number, link, *links, self.world)
