"""Kinematics of a planar base, as pure functions. Metres, radians, seconds; x forward, y left, z up."""

import math
from dataclasses import dataclass

from holozen.limits import Planar


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel that rolls on the ground: centre (x, y) and axle direction (ax, ay) in the body frame, radius in m.

    `skew` is the tangent of the angle from the rolling direction to the axis of the roller on the ground: 0 on an omni
    wheel, 1 or -1 on a mecanum wheel.
    """

    joint: str
    x: float
    y: float
    ax: float
    ay: float
    radius: float
    skew: float = 0.0


def to_world(velocity: Planar, yaw: float, dt: float) -> tuple[float, float]:
    """The world-frame velocity (m/s) that moves a body at `yaw` for one step of `dt` seconds.

    The heading at mid-step is used, so that a turning body follows its arc and not a polygon outside it.
    """
    x, y, turn = velocity
    heading = yaw + turn * dt / 2
    cosine, sine = math.cos(heading), math.sin(heading)
    return x * cosine - y * sine, x * sine + y * cosine


def travelled(velocity: Planar, yaw: float, seconds: float) -> tuple[float, float]:
    """The way in metres in the world of a body that began at `yaw`, at a constant body-frame velocity: an arc."""
    half = velocity[2] * seconds / 2
    chord = seconds * math.sin(half) / half if abs(half) > 1e-9 else seconds
    vx, vy = to_world(velocity, yaw, seconds)
    return vx * chord, vy * chord


def to_body(vx: float, vy: float, yaw: float) -> tuple[float, float]:
    """A world-frame velocity (m/s) in the frame of a body at `yaw`."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return vx * cosine + vy * sine, vy * cosine - vx * sine


def wheel_rate(velocity: Planar, wheel: Wheel) -> float:
    """The rate (rad/s) about its axle of a wheel that rolls without slipping.

    The rolling direction is axle x up. A roller takes the motion across its own axis, along which the rim and the
    wheel's centre have the same speed. Source: Siegwart, Introduction to Autonomous Mobile Robots, 3.2.3.
    """
    x, y, turn = velocity
    vx, vy = x - turn * wheel.y, y + turn * wheel.x
    return (vx * wheel.ay - vy * wheel.ax + wheel.skew * (vx * wheel.ax + vy * wheel.ay)) / wheel.radius


def mecanum_rates(velocity: Planar, arm: float, radius: float) -> tuple[float, float, float, float]:
    """The rates (rad/s) of mecanum wheels, front left, front right, back left, back right, rollers at 45 degrees.

    `arm` is half the sum of wheelbase and track, in m. Source: Taheri, Qiao and Ghaeminezhad, "Kinematic model of a
    four mecanum wheeled mobile robot", International Journal of Computer Applications 113, 2015, equation 20.
    """
    x, y, turn = velocity
    around = arm * turn
    return (
        (x - y - around) / radius,
        (x + y + around) / radius,
        (x + y - around) / radius,
        (x - y + around) / radius,
    )
