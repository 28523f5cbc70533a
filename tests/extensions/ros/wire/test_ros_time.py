"""Time of a script's node: the sim's, where `use_sim_time` is true, for its timers, rates and
sleeps.
"""

import threading

import pytest

from holozen.messages import Clock as ClockMessage
from holozen.messages import Time as TimeMessage
from holozen.ros.rclpy import context as contexts
from holozen.ros.rclpy import logging
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.executors import SingleThreadedExecutor
from holozen.ros.rclpy.node import Node
from holozen.ros.rclpy.parameter import Parameter
from holozen.ros.rclpy.time import ClockType, Duration, Time
from holozen.testing import Wire, wait_for

SIMULATED = ["--ros-args", "-p", "use_sim_time:=true"]


class Hand:
    """Moves the time by hand."""

    def __init__(self, wire: Wire) -> None:
        self._clock = wire.bus("hand").publisher("clock", ClockMessage)

    def set(self, node: Node, seconds: float) -> None:
        def shown() -> bool:
            self._clock.put(ClockMessage(TimeMessage.of(seconds)))
            return node.get_clock().nanoseconds() == round(seconds * 1e9)

        wait_for(shown)


def test_timers_go_by_simulated_time(wire: Wire, context: Context) -> None:
    node, hand, calls = Node("tom", context=context, cli_args=SIMULATED), Hand(wire), list[float]()
    hand.set(node, 10.0)
    node.create_timer(1.0, lambda: calls.append(node.get_clock().nanoseconds() / 1e9))
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    executor.spin_once(timeout_sec=0.0)
    assert calls == []
    for seconds in (10.9, 11.0, 11.5, 12.5, 12.9, 13.0):
        hand.set(node, seconds)
        for _ in range(3):
            executor.spin_once(timeout_sec=0.0)
    assert calls == [11.0, 12.5, 13.0]


def test_a_spin_that_waits_wakes_with_simulated_time(wire: Wire, context: Context) -> None:
    node, hand, called = (
        Node("tom", context=context, cli_args=SIMULATED),
        Hand(wire),
        threading.Event(),
    )
    hand.set(node, 1.0)
    node.create_timer(5.0, called.set)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    assert not called.is_set()
    hand.set(node, 6.0)
    assert called.wait(10)
    executor.shutdown()
    thread.join(10)


def test_sleeps_and_rates_go_by_simulated_time_without_a_spin(wire: Wire, context: Context) -> None:
    node, hand, woken = Node("tom", context=context, cli_args=SIMULATED), Hand(wire), list[str]()
    hand.set(node, 1.0)
    rate = node.create_rate(0.5)

    def sleep() -> None:
        rate.sleep()
        woken.append("rate")
        node.get_clock().sleep_until(Time(seconds=6, clock_type=ClockType.ROS_TIME), context)
        woken.append("sleep")

    thread = threading.Thread(target=sleep, daemon=True)
    thread.start()
    hand.set(node, 2.9)
    assert woken == []
    hand.set(node, 3.0)
    wait_for(lambda: woken == ["rate"])
    hand.set(node, 6.0)
    wait_for(lambda: woken == ["rate", "sleep"])
    thread.join(10)


def test_the_sims_time_is_a_nodes_time(wire: Wire, context: Context) -> None:
    wire.start("sim", "--empty")
    node = Node("tom", context=context, cli_args=SIMULATED)
    clock = node.get_clock()
    wait_for(lambda: clock.nanoseconds() > 0, within=30)
    before = clock.now()
    assert clock.nanoseconds() < 3600e9, "seconds since the sim's start, and not since 1970"
    assert clock.sleep_for(Duration(seconds=0.1), context)
    assert clock.now() - before >= Duration(seconds=0.1)
    node.set_parameters([Parameter("use_sim_time", value=False)])
    assert clock.nanoseconds() > 1e18


def test_loggers_of_nodes_have_the_levels_of_the_command_line(
    wire: Wire, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(contexts, "connection", wire.connection)
    context = Context()
    context.init(
        args=[
            "--ros-args",
            "-r",
            "tom:__ns:=/lab",
            "--log-level",
            "lab.tom:=debug",
            "--log-level",
            "error",
        ]
    )
    try:
        for name in ("tom", "anna"):
            logger = Node(name, context=context).get_logger()
            logger.debug("x")
            logger.error("y")
    finally:
        context.try_shutdown()
        logging.clear_config()
    words = [
        line.partition("] ")[0] + line.rpartition("[")[2]
        for line in capsys.readouterr().err.splitlines()
    ]
    assert words == ["[DEBUGlab.tom]: x", "[ERRORlab.tom]: y", "[ERRORanna]: y"]
