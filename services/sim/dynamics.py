"""What a part's joint and surface are to the engine: limits, damping, friction, stiffness."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from holozen.robot.assembly import Part
from holozen.robot.parts import Surface
from holozen.robot.rotation import Array, matrix_of_quaternion

from .engine import Vector, bullet

FRICTION = 1.0  # Gazebo's default for mu and mu2
DRAG = 0.1  # of a caster without a word in its file; with more it chatters and lifts the wheels
MOST_FRICTION = 10.0  # the engine multiplies the two surfaces'; students write 100 where they mean "does not slip"
SIDEWAYS = 0.2  # of that is a skid-steer's friction along its axles, unless its file says otherwise
GRAVITY = 9.8  # m/s^2
GENTLE = 4.0  # steps in which a contact pushes out what sank into it, at the fastest
SINK = 2e-4  # m that a skid-steer's tyres give under its weight, so that all of them carry it; and
RECOVERY = 0.1  # s in which they come back


def set_joint(world: int, body: int, number: int, part: Part, damping: float) -> None:
    """The part's inertia, the limits of its joint, and the joint's damping in N m s/rad or N s/m. The engine's own
    damping is off.
    """
    settings: dict[str, Any] = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": damping}
    limits = part.joint.limits if part.joint else None
    if limits and math.isfinite(limits.lower) and math.isfinite(limits.upper):
        settings |= {"jointLowerLimit": limits.lower, "jointUpperLimit": limits.upper}
    bullet.changeDynamics(body, number, **settings, physicsClientId=world)
    # In a call of its own: the engine reckons inertias anew where others change.
    bullet.changeDynamics(body, number, localInertiaDiagonal=part.body.inertia, physicsClientId=world)


def set_surface(
    world: int, body: int, links: Iterable[int], part: Part, dt: float, load: float = 0.0, drags: bool = False
) -> None:
    """How the part's shapes touch, which are those of `links`, for steps of `dt` seconds. `load` in N is what rests on
    it if it is a wheel that has to slide along its axle, else 0. What `drags` is a caster, or the belly, of a robot
    that wheels drive.
    """
    mu, across = _friction(part.surface, load > 0, DRAG if drags else FRICTION)
    settings: dict[str, Any] = {"lateralFriction": min(mu, MOST_FRICTION)}
    if part.joint and mu and across < mu:
        # The axle keeps its direction while the wheel turns, so the link's own axes will do.
        turns = [abs(component) for component in part.joint.axis]
        axle = turns.index(max(turns))
        settings["anisotropicFriction"] = [across / mu if index == axle else 1.0 for index in range(3)]
    if part.surface.kp and part.surface.kd:
        # With less damping the engine pushes out what sank in at once, and so throws up what fell.
        least = part.surface.kp * dt * GENTLE
        settings |= {"contactStiffness": part.surface.kp, "contactDamping": max(part.surface.kd, least)}
    elif load:
        settings |= {"contactStiffness": load / SINK, "contactDamping": load / SINK * RECOVERY}
    for link in links:
        bullet.changeDynamics(body, link, **settings, physicsClientId=world)


def load_on(parts: list[Part], wheels: int) -> float:
    """What rests on each of that many wheels, in N."""
    return sum(part.body.mass for part in parts) * GRAVITY / wheels if wheels else 0.0


def damping_of(parts: list[Part], number: int, dt: float) -> float:
    """The damping to give the engine for steps of `dt` seconds: it slows the joint of part `number` in a step as much
    as the file's damping does in that time.

    The engine takes the whole step at the damping force of its begin, which throws a light wheel to and fro, ever
    faster, where damping * dt is above twice its inertia.
    """
    part = parts[number]
    if part.joint is None or part.joint.damping <= 0:
        return 0.0
    beside = sum(other.parent == part.parent for other in parts)  # they may all turn against the same part
    inertia = 1 / (1 / _inertia(part, part.joint.axis) + beside / _carrier(parts, part))
    return inertia / dt * -math.expm1(-part.joint.damping * dt / inertia)


def _carrier(parts: list[Part], part: Part) -> float:
    """The inertia of the part that carries another, about that one's axis."""
    assert part.joint is not None, "the root is carried by nothing"
    axis = matrix_of_quaternion(part.rotation) @ np.array(part.joint.axis)
    carrier = parts[part.parent]
    return carrier.body.mass if part.joint.kind == "prismatic" else _moment(carrier, axis)


def _inertia(part: Part, axis: Vector) -> float:
    """A part's own inertia on its joint: kg, or kg m^2 about its centre of mass; it never is less than that."""
    return part.body.mass if part.joint and part.joint.kind == "prismatic" else _moment(part, np.array(axis))


def _moment(part: Part, axis: Array) -> float:
    along = matrix_of_quaternion(part.body.axes).T @ axis
    return float(np.array(part.body.inertia) @ along**2)


def _friction(surface: Surface, slides: bool, default: float) -> tuple[float, float]:
    """Friction as a wheel rolls, and along its axle."""
    along = default if surface.mu1 is None else surface.mu1
    across = along if surface.mu2 is None else surface.mu2
    return (along, across * SIDEWAYS) if slides and along == across else (along, across)
