"""A gamepad's events become a direction: only while the dead-man is held, without the sticks' play,
never too fast.
"""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.input.gamepad import (
    ABS_HAT0Y,
    ABS_RX,
    ABS_X,
    ABS_Y,
    BTN_DPAD_DOWN,
    BTN_DPAD_UP,
    BTN_SOUTH,
    BTN_START,
    BTN_TL,
    DEAD_ZONE,
    EV_ABS,
    EV_KEY,
    EV_SYN,
    REST,
    SYN_DROPPED,
    SYN_REPORT,
    Gamepad,
    stick,
)

XBOX, DUALSHOCK = (-32768, 32767), (0, 255)
AHEAD = pytest.approx((1, 0, 0), abs=1e-4)  # a pad of whole numbers has no exact middle
PADS = pytest.mark.parametrize("limits", [XBOX, DUALSHOCK], ids=["xbox", "dualshock"])


def pad(
    limits: tuple[int, int] = XBOX, down: frozenset[int] = frozenset(), hat: int = 0
) -> Gamepad:
    axes = (ABS_X, ABS_Y, ABS_RX)
    made = Gamepad(dict.fromkeys(axes, limits))
    made.begin({**dict.fromkeys(axes, (limits[0] + limits[1] + 1) // 2), ABS_HAT0Y: hat}, down)
    return made


def held(limits: tuple[int, int] = XBOX) -> Gamepad:
    made = pad(limits)
    made.take(EV_KEY, BTN_TL, 1)
    return made


@PADS
def test_a_stick_at_rest_goes_nowhere(limits: tuple[int, int]) -> None:
    assert held(limits).direction == REST


@PADS
def test_a_stick_at_its_end_goes_that_way_at_full_speed(limits: tuple[int, int]) -> None:
    rows = [
        (ABS_Y, 0, (1, 0, 0)),
        (ABS_Y, 1, (-1, 0, 0)),
        (ABS_X, 0, (0, 1, 0)),
        (ABS_X, 1, (0, -1, 0)),
        (ABS_RX, 0, (0, 0, 1)),
        (ABS_RX, 1, (0, 0, -1)),
    ]
    for axis, end, direction in rows:
        made = held(limits)
        made.take(EV_ABS, axis, limits[end])
        assert made.direction == pytest.approx(direction, abs=0.005)


@PADS
def test_a_corner_is_no_faster_than_an_end(limits: tuple[int, int]) -> None:
    made = held(limits)
    made.take(EV_ABS, ABS_X, limits[1])
    made.take(EV_ABS, ABS_Y, limits[0])
    made.take(EV_ABS, ABS_RX, limits[0])
    assert made.direction == pytest.approx((math.sqrt(0.5), -math.sqrt(0.5), 1))


def test_a_value_beyond_the_range_counts_as_its_end() -> None:
    made = held()
    made.take(EV_ABS, ABS_X, 2**31 - 1)
    made.take(EV_ABS, ABS_Y, -32768)
    assert made.direction == pytest.approx((math.sqrt(0.5), -math.sqrt(0.5), 0), abs=1e-4)


def test_nothing_goes_without_the_dead_man() -> None:
    made = pad()
    made.take(EV_ABS, ABS_Y, -32768)
    assert made.direction == REST
    made.take(EV_KEY, BTN_TL, 1)
    assert made.direction == AHEAD
    made.take(EV_KEY, BTN_TL, 0)
    assert made.direction == REST


def test_a_dead_man_that_was_held_from_before_does_not_count_until_it_was_released() -> None:
    made = pad(down=frozenset({BTN_TL}))
    made.take(EV_ABS, ABS_Y, -32768)
    made.take(EV_KEY, BTN_TL, 2)
    made.take(EV_KEY, BTN_TL, 1)
    assert made.direction == REST
    made.take(EV_KEY, BTN_TL, 0)
    assert made.direction == REST
    made.take(EV_KEY, BTN_TL, 1)
    assert made.direction == AHEAD


def test_another_button_is_no_dead_man() -> None:
    made = pad()
    made.take(EV_ABS, ABS_Y, -32768)
    for button in (BTN_SOUTH, BTN_START, BTN_TL + 1):
        made.take(EV_KEY, button, 1)
    assert made.direction == REST


def test_lost_events_let_go_until_the_state_is_read_and_the_dead_man_pressed_again() -> None:
    made = held()
    made.take(EV_ABS, ABS_Y, -32768)
    made.take(EV_SYN, SYN_DROPPED, 0)
    assert made.direction == REST
    assert made.lost
    for event in (
        (EV_KEY, BTN_TL, 0),
        (EV_KEY, BTN_TL, 1),
        (EV_KEY, BTN_START, 1),
        (EV_SYN, SYN_REPORT, 0),
    ):
        assert made.take(*event) == ""
    assert made.direction == REST
    made.begin({ABS_X: 0, ABS_Y: -32768, ABS_RX: 0}, {BTN_TL})
    assert not made.lost
    assert made.direction == REST
    made.take(EV_KEY, BTN_TL, 0)
    made.take(EV_KEY, BTN_TL, 1)
    assert made.direction == AHEAD


def test_letting_go_takes_a_release_and_a_new_press() -> None:
    made = held()
    made.take(EV_ABS, ABS_Y, -32768)
    made.let_go()
    made.take(EV_KEY, BTN_TL, 1)
    assert made.direction == REST


def test_buttons_ask_for_actions_when_they_go_down_and_not_when_they_repeat() -> None:
    made = pad()
    for button, action in (
        (BTN_START, "resume"),
        (BTN_DPAD_UP, "faster"),
        (BTN_DPAD_DOWN, "slower"),
    ):
        assert [made.take(EV_KEY, button, value) for value in (1, 2, 0, 1)] == [
            action,
            "",
            "",
            action,
        ]
    assert made.take(EV_KEY, BTN_SOUTH, 1) == ""


def test_a_cross_that_is_an_axis_asks_once_each_time_it_is_tilted() -> None:
    made = pad()
    assert [made.take(EV_ABS, ABS_HAT0Y, value) for value in (-1, -1, 0, 1, -1, 0)] == [
        "faster",
        "",
        "",
        "slower",
        "faster",
        "",
    ]


def test_a_cross_that_is_tilted_at_the_start_asks_for_nothing() -> None:
    assert pad(hat=-1).take(EV_ABS, ABS_HAT0Y, -1) == ""


def test_the_dead_zone_is_round_and_speed_starts_at_zero_behind_it() -> None:
    assert stick(DEAD_ZONE, 0) == (0, 0)
    assert stick(DEAD_ZONE * 0.7, DEAD_ZONE * 0.7) == (0, 0)
    assert stick(DEAD_ZONE * 0.8, DEAD_ZONE * 0.8) != (0, 0)
    assert stick(DEAD_ZONE + 1e-6, 0) == pytest.approx((0, 0), abs=1e-5)
    assert stick((1 + DEAD_ZONE) / 2, 0) == pytest.approx((0.5, 0))


UNIT = st.floats(-1, 1)
NUMBERS = st.integers(-(2**31), 2**31 - 1)
EVENTS = st.tuples(
    st.sampled_from([EV_SYN, EV_KEY, EV_ABS, 4, 21]),
    st.sampled_from([ABS_X, ABS_Y, ABS_RX, ABS_HAT0Y, BTN_TL, BTN_START, SYN_DROPPED, 0x2FF]),
    st.one_of(st.sampled_from([0, 1, 2, -1]), NUMBERS),
)


@given(UNIT, UNIT)
def test_a_stick_keeps_its_direction_and_is_never_longer_than_one(x: float, y: float) -> None:
    u, v = stick(x, y)
    assert math.hypot(u, v) <= 1 + 1e-12
    assert abs(u) <= 1 and abs(v) <= 1
    assert u * x >= 0 and v * y >= 0
    assert u * y == pytest.approx(v * x, abs=1e-9)


@given(UNIT, st.floats(0, 1), st.floats(0, 1))
def test_farther_out_is_never_slower(angle: float, near: float, far: float) -> None:
    near, far = sorted((near, far))
    at = [
        math.hypot(*stick(r * math.cos(math.pi * angle), r * math.sin(math.pi * angle)))
        for r in (near, far)
    ]
    assert at[0] <= at[1] + 1e-9


@given(
    st.lists(
        st.tuples(NUMBERS, NUMBERS).filter(lambda ends: ends[0] < ends[1]), min_size=3, max_size=3
    ),
    st.lists(EVENTS, max_size=40),
)
def test_whatever_comes_the_direction_is_bounded_and_zero_without_the_dead_man(
    limits: list[tuple[int, int]], events: list[tuple[int, int, int]]
) -> None:
    made = Gamepad(dict(zip((ABS_X, ABS_Y, ABS_RX), limits, strict=True)))
    made.begin({}, set())
    down = dropped = False
    for kind, code, value in events:
        assert made.take(kind, code, value) in ("", "resume", "faster", "slower")
        dropped = dropped or (kind, code) == (EV_SYN, SYN_DROPPED)
        down = bool(value) if (kind, code) == (EV_KEY, BTN_TL) else down
        forward, left, turn = made.direction
        assert (
            math.hypot(forward, left) <= 1 + 1e-12 and max(abs(forward), abs(left), abs(turn)) <= 1
        )
        assert made.direction == REST or (down and not dropped)
