"""Kinematics of a planar base, as pure functions. Metres, radians, seconds; x forward, y left, z
up.
"""

import math
from collections.abc import Sequence

from msgspec import Struct

from holozen.limits import Planar
from holozen.rotation import XYZ


class Wheel(Struct, frozen=True):
    """A wheel that rolls on the ground: centre (x, y) and axle direction (ax, ay) in the body
    frame, radius in m.

    `skew` is the tangent of the angle from the rolling direction to the axis of the roller on the
    ground: 0 on an omni wheel, 1 or -1 on a mecanum wheel.
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

    The heading at mid-step is used, so that a turning body follows its arc and not a polygon
    outside it.
    """
    x, y, turn = velocity
    heading = yaw + turn * dt / 2
    cosine, sine = math.cos(heading), math.sin(heading)
    return x * cosine - y * sine, x * sine + y * cosine


def travelled(velocity: Planar, yaw: float, seconds: float) -> tuple[float, float]:
    """The displacement (m, world frame) of a body that starts at `yaw` and keeps its body-frame
    velocity: an arc.
    """
    half = velocity[2] * seconds / 2
    chord = seconds * math.sin(half) / half if abs(half) > 1e-9 else seconds
    vx, vy = to_world(velocity, yaw, seconds)
    return vx * chord, vy * chord


def to_body(vx: float, vy: float, yaw: float) -> tuple[float, float]:
    """A world-frame velocity (m/s) in the frame of a body at `yaw`."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return vx * cosine + vy * sine, vy * cosine - vx * sine


def velocity_at(away: XYZ, linear: XYZ, angular: XYZ) -> XYZ:
    """The velocity of a point at an offset (m) from one that moves and turns: v + w x r."""
    (x, y, z), (vx, vy, vz), (wx, wy, wz) = away, linear, angular
    return vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x


def wheel_rate(velocity: Planar, wheel: Wheel) -> float:
    """The rate (rad/s) about its axle of a wheel that rolls without slipping.

    The rolling direction is axle x up. A roller takes the motion across its own axis, along which
    the rim and the wheel's centre have the same speed. Source: Siegwart, Introduction to Autonomous
    Mobile Robots, 3.2.3.
    """
    x, y, turn = velocity
    vx, vy = x - turn * wheel.y, y + turn * wheel.x
    return (
        vx * wheel.ay - vy * wheel.ax + wheel.skew * (vx * wheel.ax + vy * wheel.ay)
    ) / wheel.radius


def planar_velocity(rates: Sequence[float], wheels: Sequence[Wheel]) -> Planar:
    """The body-frame velocity at which wheels turn at `rates` (rad/s): the inverse of `wheel_rate`
    for three omni wheels, the least squares for more. Raises ValueError for wheels that do not
    determine it, such as parallel ones.
    """
    rows = [
        [wheel_rate(unit, wheel) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
        for wheel in wheels
    ]
    squares = [[sum(row[i] * row[j] for row in rows) for j in range(3)] for i in range(3)]
    sums = [sum(row[i] * rate for row, rate in zip(rows, rates, strict=True)) for i in range(3)]
    determinant = _determinant(squares)
    if abs(determinant) < 1e-9:
        raise ValueError(
            "these wheels do not determine the velocity; three omni wheels with axles in three "
            "directions do"
        )
    # Cramer's rule.
    x, y, turn = (
        _determinant(
            [[sums[i] if j == column else squares[i][j] for j in range(3)] for i in range(3)]
        )
        / determinant
        for column in range(3)
    )
    return x, y, turn


def _determinant(m: list[list[float]]) -> float:
    (a, b, c), (d, e, f), (g, h, i) = m
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def mecanum_rates(velocity: Planar, arm: float, radius: float) -> tuple[float, float, float, float]:
    """The rates (rad/s) of mecanum wheels, front left, front right, back left, back right, rollers
    at 45 degrees.

    `arm` is half the sum of wheelbase and track, in m. Source: Taheri, Qiao and Ghaeminezhad,
    "Kinematic model of a four mecanum wheeled mobile robot", International Journal of Computer
    Applications 113, 2015, equation 20.
    """
    x, y, turn = velocity
    around = arm * turn
    return (
        (x - y - around) / radius,
        (x + y + around) / radius,
        (x + y - around) / radius,
        (x - y + around) / radius,
    )
