"""The poses of a robot's shapes with all joints at zero, and which of its parts are wheels."""

import math
import re
from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Tag
from holozen.robot.files.meshes import hull
from holozen.robot.model import Joint, RobotModel, Shape, solid
from holozen.robot.rigid import Frame, farthest, joint_axes, link_frames
from holozen.robot.rotation import Array, triple

Box = tuple[Array, Array]  # lowest and highest x, y, z

UP, DOWN = np.array((0.0, 0.0, 1.0)), np.array((0.0, 0.0, -1.0))
WAYS = np.vstack([np.eye(3), -np.eye(3)])


class Placed(Struct, frozen=True, eq=False):
    """A shape of `link`, a "collision" or "visual" by its `use`, with its `frame` in the root
    frame; in metres. `solid` is the shape, or the hull of a mesh. Its bounding box along its own
    axes has its centre at `centre`, in the root frame, and the half sizes `half`; a cylinder's axis
    is its z.
    """

    link: str
    use: str
    shape: Shape
    solid: Shape
    frame: Frame
    centre: Array
    half: Array

    def farthest(self, way: Array) -> Array:
        """The point (3,) of the shape that is farthest along the unit vector `way`, both in the
        root frame.
        """
        found = farthest(self.solid, way @ self.frame.rotation)
        assert found is not None, "what has no extent is not placed"
        return self.frame.position + self.frame.rotation @ found

    def holds(self, points: Array) -> npt.NDArray[np.bool_]:
        """Which of the points (n, 3), in the root frame, lie inside: (n,)."""
        own = np.abs((points - self.centre) @ self.frame.rotation)
        inside: npt.NDArray[np.bool_] = np.all(own < self.half, axis=1)
        if self.solid.kind in ("cylinder", "sphere"):
            inside &= (
                np.linalg.norm(own[:, : 2 if self.solid.kind == "cylinder" else 3], axis=1)
                < self.half[0]
            )
        return inside


def place_shapes(model: RobotModel) -> Iterator[Placed]:
    """Every shape with an extent: not planes, and not meshes that are missing or cannot be read."""
    frames = link_frames(model)
    for link in model.links.values():
        for use, shapes in (("collision", link.collisions), ("visual", link.visuals)):
            for shape in shapes:
                frame, found = frames[link.name] @ Frame.of(shape.pose), _solid(shape)
                if box := extent(found):
                    low, high = box
                    centre = frame.position + frame.rotation @ (low + high) / 2
                    yield Placed(link.name, use, shape, found, frame, centre, (high - low) / 2)


def extent(shape: Shape) -> Box | None:
    """The bounding box of a shape, in its own frame; None for a shape without extent."""
    ends = [end for way in WAYS if (end := farthest(shape, way)) is not None]
    return around(ends) if ends else None


def around(points: Iterable[Array]) -> Box:
    """The bounding box of points (3,), of at least one."""
    every = np.stack(list(points))
    return every.min(axis=0), every.max(axis=0)


def box_of(shapes: Iterable[Placed]) -> Box | None:
    """The bounding box of shapes, in the root frame; None for no shapes."""
    points = [shape.farthest(way) for shape in shapes for way in WAYS]
    return around(points) if points else None


def size_of(box: Box) -> Array:
    """Length, width and height (3,) in metres."""
    return box[1] - box[0]


def _solid(shape: Shape) -> Shape:
    if shape.kind == "mesh" and shape.path and not shape.points:
        try:
            return replace(shape, kind="hull", points=hull(shape.path, triple(shape.size)))
        except RobotError:
            return shape
    return solid(shape)


def fixed_bodies(model: RobotModel) -> list[list[str]]:
    """The rigid bodies of a robot: for each, the links that fixed joints connect, the one nearest
    to the root first.
    """
    fixed = {joint.child: joint.parent for joint in model.joints.values() if joint.kind == "fixed"}
    bodies: dict[str, list[str]] = {}
    for name in model.links:
        head = name
        while head in fixed:
            head = fixed[head]
        bodies.setdefault(head, [head])
        if name != head:
            bodies[head].append(name)
    return list(bodies.values())


def body_of(link: str, model: RobotModel) -> list[str]:
    """The links of the rigid body that a link belongs to."""
    return next(body for body in fixed_bodies(model) if link in body)


# Wheels.


ALIGNED = math.cos(math.radians(5))
SLACK = 0.1  # of a wheel's radius
LEAST = 0.002  # m

_NAMED = re.compile(r"wheel|tyre|tire(?!d)|(^|_)w[FBRL][LR]?$", re.IGNORECASE)
_NOT_ROLLING = re.compile(r"steer|caster|castor|swivel|roller|rotor|prop", re.IGNORECASE)
_CASTER = re.compile(r"caster|castor|ball|swivel|roller", re.IGNORECASE)


class Wheel(Struct, frozen=True, eq=False, dict=True):
    """A link that turns on a continuous joint and rolls, with the `links` fixed to it. `shape` is
    its collision shape, else its visual one.
    """

    joint: Joint
    axis: Array
    shape: Placed
    sure: bool
    links: tuple[str, ...]

    @property
    def rolls(self) -> bool:
        """Whether the axle is level enough for the wheel to stand on the ground."""
        return bool(abs(self.axis @ UP) < 0.5)

    @property
    def bottom(self) -> float:
        """z of its lowest point in the root frame, in metres."""
        return float(self.shape.farthest(DOWN)[2])

    @cached_property
    def half_width(self) -> float:
        """Half of its extent along the axle, in metres."""
        return self._reach(self.axis)

    @cached_property
    def radius(self) -> float:
        """Its largest distance from the axle, in metres."""
        axes = self.shape.frame.rotation.T
        across = [axis for axis in axes if abs(axis @ self.axis) < 0.5]
        return max(map(self._reach, across or axes))

    @property
    def slack(self) -> float:
        """The tolerance of its position, in metres."""
        return max(LEAST, SLACK * self.radius)

    def _reach(self, way: Array) -> float:
        return float((self.shape.farthest(way) - self.shape.centre) @ way)


def find_wheels(
    model: RobotModel, placed: Iterable[Placed], named: Iterable[tuple[Tag, str]]
) -> list[Wheel]:
    """The wheels: links on continuous joints of the body that carry no moving part, and that either
    a plugin names or whose own name is that of a wheel (`sure`), or that are cylinders no longer
    than wide (not `sure`).

    `named` are the elements and names of the joints that plugins name.
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
                wheels.append(
                    Wheel(joint, np.array(axes[joint.name].direction), shape, sure, tuple(links))
                )
    return wheels


def is_called_wheel(*names: str) -> bool:
    """Whether one of the names identifies the part as a wheel that rolls on the ground."""
    return any(_NAMED.search(name) for name in names) and not any(
        _NOT_ROLLING.search(name) for name in names
    )


def is_called_caster(*names: str) -> bool:
    """Whether one of the names identifies the part as a caster."""
    return any(_CASTER.search(name) for name in names)


def _by_body(placed: Iterable[Placed], bodies: Iterable[list[str]]) -> dict[str, Placed]:
    """First link of each body -> its shape: collision shapes before visual ones, round ones before
    others, and the larger of two links.
    """
    ranks = {
        ("collision", True): 3,
        ("collision", False): 2,
        ("visual", True): 1,
        ("visual", False): 0,
    }
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
    """Whether no other joint above or below it moves: the wheels of casters, rollers and
    suspensions do not count.
    """
    above = {other.child: other for other in model.joints.values()}
    below = [other for other in model.joints.values() if other.parent in body]
    if any(other.kind != "fixed" for other in below):
        return False
    other = above.get(joint.parent)
    while other is not None and other.kind == "fixed":
        other = above.get(other.parent)
    return other is None or other.kind == "floating"


def _is_disc(joint: Joint, shape: Placed) -> bool:
    other = _NOT_ROLLING.search(f"{joint.name} {joint.child}")
    return not other and shape.shape.kind == "cylinder" and shape.half[2] <= shape.half[0]
