"""Roll pitch yaw, matrices and quaternions name the same rotation; principal axes are a rotation
too.
"""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from holozen.robot.rotation import Array, matrix_of, principal, quaternion_of
from holozen.rotation import XYZW

angles = st.tuples(*[st.floats(-7, 7)] * 3)
numbers = st.floats(-3, 3)


def about(axis: int, angle: float) -> Array:
    """The rotation about one coordinate axis: the next axis turns towards the one after."""
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = math.cos(angle)
    matrix[j, i], matrix[i, j] = math.sin(angle), -math.sin(angle)
    return matrix


def turned(quaternion: XYZW, vector: Array) -> Array:
    """A vector turned by a unit quaternion: v + 2 w (q x v) + 2 q x (q x v)."""
    part, w = np.array(quaternion[:3]), quaternion[3]
    result: Array = (
        vector + 2 * w * np.cross(part, vector) + 2 * np.cross(part, np.cross(part, vector))
    )
    return result


@given(angles)
def test_roll_pitch_yaw_turn_about_the_fixed_axes_x_then_y_then_z(
    rpy: tuple[float, float, float],
) -> None:
    roll, pitch, yaw = rpy
    np.testing.assert_allclose(
        matrix_of(rpy), about(2, yaw) @ about(1, pitch) @ about(0, roll), atol=1e-12
    )


@given(angles, st.tuples(numbers, numbers, numbers))
@example((math.pi, 0.0, 0.0), (1.0, 2.0, 3.0))
@example((0.0, math.pi, 0.0), (1.0, 2.0, 3.0))
@example((0.0, 0.0, math.pi), (1.0, 2.0, 3.0))
@example((0.0, math.pi / 2, 1e-9), (1.0, 2.0, 3.0))
def test_a_quaternion_turns_vectors_as_its_matrix_does(
    rpy: tuple[float, float, float], vector: tuple[float, float, float]
) -> None:
    matrix = matrix_of(rpy)
    quaternion = quaternion_of(matrix)
    assert math.hypot(*quaternion) == pytest.approx(1, abs=1e-12)
    assert quaternion[3] >= 0
    np.testing.assert_allclose(turned(quaternion, np.array(vector)), matrix @ vector, atol=1e-11)


def test_a_yaw_of_ninety_degrees_has_the_quaternion_everybody_knows() -> None:
    assert quaternion_of(matrix_of((0, 0, math.pi / 2))) == pytest.approx(
        (0, 0, math.sqrt(0.5), math.sqrt(0.5))
    )


@given(angles, st.tuples(*[st.floats(1e-4, 10)] * 3))
def test_principal_axes_turn_the_moments_back_into_the_tensor(
    rpy: tuple[float, float, float], diagonal: tuple[float, float, float]
) -> None:
    tensor = matrix_of(rpy) @ np.diag(diagonal) @ matrix_of(rpy).T
    moments, axes = principal(tensor)
    np.testing.assert_allclose(axes @ np.diag(moments) @ axes.T, tensor, atol=1e-9)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert (np.diag(axes)[:2] >= 0).all()
    np.testing.assert_allclose(np.sort(moments), np.sort(diagonal), atol=1e-9)


@given(st.tuples(*[st.floats(1e-4, 10)] * 3))
def test_a_diagonal_tensor_keeps_its_axes_and_their_order(
    diagonal: tuple[float, float, float],
) -> None:
    noise = 1e-16 * np.array([[0, 1, 1], [1, 0, 1], [1, 1, 0]])
    moments, axes = principal(np.diag(diagonal) + noise)
    np.testing.assert_array_equal(axes, np.eye(3))
    np.testing.assert_array_equal(moments, diagonal)
