"""Keys to commands: a key drives, its release stops, a stop is made sure of, and then there is silence."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.messages import Twist, Vector3
from services.teleop.keymap import MOVES, SPEEDS
from services.teleop.pilot import STOP_FOR, Pilot, Settings

SETTINGS = Settings(speed=0.5, turn=1.0, key_timeout=0.5)


@pytest.fixture
def pilot() -> Pilot:
    return Pilot(SETTINGS)


def says(pilot: Pilot, now: float, rests: bool = False) -> Twist | None:
    return pilot.command(now, rests)


def test_an_idle_pilot_is_silent(pilot: Pilot) -> None:
    assert says(pilot, 0.0) is None
    assert not pilot.engaged


@pytest.mark.parametrize("key", MOVES)
def test_a_key_drives_at_the_speeds(pilot: Pilot, key: str) -> None:
    pilot.press(key, 1.0)
    x, y, z, turn = MOVES[key]
    assert says(pilot, 1.0) == Twist(Vector3(x * 0.5, y * 0.5, z * 0.5), Vector3(0, 0, turn * 1.0))
    assert pilot.engaged


def test_another_key_replaces_the_first(pilot: Pilot) -> None:
    pilot.press("i", 1.0)
    pilot.press("J", 1.1)
    assert says(pilot, 1.1) == Twist.planar(0, 0.5, 0)


@pytest.mark.parametrize("key", ["k", "K", " ", "5", "s", "c-d", "escape", "é", "\udcff"])
def test_any_other_key_stops_the_robot(pilot: Pilot, key: str) -> None:
    pilot.press("i", 1.0)
    pilot.press(key, 1.1)
    assert says(pilot, 1.1) == Twist()


def test_any_other_key_stops_a_robot_that_somebody_else_drives(pilot: Pilot) -> None:
    pilot.press("k", 1.0)
    assert says(pilot, 1.0) == Twist()


def test_without_a_key_for_the_timeout_the_robot_stops(pilot: Pilot) -> None:
    pilot.press("i", 1.0)
    assert not pilot.expire(1.499)
    assert says(pilot, 1.499) == Twist.planar(0.5)
    assert pilot.expire(1.5)
    assert not pilot.expire(1.6)  # it just happened, and does not again
    assert says(pilot, 1.6) == Twist()


def test_a_command_never_outlives_the_timeout_even_if_nobody_looked(pilot: Pilot) -> None:
    pilot.press("i", 1.0)
    assert says(pilot, 5.0) == Twist()


def test_a_repeated_key_keeps_the_robot_going(pilot: Pilot) -> None:
    for now in (1.0, 1.4, 1.8):
        pilot.press("i", now)
    assert says(pilot, 2.2) == Twist.planar(0.5)


def test_a_speed_key_while_driving_counts_as_a_key(pilot: Pilot) -> None:
    pilot.press("i", 1.0)
    pilot.press("w", 1.4)
    assert says(pilot, 1.8) == Twist.planar(0.55)


def test_a_timeout_of_zero_drives_on_until_another_key() -> None:
    pilot = Pilot(Settings(key_timeout=0))
    pilot.press("i", 1.0)
    assert not pilot.expire(1e6)
    assert says(pilot, 1e6) == Twist.planar(0.5)
    pilot.press("k", 1e6)
    assert says(pilot, 1e6) == Twist()


def test_a_stop_is_repeated_until_the_robot_rests_and_then_there_is_silence(pilot: Pilot) -> None:
    pilot.press("i", 1.0)
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
    pilot.press("i", 1.0)
    pilot.stop(1.1)
    assert says(pilot, 1.1 + STOP_FOR) == Twist()
    assert says(pilot, 1.1 + STOP_FOR + 1e-6) is None
    assert STOP_FOR == 1.0


def test_a_robot_that_rests_is_driven_all_the_same(pilot: Pilot) -> None:
    pilot.press("i", 1.0)
    assert says(pilot, 1.0, rests=True) == Twist.planar(0.5)


def test_a_key_during_a_stop_drives_at_once(pilot: Pilot) -> None:
    pilot.press("i", 1.0)
    pilot.press("k", 1.1)
    pilot.press("j", 1.2)
    assert pilot.stopping_since() is None
    assert says(pilot, 1.2, rests=True) == Twist.planar(turn=1.0)


@pytest.mark.parametrize("key", SPEEDS)
def test_a_speed_key_changes_the_speeds_and_drives_nobody(pilot: Pilot, key: str) -> None:
    pilot.press(key, 1.0)
    speed, turn = SPEEDS[key]
    assert pilot.settings.speed == pytest.approx(0.5 * speed)
    assert pilot.settings.turn == pytest.approx(1.0 * turn)
    assert says(pilot, 1.0) is None
    assert not pilot.engaged


def test_a_speed_key_takes_effect_while_driving(pilot: Pilot) -> None:
    pilot.press("u", 1.0)
    pilot.press("q", 1.1)
    assert says(pilot, 1.1) == Twist.planar(0.55, 0, 1.1)


def test_the_limits_hold_from_the_start_and_whatever_is_pressed() -> None:
    pilot = Pilot(Settings(speed=3, turn=4, speed_limit=0.6, turn_limit=1.2))
    assert (pilot.settings.speed, pilot.settings.turn) == (0.6, 1.2)
    for key in "zzqqqqqqwwee":
        pilot.press(key, 1.0)
    assert (pilot.settings.speed, pilot.settings.turn) == (0.6, 1.2)


keys = st.lists(
    st.tuples(st.sampled_from([*MOVES, *SPEEDS, "k"]), st.sampled_from([0.0, 0.125, 0.5, 2.0])), max_size=30
)


@given(keys, st.floats(0, 10), st.floats(0, 10))
def test_whatever_is_pressed_the_limits_and_the_timeout_hold(
    pressed: list[tuple[str, float]], speed_limit: float, turn_limit: float
) -> None:
    pilot = Pilot(Settings(speed=5, turn=5, speed_limit=speed_limit, turn_limit=turn_limit))
    now = 0.0
    for key, pause in pressed:
        pilot.press(key, now)
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
