"""Where a robot's shapes are with all joints at zero, and how far they reach."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from holozen.robot.errors import RobotError
from holozen.robot.mesh.files import hull
from holozen.robot.model import RobotModel
from holozen.robot.parts import Shape
from holozen.robot.rigid import Frame, link_frames
from holozen.robot.tag import Vector

Box = tuple[Vector, Vector]  # lowest and highest x, y, z

UP: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Placed:
    """A shape of `link` in the root frame, metres: its centre and its own x, y, z axes.

    `half` are the half sizes of the box around it; a cylinder stands along its z. `points` are those of a mesh's hull.
    """

    link: str
    use: str  # "collision" or "visual"
    shape: Shape
    centre: Vector
    axes: tuple[Vector, Vector, Vector]
    half: Vector
    points: tuple[Vector, ...] = ()

    def farthest(self, way: Vector) -> Vector:
        """The point of the shape that is farthest along the unit vector `way`."""
        x, y, z = (dot(axis, way) for axis in self.axes)
        if self.shape.kind == "sphere":
            return along(self.centre, way, self.half[0])
        if self.shape.kind == "cylinder":
            across = math.hypot(x, y)
            radius = self.half[0] / across if across > 1e-9 else 0.0
            return self.at((x * radius, y * radius, math.copysign(self.half[2], z)))
        if self.points:
            return self.at(max(self.points, key=lambda point: dot(point, (x, y, z))))
        sx, sy, sz = (math.copysign(half, part) for half, part in zip(self.half, (x, y, z), strict=True))
        return self.at((sx, sy, sz))

    def at(self, own: Vector) -> Vector:
        """A point that is told in the shape's own frame."""
        point = self.centre
        for axis, value in zip(self.axes, own, strict=True):
            point = along(point, axis, value)
        return point

    def holds(self, point: Vector) -> bool:
        """Whether a point lies inside."""
        away = minus(point, self.centre)
        x, y, z = (dot(axis, away) for axis in self.axes)
        if self.shape.kind == "sphere":
            return math.hypot(x, y, z) < self.half[0]
        if self.shape.kind == "cylinder":
            return math.hypot(x, y) < self.half[0] and abs(z) < self.half[2]
        return abs(x) < self.half[0] and abs(y) < self.half[1] and abs(z) < self.half[2]


def place_shapes(model: RobotModel) -> Iterator[Placed]:
    """Every shape with a size: not planes, and not meshes that are missing or cannot be read."""
    frames = link_frames(model)
    for link in model.links.values():
        for use, shapes in (("collision", link.collisions), ("visual", link.visuals)):
            for shape in shapes:
                frame = frames[link.name] @ Frame.of(shape.pose)
                yield from _placed(link.name, use, shape, frame)


def half_sizes(shape: Shape) -> Vector | None:
    """Half the sizes of a box, cylinder or sphere; None for anything else."""
    if shape.kind == "box":
        return shape.size[0] / 2, shape.size[1] / 2, shape.size[2] / 2
    if shape.kind == "cylinder":
        return shape.size[0], shape.size[0], shape.size[1] / 2
    return (shape.size[0],) * 3 if shape.kind == "sphere" else None


def around(points: Iterable[Vector]) -> Box:
    """The box around points."""
    x, y, z = zip(*points, strict=True)
    return (min(x), min(y), min(z)), (max(x), max(y), max(z))


def box_of(shapes: Iterable[Placed]) -> Box | None:
    """The box around shapes, in the root frame."""
    ways = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), UP]
    points = [shape.farthest(turn) for shape in shapes for way in ways for turn in (way, minus((0, 0, 0), way))]
    return around(points) if points else None


def size_of(box: Box) -> Vector:
    """Length, width and height."""
    return minus(box[1], box[0])


def dot(a: Vector, b: Vector) -> float:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a: Vector, b: Vector) -> Vector:
    """From b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def along(start: Vector, way: Vector, far: float) -> Vector:
    """The point `far` from `start` along `way`."""
    return start[0] + way[0] * far, start[1] + way[1] * far, start[2] + way[2] * far


def _placed(link: str, use: str, shape: Shape, frame: Frame) -> Iterator[Placed]:
    x, y, z = (tuple(column) for column in frame.rotation.T.tolist())
    half, points = half_sizes(shape), _points(shape)
    if half:
        yield Placed(link, use, shape, frame.xyz, (x, y, z), half)
    elif points:
        low, high = around(points)
        middle = along(low, minus(high, low), 0.5)
        centre = Placed(link, use, shape, frame.xyz, (x, y, z), high).at(middle)
        yield Placed(link, use, shape, centre, (x, y, z), minus(high, middle), tuple(minus(p, middle) for p in points))


def _points(shape: Shape) -> tuple[Vector, ...]:
    if shape.kind != "mesh" or shape.path is None:
        return shape.points
    x, y, z = shape.size
    try:
        return hull(shape.path, (x, y, z))
    except RobotError:
        return ()
