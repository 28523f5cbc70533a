"""SDF's visual and collision elements -> shapes."""

import math
from functools import lru_cache
from itertools import product

from holozen.robot.materials import material_color
from holozen.robot.parts import Color, Pose, Shape
from holozen.robot.sdf.values import compose, direction, numbers, read_pose, value, vector, word
from holozen.robot.shapes import mesh_shape, needed
from holozen.robot.source import Source
from holozen.robot.tag import Tag, Vector

SMALLEST = 1e-6  # of a size in metres, and of a mesh's scale
AROUND, UPWARDS = 16, 9  # points of a round hull: on a circle, and circles from pole to pole

SIZES = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "cone": {"radius": 1, "length": 1},
    "ellipsoid": {"radii": 3},
}
"""The elements that give a shape's size, and how many numbers each holds."""

LEFT_OUT = ("heightmap", "polyline", "image")


def read_shape(tag: Tag, frame: Pose, source: Source) -> Shape | None:
    """A `<visual>` or `<collision>` in the link whose own frame is `frame` in the model's link; None for one that is
    left out with a warning, or empty. Raises RobotError.

    A capsule, a cone and an ellipsoid become the hull of points on them, at most 2 % thinner in a round cut.
    """
    pose = compose(frame, read_pose(tag).pose)
    geometry = needed(tag, "geometry")
    known = [child for child in geometry.children if child.name in (*SIZES, *LEFT_OUT, "plane", "mesh", "empty")]
    if not known:
        found = ", ".join(f"<{child.name[:80]}>" for child in geometry.children[:12]) or "nothing"
        raise geometry.wrong(f"holds {found}; it has to hold {_listed()}, <plane> or <mesh>")
    color = _color(tag, source) if tag.name == "visual" else None
    return _shape(known[0], tag.name, pose, color, source)


def _shape(tag: Tag, use: str, pose: Pose, color: Color | None, source: Source) -> Shape | None:
    if tag.name == "empty":
        return None
    if tag.name in LEFT_OUT:
        source.warn(tag, f"({use}) is left out; use {_listed()}, <plane> or <mesh>")
        return None
    if tag.name == "mesh":
        return _mesh(tag, use, pose, color, source)
    if tag.name == "plane":
        return Shape("plane", _plane_size(tag), compose(pose, _upon(direction(tag, "normal"))), color=color)
    size = _size(tag)
    if tag.name in ("box", "sphere", "cylinder"):
        return Shape(tag.name, size, pose, color=color)
    return Shape("hull", (), pose, color=color, points=tuple(_HULLS[tag.name](size)))


def _listed() -> str:
    return ", ".join(f"<{name}>" for name in SIZES)


def _size(tag: Tag) -> tuple[float, ...]:
    size = tuple(value for name, count in SIZES[tag.name].items() for value in numbers(needed(tag, name), count))
    if min(size) < SMALLEST:
        raise tag.wrong(f"has the size {size} m; each number has to be {SMALLEST:g} or more")
    return size


def _plane_size(tag: Tag) -> tuple[float, ...]:
    size = tag.first("size")
    sides = (1.0, 1.0) if size is None else numbers(size, 2)
    if min(sides) < SMALLEST:
        raise tag.wrong(f"has the size {sides} m; each number has to be {SMALLEST:g} or more")
    return sides


def _upon(normal: Vector) -> Pose:
    """The turn that lays z on `normal`."""
    x, y, z = normal
    return Pose(rpy=(0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)))


def _mesh(tag: Tag, use: str, pose: Pose, color: Color | None, source: Source) -> Shape | None:
    scale = vector(tag, "scale", (1.0, 1.0, 1.0))
    if min(abs(factor) for factor in scale) < SMALLEST:
        raise tag.wrong(f"has the scale {scale}; a zero leaves nothing of the mesh (below zero mirrors it)")
    if tag.first("submesh") is not None:
        source.warn(tag, f"({use}) names a <submesh>; the whole file is used")
    uri = word(tag, "uri")
    if not uri:
        raise tag.wrong("has no <uri>")
    return mesh_shape(tag, uri, scale, pose, use, source, color)


def _color(tag: Tag, source: Source) -> Color | None:
    """A visual's colour, as see-through as its `<transparency>` says."""
    material = tag.first("material")
    color = None if material is None else material_color(material, source)
    if color is None:
        return None
    red, green, blue, alpha = color
    return red, green, blue, alpha * (1 - min(max(value(tag, "transparency", 0.0), 0.0), 1.0))


def _capsule(size: tuple[float, ...]) -> list[Vector]:
    radius, length = size
    ball = [(x * radius, y * radius, z * radius) for x, y, z in _ball()]
    return [(x, y, z + math.copysign(length / 2, end)) for end in (1, -1) for x, y, z in ball if z * end > -SMALLEST]


def _cone(size: tuple[float, ...]) -> list[Vector]:
    radius, length = size
    return [(0.0, 0.0, length / 2), *((x * radius, y * radius, -length / 2) for x, y in _circle())]


def _ellipsoid(size: tuple[float, ...]) -> list[Vector]:
    a, b, c = size
    return [(a * x, b * y, c * z) for x, y, z in _ball()]


def _circle() -> list[tuple[float, float]]:
    turns = [2 * math.pi * step / AROUND for step in range(AROUND)]
    return [(math.cos(turn), math.sin(turn)) for turn in turns]


@lru_cache(1)
def _ball() -> list[Vector]:
    """Points on the unit sphere, the poles and the equator among them."""
    rings = [math.pi * step / (UPWARDS - 1) for step in range(1, UPWARDS - 1)]
    body = [(math.sin(up) * x, math.sin(up) * y, math.cos(up)) for up, (x, y) in product(rings, _circle())]
    return [(0.0, 0.0, 1.0), *body, (0.0, 0.0, -1.0)]


_HULLS = {"capsule": _capsule, "cone": _cone, "ellipsoid": _ellipsoid}
