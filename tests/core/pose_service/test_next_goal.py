"""Goals are handed out by number, from 0 to the last, and none beyond."""

import pytest

from holozen.messages import NextGoalReply, NextGoalRequest
from holozen.transport.errors import ServiceError
from services.pose_service.__main__ import next_goal, parser

GOALS = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0)]


def test_a_goal_is_handed_out_by_its_number() -> None:
    assert next_goal(GOALS, NextGoalRequest(0)) == NextGoalReply(1.0, 2.0, 3.0, 0)
    assert next_goal(GOALS, NextGoalRequest(1)) == NextGoalReply(4.0, 5.0, 6.0, 0)


def test_the_last_one_is_marked() -> None:
    assert next_goal(GOALS, NextGoalRequest(2)) == NextGoalReply(7.0, 8.0, 9.0, 1)
    assert next_goal(GOALS[:1], NextGoalRequest(0)).end_of_list == 1


def test_past_either_end_is_an_error_with_the_valid_range() -> None:
    for number in (-1, 3, 2**63 - 1, -(2**63)):
        with pytest.raises(ServiceError) as error:
            next_goal(GOALS, NextGoalRequest(number))
        assert str(error.value) == f"goal {number}: the list holds goals 0 to 2"


def test_a_square_of_one_metre_is_the_default() -> None:
    args = parser().parse_args([])
    assert (args.shape, args.size, args.goals) == ("square", 1.0, None)


def test_wrong_flags_are_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--shape", "circle"], ["--size", "0"], ["--size", "nan"], ["--size", "1001"]):
        with pytest.raises(SystemExit) as end:
            parser().parse_args(words)
        assert end.value.code == 2
        assert words[1] in capsys.readouterr().err
