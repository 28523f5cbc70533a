"""The two sides that a gateway joins: our graph and that of ROS 2, and how an endpoint of one is
named on the other.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import zenoh

from holozen import wire
from holozen.console import report
from holozen.messages.definitions import Interface, InterfaceError
from holozen.messages.registry import Registry
from holozen.ros.gateway import rmw_zenoh as rmw
from holozen.ros.gateway import ros2dds
from holozen.transport import actions
from holozen.transport import graph as graphs
from holozen.transport.errors import BusError
from holozen.transport.samples import RawSubscriber, Sample

if TYPE_CHECKING:
    from holozen.bus import Bus

NODE = "ros2"
NODES = f"{NODE}/"  # before the names of ROS nodes on our side
DEPTH = 64  # samples that wait in a route; no command may be lost, since it may be a stop
# publishers of a topic whose ages are measured, requests that are answered at a time, and reports
MANY = 256
CALL = 5.0  # s for a service to answer
RESULT, STATUS = (actions.BELOW + part for part in (actions.RESULT, actions.STATUS))

Ends = list[Callable[[], object]]
"""What ends a token, a service or a route."""


class Sides:
    """Both sides, and the types that both know.

    bus: Our side.
    form: The form of keys and tokens on ROS 2's side.
    there: The session on that side, which may be that of the bus.
    id: That session's id.
    registry: The types.
    theirs: Token -> the endpoint of ROS 2 that it announces.
    writers: Session, topic and type of their publishers.
    """

    def __init__(self, bus: Bus, form: rmw.Form | ros2dds.Form, there: Any) -> None:
        self.bus = bus
        self.form = form
        self.there = there
        self.id = str(there.zid())
        self.registry = Registry()
        self.theirs: dict[str, rmw.Endpoint] = {}
        self.writers: set[tuple[str, str, str]] = set()
        tokens: Any = zenoh.handlers.RingChannel(4096)
        self._tokens = there.liveliness().declare_subscriber(form.tokens, tokens, history=True)
        self._numbers: dict[str, int] = {}  # of our nodes and endpoints, in the ROS graph
        self._types: dict[str, Interface | None] = {}
        self._reported: set[str] = set()

    def poll(self) -> None:
        """Read which endpoints of theirs came or went."""
        while (change := self._tokens.try_recv()) is not None:
            token = str(change.key_expr)
            self.theirs.pop(token, None)
            endpoint = self.form.parse(token)
            if change.kind == zenoh.SampleKind.PUT and endpoint and endpoint.session != self.id:
                self.theirs[token] = endpoint
        # Replaced as a whole, since the routes' threads read it.
        self.writers = {
            (one.session, one.topic, one.type) for one in self.theirs.values() if one.kind == "pub"
        }

    def close(self) -> None:
        """Follow their graph no longer."""
        quietly(self._tokens.undeclare)()

    def hold(self, session: Any, token: str) -> Ends:
        """Hold a token in one of the two sessions."""
        return [quietly(session.liveliness().declare_token(token).undeclare)]

    def exported(self, one: graphs.Endpoint) -> rmw.Endpoint | None:
        """One of our endpoints as the ROS graph has it; None if it cannot have it."""
        interface = self.interface(one.type) if wire.ROS_TOPIC.fullmatch(one.key) else None
        if not interface or (interface.kind == "srv") != (one.kind == "srv"):
            return None
        latched = one.kind == "pub" and (graphs.is_latched(one.key) or one.key.endswith(STATUS))
        number, name = (
            self._numbers.setdefault(f"{one}", len(self._numbers)),
            self.named(one.node)[1],
        )
        return rmw.Endpoint(
            one.kind,
            one.key,
            interface.name,
            self.form.hash(interface),
            name,
            self.id,
            number,
            latched,
        )

    def named(self, node: str) -> tuple[int, str]:
        """The number and the name of one of our nodes in the ROS graph."""
        name = (
            "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in node)
            or "_"
        )
        return self._numbers.setdefault(f"node {name}", len(self._numbers)), name

    def interface(self, name: str) -> Interface | None:
        """The definition of a type; None if it is known on neither side."""
        if name not in self._types:
            try:
                self._types[name] = self.registry.learn(name, self.bus.definition)
            except InterfaceError:
                self._types[name] = None
        return self._types[name]

    def is_known(self, theirs: rmw.Endpoint) -> bool:
        """Whether the type of an endpoint of theirs is known here, with the same definition."""
        interface = self.interface(theirs.type)
        return bool(interface and not self.form.mismatch(theirs, interface))

    def refuse(self, topic: str, why: str) -> bool:
        """Report once why a topic or service is not forwarded. Returns False."""
        self.report(f"/{topic} is not forwarded: {why}")
        return False

    def report(self, text: str) -> None:
        """Report it once."""
        if text not in self._reported and len(self._reported) < MANY:
            self._reported.add(text)
            report(f"{NODE}: {text}")

    def reader(
        self, session: Any, key: str, work: Callable[[Sample], None]
    ) -> Callable[[], object]:
        """Do `work` with each sample of other sessions on a key, in a thread."""
        subscriber = session.declare_subscriber(
            key, zenoh.handlers.RingChannel(DEPTH), allowed_origin=zenoh.Locality.REMOTE
        )
        raw = RawSubscriber(subscriber)
        threading.Thread(target=_each, args=(raw, work), daemon=True).start()
        return raw.close


def _each(raw: RawSubscriber, work: Callable[[Sample], None]) -> None:
    while True:
        try:
            work(raw.recv())
        except (BusError, zenoh.ZError):  # closed
            return


def quietly(end: Callable[[], object]) -> Callable[[], object]:
    """`end`, without the error of a session that is closed."""

    def quiet() -> None:
        with contextlib.suppress(zenoh.ZError):
            end()

    return quiet
