"""Nodes have ROS's names, and stand on the wire like any other."""

import threading
from collections.abc import Callable
from typing import Any

import pytest

from holozen.bus import Bus
from holozen.messages import Twist as OurTwist
from holozen.ros import exceptions, rclpy
from holozen.ros.context import Context
from holozen.ros.generated import find
from holozen.ros.node import Node
from holozen.testing import Wire, wait_for

Twist: Any = find("geometry_msgs/msg/Twist")
Trigger: Any = find("std_srvs/srv/Trigger")


@pytest.mark.parametrize(
    ("namespace", "topic", "key"),
    [
        (None, "cmd_vel", "cmd_vel"), (None, "/cmd_vel", "cmd_vel"), ("Fred", "cmd_vel", "Fred/cmd_vel"),
        ("/a/b", "cmd_vel", "a/b/cmd_vel"), ("/a/b", "/cmd_vel", "cmd_vel"), ("Fred", "~/x", "Fred/tom/x"),
    ],
)  # fmt: skip
def test_names_become_keys(ros: Wire, namespace: str | None, topic: str, key: str) -> None:
    node = Node("tom", namespace=namespace)
    publisher = node.create_publisher(Twist, topic, 1)
    assert publisher.topic_name == node.resolve_topic_name(topic) == f"/{key}"
    graph = ros.bus("watch").graph()
    wait_for(lambda: any(end.kind == "pub" and end.key == key for end in graph.endpoints()))
    (name,) = {end.node for end in graph.endpoints()}
    assert f"/{name}" == node.get_fully_qualified_name()
    assert (node.get_name(), node.get_namespace()) == ("tom", f"/{(namespace or '').strip('/')}")


def test_the_command_line_renames_and_remaps(ros: Wire) -> None:
    words = ["--ros-args", "-r", "__node:=jerry", "-r", "__ns:=/lab", "-r", "cmd_vel:=/Fred/cmd_vel", "-r", "go:=come"]
    node = Node("tom", cli_args=words)
    assert repr(node) == "<node /lab/jerry>"
    assert node.get_logger().name == "lab.jerry"
    publisher = node.create_publisher(Twist, "cmd_vel", 1)
    assert publisher.topic_name == "/Fred/cmd_vel"
    assert node.create_service(Trigger, "go", lambda _, response: response).service_name == "/lab/come"
    assert node.create_client(Trigger, "go").service_name == "/lab/come"
    assert node.resolve_topic_name("cmd_vel", only_expand=True) == "/lab/cmd_vel"
    assert node.resolve_service_name("go", only_expand=True) == "/lab/go"


def test_the_global_words_hold_for_all_nodes_but_those_that_will_not(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    from holozen.ros import context as contexts

    monkeypatch.setattr(contexts, "connection", wire.connection)
    with Context() as context:
        context.arguments = context.arguments.merged(
            rclpy_arguments(["--ros-args", "-r", "tom:a:=b", "-p", "speed:=0.5"])
        )
        tom, jerry = Node("tom", context=context), Node("jerry", context=context)
        free = Node("tom", context=context, use_global_arguments=False)
        assert [node.resolve_topic_name("a") for node in (tom, jerry, free)] == ["/b", "/a", "/a"]
        assert tom.declare_parameter("speed", 0.1).value == 0.5
        assert free.declare_parameter("speed", 0.1).value == 0.1


def rclpy_arguments(words: list[str]) -> Any:
    from holozen.ros import arguments

    return arguments.parse(words)


def test_no_node_before_init_and_after_the_end(ros: Wire) -> None:
    rclpy.shutdown()
    with pytest.raises(exceptions.NotInitializedException, match="cannot create node 'tom'"):
        Node("tom")


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda node: Node("tom!"), exceptions.InvalidNodeNameException),
        (lambda node: Node("tom", namespace="a b"), exceptions.InvalidNamespaceException),
        (lambda node: node.create_publisher(Twist, "a//b", 1), exceptions.InvalidTopicNameException),
        (lambda node: node.create_subscription(Twist, "1a", print, 1), exceptions.InvalidTopicNameException),
        (lambda node: node.create_client(Trigger, "a b"), exceptions.InvalidServiceNameException),
        (lambda node: node.create_publisher(Twist, "a", "1"), TypeError),
        (lambda node: node.create_publisher(Trigger, "a", 1), AttributeError),
        (lambda node: node.create_publisher(Twist(), "a", 1), AttributeError),
        (lambda node: node.create_service(Twist, "a", print), AttributeError),
        (lambda node: node.create_client(3, "a"), AttributeError),
    ],
)
def test_what_is_wrong_is_refused_and_leaves_nothing(
    ros: Wire, make: Callable[[Node], object], error: type[Exception]
) -> None:
    node = rclpy.create_node("tom", start_parameter_services=False)
    with pytest.raises(error):
        make(node)
    assert node.get_topic_names_and_types() == []
    assert node.get_service_names_and_types() == []
    assert node.get_node_names() == ["tom"]


def test_a_destroyed_node_has_left_and_makes_nothing_more(ros: Wire) -> None:
    node, before = rclpy.create_node("tom"), threading.active_count()
    graph = ros.bus("watch").graph()
    for _ in range(2):
        node.create_subscription(Twist, "a", print, 1)
    node.create_publisher(Twist, "cmd_vel", 1)
    rclpy.spin_once(node, timeout_sec=0.01)
    wait_for(graph.endpoints)
    node.destroy_node()
    node.destroy_node()
    wait_for(lambda: graph.endpoints() == [])
    assert graph.left() == [node._holozen.bus.source]
    wait_for(lambda: threading.active_count() <= before)
    with pytest.raises(exceptions.InvalidHandle, match="node /tom was destroyed, or rclpy shut down"):
        node.create_publisher(Twist, "a", 1)


def test_shutdown_lets_all_nodes_leave_at_once(ros: Wire) -> None:
    graph = ros.bus("watch").graph()
    nodes = [rclpy.create_node(f"tom{number}") for number in range(5)]
    wait_for(lambda: sum(end.kind == "node" for end in graph.endpoints()) == 5)
    rclpy.shutdown()
    wait_for(lambda: graph.endpoints() == [])
    nodes[0].destroy_node()


def test_nodes_that_are_destroyed_leave_side_by_side_and_before_the_end(
    ros: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    nodes = [rclpy.create_node(f"tom{number}", start_parameter_services=False) for number in range(3)]
    meeting, leave, left = threading.Barrier(3, timeout=10), Bus.close, list[Bus]()

    def close(bus: Bus) -> None:
        meeting.wait()
        leave(bus)
        left.append(bus)

    with monkeypatch.context() as patch:
        patch.setattr(Bus, "close", close)
        for node in nodes:
            node.destroy_node()
        rclpy.shutdown()
    assert len(left) == 3


def test_it_lists_what_it_has(ros: Wire) -> None:
    node = rclpy.create_node("tom", start_parameter_services=False)
    made = [
        node.create_publisher(Twist, "a", 1), node.create_subscription(Twist, "a", print, 1),
        node.create_client(Trigger, "go"), node.create_service(Trigger, "go", lambda _, response: response),
        node.create_timer(1, print), node.create_guard_condition(print),
    ]  # fmt: skip
    lists: list[Any] = [node.publishers, node.subscriptions, node.clients, node.services, node.timers, node.guards]
    assert [list(one) for one in lists] == [[one] for one in made]


def test_the_verbs_see_it_like_any_other(ros: Wire) -> None:
    node = rclpy.create_node("tom", namespace="Fred")
    node.create_publisher(Twist, "cmd_vel", 1)
    assert ros.run("node", "list").stdout == "Fred/tom\n"
    assert "Fred/cmd_vel: geometry_msgs/msg/Twist" in ros.run("node", "info", "Fred/tom").stdout
    assert ros.run("topic", "list", "-t").stdout == "Fred/cmd_vel [geometry_msgs/msg/Twist]\n"


def test_what_is_published_by_a_bus_and_a_node_is_the_same_bytes(ros: Wire) -> None:
    node, bus = rclpy.create_node("tom"), ros.bus()
    tap = bus.tap("*")
    mine, ours = node.create_publisher(Twist, "a", 1), bus.publisher("b", OurTwist)
    wait_for(lambda: mine.get_subscription_count() and ours.matched)
    message = Twist()
    message.linear.x = 0.5
    mine.publish(message)
    ours.put(OurTwist.planar(0.5))
    first, second = tap.recv(), tap.recv()
    assert (first.payload, first.encoding) == (second.payload, second.encoding)
