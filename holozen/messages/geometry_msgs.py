"""Vectors, rotations, velocities, poses and transforms."""

from typing import Annotated

from msgspec import Meta, field

from holozen import rotation
from holozen.messages.message import Message
from holozen.messages.std_msgs import Header

Covariance = Annotated[list[float], Meta(min_length=36, max_length=36)]
"""A 6 x 6 matrix, row by row, over x, y, z and the rotations about x, y, z."""


class Vector3(Message):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Point(Message):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Quaternion(Message):
    """A rotation. As in ROS 2, the default is the identity."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0

    def yaw(self) -> float:
        """The rotation about z, in radians from -pi to pi."""
        return rotation.yaw((self.x, self.y, self.z, self.w))


class Twist(Message):
    """A velocity: linear in m/s, angular in rad/s."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)

    @classmethod
    def planar(cls, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> "Twist":
        """Forward and left in m/s, counter-clockwise in rad/s."""
        return cls(Vector3(x, y, 0.0), Vector3(0.0, 0.0, turn))

    def is_slow(self, limit: float = 0.0) -> bool:
        """Whether no component exceeds `limit` in m/s or rad/s; by default, whether this is a stop.
        A NaN is not.
        """
        sizes = (abs(size) for v in (self.linear, self.angular) for size in (v.x, v.y, v.z))
        return all(size <= limit for size in sizes)


class TwistStamped(Message):
    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


class TwistWithCovariance(Message):
    twist: Twist = field(default_factory=Twist)
    covariance: Covariance = field(default_factory=lambda: [0.0] * 36)


class Wrench(Message):
    """A force in N and a torque in N m."""

    force: Vector3 = field(default_factory=Vector3)
    torque: Vector3 = field(default_factory=Vector3)


class Accel(Message):
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


class Pose(Message):
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)

    @classmethod
    def of(
        cls, position: tuple[float, float, float], orientation: tuple[float, float, float, float]
    ) -> "Pose":
        """x, y, z in m, and a quaternion x, y, z, w. The way back is
        `holozen.rotation.Transform.of`.
        """
        return cls(Point(*position), Quaternion(*orientation))

    def planar(self) -> tuple[float, float, float]:
        """x and y in m, and the rotation about z in radians."""
        return self.position.x, self.position.y, self.orientation.yaw()


class PoseStamped(Message):
    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


class PoseWithCovariance(Message):
    pose: Pose = field(default_factory=Pose)
    covariance: Covariance = field(default_factory=lambda: [0.0] * 36)


class Transform(Message):
    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


class TransformStamped(Message):
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)
