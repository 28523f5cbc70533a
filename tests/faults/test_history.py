"""What the checks of a history let pass, and what they find: a robot that stands, and a link that
is cut.
"""

import pytest

from holozen.wire import COMMAND_SILENCE

from .history import STEP, Command, History, Row, Violation

CUT, BACK = 10.0, 10.6  # s
PROMPTLY = 0.02  # s
NEVER = 99.0


def history(*commands: Command, starts: float, stands: float = NEVER) -> History:
    """A robot that moves from an odom at `starts` on, until `stands`."""
    ends = [9.0 + step * STEP for step in range(1000)]
    odom = [Row(end - STEP, end, starts <= end < stands) for end in ends]
    return History(sorted(commands), odom)


def command(sent: float) -> Command:
    return Command(sent, sent + 0.001)


def test_a_reset_without_a_silence_may_let_through_what_was_just_sent() -> None:
    prompt = history(command(CUT - PROMPTLY), command(CUT + 0.03), starts=CUT + 0.025)
    prompt.check_restored(CUT)


def test_a_command_whose_sending_ended_when_the_link_was_back_did_not_wait() -> None:
    held_up = Command(BACK - 0.001, BACK + 0.2)
    history(command(CUT + 0.1), held_up, starts=BACK + 0.21).check_restored(BACK)


def test_the_newest_of_what_waited_may_be_fresh() -> None:
    history(command(CUT + 0.3), command(BACK - PROMPTLY), starts=BACK + 0.01).check_restored(BACK)


@pytest.mark.parametrize("commands", [[command(CUT + 0.5)], [command(CUT - PROMPTLY)], []])
def test_what_waited_moves_no_robot_that_stood(commands: list[Command]) -> None:
    with pytest.raises(Violation, match="waited"):
        history(*commands, command(BACK + 0.1), starts=BACK + 0.01).check_restored(BACK)


def test_a_command_that_is_late_after_a_reset_moves_no_robot_that_stood() -> None:
    with pytest.raises(Violation, match="waited"):
        history(command(CUT - PROMPTLY), starts=CUT + 0.1).check_restored(CUT)


def test_a_robot_moves_on_for_half_a_second_after_the_newest_of_all_commands() -> None:
    held_up = Command(CUT, CUT + 0.3)
    until = CUT + 0.3 + COMMAND_SILENCE
    history(held_up, command(CUT + 0.1), starts=CUT + 0.01, stands=until).check_silence()
    with pytest.raises(Violation, match="after the last command"):
        history(
            held_up, command(CUT + 0.1), starts=CUT + 0.01, stands=until + 4 * STEP
        ).check_silence()
