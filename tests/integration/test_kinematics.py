"""What is commanded is what odom shows, to a millimetre: the closed form of a constant velocity in the plane."""

import math

import pytest

from holozen.messages import Odometry
from holozen.testing import Wire

from .conftest import start_sim
from .robots import Planar, Robot, ahead, distance, moves, place, time_of

MILLIMETRE = 1e-3  # m; and rad


@pytest.fixture(scope="module")
def quick(town: Wire) -> Robot:
    """A robot four times as fast as real time."""
    start_sim(town, "--rtf", "4")
    return Robot(town.bus()).wait_longer()


def steady(robot: Robot, velocity: Planar, seconds: float) -> list[Odometry]:
    """Odoms over that much sim time of driving at a velocity that does not change."""
    begin = time_of(robot.drive(*velocity)[-1])
    odoms = robot.drive(*velocity, until=lambda odom: time_of(odom) >= begin + seconds)
    return [odom for odom in odoms if time_of(odom) > begin]


@pytest.mark.parametrize(
    ("velocity", "seconds"),
    [
        ((0.5, 0.0, 0.0), 4.0),
        ((0.4, -0.3, 0.0), 4.0),
        ((0.3, 0.4, -0.8), 8.0),
        ((2.0, 1.0, 5.0), 2.0),
    ],
    ids=["2 m forward", "2 m aslant", "arc aslant", "fast spiral"],
)
def test_driving_two_metres_or_turning_ends_where_the_closed_form_says(
    quick: Robot, velocity: Planar, seconds: float
) -> None:
    odoms = steady(quick, velocity, seconds)
    assert len(odoms) >= 40 * seconds
    start = place(odoms[0])
    for odom in odoms[1:]:
        x, y, yaw = ahead(start, velocity, time_of(odom) - time_of(odoms[0]))
        there = place(odom)
        assert math.hypot(there[0] - x, there[1] - y) < MILLIMETRE
        assert abs(math.remainder(there[2] - yaw, math.tau)) < MILLIMETRE
        assert moves(odom, *velocity, tolerance=MILLIMETRE)
    quick.stop()


def test_forward_is_where_the_robot_looks_after_a_turn(quick: Robot) -> None:
    quick.stop()
    quick.drive(0, 0, 0.5, until=lambda odom: place(odom)[2] > 1.4 and place(odom)[2] < 1.7)
    start = quick.stop()
    end = quick.drive(0.5, until=lambda odom: distance(odom, start) > 1)[-1]
    angle = math.atan2(place(end)[1] - place(start)[1], place(end)[0] - place(start)[0])
    assert angle == pytest.approx(place(start)[2], abs=MILLIMETRE)
    assert 1.3 < angle < 1.8
    assert moves(end, 0.5, 0, 0)


def test_a_stop_is_a_stop_at_once(quick: Robot) -> None:
    quick.drive(1.0, 1.0, 1.0)
    quick.put()
    stood = quick.stands()
    assert distance(stood, quick.pass_time(1.0)) < 1e-6
