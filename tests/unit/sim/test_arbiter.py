"""The arbiter: each rule of the wire's priorities as a sentence, and all of them against any sequence of commands."""

import math

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from holozen.command.arbiter import AUTOPILOT, MAX_HELD, MAX_PER_RANK, Arbiter, Driver, Sent
from holozen.command.motion import JointMotion, Motion
from holozen.limits import STOP, Planar
from holozen.transport.samples import PRIORITIES

FORWARD: Planar = (0.3, 0.0, 0.0)
LEFT: Planar = (0.0, 0.3, 0.0)
HELD = "held: another source took over; `holozen controller --resume` lets it drive again"
PERSON, SCRIPT, CONTROLLER, BACKGROUND = (
    PRIORITIES.index(name) for name in ("INTERACTIVE_HIGH", "DATA", "DATA_LOW", "BACKGROUND")
)


@pytest.fixture
def arbiter() -> Arbiter:
    return Arbiter(timeout=0.5)


def drives(arbiter: Arbiter, now: float) -> str:
    driver = arbiter.driver(now)
    return driver.source if driver else ""


def test_an_autopilot_is_what_sends_with_low_priority() -> None:
    assert AUTOPILOT == CONTROLLER


def test_no_source_outranks_a_person(arbiter: Arbiter) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.offer("hurry", PRIORITIES.index("REAL_TIME"), LEFT, 1.1) == "overruled: teleop drives"
    assert arbiter.offer("hurry", PRIORITIES.index("REAL_TIME"), LEFT, 2.0) == ""
    assert arbiter.offer("teleop", PERSON, STOP, 2.1) == ""
    assert arbiter.motion(2.1) == STOP


def test_without_a_command_the_robot_stands(arbiter: Arbiter) -> None:
    assert arbiter.motion(0) == STOP
    assert arbiter.driver(0) is None
    assert not arbiter.held


def test_a_command_is_obeyed_at_once(arbiter: Arbiter) -> None:
    assert arbiter.offer("teleop", PERSON, FORWARD, 1.0) == ""
    assert arbiter.motion(1.0) == FORWARD


def test_a_longer_watchdog_does_not_wake_a_command_that_was_over(arbiter: Arbiter) -> None:
    arbiter.offer("script", SCRIPT, FORWARD, 1.0)
    arbiter.set_timeout(2.0, now=1.6)
    assert (arbiter.motion(1.6), arbiter.driver(1.6)) == (STOP, None)
    arbiter.offer("script", SCRIPT, FORWARD, 2.0)
    assert (arbiter.motion(3.9), arbiter.motion(4.1)) == (FORWARD, STOP)


def test_a_shorter_watchdog_stops_a_robot_without_fresh_commands(arbiter: Arbiter) -> None:
    arbiter.offer("script", SCRIPT, FORWARD, 1.0)
    arbiter.set_timeout(0.1, now=1.05)
    assert (arbiter.motion(1.09), arbiter.motion(1.11)) == (FORWARD, STOP)


def test_a_stop_is_obeyed_at_once(arbiter: Arbiter) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.offer("teleop", PERSON, STOP, 1.01) == ""
    assert arbiter.motion(1.01) == STOP


def test_after_half_a_second_of_silence_the_robot_stands(arbiter: Arbiter) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.motion(1.5) == FORWARD
    assert arbiter.motion(1.5 + 1e-6) == STOP
    assert arbiter.driver(1.5 + 1e-6) is None


def test_a_fresh_command_keeps_the_robot_going(arbiter: Arbiter) -> None:
    for now in (1.0, 1.4, 1.8):
        arbiter.offer("teleop", PERSON, FORWARD, now)
    assert arbiter.motion(2.2) == FORWARD


@pytest.mark.parametrize(("low", "high"), [(CONTROLLER, SCRIPT), (CONTROLLER, PERSON), (SCRIPT, PERSON)])
def test_a_higher_source_takes_the_robot_while_the_lower_one_drives(arbiter: Arbiter, low: int, high: int) -> None:
    arbiter.offer("low", low, FORWARD, 1.0)
    assert arbiter.offer("high", high, LEFT, 1.1) == ""
    assert arbiter.motion(1.1) == LEFT
    assert arbiter.offer("low", low, FORWARD, 1.2) == "overruled: high drives"
    assert arbiter.motion(1.2) == LEFT


@pytest.mark.parametrize("rank", [SCRIPT, CONTROLLER])
def test_among_equals_the_one_that_drives_goes_on_while_it_is_fresh(arbiter: Arbiter, rank: int) -> None:
    arbiter.offer("first", rank, FORWARD, 1.0)
    assert arbiter.offer("second", rank, LEFT, 1.1) == "overruled: first drives"
    assert arbiter.motion(1.1) == FORWARD
    assert arbiter.offer("second", rank, LEFT, 1.6) == ""
    assert arbiter.motion(1.6) == LEFT


def test_a_person_whom_another_overruled_drives_only_after_letting_go(arbiter: Arbiter) -> None:
    def both(first: Motion, begin: int, end: int) -> str:
        """Both command at 10 Hz, from and until these tenths of a second. Returns the last refusal of the second."""
        for tenth in range(begin, end):
            arbiter.offer("first", PERSON, first, tenth / 10)
            reason = arbiter.offer("second", PERSON, LEFT, tenth / 10 + 0.05)
        return reason

    assert both(FORWARD, 10, 20).startswith("let go first: it commanded while another drove")
    assert both(STOP, 20, 30).startswith("let go first"), "a latched key does not drive once the robot is free"
    assert arbiter.motion(3.0) == STOP
    assert arbiter.offer("second", PERSON, STOP, 3.05) == arbiter.offer("second", PERSON, LEFT, 3.6) == ""
    assert arbiter.offer("first", PERSON, STOP, 3.65) == ""
    assert arbiter.offer("second", PERSON, LEFT, 4.2) == HELD
    assert arbiter.resume(4.3) == ""
    assert arbiter.offer("second", PERSON, LEFT, 4.4).startswith("let go first"), "resume is meant for others"
    assert arbiter.offer("second", PERSON, LEFT, 5.0) == "", "it was silent"


def test_a_person_whom_another_stopped_does_not_drive_on_after_a_quick_resume(arbiter: Arbiter) -> None:
    arbiter.offer("first", PERSON, FORWARD, 1.0)
    arbiter.offer("second", PERSON, STOP, 1.05)
    arbiter.offer("first", PERSON, FORWARD, 1.1)
    assert arbiter.resume(1.2) == ""
    assert arbiter.offer("first", PERSON, FORWARD, 1.25).startswith("let go first")
    assert arbiter.offer("first", PERSON, STOP, 1.3) == arbiter.offer("first", PERSON, FORWARD, 1.35) == ""


def test_a_person_whose_late_commands_were_refused_while_another_drove_lets_go_too(arbiter: Arbiter) -> None:
    arbiter.offer("first", PERSON, FORWARD, 1.0)
    arbiter.note_refused("second", PERSON, 1.2)
    arbiter.offer("first", PERSON, STOP, 1.3)
    arbiter.note_refused("second", PERSON, 1.6)
    assert arbiter.offer("second", PERSON, LEFT, 1.9).startswith("let go first")
    arbiter.offer("script", SCRIPT, FORWARD, 3.0)
    arbiter.note_refused("third", PERSON, 3.1)
    assert arbiter.offer("third", PERSON, LEFT, 3.2) == "", "only people let go of each other"


@pytest.mark.parametrize("timeout", [0.5, -1.0])
def test_a_flood_of_people_does_not_lock_out_the_one_who_drives(timeout: float) -> None:
    arbiter = Arbiter(timeout)
    for number in range(3 * MAX_PER_RANK):
        arbiter.offer("first", PERSON, FORWARD, 1.0)
        assert arbiter.offer(f"forged {number}", PERSON, LEFT, 1.0)
    assert arbiter.offer("first", PERSON, LEFT, 1.1) == ""


@pytest.mark.parametrize(("rank", "stopper"), [(PERSON, PERSON), (SCRIPT, SCRIPT), (CONTROLLER, CONTROLLER),
                                                (SCRIPT, PERSON)])  # fmt: skip
def test_an_equal_or_higher_source_may_stop_the_robot_and_it_stays_stopped(
    arbiter: Arbiter, rank: int, stopper: int
) -> None:
    arbiter.offer("first", rank, FORWARD, 1.0)
    assert arbiter.offer("second", stopper, STOP, 1.1) == ""
    assert arbiter.motion(1.1) == STOP
    for now in (1.2, 9.0):
        assert arbiter.offer("first", rank, FORWARD, now)
        assert arbiter.motion(now) == STOP
    assert arbiter.resume(9.1) == ""
    assert arbiter.offer("first", rank, FORWARD, 9.7) == ""


@pytest.mark.parametrize("low", [SCRIPT, CONTROLLER])
def test_a_lower_source_may_not_even_stop_the_robot(arbiter: Arbiter, low: int) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.offer("low", low, STOP, 1.1) == "overruled: teleop drives"
    assert arbiter.motion(1.1) == FORWARD


def test_a_held_source_may_stop_the_robot_but_not_drive_it(arbiter: Arbiter) -> None:
    arbiter.offer("script", SCRIPT, FORWARD, 1.0)
    arbiter.offer("teleop", PERSON, STOP, 1.1)
    arbiter.offer("another script", SCRIPT, FORWARD, 2.0)
    for now in (2.1, 2.2):  # a stop is repeated
        assert arbiter.offer("script", SCRIPT, STOP, now) == ""
        assert arbiter.motion(now) == STOP
    assert arbiter.offer("script", SCRIPT, FORWARD, 2.3) == HELD


def test_a_command_is_as_old_as_it_may_have_waited(arbiter: Arbiter) -> None:
    assert arbiter.offer("teleop", PERSON, FORWARD, now=1.0, sent=Sent(0.7, math.inf)) == ""
    assert arbiter.motion(1.2) == FORWARD
    assert arbiter.motion(1.2 + 1e-6) == STOP


def test_a_stop_of_any_age_stops_the_robot(arbiter: Arbiter) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.offer("teleop", PERSON, STOP, now=1.1, sent=Sent(-math.inf, math.inf)) == ""
    assert arbiter.motion(1.1) == STOP


@pytest.mark.parametrize("low", [SCRIPT, CONTROLLER])
def test_an_overruled_source_does_not_get_the_robot_back_by_waiting(arbiter: Arbiter, low: int) -> None:
    arbiter.offer("low", low, FORWARD, 1.0)
    arbiter.offer("teleop", PERSON, LEFT, 1.1)
    for now in (2.0, 60.0, 3600.0):
        assert arbiter.offer("low", low, FORWARD, now) == HELD
        assert arbiter.motion(now) == STOP
    assert arbiter.held


def test_a_script_that_spoke_while_a_person_drove_is_held_too(arbiter: Arbiter) -> None:
    arbiter.offer("teleop", PERSON, LEFT, 1.0)
    arbiter.offer("script", SCRIPT, FORWARD, 1.1)
    assert arbiter.offer("script", SCRIPT, FORWARD, 5.0) == HELD


def test_what_lets_a_held_source_drive_again_names_the_robot() -> None:
    arbiter = Arbiter(timeout=0.5, robot="Fred")
    arbiter.offer("teleop", PERSON, LEFT, 1.0)
    reason = arbiter.offer("controller", CONTROLLER, FORWARD, 9.0)
    assert reason == HELD.replace("controller", "controller Fred")


def test_a_script_that_is_started_after_the_person_let_go_is_obeyed(arbiter: Arbiter) -> None:
    arbiter.offer("teleop", PERSON, LEFT, 1.0)
    assert arbiter.offer("script", SCRIPT, FORWARD, 2.0) == ""


@pytest.mark.parametrize("above", [PERSON, SCRIPT])
def test_no_autopilot_takes_a_robot_that_others_drove_not_even_a_new_one(arbiter: Arbiter, above: int) -> None:
    arbiter.offer("teleop", above, LEFT, 1.0)
    assert arbiter.held
    assert arbiter.offer("controller", CONTROLLER, FORWARD, 9.0) == HELD
    assert arbiter.motion(9.0) == STOP


def test_the_autopilot_itself_may_fall_silent_and_go_on(arbiter: Arbiter) -> None:
    arbiter.offer("controller", CONTROLLER, FORWARD, 1.0)
    assert arbiter.offer("controller", CONTROLLER, FORWARD, 9.0) == ""
    assert arbiter.offer("another controller", CONTROLLER, FORWARD, 19.0) == ""
    assert not arbiter.held


def test_a_source_below_the_autopilot_neither_drives_nor_makes_it_yield(arbiter: Arbiter) -> None:
    arbiter.offer("controller", CONTROLLER, FORWARD, 1.0)
    assert arbiter.offer("recorder", BACKGROUND, LEFT, 1.1) == "overruled: controller drives"
    assert arbiter.offer("recorder", BACKGROUND, LEFT, 9.0) == HELD
    assert not arbiter.held


def test_after_resume_a_held_source_drives_again(arbiter: Arbiter) -> None:
    arbiter.offer("script", SCRIPT, FORWARD, 1.0)
    arbiter.offer("teleop", PERSON, STOP, 1.1)
    assert arbiter.resume(1.2) == ""
    assert not arbiter.held
    assert arbiter.resumed == 1
    assert arbiter.offer("controller", CONTROLLER, FORWARD, 1.3) == ""
    assert arbiter.offer("script", SCRIPT, LEFT, 1.4) == ""


def test_resume_is_refused_while_a_person_moves_the_robot(arbiter: Arbiter) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.resume(1.1) == "teleop drives; stop first"
    assert arbiter.resumed == 0
    assert arbiter.offer("controller", CONTROLLER, LEFT, 2.0) == HELD
    assert arbiter.resume(2.1) == ""


def test_it_knows_when_a_source_last_made_others_wait(arbiter: Arbiter) -> None:
    assert arbiter.taken_at == -math.inf
    arbiter.offer("controller", CONTROLLER, FORWARD, 1.0)
    arbiter.resume(1.1)
    assert arbiter.taken_at == -math.inf, "an autopilot that drives alone"
    arbiter.offer("teleop", PERSON, STOP, 1.2)
    assert arbiter.taken_at == 1.2, "a person stops it"
    arbiter.offer("teleop", PERSON, STOP, 1.3)
    assert arbiter.taken_at == 1.2, "a person who goes on sending zeros holds up no resume"
    arbiter.offer("teleop", PERSON, FORWARD, 1.4)
    arbiter.offer("teleop", PERSON, FORWARD, 1.5)
    arbiter.offer("controller", CONTROLLER, FORWARD, 1.6)
    assert arbiter.taken_at == 1.5, "a person drives"
    assert arbiter.stopped_at == -math.inf
    arbiter.stop("person", 2.0)
    arbiter.stop("person", 3.0)
    assert (arbiter.taken_at, arbiter.stopped_at) == (3.0, 3.0), "a stop is set, and set again"
    other = Arbiter(timeout=0.5)
    other.inherit(arbiter, 4.0)
    assert (other.taken_at, other.stopped_at) == (3.0, 3.0)


def test_resume_leaves_an_autopilot_that_drives_at_the_wheel(arbiter: Arbiter) -> None:
    arbiter.offer("controller", CONTROLLER, FORWARD, 1.0)
    assert arbiter.resume(1.1) == ""
    assert drives(arbiter, 1.1) == "controller"
    assert arbiter.motion(1.1) == FORWARD


def test_a_timeout_of_zero_obeys_for_one_moment(arbiter: Arbiter) -> None:
    arbiter = Arbiter(timeout=0)
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.motion(1.0) == FORWARD
    assert arbiter.motion(1.0 + 1e-9) == STOP


class TestWithoutATimeout:
    """`cmdTimeout` -1, as in Gazebo: a silent source is obeyed until another one speaks."""

    @pytest.fixture
    def arbiter(self) -> Arbiter:
        return Arbiter(timeout=-1)

    def test_a_silent_source_is_obeyed_for_ever(self, arbiter: Arbiter) -> None:
        arbiter.offer("teleop", PERSON, FORWARD, 1.0)
        assert arbiter.motion(1e6) == FORWARD

    def test_a_second_teleop_can_stop_what_a_dead_one_left_driving(self, arbiter: Arbiter) -> None:
        arbiter.offer("dead teleop", PERSON, FORWARD, 1.0)
        assert arbiter.offer("teleop", PERSON, STOP, 1.1) == ""
        assert arbiter.motion(9.0) == STOP

    def test_a_second_teleop_can_drive_what_a_dead_one_left_driving(self, arbiter: Arbiter) -> None:
        arbiter.offer("dead teleop", PERSON, FORWARD, 1.0)
        assert arbiter.offer("teleop", PERSON, LEFT, 1.4) == "overruled: dead teleop drives"
        assert arbiter.offer("teleop", PERSON, STOP, 1.9) == arbiter.offer("teleop", PERSON, LEFT, 2.0) == ""
        assert arbiter.motion(2.0) == LEFT

    def test_a_person_is_not_locked_out_by_another_source_that_drove_during_their_silence(
        self, arbiter: Arbiter
    ) -> None:
        arbiter.offer("teleop", PERSON, STOP, 1.0)
        assert arbiter.offer("script", SCRIPT, FORWARD, 9.0) == ""
        assert arbiter.offer("teleop", PERSON, STOP, 9.1) == ""
        assert arbiter.motion(9.1) == STOP

    def test_an_autopilot_still_waits_for_resume(self, arbiter: Arbiter) -> None:
        arbiter.offer("teleop", PERSON, STOP, 1.0)
        assert arbiter.offer("controller", CONTROLLER, FORWARD, 9.0) == HELD
        assert arbiter.resume(9.1) == ""
        assert arbiter.offer("controller", CONTROLLER, FORWARD, 9.2) == ""


@pytest.mark.parametrize("rank", [SCRIPT, BACKGROUND])
def test_a_flood_of_names_holds_its_own_rank_and_no_higher_one_and_frees_no_one(arbiter: Arbiter, rank: int) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    for number in range(12 * MAX_HELD):
        assert arbiter.offer(f"forged {number}", rank, LEFT, 1.1) == "overruled: teleop drives"
    assert arbiter.motion(1.1) == FORWARD
    for source in ("forged 0", f"forged {MAX_HELD + 5}", "never heard of"):
        assert arbiter.offer(source, rank, LEFT, 9.0) == HELD
    for now, source in ((9.0, "teleop"), (10.0, "another teleop")):
        assert not arbiter.holds(source, PERSON, now)
        assert arbiter.offer(source, PERSON, FORWARD, now) == ""
    assert arbiter.resume(11.0) == ""
    assert arbiter.offer("never heard of", rank, LEFT, 11.0) == ""


def test_a_name_that_is_forged_at_a_lower_rank_neither_holds_nor_replaces_its_owner(arbiter: Arbiter) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.offer("teleop", BACKGROUND, LEFT, 1.1) == "overruled: teleop drives"
    assert arbiter.offer("teleop", BACKGROUND, STOP, 1.1) == "overruled: teleop drives"
    assert arbiter.motion(1.1) == FORWARD
    assert arbiter.offer("teleop", PERSON, LEFT, 1.2) == ""


def test_of_equals_that_fill_the_table_with_stops_the_last_one_drives_on(arbiter: Arbiter) -> None:
    arbiter.offer("script", SCRIPT, FORWARD, 1.0)
    for number in range(2 * MAX_HELD):
        assert arbiter.offer(f"stopper {number}", SCRIPT, STOP, 1.0) == ""
    last = f"stopper {2 * MAX_HELD - 1}"
    assert arbiter.offer("script", SCRIPT, FORWARD, 1.0) != ""
    assert arbiter.offer(last, SCRIPT, FORWARD, 1.0) == ""
    assert not arbiter.holds("teleop", PERSON, 1.0)


class TestSoftwareStop:
    """`stop` and `release`; the rules of letting go are those of the software_stop."""

    def test_the_robot_stands_at_once_and_whatever_is_commanded(self, arbiter: Arbiter) -> None:
        arbiter.offer("teleop", PERSON, FORWARD, 1.0)
        arbiter.stop("ann@1", 1.1)
        assert arbiter.motion(1.1) == STOP
        for rank in (0, PERSON, SCRIPT, CONTROLLER, BACKGROUND):
            assert arbiter.offer(f"source {rank}", rank, LEFT, 1.2).startswith("stopped: by ann@1; ")
            assert arbiter.motion(1.2) == STOP
        assert arbiter.driver(1.2) is None

    @pytest.mark.parametrize("timeout", [0.5, 5.0, -1])
    def test_releasing_it_moves_nothing(self, timeout: float) -> None:
        arbiter = Arbiter(timeout)
        arbiter.offer("script", SCRIPT, FORWARD, 1.0)
        arbiter.stop("ann@1", 1.1)
        arbiter.release(1.1)
        assert arbiter.motion(1.2) == STOP
        assert arbiter.offer("script", SCRIPT, FORWARD, 1.3).startswith("let go first: ")
        assert arbiter.offer("script", SCRIPT, STOP, 1.4) == ""
        assert arbiter.offer("script", SCRIPT, FORWARD, 1.5) == ""

    def test_an_autopilot_waits_for_resume_besides(self, arbiter: Arbiter) -> None:
        arbiter.offer("controller", CONTROLLER, FORWARD, 1.0)
        arbiter.stop("ann@1", 1.1)
        assert arbiter.held
        arbiter.release(1.1)
        assert arbiter.offer("controller", CONTROLLER, FORWARD, 9.0) == HELD
        assert arbiter.resume(9.1) == ""
        assert arbiter.offer("controller", CONTROLLER, FORWARD, 9.2) == ""

    def test_resume_does_not_make_up_for_letting_go(self, arbiter: Arbiter) -> None:
        arbiter.stop("ann@1", 1.0)
        arbiter.offer("controller", CONTROLLER, FORWARD, 2.0)
        arbiter.release(2.0)
        assert arbiter.resume(2.1) == ""
        assert arbiter.offer("controller", CONTROLLER, FORWARD, 2.2).startswith("let go first: ")
        assert arbiter.offer("controller", CONTROLLER, FORWARD, 2.8) == ""

    def test_resume_is_refused_while_it_holds(self, arbiter: Arbiter) -> None:
        arbiter.stop("ann@1", 1.0)
        assert arbiter.resume(2.0) == "stopped: by ann@1; `holozen release` lets it drive again"
        assert (arbiter.resumed, arbiter.held) == (0, True)

    def test_a_joint_that_was_moved_stands_too(self, arbiter: Arbiter) -> None:
        arbiter.offer("script", SCRIPT, JointMotion("position", (("arm", 1.0),)), 1.0)
        arbiter.stop("ann@1", 1.1)
        assert arbiter.motion(1.1) == STOP
        assert arbiter.offer("script", SCRIPT, JointMotion("position", (("arm", 1.0),)), 1.2).startswith("stopped: ")

    def test_the_robot_in_the_place_of_a_stopped_one_is_stopped(self, arbiter: Arbiter) -> None:
        arbiter.stop("ann@1", 1.0)
        heir = Arbiter(0.5)
        heir.inherit(arbiter, 8.0)
        assert heir.offer("teleop", PERSON, FORWARD, 9.0).startswith("stopped: by ann@1; ")


class TestLostOperator:
    """The process behind a source is gone."""

    def test_the_robot_that_it_drove_stands_at_once(self, arbiter: Arbiter) -> None:
        arbiter.offer("teleop", PERSON, FORWARD, 1.0)
        arbiter.forget("teleop")
        assert arbiter.motion(1.0) == STOP

    @pytest.mark.parametrize("motion", [FORWARD, JointMotion("velocity", (("arm", 1.0),))])
    def test_so_it_does_where_the_watchdog_is_off(self, motion: Motion) -> None:
        arbiter = Arbiter(-1)
        arbiter.offer("teleop", PERSON, motion, 1.0)
        arbiter.forget("teleop")
        assert arbiter.motion(1.0) == arbiter.motion(1e6) == STOP

    def test_the_loss_of_a_foreign_node_changes_nothing(self, arbiter: Arbiter) -> None:
        arbiter.forget("foreign")
        arbiter.offer("teleop", PERSON, FORWARD, 1.0)
        arbiter.forget("foreign")
        assert arbiter.motion(1.1) == FORWARD

    def test_no_other_source_gets_the_robot_any_sooner_for_it(self, arbiter: Arbiter) -> None:
        """A name can be forged: what a loss does may only stop the robot."""
        arbiter.offer("first", SCRIPT, FORWARD, 1.0)
        arbiter.forget("first")
        assert arbiter.offer("second", SCRIPT, LEFT, 1.1) == "overruled: first drives"
        assert arbiter.motion(1.1) == STOP
        assert arbiter.offer("second", SCRIPT, LEFT, 1.6) == ""

    def test_a_source_that_comes_back_is_obeyed_as_usual(self, arbiter: Arbiter) -> None:
        arbiter.offer("teleop", PERSON, FORWARD, 1.0)
        arbiter.forget("teleop")
        assert arbiter.offer("teleop", PERSON, LEFT, 1.1) == ""
        assert arbiter.motion(1.1) == LEFT

    def test_the_loss_of_a_person_frees_no_autopilot_and_holds_up_no_resume(self, arbiter: Arbiter) -> None:
        arbiter.offer("teleop", PERSON, FORWARD, 1.0)
        arbiter.forget("teleop")
        assert arbiter.offer("controller", CONTROLLER, LEFT, 9.0) == HELD
        assert arbiter.resume(9.0) == ""


@pytest.mark.parametrize(("rank", "holds"), [(SCRIPT, False), (CONTROLLER, True)])
def test_a_source_that_has_to_wait_is_held(arbiter: Arbiter, rank: int, holds: bool) -> None:
    arbiter.offer("teleop", PERSON, FORWARD, 1.0)
    assert arbiter.holds("me", rank, 9.0) == holds
    arbiter.stop("ann@1", 10.0)
    assert arbiter.holds("me", rank, 10.1)


SOURCES = {"teleop": PERSON, "second teleop": PERSON, "script": SCRIPT, "another script": SCRIPT,
           "controller": CONTROLLER, "second controller": CONTROLLER, "recorder": BACKGROUND}  # fmt: skip


class Robot(RuleBasedStateMachine):
    """Any commands from any sources, pauses, stops, losses and resumes, beside a record of each source's replies."""

    timeout = 0.5

    def __init__(self) -> None:
        super().__init__()
        self.arbiter = Arbiter(self.timeout)
        self.now = 0.0
        self.heard = dict.fromkeys(SOURCES, -1000000000.0)  # when each was last obeyed
        self.commanded: dict[str, Planar] = {}  # and what it had commanded
        self.lost: set[str] = set()  # sources that were overruled by a higher one since the last resume

    @rule(seconds=st.sampled_from([0.05, 0.3, 0.5, 0.500001, 10.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds

    @rule(source=st.sampled_from(sorted(SOURCES)), velocity=st.sampled_from([STOP, FORWARD, LEFT]))
    def speak(self, source: str, velocity: Planar) -> None:
        before = self.arbiter.driver(self.now)
        waits = (
            self.arbiter.software_stop.must_let_go(source, SOURCES[source], Sent(self.now, self.now))
            and velocity != STOP
        )
        refused = self.arbiter.offer(source, SOURCES[source], velocity, self.now)
        after = self.arbiter.driver(self.now)
        if self.arbiter.software_stop.setter or waits:
            assert refused.startswith("stopped: " if self.arbiter.software_stop.setter else "let go first: ")
            assert after == before
            return
        if not refused:
            assert after is not None
            assert (after.source, after.motion, after.sent) == (source, velocity, self.now)
            assert source not in self.lost or velocity == STOP
            self.heard[source], self.commanded[source] = self.now, velocity
        else:
            assert after == before
        if before and before.source != source:
            self.speak_against(before, source, velocity, bool(refused))
        elif before:
            assert bool(refused) == (source in self.lost and velocity != STOP)

    def speak_against(self, driver: Driver, source: str, velocity: Planar, refused: bool) -> None:
        """Send commands while another source drives: a higher priority takes over, an equal one may only stop."""
        rank = SOURCES[source]
        stops = velocity == STOP and rank <= driver.rank
        assert refused == (not stops and (rank >= driver.rank or source in self.lost))
        if rank > driver.rank:
            self.lost.add(source)
        elif not refused:
            self.lost.add(driver.source)

    @rule()
    def resume(self) -> None:
        driver = self.arbiter.driver(self.now)
        refused = self.arbiter.resume(self.now)
        driven = driver and driver.rank < AUTOPILOT and driver.motion != STOP
        assert bool(refused) == bool(driven or self.arbiter.software_stop.setter)
        if not refused:
            self.lost.clear()
            assert not self.arbiter.held

    @rule()
    def stop(self) -> None:
        self.arbiter.stop("ann", self.now)
        assert self.arbiter.motion(self.now) == STOP
        assert self.arbiter.held

    @rule()
    def release(self) -> None:
        before = self.arbiter.motion(self.now)
        self.arbiter.release(self.now)
        assert self.arbiter.motion(self.now) == before

    @rule(source=st.sampled_from(sorted(SOURCES)))
    def lose(self, source: str) -> None:
        before = self.arbiter.driver(self.now)
        self.arbiter.forget(source)
        after = self.arbiter.driver(self.now)
        if before and before.source == source:
            self.commanded[source] = STOP
        assert (before and before.source) == (after and after.source)

    @invariant()
    def a_stopped_robot_stands(self) -> None:
        assert not self.arbiter.software_stop.setter or self.arbiter.driver(self.now) is None

    @invariant()
    def the_robot_does_what_its_one_driver_said_last(self) -> None:
        driver = self.arbiter.driver(self.now)
        if driver is None:
            assert self.arbiter.motion(self.now) == STOP
        else:
            assert driver.rank == SOURCES[driver.source]
            assert self.arbiter.motion(self.now) == self.commanded[driver.source]
            assert driver.source not in self.lost or driver.motion == STOP

    @invariant()
    def no_source_drives_after_the_timeout(self) -> None:
        driver = self.arbiter.driver(self.now)
        assert driver is None or self.now - self.heard[driver.source] <= self.timeout

    @precondition(lambda self: self.arbiter.held)
    @rule(source=st.sampled_from(["controller", "second controller", "recorder"]))
    def an_autopilot_asks_in_vain_while_it_is_held(self, source: str) -> None:
        driver = self.arbiter.driver(self.now)
        assert self.arbiter.offer(source, SOURCES[source], FORWARD, self.now)
        assert self.arbiter.driver(self.now) == driver
        if driver:
            self.lost.add(source)


TestAnySequence = Robot.TestCase
TestAnySequence.settings = settings(stateful_step_count=30)


def test_joint_commands_end_with_silence_even_where_the_watchdog_is_off() -> None:
    arbiter = Arbiter(-1)
    arbiter.offer("script", 4, JointMotion("velocity", (("wheel", 1.0),)), 10.0)
    assert arbiter.driver(10.4) is not None
    assert arbiter.motion(10.6) == STOP
    arbiter.offer("script", 4, (0.5, 0, 0), 11.0)
    assert arbiter.motion(1000.0) == (0.5, 0, 0)
