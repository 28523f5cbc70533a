"""A node sees the others' names, topics and services."""

import threading

import pytest

from holozen.messages import Odometry, TriggerReply, TriggerRequest, Twist
from holozen.ros import rclpy
from holozen.ros.exceptions import InvalidHandle, RCLError
from holozen.ros.generated import find
from holozen.ros.node import Node
from holozen.ros.qos import qos_profile_default
from holozen.ros.topic_endpoint_info import TopicEndpointInfo, TopicEndpointTypeEnum
from holozen.testing import Wire, wait_for

TWIST, ODOM, TRIGGER = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry", "std_srvs/srv/Trigger"


@pytest.fixture
def node(ros: Wire) -> Node:
    """A node that looks at a bus and at another node."""
    bus = ros.bus("sim", lasting=True)
    bus.publisher("odom", Odometry)
    bus.subscribe("cmd_vel", Twist)
    bus.serve("go", TriggerRequest, TriggerReply, lambda _: TriggerReply())
    other = Node("talker", namespace="Fred", start_parameter_services=False)
    other.create_publisher(find(TWIST), "/cmd_vel", 1)
    node = Node("tom", start_parameter_services=False)
    wait_for(lambda: len(node._holozen.graph.ends()) == 7)
    return node


def test_nodes(node: Node) -> None:
    assert sorted(node.get_node_names()) == ["sim", "talker", "tom"]
    assert ("talker", "/Fred") in node.get_node_names_and_namespaces()
    assert "/Fred/talker" in node.get_fully_qualified_node_names()


def test_topics_and_services(node: Node) -> None:
    assert node.get_topic_names_and_types() == [("/cmd_vel", [TWIST]), ("/odom", [ODOM])]
    assert node.get_service_names_and_types() == [("/go", [TRIGGER])]


def test_counts(node: Node) -> None:
    assert (node.count_publishers("cmd_vel"), node.count_subscribers("/cmd_vel"), node.count_services("go")) == (
        1,
        1,
        1,
    )
    assert (node.count_publishers("~/cmd_vel"), node.count_services("come")) == (0, 0)


def test_who_writes_and_who_reads(node: Node) -> None:
    (writer,) = node.get_publishers_info_by_topic("cmd_vel")
    assert writer[:3] == ("talker", "/Fred", TWIST)
    assert isinstance(writer, TopicEndpointInfo)
    (reader,) = node.get_subscriptions_info_by_topic("cmd_vel")
    assert reader[:2] == ("sim", "/")
    kinds = (writer.endpoint_type, reader.endpoint_type)
    assert kinds == (TopicEndpointTypeEnum.PUBLISHER, TopicEndpointTypeEnum.SUBSCRIPTION)
    assert writer.qos_profile == qos_profile_default


def test_what_a_node_has(node: Node) -> None:
    assert node.get_publisher_names_and_types_by_node("talker", "/Fred") == [("/cmd_vel", [TWIST])]
    assert node.get_subscriber_names_and_types_by_node("sim", "/") == [("/cmd_vel", [TWIST])]
    assert node.get_service_names_and_types_by_node("sim", "/") == [("/go", [TRIGGER])]


def test_a_node_is_waited_for(node: Node) -> None:
    assert not node.wait_for_node("/late", 0.02)
    late = threading.Timer(0.02, lambda: rclpy.create_node("late"))
    late.start()
    assert node.wait_for_node("late", 10)
    late.join()  # it is in the graph before all that it has is made


def test_nobody_looks_after_the_end(node: Node) -> None:
    other = Node("other")
    other.destroy_node()
    with pytest.raises(InvalidHandle, match="node /other was destroyed"):
        other.count_publishers("cmd_vel")
    rclpy.shutdown()
    for look in (node.get_node_names, lambda: node.count_subscribers("cmd_vel"), lambda: node.wait_for_node("x", 10)):
        with pytest.raises(RCLError, match="failed to look at the graph: rclpy was shut down"):
            look()
