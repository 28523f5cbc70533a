"""Keys to commands: a key drives, its release stops, a stop is made sure of, and then there is silence."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.messages import Twist, Vector3
from services.teleop.grip import LATCH
from services.teleop.keynames import Key
from services.teleop.layouts import TTK
from services.teleop.pilot import STILL, STOP_FOR, Pilot, Settings

MOVES, SPEEDS = TTK.moves, TTK.speeds
SETTINGS = Settings(speed=0.5, turn=1.0, key_timeout=0.5)
HELD = Settings(speed=0.5, turn=1.0)


@pytest.fixture
def pilot() -> Pilot:
    return Pilot(SETTINGS, TTK)


def typed(pilot: Pilot, key: str, now: float) -> str:
    """A key in a terminal that tells no releases."""
    return pilot.take(Key(key, key), now)


def down(pilot: Pilot, key: str, now: float = 1.0) -> str:
    return pilot.take(Key(key, key, "press", key.lower()), now)


def up(pilot: Pilot, key: str, now: float = 1.0) -> str:
    return pilot.take(Key(key, key, "release", key.lower()), now)


def says(pilot: Pilot, now: float, rests: bool = False) -> Twist | None:
    return pilot.command(now, rests)


def test_an_idle_pilot_is_silent(pilot: Pilot) -> None:
    assert says(pilot, 0.0) is None
    assert not pilot.engaged


@pytest.mark.parametrize("key", MOVES)
def test_a_key_drives_at_the_speeds(pilot: Pilot, key: str) -> None:
    typed(pilot, key, 1.0)
    x, y, z, turn = MOVES[key]
    assert says(pilot, 1.0) == Twist(Vector3(x * 0.5, y * 0.5, z * 0.5), Vector3(0, 0, turn * 1.0))
    assert pilot.engaged


def test_another_key_replaces_the_first(pilot: Pilot) -> None:
    typed(pilot, "i", 1.0)
    typed(pilot, "J", 1.1)
    assert says(pilot, 1.1) == Twist.planar(0, 0.5, 0)


@pytest.mark.parametrize("key", ["k", "K", "space", "5", "s", "ctrl+d", "escape", "é", "unknown"])
def test_any_other_key_stops_the_robot(pilot: Pilot, key: str) -> None:
    typed(pilot, "i", 1.0)
    typed(pilot, key, 1.1)
    assert says(pilot, 1.1) == Twist()


def test_a_key_drives_again_at_once_after_a_stop_key() -> None:
    pilot = Pilot(HELD, TTK)
    typed(pilot, "i", 1.0)
    typed(pilot, "k", 1.2)
    typed(pilot, "i", 1.5)
    assert says(pilot, 1.5) == Twist.planar(0.5)


def test_any_other_key_stops_a_robot_that_somebody_else_drives(pilot: Pilot) -> None:
    typed(pilot, "k", 1.0)
    assert says(pilot, 1.0) == Twist()


def test_without_a_key_for_the_timeout_the_robot_stops(pilot: Pilot) -> None:
    typed(pilot, "i", 1.0)
    assert not pilot.expire(1.499)
    assert says(pilot, 1.499) == Twist.planar(0.5)
    assert pilot.expire(1.5)
    assert not pilot.expire(1.6)  # it just happened, and does not again
    assert says(pilot, 1.6) == Twist()


def test_a_command_never_outlives_the_timeout_even_if_nobody_looked(pilot: Pilot) -> None:
    typed(pilot, "i", 1.0)
    assert says(pilot, 5.0) == Twist()


def test_a_repeated_key_keeps_the_robot_going(pilot: Pilot) -> None:
    for now in (1.0, 1.4, 1.8):
        typed(pilot, "i", now)
    assert says(pilot, 2.2) == Twist.planar(0.5)


def test_a_speed_key_does_not_prolong_a_typed_key(pilot: Pilot) -> None:
    """The terminal repeats the speed key from then on: whether the other is still held cannot be known."""
    typed(pilot, "i", 1.0)
    typed(pilot, "w", 1.4)
    assert says(pilot, 1.45) == Twist.planar(0.55)
    assert says(pilot, 1.5) == Twist()


def test_a_timeout_of_zero_drives_on_until_another_key() -> None:
    pilot = Pilot(Settings(mode=LATCH), TTK)
    typed(pilot, "i", 1.0)
    assert not pilot.expire(1e6)
    assert says(pilot, 1e6) == Twist.planar(0.5)
    typed(pilot, "k", 1e6)
    assert says(pilot, 1e6) == Twist()


def test_a_stop_is_repeated_until_the_robot_rests_and_then_there_is_silence(pilot: Pilot) -> None:
    typed(pilot, "i", 1.0)
    pilot.stop(1.1)
    assert pilot.stopping_since() == 1.1
    for now in (1.1, 1.3, 1.6):
        assert says(pilot, now) == Twist()
    assert pilot.engaged
    assert says(pilot, 1.7, rests=True) is None
    assert says(pilot, 1.8) is None
    assert not pilot.engaged
    assert pilot.stopping_since() is None


def test_a_stop_is_given_up_after_a_second(pilot: Pilot) -> None:
    typed(pilot, "i", 1.0)
    pilot.stop(1.1)
    assert says(pilot, 1.1 + STOP_FOR) == Twist()
    assert says(pilot, 1.1 + STOP_FOR + 1e-6) is None
    assert STOP_FOR == 1.0


def test_a_robot_that_rests_is_driven_all_the_same(pilot: Pilot) -> None:
    typed(pilot, "i", 1.0)
    assert says(pilot, 1.0, rests=True) == Twist.planar(0.5)


def test_a_key_during_a_stop_drives_at_once(pilot: Pilot) -> None:
    typed(pilot, "i", 1.0)
    typed(pilot, "k", 1.1)
    typed(pilot, "j", 1.2)
    assert pilot.stopping_since() is None
    assert says(pilot, 1.2, rests=True) == Twist.planar(turn=1.0)


@pytest.mark.parametrize("key", SPEEDS)
def test_a_speed_key_changes_the_speeds_and_drives_nobody(pilot: Pilot, key: str) -> None:
    typed(pilot, key, 1.0)
    speed, turn = SPEEDS[key]
    assert pilot.settings.speed == pytest.approx(0.5 * speed)
    assert pilot.settings.turn == pytest.approx(1.0 * turn)
    assert says(pilot, 1.0) is None
    assert not pilot.engaged


def test_a_speed_key_takes_effect_while_driving(pilot: Pilot) -> None:
    typed(pilot, "u", 1.0)
    typed(pilot, "q", 1.1)
    assert says(pilot, 1.1) == Twist.planar(0.55, 0, 1.1)


def test_the_limits_hold_from_the_start_and_whatever_is_pressed() -> None:
    pilot = Pilot(Settings(speed=3, turn=4, speed_limit=0.6, turn_limit=1.2), TTK)
    assert (pilot.settings.speed, pilot.settings.turn) == (0.6, 1.2)
    for key in "zzqqqqqqwwee":
        typed(pilot, key, 1.0)
    assert (pilot.settings.speed, pilot.settings.turn) == (0.6, 1.2)


keys = st.lists(
    st.tuples(st.sampled_from([*MOVES, *SPEEDS, "k"]), st.sampled_from([0.0, 0.125, 0.5, 2.0])), max_size=30
)


@given(keys, st.floats(0, 10), st.floats(0, 10))
def test_whatever_is_pressed_the_limits_and_the_timeout_hold(
    pressed: list[tuple[str, float]], speed_limit: float, turn_limit: float
) -> None:
    pilot = Pilot(Settings(speed=5, turn=5, speed_limit=speed_limit, turn_limit=turn_limit, key_timeout=0.5), TTK)
    now = 0.0
    for key, pause in pressed:
        typed(pilot, key, now)
        twist = says(pilot, now)
        if twist:
            assert max(abs(twist.linear.x), abs(twist.linear.y), abs(twist.linear.z)) <= speed_limit
            assert abs(twist.angular.z) <= turn_limit
        now += pause
        later = says(pilot, now)
        assert pause < 0.5 or later is None or later.is_slow()
    assert says(pilot, now + 0.5) in (None, Twist())
    assert says(pilot, now + 0.75 + STOP_FOR) is None
    assert not pilot.engaged


def test_held_keys_drive_until_they_are_released() -> None:
    pilot = Pilot(HELD, TTK)
    down(pilot, "i")
    assert says(pilot, 1e6) == Twist.planar(0.5)
    up(pilot, "i", 1e6)
    assert says(pilot, 1e6) == Twist()


def test_held_keys_combine_and_a_diagonal_is_no_faster() -> None:
    pilot = Pilot(HELD, TTK)
    down(pilot, "i")
    down(pilot, "J")
    down(pilot, "l")
    assert says(pilot, 1.0) == Twist.planar(0.5 / math.sqrt(2), 0.5 / math.sqrt(2), -1.0)
    up(pilot, "i")
    assert says(pilot, 1.0) == Twist.planar(0.0, 0.5, -1.0)
    assert pilot.stopping_since() is None
    up(pilot, "l")
    up(pilot, "J")
    assert says(pilot, 1.0) == Twist()


def test_opposite_keys_cancel_and_that_is_a_stop() -> None:
    pilot = Pilot(HELD, TTK)
    down(pilot, "i")
    down(pilot, ",")
    assert says(pilot, 1.0) == Twist()
    up(pilot, ",")
    assert says(pilot, 1.0) == Twist.planar(0.5)


def test_a_repeat_of_a_key_that_is_not_held_drives_nobody() -> None:
    pilot = Pilot(HELD, TTK)
    pilot.take(Key("i", "i", "repeat", "i"), 1.0)
    assert says(pilot, 1.0) is None


def test_an_unknown_key_lets_go_of_all_that_are_held() -> None:
    pilot = Pilot(HELD, TTK)
    for key in ("i", "J", "k"):
        down(pilot, key)
    assert says(pilot, 1.0) == Twist()
    up(pilot, "k")
    pilot.take(Key("i", "i", "repeat", "i"), 1.1)
    assert not any(pilot.motion)


def test_the_dead_man_has_to_be_held_too() -> None:
    pilot = Pilot(replace(HELD, deadman=True), TTK)
    down(pilot, "i")
    assert says(pilot, 1.0) is None
    down(pilot, "space")
    assert says(pilot, 1.0) == Twist.planar(0.5)
    up(pilot, "space")
    assert says(pilot, 1.0) == Twist()


@given(st.lists(st.tuples(st.booleans(), st.sampled_from([*MOVES, *SPEEDS, "k", "space", "tab"])), max_size=30))
def test_the_dead_man_is_never_forgotten(events: list[tuple[bool, str]]) -> None:
    pilot = Pilot(replace(HELD, deadman=True), TTK)
    for is_down, key in events:
        (down if is_down else up)(pilot, key)
        command = says(pilot, 1.0)
        assert "space" in pilot.grip.keys or command in (None, Twist())


@given(st.lists(st.tuples(st.booleans(), st.sampled_from([*MOVES, "k"])), max_size=30))
def test_no_chord_is_faster_than_the_fastest_key(events: list[tuple[bool, str]]) -> None:
    pilot = Pilot(HELD, TTK)
    for is_down, key in events:
        (down if is_down else up)(pilot, key)
        command = says(pilot, 1.0) or Twist()
        assert math.hypot(command.linear.x, command.linear.y) <= 0.5 * math.sqrt(2) + 1e-9
        assert len(pilot.grip.keys) < 2 or math.hypot(command.linear.x, command.linear.y) <= 0.5 + 1e-9
        assert abs(command.angular.z) <= 1.0


def test_a_joystick_drives_where_no_key_does() -> None:
    pilot = Pilot(HELD, TTK)
    pilot.steer((0.5, -0.25, 1.0), 1.0)
    assert says(pilot, 1.0) == Twist.planar(0.25, -0.125, 1.0)
    down(pilot, "i")
    assert says(pilot, 1.0) == Twist.planar(0.5)
    down(pilot, "k")
    assert says(pilot, 1.0) == Twist()
    pilot.steer((0.5, 0.0, 0.0), 1.1)
    pilot.steer((0.0, 0.0, 0.0), 1.2)
    assert says(pilot, 1.2) == Twist()


def test_a_key_that_no_longer_counts_leaves_the_robot_to_the_joystick() -> None:
    pilot = Pilot(SETTINGS, TTK)
    pilot.steer((0.5, 0.0, 0.0), 1.0)
    typed(pilot, "J", 1.0)
    assert pilot.expire(1.5)
    assert pilot.stopping_since() is None
    assert says(pilot, 1.5) == Twist.planar(0.25)


def test_each_robot_keeps_its_speeds() -> None:
    pilot = Pilot(HELD, TTK)
    pilot.switch("Fred")
    typed(pilot, "w", 1.0)
    pilot.switch("Ginger")
    assert pilot.settings.speed == pytest.approx(0.55)
    typed(pilot, "w", 1.0)
    pilot.switch("Fred")
    assert pilot.settings.speed == pytest.approx(0.55)
    pilot.switch("Ginger")
    assert pilot.settings.speed == pytest.approx(0.605)


@pytest.mark.parametrize(
    ("key", "action"),
    [("r", "resume"), ("tab", "next_robot"), ("?", "help"), ("ctrl+c", "quit"), ("ctrl+z", "suspend")],
)
def test_some_keys_ask_for_more_than_motion(pilot: Pilot, key: str, action: str) -> None:
    assert typed(pilot, key, 1.0) == action
    assert up(pilot, key) == ""


def test_a_key_that_is_typed_again_after_the_stop_key_drives_again(pilot: Pilot) -> None:
    typed(pilot, "i", 1.0)
    typed(pilot, "k", 1.2)
    assert pilot.motion == STILL
    typed(pilot, "i", 1.4)
    assert pilot.motion != STILL
