"""What a node sees of the graph: who writes, reads and serves what."""

import threading
from collections.abc import Callable

from holozen.bus import Bus
from holozen.graph import Endpoint, Graph, on_key
from holozen.ros import names


class GraphView:
    """Looks at the graph, with the names as a node says them.

    The first look waits until those who are connected have told theirs, the later ones for nothing. `check` raises
    where nobody may look any more.
    """

    def __init__(self, bus: Bus, name: str, namespace: str, check: Callable[[], None]) -> None:
        self._bus, self._name, self._namespace, self._check = bus, name, namespace, check
        self._graph: Graph | None = None
        self._lock = threading.Lock()

    def ends(self) -> list[Endpoint]:
        """All that is there by now."""
        self._check()
        with self._lock:
            if self._graph is None:
                self._graph = self._bus.graph()
                return self._graph.settled(self._bus.connected)
            return self._graph.endpoints()

    def on(self, name: str, kind: str) -> list[Endpoint]:
        """Who has a topic ("pub", "sub") or a service ("srv")."""
        full = names.expand(name, self._name, self._namespace, kind="service" if kind == "srv" else "topic")
        return on_key(self.ends(), names.key(full), kind)

    def of(self, name: str, namespace: str, kind: str) -> list[Endpoint]:
        """What a node has."""
        full = names.key(names.join(namespace, name))
        return [end for end in self.ends() if end.kind == kind and end.node == full]
