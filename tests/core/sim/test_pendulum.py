"""The gains hold the pendulum that they were made for, and one that is somewhat different."""

import math

import pytest
from msgspec.structs import replace

from services.sim.physics.balance import Pendulum, gains
from services.sim.physics.dynamics import GRAVITY

WHEELY = Pendulum(
    body_mass=0.18,
    wheel_mass=0.6,
    radius=0.034,
    height=0.04,
    axle=-0.04,
    body_inertia=6e-4,
    wheel_inertia=3.5e-5,
)
DT = 1 / 240


def accelerations(p: Pendulum, lean: float, rate: float, torque: float) -> tuple[float, float]:
    """The accelerations of the lean and along the ground: Lagrange's equations, not linearised,
    derived by hand.
    """
    sine, cosine = math.sin(lean), math.cos(lean)
    moving, turning = (
        p.body_mass + p.wheel_mass + p.wheel_inertia / p.radius**2,
        p.body_inertia + p.body_mass * p.height**2,
    )
    coupling = p.body_mass * p.height * cosine
    pull = torque / p.radius + p.body_mass * p.height * rate**2 * sine
    fall = p.body_mass * GRAVITY * p.height * sine - torque
    determinant = moving * turning - coupling**2
    return (moving * fall - coupling * pull) / determinant, (
        turning * pull - coupling * fall
    ) / determinant


def held(
    real: Pendulum, known: Pendulum, lean: float, seconds: float, dt: float = DT
) -> list[float]:
    """The lean, its rate, the speed and the distance after the gains for `known` have balanced
    it.
    """
    found = gains(known, dt)
    state = [lean, 0.0, 0.0, 0.0]
    for _ in range(round(seconds / dt)):
        torque = -sum(gain * value for gain, value in zip(found, state, strict=True))
        for _ in range(4):
            leaning, pulling = accelerations(real, state[0], state[1], torque)
            state[1] += leaning * dt / 4
            state[2] += pulling * dt / 4
            state[0] += state[1] * dt / 4
            state[3] += state[2] * dt / 4
        assert abs(state[0]) < 1, "it fell"
    return state


@pytest.mark.parametrize("lean", [-0.3, 0.05, 0.3])
def test_a_leaning_body_is_brought_upright_and_back_to_its_place(lean: float) -> None:
    assert held(WHEELY, WHEELY, lean, 10) == pytest.approx([0, 0, 0, 0], abs=2e-3)


@pytest.mark.parametrize("dt", [1 / 1000, 1 / 240, 1 / 100])
def test_the_gains_are_those_for_the_step(dt: float) -> None:
    assert held(WHEELY, WHEELY, 0.1, 10, dt) == pytest.approx([0, 0, 0, 0], abs=2e-3)


def test_a_body_that_differs_from_its_model_is_held_as_well() -> None:
    for name in ["body_mass", "wheel_mass", "radius", "height", "body_inertia", "wheel_inertia"]:
        for factor in [0.7, 1.4]:
            real = replace(WHEELY, **{name: getattr(WHEELY, name) * factor})
            assert held(real, WHEELY, 0.1, 10) == pytest.approx([0, 0, 0, 0], abs=5e-3)


def test_without_a_push_it_falls() -> None:
    leaning, _ = accelerations(WHEELY, 0.01, 0, 0)
    assert leaning > 0


def test_a_steady_lean_goes_with_a_steady_acceleration() -> None:
    lean = 1e-4 * WHEELY.lean_per_acceleration
    along = WHEELY.inertia[0][0]
    leaning, way = accelerations(WHEELY, lean, 0, WHEELY.radius * along * 1e-4)
    assert leaning == pytest.approx(0, abs=1e-9)
    assert way == pytest.approx(1e-4, rel=1e-6)


def test_the_point_ahead_of_the_axle_accelerates_by_the_lean_alone() -> None:
    for torque in (-0.01, 0, 0.02):
        leaning, way = accelerations(WHEELY, 1e-4, 0, torque)
        assert way + WHEELY.lag * leaning == pytest.approx(
            1e-4 / WHEELY.lean_per_acceleration, rel=1e-5
        )
