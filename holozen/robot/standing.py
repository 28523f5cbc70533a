"""How high a robot has to be put so that it stands on the ground."""

import math
from collections.abc import Callable

from holozen.robot.model import RobotModel
from holozen.robot.parts import Pose, Shape
from holozen.robot.rigid import Frame, link_frames
from holozen.robot.shapes import solid
from holozen.robot.tag import Vector

LEVEL = (0.0, 0.0, 0.0)


def lowest(model: RobotModel, rpy: Vector = LEVEL) -> float:
    """z in metres of the lowest collision point under the root frame, with all joints at zero and the root turned by
    `rpy` in radians; 0 without collision shapes. Raises RobotError for a mesh that cannot be read any more.
    """
    turned = Frame.of(Pose(rpy=rpy))
    frames = {name: turned @ frame for name, frame in link_frames(model).items()}
    shapes = [(frames[link.name], shape) for link in model.links.values() for shape in link.collisions]
    # Adding 0 makes a -0 a 0, as it is printed.
    low = min((_bottom(frame @ Frame.of(shape.pose), solid(shape)) for frame, shape in shapes), default=math.inf)
    return low + 0.0 if math.isfinite(low) else 0.0


def _bottom(frame: Frame, shape: Shape) -> float:
    """z of the lowest point of a shape. A plane and a mesh that was not found carry nothing: infinity."""
    reach = _REACHES.get(shape.kind)
    return math.inf if reach is None else float(frame.position[2]) - reach(shape, _up(frame))


def _up(frame: Frame) -> Vector:
    """The world's z axis in the shape's own frame."""
    x, y, z = (float(value) for value in frame.rotation[2])
    return x, y, z


def _box(shape: Shape, up: Vector) -> float:
    return sum(abs(part) * edge / 2 for part, edge in zip(up, shape.size, strict=True))


def _cylinder(shape: Shape, up: Vector) -> float:
    radius, length = shape.size
    return abs(up[2]) * length / 2 + math.hypot(up[0], up[1]) * radius


def _sphere(shape: Shape, up: Vector) -> float:
    return shape.size[0]


def _hull(shape: Shape, up: Vector) -> float:
    x, y, z = up
    return -min(a * x + b * y + c * z for a, b, c in shape.points)


_REACHES: dict[str, Callable[[Shape, Vector], float]] = {
    "box": _box,
    "cylinder": _cylinder,
    "sphere": _sphere,
    "hull": _hull,
}
"""How far in metres a kind of shape reaches below its origin."""
