"""The bus: one Zenoh session, typed.

No work is done in Zenoh's threads: samples wait in ring channels, so a slow reader delays only itself.
The codec is loaded with the first typed publisher or subscriber.
"""

from __future__ import annotations

import contextlib
import re
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Self, TypeVar

import zenoh

from holozen.background import at_once, background
from holozen.console import report
from holozen.transport import graph as graphs
from holozen.transport import listeners, services
from holozen.transport.connection import Connection, from_environment
from holozen.transport.errors import BusError
from holozen.transport.graph import Graph, NodeInfo
from holozen.transport.peer_clocks import PeerClocks, clock_key
from holozen.transport.pubsub import Declared, Gets, Latest, Publisher, RawSubscriber, Subscription, source, stamps
from holozen.transport.rendezvous import PATIENCE
from holozen.transport.services import RING, ROOM, Replies, Server
from holozen.transport.session import CLOSE_LIMIT, linked, one_line, open_session, wait_for_threads

if TYPE_CHECKING:
    from holozen.messages import Message

M = TypeVar("M", bound="Message")
R = TypeVar("R", bound="Message")
D = TypeVar("D", bound=Declared)

LARGEST_STATE = 1_000_000  # bytes; an odom takes about 1,500
ROLL_CALL = 0.5  # s
DEFINITION_WAIT = 0.5  # s for a node to answer
_TYPE_NAME = re.compile(r"\w+/(?:msg|srv)/\w+")
GETS = 256  # waiting queries for a publisher's last value; beyond, the oldest get no reply


class Bus:
    """A node on the wire. Use it in `with`: an open session keeps a Python process from ending.

    `wire` is "json" or "msgpack", by default as the connection says. `lasting` is for long-running nodes: it is listed
    in the graph, holds a rendezvous point, and as a client waits for its router until `stop`. Others give up after
    `patience` seconds, by default 5, where a process listens and does not answer, or there is no router. `early`: open
    in a thread, while the caller loads and checks what it needs; the first use waits for it, and raises its error.
    """

    def __init__(
        self,
        node: str,
        connection: Connection | None = None,
        *,
        wire: str = "",
        patience: float | None = None,
        lasting: bool = False,
        early: bool = False,
        stop: threading.Event | None = None,
    ) -> None:
        connection = connection or from_environment()
        self.node, self.wire, self.where = node, wire or connection.wire, connection.where
        self._declared: set[Declared] = set()
        self._defined: set[str] = set()  # types whose definition this node answers with
        self._gets: dict[str, Gets] = {}  # by key expression
        self._closing = threading.Event()
        self._stamp: Callable[[], bytes] | None = None  # made with the first publisher
        self.clock_asked = threading.Event()  # set once another node has asked for this session's clock
        opening = partial(
            open_session, connection, lasting=lasting, stop=stop or self._closing, closing=self._closing,
            patience=None if lasting else PATIENCE if patience is None else patience,
        )  # fmt: skip
        try:
            self._opened = background(opening) if early else at_once(opening)
        except BaseException:  # Ctrl-C, and nobody will close this bus: a thread that opens it gives up
            self._closing.set()
            raise
        self._keeper = self._opened().keeper if lasting else None
        if lasting:
            if exposed := self.exposed():
                report(f"{node}: {listeners.exposure(exposed)}")
            info = self._keep(NodeInfo(self.session, zenoh.handlers.RingChannel(16), node, exposed))
            info.ends.append(self.announce("node"))

    @property
    def session(self) -> Any:
        """Zenoh's session. Raises BusError if it could not be opened."""
        return self._opened().session

    @property
    def took(self) -> float:
        """Seconds until the session was open and had a link: about three round trips over a slow network."""
        return self._opened().took

    @property
    def id(self) -> str:
        """The session's id."""
        return str(self.session.zid())

    @property
    def source(self) -> str:
        """The name of this node in the samples that it sends."""
        return source(self.node, self.id)

    @property
    def stamp(self) -> Callable[[], bytes]:
        """Makes the attachments of our samples. From then on, readers of a stamp may ask for our clock."""
        if self._stamp is None:
            self._stamp = stamps(self.node, self.id)
            key = clock_key(self.id)

            def answer(query: zenoh.Query) -> None:  # runs in Zenoh's thread, the only work done there
                with query:
                    query.reply(key, str(time.monotonic_ns()), express=True)
                self.clock_asked.set()

            self._keep(Declared(self.session.declare_queryable(key, answer)))
        return self._stamp

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    @property
    def listens(self) -> list[str]:
        """The endpoints where this session listens, also those of a configuration file. Raises BusError."""
        return self._opened().listens

    def exposed(self) -> list[str]:
        """The endpoints that other machines can reach without a password, a certificate or a permission."""
        if self._opened().is_guarded or all(one.startswith("tcp/127.0.0.1:") for one in self.listens):
            return []
        return [endpoint for endpoint in self.listens if listeners.is_open(endpoint)]

    def close(self) -> None:
        """Close the session. Returns within 0.2 s, whatever the other side does."""
        self._closing.set()
        declared = list(self._declared)
        closer = threading.Thread(target=self._leave, args=(declared,), daemon=True)
        closer.start()
        wait_for_threads((closer, self._keeper, *(one.thread for one in declared)), CLOSE_LIMIT)

    def _leave(self, declared: list[Declared]) -> None:
        # A link that another session opens at this moment may survive the session, and Zenoh would go on to show there
        # all that was declared. So that goes first.
        for one in declared:
            with contextlib.suppress(Exception):  # closed, or in use, by another thread
                one.close()
        with contextlib.suppress(BusError, SystemExit):  # an error of opening was reported already
            self._opened().close()

    def _keep(self, declared: D) -> D:
        """Keep something until it, or the bus, is closed."""
        declared.kept = self._declared
        self._declared.add(declared)
        return declared

    def announce(self, kind: str = "node", type_name: str = "", key: str = "") -> Any:
        """List a node or an endpoint in the graph for as long as the token is kept. Raises BusError."""
        endpoint = graphs.Endpoint(key, kind, type_name, self.node, self.id)
        with one_line(f"key {key!r}"):
            _ = kind == "node" or zenoh.KeyExpr(key)  # the token's own error would name the token
            return self.session.liveliness().declare_token(graphs.token(endpoint))

    def publisher(self, key: str, kind: type[M], priority: str = "DATA", *, block: bool = False) -> Publisher[M]:
        """A writer of `kind` on `key`. On a full link it waits (`block`), or else drops messages."""
        from holozen import wire
        from holozen.messages import codec

        with one_line(f"key {key!r}"):
            publisher = self.session.declare_publisher(
                key, encoding=codec.encoding(self.wire, kind), priority=getattr(zenoh.Priority, priority),
                express=wire.is_command(key, (kind,)),
                congestion_control=zenoh.CongestionControl.BLOCK if block else zenoh.CongestionControl.DROP,
            )  # fmt: skip
        number = partial(zenoh.SourceInfo, publisher.id)
        watch = partial(publisher.declare_matching_listener, zenoh.handlers.RingChannel(1))
        writer: Publisher[M] = Publisher(publisher, self.wire, self.stamp, number, watch)
        self._answer_gets(writer, key)
        self._define(kind)
        # Last, so that nodes that discover it can query it at once.
        writer.ends.append(self.announce("pub", kind.ROS, key))
        return self._keep(writer)

    def _answer_gets(self, writer: Publisher[Any], key: str) -> None:
        """Robots share a thread: that of `Fred/odom` answers on `*/odom`."""
        first, _, rest = key.partition("/")
        expression = f"*/{rest}" if rest and not first.startswith("@") else key
        writer.gets = self._gets.get(expression)
        if not writer.gets or not writer.gets.add(writer):
            # A callback's queue would, when full, block Zenoh's thread and with it this link.
            queryable = self.session.declare_queryable(expression, zenoh.handlers.RingChannel(GETS))
            writer.gets = self._gets[expression] = self._keep(Gets(queryable))
            writer.gets.add(writer)

    def _define(self, kind: type[Message]) -> None:
        """Answer with the definition of a type that other processes may not have: one from the files of a package."""
        from holozen.messages import definitions, registry

        interface = getattr(kind, "__interface__", None)
        if interface is None or kind.ROS in self._defined or registry.table(kind.ROS.partition("/")[0]):
            return
        self._defined.add(kind.ROS)
        text = definitions.whole_text(interface)
        self._keep(graphs.Definition(self.session, zenoh.handlers.RingChannel(16), kind.ROS, text))

    def definition(self, type_name: str) -> str:
        """The definition of a type and of those nested in it, from a node that publishes it; empty without one."""
        if not _TYPE_NAME.fullmatch(type_name):
            return ""
        for reply in self.ask_all(graphs.definition_key("*", type_name), DEFINITION_WAIT):
            if not isinstance(reply, bytes):
                return reply.payload.decode(errors="replace")
        return ""

    def subscribe(self, key: str, *kinds: type[M], depth: int = 64, limit: int = 0) -> Subscription[M]:
        """A reader of any of `kinds` that keeps the newest `depth`. Payloads over `limit` bytes are refused."""
        from holozen import wire

        raw = self.subscribe_raw(key, depth, limit)
        raw.ends.append(self.announce("sub", kinds[0].ROS, key))
        return Subscription(raw, kinds, tolerant=not wire.is_command(key, kinds))

    def latest(self, key: str, kind: type[M]) -> Latest[M]:
        """The newest message on `key`, with its age. Payloads over LARGEST_STATE bytes are ignored."""
        return Latest(self.subscribe(key, kind, depth=1, limit=LARGEST_STATE))

    def subscribe_raw(self, key: str, depth: int = 1024, limit: int = 0) -> RawSubscriber:
        """A reader of bytes on any key expression. Raises BusError if it is not valid."""
        with one_line(f"key {key!r}"):
            subscriber = self.session.declare_subscriber(key, zenoh.handlers.RingChannel(depth))
        return self._keep(RawSubscriber(subscriber, limit))

    def serve(self, key: str, request: type[M], reply: type[R], answer: Callable[[M], R], room: int = ROOM) -> Server:
        """Answer requests on `key`. The caller runs it: `answer_pending()` in a loop, or `start()`.

        At most `room` requests wait; more are refused as busy.
        """
        token = self.announce("srv", reply.ROS, key)
        queryable = self.session.declare_queryable(key, zenoh.handlers.RingChannel(RING), complete=True)
        server = self._keep(Server(queryable, key, request, answer, self.wire, room))
        server.ends.append(token)
        return server

    def call(self, key: str, request: Message, reply: type[R], timeout: float = 5.0) -> R:
        """Call a service; waits for it to appear and to reply, for at most `timeout` seconds.

        Raises ServiceError with the service's own reason, without a reply, or for a malformed one.
        """
        return services.call(self, key, request, reply, timeout)[0]

    def call_all(self, key: str, request: Message, reply: type[R], timeout: float = 5.0) -> list[R]:
        """As `call`, with the replies of all servers of the key that did not refuse. Raises ServiceError if all did."""
        return services.call(self, key, request, reply, timeout, everyone=True)

    def ask(self, key: str, timeout: float, replier: str = "", **request: Any) -> Replies:
        """Send one request, without waiting for the service. `replier`: the session whose replies are read."""
        with one_line(f"key {key!r}"):
            replies = self.session.get(key, timeout=timeout, attachment=self.source, **request)
        return Replies(replies, replier)

    def served(self, key: str) -> Callable[[], bool]:
        """A function that returns whether any node, also a foreign one, answers on `key` now."""
        with one_line(f"key {key!r}"):
            querier = self.session.declare_querier(key)
        return lambda: bool(querier.matching_status.matching)

    def writers(self, key: str) -> RawSubscriber:
        """A reader of a sample for each holozen publisher on `key` that exists, appears or disappears."""
        tokens = f"@holozen/*/*/pub/*/*/*/{graphs.quoted(key)}"
        live = self.session.liveliness()
        return self._keep(RawSubscriber(live.declare_subscriber(tokens, zenoh.handlers.RingChannel(64), history=True)))

    def ask_all(self, key: str, timeout: float, **request: Any) -> Replies:
        """Query all servers of `key`, ahead of other traffic."""
        return self.ask(
            key, timeout, target=zenoh.QueryTarget.ALL, consolidation=zenoh.ConsolidationMode.NONE,
            priority=zenoh.Priority.REAL_TIME, express=True, congestion_control=zenoh.CongestionControl.BLOCK,
            **request,
        )  # fmt: skip

    def peer_clocks(self, has: Callable[[str], bool]) -> PeerClocks:
        """The clocks of other sessions, to measure the age of their commands. `has`: whether a session is alive."""

        def ask(session: str, timeout: float) -> Replies:
            # All servers are asked, since any session may serve this key.
            return self.ask(
                clock_key(session), timeout, session, target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE, priority=zenoh.Priority.REAL_TIME, express=True,
            )  # fmt: skip

        return PeerClocks(ask, has)

    def graph(self, keys: str = graphs.ALL) -> Graph:
        """The endpoints of all nodes, or those with tokens that match `keys`, kept up to date."""
        live = self.session.liveliness()
        tokens = live.declare_subscriber(keys, zenoh.handlers.RingChannel(4096), history=True)
        return Graph(
            partial(_token_change, tokens),
            lambda: list(live.get(keys, timeout=max(ROLL_CALL, self.took))),
            lambda: map(str, self.session.info.peers_zid() if keys == graphs.ALL else ()),
            partial(_undeclare, tokens),
        )

    def endpoints(self, keys: str = graphs.ALL, patience: float = 0.5) -> list[graphs.Endpoint]:
        """A snapshot of the graph, as of `Graph.settled`, which leaves nothing declared.

        It waits as long as the session took to connect, if that is more than `patience`: the network is slow.
        """
        with self.graph(keys) as graph:
            return graph.settled(self.connected, max(patience, self.took))

    def connected(self) -> bool:
        """Whether this session has a link to any other. Raises BusError once the bus is closed."""
        if self._closing.is_set():
            raise BusError("closed")
        return linked(self.session)


def _undeclare(tokens: Any) -> None:
    with contextlib.suppress(zenoh.ZError):  # the session is closed
        tokens.undeclare()


def _token_change(tokens: Any) -> tuple[str, bool] | None:
    try:
        sample = tokens.try_recv()
    except zenoh.ZError:
        raise BusError("closed") from None
    return sample and (str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)
