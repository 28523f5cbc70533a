"""Clocks: what they show, how long one sleeps on them, and the callbacks when they jump."""

import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from holozen.messages import Clock as ClockMessage
from holozen.messages import Time as TimeMessage
from holozen.messages import Twist
from holozen.ros.rclpy.clock import (
    Clock,
    ClockChange,
    JumpThreshold,
    ROSClock,
    TimeJump,
    TimeSource,
)
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.exceptions import NotInitializedException
from holozen.ros.rclpy.node import Node
from holozen.ros.rclpy.parameter import Parameter
from holozen.ros.rclpy.time import ClockType, Duration, Time
from holozen.testing import Wire, wait_for
from holozen.testing.process import PATIENCE
from holozen.transport.graph import Graph

from .sleep import sleeping


@pytest.fixture
def context() -> Iterator[Context]:
    context = Context()
    context.init(args=[])
    yield context
    context.try_shutdown()


def at(seconds: float) -> Time:
    return Time(seconds=seconds, clock_type=ClockType.ROS_TIME)


def simulated(seconds: float = 0.0) -> ROSClock:
    clock = ROSClock()
    clock._set_ros_time_is_active(True)
    clock.set_ros_time_override(at(seconds))
    return clock


class Sleeper:
    """A sleep in a thread; `woken` is what the sleep returned."""

    def __init__(self, sleep: Callable[[], bool]) -> None:
        self.woken: bool | None = None
        self._thread = threading.Thread(target=lambda: setattr(self, "woken", sleep()), daemon=True)
        self._thread.start()

    def result(self) -> bool | None:
        self._thread.join(10)
        return self.woken


def test_clocks_show_the_systems_time_or_a_steady_one() -> None:
    before = time.time_ns(), time.monotonic_ns()
    shown = [Clock().now(), Clock(clock_type=ClockType.STEADY_TIME).now(), ROSClock().now()]
    after = time.time_ns(), time.monotonic_ns()
    assert before[0] <= shown[0].nanoseconds <= shown[2].nanoseconds <= after[0]
    assert before[1] <= shown[1].nanoseconds <= after[1]
    assert [each.clock_type for each in shown] == [
        ClockType.SYSTEM_TIME,
        ClockType.STEADY_TIME,
        ClockType.ROS_TIME,
    ]


def test_a_clock_of_ros_time_is_a_ros_clock() -> None:
    made = Clock(clock_type=ClockType.ROS_TIME)
    assert isinstance(made, ROSClock)
    assert repr(made) == "Clock(clock_type=ROS_TIME)"
    for wrong in (1, ClockType.UNINITIALIZED):
        with pytest.raises(TypeError, match="use ClockType"):
            Clock(clock_type=wrong)  # type: ignore[arg-type]


def test_simulated_time_begins_at_zero_and_is_what_was_given() -> None:
    clock = ROSClock()
    clock._set_ros_time_is_active(True)
    assert clock.now() == at(0)
    clock.set_ros_time_override(at(2.5))
    assert (clock.ros_time_is_active, clock.now()) == (True, at(2.5))
    clock._set_ros_time_is_active(False)
    assert clock.now() > at(1e6)
    with pytest.raises(TypeError, match="Time of ROS_TIME"):
        clock.set_ros_time_override(Time())


def test_wait_seconds_is_the_time_left_where_that_is_known() -> None:
    clock = simulated(1.0)
    assert clock.wait_seconds(at(1).nanoseconds) == 0.0
    assert clock.wait_seconds(at(2).nanoseconds) is None, "the speed of simulated time is unknown"
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    wait = steady.wait_seconds(steady.nanoseconds() + 10**12)
    assert wait is not None
    assert 900 < wait <= 1000


def test_one_sleeps_until_the_time_has_come(context: Context) -> None:
    clock = Clock(clock_type=ClockType.STEADY_TIME)
    until = clock.now() + Duration(seconds=0.02)
    assert clock.sleep_until(until, context)
    assert clock.now() >= until
    assert clock.sleep_until(Time(clock_type=ClockType.STEADY_TIME), context)
    assert clock.sleep_for(Duration(seconds=-1e6), context)


def test_one_sleeps_in_simulated_time(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = simulated(1.0)
    asleep = sleeping(clock, monkeypatch)
    sleeper = Sleeper(lambda: clock.sleep_for(Duration(seconds=2), context))
    assert asleep.wait(PATIENCE)
    clock.set_ros_time_override(at(2.9))
    assert sleeper.woken is None
    clock.set_ros_time_override(at(3.0))
    assert sleeper.result() is True


def test_a_sleep_ends_when_rclpy_is_shut_down(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    clocks = (Clock(), Clock(clock_type=ClockType.STEADY_TIME), simulated())
    all_asleep = [sleeping(clock, monkeypatch) for clock in clocks]
    sleepers = [
        Sleeper(partial(clock.sleep_for, Duration(seconds=1000), context)) for clock in clocks
    ]
    assert all(asleep.wait(PATIENCE) for asleep in all_asleep)
    context.shutdown()
    assert [sleeper.result() for sleeper in sleepers] == [False] * 3


def test_a_sleep_ends_when_simulated_time_begins_or_ends(context: Context) -> None:
    clock = ROSClock()
    sleeper = Sleeper(lambda: clock.sleep_for(Duration(seconds=1000), context))

    def woken_by_a_change() -> bool:
        clock._set_ros_time_is_active(not clock.ros_time_is_active)
        return sleeper.woken is False

    wait_for(woken_by_a_change)


def test_a_wrong_argument_of_sleep_is_reported(context: Context) -> None:
    with pytest.raises(NotInitializedException):
        Clock().sleep_for(Duration(seconds=1), Context())
    with pytest.raises(ValueError, match="clock of SYSTEM_TIME, and the time is of ROS_TIME"):
        Clock().sleep_until(at(1), context)
    with pytest.raises(TypeError, match=r"until must be a Time; 1\.0 is a float"):
        Clock().sleep_until(1.0, context)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"rel_time must be a Duration; 1\.0 is a float"):
        Clock().sleep_for(1.0, context)  # type: ignore[arg-type]


def test_watchers_are_called_when_simulated_time_moves() -> None:
    clock, seen = ROSClock(), list[int]()
    clock.watchers.add(lambda: seen.append(clock.nanoseconds()))
    clock.set_ros_time_override(at(1e-9))
    clock._set_ros_time_is_active(True)
    clock._set_ros_time_is_active(True)
    clock.set_ros_time_override(at(2e-9))
    assert seen == [1, 2]


def test_jumps_beyond_a_threshold_are_reported_before_and_after() -> None:
    clock, events = simulated(10), list[object]()
    threshold = JumpThreshold(min_forward=Duration(seconds=5), min_backward=Duration(seconds=-1))
    handle = clock.create_jump_callback(
        threshold, pre_callback=lambda: events.append(clock.now()), post_callback=events.append
    )
    for second in (14, 13.5, 20, 18):
        clock.set_ros_time_override(at(second))
    assert events == [
        at(13.5),
        TimeJump(ClockChange.ROS_TIME_NO_CHANGE, Duration(seconds=6.5)),
        at(20),
        TimeJump(ClockChange.ROS_TIME_NO_CHANGE, Duration(seconds=-2)),
    ]
    clock._set_ros_time_is_active(False)
    assert isinstance(events[-1], TimeJump)
    assert events[-1].clock_change == ClockChange.ROS_TIME_DEACTIVATED
    handle.unregister()
    handle.unregister()
    clock._set_ros_time_is_active(True)
    assert len(events) == 6


def test_a_wrong_threshold_is_refused() -> None:
    for forward, backward, message in (
        (Duration(), None, "min_forward must be positive"),
        (None, Duration(), "min_backward must be negative"),
    ):
        with pytest.raises(ValueError, match=message):
            JumpThreshold(min_forward=forward, min_backward=backward)
    with pytest.raises(ValueError, match="report no jump"):
        JumpThreshold(min_forward=None, min_backward=None, on_clock_change=False)
    with pytest.raises(TypeError, match="min_forward must be a Duration"):
        JumpThreshold(min_forward=1.0, min_backward=None)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="give a pre_callback"):
        ROSClock().create_jump_callback(JumpThreshold(min_forward=None, min_backward=None))


class Tom(Node):
    """A node with a clock and a TimeSource of its own besides those of every node."""

    def __init__(self, *words: str) -> None:
        super().__init__("tom", cli_args=["--ros-args", *words], start_parameter_services=False)
        self.clock, self.source = ROSClock(), TimeSource(self)
        self.source.attach_clock(self.clock)

    def use_sim_time(self, value: bool) -> None:
        self.set_parameters([Parameter("use_sim_time", value=value)])

    def seconds(self) -> float:
        return self.clock.nanoseconds() / 1e9


class Sim:
    """A publisher of the time."""

    def __init__(self, wire: Wire, key: str = "clock") -> None:
        self._clock = wire.bus("sim").publisher(key, ClockMessage)

    def publish(self, node: Tom, seconds: float, clock: Clock | None = None) -> None:
        def shown() -> Any:
            self._clock.put(ClockMessage(TimeMessage.of(seconds)))
            return (clock or node.clock).nanoseconds() == seconds * 1e9

        wait_for(shown)


def readers(graph: Graph) -> set[str]:
    return {row.key for row in graph.endpoints() if row.kind == "sub"}


def test_a_node_shows_the_systems_time_by_default(ros: Wire) -> None:
    node, simulated = Tom(), Tom("-p", "use_sim_time:=true")
    assert node.seconds() > 1e9
    assert simulated.seconds() == 0.0, "simulated time begins at zero"
    assert (node.source.ros_time_is_active, simulated.source.ros_time_is_active) == (False, True)


def test_time_passes_with_the_messages_without_an_executor(ros: Wire) -> None:
    node, sim = Tom("-p", "use_sim_time:=true"), Sim(ros)
    for seconds in (1.0, 2.5, 0.5):
        sim.publish(node, seconds)


def test_the_parameter_switches_it_on_and_off(ros: Wire) -> None:
    node, sim = Tom(), Sim(ros)
    node.use_sim_time(True)
    sim.publish(node, 3.0)
    graph = ros.bus().graph()
    wait_for(lambda: readers(graph) == {"clock"})
    node.use_sim_time(False)
    assert node.seconds() > 1e9
    wait_for(lambda: readers(graph) == set())
    node.use_sim_time(True)
    sim.publish(node, 4.0)
    node.source.close()
    assert node.seconds() > 1e9


def test_the_topic_can_be_another_one(ros: Wire) -> None:
    Sim(ros, "lab/clock").publish(Tom("-p", "use_sim_time:=true", "-r", "/clock:=/lab/clock"), 5.0)


def test_more_clocks_get_the_time_and_lose_it(ros: Wire) -> None:
    node, sim, another = Tom("-p", "use_sim_time:=true"), Sim(ros), ROSClock()
    sim.publish(node, 2.0)
    node.source.attach_clock(another)
    assert another.nanoseconds() == 2_000_000_000
    sim.publish(node, 3.0, another)
    node.source.detach_clock(another)
    sim.publish(node, 4.0)
    assert another.nanoseconds() == 3_000_000_000
    with pytest.raises(ValueError, match="only clocks of ROS_TIME"):
        node.source.attach_clock(Clock())


def test_what_is_no_time_is_reported_and_changes_nothing(
    ros: Wire, capsys: pytest.CaptureFixture[str]
) -> None:
    node, sim = Tom("-p", "use_sim_time:=true"), Sim(ros)
    sim.publish(node, 2.0)
    wrong = ros.bus("wrong").publisher("clock", Twist)
    message: list[str] = []

    def is_reported() -> bool:
        wrong.put(Twist())
        message.append(capsys.readouterr().err)
        return "[WARN]" in "".join(message)

    wait_for(is_reported)
    assert "[tom]: invalid time on /clock: " in "".join(message)
    assert "".join(message).count("\n") == 1
    assert node.clock.now() == Time(seconds=2, clock_type=node.clock.clock_type)


def test_time_goes_on_when_a_callback_for_jumps_fails(
    ros: Wire, capsys: pytest.CaptureFixture[str]
) -> None:
    node, sim = Tom("-p", "use_sim_time:=true"), Sim(ros)

    def fail(_jump: object) -> None:
        raise RuntimeError("oh")

    threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1))
    node.clock.create_jump_callback(threshold, post_callback=fail)
    for seconds in (2.0, 1.0, 3.0):
        sim.publish(node, seconds)
    shown = capsys.readouterr().err
    assert shown.count("RuntimeError: oh") == 1 and shown.count("  File ") == 1
