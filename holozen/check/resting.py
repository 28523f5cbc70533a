"""How a robot stands on level ground, pushed there by its weight."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from holozen.check.placed import Placed, dot
from holozen.robot.tag import Vector

STEEPEST = math.tan(math.radians(20))  # a robot that leans more does not stand, it falls or balances
ROUNDS = 40


@dataclass(frozen=True, slots=True)
class Ground:
    """The plane z = a x + b y + c of the ground in the root frame; `tips`: nothing stops the robot before it leans by
    20 degrees.
    """

    a: float
    b: float
    c: float
    tips: bool

    @property
    def up(self) -> Vector:
        """The unit normal."""
        length = math.hypot(self.a, self.b, 1.0)
        return -self.a / length, -self.b / length, 1 / length

    def above(self, shape: Placed) -> float:
        """How far a shape is off the ground, metres."""
        x, y, z = self.up
        lowest = shape.farthest((-x, -y, -z))
        return dot(self.up, lowest) - self.c * z


def stand(shapes: Sequence[Placed], centre: Vector) -> Ground:
    """The ground under shapes whose centre of mass is `centre`.

    Of all planes below the shapes it is the one that is highest under the centre of mass: there the weight is lowest.
    Found by cutting planes: solve for some points, add the shape's point that is farthest below, and again. `shapes`
    must not be empty.
    """
    low = min(shape.farthest((0.0, 0.0, -1.0))[2] for shape in shapes)
    far = 1e3 * max(1.0, *(abs(value) for shape in shapes for value in shape.centre))
    rim = [_rim(low, far, eighth * math.pi / 4) for eighth in range(8)]
    points = list(rim)
    for _ in range(ROUNDS):
        a, b, c, touched = _highest(points, centre)
        ground = Ground(a, b, c, any(points[i] in rim for i in touched))
        deepest = min(shapes, key=ground.above)
        if ground.above(deepest) > -1e-6:
            break
        x, y, z = ground.up
        points.append(deepest.farthest((-x, -y, -z)))
    return ground


def _rim(low: float, far: float, angle: float) -> Vector:
    return far * math.cos(angle), far * math.sin(angle), low + far * STEEPEST


def _highest(points: Sequence[Vector], centre: Vector) -> tuple[float, float, float, tuple[int, ...]]:
    """The plane below all points that is highest at the centre, and the three points that it goes through."""
    best = (-math.inf, (0.0, 0.0, min(point[2] for point in points)), (0,))
    for trio in combinations(range(len(points)), 3):
        plane = _through(*(points[i] for i in trio))
        if plane is None:
            continue
        a, b, c = plane
        height = a * centre[0] + b * centre[1] + c
        if height > best[0] and all(z - (a * x + b * y + c) > -1e-7 * (1 + abs(x) + abs(y)) for x, y, z in points):
            best = height, plane, trio  # type: ignore[assignment]
    return *best[1], best[2]


def _through(p: Vector, q: Vector, r: Vector) -> Vector | None:
    """a, b, c of z = a x + b y + c through three points; None for an upright plane or three points in line."""
    ux, uy, uz = (q[i] - p[i] for i in range(3))
    vx, vy, vz = (r[i] - p[i] for i in range(3))
    area = ux * vy - uy * vx
    if abs(area) < 1e-12:
        return None
    a, b = (uz * vy - uy * vz) / area, (ux * vz - uz * vx) / area
    return a, b, p[2] - a * p[0] - b * p[1]
