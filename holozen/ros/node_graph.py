"""What a node knows of the others: their names, topics and services, by the graph's liveliness tokens."""

import threading
import time
from typing import Any, NamedTuple

from holozen.bus import Bus
from holozen.graph import Endpoint, Graph, on_key
from holozen.ros import names

__all__ = ["NodeGraph", "TopicEndpointInfo"]

LOOK = 0.01  # s between two looks for a node

NamesAndTypes = list[tuple[str, list[str]]]


class TopicEndpointInfo(NamedTuple):
    """A publisher or a subscription of some node."""

    node_name: str
    node_namespace: str
    topic_type: str
    endpoint_gid: str


class NodeGraph:
    """Looks at the graph. What a stranger does that is none of our nodes is not seen.

    The first look waits until those who are connected have told theirs, the later ones for nothing.
    """

    bus: Bus
    _name: str
    _namespace: str

    def _init_graph(self) -> None:
        self._graph: Graph | None = None
        self._graph_lock = threading.Lock()

    def count_publishers(self, topic_name: str) -> int:
        """How many publishers a topic has."""
        return len(self._on(topic_name, "pub"))

    def count_subscribers(self, topic_name: str) -> int:
        """How many subscriptions a topic has."""
        return len(self._on(topic_name, "sub"))

    def count_services(self, service_name: str) -> int:
        """How many nodes serve a name."""
        return len(self._on(service_name, "srv"))

    def get_topic_names_and_types(self, no_demangle: bool = False) -> NamesAndTypes:
        """Every topic with its types."""
        return _typed(end for end in self._ends() if end.kind in ("pub", "sub"))

    def get_service_names_and_types(self) -> NamesAndTypes:
        """Every service with its types."""
        return _typed(end for end in self._ends() if end.kind == "srv")

    def get_publishers_info_by_topic(self, topic_name: str, no_mangle: bool = False) -> list[TopicEndpointInfo]:
        """The publishers of a topic."""
        return [_info(end) for end in self._on(topic_name, "pub")]

    def get_subscriptions_info_by_topic(self, topic_name: str, no_mangle: bool = False) -> list[TopicEndpointInfo]:
        """The subscriptions of a topic."""
        return [_info(end) for end in self._on(topic_name, "sub")]

    def get_publisher_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """What a node publishes."""
        return self._of(node_name, node_namespace, "pub")

    def get_subscriber_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """What a node subscribes to."""
        return self._of(node_name, node_namespace, "sub")

    def get_service_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """What a node serves."""
        return self._of(node_name, node_namespace, "srv")

    def get_node_names(self) -> list[str]:
        """The name of every node, without its namespace."""
        return [name for name, _ in self.get_node_names_and_namespaces()]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """(name, namespace) of every node."""
        return [_parted(end.node) for end in self._ends() if end.kind == "node"]

    def get_fully_qualified_node_names(self) -> list[str]:
        """The absolute name of every node."""
        return [f"/{end.node}" for end in self._ends() if end.kind == "node"]

    def wait_for_node(self, fully_qualified_node_name: str, timeout: float) -> bool:
        """Wait for a node, at most `timeout` seconds; whether it is there."""
        deadline = time.monotonic() + timeout
        wanted = names.expand(fully_qualified_node_name, self._name, self._namespace)
        while wanted not in self.get_fully_qualified_node_names():
            if time.monotonic() > deadline:
                return False
            time.sleep(LOOK)
        return True

    def _ends(self) -> list[Endpoint]:
        with self._graph_lock:
            if self._graph is None:
                self._graph = self.bus.graph()
                return self._graph.settled(self.bus.connected)
            return self._graph.endpoints()

    def _on(self, name: str, kind: str) -> list[Endpoint]:
        full = names.expand(name, self._name, self._namespace, kind="service" if kind == "srv" else "topic")
        return on_key(self._ends(), names.key(full), kind)

    def _of(self, name: str, namespace: str, kind: str) -> NamesAndTypes:
        full = names.key(names.join(namespace, name))
        return _typed(end for end in self._ends() if end.kind == kind and end.node == full)


def _typed(ends: Any) -> NamesAndTypes:
    found: dict[str, set[str]] = {}
    for end in ends:
        found.setdefault(f"/{end.key}", set()).add(end.type)
    return [(name, sorted(types)) for name, types in sorted(found.items())]


def _info(end: Endpoint) -> TopicEndpointInfo:
    return TopicEndpointInfo(*_parted(end.node), end.type, end.session)


def _parted(node: str) -> tuple[str, str]:
    """The name and the namespace of a node as the graph names it."""
    namespace, _, name = node.rpartition("/")
    return name, f"/{namespace}"
