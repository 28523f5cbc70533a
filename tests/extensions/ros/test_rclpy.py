"""Begin, spin, end: the functions of rclpy itself."""

import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest

from holozen.messages import TriggerReply, TriggerRequest
from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy.context import (
    Context,
    SignalHandlerOptions,
    get_current_signal_handlers_options,
)
from holozen.ros.rclpy.exceptions import RCLError
from holozen.ros.rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from holozen.ros.tf2_ros.buffer import Buffer
from holozen.testing import Wire


def test_it_begins_once_and_ends_once(ros: Wire) -> None:
    assert rclpy.ok()
    with pytest.raises(RuntimeError, match="must only be called once"):
        rclpy.init(args=[])
    rclpy.shutdown()
    assert not rclpy.ok()
    with pytest.raises(RuntimeError, match="must be initialized before"):
        rclpy.shutdown()
    rclpy.try_shutdown()
    rclpy.init(args=[])
    assert rclpy.ok()


def test_a_block_ends_it() -> None:
    with rclpy.init(args=[]) as begun:
        assert rclpy.ok()
        assert begun.context is rclpy.get_default_context()
    assert not rclpy.ok()


def test_it_takes_over_the_signals_and_gives_them_back() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    rclpy.init(args=[])
    assert get_current_signal_handlers_options() == SignalHandlerOptions.ALL
    rclpy.shutdown()
    assert get_current_signal_handlers_options() == SignalHandlerOptions.NO
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.SIGTERM)
    assert signal.getsignal(signal.SIGINT) is before[0]
    rclpy.shutdown()
    with Context() as context:
        assert get_current_signal_handlers_options() == SignalHandlerOptions.NO
        assert context.ok()


def test_a_context_of_its_own_leaves_the_default_one_alone(ros: Wire) -> None:
    context = Context()
    with rclpy.init(args=[], context=context):
        assert rclpy.ok(context=context)
        node = rclpy.create_node("tom", context=context)
        executor = SingleThreadedExecutor(context=context)
        rclpy.spin_once(node, executor=executor, timeout_sec=0)
    assert not rclpy.ok(context=context)
    assert rclpy.ok()
    with pytest.raises(RuntimeError):
        rclpy.shutdown(context=context)


def test_a_spin_after_the_end_is_reported(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    rclpy.shutdown()
    spins: list[Callable[[rclpy.Node], None]] = [
        rclpy.spin,
        rclpy.spin_once,
        lambda node: rclpy.spin_until_future_complete(node, rclpy.Future()),
    ]
    for spin in spins:
        with pytest.raises(RCLError, match="rclpy is not running"):
            spin(node)


def test_a_loop_of_spin_once_runs_one_callback_each(ros: Wire) -> None:
    node, called = rclpy.create_node("tom"), list[int]()
    node.create_timer(0.001, lambda: called.append(1))
    for count in range(1, 6):
        rclpy.spin_once(node)
        assert len(called) == count
    assert node.executor is None


def test_the_words_of_ros_are_taken_out() -> None:
    assert rclpy.remove_ros_args(["me", "1", "--ros-args", "-r", "a:=b", "--", "2"]) == [
        "me",
        "1",
        "2",
    ]


def test_seconds_become_nanoseconds() -> None:
    assert [rclpy.timeout_sec_to_nsec(value) for value in (None, -1, 0, 0.5)] == [
        -1,
        -1,
        0,
        500_000_000,
    ]
    assert rclpy.get_rmw_implementation_identifier() == "zenoh"


@pytest.mark.parametrize("kind", [SingleThreadedExecutor, MultiThreadedExecutor])
def test_the_main_thread_takes_no_lock_that_ctrl_c_could_leave_locked(
    ros: Wire, kind: type[SingleThreadedExecutor]
) -> None:
    """As it would in the instant in which a Condition, an Event or a Semaphore has just taken its
    lock.
    """
    Trigger: Any = find("std_srvs/srv/Trigger")
    Twist: Any = find("geometry_msgs/msg/Twist")
    ros.bus("server").serve(
        "go", TriggerRequest, TriggerReply, lambda _: TriggerReply(True)
    ).start()
    taken = list[FrameType]()

    def profile(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code is threading.Condition.__enter__.__code__:
            taken.append(frame)

    def is_ours(frame: FrameType | None) -> bool:
        """Whether it was not Python that took it, as it starts a thread."""
        return frame is None or (
            frame.f_code is not threading.Thread.start.__code__ and is_ours(frame.f_back)
        )

    node, executor, got = rclpy.create_node("tom"), kind(), list[Any]()
    executor.add_node(node)
    sys.setprofile(profile)
    try:
        node.create_subscription(Twist, "cmd_vel", got.append, 10)
        publisher = node.create_publisher(Twist, "cmd_vel", 10)
        node.create_timer(0.001, lambda: publisher.publish(Twist()))
        while len(got) < 3:
            executor.spin_once()
        node.get_logger().info("three")
        assert not Buffer().can_transform("map", "odom", rclpy.time.Time())
        node.create_client(Trigger, "go").call(Trigger.Request())
        executor.shutdown()
        node.destroy_node()
    finally:
        sys.setprofile(None)
    ours = [frame for frame in taken if is_ours(frame)]
    assert [(frame.f_back and frame.f_back.f_back) for frame in ours] == []
