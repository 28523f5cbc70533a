"""Executors run callbacks in turn, wait for their timeout, and pass on what a callback raises."""

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from holozen.ros.rclpy.context import Context, ExternalShutdownException
from holozen.ros.rclpy.exceptions import RCLError
from holozen.ros.rclpy.executors import (
    Executor,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
    TimeoutException,
)
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


def test_the_executor_is_not_woken_while_callbacks_run(ros: Wire, spin_for: Spin) -> None:
    node, waits, executor = rclpy.create_node("tom"), list[bool](), rclpy.get_global_executor()
    node.create_timer(0.001, lambda: waits.append(executor.waker.waiting))
    spin_for(lambda: len(waits) > 5, node)
    assert not any(waits)


def test_a_timeout_is_kept_and_zero_waits_for_nothing(
    ros: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(rclpy.create_node("tom"))
    start = time.monotonic()
    executor.spin_once(timeout_sec=0.05)
    assert time.monotonic() - start >= 0.05
    monkeypatch.setattr(executor.waker, "wait", pytest.fail)
    executor.spin_once(timeout_sec=0)
    executor.spin_until_future_complete(rclpy.Future(), timeout_sec=0)


def test_a_future_that_another_thread_sets_ends_the_wait(ros: Wire) -> None:
    node, future, executor = rclpy.create_node("tom"), rclpy.Future(), rclpy.get_global_executor()

    def finish() -> None:
        wait_for(lambda: executor.waker.waiting)
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
    executor = rclpy.get_global_executor()

    def end() -> None:
        wait_for(lambda: executor.waker.waiting, what="the spin to wait")
        context.try_shutdown()

    elsewhere = threading.Thread(target=end)
    elsewhere.start()
    with pytest.raises(ExternalShutdownException):
        rclpy.spin(node)
    elsewhere.join()


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


def test_what_is_no_node_is_not_spun(ros: Wire) -> None:
    class Tom(rclpy.node.Node):
        pass

    for given, expected in [
        (Tom, r"^pass a node, such as Tom\(\), not the class$"),
        (None, r"^pass a node, such as MyNode\(\), not None$"),
    ]:
        with pytest.raises(TypeError, match=expected):
            rclpy.spin(given)  # type: ignore[arg-type]


def test_no_executor_without_a_running_context() -> None:
    with pytest.raises(RCLError, match="failed to create an executor: rclpy is not running"):
        SingleThreadedExecutor(context=Context())


def test_several_nodes_and_what_they_gain_or_lose_over_time(ros: Wire, spin_for: Spin) -> None:
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


@pytest.mark.parametrize(
    ("group", "lines"), [(MutuallyExclusiveCallbackGroup, 1), (ReentrantCallbackGroup, 0)]
)
def test_a_spin_within_a_callback_that_no_other_callback_can_end_says_so(
    ros: Wire,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    group: Any,
    lines: int,
) -> None:
    monkeypatch.setattr("holozen.ros.rclpy.executors.LATE", 0.01)
    node = rclpy.create_node("tom")
    once = node.create_timer(0.001, lambda: spin(), callback_group=group())

    def spin() -> None:
        once.cancel()
        for _ in range(2):
            rclpy.spin_until_future_complete(node, rclpy.Future(), timeout_sec=0.1)

    rclpy.spin_once(node)
    assert (
        capsys.readouterr().err.count(
            "a callback spins its node: other callbacks of its group wait"
        )
        == lines
    )


def test_data_that_arrive_while_things_are_made_and_destroyed_do_no_harm(
    ros: Wire, spin_for: Spin
) -> None:
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


def test_a_signal_between_two_spins_is_reported_by_the_next(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    rclpy.spin_once(node, timeout_sec=0)
    rclpy.get_default_context().interrupt()
    with pytest.raises(ExternalShutdownException):
        rclpy.spin_once(node, timeout_sec=0)
    for spin in (
        rclpy.spin,
        lambda node: rclpy.spin_until_future_complete(node, rclpy.Future(), timeout_sec=1),
    ):
        with pytest.raises(ExternalShutdownException):
            spin(node)
    with pytest.raises(ExternalShutdownException):
        SingleThreadedExecutor()


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


def test_one_subscription_of_a_reentrant_group_runs_several_at_a_time(
    executor: MultiThreadedExecutor,
) -> None:
    node, barrier, met = rclpy.create_node("tom"), threading.Barrier(2), list[int]()
    node.create_subscription(
        Twist,
        "a",
        lambda _: met.append(barrier.wait(10)),
        10,
        callback_group=ReentrantCallbackGroup(),
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
def test_callbacks_of_one_exclusive_group_do_not_meet(
    executor: MultiThreadedExecutor, own: bool, trials: Callable[[int, int], int]
) -> None:
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
    while count < trials(12, 40):
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

    subscription = node.create_subscription(
        Twist, "a", slow, 2, callback_group=ReentrantCallbackGroup()
    )
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
            wait_for(lambda: subscription.inbox.parked)  # its thread has nothing in its hand
        executor.spin_once(0)
    gate.set()
    while len(got) < 3:
        executor.spin_once(0.01)
    executor.spin_once(0)
    assert got == [0, 6, 7]
    assert executor.shutdown()


def test_a_shutdown_returns_whether_all_callbacks_have_ended(ros: Wire) -> None:
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


class Entity:
    """Something with a callback."""


def test_of_an_exclusive_group_one_runs_at_a_time() -> None:
    group, one, other = MutuallyExclusiveCallbackGroup(), Entity(), Entity()
    assert group.can_execute(one)
    assert group.beginning_execution(one)
    assert not group.can_execute(other)
    assert not group.beginning_execution(one)
    group.ending_execution(one)
    assert group.can_execute(other)


def test_of_a_reentrant_group_all_run() -> None:
    group, one = ReentrantCallbackGroup(), Entity()
    assert group.beginning_execution(one)
    assert group.can_execute(one)
    assert group.beginning_execution(one)
    group.ending_execution(one)


def test_a_group_knows_its_members_while_they_live() -> None:
    group, one = ReentrantCallbackGroup(), Entity()
    group.add_entity(one)
    assert group.has_entity(one)
    assert not group.has_entity(Entity())
    del one
    assert len(group.entities) == 0
