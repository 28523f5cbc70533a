"""Joins the wire with a ROS 2 graph on Zenoh: topics and services of each side appear on the other,
and messages are forwarded while something there reads them.

With rmw_zenoh both sides are one Zenoh network, and the gateway copies between its keys. Bridges
use keys like ours for other bytes, so they have a separate network, where the gateway has a second
session. Either way a sample takes one more hop. Nothing that it forwards returns to it, since its
readers take only what other sessions wrote; so there must be no second gateway.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import zenoh

from holozen.console import report
from holozen.ros.gateway import rmw_zenoh as rmw
from holozen.ros.gateway import ros2dds
from holozen.ros.gateway.descriptions import Descriptions
from holozen.ros.gateway.service_routes import ServiceRoutes
from holozen.ros.gateway.sides import NODE, NODES, Ends, Sides, quietly
from holozen.ros.gateway.topic_routes import TopicRoutes
from holozen.transport import graph as graphs
from holozen.transport.connection import Connection
from holozen.transport.meeting import new_id
from holozen.transport.session import close, configuration, one_line

if TYPE_CHECKING:
    from holozen.bus import Bus


def open_bridges(endpoints: Sequence[str], stamped: tuple[str, str]) -> Any:
    """A session that meets only bridges, which listen at `endpoints` now or later. Raises
    BusError.
    """
    alone = (("listen/endpoints", "[]"), ("id", json.dumps(new_id())), stamped)
    config = configuration(Connection(connect=tuple(endpoints), listen=(), cfg=alone))
    with one_line(f"--bridge {', '.join(endpoints)}"):
        return zenoh.open(config)


class Gateway:
    """Call `update` in a loop; it returns why the gateway has to end, or "". `close` withdraws
    everything.

    `there` is the session on ROS 2's side, `form` the form of keys and tokens there.
    """

    def __init__(self, bus: Bus, form: rmw.Form | ros2dds.Form, there: Any) -> None:
        self._ours = bus.graph()
        self._sides = Sides(bus, form, there)
        self._closed = threading.Event()
        self._topics = TopicRoutes(self._sides)
        self._services = ServiceRoutes(self._sides, self._closed)
        self._descriptions = Descriptions(self._sides, self._topics, self._ours)
        # A session for bridges alone that sees a node of ours is on our network.
        same = "" if there is bus.session else graphs.ALL
        self._same = same and there.liveliness().declare_subscriber(
            same, zenoh.handlers.RingChannel(1), history=True
        )
        self._held: dict[Any, Ends] = {}  # tokens, services and routes, and what ends each
        self._bridges: set[str] = set()  # those with a link

    def update(self) -> str:
        """Follow both graphs."""
        self._sides.poll()
        self._report_bridges()
        everything = self._ours.endpoints()
        if any(
            one.kind == "node" and one.node == NODE and one.session < self._sides.bus.id
            for one in everything
        ):
            return "another `holozen ros2` runs here; messages would loop between the two"
        if self._same and self._same.try_recv():
            return (
                "the bridge is on our own network, where messages would loop: give it a "
                "network of its own"
            )
        ours = [
            one
            for one in everything
            if one.session != self._sides.bus.id and not one.node.startswith(NODES)
        ]
        # Routes first: a subscriber asks a publisher of a latched topic for its message once, when
        # it sees it.
        wanted = {
            **self._topics.wanted(ours),
            **self._descriptions.wanted(ours),
            **self._announced(ours),
        }
        for gone in self._held.keys() - wanted.keys():
            for end in self._held.pop(gone):
                end()
        for new, begin in wanted.items():
            if new not in self._held:
                self._held[new] = begin()
        return ""

    def close(self) -> None:
        """Withdraw what was announced, and forward nothing more."""
        self._closed.set()
        for ends in self._held.values():
            for end in ends:
                end()
        self._held.clear()
        self._ours.close()
        self._sides.close()
        if self._same:
            quietly(self._same.undeclare)()
        if self._sides.there is not self._sides.bus.session:
            close(self._sides.there)

    def _report_bridges(self) -> None:
        if self._sides.there is self._sides.bus.session:
            return
        info = self._sides.there.info
        now = {str(one)[:6] for one in (*info.routers_zid(), *info.peers_zid())}
        for one in sorted(now ^ self._bridges):
            report(f"{NODE}: bridge {one} {'is there' if one in now else 'is gone'}")
        self._bridges = now

    def _announced(self, ours: list[graphs.Endpoint]) -> dict[Any, Callable[[], Ends]]:
        """What has to be announced on each side of the other, with a function that does so."""
        wanted: dict[Any, Callable[[], Ends]] = {}
        for one in ours:
            number, name = self._sides.named(one.node)
            if one.kind == "node":
                wanted[one] = partial(
                    self._services.show, self._sides.form.node_token(self._sides.id, number, name)
                )
            elif found := self._sides.exported(one):
                wanted[one] = partial(
                    self._services.show, self._sides.form.token(found, number), found
                )
        for theirs in self._sides.theirs.values():
            if theirs.kind != "srv":
                shown = graphs.Endpoint(
                    theirs.topic, theirs.kind, theirs.type, NODES + theirs.node, self._sides.bus.id
                )
                wanted[shown] = partial(
                    self._sides.hold, self._sides.bus.session, graphs.token(shown)
                )
            elif self._services.may_offer(theirs, ours):
                wanted["call", theirs.topic, theirs.type] = partial(self._services.offer, theirs)
        return wanted
