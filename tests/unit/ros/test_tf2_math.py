"""Rigid transforms agree with the mathematics of matrices."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.robot.rotation import Array, matrix_of_quaternion
from holozen.ros import tf2_math as tf

NUMBERS = st.floats(-10, 10)
POINTS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
PARTS = st.floats(-1, 1)
QUATERNIONS = st.tuples(PARTS, PARTS, PARTS, PARTS).filter(lambda q: math.hypot(*q) > 0.1).map(tf.unit)
RIGIDS = st.builds(tf.Rigid, POINTS, QUATERNIONS)


def matrix(rigid: tf.Rigid) -> Array:
    found = np.identity(4)
    found[:3, :3], found[:3, 3] = matrix_of_quaternion(rigid.rotation), rigid.translation
    return found


def same(one: Any, other: Any) -> bool:
    return np.allclose(one, other, atol=1e-9)


@given(RIGIDS, RIGIDS)
def test_one_after_the_other_is_the_product_of_their_matrices(first, outer):
    assert same(matrix(first.then(outer)), matrix(outer) @ matrix(first))


@given(RIGIDS)
def test_the_inverse_is_that_of_the_matrix(rigid):
    assert same(matrix(rigid.inverse()), np.linalg.inv(matrix(rigid)))


@given(RIGIDS, POINTS)
def test_a_point_goes_where_the_matrix_takes_it(rigid, point):
    assert same((*rigid.point(point), 1.0), matrix(rigid) @ (*point, 1.0))


@given(QUATERNIONS, QUATERNIONS)
def test_the_product_of_quaternions_is_that_of_their_rotations(a, b):
    assert same(matrix_of_quaternion(tf.multiply(a, b)), matrix_of_quaternion(a) @ matrix_of_quaternion(b))


@given(QUATERNIONS, QUATERNIONS, st.floats(0, 1))
def test_slerp_turns_at_even_speed_by_the_shorter_way(a, b, fraction):
    def angle(p: Any, q: Any) -> float:
        # By the distance: the cosine loses the digits of small angles.
        return 2 * math.asin(min(1.0, min(math.dist(p, q), math.dist(p, [-x for x in q])) / 2))

    whole, part = angle(a, b), angle(a, tf.slerp(a, b, fraction))
    assert part == pytest.approx(fraction * whole, abs=1e-6)
    assert math.hypot(*tf.slerp(a, b, fraction)) == pytest.approx(1)


def test_between_moves_in_a_straight_line_and_turns():
    end = tf.Rigid((2.0, 4.0, 6.0), (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
    middle = tf.between(tf.Rigid(), end, 0.5)
    assert middle.translation == (1.0, 2.0, 3.0)
    assert middle.rotation == pytest.approx((0, 0, math.sin(math.pi / 8), math.cos(math.pi / 8)))


@pytest.mark.parametrize("wrong", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (math.inf, 0.0, 0.0, 1.0)])
def test_a_rotation_without_direction_is_refused(wrong):
    with pytest.raises(ValueError, match="no rotation is 0, 0, 0, 1"):
        tf.unit(wrong)
