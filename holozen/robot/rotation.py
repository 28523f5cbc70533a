"""Rotation matrices and inertia tensors as numpy arrays, in radians; quaternions are those of
`holozen.rotation`.
"""

from collections.abc import Sequence
from itertools import permutations
from typing import Any

import numpy as np
import numpy.typing as npt

from holozen.rotation import XYZ, XYZW, to_rpy

Array = npt.NDArray[np.float64]


def matrix_of(rpy: Sequence[float]) -> Array:
    """URDF's rotation: roll about the fixed x, then pitch about y, then yaw about z, so Rz Ry
    Rx.
    """
    cr, cp, cy = np.cos(rpy)
    sr, sp, sy = np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of(matrix: Array) -> XYZ:
    """Roll, pitch and yaw of a rotation matrix, the inverse of `matrix_of`, as by `to_rpy`."""
    return to_rpy(quaternion_of(matrix))


def quaternion_of(matrix: Array) -> XYZW:
    """The unit quaternion of a rotation matrix, with w >= 0."""
    # Each row is 4 times one component times all four. The row with the largest square loses no
    # digits (S. W. Shepperd, "Quaternion from rotation matrix", Journal of Guidance and Control 1,
    # 1978).
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    rows = np.array(
        [
            [1 + a - e - i, b + d, c + g, h - f],
            [b + d, 1 - a + e - i, f + h, c - g],
            [c + g, f + h, 1 - a - e + i, d - b],
            [h - f, c - g, d - b, 1 + a + e + i],
        ]
    )
    row = rows[np.argmax(np.diag(rows))]
    row = row / (np.linalg.norm(row) * (-1 if row[3] < 0 else 1))
    x, y, z, w = row.tolist()
    return x, y, z, w


def principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments (3,) of a symmetric 3x3 tensor, and the rotation whose columns are their
    axes.

    Of the 24 right-handed ways to name the axes, the one nearest to x, y, z: for a tensor that is
    diagonal already, the rotation is the identity.
    """
    noise = 1e-12 * np.trace(inertia)
    moments, axes = np.linalg.eigh(np.where(np.abs(inertia) > noise, inertia, 0.0))
    order = list(
        max(permutations(range(3)), key=lambda order: np.abs(np.diag(axes[:, list(order)])).sum())
    )
    moments, axes = moments[order], axes[:, order]
    axes = axes * np.where(np.diag(axes) < 0, -1.0, 1.0)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])  # right-handed, whatever the signs
    return moments, axes


def symmetric(values: Sequence[float]) -> Array:
    """The tensor (3, 3) of xx, xy, xz, yy, yz, zz."""
    xx, xy, xz, yy, yz, zz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def triple(values: Any) -> XYZ:
    """Three values as plain floats, as engines require them."""
    x, y, z = (float(value) for value in values)
    return x, y, z
