"""Nodes have ROS's names, and stand on the wire like any other."""

import threading
from collections.abc import Callable
from typing import Any

import pytest

from holozen.bus import Bus
from holozen.messages import Odometry, TriggerReply, TriggerRequest
from holozen.messages import Twist as OurTwist
from holozen.ros import catalog, rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy import exceptions
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.exceptions import InvalidHandle, RCLError
from holozen.ros.rclpy.node import Node, TopicEndpointInfo, TopicEndpointTypeEnum
from holozen.ros.rclpy.qos import qos_profile_default
from holozen.testing import Wire, wait_for

Twist: Any = find("geometry_msgs/msg/Twist")
Trigger: Any = find("std_srvs/srv/Trigger")


@pytest.mark.parametrize(
    ("namespace", "topic", "key"),
    [
        (None, "cmd_vel", "cmd_vel"),
        ("/a/b", "/cmd_vel", "cmd_vel"),
        ("Fred", "~/x", "Fred/tom/x"),
    ],
)
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
    words = [
        "--ros-args",
        "-r",
        "__node:=jerry",
        "-r",
        "__ns:=/lab",
        "-r",
        "cmd_vel:=/Fred/cmd_vel",
        "-r",
        "go:=come",
    ]
    node = Node("tom", cli_args=words)
    assert repr(node) == "<node /lab/jerry>"
    assert node.get_logger().name == "lab.jerry"
    publisher = node.create_publisher(Twist, "cmd_vel", 1)
    assert publisher.topic_name == "/Fred/cmd_vel"
    assert (
        node.create_service(Trigger, "go", lambda _, response: response).service_name == "/lab/come"
    )
    assert node.create_client(Trigger, "go").service_name == "/lab/come"
    assert node.resolve_topic_name("cmd_vel", only_expand=True) == "/lab/cmd_vel"
    assert node.resolve_service_name("go", only_expand=True) == "/lab/go"


def test_the_global_words_hold_for_all_nodes_but_those_that_will_not(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    from holozen.ros.rclpy import context as contexts

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
    from holozen.ros.rclpy import arguments

    return arguments.parse(words)


def test_no_node_before_init_and_after_the_end(ros: Wire) -> None:
    rclpy.shutdown()
    with pytest.raises(
        exceptions.NotInitializedException, match=r"^call rclpy.init.*; cannot create node 'tom'$"
    ):
        Node("tom")


def test_what_is_wrong_is_refused_and_leaves_nothing(ros: Wire) -> None:
    node = rclpy.create_node("tom", start_parameter_services=False)
    rows: list[tuple[Callable[[Any], object], type[Exception]]] = [
        (lambda node: Node("tom!"), exceptions.InvalidNodeNameException),
        (lambda node: Node("tom", namespace="a b"), exceptions.InvalidNamespaceException),
        (
            lambda node: node.create_publisher(Twist, "a//b", 1),
            exceptions.InvalidTopicNameException,
        ),
        (
            lambda node: node.create_subscription(Twist, "1a", print, 1),
            exceptions.InvalidTopicNameException,
        ),
        (lambda node: node.create_client(Trigger, "a b"), exceptions.InvalidServiceNameException),
        (lambda node: node.create_publisher(Twist, "a", "1"), TypeError),
        (lambda node: node.create_publisher(Trigger, "a", 1), AttributeError),
        (lambda node: node.create_publisher(Twist(), "a", 1), AttributeError),
        (lambda node: node.create_service(Twist, "a", print), AttributeError),
        (lambda node: node.create_client(3, "a"), AttributeError),
        (lambda node: node.create_service(Trigger, "a", None), TypeError),
        (lambda node: node.create_timer(1, None), TypeError),
    ]
    for make, error in rows:
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
    assert [left.source for left in graph.left()] == [node._holozen.bus.source]
    wait_for(lambda: threading.active_count() <= before)
    with pytest.raises(
        exceptions.InvalidHandle, match="node /tom was destroyed, or rclpy was shut down"
    ):
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
    nodes = [
        rclpy.create_node(f"tom{number}", start_parameter_services=False) for number in range(3)
    ]
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
        node.create_publisher(Twist, "a", 1),
        node.create_subscription(Twist, "a", print, 1),
        node.create_client(Trigger, "go"),
        node.create_service(Trigger, "go", lambda _, response: response),
        node.create_timer(1, print),
        node.create_guard_condition(print),
    ]
    lists: list[Any] = [
        node.publishers,
        node.subscriptions,
        node.clients,
        node.services,
        node.timers,
        node.guards,
    ]
    assert [list(one) for one in lists] == [[one] for one in made]


def test_the_verbs_see_it_like_any_other(ros: Wire) -> None:
    node = rclpy.create_node("tom", namespace="Fred")
    node.create_publisher(Twist, "cmd_vel", 1)
    assert ros.run("node", "list").stdout == "Fred/tom\n"
    assert "Fred/cmd_vel: geometry_msgs/msg/Twist" in ros.run("node", "info", "Fred/tom").stdout
    assert ros.run("topic", "list", "-t").stdout == "Fred/cmd_vel [geometry_msgs/msg/Twist]\n"


def test_what_is_published_by_a_bus_and_a_node_is_the_same_bytes(ros: Wire) -> None:
    node, bus = rclpy.create_node("tom"), ros.bus()
    tap = bus.subscribe_raw("*")
    mine, ours = node.create_publisher(Twist, "a", 1), bus.publisher("b", OurTwist)
    wait_for(lambda: mine.get_subscription_count() and ours.matched)
    message = Twist()
    message.linear.x = 0.5
    mine.publish(message)
    ours.put(OurTwist.planar(0.5))
    first, second = tap.recv(), tap.recv()
    assert (first.payload, first.encoding) == (second.payload, second.encoding)


TWIST, ODOM, TRIGGER = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry", "std_srvs/srv/Trigger"


@pytest.fixture
def node(ros: Wire) -> Node:
    """A node that looks at a bus and at another node."""
    bus = ros.bus("sim", lasting=True)
    bus.publisher("odom", Odometry)
    bus.subscribe("cmd_vel", OurTwist)
    bus.serve("go", TriggerRequest, TriggerReply, lambda _: TriggerReply())
    other = Node("talker", namespace="Fred", start_parameter_services=False)
    other.create_publisher(find(TWIST), "/cmd_vel", 1)
    node = Node("tom", start_parameter_services=False)
    wait_for(lambda: len(node._holozen.endpoints()) == 7)
    return node


def test_nodes(node: Node) -> None:
    assert sorted(node.get_node_names()) == ["sim", "talker", "tom"]
    assert ("talker", "/Fred") in node.get_node_names_and_namespaces()
    assert "/Fred/talker" in node.get_fully_qualified_node_names()


def test_topics_and_services(node: Node) -> None:
    assert node.get_topic_names_and_types() == [("/cmd_vel", [TWIST]), ("/odom", [ODOM])]
    assert node.get_service_names_and_types() == [("/go", [TRIGGER])]


def test_counts(node: Node) -> None:
    assert (
        node.count_publishers("cmd_vel"),
        node.count_subscribers("/cmd_vel"),
        node.count_services("go"),
    ) == (
        1,
        1,
        1,
    )
    assert (node.count_publishers("~/cmd_vel"), node.count_services("come")) == (0, 0)


def test_publishers_and_subscribers_are_listed(node: Node) -> None:
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


def test_the_graph_is_closed_after_the_end(node: Node) -> None:
    other = Node("other")
    other.destroy_node()
    with pytest.raises(InvalidHandle, match="node /other was destroyed"):
        other.count_publishers("cmd_vel")
    rclpy.shutdown()
    for look in (
        node.get_node_names,
        lambda: node.count_subscribers("cmd_vel"),
        lambda: node.wait_for_node("x", 10),
    ):
        with pytest.raises(RCLError, match="failed to look at the graph: rclpy was shut down"):
            look()


String: Any = find("std_msgs/msg/String")

OF_ROS = {
    "add_on_set_parameters_callback",
    "add_post_set_parameters_callback",
    "add_pre_set_parameters_callback",
    "add_waitable",
    "clients",
    "context",
    "count_clients",
    "count_publishers",
    "count_services",
    "count_subscribers",
    "create_client",
    "create_guard_condition",
    "create_publisher",
    "create_rate",
    "create_service",
    "create_subscription",
    "create_timer",
    "declare_parameter",
    "declare_parameters",
    "default_callback_group",
    "describe_parameter",
    "describe_parameters",
    "destroy_client",
    "destroy_guard_condition",
    "destroy_node",
    "destroy_publisher",
    "destroy_rate",
    "destroy_service",
    "destroy_subscription",
    "destroy_timer",
    "executor",
    "get_client_names_and_types_by_node",
    "get_clients_info_by_service",
    "get_clock",
    "get_fully_qualified_name",
    "get_fully_qualified_node_names",
    "get_logger",
    "get_name",
    "get_namespace",
    "get_node_names",
    "get_node_names_and_namespaces",
    "get_node_names_and_namespaces_with_enclaves",
    "get_parameter",
    "get_parameter_or",
    "get_parameter_type",
    "get_parameter_types",
    "get_parameters",
    "get_parameters_by_prefix",
    "get_publisher_names_and_types_by_node",
    "get_publishers_info_by_topic",
    "get_servers_info_by_service",
    "get_service_names_and_types",
    "get_service_names_and_types_by_node",
    "get_subscriber_names_and_types_by_node",
    "get_subscriptions_info_by_topic",
    "get_topic_names_and_types",
    "guards",
    "handle",
    "has_parameter",
    "list_parameters",
    "publishers",
    "remove_on_set_parameters_callback",
    "remove_post_set_parameters_callback",
    "remove_pre_set_parameters_callback",
    "remove_waitable",
    "resolve_service_name",
    "resolve_topic_name",
    "services",
    "set_descriptor",
    "set_parameters",
    "set_parameters_atomically",
    "subscriptions",
    "timers",
    "undeclare_parameter",
    "wait_for_node",
    "waitables",
}
"""What ROS's Node has."""

MINE = [
    "bus",
    "entities",
    "close",
    "name",
    "namespace",
    "graph",
    "store",
    "arguments",
    "logger",
    "clock",
    "owned",
    "group",
    "fqn",
    "core",
    "leave",
    "own",
    "_graph",
    "_graph_lock",
    "_closed",
    "_closing",
    "_owned",
    "_own",
    "_disown",
    "_on",
    "_of",
    "_ends",
    "_store",
    "_executor",
    "_arguments",
    "_resolve",
    "_name",
    "_namespace",
    "_fqn",
    "_logger",
    "_clock",
    "_time_source",
    "_check_open",
    "_init_graph",
    "_init_parameters",
    "_context",
    "_bus",
    "_parameters",
]
"""Names that scripts take for themselves."""


def test_a_node_has_no_public_name_that_ros_does_not_have(ros: Wire) -> None:
    names = {name for name in dir(rclpy.create_node("tom")) if not name.startswith("__")}
    assert {name for name in names if name[0] != "_"} - OF_ROS == set()
    assert {name for name in names if name[0] == "_"} == {"_holozen"}
    assert set(catalog.NODE_HINTS) == OF_ROS - names


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
    jerry = rclpy.create_node("jerry")
    with rclpy.create_node("tom"):
        wait_for(lambda: jerry.get_node_names() == ["jerry", "tom"])
    wait_for(lambda: jerry.get_node_names() == ["jerry"])


class Early(Node):
    """A node that is used before it is one."""

    def __init__(self) -> None:
        self.get_logger()


def test_what_a_node_lacks_is_reported(ros: Wire) -> None:
    node: Any = Closes("tom")
    assert not hasattr(node, "nothing")
    with pytest.raises(
        AttributeError, match=r"^'Closes' object has no attribute 'nothing'; what Node has here: "
    ):
        _ = node.nothing
    with pytest.raises(
        AttributeError, match="has no attribute 'count_clients'; clients are not in the graph"
    ):
        node.count_clients("go")
    with pytest.raises(
        AttributeError, match=r"call super\(\).__init__\('name_of_the_node'\) in .* Early before"
    ):
        Early()
