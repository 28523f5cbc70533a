"""A body in the engine: where it is, how it moves, and how it is put elsewhere or taken out."""

from collections.abc import Iterable

from holozen.drive import to_body
from holozen.limits import Planar

from .engine import NOTHING, Rotation, Vector, bullet, turned, yaw_of


class Body:
    """An engine's multibody seen by its root frame, though the engine places it by its centre of mass."""

    def __init__(self, world: int, number: int, centre: Vector, axes: Rotation) -> None:
        self._world, self._body = world, number
        self._centre = centre
        self._axes = axes
        self._tilted = max(map(abs, axes[:3])) > 1e-9  # principal axes that are not the root's
        self._axes_back: Rotation = bullet.invertTransform((0, 0, 0), axes)[1]

    def pose(self) -> tuple[Vector, Rotation]:
        """Position and rotation of the root frame in the world."""
        position, rotation, centre = self._root()
        return (position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]), rotation

    def twist(self) -> tuple[Vector, Vector]:
        """The root frame's velocity and rotation rate in the world."""
        _, _, centre = self._root()
        linear, angular = bullet.getBaseVelocity(self._body, self._world)
        return _at(linear, angular, (-centre[0], -centre[1], -centre[2])), angular

    def planar(self) -> Planar:
        """The root frame's planar velocity, as seen from its heading."""
        (vx, vy, _), (_, _, turn) = self.twist()
        x, y = to_body(vx, vy, yaw_of(self.pose()[1]))
        return x, y, turn

    def put(self, position: Vector, rotation: Rotation, linear: Vector, angular: Vector) -> None:
        """Place the root frame in the world, with its velocity and rotation rate there."""
        centre = turned(rotation, self._centre)
        at = tuple(p + c for p, c in zip(position, centre, strict=True))
        _, axes = bullet.multiplyTransforms((0, 0, 0), rotation, (0, 0, 0), self._axes)
        bullet.resetBasePositionAndOrientation(self._body, at, axes, self._world)
        bullet.resetBaseVelocity(self._body, _at(linear, angular, centre), angular, self._world)

    def remove(self) -> None:
        """Take it out of the world."""
        bullet.removeBody(self._body, self._world)

    def _root(self) -> tuple[Vector, Rotation, Vector]:
        """The centre of mass, the root frame's rotation, and the way from the root to the centre, in the world."""
        position, rotation = bullet.getBasePositionAndOrientation(self._body, self._world)
        if self._tilted:
            rotation = bullet.multiplyTransforms((0, 0, 0), rotation, (0, 0, 0), self._axes_back)[1]
        return position, rotation, turned(rotation, self._centre)


class Links:
    """What `createMultiBody` is told of the links below the base, all shown as `visual`. Those without a joint only
    carry shapes.
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
        axis: Vector = (0.0, 0.0, 1.0),
        at: tuple[Vector, Rotation] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        mass: float = 0.0,
        inertial: tuple[Vector, Rotation] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    ) -> int:
        """One link on link `parent` (-1: the base) with its frame `at` in the parent's. Returns its index."""
        values = (mass, shape, self._visual, *at, *inertial, parent + 1, joint, axis)
        for name, value in zip(_NAMES, values, strict=True):
            self.arguments[name].append(value)
        return len(self) - 1

    def carry(self, parent: int, shapes: Iterable[int]) -> list[int]:
        """More shapes on a link that holds one already. Returns the indices of the links that hold them."""
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


def _at(linear: Vector, angular: Vector, away: Vector) -> Vector:
    """The velocity of a point `away` from one that moves and turns: v + w x r."""
    (vx, vy, vz), (wx, wy, wz), (x, y, z) = linear, angular, away
    return vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x
