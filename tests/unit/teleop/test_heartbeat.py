"""A terminal that does not answer in time has nobody before it."""

from services.teleop.heartbeat import EVERY, GIVE_UP, IDLE, LIMIT, Heartbeat


def answering() -> Heartbeat:
    heartbeat = Heartbeat()
    heartbeat.answered()
    return heartbeat


def test_a_terminal_that_never_answered_is_not_asked_and_not_missed() -> None:
    heartbeat = Heartbeat()
    assert not heartbeat.due(1.0, True)
    assert not heartbeat.miss(1e9)


def test_it_is_asked_often_while_the_robot_moves_and_seldom_else() -> None:
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
        assert not heartbeat.miss(now + EVERY / 2)
        heartbeat.answered()


def test_an_overdue_answer_is_missed_once_and_lost_until_it_comes() -> None:
    heartbeat = answering()
    assert heartbeat.due(1.0, True)
    assert heartbeat.due(1.0 + EVERY, True)
    assert not heartbeat.miss(1.0 + LIMIT)
    assert heartbeat.miss(1.01 + LIMIT)
    assert not heartbeat.miss(1.5 + LIMIT)
    assert heartbeat.lost
    assert not heartbeat.due(2.0, True), "two questions wait for their answers"
    heartbeat.answered()
    assert heartbeat.lost
    heartbeat.answered()
    assert not heartbeat.lost


def test_an_answer_that_never_comes_is_given_up_and_it_is_asked_anew() -> None:
    heartbeat = answering()
    for count in range(5):
        assert heartbeat.due(1.0 + count * 0.1, True)
    last = 1.4
    assert heartbeat.miss(2.0)
    assert not heartbeat.due(last + GIVE_UP - 0.01, True)
    assert heartbeat.due(last + 1.01 * GIVE_UP, True)
    heartbeat.answered()
    assert not heartbeat.lost


def test_it_is_asked_anew_at_once_when_something_has_changed() -> None:
    heartbeat = answering()
    assert heartbeat.due(1.0, True)
    heartbeat.hurry()
    assert not heartbeat.due(1.0 + EVERY / 2, True), "nothing is overdue"
    assert heartbeat.miss(2.0)
    heartbeat.hurry()
    assert heartbeat.due(2.0, True)
    heartbeat.answered()
    assert not heartbeat.lost


def test_after_a_restart_nothing_is_expected() -> None:
    heartbeat = answering()
    heartbeat.due(1.0, True)
    heartbeat.restart()
    assert not heartbeat.miss(1e9)
