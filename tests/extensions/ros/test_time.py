"""Time and Duration: whole nanoseconds, and what they may be compared with."""

import copy
import operator
from collections.abc import Callable
from typing import Any

import pytest

from holozen.messages import Time as OurTime
from holozen.ros.generated import find
from holozen.ros.rclpy.time import ClockType, Duration, Infinite, Time

COMPARISONS = (operator.eq, operator.ne, operator.lt, operator.le, operator.gt, operator.ge)


def test_seconds_and_nanoseconds_add_up() -> None:
    time = Time(seconds=1.5, nanoseconds=7)
    assert (time.nanoseconds, time.seconds_nanoseconds()) == (1_500_000_007, (1, 500_000_007))
    assert Duration(seconds=-0.5, nanoseconds=1).nanoseconds == -499_999_999
    assert Time().clock_type == ClockType.SYSTEM_TIME


def test_times_and_durations_are_added_and_subtracted() -> None:
    start, span = Time(seconds=10, clock_type=ClockType.ROS_TIME), Duration(seconds=4)
    assert start + span == span + start == Time(seconds=14, clock_type=ClockType.ROS_TIME)
    assert start - span == Time(seconds=6, clock_type=ClockType.ROS_TIME)
    assert (start - span) - start == Duration(seconds=-4)
    assert span + span == 2 * span == Duration(seconds=8)
    assert span - 3 * span == Duration(seconds=-8)


def test_they_are_compared_hashed_and_shown() -> None:
    assert Time(seconds=1) < Time(seconds=2) <= Time(seconds=2) != Time(seconds=3)
    assert Duration(seconds=2) > Duration(seconds=1) >= Duration(seconds=-1)
    assert Duration(seconds=9e9) < Infinite
    assert (
        len({Time(seconds=1), Time(nanoseconds=10**9), Duration(seconds=1), Duration(seconds=1)})
        == 2
    )
    assert repr(Time(nanoseconds=5)) == "Time(nanoseconds=5, clock_type=SYSTEM_TIME)"
    assert (repr(Duration(nanoseconds=5)), str(Duration(nanoseconds=5))) == (
        "Duration(nanoseconds=5)",
        "5 nanoseconds",
    )
    assert copy.deepcopy(Time(seconds=1)) == Time(seconds=1)


def test_only_their_own_kind_is_compared_with_them() -> None:
    others: list[Any] = [5, 5.0, None, "5", OurTime(), Duration(seconds=1), Time(seconds=1)]
    for other in others:
        for compare in COMPARISONS:
            for one in (Time(seconds=1, clock_type=ClockType.STEADY_TIME), Duration(seconds=1)):
                if not (isinstance(one, Duration) and isinstance(other, Duration)):
                    with pytest.raises(TypeError, match="cannot compare"):
                        compare(one, other)


def test_times_of_two_clocks_are_not_subtracted() -> None:
    with pytest.raises(TypeError, match="different clock types: ROS_TIME, SYSTEM_TIME"):
        Time(clock_type=ClockType.ROS_TIME) - Time()
    for compute, one, other in (
        (operator.add, Time(), 1),
        (operator.sub, Time(), 1),
        (operator.add, Time(), Time()),
        (operator.add, Duration(), 1),
        (operator.mul, Duration(), True),
    ):
        with pytest.raises(TypeError):
            compute(one, other)


def test_no_time_is_before_zero_or_beyond_64_bits() -> None:
    for name in ("seconds", "nanoseconds"):
        with pytest.raises(ValueError, match=f"^{name} value must not be negative, and is -1"):
            Time(**{name: -1})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="before the clock's zero"):
        Time(seconds=1) - Duration(seconds=2)
    computations: list[Callable[[], object]] = [
        lambda: Time(seconds=1e10),
        lambda: Duration(seconds=-1e10),
        lambda: Time(seconds=1) + Infinite,
    ]
    for too_long in computations:
        with pytest.raises(OverflowError, match="64 bits"):
            too_long()
    with pytest.raises(TypeError, match="seconds of a duration must be a number; '1' is a str"):
        Duration(seconds="1")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="use a ClockType"):
        Time(clock_type=1)  # type: ignore[arg-type]


def test_they_are_made_of_messages_and_into_messages() -> None:
    time, span = Time(seconds=3, nanoseconds=5), Duration(seconds=-0.25)
    assert time.to_msg() == find("builtin_interfaces/msg/Time")(sec=3, nanosec=5)
    assert span.to_msg() == find("builtin_interfaces/msg/Duration")(sec=-1, nanosec=750_000_000)
    assert Time.from_msg(time.to_msg(), ClockType.SYSTEM_TIME) == time
    assert Time.from_msg(time.to_msg()).clock_type == ClockType.ROS_TIME
    assert Time.from_msg(OurTime(3, 5)).nanoseconds == 3_000_000_005
    assert Duration.from_msg(span.to_msg()) == span
    for wrong in (lambda: Time.from_msg(span.to_msg()), lambda: Duration.from_msg(time.to_msg())):
        with pytest.raises(TypeError, match=r"pass a builtin_interfaces\.msg\."):
            wrong()
