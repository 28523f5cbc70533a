"""tf_transformations: rotations and matrices in ROS's conventions, by the library transforms3d.

Quaternions are x, y, z, w (transforms3d has w first), matrices 4x4 and homogeneous, angles in
radians. `axes` names one of 24 orders of Euler angles: "s" for static, "r" for rotating axes, then
their letters; "sxyz" is roll, pitch, yaw.
"""

import math
from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt
from transforms3d import affines, axangles, euler, quaternions

from holozen.rotation import XYZW, slerp

__all__ = [
    "compose_matrix",
    "concatenate_matrices",
    "euler_from_matrix",
    "euler_from_quaternion",
    "euler_matrix",
    "identity_matrix",
    "inverse_matrix",
    "is_same_transform",
    "quaternion_about_axis",
    "quaternion_conjugate",
    "quaternion_from_euler",
    "quaternion_from_matrix",
    "quaternion_inverse",
    "quaternion_matrix",
    "quaternion_multiply",
    "quaternion_slerp",
    "random_quaternion",
    "random_rotation_matrix",
    "random_vector",
    "rotation_from_matrix",
    "rotation_matrix",
    "scale_matrix",
    "translation_from_matrix",
    "translation_matrix",
    "unit_vector",
    "vector_norm",
]

Array = npt.NDArray[np.float64]
Numbers = Sequence[float] | Array
ORIGIN = (0.0, 0.0, 0.0)


def euler_from_quaternion(quaternion: Numbers, axes: str = "sxyz") -> tuple[float, float, float]:
    """The Euler angles of a quaternion of any length."""
    a, b, c = euler.quat2euler(_w_first(quaternion), axes)
    return float(a), float(b), float(c)


def quaternion_from_euler(ai: float, aj: float, ak: float, axes: str = "sxyz") -> XYZW:
    """The unit quaternion of Euler angles: roll, pitch and yaw unless `axes` is given."""
    return _w_last(euler.euler2quat(ai, aj, ak, axes))


def euler_from_matrix(matrix: Any, axes: str = "sxyz") -> tuple[float, float, float]:
    """The Euler angles of a 3x3 or 4x4 matrix."""
    a, b, c = euler.mat2euler(np.asarray(matrix, dtype=float)[:3, :3], axes)
    return float(a), float(b), float(c)


def euler_matrix(ai: float, aj: float, ak: float, axes: str = "sxyz") -> Array:
    """The 4x4 matrix of Euler angles."""
    return _homogeneous(euler.euler2mat(ai, aj, ak, axes))


def quaternion_matrix(quaternion: Numbers) -> Array:
    """The 4x4 matrix of a quaternion of any length; the identity for zeros."""
    return _homogeneous(quaternions.quat2mat(_w_first(quaternion)))


def quaternion_from_matrix(matrix: Any, isprecise: bool = False) -> XYZW:
    """The unit quaternion of a 3x3 or 4x4 rotation matrix. `isprecise` has no effect."""
    return _w_last(quaternions.mat2quat(np.asarray(matrix, dtype=float)[:3, :3]))


def quaternion_multiply(quaternion1: Numbers, quaternion0: Numbers) -> XYZW:
    """The product: rotates by `quaternion0` first, then by `quaternion1`."""
    return _w_last(quaternions.qmult(_w_first(quaternion1), _w_first(quaternion0)))


def quaternion_conjugate(quaternion: Numbers) -> Array:
    """The conjugate, which for a unit quaternion is the inverse rotation."""
    x, y, z, w = quaternion
    return np.array((-x, -y, -z, w), dtype=float)


def quaternion_inverse(quaternion: Numbers) -> Array:
    """The quaternion whose product with this one is 0, 0, 0, 1."""
    return quaternion_conjugate(quaternion) / float(np.dot(quaternion, quaternion))


def quaternion_about_axis(angle: float, axis: Numbers) -> Array:
    """The unit quaternion of a rotation by an angle about an axis of any length."""
    return np.array(_w_last(quaternions.axangle2quat(np.asarray(axis, dtype=float), angle)))


def quaternion_slerp(
    quat0: Numbers, quat1: Numbers, fraction: float, spin: int = 0, shortestpath: bool = True
) -> Array:
    """The rotation at `fraction` of the way from one to the other, at constant angular speed.

    `spin` adds half turns on the way; with `shortestpath` false the longer way is taken if the
    quaternions are apart.
    """
    a, b = (tuple(float(each) for each in unit_vector(q)) for q in (quat0, quat1))
    return np.array(
        slerp(
            (a[0], a[1], a[2], a[3]),
            (b[0], b[1], b[2], b[3]),
            fraction,
            spin * math.pi,
            shortestpath,
        )
    )


def random_quaternion(rand: Numbers | None = None) -> Array:
    """A uniformly distributed rotation. `rand` are three numbers from 0 to 1 to use instead of
    random ones.
    """
    u, v, w = np.random.default_rng().random(3) if rand is None else rand
    far, near = math.sqrt(1.0 - u), math.sqrt(u)
    a, b = 2 * math.pi * v, 2 * math.pi * w
    return np.array((math.sin(a) * far, math.cos(a) * far, math.sin(b) * near, math.cos(b) * near))


def random_rotation_matrix(rand: Numbers | None = None) -> Array:
    """The 4x4 matrix of `random_quaternion`."""
    return quaternion_matrix(random_quaternion(rand))


def random_vector(size: int) -> Array:
    """`size` random numbers from 0 to 1."""
    return np.random.default_rng().random(size)


def identity_matrix() -> Array:
    """The 4x4 identity matrix."""
    return np.identity(4)


def translation_matrix(direction: Numbers) -> Array:
    """The 4x4 matrix that translates by a vector."""
    return affines.compose(np.asarray(direction, dtype=float)[:3], np.identity(3), np.ones(3))  # type: ignore[no-any-return]


def translation_from_matrix(matrix: Any) -> Array:
    """The translation of a 4x4 matrix."""
    return np.array(np.asarray(matrix, dtype=float)[:3, 3])


def rotation_matrix(angle: float, direction: Numbers, point: Numbers | None = None) -> Array:
    """The 4x4 matrix that rotates by an angle about an axis through the origin, or through
    `point`.
    """
    return _homogeneous(
        axangles.axangle2mat(np.asarray(direction, dtype=float)[:3], angle),
        ORIGIN if point is None else point,
    )


def rotation_from_matrix(matrix: Any) -> tuple[float, Array, Array]:
    """Angle, direction and a point (x, y, z, 1) of the rotation axis of a 4x4 matrix. Raises
    ValueError.
    """
    direction, angle, point = axangles.aff2axangle(np.asarray(matrix, dtype=float))
    return float(angle), np.asarray(direction), np.asarray(point)


def scale_matrix(
    factor: float, origin: Numbers | None = None, direction: Numbers | None = None
) -> Array:
    """The 4x4 matrix that scales about `origin`, and only along `direction` if that is given."""
    part = np.identity(3)
    if direction is not None:
        axis = unit_vector(np.asarray(direction, dtype=float)[:3])
        part = np.outer(axis, axis)
    return _homogeneous(
        np.identity(3) + (factor - 1.0) * part, ORIGIN if origin is None else origin
    )


def compose_matrix(
    scale: Numbers | None = None,
    shear: Numbers | None = None,
    angles: Numbers | None = None,
    translate: Numbers | None = None,
) -> Array:
    """The 4x4 matrix that scales, shears, rotates by roll, pitch and yaw, and then translates; each
    if given.
    """
    return affines.compose(  # type: ignore[no-any-return]
        np.zeros(3) if translate is None else np.asarray(translate, dtype=float),
        np.identity(3) if angles is None else euler.euler2mat(*angles),
        np.ones(3) if scale is None else np.asarray(scale, dtype=float),
        None if shear is None else np.asarray(shear, dtype=float),
    )


def concatenate_matrices(*matrices: Any) -> Array:
    """The product: the last matrix acts first."""
    return reduce(
        np.matmul, (np.asarray(matrix, dtype=float) for matrix in matrices), identity_matrix()
    )


def inverse_matrix(matrix: Any) -> Array:
    """The inverse of a square matrix. Raises numpy.linalg.LinAlgError if there is none."""
    return np.linalg.inv(np.asarray(matrix, dtype=float))


def is_same_transform(matrix0: Any, matrix1: Any) -> bool:
    """Whether two 4x4 matrices are the same transform, whatever their last number."""
    first, second = (np.asarray(matrix, dtype=float) for matrix in (matrix0, matrix1))
    return bool(np.allclose(first / first[3, 3], second / second[3, 3]))


def vector_norm(data: Any, axis: int | None = None, out: Array | None = None) -> Any:
    """The length of a vector, or of the vectors along an axis of an array."""
    length = np.linalg.norm(np.asarray(data, dtype=float), axis=axis)
    if out is None:
        return float(length) if np.ndim(length) == 0 else length
    out[...] = length
    return None


def unit_vector(data: Any, axis: int | None = None, out: Array | None = None) -> Any:
    """The vector of length 1 with that direction, or the vectors along an axis of an array."""
    given = np.asarray(data, dtype=float)
    unit = given / np.linalg.norm(given, axis=axis, keepdims=axis is not None)
    if out is None:
        return unit
    out[...] = unit
    return None


def _w_first(quaternion: Numbers) -> Array:
    """Raises TypeError for a message."""
    if hasattr(quaternion, "ROS"):
        raise TypeError(
            "a quaternion is a sequence here, not a message; write [q.x, q.y, q.z, q.w]"
        )
    x, y, z, w = quaternion
    return np.array((w, x, y, z), dtype=float)


def _w_last(quaternion: Array) -> XYZW:
    w, x, y, z = (float(each) for each in quaternion)
    return x, y, z, w


def _homogeneous(linear: Array, fixed: Numbers = ORIGIN) -> Array:
    """The 4x4 matrix of a 3x3 one that leaves the point `fixed` in place."""
    matrix, point = np.identity(4), np.asarray(fixed, dtype=float)[:3]
    matrix[:3, :3], matrix[:3, 3] = linear, point - linear @ point
    return matrix
