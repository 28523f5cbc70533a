"""The placement of a robot's shapes with all joints at zero, and which of its parts are wheels."""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from holozen.robot.elements import Tag, Vector
from holozen.robot.errors import RobotError
from holozen.robot.meshes import hull
from holozen.robot.model import Joint, RobotModel, Shape
from holozen.robot.rigid import Frame, joint_axes, link_frames

Box = tuple[Vector, Vector]  # lowest and highest x, y, z

UP: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Placed:
    """A shape of `link` in the root frame, metres: its centre and its own x, y, z axes.

    `half` are the half sizes of the box around it; a cylinder's axis is its z. `points` are those of a mesh's hull.
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
        """A point given in the shape's own frame."""
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


def fixed_bodies(model: RobotModel) -> list[list[str]]:
    """Links that fixed joints connect to one rigid body; the one nearest to the root first."""
    fixed = {joint.child: joint.parent for joint in model.joints.values() if joint.kind not in MOVING}
    bodies: dict[str, list[str]] = {}
    for name in model.links:
        head = name
        while head in fixed:
            head = fixed[head]
        bodies.setdefault(head, [head])
        if name != head:
            bodies[head].append(name)
    return list(bodies.values())


# Wheels.


ALIGNED = math.cos(math.radians(5))
SLACK = 0.1  # of a wheel's radius
LEAST = 0.002  # m
MOVING = ("continuous", "revolute", "prismatic", "floating", "planar")

_NAMED = re.compile(r"wheel|tyre|tire(?!d)|(^|_)w[FBRL][LR]?$", re.IGNORECASE)
_NOT_ROLLING = re.compile(r"steer|caster|castor|swivel|roller|rotor|prop", re.IGNORECASE)
_CASTER = re.compile(r"caster|castor|ball|swivel|roller", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Wheel:
    """A link that turns on a continuous joint and rolls, with the `links` fixed to it. `shape` is its collision shape,
    else its visual one.
    """

    joint: Joint
    axis: Vector
    shape: Placed
    sure: bool
    links: tuple[str, ...]

    @property
    def rolls(self) -> bool:
        """Whether the axle is level enough for the wheel to stand on the ground."""
        return abs(dot(self.axis, UP)) < 0.5

    @property
    def bottom(self) -> float:
        """The height of its lowest point in the root frame, metres."""
        return self.shape.farthest((0.0, 0.0, -1.0))[2]

    @property
    def half_width(self) -> float:
        """From the centre along the axle, metres."""
        return self._reach(self.axis)

    @property
    def radius(self) -> float:
        """From the axle, metres."""
        across = [axis for axis in self.shape.axes if abs(dot(axis, self.axis)) < 0.5]
        return max(map(self._reach, across or self.shape.axes))

    @property
    def slack(self) -> float:
        """Tolerance, metres."""
        return max(LEAST, SLACK * self.radius)

    def _reach(self, way: Vector) -> float:
        return dot(minus(self.shape.farthest(way), self.shape.centre), way)


def find_wheels(model: RobotModel, placed: Iterable[Placed], named: Iterable[tuple[Tag, str]]) -> list[Wheel]:
    """Wheels are on continuous joints of the body, carry nothing movable, and are named by a plugin, called a
    wheel, or (not `sure`) are cylinders no longer than wide.
    """
    bodies = {body[0]: body for body in fixed_bodies(model)}
    axes, shapes = joint_axes(model), _by_body(placed, bodies.values())
    driven = {name for _, name in named}
    wheels = []
    for joint in model.joints.values():
        shape = shapes.get(joint.child)
        if joint.kind == "continuous" and shape and _is_free(joint, model, bodies[joint.child]):
            links = bodies[joint.child]
            sure = joint.name in driven or is_called_wheel(joint.name, *links)
            if sure or _is_disc(joint, shape):
                wheels.append(Wheel(joint, axes[joint.name].direction, shape, sure, tuple(links)))
    return wheels


def is_called_wheel(*names: str) -> bool:
    """Whether one of the names identifies the part as a wheel that rolls on the ground."""
    return any(_NAMED.search(name) for name in names) and not any(_NOT_ROLLING.search(name) for name in names)


def is_called_caster(*names: str) -> bool:
    """Whether one of the names identifies the part as a caster."""
    return any(_CASTER.search(name) for name in names)


def _by_body(placed: Iterable[Placed], bodies: Iterable[list[str]]) -> dict[str, Placed]:
    """First link of each body -> its shape: collision shapes before visual ones, round ones before others, and the
    larger of two links.
    """
    ranks = {("collision", True): 3, ("collision", False): 2, ("visual", True): 1, ("visual", False): 0}
    first = {link: body[0] for body in bodies for link in body}
    best: dict[str, Placed] = {}
    orders: dict[str, tuple[int, float]] = {}
    for shape in placed:
        body = first[shape.link]
        order = ranks[shape.use, shape.shape.kind in ("cylinder", "sphere")], max(shape.half)
        before = orders.get(body, (-1, 0.0))
        same = body in best and best[body].link == shape.link
        if order[0] > before[0] or (order[0] == before[0] and not same and order > before):
            best[body], orders[body] = shape, order
    return best


def _is_free(joint: Joint, model: RobotModel, body: list[str]) -> bool:
    """No other joint moves above it or below it: casters, rollers and suspensions are left alone."""
    above = {other.child: other for other in model.joints.values()}
    below = [other for other in model.joints.values() if other.parent in body]
    if any(other.kind in MOVING for other in below):
        return False
    other = above.get(joint.parent)
    while other is not None and other.kind == "fixed":
        other = above.get(other.parent)
    return other is None or other.kind == "floating"


def _is_disc(joint: Joint, shape: Placed) -> bool:
    other = _NOT_ROLLING.search(f"{joint.name} {joint.child}")
    return not other and shape.shape.kind == "cylinder" and shape.half[2] <= shape.half[0]
