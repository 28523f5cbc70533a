"""URDF's visual and collision elements -> shapes."""

from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.robot.parts import Pose, Shape
from holozen.robot.source import Source
from holozen.robot.tag import Tag, Vector
from holozen.robot.uris import resolve_uri

SMALLEST = 1e-6  # of a size in metres, and of a mesh's scale

SIZES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}
"""Attributes that give a shape's size, and how many numbers each holds."""


def read_shape(tag: Tag, source: Source) -> Shape:
    """A `<visual>` or `<collision>`. Raises RobotError."""
    geometry = needed(tag, "geometry")
    known = [child for child in geometry.children if child.name in SIZES or child.name == "mesh"]
    if not known:
        found = ", ".join(f"<{child.name}>" for child in geometry.children) or "nothing"
        raise geometry.wrong(f"holds {found}; it has to hold <box>, <cylinder>, <sphere> or <mesh>")
    shape = known[0]
    if shape.name == "mesh":
        return Shape("mesh", _scale(shape), read_pose(tag), _mesh(shape, tag.name, source))
    return Shape(shape.name, _size(shape), read_pose(tag))


def needed(tag: Tag, name: str) -> Tag:
    """The child called `name`. Raises RobotError if there is none."""
    found = tag.first(name)
    if found is None:
        raise tag.wrong(f"has no <{name}>")
    return found


def read_pose(tag: Tag) -> Pose:
    """The pose of an `<origin>`; without one it is the parent's frame."""
    origin = tag.first("origin")
    zero = (0.0, 0.0, 0.0)
    return Pose() if origin is None else Pose(origin.vector("xyz", zero), origin.vector("rpy", zero))


def _size(tag: Tag) -> tuple[float, ...]:
    attributes, count = SIZES[tag.name]
    size = tuple(value for attribute in attributes.split() for value in tag.numbers(attribute, count))
    if min(size) < SMALLEST:
        raise tag.wrong(f"has the size {size} m; each number has to be {SMALLEST:g} or more")
    return size


def _scale(tag: Tag) -> Vector:
    scale = tag.vector("scale", (1.0, 1.0, 1.0))
    if min(abs(factor) for factor in scale) < SMALLEST:
        raise tag.wrong(f"has the scale {scale}; a zero leaves nothing of the mesh (below zero mirrors it)")
    return scale


def _mesh(tag: Tag, use: str, source: Source) -> Path | None:
    uri = tag.word("filename")
    try:
        return resolve_uri(uri, source.origin, source.packages)
    except RobotError as error:
        source.warn(tag, f"({use}) is left out: {error}")
        return None
