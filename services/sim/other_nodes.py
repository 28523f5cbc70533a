"""The other nodes on the wire, and the other sims among them."""

import threading

from holozen.bus import Bus
from holozen.transport.graph import Endpoint, Graph, on_key


class OtherNodes:
    """What other nodes have on the keys of a sim."""

    def __init__(self, bus: Bus, graph: Graph) -> None:
        self.own_session = bus.id
        self.graph = graph

    def publish(self, key: str) -> bool:
        """Whether any of them publishes on a key. Nearly always there is none, and the graph of a
        fleet is large.
        """
        return any(session != self.own_session for session in self.graph.publishers(key))

    def on(self, key: str, kind: str) -> list[Endpoint]:
        """Their endpoints of a kind on a key."""
        found = on_key(self.graph.endpoints(), key, kind)
        return [end for end in found if end.session != self.own_session]


class Rivals:
    """Looks for other sims that serve the keys of the world: one that started in the same instant,
    or that did not discover this one. Of them all, the one with the lowest session id goes on.

    Attributes:
        winner: The source of the sim that goes on in place of this one; None while there is none.
    """

    def __init__(self, others: OtherNodes, stop: threading.Event) -> None:
        """`stop` is set once there is a winner."""
        self._others, self._stop = others, stop
        self._scanned: int | None = None  # the graph's count of changes at the last look
        self.winner: str | None = None

    def look(self) -> bool:
        """Look, if the graph has changed and another node publishes a clock. Returns that it
        answered no request.
        """
        there_is_a_clock = self._others.publish("clock")
        changes = self._others.graph.changes
        if there_is_a_clock and not self.winner and changes != self._scanned:
            rivals = self._others.on("spawn_entity", "srv")
            first = next((one for one in rivals if one.session < self._others.own_session), None)
            if first:
                self.winner = first.source
                self._stop.set()
        self._scanned = changes
        return False
