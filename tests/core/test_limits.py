"""Limits keep the direction, never go past what was wanted, and wrap angles."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.limits import Planar, clamp, clamp_speed, ramp

numbers = st.floats(-1e6, 1e6)
speeds = st.tuples(numbers, numbers, numbers)
limits = st.floats(1e-3, 1e3)


def test_clamp_brings_a_value_within_its_limit() -> None:
    for value, inside in [(0.3, 0.3), (2, 1), (-2, -1), (1, 1), (-1, -1), (0, 0)]:
        assert clamp(value, 1) == inside


def test_a_clamped_speed_has_the_limit_and_the_direction() -> None:
    assert clamp_speed((3, 4, -2), 1, 0.5) == pytest.approx((0.6, 0.8, -0.5))
    assert clamp_speed((0.3, 0.4, 0.1), 0.5, 0.5) == (0.3, 0.4, 0.1)


@given(speeds, limits, limits)
def test_a_clamped_speed_keeps_its_direction_and_its_limits(
    velocity: Planar, linear: float, angular: float
) -> None:
    x, y, turn = clamp_speed(velocity, linear, angular)
    assert math.hypot(x, y) <= linear * (1 + 1e-12)
    assert abs(turn) <= angular
    assert x * velocity[1] == pytest.approx(y * velocity[0], rel=1e-9, abs=1e-12)
    assert x * velocity[0] + y * velocity[1] >= 0
    assert turn * velocity[2] >= 0


@given(speeds, st.floats(0, 1e3), st.floats(0, 1e3))
def test_a_speed_within_the_limits_is_left_alone(
    velocity: Planar, room: float, turn_room: float
) -> None:
    limits = math.hypot(velocity[0], velocity[1]) + room, abs(velocity[2]) + turn_room
    assert clamp_speed(velocity, *limits) == velocity


@given(
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(allow_nan=False, allow_infinity=False),
    limits,
)
def test_the_largest_numbers_are_clamped_too(x: float, y: float, linear: float) -> None:
    fast = clamp_speed((x, y, 0), linear, 1)
    assert math.hypot(fast[0], fast[1]) <= linear * (1 + 1e-9)


def test_a_ramp_takes_a_step_of_the_acceleration_towards_its_target() -> None:
    assert ramp((1, 0, 0), (1, 2, 3), linear=4, angular=1, dt=0.1) == pytest.approx((1, 0.4, 0.1))
    assert ramp((1, 0, 1), (0, 0, 0), linear=1, angular=2, dt=0.25) == pytest.approx((0.75, 0, 0.5))


@given(speeds, speeds, limits, limits, st.floats(1e-3, 1))
def test_a_ramp_never_exceeds_the_acceleration_and_never_overshoots(
    now: Planar, wanted: Planar, linear: float, angular: float, dt: float
) -> None:
    then = ramp(now, wanted, linear, angular, dt)
    slack = 1e-6 * (1 + max(map(abs, (*now, *wanted))))
    assert math.hypot(then[0] - now[0], then[1] - now[1]) <= linear * dt + slack
    assert abs(then[2] - now[2]) <= angular * dt + slack
    assert math.dist(then[:2], wanted[:2]) <= math.dist(now[:2], wanted[:2]) + slack
    assert abs(then[2] - wanted[2]) <= abs(now[2] - wanted[2]) + slack


@given(speeds, speeds)
def test_a_ramp_with_room_arrives(now: Planar, wanted: Planar) -> None:
    assert ramp(now, wanted, linear=1e9, angular=1e9, dt=1) == pytest.approx(wanted, abs=1e-6)
