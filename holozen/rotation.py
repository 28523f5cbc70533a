"""Rotations and rigid transforms in plain floats: no numpy, no clock.

Metres and radians. Quaternions are x, y, z, w, as in geometry_msgs, and have length 1 unless a
docstring says otherwise. Matrices, and rotations of whole arrays, are in holozen/robot/rotation.py.
"""

import math
from typing import Protocol

from msgspec import Struct

XYZ = tuple[float, float, float]
XYZW = tuple[float, float, float, float]

IDENTITY: XYZW = (0.0, 0.0, 0.0, 1.0)
SAME = 1e-9  # rad; rotations closer than this are not interpolated
UPRIGHT = 1e-8  # cosine of a pitch that counts as straight up or down


def normalize(q: XYZW) -> XYZW:
    """A quaternion scaled to length 1. Raises ValueError if its length is zero or not finite."""
    length = math.sqrt(sum(component * component for component in q))
    if not (math.isfinite(length) and length > 0.0):
        raise ValueError(f"the quaternion {q} is not a rotation; the identity is 0, 0, 0, 1")
    return q[0] / length, q[1] / length, q[2] / length, q[3] / length


def conjugate(q: XYZW) -> XYZW:
    """The inverse rotation."""
    return -q[0], -q[1], -q[2], q[3]


def multiply(a: XYZW, b: XYZW) -> XYZW:
    """The product of two quaternions of any length: rotates by b first, then by a."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate(q: XYZW, v: XYZ) -> XYZ:
    """A vector rotated by q."""
    x, y, z, w = q
    tx, ty, tz = (
        2.0 * (y * v[2] - z * v[1]),
        2.0 * (z * v[0] - x * v[2]),
        2.0 * (x * v[1] - y * v[0]),
    )
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


def slerp(a: XYZW, b: XYZW, fraction: float, spin: float = 0.0, shortest: bool = True) -> XYZW:
    """The rotation at `fraction` (0 to 1) of the way from a to b, at constant angular speed.

    `spin` (radians) is added on the way. Unless `shortest`, q and -q count as different rotations.
    """
    dot = sum(i * j for i, j in zip(a, b, strict=True))
    if shortest and dot < 0.0:
        dot, b = -dot, (-b[0], -b[1], -b[2], -b[3])
    angle = math.acos(max(-1.0, min(1.0, dot))) + spin
    if abs(math.sin(angle)) < SAME:
        return a
    start, end = (math.sin(part * angle) / math.sin(angle) for part in (1.0 - fraction, fraction))
    x, y, z, w = (start * i + end * j for i, j in zip(a, b, strict=True))
    return x, y, z, w


def from_axis_angle(axis: XYZ, angle: float) -> XYZW:
    """The rotation by an angle about an axis of length 1."""
    sine = math.sin(angle / 2)
    return axis[0] * sine, axis[1] * sine, axis[2] * sine, math.cos(angle / 2)


def from_rpy(roll: float, pitch: float, yaw: float) -> XYZW:
    """The quaternion of URDF's angles: roll about the fixed x axis, then pitch about y, then yaw
    about z.
    """
    (cr, sr), (cp, sp), (cy, sy) = (
        (math.cos(angle / 2), math.sin(angle / 2)) for angle in (roll, pitch, yaw)
    )
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def to_rpy(q: XYZW) -> XYZ:
    """Roll, pitch and yaw, the inverse of `from_rpy`; roll is 0 where x points straight up or
    down.
    """
    x, y, z, w = q
    level = math.hypot(w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z))
    pitch = math.atan2(2.0 * (w * y - x * z), level)
    if level < UPRIGHT:
        return 0.0, pitch, math.atan2(2.0 * (w * z - x * y), w * w - x * x + y * y - z * z)
    roll = math.atan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z)
    return roll, pitch, yaw(q)


def yaw(q: XYZW) -> float:
    """The heading: the angle about the z axis from -pi to pi."""
    x, y, z, w = q
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


class Vector(Protocol):
    """A Point or Vector3 message, of ours or of rclpy."""

    x: float
    y: float
    z: float


class Quaternion(Vector, Protocol):
    """A Quaternion message, of ours or of rclpy."""

    w: float


class Transform(Struct, frozen=True):
    """A rigid transform, which takes points of a child frame into its parent: rotate, then
    translate.
    """

    translation: XYZ = (0.0, 0.0, 0.0)
    rotation: XYZW = IDENTITY

    @classmethod
    def of(cls, translation: Vector, rotation: Quaternion) -> "Transform":
        """From two messages: a Pose's position and orientation, or a Transform's translation and
        rotation.
        """
        return cls(
            (translation.x, translation.y, translation.z),
            (rotation.x, rotation.y, rotation.z, rotation.w),
        )

    def __matmul__(self, inner: "Transform") -> "Transform":
        """The composition: `inner` is applied first."""
        return Transform(self.apply(inner.translation), multiply(self.rotation, inner.rotation))

    def apply(self, point: XYZ) -> XYZ:
        """A point given in the child frame, in the parent frame."""
        x, y, z = rotate(self.rotation, point)
        return x + self.translation[0], y + self.translation[1], z + self.translation[2]

    def inverse(self) -> "Transform":
        """The transform from the parent frame into the child frame."""
        back = conjugate(self.rotation)
        x, y, z = rotate(back, self.translation)
        return Transform((-x, -y, -z), back)

    def interpolate(self, other: "Transform", fraction: float) -> "Transform":
        """The transform at `fraction` (0 to 1) of the way to another one."""
        x, y, z = (
            i + fraction * (j - i) for i, j in zip(self.translation, other.translation, strict=True)
        )
        return Transform((x, y, z), slerp(self.rotation, other.rotation, fraction))
