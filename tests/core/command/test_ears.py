"""A process whose own session does not answer it stops its robots; one that was held up itself does
not.
"""

from holozen.command.ears import PASS, Deafness

DT = 0.01


def hear(ears: Deafness, start: float, seconds: float, answers: int, matters: bool = True) -> bool:
    """Passes of a loop for so many `seconds`, without a new answer; whether it is deaf at their
    end.
    """
    passes = round(seconds / DT)
    return [
        ears.judge(start + number * DT, answers, 0.5, lambda: matters) for number in range(passes)
    ][-1]


def test_a_session_is_deaf_after_half_a_second_without_an_answer_and_until_the_next() -> None:
    ears = Deafness()
    assert not hear(ears, 10.0, 0.45, 1)
    assert not hear(ears, 10.45, 0.45, 2)
    assert hear(ears, 10.9, 0.1, 2)
    assert hear(ears, 11.0, 5.0, 2)
    assert not ears.judge(16.0, 3, 0.5)


def test_a_loop_that_was_suspended_or_held_up_is_not_deaf_by_that() -> None:
    ears = Deafness()
    hear(ears, 10.0, 0.2, 1)
    assert not ears.judge(3600.0, 1, 0.5)
    assert not hear(ears, 3600.0, 0.4 - 0.2 - PASS, 1)


def test_where_it_does_not_count_nothing_adds_up() -> None:
    ears = Deafness()
    assert not hear(ears, 10.0, 5.0, 1, matters=False)
    assert not hear(ears, 15.0, 0.3, 1)
