"""What is commanded is what odom shows, to a millimetre: the closed form of a constant velocity in
the plane.
"""

import math

import pytest

from holozen.testing import LockStep, Wire

from .robots import Planar, ahead, distance, moves, place, rests, time_of

MILLIMETRE = 1e-3  # m; and rad
STEPS = 48  # between two commands: 0.2 s


@pytest.fixture(scope="module")
def shared(town: Wire) -> LockStep:
    return LockStep(town)


@pytest.fixture
def sim(shared: LockStep) -> LockStep:
    """A sim with a robot that stands on its wheels, at time 1."""
    shared.reset()
    shared.step(240)
    return shared


def drive(sim: LockStep, velocity: Planar) -> None:
    sim.drive(*velocity)
    sim.step(STEPS)


@pytest.mark.parametrize(
    ("velocity", "seconds"),
    [
        ((0.4, -0.3, 0.0), 4.0),
        ((0.3, 0.4, -0.8), 8.0),
        ((2.0, 1.0, 5.0), 2.0),
    ],
    ids=["2 m aslant", "arc aslant", "fast spiral"],
)
def test_driving_two_metres_or_turning_ends_where_the_closed_form_predicts(
    sim: LockStep, velocity: Planar, seconds: float
) -> None:
    begin, start = time_of(sim.odom), place(sim.odom)
    while time_of(sim.odom) < begin + seconds - 1e-6:
        drive(sim, velocity)
        x, y, yaw = ahead(start, velocity, time_of(sim.odom) - begin)
        there = place(sim.odom)
        assert math.hypot(there[0] - x, there[1] - y) < MILLIMETRE
        assert abs(math.remainder(there[2] - yaw, math.tau)) < MILLIMETRE
        assert moves(sim.odom, *velocity, tolerance=MILLIMETRE)


def test_forward_is_where_the_robot_looks_after_a_turn(sim: LockStep) -> None:
    for _ in range(15):
        drive(sim, (0.0, 0.0, 0.5))
    start = place(sim.odom)
    assert start[2] == pytest.approx(1.5, abs=MILLIMETRE)
    for _ in range(10):
        drive(sim, (0.5, 0.0, 0.0))
    end = place(sim.odom)
    assert math.atan2(end[1] - start[1], end[0] - start[0]) == pytest.approx(
        start[2], abs=MILLIMETRE
    )
    assert math.dist(start[:2], end[:2]) == pytest.approx(1.0, abs=MILLIMETRE)


def test_a_stop_is_a_stop_at_once(sim: LockStep) -> None:
    drive(sim, (1.0, 1.0, 1.0))
    sim.drive()
    stood = sim.step()
    assert rests(stood)
    assert distance(stood, sim.step(240)) < 1e-6
