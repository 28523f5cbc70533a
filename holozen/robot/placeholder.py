"""A box in place of a mesh that cannot be used: the robot still stands, and shows that something is missing."""

import math

from holozen.robot.errors import RobotError
from holozen.robot.parts import Pose, Shape
from holozen.robot.tag import Tag, number

EDGE = 0.1  # m; where the link tells nothing
SMALLEST, LARGEST = 1e-3, 2.0  # m; an inertia that needs another box is taken for a mistake
WIDEST = 0.3  # m; inertias are often guessed, and a box that is too large hides the robot

MOMENTS = ("ixx", "iyy", "izz")
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
"""What tells a shape's size: attributes in URDF, elements in SDF."""


def placeholder(tag: Tag, pose: Pose) -> Shape:
    """The box in place of a mesh of the link around `tag`: for a visual one that around the link's largest collision
    shape, meshes left out; else the one that has the link's mass and moments, cut to WIDEST; else a cube.

    In URDF it stands where the collision shape or the inertial frame is; in SDF, whose links may be told in other
    frames, at the shape's own `pose`, as the cube does. A box a, b, c of mass m has Ixx = m (b^2 + c^2) / 12, so
    a^2 = 6 (Iyy + Izz - Ixx) / m. The products of inertia are not looked at.
    """
    seen = _around(tag, "visual") is not None
    link = _around(tag, "link")
    solid = [found for shape in (link.all("collision") if link and seen else ()) if (found := _box(shape))]
    if solid:
        edges, collision = max(solid, key=lambda found: math.prod(found[0]))
        return Shape("box", edges, _origin(collision, _is_sdf(collision)) or pose)
    inertial = link.first("inertial") if link else None
    size = None if inertial is None else _size(inertial)
    if inertial is None or size is None:
        return Shape("box", (EDGE, EDGE, EDGE), pose)
    mass = inertial.first("mass")
    return Shape("box", size, _origin(inertial, mass is None or "value" not in mass.attributes) or pose)


def _around(tag: Tag | None, name: str) -> Tag | None:
    while tag is not None and tag.name != name:
        tag = tag.parent
    return tag


def _box(collision: Tag) -> tuple[tuple[float, ...], Tag] | None:
    """The edges of the box around a collision shape, and its element; None for a mesh, and for what is no size."""
    geometry = collision.first("geometry")
    for shape in geometry.children if geometry else ():
        numbers = [number(word) for name in SIZES.get(shape.name, ()) for word in _told(shape, name, name).split()]
        edges = [value for value in numbers if value is not None and 1e-6 <= value <= 1e3]
        if shape.name == "box" and len(edges) == 3:
            return tuple(edges), collision
        if shape.name == "cylinder" and len(edges) == 2:
            return (2 * edges[0], 2 * edges[0], edges[1]), collision
        if shape.name == "sphere" and len(edges) == 1:
            return (2 * edges[0],) * 3, collision
    return None


def _is_sdf(collision: Tag) -> bool:
    """SDF says in elements what URDF says in attributes."""
    geometry = collision.first("geometry")
    return geometry is not None and any(shape.children for shape in geometry.children)


def _size(inertial: Tag) -> tuple[float, ...] | None:
    inertia = inertial.first("inertia")
    mass = number(_told(inertial, "mass", "value"))
    moments = [number(_told(inertia, name, name)) for name in MOMENTS] if inertia else []
    known = [moment for moment in moments if moment is not None]
    if len(known) != 3 or mass is None or mass <= 0:
        return None
    squares = [6 * (sum(known) - 2 * moment) / mass for moment in known]
    if not all(SMALLEST**2 <= square <= LARGEST**2 for square in squares):
        return None
    return tuple(min(WIDEST, math.sqrt(square)) for square in squares)


def _told(tag: Tag, name: str, attribute: str) -> str:
    """What an element says of `name`: URDF in an attribute, SDF in a child's text."""
    child = tag.first(name)
    return tag.attributes.get(name, "") if child is None else child.attributes.get(attribute, child.text)


def _origin(tag: Tag, sdf: bool) -> Pose | None:
    """Where a URDF's inertial or collision frame is; None in SDF, and for numbers that are none."""
    origin = tag.first("origin")
    if sdf:
        return None
    try:
        zero = (0.0, 0.0, 0.0)
        return Pose() if origin is None else Pose(origin.vector("xyz", zero), origin.vector("rpy", zero))
    except RobotError:
        return None
