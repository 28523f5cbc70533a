"""What a page says counts by how old it is, and by what it says."""

import asyncio
import json
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import msgspec
import pytest

from holozen.view import protocol, seat
from holozen.view.seat import MAX_AGE, OTHER_ROBOT, SLOW, Seat

S = 1_000_000_000  # ns
HOLD = {
    "type": "hold",
    "press": 1,
    "robot": "a",
    "x": 1,
    "y": 0,
    "turn": 0,
    "speed": 0.5,
    "rate": 1,
    "sent": 7,
}


class Table:
    """A seat of page 7, on robot a, at a time that the test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, look_only: bool = False) -> None:
        self.now, self.sent = 100 * S, list[Any]()
        monkeypatch.setattr(seat, "boot_ns", lambda: self.now)
        self.driver, self.asked = MagicMock(), MagicMock()
        self.driver.beats.return_value = b"robot:5"
        self.drivers: dict[str, Any] = {"a": self.driver}
        self.page = SimpleNamespace(
            number=7,
            robot="a",
            driver=self.driver,
            driver_of=self.drivers.get,
            delay=0.0,
            take=MagicMock(),
        )
        outbox: Any = SimpleNamespace(put=self.sent.append)
        pools = self.asked, self.asked

        async def made() -> Seat:
            page: Any = self.page
            return Seat(
                page, MagicMock(), MagicMock(), outbox, *pools, lambda act: act(), look_only
            )

        self.seat = asyncio.run(made())
        self.beat()

    def beat(self) -> None:
        """Send one beat."""

        async def once() -> None:
            task = asyncio.create_task(self.seat.beat())
            await asyncio.sleep(0)
            task.cancel()

        self.driver.use.return_value = None
        asyncio.run(once())

    def say(self, **fields: Any) -> None:
        self.seat.take(json.dumps(fields))

    def dropped(self) -> list[str]:
        return [one.why for one in self.sent if isinstance(one, protocol.Dropped)]


def test_a_hold_goes_to_the_robot_with_the_beats_that_the_page_had_heard(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    it = Table(monkeypatch)
    assert it.sent == [protocol.Beat(1, 0.0)]
    it.driver.beats.return_value = b"robot:9"
    it.say(**HOLD, echo=1)
    it.driver.hold.assert_called_once_with(7, 1, (0.5, 0.0, 0.0), b"robot:5")
    it.say(type="let_go", press=1, echo=1)
    it.driver.let_go.assert_called_once_with(7, 1, b"robot:5")


def test_a_diagonal_is_no_faster(monkeypatch: pytest.MonkeyPatch) -> None:
    it = Table(monkeypatch)
    it.say(**HOLD | {"y": -1}, echo=1)
    (x, y, _) = it.driver.hold.call_args.args[2]
    assert (x, y) == pytest.approx((0.5 / 2**0.5, -0.5 / 2**0.5))


@pytest.mark.parametrize(
    "message",
    [
        HOLD,
        {"type": "release", "robot": "a"},
        {"type": "resume", "robot": "a"},
        {"type": "simulation", "verb": "play"},
        {"type": "goal", "robot": "a", "u": 0.5, "v": 0.5},
        {"type": "slow_down", "robot": "a", "on": True},
        {"type": "delete", "robot": "a"},
        {"type": "spawn", "model": "b"},
    ],
    ids=lambda one: one["type"],
)
def test_what_moves_or_frees_counts_only_while_it_is_fresh(
    monkeypatch: pytest.MonkeyPatch, message: Any
) -> None:
    for late, echo, counts in (
        (MAX_AGE - 0.01, 1, True),
        (MAX_AGE + 0.01, 1, False),
        (0.0, 0, False),
        (0.0, 2, False),
    ):
        it = Table(monkeypatch)
        it.now += int(late * S)
        it.say(**message, echo=echo)
        assert bool(it.driver.hold.called or it.asked.submit.called) == counts, (late, echo)
        if not counts:
            assert it.dropped() if message is HOLD else it.sent[-1] == protocol.Answer(SLOW, False)


def test_a_stop_counts_at_any_age(monkeypatch: pytest.MonkeyPatch) -> None:
    it = Table(monkeypatch)
    it.now += 60 * S
    it.say(type="stop", robot="a", echo=0)
    it.driver.stop.assert_called_once()
    it.asked.submit.assert_called_once()


def test_a_hold_moves_the_robot_that_it_was_pressed_for_and_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    it = Table(monkeypatch)
    it.say(**HOLD, echo=1)
    it.page.robot = "b"
    it.say(**HOLD, echo=1)
    assert it.dropped() == ["a is not the robot that is chosen"] and it.driver.hold.call_count == 1
    it.driver.let_go.assert_called_once_with(7, 1, b"robot:5")


def test_a_hold_does_not_go_on_with_another_robot_that_takes_the_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    it = Table(monkeypatch)
    it.say(**HOLD, echo=1)
    it.drivers["a"] = other = MagicMock()
    it.say(**HOLD, echo=1)
    assert it.dropped() == [OTHER_ROBOT] and not other.hold.called
    it.driver.let_go.assert_called_once()
    it.say(**HOLD | {"press": 2}, echo=1)
    other.hold.assert_called_once()


@pytest.mark.parametrize("wrong", [{"speed": 80}, {"speed": -0.5}, {"rate": 0}, {"rate": 1e300}])
def test_a_speed_that_no_page_offers_moves_nothing(
    monkeypatch: pytest.MonkeyPatch, wrong: dict[str, float]
) -> None:
    it = Table(monkeypatch)
    it.say(**HOLD | wrong, echo=1)
    assert "is refused; choose" in it.dropped()[0] and not it.driver.hold.called


@pytest.mark.parametrize(
    "wrong",
    [
        '{"type": "fly", "echo": 1}',
        '{"type": "stop", "robot": "a"}',
        '{"type": "stop", "robot": "a", "echo": -1}',
        "[]",
        json.dumps(HOLD | {"echo": 1, "x": 1.01}),
        json.dumps(HOLD | {"echo": 1, "y": "left"}),
        json.dumps(HOLD | {"echo": 1, "more": 1}),
        json.dumps(HOLD | {"echo": 1, "speed": float("nan")}),
        "[" * 100_000,
        "",
    ],
)
def test_what_is_no_message_is_an_error(monkeypatch: pytest.MonkeyPatch, wrong: str) -> None:
    it = Table(monkeypatch)
    with pytest.raises((msgspec.DecodeError, RecursionError)):
        it.seat.take(wrong)
    assert not it.driver.hold.called and not it.driver.stop.called


def test_a_view_to_look_only_moves_nothing_and_frees_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    it = Table(monkeypatch, look_only=True)
    for message in (HOLD, {"type": "stop", "robot": "a"}, {"type": "release", "robot": "a"}):
        it.say(**message, echo=1)
    assert not it.driver.hold.called and not it.driver.stop.called and not it.asked.submit.called


def test_a_page_that_is_gone_lets_go(monkeypatch: pytest.MonkeyPatch) -> None:
    it = Table(monkeypatch)
    it.say(**HOLD, echo=1)
    it.seat.close()
    helm = MagicMock()
    it.driver.use.call_args.args[0](helm, 5.0)
    helm.close.assert_called_once_with(7, 5.0)
