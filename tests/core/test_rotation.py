"""Quaternions and rigid transforms agree with the mathematics of matrices."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.robot.rotation import Array, matrix_of
from holozen.rotation import (
    Transform,
    from_axis_angle,
    from_rpy,
    multiply,
    normalize,
    slerp,
    to_rpy,
    yaw,
)

NUMBERS = st.floats(-10, 10)
POINTS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
PARTS = st.floats(-1, 1)
QUATERNIONS = (
    st.tuples(PARTS, PARTS, PARTS, PARTS).filter(lambda q: math.hypot(*q) > 0.1).map(normalize)
)
ANGLES = st.floats(-math.pi, math.pi)
TRANSFORMS = st.builds(Transform, POINTS, QUATERNIONS)


def matrix_of_quaternion(q: tuple[float, float, float, float]) -> Array:
    """The textbook's matrix, as a second opinion."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def matrix(transform: Transform) -> Array:
    found = np.identity(4)
    found[:3, :3], found[:3, 3] = matrix_of_quaternion(transform.rotation), transform.translation
    return found


def same(one: Any, other: Any) -> bool:
    return np.allclose(one, other, atol=1e-9)


@given(TRANSFORMS, TRANSFORMS, POINTS)
def test_transforms_compose_invert_and_apply_as_their_matrices(outer, inner, point):
    assert same(matrix(outer @ inner), matrix(outer) @ matrix(inner))
    assert same(matrix(outer.inverse()), np.linalg.inv(matrix(outer)))
    assert same((*outer.apply(point), 1.0), matrix(outer) @ (*point, 1.0))


@given(QUATERNIONS, QUATERNIONS)
def test_the_product_of_quaternions_is_that_of_their_rotations(a, b):
    assert same(
        matrix_of_quaternion(multiply(a, b)), matrix_of_quaternion(a) @ matrix_of_quaternion(b)
    )


@given(ANGLES, ANGLES, ANGLES)
def test_roll_pitch_and_yaw_are_those_of_urdf(roll, pitch, turn):
    q = from_rpy(roll, pitch, turn)
    assert same(matrix_of_quaternion(q), matrix_of((roll, pitch, turn)))
    assert same(matrix_of(to_rpy(q)), matrix_of((roll, pitch, turn)))


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_straight_up_and_down_have_no_roll(pitch):
    turn = 0.3 - math.copysign(0.4, pitch)  # roll and yaw turn the same way there
    assert to_rpy(from_rpy(0.4, pitch, 0.3)) == pytest.approx((0.0, pitch, turn), abs=1e-7)


@given(ANGLES)
def test_an_angle_about_z_is_the_yaw(angle):
    assert same(from_axis_angle((0.0, 0.0, 1.0), angle), from_rpy(0.0, 0.0, angle))
    assert yaw(from_axis_angle((0.0, 0.0, 1.0), angle)) == pytest.approx(angle)


@given(QUATERNIONS, QUATERNIONS, st.floats(0, 1))
def test_slerp_turns_at_constant_speed_along_the_shorter_way(a, b, fraction):
    def angle(p: Any, q: Any) -> float:
        # By the distance: the cosine loses the digits of small angles.
        return 2 * math.asin(min(1.0, min(math.dist(p, q), math.dist(p, [-x for x in q])) / 2))

    whole, part = angle(a, b), angle(a, slerp(a, b, fraction))
    assert part == pytest.approx(fraction * whole, abs=1e-6)
    assert math.hypot(*slerp(a, b, fraction)) == pytest.approx(1)


def test_interpolation_moves_in_a_straight_line_and_turns():
    end = Transform((2.0, 4.0, 6.0), (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
    middle = Transform().interpolate(end, 0.5)
    assert middle.translation == (1.0, 2.0, 3.0)
    assert middle.rotation == pytest.approx((0, 0, math.sin(math.pi / 8), math.cos(math.pi / 8)))


@pytest.mark.parametrize(
    "wrong", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (math.inf, 0.0, 0.0, 1.0)]
)
def test_a_rotation_without_direction_is_refused(wrong):
    with pytest.raises(ValueError, match="the identity is 0, 0, 0, 1"):
        normalize(wrong)
