"""What a robot tells, as messages. Pure functions of poses (m, x y z w) and body-frame velocities (m/s, rad/s)."""

import math
from collections.abc import Mapping

from holozen.limits import Planar
from holozen.messages import (
    Header,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Time,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from holozen.robot.model import Drive, RobotModel
from holozen.robot.rigid import Frame

UNKNOWN = 1e12  # m^2, rad^2; Gazebo's variance for what planar_move does not steer
Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]


class Schedule:
    """Says when something with a rate in Hz is due, on a clock in seconds that only goes forward."""

    def __init__(self, rate: float) -> None:
        self.keep(rate)

    def keep(self, rate: float) -> None:
        """Take another rate; the first is due at once."""
        self.rate, self._count = rate, -1

    def due(self, time: float) -> bool:
        """Whether a period has begun since the last time this was true."""
        count = int(time * self.rate + 1e-6)
        began = count > self._count
        self._count = count
        return began


def covariance(drive: Drive) -> list[float]:
    """The 6 x 6 diagonal that Gazebo's planar_move tells."""
    x, y, yaw = drive.covariance
    diagonal = (x, y, UNKNOWN, UNKNOWN, UNKNOWN, yaw)
    return [diagonal[row] if row == column else 0.0 for row in range(6) for column in range(6)]


def odometry(
    header: Header, child: str, position: Vector, rotation: Rotation, velocity: Planar, variances: list[float]
) -> Odometry:
    """The world pose, and the velocity as the body sees it."""
    pose = Pose(Point(*position), Quaternion(*rotation))
    return Odometry(
        header, child, PoseWithCovariance(pose, variances), TwistWithCovariance(Twist.planar(*velocity), variances)
    )


def transform(header: Header, child: str, position: Vector, rotation: Rotation) -> TransformStamped:
    """Where the frame `child` is in the frame of `header`."""
    return TransformStamped(header, child, Transform(Vector3(*position), Quaternion(*rotation)))


class JointFrames:
    """Every link in its parent's frame. `prefix` goes before each frame's name."""

    def __init__(self, model: RobotModel, prefix: str) -> None:
        self._joints = [
            (joint.name, f"{prefix}{joint.parent}", f"{prefix}{joint.child}", joint.axis, Frame.of(joint.pose))
            for joint in model.joints.values()
        ]
        self._at = [(frame.xyz, frame.quaternion) for *_, frame in self._joints]

    def transforms(self, stamp: Time, angles: Mapping[str, float]) -> list[TransformStamped]:
        """The transforms with joints turned to `angles` (rad); a joint not named is at zero."""
        return [
            transform(Header(stamp, parent), child, xyz, _times(rotation, _about(axis, angles.get(name, 0.0))))
            for (name, parent, child, axis, _), (xyz, rotation) in zip(self._joints, self._at, strict=True)
        ]


def _about(axis: Vector, angle: float) -> Rotation:
    """The rotation by `angle` about the unit vector `axis`."""
    sine = math.sin(angle / 2)
    return axis[0] * sine, axis[1] * sine, axis[2] * sine, math.cos(angle / 2)


def _times(a: Rotation, b: Rotation) -> Rotation:
    """Hamilton's product: first b, then a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
