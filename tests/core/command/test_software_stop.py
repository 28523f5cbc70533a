"""The software stop: what it refuses, and that releasing it moves nothing by itself."""

import pytest

from holozen.command.arbiter import MAX_NAMES, Arbiter, Sent
from holozen.limits import STOP

RANK, PERSON = 4, 1
GO = (0.3, 0.0, 0.0)
STOPPED = "stopped: by ann@1; `holozen release` lets it drive again"
LET_GO = (
    "let go first: it commanded while another drove or the robot was stopped; let go of the keys, "
    "or send zeros or nothing for 0.5 s, then drive"
)


class Robot:
    """A robot that Ann has stopped at 1.0, and the refusals of those that command it."""

    def __init__(self, timeout: float | None = 0.5, driver: str = "") -> None:
        self.arbiter = Arbiter(timeout)
        if driver:
            self.arbiter.offer(driver, RANK, GO, 0.9)
        self.arbiter.stop("ann@1", 1.0)

    def go(self, source: str, now: float, rank: int = RANK, sent: Sent | None = None) -> str:
        """Command a motion. Returns why it is refused; each that is obeyed stops again at once."""
        reason = self.arbiter.offer(source, rank, GO, now, sent).reason
        if not reason:
            self.arbiter.begin(now)
        return reason

    def let_go(self, source: str, now: float) -> str:
        """Send a stop."""
        return self.arbiter.offer(source, RANK, STOP, now).reason

    def respawned(self, removed: float, spawned: float) -> "Robot":
        """The robot in its place."""
        self.arbiter.settle(removed)
        heir = Robot()
        heir.arbiter = Arbiter(0.5)
        heir.arbiter.inherit(self.arbiter, spawned)
        return heir


def test_while_it_holds_everything_is_refused_however_long() -> None:
    robot = Robot()
    for now in (1.0, 1e6):
        assert robot.go("me", now) == robot.let_go("me", now) == STOPPED


def test_the_first_setter_remains_and_setting_it_again_changes_nothing() -> None:
    robot = Robot()
    robot.arbiter.stop("bob@2", 2.0)
    assert robot.arbiter.stopped_by == "ann@1"
    robot.arbiter.release(2.0)
    assert robot.arbiter.stopped_by is None


def test_a_setter_without_a_name_stops_it_too() -> None:
    arbiter = Arbiter(0.5)
    arbiter.stop("", 1.0)
    refusal = arbiter.offer("me", RANK, GO, 2.0).reason
    assert refusal == "stopped: by an unknown caller; `holozen release` lets it drive again"


def test_after_the_release_a_source_that_goes_on_commanding_is_not_obeyed() -> None:
    robot = Robot()
    for step in range(1000):
        if step == 100:
            robot.arbiter.release(2.0 + step * 0.05)
        assert robot.go("me", 2.0 + step * 0.05) == (STOPPED if step < 100 else LET_GO)


def test_it_is_obeyed_once_it_was_silent() -> None:
    robot = Robot()
    robot.go("me", 2.0)
    robot.arbiter.release(2.0)
    assert robot.go("me", 2.5) == LET_GO
    assert robot.go("me", 3.01) == ""
    assert robot.go("me", 3.02) == ""


@pytest.mark.parametrize("released", [True, False])
def test_it_is_obeyed_once_it_sent_a_stop_also_while_the_stop_was_set(released: bool) -> None:
    robot = Robot()
    robot.go("me", 2.0)
    if released:
        robot.arbiter.release(2.0)
    robot.let_go("me", 2.01)
    robot.arbiter.release(2.01)
    assert robot.go("me", 2.02) == ""


def test_a_motion_sent_after_that_stop_and_before_the_release_binds_it_again_however_late_it_comes() -> (  # noqa: E501
    None
):
    robot = Robot()
    robot.go("me", 1.1)
    robot.let_go("me", 1.2)
    robot.arbiter.release(2.0)
    assert robot.go("me", 2.3, sent=Sent(1.9, 1.9, 0.0)) == LET_GO
    assert robot.go("me", 2.35, sent=Sent(2.3, 2.3, 0.0)) == LET_GO
    robot.let_go("me", 2.4)
    assert robot.go("me", 2.45, sent=Sent(2.4, 2.4, 0.0)) == ""


def test_so_it_does_where_the_motions_of_that_time_are_missing() -> None:
    robot = Robot()
    robot.let_go("me", 1.2)
    robot.arbiter.release(2.0)
    assert robot.go("me", 2.3, sent=Sent(at=2.25, unheard=1.2, silence=0.0)) == LET_GO


def test_the_driver_has_to_let_go_too_though_it_was_silent_during_the_stop() -> None:
    robot = Robot(driver="me")
    robot.arbiter.release(1.0)
    assert robot.go("me", 1.05) == LET_GO
    assert robot.go("me", 1.6) == ""


def test_a_source_that_begins_after_the_release_is_obeyed_at_once() -> None:
    robot = Robot()
    robot.arbiter.release(1.0)
    assert robot.go("me", 1.01) == ""


def test_a_second_stop_remembers_sources_that_still_have_to_let_go() -> None:
    robot = Robot()
    robot.go("me", 2.0)
    robot.arbiter.release(2.0)
    robot.arbiter.stop("ann@1", 2.1)
    robot.arbiter.release(2.1)
    assert robot.go("me", 2.3) == LET_GO


def test_a_slow_watchdog_means_an_equally_long_silence() -> None:
    robot = Robot(2.0)
    robot.go("slow", 2.0)
    robot.arbiter.release(2.0)
    assert robot.go("slow", 3.5).endswith("or nothing for 2 s, then drive")
    assert robot.go("slow", 5.6) == ""


def test_where_the_watchdog_is_off_only_a_stop_counts() -> None:
    robot = Robot(None)
    robot.go("slow", 1.1)
    robot.arbiter.release(1.2)
    assert robot.go("slow", 1000.0).endswith("or send zeros, then drive")
    assert robot.go("new", 1000.0) == ""
    assert robot.let_go("slow", 1001.0) == robot.go("slow", 1001.1) == ""


def test_the_robot_that_takes_its_place_is_stopped_as_well() -> None:
    robot = Robot()
    robot.go("me", 2.0)
    heir = robot.respawned(2.02, 2.05)
    assert heir.go("me", 2.1) == STOPPED
    heir.arbiter.release(2.1)
    assert heir.go("me", 2.2) == LET_GO


def test_a_source_that_had_not_let_go_has_not_when_the_robot_is_spawned_again() -> None:
    """A source that commands every 0.4 s was not heard while the robot was gone."""
    robot = Robot()
    robot.go("me", 1.5)
    robot.let_go("let go", 1.5)
    robot.go("silent", 1.1)
    heir = robot.respawned(1.8, 3.0)
    heir.arbiter.release(3.0)
    assert heir.go("me", 3.02) == LET_GO
    assert heir.go("let go", 3.02) == heir.go("silent", 3.03) == heir.go("new", 3.04) == ""


def test_a_flood_of_names_lets_no_one_of_its_rank_through_and_delays_no_one_of_another() -> None:
    robot = Robot()
    for number in range(MAX_NAMES + 10):
        robot.go(f"script {number}", 2.0)
    robot.arbiter.release(2.0)
    for number in (0, MAX_NAMES + 5):
        assert robot.go(f"script {number}", 2.3) == LET_GO
    assert robot.go("a fresh script", 2.3) == LET_GO
    assert robot.go("teleop", 2.3, PERSON) == ""
    robot.arbiter.resume(2.4)
    assert robot.go("another fresh script", 3.0) == ""


def test_with_a_longer_watchdog_a_source_has_to_be_silent_for_longer() -> None:
    robot = Robot()
    robot.go("me", 1.1)
    robot.arbiter.set_velocity_timeout(2.0, 1.1)
    robot.arbiter.release(1.1)
    assert "nothing for 2 s" in robot.go("me", 3.0)
    assert robot.go("me", 5.1) == ""
