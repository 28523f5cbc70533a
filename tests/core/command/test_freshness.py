"""How old a command is, by the beat that it echoes, and what of it is obeyed."""

import math

import pytest

from holozen.command.arbiter import Arbiter, Sent
from holozen.command.freshness import BEGIN_AGE, MAX_KNOWN, Freshness
from holozen.messages import Twist
from holozen.transport.pubsub import Received
from tests.core.command.fakes import FakeSenders, received, stamp

GO, STOP = Twist.planar(0.3), Twist()


class Robot(Arbiter):
    """The Freshness of one robot, which stands unless it is `driving`. It has listened since
    1.0.
    """

    def __init__(self) -> None:
        super().__init__(0.5)
        self.senders, self.driving = FakeSenders(), False
        self.freshness: Freshness[Twist] = Freshness(
            ("Fred/cmd_vel",), self.senders, lambda twist: twist.is_slow(), (self,)
        )
        self.begin(1.0)

    def moves(self, name: str, now: float) -> bool:
        return self.driving

    def sift(self, now: float, *commands: Received[Twist]) -> list[tuple[str, Sent]]:
        """The word of each refusal, and when the command was sent."""
        judged = self.freshness.sift(commands, now, now - 0.004)
        return [(each.refused.outcome.value if each.refused else "", each.sent) for each in judged]

    def hear(self, now: float, *commands: Received[Twist]) -> list[str]:
        return [word for word, _ in self.sift(now, *commands)]


def sent(number: int, at: float, twist: Twist = GO, session: str = "aa") -> Received[Twist]:
    """A command that echoes the beat of the time `at`."""
    return received(twist, stamp(number, at, session))


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_a_command_was_sent_after_the_beat_that_it_echoes(robot: Robot) -> None:
    ((word, times),) = robot.sift(10.0, sent(0, 9.9))
    assert (word, times) == ("", Sent(pytest.approx(9.9), pytest.approx(9.9), math.inf))  # type: ignore[arg-type]


def test_a_silence_is_from_the_arrival_of_the_number_before_to_the_echo(robot: Robot) -> None:
    robot.hear(10.0, sent(0, 9.98))
    ((_, times),) = robot.sift(11.0, sent(1, 10.9))
    assert times.silence == pytest.approx(0.9)


def test_where_numbers_are_missing_their_source_may_have_commanded_since(robot: Robot) -> None:
    robot.hear(10.0, sent(0, 9.98))
    ((_, times),) = robot.sift(11.0, sent(7, 10.9))
    assert (times.unheard, times.silence) == (10.0, 0.0)
    ((_, times),) = robot.sift(11.0, sent(7, 10.9, session="bb"))
    assert (times.unheard, times.silence) == (1.0, 0.0), (
        "of a source that was not heard before, since the robot listens"
    )


def test_what_was_sent_before_any_robot_was_heard_does_not_count_as_commanded(robot: Robot) -> None:
    """Numbers begin anew at the first echo."""
    assert robot.hear(10.0, received(GO, "me@aa;7;")) == ["no echo"]
    ((word, times),) = robot.sift(10.1, sent(0, 10.05))
    assert (word, times.silence) == ("", math.inf)
    assert times.unheard == pytest.approx(10.05)


def test_what_may_have_been_sent_more_than_half_a_second_ago_moves_nothing(robot: Robot) -> None:
    robot.driving = True
    assert robot.hear(10.0, sent(1, 9.499), sent(2, 9.501)) == ["old", ""]


def test_the_limit_of_age_can_be_set(robot: Robot) -> None:
    robot.driving = True
    robot.freshness.max_age = 0.2
    assert robot.hear(10.0, sent(1, 9.79), sent(2, 9.81)) == ["old", ""]


def test_a_command_that_echoes_nothing_of_this_robot_moves_nothing(robot: Robot) -> None:
    other = received(GO, "me@aa;1;dd:9990000000")
    assert robot.hear(10.0, other, received(GO, "me@aa;2;")) == ["no echo", "no echo"]


def test_a_stop_passes_at_any_age_from_any_sender(robot: Robot) -> None:
    robot.senders.there.clear()
    assert robot.hear(10.0, sent(1, 2.0, STOP), received(STOP, "cc"), received(STOP, "")) == [
        "",
        "",
        "",
    ]
    assert robot.hear(10.0, received(STOP, "me@aa;2;")) == [""]


@pytest.mark.parametrize("first", [STOP, GO])
def test_what_follows_a_command_without_an_echo_is_no_first_command(
    robot: Robot, first: Twist
) -> None:
    assert robot.hear(10.0, received(first, "me@aa;7;")) == ["" if first == STOP else "no echo"]
    ((_, times),) = robot.sift(10.1, sent(8, 10.05))
    assert times.unheard == pytest.approx(10.05)


def test_what_goes_back_in_number_moves_nothing(robot: Robot) -> None:
    assert robot.hear(10.0, sent(7, 10.0), sent(6, 10.0), sent(7, 10.0)) == [
        "",
        *2 * ["out of order"],
    ]
    assert robot.hear(10.0, sent(8, 10.0, STOP), sent(7, 10.0)) == ["", "out of order"]
    assert robot.hear(10.0, sent(1, 10.0, session="bb")) == [""]


def test_what_comes_from_a_sender_that_left_moves_nothing(robot: Robot) -> None:
    assert robot.hear(10.0, sent(1, 10.0)) == [""]
    robot.senders.there.clear()
    assert robot.hear(10.1, sent(2, 10.1)) == ["gone"]


class TestForgedStamps:
    """A session's id is no secret: anyone may write it, with any number and any echo."""

    @pytest.mark.parametrize("twist", [GO, STOP, None], ids=["move", "stop", "undecodable"])
    @pytest.mark.parametrize("at", [1.0, 9.9])
    def test_a_number_that_is_far_ahead_does_not_lock_its_owner_out(
        self, robot: Robot, twist: Twist | None, at: float
    ) -> None:
        forged = received(twist, stamp(10**18, at, node="x"), error="" if twist else "not a Twist")
        assert robot.hear(10.0, sent(1, 10.0)) == [""]
        robot.hear(10.01, forged)
        assert robot.hear(10.02, sent(2, 10.02)) == [""]

    def test_many_names_and_sessions_leave_nothing_behind(self, robot: Robot) -> None:
        robot.senders.there |= {f"s{number}" for number in range(5000)}
        for number in range(5000):
            robot.hear(
                10.0, sent(number, 10.0, STOP, f"s{number}"), received(STOP, f"n{number}@aa;1;")
            )
            robot.hear(10.0, sent(number, 9.8, GO, f"s{number}"), received(GO, f"m{number}"))
        tables = [table for table in vars(robot.freshness).values() if isinstance(table, dict)]
        assert max(map(len, tables)) <= MAX_KNOWN

    def test_a_command_on_a_key_that_is_not_the_robots_is_not_its_business(
        self, robot: Robot
    ) -> None:
        other = received(GO, stamp(9, 10.0), key="*/cmd_vel")
        assert robot.hear(10.0, other) == [""]  # the next look refuses it
        assert robot.hear(10.0, sent(1, 10.0)) == [""]


def test_a_node_of_another_session_is_no_driver_that_left(robot: Robot) -> None:
    assert robot.freshness.is_session("me@aa", "aa")  # nothing is known yet
    assert robot.hear(10.0, sent(1, 10.0)) == [""]
    assert robot.freshness.is_session("me@aa", "aa")
    assert not robot.freshness.is_session("me@aa", "a")


class TestALinkThatWasHeldUp:
    """Commands that waited arrive at once: the first to arrive may be the last that its sender ever
    sent.
    """

    def test_a_robot_that_stands_is_moved_by_nothing_that_waited(self, robot: Robot) -> None:
        # until 10.2; it arrives at 10.4
        waited = [sent(number, 10.0 + number * 0.04) for number in range(6)]
        assert robot.hear(10.4, *waited) == 6 * ["late"]

    def test_it_moves_again_by_the_echo_of_a_beat_from_after_that(self, robot: Robot) -> None:
        assert robot.hear(10.4, sent(1, 10.2)) == ["late"]
        assert robot.hear(10.6, sent(2, 10.39)) == ["late"], "by a beat from before"
        assert robot.hear(10.7, sent(3, 10.41)) == [""]
        assert robot.hear(11.7, sent(4, 11.4)) == ["late"], "if it stands, it begins anew"
        assert robot.hear(60.0, sent(5, 59.6)) == ["late"], "and after a pause too"

    def test_what_was_too_old_to_be_obeyed_asks_for_a_newer_beat_too(self, robot: Robot) -> None:
        assert robot.hear(10.4, sent(1, 9.0)) == ["old"]
        assert robot.hear(10.7, sent(2, 10.41)) == [""]

    def test_a_robot_that_drives_goes_on(self, robot: Robot) -> None:
        robot.driving = True
        assert robot.hear(10.4, sent(1, 10.1), sent(2, 10.2)) == ["", ""]

    def test_a_command_that_is_a_little_late_is_obeyed_at_once(self, robot: Robot) -> None:
        assert robot.hear(10.0, sent(1, 10.0 - 0.9 * BEGIN_AGE)) == [""]


class TestWithoutAStamp:
    """A bare `zenoh put`: its age cannot be known."""

    def test_the_newest_of_those_that_arrive_together_counts(self, robot: Robot) -> None:
        commands = [received(Twist.planar(speed), "") for speed in (0.1, 0.2, 0.3)]
        judged = list(robot.freshness.sift(commands, 10.0, 9.996))
        assert [(each.received, each.sent.at, each.refused) for each in judged] == [
            (commands[2], 9.996, None)
        ]

    def test_a_stop_among_them_is_not_left_out(self, robot: Robot) -> None:
        commands = [received(GO, ""), received(STOP, ""), received(GO, "")]
        assert [each.received for each in robot.freshness.sift(commands, 10.0, 9.996)] == commands[
            1:
        ]

    def test_other_names_are_other_sources(self, robot: Robot) -> None:
        assert robot.hear(10.0, received(GO, "a@1"), received(GO, "b@2"), received(GO, "")) == [
            "",
            "",
            "",
        ]

    def test_it_does_not_pass_for_a_sender_that_stamps(self, robot: Robot) -> None:
        assert robot.hear(10.0, sent(1, 10.0)) == [""]
        assert robot.hear(10.0, received(GO, "me@aa")) == ["unstamped"]
