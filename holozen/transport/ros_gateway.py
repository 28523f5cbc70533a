"""Joins the wire with a ROS 2 graph on Zenoh: topics and services of each side appear on the other, and messages are
forwarded while something there reads them.

With rmw_zenoh both sides are one Zenoh network, and the gateway copies between its keys. Bridges use keys like ours for
other bytes, so they have a separate network, where the gateway has a second session. Either way a sample takes one more
hop. Nothing that it forwards returns to it, since its readers take only what other sessions wrote; so there must be no
second gateway.
"""

from __future__ import annotations

import contextlib
import json
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from typing import TYPE_CHECKING, Any

import zenoh

from holozen import wire
from holozen.console import report
from holozen.messages import (
    CodecError,
    GetSceneReply,
    GetSceneRequest,
    RobotDescriptionReply,
    RobotDescriptionRequest,
    SceneEntity,
    cdr,
    codec,
)
from holozen.messages.definitions import Interface, InterfaceError
from holozen.messages.registry import Registry
from holozen.transport import actions, ros2dds
from holozen.transport import graph as graphs
from holozen.transport import rmw_zenoh as rmw
from holozen.transport.connection import Connection
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.samples import Answers, RawSubscriber, Sample, stamps
from holozen.transport.services import MAX_REQUEST_BYTES, RING, call_bytes, frees, refuse
from holozen.transport.session import close, configuration, new_id, one_line

if TYPE_CHECKING:
    from holozen.bus import Bus

NODE = "ros2"
NODES = f"{NODE}/"  # before the names of ROS nodes on our side
DEPTH = 64  # samples that wait in a route; no command may be lost, since it may be a stop
MANY = 256  # publishers of a topic whose ages are measured
CALL = 5.0  # s for a service to answer
UNDER_WAY = f"a command was under way for more than {wire.COMMAND_SILENCE:g} s"
UNKNOWN_AGE = (
    f"a first command has a time of sending more than {wire.COMMAND_SILENCE:g} s from this machine's clock; it is late,"
    f" or the clocks differ: set them, or go on publishing, and after {rmw.PACE:g} s commands are forwarded"
)
LATE = (
    f"it was sent more than {wire.COMMAND_SILENCE:g} s from this machine's clock: it is late, and has to be sent again,"
    " or the clocks differ: set them, or use `holozen release`, `controller --resume`, `sim play` or `action send_goal`"
)
FAILED = 4  # OPERATION_FAILED of simulation_interfaces/msg/Result
SHARED = ("tf", "tf_static")  # topics with several publishers by nature
DESCRIPTION, STRING = "robot_description", "std_msgs/msg/String"

RESULT, STATUS = (actions.BELOW + part for part in (actions.RESULT, actions.STATUS))

Ends = list[Callable[[], object]]


def open_bridges(endpoints: Sequence[str], stamped: tuple[str, str]) -> Any:
    """A session that meets only bridges, which listen at `endpoints` now or later. Raises BusError."""
    alone = (("listen/endpoints", "[]"), ("id", json.dumps(new_id([], ()))), stamped)
    config = configuration(Connection(connect=tuple(endpoints), listen=(), cfg=alone))
    with one_line(f"--bridge {', '.join(endpoints)}"):
        return zenoh.open(config)


class Gateway:
    """Call `update` in a loop; it returns why the gateway has to end, or "". `close` withdraws everything.

    `there` is the session on ROS 2's side, `form` the form of keys and tokens there.
    """

    def __init__(self, bus: Bus, form: rmw.Form | ros2dds.Form, there: Any) -> None:
        self._bus, self._form, self._there, self._registry = bus, form, there, Registry()
        self._ours, self._id = bus.graph(), str(there.zid())
        tokens: Any = zenoh.handlers.RingChannel(4096)
        self._tokens = there.liveliness().declare_subscriber(form.tokens, tokens, history=True)
        self._theirs: dict[str, rmw.Endpoint] = {}  # by token
        # A session for bridges alone that sees a node of ours is on our network.
        same = "" if there is bus.session else graphs.ALL
        self._same = same and there.liveliness().declare_subscriber(same, zenoh.handlers.RingChannel(1), history=True)
        self._writers: set[tuple[str, str, str]] = set()  # session, topic and type of their publishers
        self._numbers: dict[str, int] = {}  # of our nodes and endpoints, in the ROS graph
        self._held: dict[Any, Ends] = {}  # tokens, services and routes, and what ends each
        self._types: dict[str, Interface | None] = {}
        self._reported: set[str] = set()
        self._closed = threading.Event()
        self._bridges: set[str] = set()  # those with a link
        self._robots: list[SceneEntity] = []  # of sims
        self._changes = -1  # of our graph, when the sims were asked for them

    def update(self) -> str:
        """Follow both graphs."""
        while (change := self._tokens.try_recv()) is not None:
            token = str(change.key_expr)
            self._theirs.pop(token, None)
            endpoint = self._form.parse(token)
            if change.kind == zenoh.SampleKind.PUT and endpoint and endpoint.session != self._id:
                self._theirs[token] = endpoint
        # Replaced as a whole, since the routes' threads read it.
        self._writers = {(one.session, one.topic, one.type) for one in self._theirs.values() if one.kind == "pub"}
        self._report_bridges()
        everything = self._ours.endpoints()
        if any(one.kind == "node" and one.node == NODE and one.session < self._bus.id for one in everything):
            return "another `holozen ros2` runs here; messages would loop between the two"
        if self._same and self._same.try_recv():
            return "the bridge is on our own network, where messages would loop: give it a network of its own"
        ours = [one for one in everything if one.session != self._bus.id and not one.node.startswith(NODES)]
        # Routes first: a subscriber asks a publisher of a latched topic for its message once, when it sees it.
        wanted = {**self._routes(ours), **self._descriptions(ours), **self._announced(ours)}
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
        for watched in (self._tokens, self._same):
            if watched:
                _quietly(watched.undeclare)()
        if self._there is not self._bus.session:
            close(self._there)

    def _report_bridges(self) -> None:
        if self._there is self._bus.session:
            return
        info = self._there.info
        now = {str(one)[:6] for one in (*info.routers_zid(), *info.peers_zid())}
        for one in sorted(now ^ self._bridges):
            report(f"{NODE}: bridge {one} {'is there' if one in now else 'is gone'}")
        self._bridges = now

    def _announced(self, ours: list[graphs.Endpoint]) -> dict[Any, Callable[[], Ends]]:
        """What has to be announced on each side of the other, with a function that does so."""
        wanted: dict[Any, Callable[[], Ends]] = {}
        for one in ours:
            number, name = self._named(one.node)
            if one.kind == "node":
                wanted[one] = partial(self._show, self._form.node_token(self._id, number, name))
            elif found := self._exported(one):
                wanted[one] = partial(self._show, self._form.token(found, number), found)
        for theirs in self._theirs.values():
            if theirs.kind != "srv":
                shown = graphs.Endpoint(theirs.topic, theirs.kind, theirs.type, NODES + theirs.node, self._bus.id)
                wanted[shown] = partial(self._hold, self._bus.session, graphs.token(shown))
            elif self._may_offer(theirs, ours):
                wanted["call", theirs.topic, theirs.type] = partial(self._offer, theirs)
        return wanted

    def _hold(self, session: Any, token: str) -> Ends:
        return [_quietly(session.liveliness().declare_token(token).undeclare)]

    def _show(self, token: str, found: rmw.Endpoint | None = None) -> Ends:
        """Show a node or an endpoint of ours to ROS 2, and answer the calls of a service."""
        ends: Ends = []
        if found and found.kind == "sub" and not self._form.shows_readers:
            reader = self._there.declare_subscriber(self._form.key(found), zenoh.handlers.RingChannel(1))
            ends.append(_quietly(reader.undeclare))
        if found and found.kind == "srv":
            answers = ConcurrentAnswers if found.topic.endswith(RESULT) else Answers
            ends.append(self._answers(self._there, self._form.key(found), partial(self._answer, found), answers))
        # Last, so that whoever sees it can call it at once.
        return [*ends, *(self._hold(self._there, token) if token else ())]

    def _routes(self, ours: list[graphs.Endpoint]) -> dict[Any, Callable[[], Ends]]:
        """What has to be forwarded, with a function that begins it."""
        wanted: dict[Any, Callable[[], Ends]] = {}
        read = {(one.topic, one.type) for one in self._theirs.values() if one.kind == "sub" and self._is_known(one)}
        writers: dict[str, list[str]] = {}
        for one in ours:
            if one.kind == "pub":
                writers.setdefault(one.key, []).append(one.session)
        for one in ours:
            found = self._exported(one) if one.kind == "pub" else None
            if found and (found.latched or (found.topic, found.type) in read):
                # A latched message may have been put before this session knew its publisher: each new one is asked.
                asked = tuple(writers[found.topic]) if found.latched else ()
                wanted["out", found.topic, found.type, asked] = partial(self._carry_out, found)
        for theirs in self._theirs.values():
            if theirs.kind == "pub" and graphs.on_key(ours, theirs.topic, "sub") and self._may_enter(theirs, ours):
                wanted["in", theirs.topic, theirs.type] = partial(self._carry_in, theirs)
        return wanted

    def _descriptions(self, ours: list[graphs.Endpoint]) -> dict[Any, Callable[[], Ends]]:
        """The robots whose description ROS 2 is shown, as by a robot_state_publisher, with a function that shows it.

        On our side the key is a service of the sim. A node that publishes the topic, on either side, takes precedence.
        """
        if self._changes != self._ours.changes:
            self._changes = self._ours.changes
            try:
                self._robots = self._robots_of_sims() if graphs.on_key(ours, "get_scene", "srv") else []
            except BusError:  # it may have left; until the next update, its robots are those of before
                self._changes = -1
        taken = {one.key for one in ours if one.kind == "pub"} | {
            one.topic for one in self._theirs.values() if one.kind == "pub"
        }
        return {
            (topic, robot.number): partial(self._describe, topic, robot)
            for robot in self._robots
            if (topic := f"{robot.odometry.rpartition('/')[0]}/{DESCRIPTION}".lstrip("/")) not in taken
        }

    def _robots_of_sims(self) -> list[SceneEntity]:
        scenes = self._bus.call_all("get_scene", GetSceneRequest(), GetSceneReply, CALL)
        return [one for scene in scenes for one in scene.entities if one.odometry]

    def _describe(self, topic: str, robot: SceneEntity) -> Ends:
        """Publish a robot's URDF on ROS 2's side."""
        found = self._exported(graphs.Endpoint(topic, "pub", STRING, NODE, self._bus.id))
        if not found:
            return []
        try:
            request = RobotDescriptionRequest(robot.name)
            replies = self._bus.call_all(DESCRIPTION, request, RobotDescriptionReply, CALL)
        except BusError as error:
            self._refuse(topic, str(error))
            return []
        text = next((reply.description for reply in replies if reply.number == robot.number), "")
        if not text:  # it has left
            return []
        publisher, put = self._publisher(found)
        put(cdr.write(self._registry.find(STRING), {"data": text}))
        shown = self._hold(self._there, self._form.token(found, self._named(NODE)[0]))
        return [*shown, _quietly(publisher.undeclare)]

    def _exported(self, one: graphs.Endpoint) -> rmw.Endpoint | None:
        """One of our endpoints as the ROS graph has it; None if it cannot have it."""
        interface = self._interface(one.type) if rmw.TOPIC.fullmatch(one.key) else None
        if not interface or (interface.kind == "srv") != (one.kind == "srv"):
            return None
        latched = one.kind == "pub" and (graphs.is_latched(one.key) or one.key.endswith(STATUS))
        number, name = self._numbers.setdefault(f"{one}", len(self._numbers)), self._named(one.node)[1]
        return rmw.Endpoint(
            one.kind, one.key, interface.name, self._form.hash(interface), name, self._id, number, latched
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
        """Whether samples of theirs may be forwarded to our side. What a robot reports has one publisher."""
        interface = self._interface(theirs.type)
        if not interface:
            return self._refuse(theirs.topic, f"its type {theirs.type} is not known here")
        if why := self._form.mismatch(theirs, interface):
            return self._refuse(theirs.topic, why)
        row = wire.topic(theirs.topic)
        writers = graphs.on_key(ours, theirs.topic, "pub")
        if row and not row.is_command and row.key not in SHARED and writers:
            return self._refuse(theirs.topic, f"{writers[0].node} publishes {theirs.topic} here")
        return True

    def _may_offer(self, theirs: rmw.Endpoint, ours: list[graphs.Endpoint]) -> bool:
        """Whether a service of theirs may be called from our side. Most of each node's have types not known here. Those
        of an action are left out: a result takes longer than CALL.
        """
        interface = self._interface(theirs.type)
        if not interface or interface.kind != "srv" or actions.BELOW in theirs.topic:
            return False
        if why := self._form.mismatch(theirs, interface):
            return self._refuse(theirs.topic, why)
        if servers := graphs.on_key(ours, theirs.topic, "srv"):
            return self._refuse(theirs.topic, f"{servers[0].node} serves {theirs.topic} here")
        return True

    def _is_known(self, theirs: rmw.Endpoint) -> bool:
        interface = self._interface(theirs.type)
        return bool(interface and not self._form.mismatch(theirs, interface))

    def _refuse(self, topic: str, why: str) -> bool:
        """Report once why a topic or service is not forwarded. Returns False."""
        self._report(f"/{topic} is not forwarded: {why}")
        return False

    def _report(self, text: str) -> None:
        """Report it once."""
        if text not in self._reported and len(self._reported) < MANY:
            self._reported.add(text)
            report(f"{NODE}: {text}")

    def _reader(self, session: Any, key: str, work: Callable[[Sample], None]) -> Callable[[], object]:
        """Do `work` with each sample of other sessions on a key, in a thread."""
        subscriber = session.declare_subscriber(
            key, zenoh.handlers.RingChannel(DEPTH), allowed_origin=zenoh.Locality.REMOTE
        )
        raw = RawSubscriber(subscriber)
        threading.Thread(target=_each, args=(raw, work), daemon=True).start()
        return raw.close

    def _carry_out(self, found: rmw.Endpoint) -> Ends:
        """Our samples, in CDR, to ROS 2."""
        interface = self._registry.find(found.type)
        publisher, put_bytes = self._publisher(found)

        def put(sample: Sample) -> None:
            try:
                payload = codec.transcoded(interface, sample.payload, sample.encoding)
            except (CodecError, InterfaceError) as error:
                self._refuse(found.topic, str(error))
                return
            put_bytes(payload)

        ends = [self._reader(self._bus.session, found.topic, put), _quietly(publisher.undeclare)]
        # All of them: alone, a service of the same name, such as the sim's robot_description, would be asked.
        for sample in self._bus.ask_all(found.topic, 0.5) if found.latched else ():
            if isinstance(sample, Sample):
                put(sample)
        return ends

    def _publisher(self, found: rmw.Endpoint) -> tuple[Any, Callable[[bytes], None]]:
        """A publisher on ROS 2's side, and a function that puts bytes of CDR with it."""
        session, numbers = self._there, count(1)
        key, gid = self._form.key(found), rmw.gid(self._form.token(found, 0))
        if found.latched:
            from zenoh.ext import CacheConfig, declare_advanced_publisher

            cache = CacheConfig(max_samples=1)
            publisher: Any = declare_advanced_publisher(session, key, cache=cache, publisher_detection=True)
        else:
            publisher = session.declare_publisher(key)

        def put(payload: bytes) -> None:
            attachment = self._form.attachment(next(numbers), gid)
            publisher.put(payload, encoding="application/cdr", attachment=attachment)

        return publisher, put

    def _carry_in(self, theirs: rmw.Endpoint) -> Ends:
        """Samples of ROS 2 to our side, with a stamp of this session and the priority of plain data.

        A command that waited in a buffer on its way here is dropped: our stamp would make it look new.
        """
        key, encoding = theirs.topic, f"application/cdr;{theirs.type}"
        is_command = wire.is_command(key, (theirs.type,))
        publisher = self._bus.session.declare_publisher(key, encoding=encoding, express=is_command)
        ages: dict[bytes, tuple[rmw.Ages, Callable[[], bytes]]] = {}
        _ = self._bus.clock_server  # from now on this session answers for its clock

        def put(sample: Sample) -> None:
            stamp = self._form.stamp(sample)
            if stamp is None:
                self._refuse(key, "a sample does not state when it was sent, as all of ROS 2 do")
                return
            writer = self._form.writer(stamp)
            if writer and (writer, key, theirs.type) not in self._writers:
                self._refuse(key, f"a sample came from {writer[:6]}, which announces no publisher of {theirs.type}")
                return
            if stamp.gid not in ages:
                if len(ages) == MANY:
                    ages.clear()
                ages[stamp.gid] = (rmw.Ages(), stamps(self._source(theirs, stamp.gid), self._bus.id, count()))
            measured, stamped = ages[stamp.gid]
            age = measured.of(stamp, time.monotonic(), time.time()) if is_command else 0.0
            if age > wire.COMMAND_SILENCE and not self._stops(theirs.type, sample.payload):
                self._refuse(key, UNDER_WAY if measured.kept_pace else UNKNOWN_AGE)
                return
            publisher.put(sample.payload, attachment=stamped())

        return [self._reader(self._there, self._form.key(theirs), put), _quietly(publisher.undeclare)]

    def _stops(self, type_name: str, payload: bytes) -> bool:
        """Whether a command is a velocity of zero, which is forwarded at any age."""
        if type_name not in wire.VELOCITIES:
            return False
        try:
            value = cdr.read(self._registry.find(type_name), payload)
        except CodecError:
            return False
        twist = value.get("twist", value)
        return not any(number for part in ("linear", "angular") for number in twist[part].values())

    def _source(self, theirs: rmw.Endpoint, gid: bytes) -> str:
        """The name of a publisher on our side: that of its node, if no other publishes the topic."""
        nodes = {one.node for one in self._theirs.copy().values() if one.kind == "pub" and one.topic == theirs.topic}
        return NODES + (nodes.pop() if len(nodes) == 1 else gid[:4].hex())

    def _answers(
        self, session: Any, key: str, reply: Callable[[Any], None], answers: type[Answers] = Answers
    ) -> Callable[[], object]:
        """Answer the queries on a key with `reply`, in a thread; where it raises an error, with that."""
        queryable = session.declare_queryable(key, zenoh.handlers.RingChannel(RING), complete=True)

        def answer(query: Any) -> None:
            try:
                if len(query.payload or b"") > MAX_REQUEST_BYTES:
                    raise ServiceError(f"a request of {len(query.payload)} bytes; at most {MAX_REQUEST_BYTES}")
                reply(query)
            except (ServiceError, CodecError, InterfaceError) as error:
                refuse(query, str(error))
            except (BusError, zenoh.ZError):  # the session is closed, and with it the queryable
                pass

        return _quietly(answers(queryable, answer).close)

    def _answer(self, found: rmw.Endpoint, query: Any) -> None:
        """Answer ROS 2's call of one of our services."""
        interface = self._registry.find(found.type)
        assert interface.request
        assert interface.response
        asked = bytes(query.attachment or b"")
        attachment, stamp = self._form.answered(asked), rmw.attachment(asked)  # bridges to DDS send none
        request = f"application/cdr;{interface.request.name}"
        try:
            is_late = stamp and abs(time.time() - stamp.sent / 1e9) > wire.COMMAND_SILENCE
            payload = bytes(query.payload or b"")
            if is_late and frees(found.topic, payload, request):
                raise ServiceError(LATE)
            reply = self._replied(found.topic, payload, request)
            payload = codec.transcoded(interface.response, reply.payload, reply.encoding)
        except ServiceError as error:
            # A client of ROS 2 ignores an error reply, and would wait for ever.
            fields = _refused(interface.response, error)
            if fields is None:
                self._report(f"/{found.topic}: a caller waits, as {found.type} has no place for an error: {error}")
                raise
            if "accepted" in fields:  # there is no place for the reason
                self._report(f"/{found.topic}: {error}")
            payload = cdr.write(interface.response, fields)
        query.reply(self._form.key(found), payload, encoding="application/cdr", attachment=attachment)

    def _replied(self, key: str, payload: bytes, encoding: str) -> Sample:
        """The reply of a service of ours. The result of an action comes when the goal has ended."""
        if not key.endswith(RESULT):
            return call_bytes(self._bus, key, payload, encoding, CALL)[0]
        found = actions.wait_for_result(self._bus, key.removesuffix(RESULT), payload, encoding, self._closed.is_set)
        if found is None:
            raise ServiceError("`holozen ros2` ends")
        return found

    def _offer(self, theirs: rmw.Endpoint) -> Ends:
        """Let a service of ROS 2 be called on our side."""
        interface, numbers, key = self._registry.find(theirs.type), count(1), self._form.key(theirs)
        assert interface.request
        assert interface.response
        asked, answered = interface.request, interface.response
        gid = rmw.gid(self._form.token(theirs._replace(session=self._id), 0))

        def answer(query: Any) -> None:
            payload = codec.transcoded(asked, bytes(query.payload or b"{}"), str(query.encoding or ""))
            attachment = self._form.attachment(next(numbers), gid)
            for reply in self._there.get(
                key, payload=payload, encoding="application/cdr", attachment=attachment, timeout=CALL
            ):
                if not reply.ok:
                    raise ServiceError(f"/{theirs.topic} of ROS 2: {bytes(reply.err.payload).decode(errors='replace')}")
                found = bytes(reply.ok.payload)
                cdr.read(answered, found)
                query.reply(theirs.topic, found, encoding=f"application/cdr;{answered.name}")
                return
            raise ServiceError(f"/{theirs.topic} of ROS 2 did not reply within {CALL:g} s")

        shown = graphs.Endpoint(theirs.topic, "srv", theirs.type, NODES + theirs.node, self._bus.id)
        answers = self._answers(self._bus.session, theirs.topic, answer)
        return [*self._hold(self._bus.session, graphs.token(shown)), answers]


class ConcurrentAnswers(Answers):
    """Answers each query in its own thread, as some take long; at most MANY at a time."""

    def __init__(self, queryable: Any, answer: Callable[[Any], None]) -> None:
        self._room = threading.BoundedSemaphore(MANY)
        super().__init__(queryable, answer)

    def _handle(self, query: Any) -> None:
        self._room.acquire()  # waits while there are too many
        threading.Thread(target=self._handle_one, args=(query,), daemon=True).start()

    def _handle_one(self, query: Any) -> None:
        try:
            super()._handle(query)
        finally:
            self._room.release()


def _refused(response: Interface, error: ServiceError) -> dict[str, Any] | None:
    """A reply that tells ROS 2 of an error; None if the type has no place for it."""
    kinds = {field.name: field.nested.name if field.nested else field.type for field in response.fields}
    if kinds.keys() >= {"success", "message"}:
        return {"success": False, "message": str(error)}
    if "accepted" in kinds:  # a goal is rejected
        return {"accepted": False}
    if kinds.get("result") == "simulation_interfaces/msg/Result":
        return {"result": error.fields.get("result") or {"result": FAILED, "error_message": str(error)}}
    return None


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
