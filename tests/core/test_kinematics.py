"""Kinematics of a planar base against closed forms and against wheels that are moved by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.kinematics import Wheel, mecanum_rates, planar_velocity, to_body, to_world, wheel_rate

speeds = st.floats(-5, 5)
angles = st.floats(-10, 10)


@pytest.mark.parametrize(
    ("yaw", "world"), [(0, (1, 2)), (math.pi / 2, (-2, 1)), (math.pi, (-1, -2))]
)
def test_the_body_velocity_is_turned_into_the_world_by_yaw(
    yaw: float, world: tuple[float, float]
) -> None:
    assert to_world((1, 2, 0), yaw, 0.1) == pytest.approx(world)
    assert to_body(*world, yaw) == pytest.approx((1, 2))


@given(speeds, speeds, speeds, angles, st.floats(1e-4, 0.1))
def test_steps_along_the_mean_heading_follow_the_arc(
    x: float, y: float, turn: float, yaw: float, dt: float
) -> None:
    headings = yaw + turn * dt * (np.arange(1000) + 0.5) / 1000
    chord = (
        np.mean(x * np.cos(headings) - y * np.sin(headings)),
        np.mean(x * np.sin(headings) + y * np.cos(headings)),
    )
    # The mean velocity over an arc is shorter than the velocity by (turn dt)^2 / 24, and has its
    # mean heading.
    slack = math.hypot(x, y) * (turn * dt) ** 2 / 23 + 1e-9
    assert math.dist(to_world((x, y, turn), yaw, dt), chord) <= slack


@given(speeds, speeds, angles)
def test_to_body_undoes_to_world(x: float, y: float, yaw: float) -> None:
    assert to_body(*to_world((x, y, 0), yaw, 1), yaw) == pytest.approx((x, y), abs=1e-9)


def test_a_wheel_with_its_axle_to_the_left_rolls_forward() -> None:
    assert wheel_rate((0.3, 0, 0), Wheel("w", 0, 0, 0, 1, 0.1)) == pytest.approx(3)


def test_an_omni_wheel_ignores_what_is_along_its_axle() -> None:
    assert wheel_rate((0, 0.3, 0), Wheel("w", 0, 0, 0, 1, 0.1)) == 0


def test_a_wheel_beside_the_centre_rolls_when_the_base_turns() -> None:
    # At the left of the centre with its axle to the left: turning left moves it backward.
    assert wheel_rate((0, 0, 2), Wheel("w", 0, 0.5, 0, 1, 0.1)) == pytest.approx(-10)


@given(speeds, speeds, speeds, st.floats(-2, 2), st.floats(-2, 2), angles, st.floats(0.02, 1))
def test_the_wheel_turns_by_the_way_it_rolls(
    x: float, y: float, turn: float, wx: float, wy: float, axle: float, radius: float
) -> None:
    """Brute force: move the base a little both ways, and measure the wheel's way along its rolling
    direction.
    """
    wheel = Wheel("w", wx, wy, math.cos(axle), math.sin(axle), radius)

    def centre(dt: float) -> np.ndarray:
        c, s = math.cos(turn * dt), math.sin(turn * dt)
        return np.array([x * dt + c * wx - s * wy, y * dt + s * wx + c * wy, 0.0])

    dt = 1e-5
    way = (centre(dt) - centre(-dt)) / (2 * dt)
    rolling = np.cross([wheel.ax, wheel.ay, 0], [0, 0, 1])
    assert wheel_rate((x, y, turn), wheel) == pytest.approx(
        way @ rolling / radius, abs=1e-5 / radius
    )


CORNERS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
"""Front and left (1) or back and right (-1) of the wheels, in the order of `mecanum_rates`."""


@given(speeds, speeds, speeds, st.floats(0.05, 1), st.floats(0.05, 1), st.floats(0.02, 0.5))
def test_a_mecanum_wheel_rolls_what_its_rollers_cannot(
    x: float, y: float, turn: float, length: float, width: float, radius: float
) -> None:
    """Along its axle a roller on the ground does not slip: there rim and ground are equally
    fast.
    """
    rates = mecanum_rates((x, y, turn), length + width, radius)
    for rate, (front, left) in zip(rates, CORNERS, strict=True):
        ground = np.array([x - turn * left * width, y + turn * front * length])
        axle = np.array([1, -front * left]) / math.sqrt(2)  # of the roller that touches the ground
        assert rate * radius * axle[0] == pytest.approx(ground @ axle, abs=1e-9)


def test_a_mecanum_base_goes_left_on_crossed_wheels() -> None:
    assert mecanum_rates((0, 0.3, 0), 0.5, 0.1) == pytest.approx((-3, 3, 3, -3))


@given(speeds, speeds, speeds, st.floats(0.02, 1), st.floats(0.02, 1))
def test_the_velocity_of_omni_wheels_is_the_one_that_turns_them(
    x: float, y: float, turn: float, arm: float, radius: float
) -> None:
    angles = [math.radians(degrees) for degrees in (30, 150, 270)]
    wheels = [
        Wheel("w", arm * math.cos(a), arm * math.sin(a), math.cos(a), math.sin(a), radius)
        for a in angles
    ]
    for some in (wheels, [*wheels, Wheel("w", 2 * arm, 0, 1, 0, radius)]):
        found = planar_velocity([wheel_rate((x, y, turn), wheel) for wheel in some], some)
        assert found == pytest.approx((x, y, turn), abs=1e-6)


def test_wheels_that_leave_a_velocity_open_are_refused() -> None:
    beside = [Wheel("w", 0, side, 0, 1, 0.1) for side in (0.2, 0.0, -0.2)]
    with pytest.raises(ValueError, match="do not determine the velocity"):
        planar_velocity([1, 1, 1], beside)
