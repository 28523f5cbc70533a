"""Goes to a goal: errors, velocities and legs, as pure functions. Metres, radians, seconds, the
frame of odom.
"""

import math

from msgspec import Struct

from holozen.kinematics import to_body
from holozen.limits import Planar, clamp_speed, ramp

CREEP, TURN_CREEP = 0.05, 0.1  # m/s, rad/s; slow enough to arrive without braking

PlanarPose = tuple[float, float, float]
"""x, y in metres and theta in radians."""


class Gains(Struct, frozen=True):
    """The gains and limits of the controller. `linear` and `angular` in 1/s, speeds in m/s and
    rad/s, accelerations in m/s^2 and rad/s^2.
    """

    linear: float = 1.5
    angular: float = 2.0
    max_speed: float = 0.5
    max_turn: float = 1.0
    max_acceleration: float = 1.0
    max_turn_acceleration: float = 3.0
    tolerance: float = 0.01  # m
    angle_tolerance: float = 0.02  # rad


def error(pose: PlanarPose, goal: PlanarPose) -> Planar:
    """The goal in the body frame: forward, left, and the heading error within [-pi, pi]."""
    x, y = to_body(goal[0] - pose[0], goal[1] - pose[1], pose[2])
    return x, y, math.remainder(goal[2] - pose[2], math.tau)


def arrived(left: Planar, now: Planar, gains: Gains) -> bool:
    """Whether the error is within the tolerances and the last commanded velocity is nearly zero."""
    close = (
        math.hypot(left[0], left[1]) <= gains.tolerance and abs(left[2]) <= gains.angle_tolerance
    )
    return close and math.hypot(now[0], now[1]) <= CREEP and abs(now[2]) <= TURN_CREEP


def velocity(left: Planar, now: Planar, gains: Gains, dt: float) -> Planar:
    """The velocity to command `dt` seconds after `now` was commanded.

    It is proportional to the error, within the limits, and never too fast to stop within the
    remaining distance at half the maximum acceleration: v^2 = 2 a s.
    """
    x, y, turn = left
    wanted = (gains.linear * x, gains.linear * y, gains.angular * turn)
    speed = min(gains.max_speed, math.sqrt(gains.max_acceleration * math.hypot(x, y)))
    spin = min(gains.max_turn, math.sqrt(gains.max_turn_acceleration * abs(turn)))
    return ramp(
        now,
        clamp_speed(wanted, speed, spin),
        gains.max_acceleration,
        gains.max_turn_acceleration,
        dt,
    )


class Leg(Struct):
    """The way to one goal: its start, its times (s, on odom's clock), and the largest distance (m)
    from a straight line.
    """

    start: PlanarPose
    goal: PlanarPose
    began: float
    ended: float = 0.0
    path_error: float = 0.0

    def update(self, pose: PlanarPose, time: float) -> None:
        """Take the robot's pose at `time` (s)."""
        self.ended = time
        self.path_error = max(self.path_error, distance_to_line(pose, self.start, self.goal))


def distance_to_line(point: PlanarPose, start: PlanarPose, end: PlanarPose) -> float:
    """The distance in metres of a point from the segment between two others."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length2 = dx * dx + dy * dy
    along = ((point[0] - start[0]) * dx + (point[1] - start[1]) * dy) / length2 if length2 else 0.0
    along = max(0.0, min(1.0, along))
    return math.hypot(point[0] - start[0] - along * dx, point[1] - start[1] - along * dy)
