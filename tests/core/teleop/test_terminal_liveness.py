"""A terminal that does not answer in time has lost its operator."""

from services.teleop.input.terminal_liveness import EVERY, IDLE, LIMIT, RETRY, ROUNDS, Heartbeat


def answering() -> Heartbeat:
    heartbeat = Heartbeat()
    heartbeat.answered(0.0, terminal=False)
    return heartbeat


def test_a_terminal_that_never_answered_is_not_asked_and_not_missed() -> None:
    heartbeat = Heartbeat()
    assert not heartbeat.due(1.0, True)
    assert not heartbeat.has_missed(1e9)


def test_it_is_asked_often_while_the_robot_moves_and_seldom_otherwise() -> None:
    heartbeat = answering()
    assert heartbeat.due(1.0, True)
    assert not heartbeat.due(1.0 + EVERY / 2, True)
    assert heartbeat.due(1.0 + EVERY, True)
    assert not heartbeat.due(1.0 + 2 * EVERY, False)
    assert heartbeat.due(1.0 + EVERY + IDLE, False)


def test_answers_in_time_are_never_missed() -> None:
    heartbeat = answering()
    for tick in range(100):
        now = 1.0 + tick * EVERY
        heartbeat.due(now, True)
        assert not heartbeat.has_missed(now + EVERY / 2)
        heartbeat.answered(now, terminal=False)


def lost(questions: int = 1) -> Heartbeat:
    """The liveness of a terminal that missed the queries for its type sent at 1.0; it is 2.0
    now.
    """
    heartbeat = answering()
    heartbeat.asked_terminal(questions)
    assert heartbeat.due(1.0, True)
    assert not heartbeat.has_missed(1.0 + LIMIT)
    assert heartbeat.has_missed(2.0)
    assert heartbeat.lost
    return heartbeat


def ask(heartbeat: Heartbeat, now: float) -> int:
    """Report input, and return how many times the terminal is queried."""
    times = heartbeat.note_input(now)
    heartbeat.asked_terminal(times)
    return times


def test_an_overdue_answer_is_missed_once() -> None:
    assert not lost().has_missed(3.0)


def test_answers_to_what_was_asked_before_only_show_that_it_is_back() -> None:
    heartbeat = lost(questions=3)
    for _ in range(3):
        heartbeat.answered(3.0, terminal=True)
    heartbeat.answered(3.0, terminal=False)
    assert heartbeat.lost
    assert ask(heartbeat, 3.0) == 1
    assert heartbeat.lost


def test_it_is_found_again_when_it_answers_in_time_what_was_asked_after_it_was_back() -> None:
    heartbeat = lost(questions=0)
    for count in range(ROUNDS):
        assert heartbeat.lost
        assert ask(heartbeat, 3.0 + count) == 1
        heartbeat.answered(3.1 + count, terminal=True)
    assert not heartbeat.lost


def test_answers_that_may_be_to_older_questions_are_counted_off() -> None:
    """After a terminal was detached some queries are never answered, and nobody can tell which."""
    heartbeat = lost(questions=3)
    assert ask(heartbeat, 3.0) == 4
    for _ in range(3):
        heartbeat.answered(3.0, terminal=True)
        assert ask(heartbeat, 3.0) == 0, "these may be to the old ones"
    heartbeat.answered(3.0, terminal=True)
    assert ask(heartbeat, 3.0) > 0, "the first that was surely asked after it was back"


def test_one_that_hangs_again_before_it_answers_has_to_start_over() -> None:
    heartbeat = lost(questions=0)
    assert ask(heartbeat, 3.0) == 1
    assert ask(heartbeat, 3.1) == 0, "the answer may still come in time"
    for _ in range(ROUNDS):
        heartbeat.answered(5.0, terminal=True)
    assert heartbeat.lost


def test_a_lost_terminal_is_asked_at_once_and_then_less_and_less_often() -> None:
    heartbeat = lost()
    now, asked = 2.0, []
    while now < 100.0:
        if heartbeat.due(now, True):
            asked.append(now)
        now += 0.05
    assert asked[0] == 2.0
    assert asked[1] - asked[0] >= RETRY
    assert len(asked) < 10


def test_after_a_restart_only_new_answers_count() -> None:
    heartbeat = answering()
    heartbeat.due(1.0, True)
    heartbeat.restart(2.0)
    assert heartbeat.lost
    assert not heartbeat.has_missed(1e9)


def test_a_terminal_that_never_answered_is_not_lost_by_a_restart() -> None:
    heartbeat = Heartbeat()
    heartbeat.restart(2.0)
    assert not heartbeat.lost
