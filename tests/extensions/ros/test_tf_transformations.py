"""tf_transformations: known values, and the mathematics of numpy."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.ros import tf_transformations as tft
from holozen.ros.generated import find

ANGLES = st.floats(-3.1, 3.1)
HALF = math.sqrt(0.5)
Z = (0.0, 0.0, 1.0)


def turned(axis: Any, angle: float) -> Any:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.identity(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


@given(ANGLES, st.floats(-1.5, 1.5), ANGLES)
def test_euler_angles_come_back_from_quaternion_and_matrix(roll, pitch, yaw):
    want = pytest.approx((roll, pitch, yaw), abs=1e-6)
    assert tft.euler_from_quaternion(tft.quaternion_from_euler(roll, pitch, yaw)) == want
    assert tft.euler_from_matrix(tft.euler_matrix(roll, pitch, yaw)) == want


@given(ANGLES, ANGLES, ANGLES)
def test_roll_pitch_and_yaw_turn_about_fixed_axes(roll, pitch, yaw):
    rotation = turned(Z, yaw) @ turned((0, 1, 0), pitch) @ turned((1, 0, 0), roll)
    assert np.allclose(tft.euler_matrix(roll, pitch, yaw)[:3, :3], rotation)
    assert np.allclose(
        tft.quaternion_matrix(tft.quaternion_from_euler(roll, pitch, yaw))[:3, :3], rotation
    )
    turning = turned((1, 0, 0), roll) @ turned((0, 1, 0), pitch) @ turned(Z, yaw)
    assert np.allclose(tft.euler_matrix(roll, pitch, yaw, "rxyz")[:3, :3], turning)


def test_w_is_last():
    assert tft.quaternion_from_euler(0, 0, math.pi / 2) == pytest.approx((0, 0, HALF, HALF))
    assert tft.euler_from_quaternion([0, 0, HALF, HALF]) == pytest.approx((0, 0, math.pi / 2))
    assert tft.quaternion_from_euler(1, 2, 3, "ryxz") == pytest.approx(
        (0.310622, -0.718287, 0.444435, 0.435953), abs=1e-6
    )


def test_angles_and_quaternions_are_plain_numbers():
    found = (
        *tft.euler_from_quaternion(np.array([0, 0, HALF, HALF])),
        *tft.quaternion_from_euler(0, 0, 1),
    )
    assert {type(each) for each in found} == {float}


def test_a_quaternion_of_any_length_is_a_rotation():
    assert tft.euler_from_quaternion((0, 0, 3, 3)) == pytest.approx((0, 0, math.pi / 2))
    assert np.allclose(tft.quaternion_matrix((0, 0, 0, 0)), np.identity(4))


@given(ANGLES, ANGLES)
def test_products_inverses_and_conjugates_are_those_of_rotations(first, second):
    a, b = tft.quaternion_about_axis(first, (1, 2, 3)), tft.quaternion_about_axis(second, (0, 1, 0))
    product = tft.quaternion_matrix(a) @ tft.quaternion_matrix(b)
    assert np.allclose(tft.quaternion_matrix(tft.quaternion_multiply(a, b)), product)
    assert np.allclose(tft.quaternion_multiply(a, tft.quaternion_inverse(a)), (0, 0, 0, 1))
    assert np.allclose(tft.quaternion_conjugate(a), tft.quaternion_inverse(a))
    assert np.allclose(tft.quaternion_multiply(2 * b, tft.quaternion_inverse(2 * b)), (0, 0, 0, 1))


def test_the_product_of_i_and_j_is_k():
    assert tft.quaternion_multiply((1, 0, 0, 0), (0, 1, 0, 0)) == (0, 0, 1, 0)


@given(ANGLES)
def test_about_an_axis_it_is_rodrigues_formula(angle):
    axis = np.array((1, -2, 2)) / 3
    assert np.allclose(tft.rotation_matrix(angle, 5 * axis)[:3, :3], turned(axis, angle))
    assert np.allclose(
        tft.quaternion_matrix(tft.quaternion_about_axis(angle, axis))[:3, :3], turned(axis, angle)
    )


def test_about_a_point_that_point_stays():
    matrix = tft.rotation_matrix(0.7, Z, (1, 2, 3))
    assert np.allclose(matrix @ (1, 2, 3, 1), (1, 2, 3, 1))
    angle, direction, point = tft.rotation_from_matrix(matrix)
    assert angle == pytest.approx(0.7)
    assert np.allclose(direction, Z)
    assert np.allclose(matrix @ point, point)


def test_slerp_goes_half_way_the_short_way_and_ends_at_the_ends():
    start, end = (0, 0, 0, 1), tft.quaternion_from_euler(0, 0, 1.0)
    assert np.allclose(tft.quaternion_slerp(start, end, 0), start)
    assert np.allclose(tft.quaternion_slerp(start, end, 1), end)
    assert tft.euler_from_quaternion(tft.quaternion_slerp(start, end, 0.5))[2] == pytest.approx(0.5)
    assert tft.euler_from_quaternion(tft.quaternion_slerp(start, -np.array(end), 0.5))[
        2
    ] == pytest.approx(0.5)
    long = tft.quaternion_slerp(start, -np.array(end), 0.5, shortestpath=False)
    assert abs(tft.euler_from_quaternion(long)[2]) == pytest.approx(math.pi - 0.5)


def test_matrices_move_join_and_go_back():
    matrix = tft.concatenate_matrices(
        tft.translation_matrix((1, 2, 3)), tft.rotation_matrix(math.pi / 2, Z)
    )
    assert np.allclose(matrix @ (1, 0, 0, 1), (1, 3, 3, 1))
    assert np.allclose(tft.translation_from_matrix(matrix), (1, 2, 3))
    assert np.allclose(tft.inverse_matrix(matrix) @ matrix, tft.identity_matrix())
    assert tft.quaternion_from_matrix(matrix) == pytest.approx((0, 0, HALF, HALF))
    assert tft.is_same_transform(matrix, 2 * matrix)
    assert not tft.is_same_transform(matrix, np.identity(4))
    assert np.allclose(tft.concatenate_matrices(), np.identity(4))


def test_scaling_and_composing():
    assert np.allclose(tft.scale_matrix(2, (1, 0, 0)) @ (2, 1, 0, 1), (3, 2, 0, 1))
    assert np.allclose(tft.scale_matrix(3, direction=(0, 2, 0)) @ (1, 1, 1, 1), (1, 3, 1, 1))
    matrix = tft.compose_matrix((1, 2, 1), angles=(0, 0, math.pi / 2), translate=(5, 0, 0))
    assert np.allclose(matrix @ (0, 1, 0, 1), (3, 0, 0, 1))
    assert np.allclose(tft.compose_matrix(), np.identity(4))


def test_lengths_and_unit_vectors():
    assert tft.vector_norm((3, 4)) == 5.0
    assert np.allclose(tft.vector_norm([[3, 4], [6, 8]], axis=1), (5, 10))
    assert np.allclose(tft.unit_vector((3, 0, 4)), (0.6, 0, 0.8))
    assert np.allclose(tft.unit_vector([[3, 4], [0, 2]], axis=1), ((0.6, 0.8), (0.0, 1.0)))
    out = np.zeros(3)
    assert tft.unit_vector((0, 0, 7), out=out) is None
    assert np.allclose(out, Z)


def test_random_rotations_are_rotations():
    found = [tft.random_quaternion() for _ in range(50)]
    assert [tft.vector_norm(each) for each in found] == pytest.approx([1.0] * 50)
    assert np.allclose(np.linalg.det(tft.random_rotation_matrix()[:3, :3]), 1)
    assert tft.random_vector(7).shape == (7,)
    assert np.allclose(tft.random_quaternion((0.0, 0.25, 0.0)), (1, 0, 0, 0))


def test_a_message_is_no_quaternion():
    with pytest.raises(TypeError, match=r"not a message; write \[q.x, q.y, q.z, q.w]"):
        tft.euler_from_quaternion(find("geometry_msgs/msg/Quaternion")())


def test_an_order_of_axes_that_there_is_not_is_an_error():
    with pytest.raises((KeyError, AttributeError)):
        tft.quaternion_from_euler(1, 2, 3, "sxyy")


def test_all_that_is_listed_is_there():
    assert [name for name in tft.__all__ if not callable(getattr(tft, name))] == []
