"""Timers keep their period on their clock, and a rate needs no executor."""

import threading
from collections.abc import Callable
from itertools import count
from typing import Any

import pytest

from holozen.messages import Clock as ClockMessage
from holozen.messages import Time as TimeMessage
from holozen.ros import rclpy
from holozen.ros.rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from holozen.ros.rclpy.clock import ROSClock
from holozen.ros.rclpy.exceptions import InvalidHandle, ROSInterruptException
from holozen.ros.rclpy.parameter import Parameter
from holozen.ros.rclpy.time import ClockType, Duration, Time
from holozen.ros.rclpy.timer import Timer
from holozen.ros.rclpy.waitable import Waker
from holozen.testing import Wire, wait_for
from holozen.testing.process import PATIENCE

from .sleep import sleeping

Spin = Callable[..., Any]


class Watch(ROSClock):
    """A clock that is set by hand."""

    def __init__(self) -> None:
        super().__init__()
        self._set_ros_time_is_active(True)

    def set(self, nanoseconds: int) -> None:
        self.set_ros_time_override(Time(nanoseconds=nanoseconds, clock_type=ClockType.ROS_TIME))


def made(clock: Watch, period: int = 10, **options: Any) -> Timer:
    return Timer(lambda: None, MutuallyExclusiveCallbackGroup(), period, clock, **options)


def calls(timer: Timer, clock: Watch, *times: int) -> list[int]:
    """At which of the times it calls."""
    found = []
    for time in times:
        clock.set(time)
        found += [time] if timer.take() else []
        assert timer.take() is None or not timer.timer_period_ns
    return found


@pytest.fixture
def clock() -> Watch:
    watch = Watch()
    watch.set(100)
    return watch


def test_it_is_called_a_period_after_it_was_made_and_then_every_period(clock: Watch) -> None:
    assert calls(made(clock), clock, 100, 109, 110, 115, 121, 130, 139, 140) == [110, 121, 130, 140]


def test_calls_that_were_missed_are_one_and_the_beat_stays(clock: Watch) -> None:
    assert calls(made(clock), clock, 145, 149, 150, 160) == [145, 150, 160]


def test_a_clock_that_is_set_back_begins_a_new_period(clock: Watch) -> None:
    assert calls(made(clock), clock, 110, 50, 59, 60) == [110, 60]


def test_no_timer_is_called_before_simulated_time_has_begun() -> None:
    clock = Watch()
    assert calls(made(clock), clock, 0, 500, 509, 510) == [510]


def test_a_period_of_zero_calls_at_every_look(clock: Watch) -> None:
    assert calls(made(clock, 0), clock, 100, 100, 101) == [100, 100, 101]


def test_it_reports_the_time_since_the_last_and_until_the_next_call(clock: Watch) -> None:
    timer = made(clock)
    clock.set(104)
    assert (timer.is_ready(), timer.time_since_last_call(), timer.time_until_next_call()) == (
        False,
        4,
        6,
    )
    clock.set(112)
    assert (timer.is_ready(), timer.time_until_next_call()) == (True, -2)
    assert timer.clock is clock


def test_a_cancelled_one_waits_for_its_reset(clock: Watch) -> None:
    timer = made(clock)
    timer.cancel()
    assert (timer.is_canceled(), timer.time_until_next_call(), timer.wait_seconds()) == (
        True,
        None,
        None,
    )
    assert calls(timer, clock, 110, 120) == []
    timer.reset()
    assert calls(timer, clock, 129, 130) == [130]
    timer.timer_period_ns = 3
    assert calls(timer, clock, 139, 140, 142, 143) == [140, 143]


def test_one_without_a_start_waits_for_it_and_a_destroyed_one_never_calls(clock: Watch) -> None:
    timer = made(clock, autostart=False)
    assert calls(timer, clock, 110) == []
    timer.reset()
    assert calls(timer, clock, 120) == [120]
    timer.destroy()
    assert calls(timer, clock, 200) == []
    assert clock.watchers == set()
    with pytest.raises(InvalidHandle):
        timer.reset()


def test_a_period_below_zero_is_refused(clock: Watch) -> None:
    with pytest.raises(ValueError, match=r"^timer period must be non-negative, and -1 ns is not$"):
        made(clock, -1)


def test_a_move_of_simulated_time_wakes_the_waiting_thread(clock: Watch) -> None:
    timer, waker = made(clock), Waker()
    timer.arm(waker)
    assert timer.wait_seconds() is None
    clock.set(110)
    assert waker.wait(10)
    assert timer.take()


def test_timers_run_in_spin_and_one_may_cancel_itself(ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[str]()

    def once() -> None:
        got.append("once")
        timer.cancel()

    timer = node.create_timer(0.002, once)
    node.create_timer(0.001, lambda: got.append("often"))
    spin_for(lambda: got.count("often") > 20, node)
    assert got.count("once") == 1
    assert node.destroy_timer(timer)


def test_timers_follow_simulated_time_that_begins_late(ros: Wire, spin_for: Spin) -> None:
    node = rclpy.create_node("tom", parameter_overrides=[Parameter("use_sim_time", value=True)])
    got = list[int]()
    node.create_timer(1.0, lambda: got.append(node.get_clock().now().nanoseconds // 10**9))
    clock = ros.bus("sim").publisher("clock", ClockMessage)
    wait_for(lambda: clock.matched)
    for second in range(100, 104):
        clock.put(ClockMessage(TimeMessage(second, 0)))
        spin_for(lambda second=second: node.get_clock().nanoseconds() == second * 10**9, node)
        spin_for(lambda second=second: second == 100 or got[-1:] == [second], node)
        rclpy.get_global_executor().spin_once(timeout_sec=0)
    assert got == [101, 102, 103]


def test_a_rate_sleeps_without_spin_and_catches_up_with_a_late_loop(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    clock = node.get_clock()
    start = clock.nanoseconds()
    rate = node.create_rate(200)
    for _ in range(5):
        rate.sleep()
    assert clock.nanoseconds() - start >= 24_000_000
    node.get_clock().sleep_for(Duration(seconds=0.1))
    before = clock.nanoseconds()
    rate.sleep()  # late: from now on
    rate.sleep()
    assert clock.nanoseconds() - before >= 4_000_000


def test_a_rate_does_not_wait_for_the_time_of_a_clock_that_was_set_back(ros: Wire) -> None:
    clock = Watch()
    clock.set(3600 * 10**9)
    rate = rclpy.create_node("tom").create_rate(1, clock)
    times, rounds = count(10**9, 10**7), list[int]()

    def loop() -> None:
        for number in range(2):
            rate.sleep()
            rounds.append(number)

    def has_ended() -> bool:
        clock.set(next(times))
        return rounds == [0, 1]

    thread = threading.Thread(target=loop)
    thread.start()
    wait_for(has_ended)
    thread.join()


def test_a_rate_ends_with_rclpy(ros: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    node = rclpy.create_node("tom")
    rate, raised = node.create_rate(0.001), list[BaseException]()
    asleep = sleeping(node.get_clock(), monkeypatch)

    def sleep() -> None:
        try:
            rate.sleep()
        except ROSInterruptException as error:
            raised.append(error)

    thread = threading.Thread(target=sleep)
    thread.start()
    assert asleep.wait(PATIENCE)
    rclpy.shutdown()
    thread.join(10)
    assert len(raised) == 1
    with pytest.raises(ROSInterruptException):
        rate.sleep()


def test_a_rate_that_was_destroyed_sleeps_no_more(ros: Wire) -> None:
    rate = rclpy.create_node("tom").create_rate(1)
    rate.destroy()
    with pytest.raises(RuntimeError, match="destroyed"):
        rate.sleep()


def test_a_rate_of_nothing_is_refused(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    with pytest.raises(ValueError, match=r"^frequency must be > 0, and 0 is not$"):
        node.create_rate(0)
    rate = node.create_rate(1)
    assert node.destroy_rate(rate)
