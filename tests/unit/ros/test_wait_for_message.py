"""One message of a topic is waited for, whoever spins or not."""

import threading
from typing import Any

import pytest

from holozen.messages import Twist as OurTwist
from holozen.ros import rclpy
from holozen.ros.exceptions import RCLError
from holozen.ros.executors import SingleThreadedExecutor
from holozen.ros.generated import find
from holozen.ros.wait_for_message import wait_for_message
from holozen.testing import Wire, wait_for

Twist: Any = find("geometry_msgs/msg/Twist")


def test_the_next_message_is_given_also_while_another_thread_spins(ros: Wire) -> None:
    node, writer = rclpy.create_node("tom"), ros.bus().publisher("cmd_vel", OurTwist)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spins = threading.Thread(target=executor.spin)
    spins.start()

    def tell() -> None:
        wait_for(lambda: writer.matched)
        writer.put(OurTwist.planar(0.5))

    teller = threading.Thread(target=tell)
    teller.start()
    there, message = wait_for_message(Twist, node, "cmd_vel", time_to_wait=10)
    assert (there, message.linear.x) == (True, 0.5)
    teller.join()
    wait_for(lambda: not writer.matched)
    executor.shutdown()
    spins.join()


def test_it_waits_no_longer_than_it_was_told(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    assert wait_for_message(Twist, node, "cmd_vel", time_to_wait=0.02) == (False, None)
    assert node.count_subscribers("cmd_vel") == 0


def test_what_was_latched_counts(ros: Wire) -> None:
    from holozen.ros.qos import DurabilityPolicy, QoSProfile

    node = rclpy.create_node("tom")
    lasting = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(Twist, "cmd_vel", lasting).publish(Twist())
    there, message = wait_for_message(Twist, rclpy.create_node("jerry"), "cmd_vel", qos_profile=lasting)
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
