"""Which keys are held, in terminals that tell releases, in those that only repeat, and latched."""

import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.grip import HOLD, LATCH, Grip
from services.teleop.repeat import FIRST, LONGEST, SLACK

LOOK = 0.005  # s between two looks
WITHIN = 0.060  # s after an interval in which a key that went up is no longer held

Times = list[float]


def run(first: float, every: float, seconds: float, late: float = 0.0, seed: int = 0) -> Times:
    """When a key that is held so long is typed; each repeat may be late by up to `late`."""
    noise = random.Random(seed)
    repeats = (first + number * every for number in itertools.count())
    return [0.0, *(at + noise.uniform(0, late) for at in itertools.takewhile(lambda at: at < seconds, repeats))]


def held(grip: Grip, typed: Times, key: str = "i", start: float = 0.0) -> list[tuple[float, float]]:
    """From when to when the key counts as held, looked at as often as the teleop does."""
    spans: list[tuple[float, float]] = []
    began: float | None = None
    left = sorted(typed)
    now = 0.0
    while left or began is not None:
        while left and left[0] <= now:
            grip.type(key, start + left.pop(0))
        grip.expire(start + now)
        if grip.keys and began is None:
            began = now
        elif not grip.keys and began is not None:
            spans.append((began, now))
            began = None
        now += LOOK
    return spans


TERMINALS = [(0.25, 0.03), (0.5, 0.04), (0.66, 0.04), (0.25, 0.092), (0.5, 0.033)]


@pytest.mark.parametrize(("first", "every"), TERMINALS)
def test_a_held_key_never_stutters_and_its_end_is_seen_within_an_interval(first: float, every: float) -> None:
    grip = Grip()
    for number in range(3):
        typed = run(first, every, 1.5)
        ((_, ended),) = held(grip, typed, start=10.0 * number)
        assert ended - typed[-1] <= every + WITHIN
    assert grip.repeat.first == pytest.approx(first, abs=0.01)
    assert grip.repeat.every == pytest.approx(every, abs=0.005)


@pytest.mark.parametrize(("first", "every"), TERMINALS)
def test_a_tap_of_a_known_terminal_lasts_its_first_delay(first: float, every: float) -> None:
    grip = Grip()
    held(grip, [0.0])
    held(grip, run(first, every, 1.5), start=10.0)
    ((began, ended),) = held(grip, [0.0], start=20.0)
    assert first <= ended - began <= 1.1 * first + SLACK + 2 * LOOK


def test_a_tap_of_an_unknown_terminal_lasts_less_than_a_second() -> None:
    ((began, ended),) = held(Grip(), [0.0])
    assert ended - began <= FIRST + SLACK + 2 * LOOK


@pytest.mark.parametrize("seed", range(20))
def test_a_line_that_delays_repeats_makes_it_patient(seed: int) -> None:
    grip = Grip()
    held(grip, run(0.5, 0.03, 1.5))
    spans = held(grip, run(0.5, 0.03, 4.0, late=0.08, seed=seed), start=10.0)
    later = [span for span in spans if span[0] > 2.0]
    assert not later, "it learned how late a repeat may be"


@given(st.lists(st.floats(0.0, 2.0), max_size=30))
def test_whatever_is_typed_a_key_is_let_go_in_time(gaps: list[float]) -> None:
    grip = Grip()
    now = 0.0
    for gap in gaps:
        now += gap
        grip.type("i", now)
        assert grip.patience() <= 1.1 * LONGEST + SLACK
    grip.expire(now + 1.5)
    assert list(grip.keys) == []


def test_two_quick_taps_and_a_hold_do_not_stutter() -> None:
    grip = Grip()
    held(grip, run(0.5, 0.03, 1.5))
    typed = [0.0, *(0.2 + at for at in run(0.5, 0.03, 1.5))]
    assert len(held(grip, typed, start=10.0)) == 1


def test_another_key_takes_the_place_of_a_typed_one() -> None:
    grip = Grip()
    grip.type("i", 1.0)
    grip.type("J", 1.1)
    assert list(grip.keys) == ["J"]


def test_with_a_timeout_a_typed_key_counts_so_long() -> None:
    grip = Grip(timeout=0.3)
    for now in (1.0, 1.2):
        grip.type("i", now)
    assert not grip.expire(1.49)
    assert grip.expire(1.5)
    assert list(grip.keys) == []


def test_pressed_keys_are_held_together_until_each_is_released() -> None:
    grip = Grip()
    grip.press("i", "105")
    grip.press("J", "106")
    assert list(grip.keys) == ["i", "J"]
    assert not grip.expire(1e9)
    assert grip.release("105")
    assert list(grip.keys) == ["J"]
    assert not grip.release("105")
    assert grip.release("106")
    assert list(grip.keys) == []


def test_latched_a_key_counts_until_another() -> None:
    grip = Grip(LATCH)
    grip.type("i", 1.0)
    assert not grip.expire(1e9)
    grip.press("J", "106")
    grip.release("106")
    assert list(grip.keys) == ["J"]
    grip.let_go()
    assert list(grip.keys) == []


@pytest.mark.parametrize("mode", [HOLD, LATCH])
def test_a_key_that_was_let_go_while_it_repeats_counts_only_when_pressed_anew(mode: str) -> None:
    grip = Grip(mode)
    typed = run(0.5, 0.03, 3.0)
    for now in typed[:20]:
        grip.type("i", now)
    grip.let_go()
    for now in typed[20:]:
        assert not grip.type("i", now)
        assert list(grip.keys) == []
    assert grip.type("j", typed[-1] + 0.01), "another key counts at once"
    grip.let_go()
    assert grip.type("i", typed[-1] + 2.0)
    assert list(grip.keys) == ["i"]


def test_a_pressed_key_that_was_let_go_counts_only_when_pressed_anew() -> None:
    grip = Grip()
    grip.press("i", "105")
    grip.let_go()
    assert not grip.release("105")
    grip.press("i", "105")
    assert list(grip.keys) == ["i"]


def test_a_key_that_was_ignored_does_not_count_while_it_repeats() -> None:
    grip = Grip()
    grip.ignore("i", 1.0)
    assert not any(grip.type("i", 1.0 + count * 0.04) for count in range(1, 50))
    assert grip.keys == ()
    assert grip.type("i", 4.0), "it was let go and pressed anew"
