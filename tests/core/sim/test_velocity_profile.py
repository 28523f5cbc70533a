"""A profile approaches the wanted speed smoothly, within its acceleration, and stays there."""

import pytest

from services.sim.physics.balance import VelocityProfile

DT = 1 / 240


def speeds(profile: VelocityProfile, wanted: float, seconds: float) -> list[float]:
    found = []
    for _ in range(round(seconds / DT)):
        profile.step(wanted, DT)
        found.append(profile.speed)
    return found


def test_it_comes_to_the_speed_and_hardly_beyond() -> None:
    for wanted in [-1.5, -0.2, 0.01, 0.5, 3.0]:
        found = speeds(VelocityProfile(1.0), wanted, 6)
        assert found[-1] == pytest.approx(wanted, abs=1e-4)
        assert max(speed / wanted for speed in found) < 1.05


def test_it_keeps_to_its_acceleration() -> None:
    profile = VelocityProfile(0.8)
    for wanted in (2.0, -2.0, 1.0):
        for _ in range(200):
            profile.step(wanted, DT)
            assert abs(profile.acceleration) < 0.8 * 1.1


def test_at_first_it_only_jerks() -> None:
    profile = VelocityProfile(1.0)
    profile.step(1.0, DT)
    assert profile.speed < 1e-3
    assert profile.acceleration < 0.02


def test_a_push_beyond_its_reach_makes_it_begin_there() -> None:
    profile = VelocityProfile(1.0)
    profile.follow(2.0, 0.3)
    assert profile.speed == pytest.approx(1.7)
    profile.follow(1.8, 0.3)
    assert profile.speed == pytest.approx(1.7)
