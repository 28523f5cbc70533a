"""A bag is played in time and in order; keys pause and step it, an event ends it."""

import itertools
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.bag.keys import meaning
from holozen.bag.pace import Pace
from holozen.bag.player import LOOK, PAUSE, STEP, Player
from holozen.bag.reader import Channel, Message

A = Channel("a", "", "", "")
MS = 1_000_000  # ns


def messages(*times: int) -> list[Message]:
    """Messages at these ms."""
    return [Message(A, at * MS, b"%d" % at) for at in times]


class Pressed:
    """Keys that are pressed one a look; then nothing for ever."""

    def __init__(self, *keys: str) -> None:
        self.keys, self.looks = list(keys), 0

    def read(self, timeout: float) -> str:
        self.looks += 1
        key = self.keys.pop(0) if self.keys else "wait"
        if key != "wait":
            return key
        time.sleep(timeout)
        return ""


class Played:
    """A player and what it did."""

    def __init__(self, *keys: str, rate: float = 1.0) -> None:
        self.done: list[str] = []
        self.stop, self.keys = threading.Event(), Pressed(*keys)
        self.player = Player(self._publish, lambda: self.done.append("hold"), self.keys, self.stop, rate)
        self.end_after = 10**9

    def _publish(self, message: Message) -> None:
        self.done.append(message.payload.decode())
        if len(self.done) >= self.end_after:
            self.stop.set()


@given(st.floats(0.01, 1000), st.integers(0, 2**62), st.floats(0, 1e6), st.integers(0, 10**13))
def test_a_message_is_due_by_its_distance_from_the_origin_and_the_rate(
    rate: float, at: int, now: float, later: int
) -> None:
    pace = Pace(rate)
    pace.jump(at, now)
    assert pace.due(at) == now
    assert pace.due(at + later) == pytest.approx(now + later / 1e9 / rate)
    assert pace.position(now) == at
    assert pace.position(now + 2.0) == pytest.approx(at + 2e9 * rate)


def test_all_messages_are_played_in_order_and_none_before_its_time() -> None:
    played, begun = Played(), time.monotonic()
    assert played.player.play(messages(1000, 1010, 1030, 1030, 1060))
    assert time.monotonic() - begun >= 0.06
    assert played.done == ["1000", "1010", "1030", "1030", "1060"]
    assert (played.player.count, played.player.position) == (5, 1060 * MS)


def test_a_message_from_before_is_played_at_once() -> None:
    played = Played()
    assert played.player.play(messages(5000, 100, 5001))
    assert played.done == ["5000", "100", "5001"]


def test_a_rate_makes_a_long_bag_short() -> None:
    played = Played(rate=1e6)
    assert played.player.play(messages(0, 3_600_000, 7_200_000))
    assert len(played.done) == 3


def test_an_event_ends_it_between_two_messages() -> None:
    played = Played(rate=1e6)
    played.end_after = 3
    assert not played.player.play(messages(*range(100)))
    assert played.done == ["0", "1", "2"]


def test_a_pause_holds_the_robots_and_each_step_plays_one_message() -> None:
    played = Played("", PAUSE, STEP, STEP)
    played.end_after = 4
    assert not played.player.play(messages(0, 3_600_000, 7_200_000, 10_800_000))
    assert played.done == ["0", "hold", "3600000", "7200000"]


def test_a_step_without_a_pause_does_nothing() -> None:
    played = Played("", STEP, STEP)
    assert played.player.play(messages(0, 10, 20))
    assert played.done == ["0", "10", "20"]


def test_after_a_pause_it_goes_on_where_it_was() -> None:
    played = Played("", PAUSE, "wait", "wait", PAUSE)
    begun = time.monotonic()
    assert played.player.play(messages(0, 100))
    assert time.monotonic() - begun >= 0.1 + 2 * LOOK
    assert played.done == ["0", "hold", "100"]


def test_keys_are_looked_at_also_when_every_message_is_late() -> None:
    played = Played(rate=1e6)
    slow = itertools.islice(messages(*range(1000)), 1000)
    publish = played.player._publish
    played.player._publish = lambda message: (publish(message), time.sleep(0.0002))[0]  # type: ignore[func-returns-value]
    assert played.player.play(slow)
    assert played.keys.looks > 2


@pytest.mark.parametrize(
    ("pressed", "told"),
    [(b" ", PAUSE), (b"s", STEP), (b"\x1b[C", STEP), (b"\x1bOC", STEP), (b"x", ""), (b"\x1b[A", ""), (b"", "")],
)
def test_space_pauses_and_the_right_arrow_steps(pressed: bytes, told: str) -> None:
    assert meaning(pressed) == told
