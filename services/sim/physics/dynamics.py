"""The engine's parameters of a part's joint and surface: limits, damping, friction, stiffness."""

import math
from collections.abc import Iterable
from typing import Any

from holozen.robot.model import GRAVITY as GRAVITY_VECTOR
from holozen.robot.model import Surface
from holozen.robot.rigid import Part
from holozen.rotation import XYZ, conjugate, rotate

from .engine import bullet

FRICTION = 1.0  # Gazebo's default for mu and mu2
DRAG = 0.1  # friction of a caster whose file sets none; with more it chatters and lifts the wheels
MAX_FRICTION = 10.0  # the engine multiplies the two surfaces'; students write 100 where they mean "does not slip"
SIDEWAYS = 0.2  # share of it along the axles of a skid-steer, unless its file sets it
GRAVITY = -GRAVITY_VECTOR[2]  # m/s^2
GENTLE = 4.0  # steps in which a contact resolves penetration, at the fastest
SINK = 2e-4  # m that a skid-steer's tyres yield under its weight, so that all of them carry it
RECOVERY = 0.1  # s; time constant of their rebound


def set_joint(world: int, body: int, number: int, part: Part, damping: float) -> None:
    """The part's inertia, the limits of its joint, and the joint's damping in N m s/rad or N s/m. The engine's own
    damping is off.
    """
    settings: dict[str, Any] = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": damping}
    limits = part.joint.limits if part.joint else None
    if limits and math.isfinite(limits.lower) and math.isfinite(limits.upper):
        settings |= {"jointLowerLimit": limits.lower, "jointUpperLimit": limits.upper}
    bullet.changeDynamics(body, number, **settings, physicsClientId=world)
    # In a separate call: the engine recomputes inertias when other values change.
    bullet.changeDynamics(body, number, localInertiaDiagonal=part.body.inertia, physicsClientId=world)


def set_surface(
    world: int, body: int, links: Iterable[int], part: Part, dt: float, load: float = 0.0, drags: bool = False,
    rolls: bool = False,
) -> None:  # fmt: skip
    """Set the contact parameters of a part's shapes, those of `links`, for steps of `dt` seconds. `load` in N is the
    weight on a wheel that has to slide along its axle, else 0. `drags`: the part is a caster, or the chassis, of a
    robot that wheels drive. `rolls`: rollers on the part's rim take the motion along its axle.
    """
    mu, across = _friction(part.surface, load > 0, DRAG if drags else FRICTION)
    across = 0.0 if rolls else across
    settings: dict[str, Any] = {"lateralFriction": min(mu, MAX_FRICTION)}
    if part.joint and mu and across < mu:
        # The axle keeps its direction while the wheel turns, so the link's own axes suffice.
        turns = [abs(component) for component in rotate(conjugate(part.body.axes), part.joint.axis)]
        axle = turns.index(max(turns))
        settings["anisotropicFriction"] = [across / mu if index == axle else 1.0 for index in range(3)]
    if part.surface.kp and part.surface.kd:
        # With less damping the engine resolves penetration at once, and throws falling bodies up.
        least = part.surface.kp * dt * GENTLE
        settings |= {"contactStiffness": part.surface.kp, "contactDamping": max(part.surface.kd, least)}
    elif load:
        settings |= {"contactStiffness": load / SINK, "contactDamping": load / SINK * RECOVERY}
    for link in links:
        bullet.changeDynamics(body, link, **settings, physicsClientId=world)


def load_on(parts: list[Part], wheels: int) -> float:
    """The weight on each of `wheels` wheels, in N."""
    return sum(part.body.mass for part in parts) * GRAVITY / wheels if wheels else 0.0


def damping_of(parts: list[Part], number: int, dt: float) -> float:
    """The damping to give the engine for steps of `dt` seconds: it slows the joint of part `number` in a step as much
    as the file's damping does in that time.

    The engine applies the damping force of the step's start to the whole step, which makes a light wheel oscillate
    with growing amplitude where damping * dt is above twice its inertia.
    """
    part = parts[number]
    if part.joint is None or part.joint.damping <= 0:
        return 0.0
    beside = sum(other.parent == part.parent for other in parts)  # all of them may turn against the same part
    inertia = 1 / (1 / _inertia(part, part.joint.axis) + beside / _carrier(parts, part))
    return inertia / dt * -math.expm1(-part.joint.damping * dt / inertia)


def _carrier(parts: list[Part], part: Part) -> float:
    """The inertia of the part that carries another, about that one's axis."""
    assert part.joint is not None, "the root is carried by nothing"
    carrier = parts[part.parent].body
    return carrier.mass if part.joint.kind == "prismatic" else carrier.moment(rotate(part.rotation, part.joint.axis))


def _inertia(part: Part, axis: XYZ) -> float:
    """A part's own inertia on its joint: kg, or kg m^2 about its centre of mass; it never is less than that."""
    return part.body.mass if part.joint and part.joint.kind == "prismatic" else part.body.moment(axis)


def _friction(surface: Surface, slides: bool, default: float) -> tuple[float, float]:
    """Friction as a wheel rolls, and along its axle."""
    along = default if surface.mu1 is None else surface.mu1
    across = along if surface.mu2 is None else surface.mu2
    return (along, across * SIDEWAYS) if slides and along == across else (along, across)
