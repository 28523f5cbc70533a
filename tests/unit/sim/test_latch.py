"""The software stop: what it refuses, and that releasing it moves nothing by itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.sim.latch import MOST, Latch

STOPPED = "stopped: by ann@1; `holozen release` lets it drive again"
LET_GO = (
    "let go first: it commanded while the robot was stopped; send a stop or be silent for 0.5 s"
)  # fmt: skip


@pytest.fixture
def latch() -> Latch:
    return Latch(0.5)


def set_at(latch: Latch, now: float, driver: str = "") -> None:
    latch.set("ann@1", driver, now)


def test_a_robot_that_nobody_stopped_refuses_nothing(latch: Latch) -> None:
    assert latch.setter == ""
    assert latch.refusal("me", False, 0.0) == latch.refusal("me", True, 1e6) == ""


@pytest.mark.parametrize("stops", [True, False])
def test_while_it_holds_everything_is_refused_however_long(latch: Latch, stops: bool) -> None:
    set_at(latch, 1.0)
    assert latch.refusal("me", stops, 1.0) == latch.refusal("me", stops, 1e6) == STOPPED


def test_who_set_it_first_stays_its_setter_and_setting_it_again_changes_nothing(latch: Latch) -> None:
    set_at(latch, 1.0)
    latch.set("bob@2", "", 2.0)
    assert latch.setter == "ann@1"
    latch.release()
    assert latch.setter == ""


def test_a_setter_without_a_name_stops_it_too(latch: Latch) -> None:
    latch.set("", "", 1.0)
    assert latch.refusal("me", False, 2.0) == "stopped: by somebody; `holozen release` lets it drive again"


def test_after_the_release_a_source_that_goes_on_commanding_is_not_obeyed(latch: Latch) -> None:
    set_at(latch, 1.0)
    for step in range(1000):
        if step == 100:
            latch.release()
        assert latch.refusal("me", False, 2.0 + step * 0.05) == (STOPPED if step < 100 else LET_GO)


def test_it_is_obeyed_once_it_was_silent(latch: Latch) -> None:
    set_at(latch, 1.0)
    latch.refusal("me", False, 2.0)
    latch.release()
    assert latch.refusal("me", False, 2.5) == LET_GO
    assert latch.refusal("me", False, 3.01) == ""
    assert latch.refusal("me", False, 3.02) == ""


@pytest.mark.parametrize("released", [True, False])
def test_it_is_obeyed_once_it_sent_a_stop_also_while_the_latch_held(latch: Latch, released: bool) -> None:
    set_at(latch, 1.0)
    latch.refusal("me", False, 2.0)
    if released:
        latch.release()
    latch.refusal("me", True, 2.01)
    latch.release()
    assert latch.refusal("me", False, 2.02) == ""


def test_the_one_who_drove_has_to_let_go_too_though_it_said_nothing_meanwhile(latch: Latch) -> None:
    set_at(latch, 1.0, driver="me")
    latch.release()
    assert latch.refusal("me", False, 1.05) == LET_GO
    assert latch.refusal("me", False, 1.6) == ""


def test_right_after_the_stop_anybody_may_have_been_commanding(latch: Latch) -> None:
    set_at(latch, 1.0)
    latch.release()
    assert latch.refusal("me", False, 1.05) == LET_GO
    assert latch.refusal("late comer", False, 1.6) == ""


def test_a_source_that_begins_after_the_release_is_obeyed_at_once(latch: Latch) -> None:
    set_at(latch, 1.0)
    latch.release()
    assert latch.refusal("me", False, 2.0) == ""


def test_a_second_stop_does_not_forget_who_still_has_to_let_go(latch: Latch) -> None:
    set_at(latch, 1.0)
    latch.refusal("me", False, 2.0)
    latch.release()
    set_at(latch, 2.1)
    latch.release()
    assert latch.refusal("me", False, 2.3) == LET_GO


def test_where_the_watchdog_is_slow_the_silence_is_as_long() -> None:
    latch = Latch(2.0)
    set_at(latch, 1.0)
    latch.refusal("slow", False, 2.0)
    latch.release()
    assert latch.refusal("slow", False, 3.5).endswith("silent for 2 s")
    assert latch.refusal("slow", False, 5.6) == ""


def test_where_the_watchdog_is_off_only_a_stop_counts() -> None:
    latch = Latch(-1)
    set_at(latch, 1.0, driver="slow")
    latch.release()
    assert latch.refusal("slow", False, 1000.0).endswith("send a stop")
    assert latch.refusal("new", False, 1000.0) == ""
    assert latch.refusal("slow", True, 1001.0) == latch.refusal("slow", False, 1001.1) == ""


def test_the_robot_that_takes_its_place_is_stopped_as_well(latch: Latch) -> None:
    set_at(latch, 1.0)
    latch.refusal("me", False, 2.0)
    heir = Latch(0.5)
    heir.inherit(latch)
    assert heir.refusal("me", False, 2.1) == STOPPED
    heir.release()
    assert heir.refusal("me", False, 2.2) == LET_GO


def test_a_flood_of_names_takes_bounded_memory_and_lets_nobody_through(latch: Latch) -> None:
    set_at(latch, 1.0)
    for number in range(MOST + 10):
        latch.refusal(f"script {number}", False, 2.0)
    latch.release()
    assert len(latch._spoke) <= MOST
    for number in (0, MOST + 5):
        assert latch.refusal(f"script {number}", False, 2.3) == LET_GO
    assert latch.refusal("somebody else", False, 3.0) == ""


steps = st.tuples(
    st.sampled_from(["a", "b"]), st.sampled_from(["go", "stop"]), st.sampled_from([0.01, 0.2, 0.5, 0.51, 3.0])
)


@given(st.lists(steps, max_size=8), st.lists(steps, min_size=1, max_size=8))
def test_nobody_moves_the_robot_after_a_release_without_having_let_go(
    before: list[tuple[str, str, float]], after: list[tuple[str, str, float]]
) -> None:
    """Beside a plain record of what each source did: its last command that moves, and its stops."""
    latch, now = Latch(0.5), 10.0
    set_at(latch, now)
    last = {"a": now, "b": now}  # when each wanted to move, at the latest
    for index, (source, what, pause) in enumerate(before + after):
        now += pause
        if index == len(before):
            latch.release()
        refused = latch.refusal(source, what == "stop", now)
        let_go = what == "stop" or now - last[source] > 0.5
        assert bool(refused) == (index < len(before) or not let_go)
        last[source] = -100.0 if what == "stop" or not refused else now
        if index < len(before) and what == "go":
            last[source] = now


def test_with_a_longer_watchdog_a_source_has_to_be_silent_for_longer(latch: Latch) -> None:
    set_at(latch, 1.0)
    latch.refusal("me", False, 1.1)
    latch.wait_for(2.0)
    latch.release()
    assert "silent for 2 s" in latch.refusal("me", False, 3.0)
    assert latch.refusal("me", False, 5.1) == ""
