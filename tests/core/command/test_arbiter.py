"""The arbiter: each rule of the wire's priorities as a sentence. tests/core/command runs every
sequence of them.
"""

import pytest

from holozen.command.arbiter import AUTOPILOT, MAX_NAMES, Arbiter, Sent
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
    return Arbiter(velocity_timeout=0.5)


def offer(
    arbiter: Arbiter, source: str, rank: int, motion: Motion, now: float, sent: Sent | None = None
) -> str:
    """Why a command is refused; empty if it is obeyed."""
    return arbiter.offer(source, rank, motion, now, sent).reason


def drives(arbiter: Arbiter, now: float) -> str:
    driver = arbiter.driver(now)
    return driver.source.name if driver else ""


def test_an_autopilot_is_what_sends_with_low_priority() -> None:
    assert AUTOPILOT == CONTROLLER


def test_no_source_outranks_a_person(arbiter: Arbiter) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert (
        offer(arbiter, "hurry", PRIORITIES.index("REAL_TIME"), LEFT, 1.1)
        == "overruled: teleop drives; it has to stop first"
    )
    assert offer(arbiter, "hurry", PRIORITIES.index("REAL_TIME"), LEFT, 2.0) == ""
    assert offer(arbiter, "teleop", PERSON, STOP, 2.1) == ""
    assert arbiter.motion(2.1).value == STOP


def test_without_a_command_the_robot_stands(arbiter: Arbiter) -> None:
    assert arbiter.motion(0).value == STOP
    assert arbiter.driver(0) is None
    assert not arbiter.autopilots_wait


def test_a_command_is_obeyed_at_once(arbiter: Arbiter) -> None:
    assert offer(arbiter, "teleop", PERSON, FORWARD, 1.0) == ""
    assert arbiter.motion(1.0).value == FORWARD


def test_a_longer_watchdog_does_not_wake_a_command_that_was_over(arbiter: Arbiter) -> None:
    offer(arbiter, "script", SCRIPT, FORWARD, 1.0)
    arbiter.set_velocity_timeout(2.0, now=1.6)
    assert (arbiter.motion(1.6).value, arbiter.driver(1.6)) == (STOP, None)
    offer(arbiter, "script", SCRIPT, FORWARD, 2.0)
    assert (arbiter.motion(3.9).value, arbiter.motion(4.1).value) == (FORWARD, STOP)


def test_a_shorter_watchdog_stops_a_robot_without_fresh_commands(arbiter: Arbiter) -> None:
    offer(arbiter, "script", SCRIPT, FORWARD, 1.0)
    arbiter.set_velocity_timeout(0.1, now=1.05)
    assert (arbiter.motion(1.09).value, arbiter.motion(1.11).value) == (FORWARD, STOP)


def test_a_stop_is_obeyed_at_once(arbiter: Arbiter) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert offer(arbiter, "teleop", PERSON, STOP, 1.01) == ""
    assert arbiter.motion(1.01).value == STOP


def test_after_half_a_second_of_silence_the_robot_stands(arbiter: Arbiter) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert arbiter.motion(1.5).value == FORWARD
    assert arbiter.motion(1.5 + 1e-6).value == STOP
    assert arbiter.driver(1.5 + 1e-6) is None


def test_a_fresh_command_keeps_the_robot_going(arbiter: Arbiter) -> None:
    for now in (1.0, 1.4, 1.8):
        offer(arbiter, "teleop", PERSON, FORWARD, now)
    assert arbiter.motion(2.2).value == FORWARD


@pytest.mark.parametrize(
    ("low", "high"), [(CONTROLLER, SCRIPT), (CONTROLLER, PERSON), (SCRIPT, PERSON)]
)
def test_a_higher_source_takes_the_robot_while_the_lower_one_drives(
    arbiter: Arbiter, low: int, high: int
) -> None:
    offer(arbiter, "low", low, FORWARD, 1.0)
    assert offer(arbiter, "high", high, LEFT, 1.1) == ""
    assert arbiter.motion(1.1).value == LEFT
    assert (
        offer(arbiter, "low", low, FORWARD, 1.2) == "overruled: high drives; it has to stop first"
    )
    assert arbiter.motion(1.2).value == LEFT


@pytest.mark.parametrize("rank", [SCRIPT, CONTROLLER])
def test_among_equals_the_one_that_drives_goes_on_while_it_is_fresh(
    arbiter: Arbiter, rank: int
) -> None:
    offer(arbiter, "first", rank, FORWARD, 1.0)
    assert (
        offer(arbiter, "second", rank, LEFT, 1.1) == "overruled: first drives; it has to stop first"
    )
    assert arbiter.motion(1.1).value == FORWARD
    assert offer(arbiter, "second", rank, LEFT, 1.6).startswith("let go first: "), (
        "by silence, or by a stop"
    )
    assert offer(arbiter, "second", rank, LEFT, 2.2) == ""
    assert arbiter.motion(2.2).value == LEFT


def test_a_person_whom_another_overruled_drives_only_after_letting_go(arbiter: Arbiter) -> None:
    def both(first: Motion, begin: int, end: int) -> str:
        """Both command at 10 Hz, from and until these tenths of a second. Returns the last refusal
        of the second.
        """
        for tenth in range(begin, end):
            offer(arbiter, "first", PERSON, first, tenth / 10)
            reason = offer(arbiter, "second", PERSON, LEFT, tenth / 10 + 0.05)
        return reason

    assert both(FORWARD, 10, 20) == "overruled: first drives; it has to stop first"
    assert both(STOP, 20, 30) == "overruled: first drives; it has to stop first"
    refused = offer(arbiter, "second", PERSON, LEFT, 3.41)
    assert refused.startswith("let go first"), "a latched key does not drive once the robot is free"
    assert (
        offer(arbiter, "second", PERSON, STOP, 3.5)
        == offer(arbiter, "second", PERSON, LEFT, 3.6)
        == ""
    )
    assert offer(arbiter, "first", PERSON, STOP, 3.65) == ""
    assert offer(arbiter, "second", PERSON, LEFT, 4.2) == HELD
    assert offer(arbiter, "second", PERSON, LEFT, 4.25) == HELD, (
        "to let go of that press would not help"
    )
    assert arbiter.resume(4.3) == ""
    assert offer(arbiter, "second", PERSON, LEFT, 4.4).startswith("let go first"), (
        "resume is meant for others"
    )
    assert offer(arbiter, "second", PERSON, LEFT, 5.0) == "", "it was silent"


def test_a_person_whom_another_stopped_does_not_drive_on_after_a_quick_resume(
    arbiter: Arbiter,
) -> None:
    offer(arbiter, "first", PERSON, FORWARD, 1.0)
    offer(arbiter, "second", PERSON, STOP, 1.05)
    offer(arbiter, "first", PERSON, FORWARD, 1.1)
    assert arbiter.resume(1.2) == ""
    assert offer(arbiter, "first", PERSON, FORWARD, 1.25).startswith("let go first")
    assert (
        offer(arbiter, "first", PERSON, STOP, 1.3)
        == offer(arbiter, "first", PERSON, FORWARD, 1.35)
        == ""
    )


def test_a_person_whose_late_commands_were_refused_while_another_drove_lets_go_too(
    arbiter: Arbiter,
) -> None:
    offer(arbiter, "first", PERSON, FORWARD, 1.0)
    arbiter.note_refused("second", PERSON, 1.2)
    offer(arbiter, "first", PERSON, STOP, 1.3)
    arbiter.note_refused("second", PERSON, 1.6)
    assert offer(arbiter, "second", PERSON, LEFT, 1.9).startswith("let go first")
    offer(arbiter, "script", SCRIPT, FORWARD, 3.0)
    arbiter.note_refused("third", PERSON, 3.1)
    assert offer(arbiter, "third", PERSON, LEFT, 3.2) == "", "only people let go of each other"


@pytest.mark.parametrize("timeout", [0.5, None])
def test_a_flood_of_people_does_not_lock_out_the_one_who_drives(timeout: float | None) -> None:
    arbiter = Arbiter(timeout)
    for number in range(3 * MAX_NAMES):
        offer(arbiter, "first", PERSON, FORWARD, 1.0)
        assert offer(arbiter, f"forged {number}", PERSON, LEFT, 1.0)
    assert offer(arbiter, "first", PERSON, LEFT, 1.1) == ""


@pytest.mark.parametrize(
    ("rank", "stopper"),
    [(PERSON, PERSON), (SCRIPT, SCRIPT), (CONTROLLER, CONTROLLER), (SCRIPT, PERSON)],
)
def test_an_equal_or_higher_source_may_stop_the_robot_and_it_stays_stopped(
    arbiter: Arbiter, rank: int, stopper: int
) -> None:
    offer(arbiter, "first", rank, FORWARD, 1.0)
    assert offer(arbiter, "second", stopper, STOP, 1.1) == ""
    assert arbiter.motion(1.1).value == STOP
    for now in (1.2, 9.0):
        assert offer(arbiter, "first", rank, FORWARD, now)
        assert arbiter.motion(now).value == STOP
    assert arbiter.resume(9.1) == ""
    assert offer(arbiter, "first", rank, FORWARD, 9.7) == ""


@pytest.mark.parametrize("low", [SCRIPT, CONTROLLER])
def test_a_lower_source_may_not_even_stop_the_robot(arbiter: Arbiter, low: int) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert offer(arbiter, "low", low, STOP, 1.1) == "overruled: teleop drives; it has to stop first"
    assert arbiter.motion(1.1).value == FORWARD


def test_a_held_source_stops_a_robot_whose_driver_has_been_silent() -> None:
    arbiter = Arbiter(velocity_timeout=2.0)
    offer(arbiter, "script", SCRIPT, FORWARD, 1.0)
    offer(arbiter, "teleop", PERSON, LEFT, 1.1)
    assert (
        offer(arbiter, "script", SCRIPT, STOP, 1.5)
        == "overruled: teleop drives; it has to stop first"
    )
    assert offer(arbiter, "script", SCRIPT, STOP, 1.7) == ""
    assert arbiter.motion(1.7).value == STOP
    assert offer(arbiter, "script", SCRIPT, FORWARD, 1.8) == HELD


def test_a_script_that_had_to_let_go_while_a_person_drove_waits_for_resume_besides(
    arbiter: Arbiter,
) -> None:
    arbiter.stop("ann@1", 1.0)
    offer(arbiter, "script", SCRIPT, FORWARD, 1.1)
    arbiter.release(1.2)
    offer(arbiter, "teleop", PERSON, LEFT, 1.3)
    assert (
        offer(arbiter, "script", SCRIPT, FORWARD, 1.4)
        == "overruled: teleop drives; it has to stop first"
    )
    offer(arbiter, "teleop", PERSON, STOP, 1.5)
    offer(arbiter, "script", SCRIPT, STOP, 2.1)
    assert offer(arbiter, "script", SCRIPT, FORWARD, 2.2) == HELD


def test_a_held_source_may_stop_the_robot_but_not_drive_it(arbiter: Arbiter) -> None:
    offer(arbiter, "script", SCRIPT, FORWARD, 1.0)
    offer(arbiter, "teleop", PERSON, STOP, 1.1)
    offer(arbiter, "another script", SCRIPT, FORWARD, 2.0)
    for now in (2.1, 2.2):  # a stop is repeated
        assert offer(arbiter, "script", SCRIPT, STOP, now) == ""
        assert arbiter.motion(now).value == STOP
    assert offer(arbiter, "script", SCRIPT, FORWARD, 2.3) == HELD


def test_a_command_is_as_old_as_it_may_have_waited(arbiter: Arbiter) -> None:
    assert offer(arbiter, "teleop", PERSON, FORWARD, now=1.0, sent=Sent(0.7, 0.7)) == ""
    assert arbiter.motion(1.2).value == FORWARD
    assert arbiter.motion(1.2 + 1e-6).value == STOP


def test_a_stop_of_any_age_stops_the_robot(arbiter: Arbiter) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert offer(arbiter, "teleop", PERSON, STOP, now=1.1, sent=Sent(-9e9, -9e9)) == ""
    assert arbiter.motion(1.1).value == STOP


@pytest.mark.parametrize("low", [SCRIPT, CONTROLLER])
def test_an_overruled_source_does_not_get_the_robot_back_by_waiting(
    arbiter: Arbiter, low: int
) -> None:
    offer(arbiter, "low", low, FORWARD, 1.0)
    offer(arbiter, "teleop", PERSON, LEFT, 1.1)
    for now in (2.0, 60.0, 3600.0):
        assert offer(arbiter, "low", low, FORWARD, now) == HELD
        assert arbiter.motion(now).value == STOP
    assert arbiter.autopilots_wait


def test_a_script_that_spoke_while_a_person_drove_is_held_too(arbiter: Arbiter) -> None:
    offer(arbiter, "teleop", PERSON, LEFT, 1.0)
    offer(arbiter, "script", SCRIPT, FORWARD, 1.1)
    assert offer(arbiter, "script", SCRIPT, FORWARD, 5.0) == HELD


def test_what_lets_a_held_source_drive_again_names_the_robot() -> None:
    arbiter = Arbiter(velocity_timeout=0.5, robot="Fred")
    offer(arbiter, "teleop", PERSON, LEFT, 1.0)
    reason = offer(arbiter, "controller", CONTROLLER, FORWARD, 9.0)
    assert reason == HELD.replace("controller", "controller Fred")


def test_a_script_that_is_started_after_the_person_let_go_is_obeyed(arbiter: Arbiter) -> None:
    offer(arbiter, "teleop", PERSON, LEFT, 1.0)
    assert offer(arbiter, "script", SCRIPT, FORWARD, 2.0) == ""


@pytest.mark.parametrize("above", [PERSON, SCRIPT])
def test_no_autopilot_takes_a_robot_that_others_drove_not_even_a_new_one(
    arbiter: Arbiter, above: int
) -> None:
    offer(arbiter, "teleop", above, LEFT, 1.0)
    assert arbiter.autopilots_wait
    assert offer(arbiter, "controller", CONTROLLER, FORWARD, 9.0) == HELD
    assert arbiter.motion(9.0).value == STOP


def test_the_autopilot_itself_may_fall_silent_and_go_on(arbiter: Arbiter) -> None:
    offer(arbiter, "controller", CONTROLLER, FORWARD, 1.0)
    assert offer(arbiter, "controller", CONTROLLER, FORWARD, 9.0) == ""
    assert offer(arbiter, "another controller", CONTROLLER, FORWARD, 19.0) == ""
    assert not arbiter.autopilots_wait


def test_a_source_below_the_autopilot_neither_drives_nor_makes_it_yield(arbiter: Arbiter) -> None:
    offer(arbiter, "controller", CONTROLLER, FORWARD, 1.0)
    assert (
        offer(arbiter, "recorder", BACKGROUND, LEFT, 1.1)
        == "overruled: controller drives; it has to stop first"
    )
    assert offer(arbiter, "recorder", BACKGROUND, LEFT, 9.0) == HELD
    assert not arbiter.autopilots_wait


def test_after_resume_a_held_source_drives_again(arbiter: Arbiter) -> None:
    offer(arbiter, "script", SCRIPT, FORWARD, 1.0)
    offer(arbiter, "teleop", PERSON, STOP, 1.1)
    assert arbiter.resume(1.2) == ""
    assert not arbiter.autopilots_wait
    assert arbiter.resumed == 1
    assert offer(arbiter, "controller", CONTROLLER, FORWARD, 1.3) == ""
    assert offer(arbiter, "script", SCRIPT, LEFT, 1.4) == ""


def test_resume_is_refused_while_a_person_moves_the_robot(arbiter: Arbiter) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert arbiter.resume(1.1) == "teleop drives; stop it first"
    assert arbiter.resumed == 0
    assert offer(arbiter, "controller", CONTROLLER, LEFT, 2.0) == HELD
    assert arbiter.resume(2.1) == ""


def test_it_knows_when_a_source_last_made_others_wait(arbiter: Arbiter) -> None:
    assert arbiter.taken_at is None
    offer(arbiter, "controller", CONTROLLER, FORWARD, 1.0)
    arbiter.resume(1.1)
    assert arbiter.taken_at is None, "an autopilot that drives alone"
    offer(arbiter, "teleop", PERSON, STOP, 1.2)
    assert arbiter.taken_at == 1.2, "a person stops it"
    offer(arbiter, "teleop", PERSON, STOP, 1.3)
    assert arbiter.taken_at == 1.2, "a person who goes on sending zeros holds up no resume"
    offer(arbiter, "teleop", PERSON, FORWARD, 1.4)
    offer(arbiter, "teleop", PERSON, FORWARD, 1.5)
    offer(arbiter, "controller", CONTROLLER, FORWARD, 1.6)
    assert arbiter.taken_at == 1.5, "a person drives"
    assert arbiter.stopped_at is None
    arbiter.stop("person", 2.0)
    arbiter.stop("person", 3.0)
    assert arbiter.taken_at == arbiter.stopped_at == 3.0, "a stop is set, and set again"
    other = Arbiter(velocity_timeout=0.5)
    other.inherit(arbiter, 4.0)
    assert other.taken_at == other.stopped_at == 3.0


def test_resume_leaves_an_autopilot_that_drives_at_the_wheel(arbiter: Arbiter) -> None:
    offer(arbiter, "controller", CONTROLLER, FORWARD, 1.0)
    assert arbiter.resume(1.1) == ""
    assert drives(arbiter, 1.1) == "controller"
    assert arbiter.motion(1.1).value == FORWARD


def test_a_timeout_of_zero_obeys_for_one_moment(arbiter: Arbiter) -> None:
    arbiter = Arbiter(velocity_timeout=0)
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert arbiter.motion(1.0).value == FORWARD
    assert arbiter.motion(1.0 + 1e-9).value == STOP


class TestWithoutATimeout:
    """As `cmdTimeout` -1 in Gazebo: a silent source is obeyed until another one speaks."""

    @pytest.fixture
    def arbiter(self) -> Arbiter:
        return Arbiter(velocity_timeout=None)

    def test_a_silent_source_is_obeyed_for_ever(self, arbiter: Arbiter) -> None:
        offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
        assert arbiter.motion(1e6).value == FORWARD

    def test_a_second_teleop_can_stop_what_a_dead_one_left_driving(self, arbiter: Arbiter) -> None:
        offer(arbiter, "dead teleop", PERSON, FORWARD, 1.0)
        assert offer(arbiter, "teleop", PERSON, STOP, 1.1) == ""
        assert arbiter.motion(9.0).value == STOP

    def test_a_second_teleop_can_drive_what_a_dead_one_left_driving(self, arbiter: Arbiter) -> None:
        offer(arbiter, "dead teleop", PERSON, FORWARD, 1.0)
        assert (
            offer(arbiter, "teleop", PERSON, LEFT, 1.4)
            == "overruled: dead teleop drives; it has to stop first"
        )
        assert (
            offer(arbiter, "teleop", PERSON, STOP, 1.9)
            == offer(arbiter, "teleop", PERSON, LEFT, 2.0)
            == ""
        )
        assert arbiter.motion(2.0).value == LEFT

    def test_a_person_is_not_locked_out_by_another_source_that_drove_during_their_silence(
        self, arbiter: Arbiter
    ) -> None:
        offer(arbiter, "teleop", PERSON, STOP, 1.0)
        assert offer(arbiter, "script", SCRIPT, FORWARD, 9.0) == ""
        assert offer(arbiter, "teleop", PERSON, STOP, 9.1) == ""
        assert arbiter.motion(9.1).value == STOP

    def test_an_autopilot_still_waits_for_resume(self, arbiter: Arbiter) -> None:
        offer(arbiter, "teleop", PERSON, STOP, 1.0)
        assert offer(arbiter, "controller", CONTROLLER, FORWARD, 9.0) == HELD
        assert arbiter.resume(9.1) == ""
        assert offer(arbiter, "controller", CONTROLLER, FORWARD, 9.2) == ""


@pytest.mark.parametrize("rank", [SCRIPT, BACKGROUND])
def test_a_flood_of_names_holds_its_own_rank_and_no_higher_one_and_frees_no_one(
    arbiter: Arbiter, rank: int
) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    for number in range(12 * MAX_NAMES):
        assert (
            offer(arbiter, f"forged {number}", rank, LEFT, 1.1)
            == "overruled: teleop drives; it has to stop first"
        )
    assert arbiter.motion(1.1).value == FORWARD
    for source in ("forged 0", f"forged {MAX_NAMES + 5}", "never heard of"):
        assert offer(arbiter, source, rank, LEFT, 9.0) == HELD
    for now, source in ((9.0, "teleop"), (10.0, "another teleop")):
        assert not arbiter.must_wait(source, PERSON, now)
        assert offer(arbiter, source, PERSON, FORWARD, now) == ""
    assert arbiter.resume(11.0) == ""
    assert offer(arbiter, "never heard of", rank, LEFT, 11.0) == ""


def test_a_name_that_is_forged_at_a_lower_rank_neither_holds_nor_replaces_its_owner(
    arbiter: Arbiter,
) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert (
        offer(arbiter, "teleop", BACKGROUND, LEFT, 1.1)
        == "overruled: teleop drives; it has to stop first"
    )
    assert (
        offer(arbiter, "teleop", BACKGROUND, STOP, 1.1)
        == "overruled: teleop drives; it has to stop first"
    )
    assert arbiter.motion(1.1).value == FORWARD
    assert offer(arbiter, "teleop", PERSON, LEFT, 1.2) == ""


def test_of_equals_that_fill_the_table_with_stops_the_last_one_drives_on(arbiter: Arbiter) -> None:
    offer(arbiter, "script", SCRIPT, FORWARD, 1.0)
    for number in range(2 * MAX_NAMES):
        assert offer(arbiter, f"stopper {number}", SCRIPT, STOP, 1.0) == ""
    last = f"stopper {2 * MAX_NAMES - 1}"
    assert offer(arbiter, "script", SCRIPT, FORWARD, 1.0) != ""
    assert offer(arbiter, last, SCRIPT, FORWARD, 1.0) == ""
    assert not arbiter.must_wait("teleop", PERSON, 1.0)


class TestSoftwareStop:
    """`stop` and `release`."""

    def test_the_robot_stands_at_once_and_whatever_is_commanded(self, arbiter: Arbiter) -> None:
        offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
        arbiter.stop("ann@1", 1.1)
        assert arbiter.motion(1.1).value == STOP
        for rank in (0, PERSON, SCRIPT, CONTROLLER, BACKGROUND):
            assert offer(arbiter, f"source {rank}", rank, LEFT, 1.2).startswith(
                "stopped: by ann@1; "
            )
            assert arbiter.motion(1.2).value == STOP
        assert arbiter.driver(1.2) is None

    @pytest.mark.parametrize("timeout", [0.5, 5.0, None])
    def test_releasing_it_moves_nothing(self, timeout: float | None) -> None:
        arbiter = Arbiter(timeout)
        offer(arbiter, "script", SCRIPT, FORWARD, 1.0)
        arbiter.stop("ann@1", 1.1)
        arbiter.release(1.1)
        assert arbiter.motion(1.2).value == STOP
        assert offer(arbiter, "script", SCRIPT, FORWARD, 1.3).startswith("let go first: ")
        assert offer(arbiter, "script", SCRIPT, STOP, 1.4) == ""
        assert offer(arbiter, "script", SCRIPT, FORWARD, 1.5) == ""

    def test_an_autopilot_waits_for_resume_besides(self, arbiter: Arbiter) -> None:
        offer(arbiter, "controller", CONTROLLER, FORWARD, 1.0)
        arbiter.stop("ann@1", 1.1)
        assert arbiter.autopilots_wait
        arbiter.release(1.1)
        assert offer(arbiter, "controller", CONTROLLER, FORWARD, 9.0) == HELD
        assert arbiter.resume(9.1) == ""
        assert offer(arbiter, "controller", CONTROLLER, FORWARD, 9.2) == ""

    def test_resume_does_not_make_up_for_letting_go(self, arbiter: Arbiter) -> None:
        arbiter.stop("ann@1", 1.0)
        offer(arbiter, "controller", CONTROLLER, FORWARD, 2.0)
        arbiter.release(2.0)
        assert arbiter.resume(2.1) == ""
        assert offer(arbiter, "controller", CONTROLLER, FORWARD, 2.2).startswith("let go first: ")
        assert offer(arbiter, "controller", CONTROLLER, FORWARD, 2.8) == ""

    def test_resume_is_refused_while_it_holds(self, arbiter: Arbiter) -> None:
        arbiter.stop("ann@1", 1.0)
        assert arbiter.resume(2.0) == "stopped: by ann@1; `holozen release` lets it drive again"
        assert (arbiter.resumed, arbiter.autopilots_wait) == (0, True)

    def test_a_joint_that_was_moved_stands_too(self, arbiter: Arbiter) -> None:
        offer(arbiter, "script", SCRIPT, JointMotion("position", (("arm", 1.0),)), 1.0)
        arbiter.stop("ann@1", 1.1)
        assert arbiter.motion(1.1).value == STOP
        assert offer(
            arbiter, "script", SCRIPT, JointMotion("position", (("arm", 1.0),)), 1.2
        ).startswith("stopped: ")

    def test_the_robot_in_the_place_of_a_stopped_one_is_stopped(self, arbiter: Arbiter) -> None:
        arbiter.stop("ann@1", 1.0)
        heir = Arbiter(0.5)
        heir.inherit(arbiter, 8.0)
        assert offer(heir, "teleop", PERSON, FORWARD, 9.0).startswith("stopped: by ann@1; ")


class TestLostOperator:
    """The process behind a source is gone."""

    def test_the_robot_that_it_drove_stands_at_once(self, arbiter: Arbiter) -> None:
        offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
        arbiter.forget("teleop")
        assert arbiter.motion(1.0).value == STOP

    @pytest.mark.parametrize("motion", [FORWARD, JointMotion("velocity", (("arm", 1.0),))])
    def test_so_it_does_where_the_watchdog_is_off(self, motion: Motion) -> None:
        arbiter = Arbiter(None)
        offer(arbiter, "teleop", PERSON, motion, 1.0)
        arbiter.forget("teleop")
        assert arbiter.motion(1.0).value == arbiter.motion(1e6).value == STOP

    def test_the_loss_of_a_foreign_node_changes_nothing(self, arbiter: Arbiter) -> None:
        arbiter.forget("foreign")
        offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
        arbiter.forget("foreign")
        assert arbiter.motion(1.1).value == FORWARD

    def test_no_other_source_gets_the_robot_any_sooner_for_it(self, arbiter: Arbiter) -> None:
        """A name can be forged: what a loss does may only stop the robot."""
        offer(arbiter, "first", SCRIPT, FORWARD, 1.0)
        arbiter.forget("first")
        assert (
            offer(arbiter, "second", SCRIPT, LEFT, 1.1)
            == "overruled: first drives; it has to stop first"
        )
        assert arbiter.motion(1.1).value == STOP
        assert offer(arbiter, "second", SCRIPT, LEFT, 1.6) == ""

    def test_a_source_that_comes_back_is_obeyed_as_usual(self, arbiter: Arbiter) -> None:
        offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
        arbiter.forget("teleop")
        assert offer(arbiter, "teleop", PERSON, LEFT, 1.1) == ""
        assert arbiter.motion(1.1).value == LEFT

    def test_the_loss_of_a_person_frees_no_autopilot_and_holds_up_no_resume(
        self, arbiter: Arbiter
    ) -> None:
        offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
        arbiter.forget("teleop")
        assert offer(arbiter, "controller", CONTROLLER, LEFT, 9.0) == HELD
        assert arbiter.resume(9.0) == ""


@pytest.mark.parametrize(("rank", "holds"), [(SCRIPT, False), (CONTROLLER, True)])
def test_a_source_that_has_to_wait_is_held(arbiter: Arbiter, rank: int, holds: bool) -> None:
    offer(arbiter, "teleop", PERSON, FORWARD, 1.0)
    assert arbiter.must_wait("me", rank, 9.0) == holds
    arbiter.stop("ann@1", 10.0)
    offer(arbiter, "me", rank, FORWARD, 10.1)
    assert arbiter.must_wait("me", rank, 10.1)


def test_joint_commands_end_with_silence_even_where_the_watchdog_is_off() -> None:
    arbiter = Arbiter(None)
    offer(arbiter, "script", 4, JointMotion("velocity", (("wheel", 1.0),)), 10.0)
    assert arbiter.driver(10.4) is not None
    assert arbiter.motion(10.6).value == STOP
    offer(arbiter, "script", 4, (0.5, 0, 0), 11.0)
    assert arbiter.motion(1000.0).value == (0.5, 0, 0)
