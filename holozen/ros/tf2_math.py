"""Rigid transforms in floats: no clock, no message, no library. Metres; quaternions are x, y, z, w."""

import math
from dataclasses import dataclass

XYZ = tuple[float, float, float]
XYZW = tuple[float, float, float, float]

STRAIGHT = 1e-9  # rad; two rotations as near as that are one


@dataclass(frozen=True, slots=True)
class Rigid:
    """Turns by `rotation` (a unit quaternion), then moves by `translation`: a child frame's point into its parent."""

    translation: XYZ = (0.0, 0.0, 0.0)
    rotation: XYZW = (0.0, 0.0, 0.0, 1.0)

    def then(self, outer: "Rigid") -> "Rigid":
        """This one, and after it `outer`."""
        return Rigid(outer.point(self.translation), multiply(outer.rotation, self.rotation))

    def inverse(self) -> "Rigid":
        """The way back."""
        back = conjugate(self.rotation)
        x, y, z = rotate(back, self.translation)
        return Rigid((-x, -y, -z), back)

    def point(self, point: XYZ) -> XYZ:
        """Where a point of the child frame is in the parent."""
        turned = rotate(self.rotation, point)
        return _sum(turned, self.translation)


def multiply(a: XYZW, b: XYZW) -> XYZW:
    """The product of two quaternions: b first, then a."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q: XYZW) -> XYZW:
    """The inverse of a unit quaternion."""
    return -q[0], -q[1], -q[2], q[3]


def unit(q: XYZW) -> XYZW:
    """A quaternion of length 1. ValueError if it has none."""
    length = math.sqrt(sum(each * each for each in q))
    if not (math.isfinite(length) and length > 0.0):
        raise ValueError(f"the rotation {q} has no direction; no rotation is 0, 0, 0, 1")
    return q[0] / length, q[1] / length, q[2] / length, q[3] / length


def rotate(q: XYZW, v: XYZ) -> XYZ:
    """A vector, turned by a unit quaternion."""
    x, y, z, w = q
    tx, ty, tz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


def slerp(a: XYZW, b: XYZW, fraction: float, spin: float = 0.0, shortest: bool = True) -> XYZW:
    """The unit quaternion at `fraction` (0 to 1) of the way from a to b, at even speed.

    `spin` in radians is turned on the way besides; unless `shortest`, q and -q are different ends.
    """
    dot = sum(each * other for each, other in zip(a, b, strict=True))
    if shortest and dot < 0.0:
        dot, b = -dot, (-b[0], -b[1], -b[2], -b[3])
    angle = math.acos(max(-1.0, min(1.0, dot))) + spin
    if abs(math.sin(angle)) < STRAIGHT:
        return a
    near, far = (math.sin(part * angle) / math.sin(angle) for part in (1.0 - fraction, fraction))
    x, y, z, w = (near * each + far * other for each, other in zip(a, b, strict=True))
    return x, y, z, w


def between(a: Rigid, b: Rigid, fraction: float) -> Rigid:
    """The transform at `fraction` (0 to 1) of the way from a to b."""
    moved = [each + fraction * (other - each) for each, other in zip(a.translation, b.translation, strict=True)]
    return Rigid((moved[0], moved[1], moved[2]), slerp(a.rotation, b.rotation, fraction))


def _sum(a: XYZ, b: XYZ) -> XYZ:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
