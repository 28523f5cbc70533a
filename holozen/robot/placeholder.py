"""A box in place of a mesh that cannot be used: the robot still stands, and shows that something is missing."""

import math

from holozen.robot.errors import RobotError
from holozen.robot.parts import Pose, Shape
from holozen.robot.tag import Tag, number

EDGE = 0.1  # m; where the inertia tells nothing
SMALLEST, LARGEST = 1e-3, 2.0  # m; an inertia that needs another box is taken for a mistake

MOMENTS = ("ixx", "iyy", "izz")


def placeholder(tag: Tag, pose: Pose) -> Shape:
    """The box that has the mass and moments of the link around `tag`, else a cube.

    In URDF it stands where the inertial frame is; in SDF, whose links may be told in other frames, at the shape's own
    `pose`, as the cube does. A box a, b, c of mass m has Ixx = m (b^2 + c^2) / 12, so a^2 = 6 (Iyy + Izz - Ixx) / m.
    The products of inertia are not looked at.
    """
    inertial = _inertial(tag)
    size = None if inertial is None else _size(inertial)
    if inertial is None or size is None:
        return Shape("box", (EDGE, EDGE, EDGE), pose)
    return Shape("box", size, _origin(inertial) or pose)


def _inertial(tag: Tag | None) -> Tag | None:
    while tag is not None and tag.name != "link":
        tag = tag.parent
    return tag and tag.first("inertial")


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
    return tuple(math.sqrt(square) for square in squares)


def _told(tag: Tag, name: str, attribute: str) -> str:
    """What an element says of `name`: URDF in an attribute, SDF in a child's text."""
    child = tag.first(name)
    return tag.attributes.get(name, "") if child is None else child.attributes.get(attribute, child.text)


def _origin(inertial: Tag) -> Pose | None:
    """Where a URDF's inertial frame is; None in SDF, and for numbers that are none."""
    mass, origin = inertial.first("mass"), inertial.first("origin")
    if mass is None or "value" not in mass.attributes:
        return None
    try:
        zero = (0.0, 0.0, 0.0)
        return Pose() if origin is None else Pose(origin.vector("xyz", zero), origin.vector("rpy", zero))
    except RobotError:
        return None
