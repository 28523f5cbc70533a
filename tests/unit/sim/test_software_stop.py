"""The software stop: what it refuses, and that releasing it moves nothing by itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.command.arbiter import MAX_PER_RANK, SoftwareStop

RANK, PERSON = 4, 1
STOPPED = "stopped: by ann@1; `holozen release` lets it drive again"
LET_GO = (
    "let go first: it commanded while another drove or the robot was stopped; send a stop or be silent for 0.5 s"
)  # fmt: skip


@pytest.fixture
def stop() -> SoftwareStop:
    return SoftwareStop(0.5)


def set_at(stop: SoftwareStop, now: float, driver: str = "") -> None:
    stop.set("ann@1", (driver, RANK) if driver else None, now)


def test_a_robot_that_is_not_stopped_refuses_nothing(stop: SoftwareStop) -> None:
    assert stop.setter == ""
    assert stop.refusal("me", RANK, False, 0.0) == stop.refusal("me", RANK, True, 1e6) == ""


@pytest.mark.parametrize("stops", [True, False])
def test_while_it_holds_everything_is_refused_however_long(stop: SoftwareStop, stops: bool) -> None:
    set_at(stop, 1.0)
    assert stop.refusal("me", RANK, stops, 1.0) == stop.refusal("me", RANK, stops, 1e6) == STOPPED


def test_the_first_setter_remains_and_setting_it_again_changes_nothing(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    stop.set("bob@2", None, 2.0)
    assert stop.setter == "ann@1"
    stop.release(2.0)
    assert stop.setter == ""


def test_a_setter_without_a_name_stops_it_too(stop: SoftwareStop) -> None:
    stop.set("", None, 1.0)
    refusal = stop.refusal("me", RANK, False, 2.0)
    assert refusal == "stopped: by an unknown caller; `holozen release` lets it drive again"


def test_after_the_release_a_source_that_goes_on_commanding_is_not_obeyed(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    for step in range(1000):
        if step == 100:
            stop.release(2.0 + step * 0.05)
        assert stop.refusal("me", RANK, False, 2.0 + step * 0.05) == (STOPPED if step < 100 else LET_GO)


def test_it_is_obeyed_once_it_was_silent(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    stop.refusal("me", RANK, False, 2.0)
    stop.release(2.0)
    assert stop.refusal("me", RANK, False, 2.5) == LET_GO
    assert stop.refusal("me", RANK, False, 3.01) == ""
    assert stop.refusal("me", RANK, False, 3.02) == ""


@pytest.mark.parametrize("released", [True, False])
def test_it_is_obeyed_once_it_sent_a_stop_also_while_the_stop_was_set(stop: SoftwareStop, released: bool) -> None:
    set_at(stop, 1.0)
    stop.refusal("me", RANK, False, 2.0)
    if released:
        stop.release(2.0)
    stop.refusal("me", RANK, True, 2.01)
    stop.release(2.01)
    assert stop.refusal("me", RANK, False, 2.02) == ""


def test_the_driver_has_to_let_go_too_though_it_was_silent_during_the_stop(stop: SoftwareStop) -> None:
    set_at(stop, 1.0, driver="me")
    stop.release(1.0)
    assert stop.refusal("me", RANK, False, 1.05) == LET_GO
    assert stop.refusal("me", RANK, False, 1.6) == ""


def test_right_after_the_stop_any_source_may_have_been_commanding(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    stop.release(1.0)
    assert stop.refusal("me", RANK, False, 1.05) == LET_GO
    assert stop.refusal("late comer", RANK, False, 1.6) == ""


def test_a_source_that_begins_after_the_release_is_obeyed_at_once(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    stop.release(1.0)
    assert stop.refusal("me", RANK, False, 2.0) == ""


def test_a_second_stop_remembers_sources_that_still_have_to_let_go(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    stop.refusal("me", RANK, False, 2.0)
    stop.release(2.0)
    set_at(stop, 2.1)
    stop.release(2.1)
    assert stop.refusal("me", RANK, False, 2.3) == LET_GO


def test_a_slow_watchdog_means_an_equally_long_silence() -> None:
    stop = SoftwareStop(2.0)
    set_at(stop, 1.0)
    stop.refusal("slow", RANK, False, 2.0)
    stop.release(2.0)
    assert stop.refusal("slow", RANK, False, 3.5).endswith("silent for 2 s")
    assert stop.refusal("slow", RANK, False, 5.6) == ""


def test_where_the_watchdog_is_off_only_a_stop_counts() -> None:
    stop = SoftwareStop(-1)
    set_at(stop, 1.0, driver="slow")
    stop.release(1.0)
    assert stop.refusal("slow", RANK, False, 1000.0).endswith("send a stop")
    assert stop.refusal("new", RANK, False, 1000.0) == ""
    assert stop.refusal("slow", RANK, True, 1001.0) == stop.refusal("slow", RANK, False, 1001.1) == ""


def test_the_robot_that_takes_its_place_is_stopped_as_well(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    stop.refusal("me", RANK, False, 2.0)
    heir = SoftwareStop(0.5)
    heir.inherit(stop, 2.05)
    assert heir.refusal("me", RANK, False, 2.1) == STOPPED
    heir.release(2.1)
    assert heir.refusal("me", RANK, False, 2.2) == LET_GO


def test_when_it_takes_that_place_whoever_sent_no_stop_has_not_let_go(stop: SoftwareStop) -> None:
    """A source that commands every 0.4 s was not heard while the robot was gone."""
    set_at(stop, 1.0)
    stop.refusal("me", RANK, False, 1.4)
    stop.refusal("let go", RANK, True, 1.4)
    heir = SoftwareStop(0.5)
    heir.inherit(stop, 3.0)
    heir.release(3.0)
    assert heir.refusal("me", RANK, False, 3.2) == heir.refusal("new", RANK, False, 3.2) == LET_GO
    assert heir.refusal("let go", RANK, False, 3.2) == ""


def test_a_source_that_had_not_let_go_has_not_when_a_released_robot_is_spawned_again(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    stop.refusal("me", RANK, False, 1.5)
    stop.release(1.6)
    stop.refusal("let go", RANK, False, 1.3)
    stop.refusal("me", RANK, False, 1.7)
    stop.settle(1.9)  # the robot is gone
    heir = SoftwareStop(0.5)
    heir.inherit(stop, 3.0)  # whoever commanded until then may have gone on
    assert heir.refusal("me", RANK, False, 3.02) == LET_GO
    assert heir.refusal("let go", RANK, False, 3.02) == heir.refusal("new", RANK, False, 3.02) == ""


def test_a_flood_of_names_lets_no_one_of_its_rank_through_and_delays_no_one_of_another(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    for number in range(MAX_PER_RANK + 10):
        stop.refusal(f"script {number}", RANK, False, 2.0)
    stop.release(2.0)
    for number in (0, MAX_PER_RANK + 5):
        assert stop.refusal(f"script {number}", RANK, False, 2.3) == LET_GO
    assert stop.refusal("a fresh script", RANK, False, 2.3) == LET_GO
    assert stop.refusal("teleop", PERSON, False, 2.3) == ""
    assert stop.refusal("another fresh script", RANK, False, 3.0) == ""


steps = st.tuples(
    st.sampled_from(["a", "b"]), st.sampled_from(["go", "stop"]), st.sampled_from([0.01, 0.2, 0.5, 0.51, 3.0])
)


@given(st.lists(steps, max_size=8), st.lists(steps, min_size=1, max_size=8))
def test_no_source_moves_the_robot_after_a_release_without_having_let_go(
    before: list[tuple[str, str, float]], after: list[tuple[str, str, float]]
) -> None:
    """Beside a plain record of what each source did: its last command that moves, and its stops."""
    stop, now = SoftwareStop(0.5), 10.0
    set_at(stop, now)
    last = {"a": now, "b": now}  # when each wanted to move, at the latest
    for index, (source, what, pause) in enumerate(before + after):
        now += pause
        if index == len(before):
            stop.release(now)
        refused = stop.refusal(source, RANK, what == "stop", now)
        let_go = what == "stop" or now - last[source] > 0.5
        assert bool(refused) == (index < len(before) or not let_go)
        last[source] = -100.0 if what == "stop" or not refused else now
        if index < len(before) and what == "go":
            last[source] = now


def test_with_a_longer_watchdog_a_source_has_to_be_silent_for_longer(stop: SoftwareStop) -> None:
    set_at(stop, 1.0)
    stop.refusal("me", RANK, False, 1.1)
    stop.set_timeout(2.0)
    stop.release(1.1)
    assert "silent for 2 s" in stop.refusal("me", RANK, False, 3.0)
    assert stop.refusal("me", RANK, False, 5.1) == ""
