"""URDF elements -> links and joints."""

import math
from dataclasses import replace

from holozen.robot.errors import cut
from holozen.robot.materials import Materials, urdf_color
from holozen.robot.moments import NO_INERTIA, with_moments
from holozen.robot.parts import JOINT_KINDS, Inertial, Joint, Limits, Link, Mimic, Shape
from holozen.robot.shapes import needed, read_pose, read_shape
from holozen.robot.source import Source
from holozen.robot.tag import Tag, Vector

SMALLEST_AXIS = 1e-6


def read_link(tag: Tag, source: Source, materials: Materials = {}) -> Link:
    """A `<link>`; `materials` are those of its robot. Raises RobotError."""
    inertial = tag.first("inertial")
    link = Link(
        name=tag.word("name"),
        inertial=None if inertial is None else _inertial(inertial),
        visuals=tuple(_visual(visual, source, materials) for visual in tag.all("visual")),
        collisions=tuple(read_shape(collision, source) for collision in tag.all("collision")),
    )
    return with_moments(link, inertial, source)


def read_joint(tag: Tag, source: Source) -> Joint:
    """A `<joint>`. Raises RobotError."""
    kind = tag.word("type")
    if kind not in JOINT_KINDS:
        raise tag.wrong(f"has the unknown type {cut(kind)}; known are {', '.join(JOINT_KINDS)}")
    ends = {name: tag.first(name) for name in ("parent", "child")}
    parent, child = (needed(tag, name).word("link") for name in ends)
    friction, damping = (_dynamics(tag, name) for name in ("friction", "damping"))
    axis, limits = _axis(tag, kind), _limits(tag, kind, source)
    return Joint(tag.word("name"), kind, parent, child, read_pose(tag), axis, limits, friction, damping, _mimic(tag))


def _visual(tag: Tag, source: Source, materials: Materials) -> Shape:
    shape = read_shape(tag, source)
    color = urdf_color(tag, materials, source)
    return replace(shape, color=color) if color else shape


def _dynamics(tag: Tag, name: str) -> float:
    dynamics = tag.first("dynamics")
    value = 0.0 if dynamics is None else dynamics.number(name, 0.0)
    if dynamics is not None and value < 0:
        raise dynamics.wrong(f"{name}: {value} is below zero; it would drive the joint on")
    return value


def _mimic(tag: Tag) -> Mimic | None:
    mimic = tag.first("mimic")
    if mimic is None:
        return None
    return Mimic(mimic.word("joint"), mimic.number("multiplier", 1.0), mimic.number("offset", 0.0))


def _inertial(tag: Tag) -> Inertial:
    mass = needed(tag, "mass").number("value")
    if mass < 0:
        raise needed(tag, "mass").wrong(f"value: {mass} kg is below zero")
    return Inertial(read_pose(tag), mass, _inertia(tag) if mass else NO_INERTIA)


def _inertia(tag: Tag) -> tuple[float, float, float, float, float, float]:
    given = tag.first("inertia") or Tag("inertia", {}, tag.place, tag)
    xx, xy, xz, yy, yz, zz = (given.number(name, 0.0) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    if min(xx, yy, zz) < 0:
        raise given.wrong(f"has ixx={xx}, iyy={yy}, izz={zz}; a moment of inertia is never below zero")
    # Refusing what is not positive definite would stop many a student's robot.
    return (xx, xy, xz, yy, yz, zz) if positive_definite(xx, xy, xz, yy, yz, zz) else NO_INERTIA


def positive_definite(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float) -> bool:
    """Sylvester's criterion: the leading minors are above zero."""
    minor = xx * yy - xy * xy
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    return xx > 0 and minor > 0 and determinant > 0


def _axis(tag: Tag, kind: str) -> Vector:
    axis = tag.first("axis")
    if axis is None or kind in ("fixed", "floating"):
        return (1.0, 0.0, 0.0)
    x, y, z = axis.vector("xyz", (1.0, 0.0, 0.0))
    length = math.hypot(x, y, z)
    if length < SMALLEST_AXIS:
        raise axis.wrong("has no direction; a wheel that turns about its own y has xyz='0 1 0'")
    return x / length, y / length, z / length


def _limits(tag: Tag, kind: str, source: Source) -> Limits:
    limit = tag.first("limit")
    bounded = kind in ("revolute", "prismatic")
    if limit is None:
        if bounded:
            source.warn(tag, f"is {kind} and has no <limit>; it is taken as unlimited")
        return Limits()
    effort, velocity = (_most(limit, name, source) for name in ("effort", "velocity"))
    if not bounded:
        return Limits(effort, velocity)
    # URDF: a position bound that is left out is 0.
    lower, upper = (limit.number(name, 0.0, most=math.inf) for name in ("lower", "upper"))
    if lower > upper:
        raise limit.wrong(f"has lower={lower} above upper={upper}")
    return Limits(effort, velocity, lower, upper)


def _most(limit: Tag, name: str, source: Source) -> float:
    value = limit.number(name, math.inf, most=math.inf)
    if value < 0:
        source.warn(limit, f"{name}: {value:g} is below zero; it is taken as unlimited")
        return math.inf
    return value
