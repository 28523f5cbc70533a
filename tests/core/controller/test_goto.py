"""Go to a goal: pure functions, and a robot that moves as commanded arrives from anywhere."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.kinematics import to_world
from holozen.limits import STOP, Planar
from services.controller.goto import (
    Gains,
    Leg,
    PlanarPose,
    arrived,
    distance_to_line,
    error,
    velocity,
)

DT = 0.05
places = st.floats(-5, 5)
poses = st.tuples(places, places, st.floats(-10, 10))
numbers = st.floats(-1e3, 1e3)


def drive(
    start: PlanarPose, goal: PlanarPose, gains: Gains, seconds: float = 60.0
) -> list[tuple[PlanarPose, Planar]]:
    """The poses and commands of an ideal robot, step by step, until it has arrived."""
    pose, now = start, STOP
    way: list[tuple[PlanarPose, Planar]] = []
    for _ in range(round(seconds / DT)):
        left = error(pose, goal)
        if arrived(left, now, gains):
            return way
        now = velocity(left, now, gains, DT)
        vx, vy = to_world(now, pose[2], DT)
        pose = pose[0] + vx * DT, pose[1] + vy * DT, pose[2] + now[2] * DT
        way.append((pose, now))
    raise AssertionError(f"not there after {seconds} s: {pose} for {goal}")


def test_the_error_is_the_goal_as_the_body_sees_it() -> None:
    assert error((1, 1, 0), (3, 2, 0.5)) == pytest.approx((2, 1, 0.5))
    assert error((1, 1, math.pi / 2), (3, 2, math.pi / 2)) == pytest.approx((1, -2, 0))


def test_the_angle_is_turned_the_short_way_round() -> None:
    rows = [
        (3.0, -3.0, math.tau - 6),
        (-3.0, 3.0, 6 - math.tau),
        (0, 7 * math.tau + 1, 1),
        (20.0, 20.5, 0.5),
    ]
    for theta, goal, turn in rows:
        assert error((0, 0, theta), (0, 0, goal))[2] == pytest.approx(turn)


def test_arrived_is_within_both_tolerances() -> None:
    gains = Gains(tolerance=0.01, angle_tolerance=0.02)
    assert arrived((0.006, -0.008, 0.02), STOP, gains)
    assert not arrived((0.008, 0.008, 0), STOP, gains)
    assert not arrived((0, 0, -0.021), STOP, gains)


def test_a_robot_that_only_passes_has_not_arrived() -> None:
    gains = Gains()
    assert arrived((0, 0, 0), (0.03, -0.03, 0.1), gains)
    assert not arrived((0, 0, 0), (0.04, -0.04, 0), gains)
    assert not arrived((0, 0, 0), (0, 0, -0.11), gains)


def test_the_velocity_leaves_half_of_the_acceleration_to_stop_with() -> None:
    gains = Gains(
        linear=10,
        angular=10,
        max_speed=10,
        max_turn=10,
        max_acceleration=1,
        max_turn_acceleration=2,
    )
    x, y, turn = velocity((0.16, 0, 0.5), (0.4, 0, 1.0), gains, dt=10)
    assert (x, y, turn) == pytest.approx((0.4, 0, 1.0))  # v^2 = 2 (a / 2) s


def test_the_velocity_is_proportional_near_the_goal() -> None:
    gains = Gains(linear=1.5, angular=2.0, max_acceleration=1e6, max_turn_acceleration=1e6)
    assert velocity((0.1, -0.2, 0.3), STOP, gains, DT) == pytest.approx((0.15, -0.3, 0.6))


def test_the_velocity_far_away_has_the_speed_limit_and_points_at_the_goal() -> None:
    gains = Gains(max_speed=0.5, max_turn=1.0, max_acceleration=1e6, max_turn_acceleration=1e6)
    assert velocity((30, 40, -3), STOP, gains, DT) == pytest.approx((0.3, 0.4, -1.0))


@given(
    st.tuples(numbers, numbers, st.floats(-3, 3)),
    st.tuples(*[st.floats(-1, 1)] * 3),
    st.floats(0.01, 1),
)
def test_no_command_exceeds_the_limits_of_speed_and_acceleration(
    left: Planar, before: Planar, dt: float
) -> None:
    gains = Gains()
    now = velocity(left, before, gains, dt)
    assert math.hypot(now[0] - before[0], now[1] - before[1]) <= gains.max_acceleration * dt + 1e-9
    assert abs(now[2] - before[2]) <= gains.max_turn_acceleration * dt + 1e-9
    assert (
        math.hypot(now[0], now[1]) <= max(gains.max_speed, math.hypot(before[0], before[1])) + 1e-9
    )
    assert abs(now[2]) <= max(gains.max_turn, abs(before[2])) + 1e-9


@given(poses, poses)
def test_from_anywhere_the_robot_arrives_within_the_limits(
    start: PlanarPose, goal: PlanarPose
) -> None:
    gains = Gains()
    for (x, y, _), (vx, vy, turn) in drive(start, goal, gains):
        assert math.hypot(vx, vy) <= gains.max_speed + 1e-9
        assert abs(turn) <= gains.max_turn + 1e-9
        assert math.dist((x, y), goal[:2]) <= math.dist(start[:2], goal[:2]) + 0.05


@pytest.mark.parametrize(
    "gains",
    [
        Gains(linear=10, angular=10),
        Gains(linear=0.1, angular=0.1),
        Gains(max_speed=10, max_turn=20, max_acceleration=100),
        Gains(tolerance=0.001, angle_tolerance=0.001),
    ],
)
def test_it_arrives_with_the_gains_at_the_ends_of_their_ranges(gains: Gains) -> None:
    drive((0, 0, 0), (1, -1, 2), gains, seconds=300)


def test_a_turning_robot_strafes_along_the_straight_line() -> None:
    start, goal = (0.0, 0.0, 0.0), (2.0, 1.0, 2.5)
    assert (
        max(distance_to_line(pose, start, goal) for pose, _ in drive(start, goal, Gains())) < 0.03
    )


def test_the_distance_to_a_leg_ends_at_its_ends() -> None:
    for point, distance in [
        ((1, 0), 0),
        ((1, 0.5), 0.5),
        ((1, -0.5), 0.5),
        ((-3, 4), 5),
        ((5, 4), 5),
        ((0, 0), 0),
        ((2, 0), 0),
    ]:
        assert distance_to_line((*point, 0), (0, 0, 0), (2, 0, 0)) == pytest.approx(distance)


def test_a_leg_without_length_is_a_point() -> None:
    assert distance_to_line((3, 4, 0), (0, 0, 0), (0, 0, 1)) == pytest.approx(5)


def test_a_leg_keeps_its_times_and_its_worst_error() -> None:
    leg = Leg(start=(0, 0, 0), goal=(2, 0, 0), began=10.0)
    for y, time in ((0.0, 10.0), (0.3, 11.0), (-0.1, 12.5)):
        leg.update((1, y, 0), time)
    assert (leg.began, leg.ended) == (10.0, 12.5)
    assert leg.path_error == pytest.approx(0.3)
