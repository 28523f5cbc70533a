"""URDF's visual and collision elements -> shapes."""

import os
from dataclasses import replace

from holozen.robot.errors import RobotError
from holozen.robot.parts import Color, Pose, Shape
from holozen.robot.placeholder import placeholder
from holozen.robot.source import Source
from holozen.robot.tag import Tag, Vector
from holozen.robot.uris import is_data, resolve_uri

MOST_MESHES = 200  # of a text that came over the wire: each takes up to 1 ms of the sim's loop
MOST_BYTES = 5_000_000  # of a file that such a text names: 0.3 s
SMALLEST = 1e-6  # of a size in metres, and of a mesh's scale

SIZES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}
"""Attributes that give a shape's size, and how many numbers each holds."""


def read_shape(tag: Tag, source: Source) -> Shape:
    """A `<visual>` or `<collision>`. Raises RobotError."""
    geometry = needed(tag, "geometry")
    known = [child for child in geometry.children if child.name in SIZES or child.name == "mesh"]
    if not known:
        found = ", ".join(f"<{child.name[:80]}>" for child in geometry.children[:12]) or "nothing"
        raise geometry.wrong(f"holds {found}; it has to hold <box>, <cylinder>, <sphere> or <mesh>")
    shape = known[0]
    if shape.name == "mesh":
        return mesh_shape(shape, shape.word("filename"), _scale(shape), read_pose(tag), tag.name, source)
    return Shape(shape.name, _size(shape), read_pose(tag))


def mesh_shape(
    tag: Tag, uri: str, scale: Vector, pose: Pose, use: str, source: Source, color: Color | None = None
) -> Shape:
    """The mesh that `uri` names, for a visual or collision (`use`) of a link around `tag`, in URDF or SDF.

    A collision mesh is read, a visual one only found. A mesh that is missing or bad makes a warning and a box in its
    place, or with `source.strict` a RobotError. Of a text that came over the wire visual meshes are not even
    looked for.
    """
    if use == "visual" and source.confined:
        return Shape("mesh", scale, pose, color=color)
    try:
        shape = _found(tag, uri, scale, pose, use, source)
    except RobotError as error:
        if source.strict:
            raise tag.wrong(f"({use}): {error}") from None
        shape = placeholder(tag, pose)
        size = " x ".join(f"{edge:.3g}" for edge in shape.size)
        source.warn(tag, f"({use}) is replaced by a box of {size} m: {error}")
    return replace(shape, color=color)


def solid(shape: Shape) -> Shape:
    """What the sim takes: the convex hull of a mesh that was found; any other shape as it is. Raises RobotError."""
    if shape.kind != "mesh" or shape.path is None:
        return shape
    from holozen.robot.mesh.files import hull

    x, y, z = shape.size
    return replace(shape, kind="hull", size=(), points=hull(shape.path, (x, y, z)))


def _found(tag: Tag, uri: str, scale: Vector, pose: Pose, use: str, source: Source) -> Shape:
    source.meshes += 1
    if source.confined and source.meshes > MOST_MESHES:
        raise RobotError(f"is number {source.meshes}; of a text that was sent {MOST_MESHES} collision meshes are read")
    if is_data(uri):
        from holozen.robot.mesh.files import data_hull

        return Shape("hull", (), pose, points=data_hull(uri, scale))
    path = resolve_uri(
        uri, source.origin, source.packages, source.confined, lambda taken: source.warn(tag, f"({use}): {taken}")
    )
    if use == "collision":
        from holozen.robot.mesh.files import hull

        if source.confined and os.path.getsize(path) > MOST_BYTES:
            raise RobotError(f"{path}: is too large to be read here; send the mesh itself (holozen spawn does)")
        hull(path, scale)  # here a bad one can be told with its line; `solid` does not read it again
    return Shape("mesh", scale, pose, path)


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
