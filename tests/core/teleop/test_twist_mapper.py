"""Keys to commands: a key drives, its release stops, the stop is repeated until it takes effect,
and then nothing is sent.
"""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from holozen.messages import Twist, Vector3
from services.teleop.control.key_state import LATCH
from services.teleop.control.layouts import TTK
from services.teleop.control.twist_mapper import STILL, STOP_FOR, Settings, TwistMapper
from services.teleop.input.kitty import Key

MOVES, SPEEDS = TTK.moves, TTK.speeds
SETTINGS = Settings(speed=0.5, turn=1.0, key_timeout=0.5)
HELD = Settings(speed=0.5, turn=1.0)


@pytest.fixture
def mapper() -> TwistMapper:
    return TwistMapper(SETTINGS, TTK)


def typed(mapper: TwistMapper, key: str, now: float) -> str:
    """A key typed in a terminal that reports no releases."""
    return mapper.take(Key(key, key), now)


def down(mapper: TwistMapper, key: str, now: float = 1.0) -> str:
    return mapper.take(Key(key, key, "press", key.lower()), now)


def up(mapper: TwistMapper, key: str, now: float = 1.0) -> str:
    return mapper.take(Key(key, key, "release", key.lower()), now)


def commanded(mapper: TwistMapper, now: float, rests: bool = False) -> Twist | None:
    return mapper.command(now, rests)


def test_an_idle_mapper_is_silent(mapper: TwistMapper) -> None:
    assert commanded(mapper, 0.0) is None
    assert not mapper.engaged


def test_a_key_drives_at_the_speeds() -> None:
    for key, (x, y, z, turn) in MOVES.items():
        mapper = TwistMapper(SETTINGS, TTK)
        typed(mapper, key, 1.0)
        expected = Twist(Vector3(x * 0.5, y * 0.5, z * 0.5), Vector3(0, 0, turn * 1.0))
        assert commanded(mapper, 1.0) == expected, key
        assert mapper.engaged


def test_another_key_replaces_the_first(mapper: TwistMapper) -> None:
    typed(mapper, "i", 1.0)
    typed(mapper, "J", 1.1)
    assert commanded(mapper, 1.1) == Twist.planar(0, 0.5, 0)


def test_any_other_key_stops_the_robot() -> None:
    for key in ("k", "K", "space", "5", "s", "ctrl+d", "escape", "é", "unknown"):
        mapper = TwistMapper(SETTINGS, TTK)
        typed(mapper, "i", 1.0)
        typed(mapper, key, 1.1)
        assert commanded(mapper, 1.1) == Twist(), key


def test_a_key_drives_again_at_once_after_a_stop_key() -> None:
    for settings in (SETTINGS, HELD):
        mapper = TwistMapper(settings, TTK)
        typed(mapper, "i", 1.0)
        typed(mapper, "k", 1.2)
        assert mapper.motion == STILL
        typed(mapper, "i", 1.5)
        assert commanded(mapper, 1.5) == Twist.planar(0.5)


def test_any_other_key_stops_a_robot_that_another_source_drives(mapper: TwistMapper) -> None:
    typed(mapper, "k", 1.0)
    assert commanded(mapper, 1.0) == Twist()


def test_without_a_key_for_the_timeout_the_robot_stops(mapper: TwistMapper) -> None:
    typed(mapper, "i", 1.0)
    assert not mapper.expire(1.499)
    assert commanded(mapper, 1.499) == Twist.planar(0.5)
    assert mapper.expire(1.5)
    assert not mapper.expire(1.6)  # it just happened, and does not again
    assert commanded(mapper, 1.6) == Twist()


def test_a_command_never_outlives_the_timeout_even_without_a_tick(mapper: TwistMapper) -> None:
    typed(mapper, "i", 1.0)
    assert commanded(mapper, 5.0) == Twist()


def test_a_repeated_key_keeps_the_robot_going(mapper: TwistMapper) -> None:
    for now in (1.0, 1.4, 1.8):
        typed(mapper, "i", now)
    assert commanded(mapper, 2.2) == Twist.planar(0.5)


def test_a_speed_key_does_not_prolong_a_typed_key(mapper: TwistMapper) -> None:
    """The terminal repeats the speed key from then on: whether the other key is still held is
    unknown.
    """
    typed(mapper, "i", 1.0)
    typed(mapper, "w", 1.4)
    assert commanded(mapper, 1.45) == Twist.planar(0.55)
    assert commanded(mapper, 1.5) == Twist()


def test_a_timeout_of_zero_drives_on_until_another_key() -> None:
    mapper = TwistMapper(Settings(mode=LATCH), TTK)
    typed(mapper, "i", 1.0)
    assert not mapper.expire(1e6)
    assert commanded(mapper, 1e6) == Twist.planar(0.5)
    typed(mapper, "k", 1e6)
    assert commanded(mapper, 1e6) == Twist()


def test_a_stop_is_repeated_until_the_robot_rests_and_then_there_is_silence(
    mapper: TwistMapper,
) -> None:
    typed(mapper, "i", 1.0)
    mapper.stop(1.1)
    assert mapper.stopping_since() == 1.1
    for now in (1.1, 1.3, 1.6):
        assert commanded(mapper, now) == Twist()
    assert mapper.engaged
    assert commanded(mapper, 1.7, rests=True) is None
    assert commanded(mapper, 1.8) is None
    assert not mapper.engaged
    assert mapper.stopping_since() is None


def test_a_stop_is_given_up_after_a_second(mapper: TwistMapper) -> None:
    typed(mapper, "i", 1.0)
    mapper.stop(1.1)
    assert commanded(mapper, 1.1 + STOP_FOR) == Twist()
    assert commanded(mapper, 1.1 + STOP_FOR + 1e-6) is None
    assert STOP_FOR == 1.0


def test_a_robot_at_rest_can_still_be_driven(mapper: TwistMapper) -> None:
    typed(mapper, "i", 1.0)
    assert commanded(mapper, 1.0, rests=True) == Twist.planar(0.5)


def test_a_key_during_a_stop_drives_at_once(mapper: TwistMapper) -> None:
    typed(mapper, "i", 1.0)
    typed(mapper, "k", 1.1)
    typed(mapper, "j", 1.2)
    assert mapper.stopping_since() is None
    assert commanded(mapper, 1.2, rests=True) == Twist.planar(turn=1.0)


def test_a_speed_key_changes_the_speeds_and_moves_nothing() -> None:
    for key, (speed, turn) in SPEEDS.items():
        mapper = TwistMapper(SETTINGS, TTK)
        typed(mapper, key, 1.0)
        assert mapper.settings.speed == pytest.approx(0.5 * speed), key
        assert mapper.settings.turn == pytest.approx(1.0 * turn), key
        assert commanded(mapper, 1.0) is None
        assert not mapper.engaged


def test_a_speed_key_takes_effect_while_driving(mapper: TwistMapper) -> None:
    typed(mapper, "u", 1.0)
    typed(mapper, "q", 1.1)
    assert commanded(mapper, 1.1) == Twist.planar(0.55, 0, 1.1)


def test_the_limits_hold_from_the_start_and_whatever_is_pressed() -> None:
    mapper = TwistMapper(Settings(speed=3, turn=4, speed_limit=0.6, turn_limit=1.2), TTK)
    assert (mapper.settings.speed, mapper.settings.turn) == (0.6, 1.2)
    for key in "zzqqqqqqwwee":
        typed(mapper, key, 1.0)
    assert (mapper.settings.speed, mapper.settings.turn) == (0.6, 1.2)


keys = st.lists(
    st.tuples(st.sampled_from([*MOVES, *SPEEDS, "k"]), st.sampled_from([0.0, 0.125, 0.5, 2.0])),
    max_size=30,
)


@given(keys, st.floats(0, 10), st.floats(0, 10))
def test_whatever_is_pressed_the_limits_and_the_timeout_hold(
    pressed: list[tuple[str, float]], speed_limit: float, turn_limit: float
) -> None:
    mapper = TwistMapper(
        Settings(speed=5, turn=5, speed_limit=speed_limit, turn_limit=turn_limit, key_timeout=0.5),
        TTK,
    )
    now = 0.0
    for key, pause in pressed:
        typed(mapper, key, now)
        twist = commanded(mapper, now)
        if twist:
            assert max(abs(twist.linear.x), abs(twist.linear.y), abs(twist.linear.z)) <= speed_limit
            assert abs(twist.angular.z) <= turn_limit
        now += pause
        later = commanded(mapper, now)
        assert pause < 0.5 or later is None or later.is_slow()
    assert commanded(mapper, now + 0.5) in (None, Twist())
    assert commanded(mapper, now + 0.75 + STOP_FOR) is None
    assert not mapper.engaged


def test_held_keys_drive_until_they_are_released() -> None:
    mapper = TwistMapper(HELD, TTK)
    down(mapper, "i")
    assert commanded(mapper, 1e6) == Twist.planar(0.5)
    up(mapper, "i", 1e6)
    assert commanded(mapper, 1e6) == Twist()


def test_held_keys_combine_and_a_diagonal_is_no_faster() -> None:
    mapper = TwistMapper(HELD, TTK)
    down(mapper, "i")
    down(mapper, "J")
    down(mapper, "l")
    assert commanded(mapper, 1.0) == Twist.planar(0.5 / math.sqrt(2), 0.5 / math.sqrt(2), -1.0)
    up(mapper, "i")
    assert commanded(mapper, 1.0) == Twist.planar(0.0, 0.5, -1.0)
    assert mapper.stopping_since() is None
    up(mapper, "l")
    up(mapper, "J")
    assert commanded(mapper, 1.0) == Twist()


def test_opposite_keys_cancel_and_that_is_a_stop() -> None:
    mapper = TwistMapper(HELD, TTK)
    down(mapper, "i")
    down(mapper, ",")
    assert commanded(mapper, 1.0) == Twist()
    up(mapper, ",")
    assert commanded(mapper, 1.0) == Twist.planar(0.5)


def test_a_repeat_of_a_key_that_is_not_held_moves_nothing() -> None:
    mapper = TwistMapper(HELD, TTK)
    mapper.take(Key("i", "i", "repeat", "i"), 1.0)
    assert commanded(mapper, 1.0) is None


def test_an_unknown_key_lets_go_of_all_that_are_held() -> None:
    mapper = TwistMapper(HELD, TTK)
    for key in ("i", "J", "k"):
        down(mapper, key)
    assert commanded(mapper, 1.0) == Twist()
    up(mapper, "k")
    mapper.take(Key("i", "i", "repeat", "i"), 1.1)
    assert not any(mapper.motion)


def test_the_dead_man_has_to_be_held_too() -> None:
    mapper = TwistMapper(replace(HELD, deadman=True), TTK)
    down(mapper, "i")
    assert commanded(mapper, 1.0) is None
    down(mapper, "space")
    assert commanded(mapper, 1.0) == Twist.planar(0.5)
    up(mapper, "space")
    assert commanded(mapper, 1.0) == Twist()


@given(
    st.lists(
        st.tuples(st.booleans(), st.sampled_from([*MOVES, *SPEEDS, "k", "space", "tab"])),
        max_size=30,
    )
)
def test_the_dead_man_is_never_forgotten(events: list[tuple[bool, str]]) -> None:
    mapper = TwistMapper(replace(HELD, deadman=True), TTK)
    for is_down, key in events:
        (down if is_down else up)(mapper, key)
        command = commanded(mapper, 1.0)
        assert "space" in mapper.key_state.keys or command in (None, Twist())


@given(st.lists(st.tuples(st.booleans(), st.sampled_from([*MOVES, "k"])), max_size=30))
def test_no_chord_is_faster_than_the_fastest_key(events: list[tuple[bool, str]]) -> None:
    mapper = TwistMapper(HELD, TTK)
    for is_down, key in events:
        (down if is_down else up)(mapper, key)
        command = commanded(mapper, 1.0) or Twist()
        assert math.hypot(command.linear.x, command.linear.y) <= 0.5 * math.sqrt(2) + 1e-9
        assert (
            len(mapper.key_state.keys) < 2
            or math.hypot(command.linear.x, command.linear.y) <= 0.5 + 1e-9
        )
        assert abs(command.angular.z) <= 1.0


def test_a_joystick_drives_where_no_key_does() -> None:
    mapper = TwistMapper(HELD, TTK)
    mapper.steer((0.5, -0.25, 1.0), 1.0)
    assert commanded(mapper, 1.0) == Twist.planar(0.25, -0.125, 1.0)
    down(mapper, "i")
    assert commanded(mapper, 1.0) == Twist.planar(0.5)
    down(mapper, "k")
    assert commanded(mapper, 1.0) == Twist()
    mapper.steer((0.5, 0.0, 0.0), 1.1)
    mapper.steer((0.0, 0.0, 0.0), 1.2)
    assert commanded(mapper, 1.2) == Twist()


def test_a_key_that_no_longer_counts_leaves_the_robot_to_the_joystick() -> None:
    mapper = TwistMapper(SETTINGS, TTK)
    mapper.steer((0.5, 0.0, 0.0), 1.0)
    typed(mapper, "J", 1.0)
    assert mapper.expire(1.5)
    assert mapper.stopping_since() is None
    assert commanded(mapper, 1.5) == Twist.planar(0.25)


def test_each_robot_keeps_its_speeds() -> None:
    mapper = TwistMapper(HELD, TTK)
    mapper.switch("Fred")
    typed(mapper, "w", 1.0)
    mapper.switch("Ginger")
    assert mapper.settings.speed == pytest.approx(0.55)
    typed(mapper, "w", 1.0)
    mapper.switch("Fred")
    assert mapper.settings.speed == pytest.approx(0.55)
    mapper.switch("Ginger")
    assert mapper.settings.speed == pytest.approx(0.605)


def test_some_keys_ask_for_more_than_motion() -> None:
    actions = {
        "r": "resume",
        "tab": "next_robot",
        "?": "help",
        "ctrl+c": "quit",
        "ctrl+z": "suspend",
    }
    for key, action in actions.items():
        mapper = TwistMapper(SETTINGS, TTK)
        assert typed(mapper, key, 1.0) == action
        assert up(mapper, key) == ""
