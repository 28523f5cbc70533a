"""URDF elements -> links and joints."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.robot.parts import JOINT_KINDS, Inertial, Joint, Limits, Link, Pose, Shape
from holozen.robot.tag import Tag, Vector
from holozen.robot.uris import resolve_uri

SMALLEST = 1e-6  # of a size in metres, and of a mesh's scale

SIZES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}
"""Attributes that give a shape's size, and how many numbers each holds."""

NO_INERTIA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(slots=True)
class Source:
    """The file a robot comes from, the packages given with it, and what there is to warn of in it."""

    origin: Path
    packages: Mapping[str, Path]
    warnings: list[str] = field(default_factory=list)

    def warn(self, tag: Tag, problem: str) -> None:
        """Notes a mistake that a robot can be driven with."""
        self.warnings.append(str(tag.wrong(problem)))


def read_link(tag: Tag, source: Source) -> Link:
    """A `<link>`. Raises RobotError."""
    inertial = tag.first("inertial")
    return Link(
        name=tag.word("name"),
        inertial=None if inertial is None else _inertial(inertial, source),
        visuals=tuple(_shape(visual, source) for visual in tag.all("visual")),
        collisions=tuple(_shape(collision, source) for collision in tag.all("collision")),
    )


def read_joint(tag: Tag, source: Source) -> Joint:
    """A `<joint>`. Raises RobotError."""
    kind = tag.word("type")
    if kind not in JOINT_KINDS:
        raise tag.wrong(f"has the unknown type {kind!r}; known are {', '.join(JOINT_KINDS)}")
    ends = {name: tag.first(name) for name in ("parent", "child")}
    parent, child = (_needed(tag, name).word("link") for name in ends)
    return Joint(tag.word("name"), kind, parent, child, _pose(tag), _axis(tag, kind), _limits(tag, kind, source))


def _needed(tag: Tag, name: str) -> Tag:
    found = tag.first(name)
    if found is None:
        raise tag.wrong(f"has no <{name}>")
    return found


def _pose(tag: Tag) -> Pose:
    origin = tag.first("origin")
    zero = (0.0, 0.0, 0.0)
    return Pose() if origin is None else Pose(origin.vector("xyz", zero), origin.vector("rpy", zero))


def _inertial(tag: Tag, source: Source) -> Inertial:
    mass = _needed(tag, "mass").number("value")
    if mass < 0:
        raise _needed(tag, "mass").wrong(f"value: {mass} kg is below zero")
    if mass == 0:
        source.warn(tag, "has no mass; the link is taken as massless, with no inertia")
    return Inertial(_pose(tag), mass, _inertia(tag, source) if mass else NO_INERTIA)


def _inertia(tag: Tag, source: Source) -> tuple[float, float, float, float, float, float]:
    given = tag.first("inertia") or Tag("inertia", {}, tag.place, tag)
    xx, xy, xz, yy, yz, zz = (given.number(name, 0.0) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    if min(xx, yy, zz) < 0:
        raise given.wrong(f"has ixx={xx}, iyy={yy}, izz={zz}; a moment of inertia is never below zero")
    if not _positive_definite(xx, xy, xz, yy, yz, zz):
        # Refusing it would stop many a student's robot. A point mass still counts in the robot's inertia.
        source.warn(given, "is zero or not positive definite, which no body has; the link is taken as a point mass")
        return NO_INERTIA
    return xx, xy, xz, yy, yz, zz


def _positive_definite(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float) -> bool:
    """Sylvester's criterion: the leading minors are above zero."""
    minor = xx * yy - xy * xy
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    return xx > 0 and minor > 0 and determinant > 0


def _shape(tag: Tag, source: Source) -> Shape:
    geometry = _needed(tag, "geometry")
    known = [child for child in geometry.children if child.name in SIZES or child.name == "mesh"]
    if not known:
        found = ", ".join(f"<{child.name}>" for child in geometry.children) or "nothing"
        raise geometry.wrong(f"holds {found}; it has to hold <box>, <cylinder>, <sphere> or <mesh>")
    shape = known[0]
    if shape.name == "mesh":
        return Shape("mesh", _scale(shape), _pose(tag), _mesh(shape, tag.name, source))
    return Shape(shape.name, _size(shape), _pose(tag))


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


def _axis(tag: Tag, kind: str) -> Vector:
    axis = tag.first("axis")
    if axis is None or kind in ("fixed", "floating"):
        return (1.0, 0.0, 0.0)
    x, y, z = axis.vector("xyz", (1.0, 0.0, 0.0))
    length = math.hypot(x, y, z)
    if length < SMALLEST:
        raise axis.wrong("has no direction; a wheel that turns about its own y has xyz='0 1 0'")
    return x / length, y / length, z / length


def _limits(tag: Tag, kind: str, source: Source) -> Limits:
    limit = tag.first("limit")
    bounded = kind in ("revolute", "prismatic")
    if limit is None:
        if bounded:
            source.warn(tag, f"is {kind} and has no <limit>; it is taken as unlimited")
        return Limits()
    effort, velocity = (limit.number(name, math.inf, most=math.inf) for name in ("effort", "velocity"))
    if not bounded:
        return Limits(effort, velocity)
    # URDF: a position bound that is left out is 0.
    lower, upper = (limit.number(name, 0.0, most=math.inf) for name in ("lower", "upper"))
    if lower > upper:
        raise limit.wrong(f"has lower={lower} above upper={upper}")
    return Limits(effort, velocity, lower, upper)
