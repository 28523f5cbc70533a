"""Callbacks in several threads: as many at a time as their groups allow."""

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from holozen.ros import rclpy
from holozen.ros.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from holozen.ros.executors import MultiThreadedExecutor
from holozen.ros.generated import find
from holozen.testing import Wire, wait_for

Twist: Any = find("geometry_msgs/msg/Twist")


@pytest.fixture
def executor(ros: Wire) -> Iterator[MultiThreadedExecutor]:
    with MultiThreadedExecutor(4) as executor:
        yield executor


def test_callbacks_of_a_reentrant_group_meet(executor: MultiThreadedExecutor) -> None:
    node, group = rclpy.create_node("tom"), ReentrantCallbackGroup()
    barrier = threading.Barrier(3)

    def meet() -> None:
        barrier.wait(10)
        executor.shutdown(0)

    for _ in range(3):
        node.create_guard_condition(meet, callback_group=group).trigger()
    executor.add_node(node)
    executor.spin()
    assert not barrier.broken


def test_one_subscription_of_a_reentrant_group_runs_several_at_a_time(executor: MultiThreadedExecutor) -> None:
    node, barrier, met = rclpy.create_node("tom"), threading.Barrier(2), list[int]()
    node.create_subscription(
        Twist, "a", lambda _: met.append(barrier.wait(10)), 10, callback_group=ReentrantCallbackGroup()
    )
    writer = node.create_publisher(Twist, "a", 10)
    wait_for(writer.get_subscription_count)
    writer.publish(Twist())
    writer.publish(Twist())
    executor.add_node(node)
    while len(met) < 2:
        executor.spin_once(0.01)
    assert sorted(met) == [0, 1]


@pytest.mark.parametrize("own", [True, False])
def test_callbacks_of_one_exclusive_group_do_not_meet(executor: MultiThreadedExecutor, own: bool) -> None:
    node, running, most, count = rclpy.create_node("tom"), list[int](), list[int](), 0
    group = MutuallyExclusiveCallbackGroup() if own else None

    def alone() -> None:
        nonlocal count
        running.append(1)
        most.append(len(running))
        threading.Event().wait(0.001)
        running.pop()
        count += 1

    for _ in range(4):
        node.create_timer(0, alone, callback_group=group)
    executor.add_node(node)
    while count < 40:
        executor.spin_once(0.01)
    assert set(most) == {1}


def test_what_a_callback_raises_comes_out_of_the_spin(executor: MultiThreadedExecutor) -> None:
    node = rclpy.create_node("tom")

    def mine() -> None:
        raise KeyError("x")

    node.create_timer(0.001, mine)
    executor.add_node(node)
    with pytest.raises(KeyError) as error:
        executor.spin()
    assert error.traceback[-1].name == "mine"


def test_while_all_threads_are_busy_the_newest_wait(ros: Wire) -> None:
    executor = MultiThreadedExecutor(1)
    node, got, gate = rclpy.create_node("tom"), list[float](), threading.Event()

    def slow(message: Any) -> None:
        got.append(message.linear.x)
        gate.wait(10)

    subscription = node.create_subscription(Twist, "a", slow, 2, callback_group=ReentrantCallbackGroup())
    writer = node.create_publisher(Twist, "a", 10)
    wait_for(writer.get_subscription_count)
    executor.add_node(node)
    for x in range(8):
        message = Twist()
        message.linear.x = float(x)
        writer.publish(message)
        while not got:
            executor.spin_once(0.01)
        if x:
            wait_for(lambda: subscription._inbox._parked)  # its thread has nothing in its hand
        executor.spin_once(0)
    gate.set()
    while len(got) < 3:
        executor.spin_once(0.01)
    executor.spin_once(0)
    assert got == [0, 6, 7]
    assert executor.shutdown()


def test_a_shutdown_tells_whether_all_callbacks_have_ended(ros: Wire) -> None:
    executor, gate, begun = MultiThreadedExecutor(2), threading.Event(), threading.Event()
    node = rclpy.create_node("tom")

    def wait() -> None:
        begun.set()
        gate.wait(10)

    node.create_guard_condition(wait).trigger()
    executor.add_node(node)
    while not begun.is_set():
        executor.spin_once(0.01)
    assert not executor.shutdown(0.01)
    gate.set()
    assert executor.shutdown(10)


def test_less_than_one_thread_is_refused(ros: Wire) -> None:
    with pytest.raises(ValueError, match=r"^num_threads is 0; use 1 or more$"):
        MultiThreadedExecutor(0)
