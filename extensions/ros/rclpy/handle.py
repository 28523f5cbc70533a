"""NodeHandle: what the publishers, subscriptions, services and clients of a node share with it."""

import threading
from collections.abc import Iterable

from holozen.bus import Bus
from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.rclpy import names
from holozen.ros.rclpy.arguments import Arguments
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.exceptions import InvalidHandle, NotInitializedException
from holozen.ros.rclpy.logging import get_logger
from holozen.suggest import article
from holozen.transport.actions import Found
from holozen.transport.graph import Endpoint, Graph, on_key

NamesAndTypes = list[tuple[str, list[str]]]


class NodeHandle:
    """The names, the bus session, the logger and the graph view of one node.

    Raises NotInitializedException before `rclpy.init()`.
    """

    def __init__(
        self, node_name: str, namespace: str, context: Context, arguments: Arguments
    ) -> None:
        if not context.ok():
            raise NotInitializedException(f"cannot create node {node_name!r}")
        self.context, self.arguments = context, arguments
        self.name = arguments.node_name(names.check_node_name(node_name))
        self.namespace = arguments.namespace(names.check_namespace(namespace), node_name)
        self.full_name = names.join(self.namespace, self.name)
        self.logger = get_logger(names.key(self.full_name).replace("/", "."))
        self.bus = Bus(names.key(self.full_name), context.connection, lasting=True)
        self.is_closed = False
        # keys of the command statuses that a publisher of this node reports from
        self.watched: set[str] = set()
        self._graph: Graph | None = None
        self._graph_lock = threading.Lock()

    def check_open(self) -> None:
        """Raises InvalidHandle if the node was destroyed."""
        if self.is_closed:
            raise InvalidHandle(f"node {self.full_name} was destroyed, or rclpy was shut down")

    def resolve(self, name: str, kind: str, only_expand: bool = False) -> str:
        """The absolute name of a "topic" or a "service", remapped unless `only_expand`."""
        full = names.expand(name, self.name, self.namespace, kind=kind)
        return (
            full
            if only_expand
            else self.arguments.remap(full, self.name, self.namespace, kind=kind)
        )

    def endpoints(self) -> list[Endpoint]:
        """Everything in the graph. The first call waits until the connected processes have
        announced theirs.

        Raises InvalidHandle if the node was destroyed, and what `Publisher.publish` raises after a
        shutdown.
        """
        self.context.check_can_publish("look at the graph")
        self.check_open()
        with self._graph_lock:
            if self._graph is None:
                self._graph = self.bus.graph()
                return self._graph.settled(self.bus.connected)
            return self._graph.endpoints()

    def endpoints_on(self, name: str, kind: str) -> list[Endpoint]:
        """The endpoints of a topic ("pub", "sub") or of a service ("srv")."""
        full = names.expand(
            name, self.name, self.namespace, kind="service" if kind == "srv" else "topic"
        )
        return on_key(self.endpoints(), names.key(full), kind)

    def endpoints_of(self, name: str, namespace: str, kind: str) -> list[Endpoint]:
        """The endpoints of one kind of a node."""
        full = names.key(names.join(namespace, name))
        return [end for end in self.endpoints() if end.kind == kind and end.node == full]


class Owned(HelpfulAttributes):
    """A publisher, subscription, client or service of a node."""

    _handle: NodeHandle

    @property
    def logger_name(self) -> str:
        """The name of its node's logger."""
        return self._handle.logger.name


def names_and_types(found: Iterable[Endpoint | Found]) -> NamesAndTypes:
    """The absolute names of endpoints or actions, each with its types."""
    types: dict[str, set[str]] = {}
    for one in found:
        types.setdefault(f"/{one.key}", set()).add(one.type)
    return [(name, sorted(types[name])) for name in sorted(types)]


def wrong_type(place: str, wanted: str, value: object) -> TypeError:
    """The error for a value that is no `wanted`, or for a class in the place of a value."""
    given = value.__name__ if isinstance(value, type) else type(value).__name__
    hint = f"; write {wanted}()" if isinstance(value, type) else ""
    return TypeError(f"{place}: expected {article(wanted)}, and got {article(given)}{hint}")
