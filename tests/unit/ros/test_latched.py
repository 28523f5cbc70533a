"""A transient local subscription gets what was sent before it, once."""

import sys
from collections.abc import Callable
from typing import Any

from holozen.messages import Twist as OurTwist
from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.qos import DurabilityPolicy, QoSProfile
from holozen.testing import Wire, wait_for

String: Any = find("std_msgs/msg/String")
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
Spin = Callable[..., Any]
LARGE = 1_000_000  # bytes


def test_who_comes_late_gets_the_last_of_each_publisher(ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[str]()
    for name, texts in (("one", "ab"), ("two", "cd")):
        writer = rclpy.create_node(name).create_publisher(String, "map", LATCHED)
        for text in texts:
            writer.publish(String(data=text))
    node.create_subscription(String, "map", lambda message: got.append(message.data), LATCHED)
    spin_for(lambda: len(got) == 2, node)
    assert sorted(got) == ["b", "d"]


def test_a_publisher_that_comes_later_is_heard_from_its_first_message_and_each_once(ros: Wire, spin_for: Spin) -> None:
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
    reader = node.create_subscription(String, "map", lambda message: got.append(len(message.data)), LATCHED)
    writer = rclpy.create_node("one").create_publisher(String, "map", LATCHED)
    writer.publish(String(data=LARGE * "x"))
    spin_for(lambda: got == [LARGE], node)
    assert reader._latched
    assert sum(map(sys.getsizeof, reader._latched._seen)) < LARGE


def test_a_volatile_one_gets_nothing_old(ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[str]()
    other, end = rclpy.create_node("one"), node._holozen.bus.tap("end")
    writer = other.create_publisher(String, "map", LATCHED)
    writer.publish(String(data="old"))
    # What was sent before it has come by now, to nobody.
    wait_for(lambda: other._holozen.bus.session.put("end", b"") or end.try_recv())
    node.create_subscription(String, "map", lambda message: got.append(message.data), 10)
    wait_for(writer.get_subscription_count)
    writer.publish(String(data="new"))
    spin_for(lambda: got, node)
    assert got == ["new"]


def test_it_can_be_destroyed(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    subscription = node.create_subscription(String, "map", print, LATCHED)
    latched = subscription._latched
    assert latched
    thread = wait_for(lambda: latched._writers.thread)
    assert thread
    assert node.destroy_subscription(subscription)
    thread.join(10)
    assert not thread.is_alive()
