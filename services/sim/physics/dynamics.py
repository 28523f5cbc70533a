"""The engine's parameters of a part's joint and surface: damping, friction, stiffness."""

import math
from collections.abc import Sequence

from holozen.robot.model import GRAVITY as GRAVITY_VECTOR
from holozen.robot.model import Surface
from holozen.robot.rigid import Part
from holozen.rotation import XYZ, rotate

from .engine import Contact

FRICTION = 1.0  # Gazebo's default for mu and mu2
DRAG = 0.1  # friction of a caster whose file sets none; with more it chatters and lifts the wheels
# the engine multiplies the friction of both surfaces, and some files have 100 for "does not slip"
MAX_FRICTION = 10.0
SIDEWAYS = 0.2  # share of the friction along the axles of a skid-steer, unless its file sets it
GRAVITY = -GRAVITY_VECTOR[2]  # m/s^2
GENTLE = 4.0  # the fewest steps in which a contact resolves penetration
SINK = 2e-4  # m that a skid-steer's tyres yield under its weight, so that all of them carry it
# m that a caster, or the chassis, yields under the robot's weight, so that its two wheels carry it
YIELD = 2e-3
RECOVERY = 0.1  # s; time constant of their rebound
MAX_LOST = 10.0  # time constants of damping in a step; beyond, a joint stands still at once


def contact_of(
    part: Part,
    dt: float,
    load: float = 0.0,
    drags: bool = False,
    rolls: bool = False,
    yields: float = 0.0,
) -> Contact:
    """The contact parameters of a part, for steps of `dt` seconds. `load` is the weight (N) on a
    wheel that has to slide along its axle, else 0. `drags`: the part is a caster, or the chassis,
    of a robot on driven wheels. `rolls`: the part has rollers on its rim, and no friction along its
    axle. `yields` is the robot's weight (N) if the part has to leave it to two driven wheels that
    are as low, else 0.
    """
    mu, across = _friction(part.surface, load > 0, DRAG if drags else FRICTION)
    across = 0.0 if rolls else across
    share = across / mu if part.joint and mu and across < mu else 1.0
    stiffness = damping = 0.0
    soft = yields / YIELD
    if part.surface.kp and part.surface.kd and not 0 < soft < part.surface.kp:
        # With less damping the engine resolves penetration at once, and throws falling bodies up.
        stiffness, damping = part.surface.kp, max(part.surface.kd, part.surface.kp * dt * GENTLE)
    elif load:
        stiffness, damping = load / SINK, load / SINK * RECOVERY
    elif soft:
        stiffness, damping = soft, soft * RECOVERY
    return Contact(min(mu, MAX_FRICTION), share, stiffness, damping, yields=soft > 0)


def load_on(parts: list[Part], wheels: int) -> float:
    """The weight on each of `wheels` wheels, in N."""
    return sum(part.body.mass for part in parts) * GRAVITY / wheels if wheels else 0.0


def damping_of(parts: Sequence[Part], number: int, dt: float, implicit: bool = False) -> float:
    """The damping to give the engine for the joint of part `number`, so that a step of `dt` seconds
    slows the joint as much as the file's damping does in continuous time.

    An engine applies the damping force at the start of a step to all of it, which makes a light
    wheel oscillate with growing amplitude where damping * dt is more than twice its inertia; an
    `implicit` one applies that at the end.
    """
    part = parts[number]
    if part.joint is None or part.joint.damping <= 0:
        return 0.0
    # all of them may turn against the same part
    beside = sum(other.parent == part.parent for other in parts)
    inertia = 1 / (1 / _inertia(part, part.joint.axis) + beside / _carrier(parts, part))
    lost = part.joint.damping * dt / inertia
    return inertia / dt * (math.expm1(min(lost, MAX_LOST)) if implicit else -math.expm1(-lost))


def _carrier(parts: Sequence[Part], part: Part) -> float:
    """The inertia of the part that carries this one, about this one's joint axis; its mass for a
    prismatic joint. Infinite for one without, such as a link `world`, which the engine holds.
    """
    assert part.joint is not None and part.parent is not None, "nothing carries the root"
    carrier = parts[part.parent].body
    if part.joint.kind == "prismatic":
        return carrier.mass or math.inf
    return carrier.moment(rotate(part.rotation, part.joint.axis)) or math.inf


def _inertia(part: Part, axis: XYZ) -> float:
    """A part's own inertia on its joint: its mass in kg, or the moment in kg m^2 about its centre
    of mass, a lower bound.
    """
    return (
        part.body.mass if part.joint and part.joint.kind == "prismatic" else part.body.moment(axis)
    )


def _friction(surface: Surface, slides: bool, default: float) -> tuple[float, float]:
    """The friction in a wheel's rolling direction, and along its axle."""
    along = default if surface.mu1 is None else surface.mu1
    across = along if surface.mu2 is None else surface.mu2
    return (along, across * SIDEWAYS) if slides and along == across else (along, across)
