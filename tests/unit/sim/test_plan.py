"""A plan comes to the wanted speed smoothly, within its acceleration, and stays there."""

import pytest

from services.sim.plan import Plan

DT = 1 / 240


def speeds(plan: Plan, wanted: float, seconds: float) -> list[float]:
    found = []
    for _ in range(round(seconds / DT)):
        plan.step(wanted, DT)
        found.append(plan.speed)
    return found


@pytest.mark.parametrize("wanted", [-1.5, -0.2, 0.01, 0.5, 3.0])
def test_it_comes_to_the_speed_and_hardly_beyond(wanted: float) -> None:
    found = speeds(Plan(1.0), wanted, 6)
    assert found[-1] == pytest.approx(wanted, abs=1e-4)
    assert max(speed / wanted for speed in found) < 1.05


def test_it_keeps_to_its_acceleration() -> None:
    plan = Plan(0.8)
    for wanted in (2.0, -2.0, 1.0):
        for _ in range(200):
            plan.step(wanted, DT)
            assert abs(plan.acceleration) < 0.8 * 1.1


def test_at_first_it_only_jerks() -> None:
    plan = Plan(1.0)
    plan.step(1.0, DT)
    assert plan.speed < 1e-3
    assert plan.acceleration < 0.02


def test_a_push_beyond_its_reach_makes_it_begin_there() -> None:
    plan = Plan(1.0)
    plan.keep_near(2.0, 0.3)
    assert plan.speed == pytest.approx(1.7)
    plan.keep_near(1.8, 0.3)
    assert plan.speed == pytest.approx(1.7)
