"""Executors run callbacks in turn, wait as long as they are told, and hand on what a callback raises."""

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from holozen.ros import rclpy
from holozen.ros.context import Context
from holozen.ros.exceptions import RCLError
from holozen.ros.executors import Executor, ExternalShutdownException, SingleThreadedExecutor, TimeoutException
from holozen.ros.generated import find
from holozen.testing import Wire, wait_for

Twist: Any = find("geometry_msgs/msg/Twist")
Spin = Callable[..., Any]


def test_entities_take_turns_however_much_one_has_to_do(ros: Wire) -> None:
    node, order = rclpy.create_node("tom"), list[str]()
    for name in "abc":
        node.create_timer(0, lambda name=name: order.append(name))
    for _ in range(9):
        rclpy.spin_once(node, timeout_sec=0)
    assert order == ["a", "b", "c"] * 3


def test_nobody_is_woken_while_callbacks_run(ros: Wire, spin_for: Spin) -> None:
    node, waits, executor = rclpy.create_node("tom"), list[bool](), rclpy.get_global_executor()
    node.create_timer(0.001, lambda: waits.append(executor._waker.waiting))
    spin_for(lambda: len(waits) > 5, node)
    assert not any(waits)


def test_a_timeout_is_kept_and_zero_waits_for_nothing(ros: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(rclpy.create_node("tom"))
    start = time.monotonic()
    executor.spin_once(timeout_sec=0.05)
    assert time.monotonic() - start >= 0.05
    monkeypatch.setattr(executor._waker, "wait", pytest.fail)
    executor.spin_once(timeout_sec=0)
    executor.spin_until_future_complete(rclpy.Future(), timeout_sec=0)


def test_a_future_that_another_thread_sets_ends_the_wait(ros: Wire) -> None:
    node, future, executor = rclpy.create_node("tom"), rclpy.Future(), rclpy.get_global_executor()

    def finish() -> None:
        wait_for(lambda: executor._waker.waiting)
        future.set_result(5)

    thread = threading.Thread(target=finish)
    thread.start()
    rclpy.spin_until_future_complete(node, future)
    thread.join()
    assert future.result() == 5


def test_an_exception_of_a_callback_ends_the_spin_with_its_own_traceback(ros: Wire) -> None:
    node = rclpy.create_node("tom")

    def mine() -> None:
        raise KeyError("x")

    node.create_timer(0.001, mine)
    with pytest.raises(KeyError) as error:
        rclpy.spin(node)
    assert error.traceback[-1].name == "mine"
    assert node.executor is None
    with pytest.raises(KeyError):  # and one may spin again
        rclpy.spin(node)


def test_a_task_runs_in_spin_and_what_it_raises_comes_out(ros: Wire) -> None:
    executor = rclpy.get_global_executor()
    task = executor.create_task(lambda a: a + 1, 1)
    executor.spin_once(timeout_sec=0)
    assert task.result() == 2
    executor.create_task(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        executor.spin_once(timeout_sec=0)


def test_shutdown_in_a_callback_ends_the_spin_quietly(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    node.create_timer(0.001, rclpy.shutdown)
    rclpy.spin(node)
    assert not rclpy.ok()


def test_shutdown_from_elsewhere_ends_the_spin_with_a_word(ros: Wire) -> None:
    node, context = rclpy.create_node("tom"), rclpy.get_default_context()
    rclpy.get_global_executor().create_task(lambda: threading.Timer(0.01, context.try_shutdown).start())
    with pytest.raises(ExternalShutdownException):
        rclpy.spin(node)


def test_an_executor_that_is_shut_down_spins_no_more(ros: Wire) -> None:
    with SingleThreadedExecutor() as executor:
        node = rclpy.create_node("tom")
        assert executor.add_node(node)
        assert not executor.add_node(node)
        executor.create_task(executor.shutdown)
        executor.spin()
        assert executor.get_nodes() == []
        executor.spin_once()
    assert node.executor is None


def test_no_executor_without_a_running_context() -> None:
    with pytest.raises(RCLError, match="failed to make an executor: rclpy is not running"):
        SingleThreadedExecutor(context=Context())


def test_several_nodes_and_what_they_get_or_lose_meanwhile(ros: Wire, spin_for: Spin) -> None:
    first, second, got = rclpy.create_node("first"), rclpy.create_node("second"), list[str]()
    first.create_timer(0.001, lambda: got.append("first"))
    spin_for(lambda: got, first, second)
    second.create_timer(0.001, lambda: got.append("second"))
    spin_for(lambda: "second" in got)
    other = SingleThreadedExecutor()
    other.add_node(first)
    assert first not in rclpy.get_global_executor().get_nodes()
    first.destroy_node()
    assert other.get_nodes() == []
    got.clear()
    spin_for(lambda: len(got) > 5)
    assert set(got) == {"second"}


def test_a_spin_within_a_callback_leaves_the_outer_one_its_node(ros: Wire, spin_for: Spin) -> None:
    node, future, got = rclpy.create_node("tom"), rclpy.Future(), list[str]()

    def within() -> None:
        timer.cancel()
        threading.Timer(0.01, lambda: future.set_result(None)).start()
        rclpy.spin_until_future_complete(node, future)
        got.append("inner")

    timer = node.create_timer(0.001, within)
    node.create_timer(0.001, lambda: got.append("outer"))
    spin_for(lambda: "inner" in got and got[-1] == "outer", node)


def test_data_that_come_while_things_are_made_and_destroyed_harm_nobody(ros: Wire, spin_for: Spin) -> None:
    node, got, made = rclpy.create_node("tom"), list[Any](), list[Any]()
    writer = rclpy.create_node("writer").create_publisher(Twist, "a", 10)
    stop = threading.Event()

    def write() -> None:
        while not stop.wait(0.0005):
            writer.publish(Twist())

    def change() -> None:
        if made:
            node.destroy_subscription(made.pop())
        made.append(node.create_subscription(Twist, "a", got.append, 3))

    thread = threading.Thread(target=write)
    thread.start()
    node.create_timer(0.003, change)
    spin_for(lambda: len(got) > 200, node)
    stop.set()
    thread.join()


class Mine(Executor):
    """An executor as scripts write them."""

    def __init__(self) -> None:
        super().__init__()
        self.of: list[Any] = []

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback, and note whose it was."""
        handler, entity, node = self.wait_for_ready_callbacks(timeout_sec=timeout_sec)
        self.of.append((entity, node))
        handler()


def test_an_executor_of_the_scripts_own_is_given_callbacks(ros: Wire) -> None:
    tom, jerry, called = rclpy.create_node("tom"), rclpy.create_node("jerry"), list[str]()
    executor = Mine()
    executor.add_node(tom)
    executor.add_node(jerry)
    with pytest.raises(TimeoutException):
        executor.spin_once(0)
    timer = jerry.create_timer(0.001, lambda: called.append("jerry"))
    executor.spin_once(10)
    assert (called, executor.of) == (["jerry"], [(timer, jerry)])
    executor.spin_once(10)  # its group is free again
    assert called == ["jerry"] * 2
    executor.shutdown()


def test_a_signal_between_two_spins_is_told_by_the_next(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    rclpy.spin_once(node, timeout_sec=0)
    rclpy.get_default_context().interrupt()
    with pytest.raises(ExternalShutdownException):
        rclpy.spin_once(node, timeout_sec=0)
    for spin in (rclpy.spin, lambda node: rclpy.spin_until_future_complete(node, rclpy.Future(), timeout_sec=1)):
        with pytest.raises(ExternalShutdownException):
            spin(node)
    with pytest.raises(ExternalShutdownException):
        SingleThreadedExecutor()
