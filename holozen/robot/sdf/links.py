"""SDF links -> those of a robot."""

import math
from dataclasses import dataclass

from holozen.robot.moments import NO_INERTIA, with_moments
from holozen.robot.parts import Inertial, Link, Pose, Surface
from holozen.robot.sdf.shapes import read_shape
from holozen.robot.sdf.values import compose, empty, flag, numbers, read_pose, value
from holozen.robot.shapes import needed
from holozen.robot.source import Source
from holozen.robot.tag import Tag
from holozen.robot.urdf import positive_definite

GAZEBOS_INERTIAL = Inertial(Pose(), 1.0, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Held:
    """What a model says of all its links."""

    static: bool
    self_collide: bool


def read_link(tag: Tag, name: str, frame: Pose, held: Held, source: Source) -> Link:
    """A `<link>` whose own frame is `frame` in the one that the robot's link is told in. Raises RobotError."""
    if flag(tag, "kinematic", False) and not held.static:
        source.warn(tag, "is kinematic, which is not simulated; gravity and contacts move it like any other")
    visuals = [read_shape(visual, frame, source) for visual in tag.all("visual")]
    collisions = [read_shape(collision, frame, source) for collision in tag.all("collision")]
    link = Link(
        name=name,
        inertial=_inertial(tag, frame, held.static, source),
        visuals=tuple(shape for shape in visuals if shape is not None),
        collisions=tuple(shape for shape in collisions if shape is not None),
        surface=_surface(tag, flag(tag, "self_collide", held.self_collide), source),
        gravity=flag(tag, "gravity", True),
    )
    return with_moments(link, tag.first("inertial"), source, silent=held.static)


def _inertial(tag: Tag, frame: Pose, static: bool, source: Source) -> Inertial | None:
    inertial = tag.first("inertial")
    if inertial is None:
        if not static:
            source.warn(tag, "has no <inertial>; as in Gazebo it is taken as 1 kg with 1 kg m^2 about each axis")
        return None if static else GAZEBOS_INERTIAL
    if inertial.attributes.get("auto", "false").strip().lower() in ("true", "1") and not static:
        source.warn(inertial, "is to be worked out from the shapes, which is not done here; write <mass> and <inertia>")
    mass = value(inertial, "mass", 1.0)
    if mass < 0:
        raise needed(inertial, "mass").wrong(f"is {mass} kg, which is below zero")
    if mass == 0 and not static:
        source.warn(inertial, "has no mass; the link is taken as massless, with no inertia")
    pose = compose(frame, read_pose(inertial).pose)
    return Inertial(pose, mass, _inertia(inertial) if mass else NO_INERTIA)


def _inertia(tag: Tag) -> tuple[float, float, float, float, float, float]:
    given = tag.first("inertia") or empty(tag)
    xx, yy, zz = (value(given, name, 1.0) for name in ("ixx", "iyy", "izz"))
    xy, xz, yz = (value(given, name, 0.0) for name in ("ixy", "ixz", "iyz"))
    if min(xx, yy, zz) < 0:
        raise given.wrong(f"has ixx={xx}, iyy={yy}, izz={zz}; a moment of inertia is never below zero")
    return (xx, xy, xz, yy, yz, zz) if positive_definite(xx, xy, xz, yy, yz, zz) else NO_INERTIA


def _surface(tag: Tag, self_collide: bool, source: Source) -> Surface:
    """The surface of a link's first collision that has one: there is one for all of them."""
    found = [surface for collision in tag.all("collision") if (surface := collision.first("surface"))]
    values = [tuple(_first(surface, paths) for paths in SURFACE.values()) for surface in found]
    if any(other != values[0] for other in values):
        source.warn(tag, "has collisions with different surfaces; the first one's holds for all")
    mu1, mu2, kp, kd = values[0] if values else (None, None, None, None)
    return Surface(mu1, mu2, kp, kd, self_collide)


SURFACE = {
    "mu1": ("friction/ode/mu", "friction/bullet/friction"),
    "mu2": ("friction/ode/mu2", "friction/bullet/friction2"),
    "kp": ("contact/ode/kp", "contact/bullet/kp"),
    "kd": ("contact/ode/kd", "contact/bullet/kd"),
}
"""Where a surface says what; the first that is there counts."""


def _first(surface: Tag, paths: tuple[str, ...]) -> float | None:
    for path in paths:
        tag: Tag | None = surface
        for name in path.split("/"):
            tag = tag.first(name) if tag else None
        if tag is not None:
            (number,) = numbers(tag, 1, most=math.inf)
            if number < 0:
                raise tag.wrong(f"is {number}, which is below zero")
            return number
    return None
