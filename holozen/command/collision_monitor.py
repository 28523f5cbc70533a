"""Slows a robot down towards what its sensors see near it, and stops it before it touches that.

It limits what was chosen among the commands, and says so. No clock, no socket: a time that has
passed is an argument. It is a comfort, and no part of who drives: it sees what the sensors see.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from msgspec import Struct

from holozen.kinematics import to_world, travelled
from holozen.limits import STOP, TIMES, Planar
from holozen.messages import LaserScan, Range
from holozen.robot.model import Pose
from holozen.rotation import XYZ, XYZW, from_rpy, rotate
from holozen.wire import COMMAND_SILENCE

TIME_BEFORE_COLLISION = 1.2  # s; that of Nav2's nav2_params.yaml for the action "approach"
STOP_DISTANCE = 0.1  # m that stay free between the footprint and what is seen
SOURCE_TIMEOUT = COMMAND_SILENCE  # s; the age from which a measurement is not driven by
CREEP, START = 0.02, 0.05  # m/s; slowed down farther, a robot stops; and then stands up to that
ROUNDING = 1e-6  # m; ranges are 32-bit floats
CONE = 9  # points across the cone of a distance sensor

Seen = tuple[float, float, float]
"""A point that a sensor saw: its distance from where the robot turns, and x, y (m, body frame)."""


class Share(NamedTuple):
    """The part of a velocity that is left, 0 to 1, and what takes the rest.

    Attributes:
        left: The part.
        room: The distance (m) from the footprint to the point that limits it.
        bearing: The direction (rad, body frame) of that point.
    """

    left: float = 1.0
    room: float = math.inf
    bearing: float = 0.0


def approach(
    velocity: Planar,
    points: Iterable[Seen],
    radius: float,
    seconds: float,
    moved: Planar = STOP,
) -> Share:
    """The part of a body-frame `velocity` at which no point is reached within `seconds` s.

    `points` are sorted; since they were seen the body has `moved` by x, y (m) and yaw (rad). The
    footprint is a circle of `radius` m, so that turns bring nothing nearer. What is between it and
    a point, less STOP_DISTANCE, may shrink by one part in `seconds` a second: a velocity damper
    (Faverjon and Tournassoud, "A local based approach for path planning of manipulators with a high
    number of degrees of freedom", 1987). Head on that is Nav2's action "approach". Nothing is
    limited along a point or away from it.
    """
    vx, vy = to_world((velocity[0], velocity[1], 0.0), moved[2], 0.0)
    speed, shifted = math.hypot(vx, vy), math.hypot(moved[0], moved[1])
    kept = radius + STOP_DISTANCE
    share = Share()
    for far, x, y in points:
        if far - shifted - kept >= share.left * speed * seconds:
            break  # the others are farther away, and limit it less
        x, y = x - moved[0], y - moved[1]
        distance = math.hypot(x, y)
        closing = (vx * x + vy * y) / distance if distance else speed
        room = max(0.0, distance - kept)
        if room < share.left * closing * seconds:
            bearing = math.atan2(y, x) - moved[2]
            share = Share(room / (closing * seconds), distance - radius, bearing)
    return share


class Sight(Struct):
    """The last measurement of a sensor.

    Attributes:
        points: What it saw, the nearest first.
        fault: Why the robot cannot drive by it; or "".
        age: s since it was made.
        moved: By how much (m, m, rad) the body has moved since then.
    """

    points: list[Seen]
    fault: str = ""
    age: float = 0.0
    moved: Planar = STOP

    def follow(self, velocity: Planar, dt: float) -> None:
        """The body has moved at a velocity for `dt` s more."""
        x, y, yaw = self.moved
        dx, dy = travelled(velocity, yaw, dt)
        self.moved = x + dx, y + dy, yaw + velocity[2] * dt
        self.age += dt


class CollisionMonitor:
    """Limits the velocities of one robot.

    Attributes:
        seconds: The time before a collision at which it slows down, in s; 0: it is off.
        reason: How it limits the present velocity, and why; empty if it does not.
    """

    def __init__(
        self, radius: float, sensors: Mapping[str, Pose], seconds: float = TIME_BEFORE_COLLISION
    ) -> None:
        """`radius` (m) is that of a circle around all of the robot, whose centre is where it turns.
        `sensors` are the keys of its scans and ranges, each with the sensor's pose from there.
        Raises ValueError for a radius or time that makes no sense, and without sensors.
        """
        if not 0 < radius < math.inf:
            raise ValueError(f"radius is {radius:g} m; use one above 0, such as 0.2")
        if not TIMES[0] <= seconds <= TIMES[1]:
            raise ValueError(f"seconds is {seconds:g} s; use 0 (off) to {TIMES[1]:g}")
        if not sensors:
            raise ValueError("there is no sensor; name the key of a scan or range, with its pose")
        self.radius, self.seconds, self.reason = radius, seconds, ""
        self._mounts = {key: (pose.xyz, from_rpy(*pose.rpy)) for key, pose in sensors.items()}
        self._sights: dict[str, Sight] = {}
        self._velocity = STOP

    @property
    def sensors(self) -> list[str]:
        """The keys of its sensors."""
        return list(self._mounts)

    def set_time(self, seconds: float) -> None:
        """Slow down at that time before a collision; 0 switches it off."""
        self.seconds = seconds
        self.forget()

    def forget(self) -> None:
        """Forget all that was seen: the robot stands until its sensors have measured again."""
        self._sights.clear()
        self._velocity, self.reason = STOP, ""

    def see(self, key: str, message: LaserScan | Range, age: float = 0.0) -> None:
        """Take the measurement of the sensor on `key`, which was made `age` s ago."""
        if isinstance(message, LaserScan):
            rays, low, high = _rays(message), message.range_min, message.range_max
        else:
            rays, low, high = _cone(message), message.min_range, message.max_range
        name = key.rpartition("/")[2]
        sight = self._sights[key] = _sight(
            name, list(rays), low, high or math.inf, *self._mounts[key]
        )
        sight.follow(self._velocity, max(0.0, age))

    def limit(self, velocity: Planar, dt: float) -> Planar:
        """What of a body-frame velocity the robot may drive, `dt` s after the last call."""
        for sight in self._sights.values():
            sight.follow(self._velocity, dt)
        limited, self.reason = velocity, ""
        if self.seconds and velocity != STOP:
            limited, self.reason = self._limited(velocity)
        self._velocity = limited
        return limited

    def _limited(self, velocity: Planar) -> tuple[Planar, str]:
        if fault := next(filter(None, map(self._fault, self._mounts)), ""):
            return STOP, f"stopped: {fault}"
        share = min(
            approach(velocity, sight.points, self.radius, self.seconds, sight.moved)
            for sight in self._sights.values()
        )
        x, y, turn = velocity
        if share.left == 1.0:
            return velocity, ""
        what = f"{max(0.0, share.room):.1f} m {_side(share.bearing)}"
        if share.left * math.hypot(x, y) < (CREEP if any(self._velocity[:2]) else START):
            return (0.0, 0.0, turn), f"stopped: {what}"
        return (share.left * x, share.left * y, turn), f"slowed: {what}"

    def _fault(self, key: str) -> str:
        """Why the robot cannot drive by a sensor; or ""."""
        name, sight = key.rpartition("/")[2], self._sights.get(key)
        if sight is None:
            return f"no {name} has come yet"
        if sight.age > SOURCE_TIMEOUT:
            return f"the {name} is {sight.age:.1f} s old"
        return sight.fault


def _side(bearing: float) -> str:
    """Where that is, in words."""
    quarter = round(math.remainder(bearing, math.tau) / (math.pi / 2)) % 4
    return ("ahead", "to the left", "behind", "to the right")[quarter]


Ray = tuple[float, float]
"""An angle (rad) to the left of the sensor's x axis, and the range (m) there."""


def _rays(scan: LaserScan) -> Iterator[Ray]:
    first, step = scan.angle_min, scan.angle_increment
    return ((first + step * index, far) for index, far in enumerate(scan.ranges))


def _cone(message: Range) -> Iterator[Ray]:
    """The range is that of anything within the cone: all across it may be there."""
    width = message.field_of_view
    return ((width * (index / (CONE - 1) - 0.5), message.range) for index in range(CONE))


def _sight(name: str, rays: list[Ray], low: float, high: float, xyz: XYZ, rotation: XYZW) -> Sight:
    """What rays between `low` and `high` m hit, by REP 117: a range that is infinite, or beyond
    `high`, is free; minus infinity is nearer than `low`. Anything else is no measurement.
    """
    ahead, left = rotate(rotation, (1.0, 0.0, 0.0)), rotate(rotation, (0.0, 1.0, 0.0))
    points, valid, least = [], 0, max(low - ROUNDING, ROUNDING)
    for angle, far in rays:
        if far == -math.inf:
            far = least
        if not far >= least:  # also NaN
            continue
        valid += 1
        if far > high:
            continue
        along, aside = far * math.cos(angle), far * math.sin(angle)
        x = xyz[0] + along * ahead[0] + aside * left[0]
        y = xyz[1] + along * ahead[1] + aside * left[1]
        points.append((math.hypot(x, y), x, y))
    fault = "" if valid else f"the {name} is blind: none of its ranges is valid"
    return Sight(sorted(points), fault)
