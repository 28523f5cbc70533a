"""A body in the engine: its pose and velocity, and how it is placed or removed."""

from collections.abc import Iterable, Mapping

from holozen.kinematics import to_body
from holozen.limits import Planar
from holozen.rotation import XYZ, XYZW, multiply, rotate, yaw

from .engine import NOTHING, Bodies, bullet

Moved = tuple[XYZ, XYZW, Planar]
"""Position (m), rotation and body-frame velocity (m/s, rad/s) for odometry."""
JointStates = tuple[list[float], list[float], list[float]]
"""Positions, rates and efforts: rad, rad/s, N m or m, m/s, N."""


class Body:
    """A multibody of the engine, by its root frame; the engine itself uses the centre of mass.

    `number` is the engine's. `weightless` is the mass in kg, by the engine's number of a link (-1: the base), that
    gravity does not pull.
    """

    def __init__(
        self, bodies: Bodies, number: int, centre: XYZ, axes: XYZW, weightless: Mapping[int, float] = {}
    ) -> None:
        self._bodies, self._world, self._body, self.number = bodies, bodies.world, number, number
        self.weightless = {link: mass for link, mass in weightless.items() if mass > 0}
        self.is_removed = False
        self.glides = False  # whether it keeps the velocity that was set, without being set again at each step
        self._centre = centre
        self._axes = axes
        self._links = range(-1, bullet.getNumJoints(number, bodies.world))
        self._tilted = max(map(abs, axes[:3])) > 1e-9  # principal axes that are not the root's
        self._axes_back: XYZW = bullet.invertTransform((0, 0, 0), axes)[1]

    def pose(self) -> tuple[XYZ, XYZW]:
        """Position and rotation of the root frame in the world."""
        position, rotation, centre = self._root()
        return (position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]), rotation

    def twist(self) -> tuple[XYZ, XYZ]:
        """The root frame's velocity and rotation rate in the world."""
        _, _, centre = self._root()
        linear, angular = bullet.getBaseVelocity(self._body, self._world)
        return _at(linear, angular, (-centre[0], -centre[1], -centre[2])), angular

    def planar(self) -> Planar:
        """The planar velocity of the root frame, in the body frame."""
        (vx, vy, _), (_, _, turn) = self.twist()
        x, y = to_body(vx, vy, yaw(self.pose()[1]))
        return x, y, turn

    def box(self) -> tuple[XYZ, XYZ]:
        """The corners of the box around it in the engine, along the axes of the world."""
        if len(self._links) == 1:
            box: tuple[XYZ, XYZ] = bullet.getAABB(self._body, -1, self._world)
            return box
        boxes = [bullet.getAABB(self._body, link, self._world) for link in self._links]
        low, high = (zip(*corners, strict=True) for corners in zip(*boxes, strict=True))
        return tuple(map(min, low)), tuple(map(max, high))

    def put(self, position: XYZ, rotation: XYZW, linear: XYZ, angular: XYZ) -> None:
        """Place the root frame in the world, with its velocity and rotation rate there."""
        centre = self._place(position, rotation)
        bullet.resetBaseVelocity(self._body, _at(linear, angular, centre), angular, self._world)

    def _place(self, position: XYZ, rotation: XYZW) -> XYZ:
        """Place the root frame in the world. Returns the offset from it to the centre of mass, in the world."""
        (x, y, z), (cx, cy, cz) = position, rotate(rotation, self._centre)
        axes = multiply(rotation, self._axes) if self._tilted else rotation
        bullet.resetBasePositionAndOrientation(self._body, (x + cx, y + cy, z + cz), axes, self._world)
        return cx, cy, cz

    def cancel_gravity(self, gravity: XYZ) -> None:
        """Cancel the world's `gravity` on weightless links for the next step: the engine has no such flag."""
        for link, mass in self.weightless.items():
            if link < 0:
                centre = bullet.getBasePositionAndOrientation(self._body, self._world)[0]
            else:
                centre = bullet.getLinkState(self._body, link, physicsClientId=self._world)[0]
            force = [-mass * part for part in gravity]
            bullet.applyExternalForce(self._body, link, force, centre, bullet.WORLD_FRAME, self._world)

    def remove(self) -> None:
        """Remove it from the world."""
        self.is_removed = True
        self._bodies.remove(self._body)

    def _root(self) -> tuple[XYZ, XYZW, XYZ]:
        """The centre of mass, the root frame's rotation, and the offset from the root to the centre, in the world."""
        position, rotation = bullet.getBasePositionAndOrientation(self._body, self._world)
        if self._tilted:
            rotation = bullet.multiplyTransforms((0, 0, 0), rotation, (0, 0, 0), self._axes_back)[1]
        return position, rotation, rotate(rotation, self._centre)


class Links:
    """The arguments of `createMultiBody` for links below the base, all with the shape `visual`. Those without a joint
    only carry shapes.
    """

    def __init__(self, visual: int) -> None:
        self._visual = visual
        self.arguments: dict[str, list[object]] = {name: [] for name in _NAMES}

    def __len__(self) -> int:
        return len(self.arguments["linkMasses"])

    def add(
        self,
        parent: int,
        shape: int = NOTHING,
        joint: int = bullet.JOINT_FIXED,
        axis: XYZ = (0.0, 0.0, 1.0),
        at: tuple[XYZ, XYZW] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        mass: float = 0.0,
        inertial: tuple[XYZ, XYZW] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    ) -> int:
        """One link on link `parent` (-1: the base) with its frame `at` in the parent's. Returns its index."""
        values = (mass, shape, self._visual, *at, *inertial, parent + 1, joint, axis)
        for name, value in zip(_NAMES, values, strict=True):
            self.arguments[name].append(value)
        return len(self) - 1

    def carry(self, parent: int, shapes: Iterable[int]) -> list[int]:
        """Attach more shapes to a link that has one. Returns the indices of the links that carry them."""
        return [self.add(parent, shape) for shape in shapes]

    def numbers(self, body: int, world: int) -> dict[int, int]:
        """Our index -> the engine's, which counts depth first; -1, the base, is the same in both."""
        infos = (bullet.getJointInfo(body, number, world) for number in range(len(self)))
        return {-1: -1} | {int(info[12].removeprefix(b"link")) - 1: info[0] for info in infos}


_NAMES = (
    "linkMasses", "linkCollisionShapeIndices", "linkVisualShapeIndices", "linkPositions", "linkOrientations",
    "linkInertialFramePositions", "linkInertialFrameOrientations", "linkParentIndices", "linkJointTypes",
    "linkJointAxis",
)  # fmt: skip


def _at(linear: XYZ, angular: XYZ, away: XYZ) -> XYZ:
    """The velocity of a point `away` from one that moves and turns: v + w x r."""
    (vx, vy, vz), (wx, wy, wz), (x, y, z) = linear, angular, away
    return vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x
