"""What a node knows of the others: their names, topics and services, by the graph's liveliness tokens."""

import time
from typing import TYPE_CHECKING, Any

from holozen.graph import Endpoint
from holozen.ros import names
from holozen.ros.topic_endpoint_info import TopicEndpointInfo, TopicEndpointTypeEnum

if TYPE_CHECKING:
    from holozen.ros.node_core import Core

LOOK = 0.01  # s between two looks for a node

KINDS = {"pub": TopicEndpointTypeEnum.PUBLISHER, "sub": TopicEndpointTypeEnum.SUBSCRIPTION}
NamesAndTypes = list[tuple[str, list[str]]]


class NodeGraph:
    """Looks at the graph. What a stranger does that is none of our nodes is not seen."""

    _holozen: "Core"

    def count_publishers(self, topic_name: str) -> int:
        """How many publishers a topic has."""
        return len(self._holozen.graph.on(topic_name, "pub"))

    def count_subscribers(self, topic_name: str) -> int:
        """How many subscriptions a topic has."""
        return len(self._holozen.graph.on(topic_name, "sub"))

    def count_services(self, service_name: str) -> int:
        """How many nodes serve a name."""
        return len(self._holozen.graph.on(service_name, "srv"))

    def get_topic_names_and_types(self, no_demangle: bool = False) -> NamesAndTypes:
        """Every topic with its types."""
        return _typed(end for end in self._holozen.graph.ends() if end.kind in ("pub", "sub"))

    def get_service_names_and_types(self) -> NamesAndTypes:
        """Every service with its types."""
        return _typed(end for end in self._holozen.graph.ends() if end.kind == "srv")

    def get_publishers_info_by_topic(self, topic_name: str, no_mangle: bool = False) -> list[TopicEndpointInfo]:
        """The publishers of a topic."""
        return [_info(end) for end in self._holozen.graph.on(topic_name, "pub")]

    def get_subscriptions_info_by_topic(self, topic_name: str, no_mangle: bool = False) -> list[TopicEndpointInfo]:
        """The subscriptions of a topic."""
        return [_info(end) for end in self._holozen.graph.on(topic_name, "sub")]

    def get_publisher_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """What a node publishes."""
        return _typed(self._holozen.graph.of(node_name, node_namespace, "pub"))

    def get_subscriber_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """What a node subscribes to."""
        return _typed(self._holozen.graph.of(node_name, node_namespace, "sub"))

    def get_service_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """What a node serves."""
        return _typed(self._holozen.graph.of(node_name, node_namespace, "srv"))

    def get_node_names(self) -> list[str]:
        """The name of every node, without its namespace."""
        return [name for name, _ in self.get_node_names_and_namespaces()]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """(name, namespace) of every node."""
        return [_parted(end.node) for end in self._holozen.graph.ends() if end.kind == "node"]

    def get_fully_qualified_node_names(self) -> list[str]:
        """The absolute name of every node."""
        return [f"/{end.node}" for end in self._holozen.graph.ends() if end.kind == "node"]

    def wait_for_node(self, fully_qualified_node_name: str, timeout: float) -> bool:
        """Wait for a node, at most `timeout` seconds; whether it is there. Raises as `Client.wait_for_service`."""
        deadline = time.monotonic() + timeout
        wanted = names.expand(fully_qualified_node_name, self._holozen.name, self._holozen.namespace)
        while wanted not in self.get_fully_qualified_node_names():
            self._holozen.context.check_running(f"wait for {wanted}")
            if time.monotonic() > deadline:
                return False
            time.sleep(LOOK)
        return True


def _typed(ends: Any) -> NamesAndTypes:
    found: dict[str, set[str]] = {}
    for end in ends:
        found.setdefault(f"/{end.key}", set()).add(end.type)
    return [(name, sorted(types)) for name, types in sorted(found.items())]


def _info(end: Endpoint) -> TopicEndpointInfo:
    return TopicEndpointInfo(*_parted(end.node), end.type, end.session, KINDS[end.kind])


def _parted(node: str) -> tuple[str, str]:
    """The name and the namespace of a node as the graph names it."""
    namespace, _, name = node.rpartition("/")
    return name, f"/{namespace}"
