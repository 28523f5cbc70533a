"""What a receiver knows of the sessions that command it."""

from __future__ import annotations

import time

from holozen.transport.beat import Beat
from holozen.transport.graph import Graph
from holozen.transport.samples import Echo


class LiveSenders:
    """The senders in the graph, and the receiver's own beat, which they echo."""

    def __init__(self, graph: Graph, beat: Beat) -> None:
        self._graph = graph
        self._beat = beat

    def has(self, session: str) -> bool:
        """Whether the session holds a liveliness token."""
        return self._graph.has(session)

    def echo(self, echoes: tuple[Echo, ...]) -> int | None:
        """This receiver's beat that is among the echoes, in ns of its own time; None if none of its
        beats is.
        """
        return self._beat.own.echoed(echoes)

    def age(self, beat: int, now: float) -> float:
        """The time in s from a beat of this receiver to `now` (s), which may be some time ago."""
        return self._beat.own.since(beat) - (time.monotonic() - now)

    def beat_now(self) -> None:
        """Send a beat after an event, so that commands can tell that they were sent after it."""
        self._beat.send()
