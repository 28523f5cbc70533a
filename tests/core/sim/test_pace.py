"""Steps are due one after another without drift, and none are rushed to make up for a stall."""

import pytest

from services.sim.schedule import STALL, Pace


def test_the_first_step_is_due_at_once() -> None:
    assert Pace(1 / 240, 1.0, now=100.0).left(100.0) == 0


def test_a_step_is_due_one_period_after_the_last_was_due_not_after_it_was_made() -> None:
    pace = Pace(0.01, 1.0, now=100.0)
    pace.stepped(100.004)  # late
    assert pace.left(100.004) == pytest.approx(0.006)


@pytest.mark.parametrize(("rtf", "period"), [(1, 0.01), (2, 0.005), (0.5, 0.02)])
def test_a_real_time_factor_shortens_or_stretches_the_period(rtf: float, period: float) -> None:
    pace = Pace(0.01, rtf, now=0.0)
    pace.stepped(0.0)
    assert pace.left(0.0) == pytest.approx(period)


def test_minutes_of_steps_take_as_long() -> None:
    """A simulated clock that always wakes late, and steps that take time."""
    dt, now = 1 / 240, 0.0
    pace = Pace(dt, 1.0, now)
    for _ in range(360 * 240):
        now += max(0.0, pace.left(now)) + 0.0002  # it sleeps a little too long
        pace.stepped(now)
    assert now + pace.left(now) == pytest.approx(360, abs=1e-4)
    assert pace.lost == 0


def test_a_short_delay_is_made_good_at_twice_the_pace_and_not_in_a_burst() -> None:
    pace, now, steps = Pace(0.01, 1.0, now=0.0), 0.05, 0
    while pace.left(now) <= 0.005 + 1e-9:
        now += max(pace.left(now), 0.0)
        pace.stepped(now)
        steps += 1
    assert steps == 11 and now == pytest.approx(0.1)
    assert (pace.overruns, pace.lost) == (0, 0)


def test_after_a_stall_the_steps_go_on_from_now() -> None:
    pace = Pace(0.01, 1.0, now=0.0)
    stalled = 0.01 + STALL + 1.0
    pace.stepped(stalled)
    assert pace.overruns == 1 and pace.lost == pytest.approx(STALL + 1.0)
    for _ in range(10):
        stalled += pace.left(stalled)
        pace.stepped(stalled)
    assert stalled == pytest.approx(0.01 + STALL + 1.0 + 9 * 0.01)
    assert pace.overruns == 1


def test_a_factor_of_zero_never_waits() -> None:
    pace = Pace(0.01, 0, now=0.0)
    for now in (0.0, 0.001, 50.0):
        assert pace.left(now) <= 0
        pace.stepped(now)


def test_another_factor_holds_from_now_on_and_no_steps_are_rushed() -> None:
    pace = Pace(0.01, 0.001, now=0.0)
    pace.stepped(0.0)
    assert pace.left(0.0) == pytest.approx(10)
    pace.set_factor(2.0, now=5.0)
    assert (pace.left(5.0), pace.rtf, pace.lost) == (0, 2.0, 0)
    pace.stepped(5.0)
    assert pace.left(5.0) == pytest.approx(0.005)
    pace.set_factor(0.0, now=6.0)
    assert pace.left(6.0) == 0
