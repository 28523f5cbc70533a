"""Joins the wire with a ROS 2 graph on Zenoh (rmw_zenoh): what one side has appears on the other, and is carried there
while something there reads it.

Both sides are one Zenoh network: the gateway copies between its keys, so a sample takes one more hop. Nothing that it
carries comes back to it, as its readers take only what other sessions wrote. For that there must be no second gateway.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import zenoh

from holozen import wire
from holozen.console import report
from holozen.messages import CodecError, cdr, codec
from holozen.messages.definitions import Interface, InterfaceError
from holozen.messages.registry import Registry
from holozen.messages.type_hash import type_hash
from holozen.transport import graph as graphs
from holozen.transport import rmw_zenoh as rmw
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.samples import Answers, RawSubscriber, Sample, stamps
from holozen.transport.services import MAX_REQUEST_BYTES, RING, call_bytes, refuse

if TYPE_CHECKING:
    from holozen.bus import Bus

NODE = "ros2"
NODES = f"{NODE}/"  # before the names of ROS nodes on our side
DEPTH = 64  # samples that wait in a route; of commands all count, since one may be a stop
MANY = 256  # publishers of a topic whose ages are measured
CALL = 5.0  # s for a service to answer
SHARED = ("tf", "tf_static")  # topics with several publishers by nature

Route = tuple[str, str]  # topic and type
Ends = list[Callable[[], object]]


class Gateway:
    """Call `update` again and again; it returns why the gateway has to end, or "". `close` withdraws everything."""

    def __init__(self, bus: Bus, domain: int) -> None:
        self._bus, self._domain, self._registry = bus, domain, Registry()
        self._ours = bus.graph()
        live = bus.session.liveliness()
        tokens: Any = zenoh.handlers.RingChannel(4096)
        self._tokens = live.declare_subscriber(f"@ros2_lv/{domain}/**", tokens, history=True)
        self._theirs: dict[str, rmw.Endpoint] = {}  # by token
        self._numbers: dict[str, int] = {}  # of our nodes and endpoints, in the ROS graph
        self._held: dict[Any, Ends] = {}  # tokens, services and routes, and what ends each
        self._types: dict[str, Interface | None] = {}
        self._reported: set[str] = set()

    def update(self) -> str:
        """Follow both graphs."""
        while (change := self._tokens.try_recv()) is not None:
            token = str(change.key_expr)
            self._theirs.pop(token, None)
            endpoint = rmw.parse(token)
            if change.kind == zenoh.SampleKind.PUT and endpoint and endpoint.session != self._bus.id:
                self._theirs[token] = endpoint
        everything = self._ours.endpoints()
        if any(one.kind == "node" and one.node == NODE and one.session < self._bus.id for one in everything):
            return "another `holozen ros2` runs here; what both carry would go round and round"
        ours = [one for one in everything if one.session != self._bus.id and not one.node.startswith(NODES)]
        wanted = {**self._announced(ours), **self._routes(ours)}
        for gone in self._held.keys() - wanted.keys():
            for end in self._held.pop(gone):
                end()
        for new in wanted.keys() - self._held.keys():
            self._held[new] = wanted[new]()
        return ""

    def close(self) -> None:
        """Withdraw what was announced, and carry nothing more."""
        for ends in self._held.values():
            for end in ends:
                end()
        self._held.clear()

    def _announced(self, ours: list[graphs.Endpoint]) -> dict[Any, Callable[[], Ends]]:
        """What each side has to be shown of the other, with a function that shows it."""
        wanted: dict[Any, Callable[[], Ends]] = {}
        for one in ours:
            number, name = self._named(one.node)
            if one.kind == "node":
                wanted[one] = partial(self._show, rmw.node_token(self._domain, self._bus.id, number, name))
            elif found := self._exported(one):
                wanted[one] = partial(
                    self._show, found.token(self._domain, number), found if one.kind == "srv" else None
                )
        for theirs in self._theirs.values():
            shown = graphs.Endpoint(theirs.topic, theirs.kind, theirs.type, NODES + theirs.node, self._bus.id)
            if theirs.kind != "srv":  # a call of theirs is not carried
                wanted[shown] = partial(self._show, graphs.token(shown))
        return wanted

    def _show(self, token: str, service: rmw.Endpoint | None = None) -> Ends:
        shown = _quietly(self._bus.session.liveliness().declare_token(token).undeclare)
        return [shown, self._serve(service)] if service else [shown]

    def _routes(self, ours: list[graphs.Endpoint]) -> dict[Any, Callable[[], Ends]]:
        """What has to be carried, with a function that begins it."""
        wanted: dict[Any, Callable[[], Ends]] = {}
        read = {(one.topic, one.type, one.hash) for one in self._theirs.values() if one.kind == "sub"}
        for one in ours:
            found = self._exported(one) if one.kind == "pub" else None
            if found and (found.latched or (found.topic, found.type, found.hash) in read):
                wanted["out", found.topic, found.type] = partial(self._carry_out, found)
        for theirs in self._theirs.values():
            if theirs.kind == "pub" and graphs.on_key(ours, theirs.topic, "sub") and self._may_enter(theirs, ours):
                wanted["in", theirs.topic, theirs.type] = partial(self._carry_in, theirs)
        return wanted

    def _exported(self, one: graphs.Endpoint) -> rmw.Endpoint | None:
        """How one of our endpoints stands in the ROS graph; None if it cannot."""
        interface = self._interface(one.type) if rmw.TOPIC.fullmatch(one.key) else None
        if not interface or (interface.kind == "srv") != (one.kind == "srv"):
            return None
        latched = one.kind == "pub" and one.key.rpartition("/")[2] in wire.LATCHED
        number, name = self._numbers.setdefault(f"{one}", len(self._numbers)), self._named(one.node)[1]
        return rmw.Endpoint(
            one.kind, one.key, interface.name, type_hash(interface), name, self._bus.id, number, latched
        )

    def _named(self, node: str) -> tuple[int, str]:
        """The number and the name of one of our nodes in the ROS graph."""
        name = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in node) or "_"
        return self._numbers.setdefault(f"node {name}", len(self._numbers)), name

    def _interface(self, name: str) -> Interface | None:
        if name not in self._types:
            try:
                self._types[name] = self._registry.learn(name, self._bus.definition)
            except InterfaceError:
                self._types[name] = None
        return self._types[name]

    def _may_enter(self, theirs: rmw.Endpoint, ours: list[graphs.Endpoint]) -> bool:
        """Whether samples of theirs may be read on our side: of a robot's own reports there is one publisher."""
        interface = self._interface(theirs.type)
        if not interface:
            return self._refuse(theirs.topic, f"its type {theirs.type} is not known here")
        if type_hash(interface) != theirs.hash:
            return self._refuse(theirs.topic, f"its {theirs.type} is not the one known here")
        row = wire.topic(theirs.topic)
        writers = graphs.on_key(ours, theirs.topic, "pub")
        if row and not row.is_command and row.key not in SHARED and writers:
            return self._refuse(theirs.topic, f"{writers[0].node} publishes {theirs.topic} here")
        return True

    def _refuse(self, topic: str, why: str) -> bool:
        """Report once why something of a topic is not carried. Returns False."""
        text = f"/{topic} is not carried: {why}"
        if text not in self._reported and len(self._reported) < MANY:
            self._reported.add(text)
            report(f"{NODE}: {text}")
        return False

    def _reader(self, key: str, work: Callable[[Sample], None]) -> Callable[[], object]:
        """Do `work` with each sample of other sessions on a key, in a thread."""
        subscriber = self._bus.session.declare_subscriber(
            key, zenoh.handlers.RingChannel(DEPTH), allowed_origin=zenoh.Locality.REMOTE
        )
        raw = RawSubscriber(subscriber)
        threading.Thread(target=_each, args=(raw, work), daemon=True).start()
        return raw.close

    def _carry_out(self, found: rmw.Endpoint) -> Ends:
        """Our samples, in CDR, to ROS 2."""
        session, interface = self._bus.session, self._registry.find(found.type)
        key, gid, number = found.key(self._domain), rmw.gid(found.token(self._domain, 0)), 0
        if found.latched:
            from zenoh.ext import CacheConfig, declare_advanced_publisher

            cache = CacheConfig(max_samples=1)
            publisher: Any = declare_advanced_publisher(session, key, cache=cache, publisher_detection=True)
        else:
            publisher = session.declare_publisher(key)

        def put(sample: Sample) -> None:
            nonlocal number
            try:
                payload = codec.transcoded(interface, sample.payload, sample.encoding)
            except (CodecError, InterfaceError) as error:
                self._refuse(found.topic, str(error))
                return
            number += 1
            publisher.put(
                payload, encoding="application/cdr", attachment=rmw.Attachment(number, time.time_ns(), gid).packed()
            )

        ends = [self._reader(found.topic, put), _quietly(publisher.undeclare)]
        for sample in self._bus.ask(found.topic, 0.5) if found.latched else ():
            if isinstance(sample, Sample):
                put(sample)
        return ends

    def _carry_in(self, theirs: rmw.Endpoint) -> Ends:
        """Samples of ROS 2 to our side, with a stamp of this session and the priority of plain data.

        A command that waited in a buffer on its way here is left out: our stamp would make it new.
        """
        key, encoding = theirs.topic, f"application/cdr;{theirs.type}"
        is_command = _moves(theirs.type, key)
        publisher = self._bus.session.declare_publisher(key, encoding=encoding, express=is_command)
        ages: dict[bytes, tuple[rmw.Ages, Callable[[], bytes]]] = {}
        _ = self._bus.stamp  # from now on this session answers for its clock

        def put(sample: Sample) -> None:
            stamp = rmw.attachment(sample.attachment)
            if stamp is None:
                self._refuse(key, "a sample came without the attachment of rmw_zenoh")
                return
            if stamp.gid not in ages:
                if len(ages) == MANY:
                    ages.clear()
                ages[stamp.gid] = (rmw.Ages(), stamps(self._source(theirs, stamp.gid), self._bus.id))
            measured, stamped = ages[stamp.gid]
            if is_command and measured.of(stamp, time.monotonic()) > wire.COMMAND_SILENCE:
                self._refuse(key, f"a command was under way for more than {wire.COMMAND_SILENCE:g} s")
                return
            publisher.put(sample.payload, attachment=stamped())

        return [self._reader(theirs.key(self._domain), put), _quietly(publisher.undeclare)]

    def _source(self, theirs: rmw.Endpoint, gid: bytes) -> str:
        """What a publisher is called on our side: its node, where that is the only one on the topic."""
        nodes = {one.node for one in self._theirs.copy().values() if one.kind == "pub" and one.topic == theirs.topic}
        return NODES + (nodes.pop() if len(nodes) == 1 else gid[:4].hex())

    def _serve(self, found: rmw.Endpoint) -> Callable[[], object]:
        """Answer ROS 2's calls of one of our services."""
        key = found.key(self._domain)
        queryable = self._bus.session.declare_queryable(key, zenoh.handlers.RingChannel(RING), complete=True)

        def answer(query: Any) -> None:
            try:
                self._answer(query, found, key)
            except (ServiceError, CodecError, InterfaceError) as error:
                refuse(query, str(error))
            except BusError:  # the bus is closed, and with it the queryable
                pass

        return _quietly(Answers(queryable, answer).close)

    def _answer(self, query: Any, found: rmw.Endpoint, key: str) -> None:
        interface = self._registry.find(found.type)
        assert interface.request
        assert interface.response
        stamp = rmw.attachment(bytes(query.attachment or b""))
        if stamp is None or query.payload is None or len(query.payload) > MAX_REQUEST_BYTES:
            raise ServiceError("a request of rmw_zenoh has a payload and an attachment of 33 bytes")
        request = f"application/cdr;{interface.request.name}"
        try:
            (reply,) = call_bytes(self._bus, found.topic, bytes(query.payload), request, CALL)
            payload = codec.transcoded(interface.response, reply.payload, reply.encoding)
        except ServiceError as error:
            names = {field.name for field in interface.response.fields}
            if not names >= {"success", "message"}:
                raise
            # A client of ROS 2 takes no notice of an error reply, and would wait for ever.
            payload = cdr.write(interface.response, {"success": False, "message": str(error)})
        answered = stamp._replace(sent=time.time_ns()).packed()
        query.reply(key, payload, encoding="application/cdr", attachment=answered)


def _moves(type_name: str, key: str) -> bool:
    row = wire.topic(key)
    moving = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Wrench")
    return bool(row and row.is_command) or type_name in moving


def _each(raw: RawSubscriber, work: Callable[[Sample], None]) -> None:
    while True:
        try:
            work(raw.recv())
        except (BusError, zenoh.ZError):  # closed
            return


def _quietly(end: Callable[[], object]) -> Callable[[], object]:
    """`end`, without the error of a session that is closed."""

    def quiet() -> None:
        with contextlib.suppress(zenoh.ZError):
            end()

    return quiet
