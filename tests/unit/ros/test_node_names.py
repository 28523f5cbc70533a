"""A Node leaves every name that ROS's Node does not have to those who make a subclass of it."""

from collections.abc import Callable
from typing import Any

import pytest

from holozen.ros import missing, rclpy
from holozen.ros.generated import find
from holozen.ros.node import Node
from holozen.testing import Wire, wait_for

String: Any = find("std_msgs/msg/String")
Trigger: Any = find("std_srvs/srv/Trigger")

OF_ROS = {
    "add_on_set_parameters_callback", "add_post_set_parameters_callback", "add_pre_set_parameters_callback",
    "add_waitable", "clients", "context", "count_clients", "count_publishers", "count_services",
    "count_subscribers", "create_client", "create_guard_condition", "create_publisher", "create_rate",
    "create_service", "create_subscription", "create_timer", "declare_parameter", "declare_parameters",
    "default_callback_group", "describe_parameter", "describe_parameters", "destroy_client",
    "destroy_guard_condition", "destroy_node", "destroy_publisher", "destroy_rate", "destroy_service",
    "destroy_subscription", "destroy_timer", "executor", "get_client_names_and_types_by_node",
    "get_clients_info_by_service", "get_clock", "get_fully_qualified_name", "get_fully_qualified_node_names",
    "get_logger", "get_name", "get_namespace", "get_node_names", "get_node_names_and_namespaces",
    "get_node_names_and_namespaces_with_enclaves", "get_parameter", "get_parameter_or", "get_parameter_type",
    "get_parameter_types", "get_parameters", "get_parameters_by_prefix", "get_publisher_names_and_types_by_node",
    "get_publishers_info_by_topic", "get_servers_info_by_service", "get_service_names_and_types",
    "get_service_names_and_types_by_node", "get_subscriber_names_and_types_by_node",
    "get_subscriptions_info_by_topic", "get_topic_names_and_types", "guards", "handle", "has_parameter",
    "list_parameters", "publishers", "remove_on_set_parameters_callback", "remove_post_set_parameters_callback",
    "remove_pre_set_parameters_callback", "remove_waitable", "resolve_service_name", "resolve_topic_name",
    "services", "set_descriptor", "set_parameters", "set_parameters_atomically", "subscriptions", "timers",
    "undeclare_parameter", "wait_for_node", "waitables",
}  # fmt: skip
"""What ROS's Node has."""

MINE = [
    "bus", "entities", "close", "name", "namespace", "graph", "store", "arguments", "logger", "clock", "owned",
    "group", "fqn", "core", "leave", "own", "_graph", "_graph_lock", "_closed", "_closing", "_owned", "_own",
    "_disown", "_on", "_of", "_ends", "_store", "_executor", "_arguments", "_resolve", "_name", "_namespace",
    "_fqn", "_logger", "_clock", "_time_source", "_check_open", "_init_graph", "_init_parameters", "_context",
    "_bus", "_parameters",
]  # fmt: skip
"""Names that scripts take for themselves."""


def test_a_node_has_no_public_name_that_ros_does_not_have(ros: Wire) -> None:
    names = {name for name in dir(rclpy.create_node("tom")) if not name.startswith("__")}
    assert {name for name in names if name[0] != "_"} - OF_ROS == set()
    assert {name for name in names if name[0] == "_"} == {"_holozen"}
    assert set(missing.OF_NODE) == OF_ROS - names


class Mine(Node):
    """A node whose script has taken all those names."""

    def __init__(self) -> None:
        super().__init__("tom")
        self.heard = 0
        for name in MINE:
            setattr(self, name, f"my {name}")
        self.declare_parameter("p", 1)
        self.pub = self.create_publisher(String, "x", 10)
        self.create_subscription(String, "x", self.hear, 10)
        self.create_timer(0.01, lambda: self.pub.publish(String(data="a")))
        self.create_service(Trigger, "go", lambda _, response: response)
        self.client = self.create_client(Trigger, "go")

    def hear(self, _message: Any) -> None:
        self.heard += 1


def test_a_script_with_such_names_runs_and_ends(ros: Wire, spin_for: Callable[..., Any]) -> None:
    node = Mine()
    future = node.client.call_async(Trigger.Request())
    assert spin_for(lambda: node.heard and future.done(), node)
    assert node.set_parameters([rclpy.Parameter("p", value=2)])[0].successful
    assert node.count_publishers("x") == node.count_services("go") == 1
    assert node.create_rate(1000).sleep() is None  # type: ignore[func-returns-value]
    assert repr(node) == "<node /tom>"
    node.destroy_node()
    assert [getattr(node, name) for name in MINE] == [f"my {name}" for name in MINE]


class Closes(Node):
    """A node with an end of its own."""

    ends = 0

    def close(self) -> None:
        """Leave, and end all."""
        self.ends += 1
        self.destroy_node()
        rclpy.shutdown()


def test_a_close_of_its_own_ends_it_once(ros: Wire) -> None:
    node = Closes("tom")
    node.close()
    assert node.ends == 1
    assert not rclpy.ok()


def test_shutdown_does_not_call_a_close_of_the_script(ros: Wire) -> None:
    node = Closes("tom")
    rclpy.shutdown()
    assert node.ends == 0


def test_a_node_is_destroyed_at_the_end_of_its_with(ros: Wire) -> None:
    with rclpy.create_node("tom") as node:
        assert node.get_node_names() == ["tom"]
    jerry = rclpy.create_node("jerry")
    wait_for(lambda: jerry.get_node_names() == ["jerry"])


class Early(Node):
    """A node that is used before it is one."""

    def __init__(self) -> None:
        self.get_logger()


def test_what_a_node_lacks_is_told(ros: Wire) -> None:
    node: Any = Closes("tom")
    assert not hasattr(node, "nothing")
    with pytest.raises(AttributeError, match=r"^'Closes' object has no attribute 'nothing'; what Node has here: "):
        _ = node.nothing
    with pytest.raises(AttributeError, match="has no attribute 'count_clients'; who asks does not stand in the graph"):
        node.count_clients("go")
    with pytest.raises(AttributeError, match=r"call super\(\).__init__\('name_of_the_node'\) in .* Early before"):
        Early()
