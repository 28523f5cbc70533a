"""The age of commands by their senders' clocks: what waited in a buffer or comes from a dead process moves nothing."""

import pytest

from holozen.command.freshness import MAX_KNOWN, MAX_WAITING, Freshness
from holozen.messages import Twist
from holozen.transport.peer_clocks import PROMPT
from holozen.transport.pubsub import Received
from tests.unit.sim.fakes import FakeSenders, received

GO, STOP = Twist.planar(0.3), Twist()


class Robot:
    """Commands that reach one robot, and what becomes of each: "" or the kind of its refusal."""

    def __init__(self) -> None:
        self.senders = FakeSenders()
        self.driving = False
        self.freshness: Freshness[Twist] = Freshness(
            ("Fred/cmd_vel",), self.senders, lambda twist: twist.is_slow(), lambda _source, _now: self.driving
        )

    def hear(self, now: float, *commands: Received[Twist]) -> list[str]:
        return [judged.refusal.partition(":")[0] for judged in self.freshness.sift(commands, now, now - 0.004)]

    def sent(self, number: int, at: float, twist: Twist = GO, session: str = "aa") -> Received[Twist]:
        """A stamped command that was sent `at` by our clock."""
        return received(twist, f"teleop@{session};{number};{round((at + self.senders.offset) * 1e9)}")


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_a_fresh_command_passes_with_the_time_when_it_was_sent_at_the_earliest(robot: Robot) -> None:
    robot.senders.error = 0.02
    (judged,) = robot.freshness.sift([robot.sent(1, 9.9)], 10.0, 9.996)
    assert judged.refusal.startswith("late")  # nothing drives, and it was under way for at least 0.08 s
    robot.driving = True
    robot.senders.answers["aa"] = 10.0
    (judged,) = robot.freshness.sift([robot.sent(2, 10.0)], 10.1, 10.096)
    assert judged.refusal == ""
    assert (judged.sent, judged.age) == pytest.approx((9.98, 0.12))


def test_what_may_have_been_sent_more_than_half_a_second_ago_moves_nothing(robot: Robot) -> None:
    robot.driving = True
    assert robot.hear(10.0, robot.sent(1, 9.499)) == ["old"]
    assert robot.hear(10.0, robot.sent(2, 9.501)) == [""]
    robot.senders.error = 0.1
    assert robot.hear(10.0, robot.sent(3, 9.55)) == ["old"]


def test_the_limit_of_age_can_be_set(robot: Robot) -> None:
    robot.driving = True
    robot.freshness.max_age = 0.2
    assert robot.hear(10.0, robot.sent(1, 9.79), robot.sent(2, 9.81)) == ["old", ""]


def test_a_stop_passes_at_any_age_from_any_sender(robot: Robot) -> None:
    robot.senders.there.clear()
    assert robot.hear(10.0, robot.sent(1, 2.0, STOP), received(STOP, "cc"), received(STOP, "")) == ["", "", ""]


def test_what_goes_back_in_number_moves_nothing(robot: Robot) -> None:
    assert robot.hear(10.0, robot.sent(7, 10.0), robot.sent(6, 10.0), robot.sent(7, 10.0)) == [
        "",
        *2 * ["out of order"],
    ]
    assert robot.hear(10.0, robot.sent(8, 10.0, STOP), robot.sent(7, 10.0)) == ["", "out of order"]
    assert robot.hear(10.0, robot.sent(1, 10.0, session="bb")) == [""]


class TestForgedStamps:
    """A session's id is no secret: anyone may write it, with any number and any time."""

    @pytest.mark.parametrize("twist", [GO, STOP, None], ids=["move", "stop", "undecodable"])
    @pytest.mark.parametrize("at", [1.0, 9.9])
    def test_a_number_that_is_far_ahead_does_not_lock_its_owner_out(
        self, robot: Robot, twist: Twist | None, at: float
    ) -> None:
        forged = f"x@aa;{10**18};{round((at + robot.senders.offset) * 1e9)}"
        assert robot.hear(10.0, robot.sent(1, 10.0)) == [""]
        robot.hear(10.01, received(twist, forged, error="" if twist else "not a Twist"))
        assert robot.hear(10.02, robot.sent(2, 10.02)) == [""]

    def test_many_names_and_sessions_leave_nothing_behind(self, robot: Robot) -> None:
        robot.senders.there |= {f"s{number}" for number in range(5000)}
        robot.senders.known |= robot.senders.there
        for number in range(5000):
            robot.hear(10.0, robot.sent(number, 10.0, STOP, f"s{number}"), received(STOP, f"n{number}@aa;1;1"))
            robot.hear(10.0, robot.sent(number, 10.0, GO, f"s{number}"))
        tables = [table for table in vars(robot.freshness).values() if isinstance(table, dict)]
        assert max(map(len, tables)) <= MAX_KNOWN

    def test_a_command_on_a_key_that_is_not_the_robots_is_not_its_business(self, robot: Robot) -> None:
        (judged,) = robot.freshness.sift([received(GO, "x@aa;9;1", key="*/cmd_vel")], 10.0, 9.9)
        assert judged.refusal == ""  # the next look refuses it
        assert robot.hear(10.0, robot.sent(1, 10.0)) == [""]


def test_a_node_of_another_session_is_no_driver_that_left(robot: Robot) -> None:
    assert robot.freshness.is_session("teleop@aa", "aa")  # nothing is known yet
    assert robot.hear(10.0, robot.sent(1, 10.0)) == [""]
    assert robot.freshness.is_session("teleop@aa", "aa")
    assert not robot.freshness.is_session("teleop@aa", "a")


def test_a_sender_that_goes_on_and_whose_clock_stays_unknown_is_refused_and_asked_first(robot: Robot) -> None:
    robot.senders.known.clear()
    reported = [kind for step in range(20) for kind in robot.hear(10 + step * 0.05, robot.sent(step, 10 + step * 0.05))]
    assert reported == ["unknown clock"]
    assert set(robot.senders.tracked) == {"aa"}


def test_what_comes_from_a_sender_that_left_moves_nothing(robot: Robot) -> None:
    assert robot.hear(10.0, robot.sent(1, 10.0)) == [""]
    robot.senders.there.clear()
    assert robot.hear(10.1, robot.sent(2, 10.1)) == []
    assert robot.hear(10.7) == ["gone"]


def test_a_command_waits_for_its_senders_clock_and_the_newest_is_judged_then(robot: Robot) -> None:
    robot.senders.known.clear()
    assert robot.hear(10.0, robot.sent(1, 10.0), robot.sent(2, 10.0)) == []
    assert robot.freshness.is_waiting
    robot.senders.known.add("aa")
    (judged,) = robot.freshness.sift([], 10.02, 10.016)
    assert (judged.received.stamp and judged.received.stamp.number, judged.refusal) == (2, "")
    assert not robot.freshness.is_waiting


def test_what_waits_when_the_sim_is_played_or_reset_is_refused(robot: Robot) -> None:
    robot.senders.known.clear()
    robot.hear(10.0, robot.sent(1, 10.0))
    robot.freshness.drop_waiting()
    robot.senders.known.add("aa")
    assert robot.hear(10.02, robot.sent(2, 10.02)) == ["void", ""]
    assert robot.hear(10.04) == [] and not robot.freshness.is_waiting


def test_a_command_whose_senders_clock_stays_unknown_is_refused(robot: Robot) -> None:
    robot.senders.known.clear()
    assert robot.hear(10.0, robot.sent(1, 10.0)) == []
    assert robot.hear(10.6) == ["unknown clock"]
    assert not robot.freshness.is_waiting


def test_a_stop_ends_the_wait_of_what_was_sent_before_it(robot: Robot) -> None:
    robot.senders.known.clear()
    robot.hear(10.0, robot.sent(1, 10.0))
    assert robot.hear(10.01, robot.sent(2, 10.01, STOP)) == [""]
    robot.senders.known.add("aa")
    assert robot.hear(10.02) == []


def test_a_flood_of_unknown_senders_takes_bounded_memory(robot: Robot) -> None:
    flood = [received(GO, f"x@z{number};1;1") for number in range(1000)]
    assert robot.hear(10.0, *flood) == (1000 - MAX_WAITING) * ["gone"]
    assert robot.hear(10.1, robot.sent(1, 10.1)) == [""]


class TestALinkThatWasHeldUp:
    """Commands that waited arrive at once: the first to arrive may be the last that its sender ever sent."""

    def test_a_robot_that_stands_is_moved_by_nothing_that_waited(self, robot: Robot) -> None:
        waited = [robot.sent(number, 10.0 + number * 0.05) for number in range(6)]  # until 10.25; it arrives at 10.4
        assert robot.hear(10.4, *waited) == 6 * ["late"]
        assert robot.senders.asked == ["aa"]

    def test_it_moves_again_by_what_arrives_after_its_sender_has_answered(self, robot: Robot) -> None:
        assert robot.hear(10.4, robot.sent(1, 10.3)) == ["late"]
        assert robot.hear(10.42, robot.sent(2, 10.42)) == ["late"]  # its sender has not answered yet
        robot.senders.answers["aa"] = 10.39  # this answer is to a question from before
        assert robot.hear(10.43, robot.sent(3, 10.43)) == ["late"]
        robot.senders.answers["aa"] = 10.41
        assert robot.hear(10.45, robot.sent(4, 10.45)) == [""]

    def test_a_robot_that_drives_goes_on(self, robot: Robot) -> None:
        robot.driving = True
        assert robot.hear(10.4, robot.sent(1, 10.2), robot.sent(2, 10.25)) == ["", ""]

    def test_a_command_that_is_a_little_late_is_obeyed_at_once(self, robot: Robot) -> None:
        assert robot.hear(10.0, robot.sent(1, 10.0 - 0.9 * PROMPT)) == [""]


class TestWithoutAStamp:
    """A bare `zenoh put`: its age cannot be known."""

    def test_the_newest_of_those_that_arrive_together_counts(self, robot: Robot) -> None:
        commands = [received(Twist.planar(speed), "") for speed in (0.1, 0.2, 0.3)]
        judged = list(robot.freshness.sift(commands, 10.0, 9.996))
        assert [(each.received, each.sent, each.refusal) for each in judged] == [(commands[2], 9.996, "")]

    def test_a_stop_among_them_is_not_left_out(self, robot: Robot) -> None:
        commands = [received(GO, ""), received(STOP, ""), received(GO, "")]
        assert [each.received for each in robot.freshness.sift(commands, 10.0, 9.996)] == commands[1:]

    def test_other_names_are_other_sources(self, robot: Robot) -> None:
        assert robot.hear(10.0, received(GO, "a@1"), received(GO, "b@2"), received(GO, "")) == ["", "", ""]

    def test_it_does_not_pass_for_a_sender_that_stamps(self, robot: Robot) -> None:
        assert robot.hear(10.0, robot.sent(1, 10.0)) == [""]
        assert robot.hear(10.0, received(GO, "teleop@aa")) == ["unstamped"]
