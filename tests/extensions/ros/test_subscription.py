"""Messages reach callbacks in spin only, in order, the newest of them."""

import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from holozen.bus import Bus
from holozen.messages import Twist as OurTwist
from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy import qos
from holozen.ros.rclpy.exceptions import RCLError
from holozen.ros.rclpy.executors import SingleThreadedExecutor
from holozen.ros.rclpy.node import Node
from holozen.ros.rclpy.qos import DurabilityPolicy, QoSProfile
from holozen.ros.rclpy.subscription import wait_for_message
from holozen.testing import Wire, wait_for

Twist: Any = find("geometry_msgs/msg/Twist")
Spin = Callable[..., Any]


def twist(x: float) -> Any:
    message = Twist()
    message.linear.x = float(x)
    return message


def numbers(messages: list[Any]) -> list[float]:
    return [message.linear.x for message in messages]


def meet(writer: Bus, node: Node) -> Callable[[], object]:
    """A function that waits until all that `writer` has put so far is here."""
    end, marks = node._holozen.bus.subscribe_raw("end"), iter(range(10_000))

    def arrived(mark: bytes) -> bool:
        writer.session.put("end", mark)
        return mark in [sample.payload for sample in iter(end.try_recv, None)]

    return lambda: wait_for(partial(arrived, b"%d" % next(marks)))


def test_a_message_of_our_bus_comes_as_rosss_and_the_other_way_round(
    ros: Wire, spin_for: Spin
) -> None:
    node, bus, got = rclpy.create_node("tom"), ros.bus("bus"), list[Any]()
    node.create_subscription(Twist, "/odom_twist", got.append, 10)
    here, there = bus.subscribe("cmd_vel", OurTwist), bus.publisher("odom_twist", OurTwist)
    mine = node.create_publisher(Twist, "cmd_vel", 10)
    wait_for(lambda: there.matched and mine.get_subscription_count())
    there.put(OurTwist.planar(0.5))
    spin_for(lambda: got, node)
    assert got == [twist(0.5)]
    mine.publish(twist(0.25))
    received = here.recv()
    assert received.message == OurTwist.planar(0.25)
    assert (received.priority, received.source) == ("DATA", node._holozen.bus.source)


def test_a_slow_subscriber_gets_the_newest_in_order(ros: Wire) -> None:
    node, bus, got = rclpy.create_node("tom"), ros.bus("bus"), list[Any]()
    node.create_subscription(Twist, "a", got.append, 3)
    writer = bus.publisher("a", OurTwist)
    wait_for(lambda: writer.matched)
    wait = meet(bus, node)
    for x in range(12):
        writer.put(OurTwist.planar(float(x)))
        wait()  # on a busy machine Zenoh would drop some
    for _ in range(20):
        rclpy.spin_once(node, timeout_sec=0)
    assert numbers(got) == [9, 10, 11]


def test_a_slow_callback_sees_the_newest_after_it(ros: Wire) -> None:
    node, bus, got = rclpy.create_node("tom"), ros.bus("bus"), list[Any]()
    writer = bus.publisher("a", OurTwist)
    wait = meet(bus, node)

    def slow(message: Any) -> None:
        got.append(message)
        if len(got) == 1:
            for x in range(1, 10):
                writer.put(OurTwist.planar(float(x)))
                wait()

    node.create_subscription(Twist, "a", slow, 2)
    wait_for(lambda: writer.matched)
    writer.put(OurTwist.planar(0.0))
    executor = rclpy.get_global_executor()
    executor.add_node(node)
    executor.spin_once(timeout_sec=10)
    executor.spin_once(timeout_sec=10)
    executor.spin_once(timeout_sec=10)
    executor.spin_once(timeout_sec=0)
    assert numbers(got) == [0, 8, 9]


def test_keep_all_keeps_all(ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[Any]()
    profile = QoSProfile(history=qos.HistoryPolicy.KEEP_ALL)
    node.create_subscription(Twist, "a", got.append, profile)
    writer = rclpy.create_node("jerry").create_publisher(Twist, "a", profile)
    wait_for(writer.get_subscription_count)
    for x in range(2000):
        writer.publish(twist(x))
    spin_for(lambda: len(got) == 2000, node)
    assert numbers(got) == list(range(2000))


def test_callbacks_run_in_the_thread_that_spins(ros: Wire, spin_for: Spin) -> None:
    node, threads = rclpy.create_node("tom"), set[threading.Thread]()
    node.create_subscription(Twist, "a", lambda _: threads.add(threading.current_thread()), 10)
    writer = node.create_publisher(Twist, "a", 10)
    wait_for(writer.get_subscription_count)
    writer.publish(twist(1))
    assert threads == set()
    spin_for(lambda: threads, node)
    assert threads == {threading.main_thread()}


def test_a_loop_that_never_waits_sees_the_newest(ros: Wire) -> None:
    node, bus, got = rclpy.create_node("tom"), ros.bus("bus"), list[Any]()
    node.create_subscription(Twist, "a", got.append, 1)
    writer = bus.publisher("a", OurTwist)
    wait_for(lambda: writer.matched)
    wait = meet(bus, node)
    for x in range(200):
        writer.put(OurTwist.planar(float(x)))
        wait()
        rclpy.spin_once(node, timeout_sec=0)
    assert numbers(got) == list(range(200))


def test_what_cannot_be_read_is_reported_once_and_left_out(
    ros: Wire, spin_for: Spin, capfd: pytest.CaptureFixture[str]
) -> None:
    node, bus, got = rclpy.create_node("tom"), ros.bus("bus"), list[Any]()
    subscription = node.create_subscription(Twist, "a", got.append, 10)
    writer = bus.publisher("a", OurTwist)
    wait_for(lambda: writer.matched)
    for rubbish in (b"rubbish", b'{"linear": 3}', b'{"angular": {"w": 1}}'):
        writer.put_bytes(rubbish)
    writer.put(OurTwist.planar(1.0))
    spin_for(lambda: got, node)
    assert (numbers(got), subscription.bad) == ([1.0], 3)
    (line,) = capfd.readouterr().err.splitlines()
    assert "[WARN]" in line
    assert f"[tom]: /a: dropped a message from {bus.source} (1 so far): not a Twist" in line


def test_a_callback_may_ask_when_a_message_came_or_for_its_bytes(ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[Any]()
    node.create_subscription(Twist, "a", lambda message, info: got.append(sorted(info)), 10)
    node.create_subscription(Twist, "a", lambda payload: got.append(payload), 10, raw=True)
    writer = node.create_publisher(Twist, "a", 10)
    wait_for(writer.get_subscription_count)
    writer.publish(twist(1))
    spin_for(lambda: len(got) == 2, node)
    assert ["received_timestamp", "source_timestamp"] in got
    assert any(isinstance(one, bytes) and b'"linear"' in one for one in got)


def test_a_callback_that_takes_no_message_is_refused(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    with pytest.raises(
        RuntimeError,
        match=r"takes \(\); a subscription's callback takes one argument, the message$",
    ):
        node.create_subscription(Twist, "a", lambda: None, 10)
    with pytest.raises(TypeError, match=r"^a callback must be a function, and 3 is an int$"):
        node.create_subscription(Twist, "a", 3, 10)  # type: ignore[arg-type]
    with pytest.raises(
        TypeError, match=r"and None is a NoneType; write the function's name without \(\)$"
    ):
        node.create_subscription(Twist, "a", None, 10)  # type: ignore[arg-type]


def test_a_destroyed_one_hears_nothing_while_data_come(ros: Wire, spin_for: Spin) -> None:
    node, got, others = rclpy.create_node("tom"), list[Any](), list[Any]()
    first = node.create_subscription(Twist, "a", got.append, 10)
    node.create_subscription(Twist, "a", others.append, 10)
    writer = node.create_publisher(Twist, "a", 10)
    node.create_timer(0.001, lambda: writer.publish(twist(1)))
    spin_for(lambda: got, node)
    assert first.get_publisher_count() == 1
    assert node.destroy_subscription(first)
    assert not node.destroy_subscription(first)
    heard, count = len(got), len(others)
    spin_for(lambda: len(others) > count + 20, node)
    assert len(got) == heard
    assert node.count_subscribers("a") == 1


def test_an_async_callback_runs_to_its_end(ros: Wire, spin_for: Spin) -> None:
    node, got, future = rclpy.create_node("tom"), list[Any](), rclpy.Future()

    async def callback(message: Any) -> None:
        got.append(message.linear.x)
        got.append(await future)

    node.create_subscription(Twist, "a", callback, 10)
    writer = node.create_publisher(Twist, "a", 10)
    wait_for(writer.get_subscription_count)
    writer.publish(twist(1))
    spin_for(lambda: got, node)
    assert got == [1.0]
    future.set_result("there")
    spin_for(lambda: len(got) == 2, node)
    assert got == [1.0, "there"]


String: Any = find("std_msgs/msg/String")
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LARGE = 1_000_000  # bytes


def test_a_late_subscriber_gets_the_last_of_each_publisher(ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[str]()
    for name, texts in (("one", "ab"), ("two", "cd")):
        writer = rclpy.create_node(name).create_publisher(String, "map", LATCHED)
        for text in texts:
            writer.publish(String(data=text))
    node.create_subscription(String, "map", lambda message: got.append(message.data), LATCHED)
    spin_for(lambda: len(got) == 2, node)
    assert sorted(got) == ["b", "d"]


def test_a_publisher_that_comes_later_is_heard_from_its_first_message_and_each_once(
    ros: Wire, spin_for: Spin
) -> None:
    node, got = rclpy.create_node("tom"), list[str]()
    node.create_subscription(String, "map", lambda message: got.append(message.data), LATCHED)
    rclpy.spin_once(node, timeout_sec=0)
    writer = rclpy.create_node("late").create_publisher(String, "map", LATCHED)
    writer.publish(String(data="first"))
    spin_for(lambda: got, node)
    wait_for(writer.get_subscription_count)
    writer.publish(String(data="second"))
    spin_for(lambda: "second" in got, node)
    end = ros.bus("end").publisher("map", OurTwist)  # one more token, so one more question to all
    end.close()
    writer.publish(String(data="third"))
    spin_for(lambda: "third" in got, node)
    assert got == ["first", "second", "third"]


def test_what_came_does_not_stay_in_memory(ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[int]()
    reader = node.create_subscription(
        String, "map", lambda message: got.append(len(message.data)), LATCHED
    )
    writer = rclpy.create_node("one").create_publisher(String, "map", LATCHED)
    writer.publish(String(data=LARGE * "x"))
    spin_for(lambda: got == [LARGE], node)
    assert reader.latched
    assert sum(map(sys.getsizeof, reader.latched.seen)) < LARGE


def test_a_volatile_one_gets_nothing_old(ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[str]()
    other, end = rclpy.create_node("one"), node._holozen.bus.subscribe_raw("end")
    writer = other.create_publisher(String, "map", LATCHED)
    writer.publish(String(data="old"))
    # What was sent before has been dropped by now.
    wait_for(lambda: other._holozen.bus.session.put("end", b"") or end.try_recv())
    node.create_subscription(String, "map", lambda message: got.append(message.data), 10)
    wait_for(writer.get_subscription_count)
    writer.publish(String(data="new"))
    spin_for(lambda: got, node)
    assert got == ["new"]


def test_it_can_be_destroyed(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    subscription = node.create_subscription(String, "map", print, LATCHED)
    latched = subscription.latched
    assert latched
    thread = wait_for(lambda: latched.writers.thread)
    assert thread
    assert node.destroy_subscription(subscription)
    thread.join(10)
    assert not thread.is_alive()


def test_the_next_message_is_given_also_while_another_thread_spins(ros: Wire) -> None:
    node, writer = rclpy.create_node("tom"), ros.bus().publisher("cmd_vel", OurTwist)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spins = threading.Thread(target=executor.spin)
    spins.start()

    def publish() -> None:
        wait_for(lambda: writer.matched)
        writer.put(OurTwist.planar(0.5))

    publisher = threading.Thread(target=publish)
    publisher.start()
    there, message = wait_for_message(Twist, node, "cmd_vel", time_to_wait=10)
    assert (there, message.linear.x) == (True, 0.5)
    publisher.join()
    wait_for(lambda: not writer.matched)
    executor.shutdown()
    spins.join()


def test_it_waits_no_longer_than_its_timeout(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    assert wait_for_message(Twist, node, "cmd_vel", time_to_wait=0.02) == (False, None)
    assert node.count_subscribers("cmd_vel") == 0


def test_what_was_latched_counts(ros: Wire) -> None:
    rclpy.create_node("tom").create_publisher(Twist, "cmd_vel", LATCHED).publish(Twist())
    there, message = wait_for_message(
        Twist, rclpy.create_node("jerry"), "cmd_vel", qos_profile=LATCHED
    )
    assert (there, message) == (True, Twist())


def test_it_ends_with_rclpy(ros: Wire) -> None:
    node, ended = rclpy.create_node("tom"), list[str]()

    def wait() -> None:
        with pytest.raises(RCLError) as caught:
            wait_for_message(Twist, node, "cmd_vel")
        ended.append(str(caught.value))

    thread = threading.Thread(target=wait)
    thread.start()
    wait_for(lambda: node.count_subscribers("cmd_vel"))
    rclpy.shutdown()
    thread.join(10)
    assert ended == ["failed to wait for a message on /cmd_vel: rclpy was shut down"]
