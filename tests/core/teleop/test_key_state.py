"""Which keys are held, in terminals that report releases, in those that only repeat, and
latched.
"""

import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.control.key_state import FIRST, HOLD, LATCH, MAX_FIRST_DELAY, SLACK, KeyState

LOOK = 0.005  # s between two looks
WITHIN = 0.060  # s after an interval in which a key that went up is no longer held

Times = list[float]


def run(first: float, every: float, seconds: float, late: float = 0.0, seed: int = 0) -> Times:
    """The times at which a key that is held for so long is typed; each repeat may come up to `late`
    seconds late.
    """
    noise = random.Random(seed)
    repeats = (first + number * every for number in itertools.count())
    return [
        0.0,
        *(
            at + noise.uniform(0, late)
            for at in itertools.takewhile(lambda at: at < seconds, repeats)
        ),
    ]


def held(
    key_state: KeyState, typed: Times, key: str = "i", start: float = 0.0
) -> list[tuple[float, float]]:
    """From when to when the key counts as held, polled as often as the teleop does."""
    spans: list[tuple[float, float]] = []
    began: float | None = None
    left = sorted(typed)
    now = 0.0
    while left or began is not None:
        while left and left[0] <= now:
            key_state.type(key, start + left.pop(0))
        key_state.expire(start + now)
        if key_state.keys and began is None:
            began = now
        elif not key_state.keys and began is not None:
            spans.append((began, now))
            began = None
        now += LOOK
    return spans


TERMINALS = [(0.25, 0.03), (0.5, 0.04), (0.66, 0.04), (0.25, 0.092), (0.5, 0.033)]


def test_a_held_key_never_stutters_and_its_end_is_seen_within_an_interval() -> None:
    for first, every in TERMINALS:
        key_state = KeyState()
        for number in range(3):
            typed = run(first, every, 1.5)
            ((_, ended),) = held(key_state, typed, start=10.0 * number)
            assert ended - typed[-1] <= every + WITHIN
        assert key_state.repeat.first == pytest.approx(first, abs=0.01)
        assert key_state.repeat.every == pytest.approx(every, abs=0.005)


def test_a_tap_of_a_known_terminal_lasts_its_first_delay() -> None:
    for first, every in TERMINALS:
        key_state = KeyState()
        held(key_state, [0.0])
        held(key_state, run(first, every, 1.5), start=10.0)
        ((began, ended),) = held(key_state, [0.0], start=20.0)
        assert first <= ended - began <= 1.1 * first + SLACK + 2 * LOOK


def test_a_tap_of_an_unknown_terminal_lasts_less_than_a_second() -> None:
    ((began, ended),) = held(KeyState(), [0.0])
    assert ended - began <= FIRST + SLACK + 2 * LOOK


def test_a_line_that_delays_repeats_makes_it_patient() -> None:
    for seed in range(20):
        key_state = KeyState()
        held(key_state, run(0.5, 0.03, 1.5))
        spans = held(key_state, run(0.5, 0.03, 4.0, late=0.08, seed=seed), start=10.0)
        later = [span for span in spans if span[0] > 2.0]
        assert not later, "it learned how late a repeat may be"


@given(st.lists(st.floats(0.0, 2.0), max_size=30))
def test_whatever_is_typed_a_key_is_let_go_in_time(gaps: list[float]) -> None:
    key_state = KeyState()
    now = 0.0
    for gap in gaps:
        now += gap
        key_state.type("i", now)
        assert key_state.patience() <= 1.1 * MAX_FIRST_DELAY + SLACK
    key_state.expire(now + 1.5)
    assert list(key_state.keys) == []


def test_two_quick_taps_and_a_hold_do_not_stutter() -> None:
    key_state = KeyState()
    held(key_state, run(0.5, 0.03, 1.5))
    typed = [0.0, *(0.2 + at for at in run(0.5, 0.03, 1.5))]
    assert len(held(key_state, typed, start=10.0)) == 1


def test_another_key_takes_the_place_of_a_typed_one() -> None:
    key_state = KeyState()
    key_state.type("i", 1.0)
    key_state.type("J", 1.1)
    assert list(key_state.keys) == ["J"]


def test_a_typed_key_counts_for_the_timeout() -> None:
    key_state = KeyState(timeout=0.3)
    for now in (1.0, 1.2):
        key_state.type("i", now)
    assert not key_state.expire(1.49)
    assert key_state.expire(1.5)
    assert list(key_state.keys) == []


def test_pressed_keys_are_held_together_until_each_is_released() -> None:
    key_state = KeyState()
    key_state.press("i", "105")
    key_state.press("J", "106")
    assert list(key_state.keys) == ["i", "J"]
    assert not key_state.expire(1e9)
    assert key_state.release("105")
    assert list(key_state.keys) == ["J"]
    assert not key_state.release("105")
    assert key_state.release("106")
    assert list(key_state.keys) == []


def test_latched_a_key_counts_until_another() -> None:
    key_state = KeyState(LATCH)
    key_state.type("i", 1.0)
    assert not key_state.expire(1e9)
    key_state.press("J", "106")
    key_state.release("106")
    assert list(key_state.keys) == ["J"]
    key_state.let_go()
    assert list(key_state.keys) == []


@pytest.mark.parametrize("mode", [HOLD, LATCH])
def test_a_key_that_was_let_go_while_it_repeats_counts_only_when_pressed_again(mode: str) -> None:
    key_state = KeyState(mode)
    typed = run(0.5, 0.03, 3.0)
    for now in typed[:20]:
        key_state.type("i", now)
    key_state.let_go()
    for now in typed[20:]:
        assert not key_state.type("i", now)
        assert list(key_state.keys) == []
    assert key_state.type("j", typed[-1] + 0.01), "another key counts at once"
    key_state.let_go()
    assert key_state.type("i", typed[-1] + 2.0)
    assert list(key_state.keys) == ["i"]


def test_a_pressed_key_that_was_let_go_counts_only_when_pressed_again() -> None:
    key_state = KeyState()
    key_state.press("i", "105")
    key_state.let_go()
    assert not key_state.release("105")
    key_state.press("i", "105")
    assert list(key_state.keys) == ["i"]


def test_a_key_that_was_ignored_does_not_count_while_it_repeats() -> None:
    key_state = KeyState()
    key_state.ignore("i", 1.0)
    assert not any(key_state.type("i", 1.0 + count * 0.04) for count in range(1, 50))
    assert key_state.keys == ()
    assert key_state.type("i", 4.0), "it was let go and pressed again"


def test_a_key_that_was_ignored_does_not_count_however_it_repeats() -> None:
    for first, every in [(0.25, 0.03), (0.66, 0.04), (0.5, 0.092), (0.25, 0.24)]:
        key_state = KeyState()
        held(key_state, run(0.5, 0.03, 1.5))  # another keyboard, which it knows
        key_state.ignore("i", 10.0)
        assert not any(key_state.type("i", 10.0 + at) for at in run(first, every, 3.0)[1:])
        assert key_state.type("i", 14.0), "it was let go and pressed again"
