"""The bus: one Zenoh session, typed. Only this file and session.py import zenoh.

Nothing here works in Zenoh's threads: samples wait in ring channels, so a slow reader delays nobody but itself.
Only a process that names a type loads the codec.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from functools import partial

import zenoh

from holozen import threads
from holozen.connection import Connection
from holozen.errors import BusError
from holozen.meanwhile import at_once, meanwhile
from holozen.replies import Replies
from holozen.session import close, one_line, open_door, open_session
from holozen.tap import Tap, source

TYPE_CHECKING = False  # importing `typing` takes 3 ms, which a verb that only looks at bytes would wait for
if TYPE_CHECKING:
    from typing import Any, Self, TypeVar

    from holozen.about import About
    from holozen.graph import Graph
    from holozen.messages import Message
    from holozen.publisher import Publisher
    from holozen.readers import Latest, Subscription
    from holozen.server import Server

    M = TypeVar("M", bound=Message)
    R = TypeVar("R", bound=Message)

CLOSE_LIMIT = 0.15  # s; a session whose peer hangs would take 10 s to close
ROLL_CALL = 0.5  # s


class Bus:
    """A node on the wire. Use it in `with`: an open session keeps a Python process from ending.

    `wire` is "json" or "msgpack", by default as the connection says. `patience` is how many seconds a client waits for
    its router (None: for ever, or until `stop`). `lasting` is for what runs long: it stands in the graph, and keeps
    the meeting point open when its holder is gone. `early`: open in a thread, while the caller loads and checks what
    it needs; the first use waits for it, and raises its error.
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
        connection = connection or Connection()
        self.node, self.wire, self.where = node, wire or connection.wire, connection.where
        self._readers: set[Tap | Server | About] = set()  # they live until the bus is closed
        self._closing = threading.Event()
        opening = partial(open_session, connection, patience, stop or self._closing)
        self._opened = meanwhile(opening) if early else at_once(opening)
        self._door: threading.Thread | None = None
        if lasting:
            from holozen.about import About

            self._readers.add(About(self.session, zenoh.handlers.RingChannel(16), node))
        self._token = self.announce("node") if lasting else None
        if lasting and connection.door:
            from holozen import door

            self._door = door.keep(connection.door, self._closing, open_door)

    @property
    def session(self) -> Any:
        """Zenoh's session. Raises BusError if it could not be opened."""
        return self._opened()

    @property
    def id(self) -> str:
        """The session's id."""
        return str(self.session.zid())

    @property
    def source(self) -> str:
        """How others name the sender of our samples."""
        return source(self.node, self.id)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave. Returns within 0.2 s, whatever the other side does."""
        self._closing.set()
        closer = threading.Thread(target=self._leave, daemon=True)
        closer.start()
        threads.wait((closer, self._door, *(reader.thread for reader in self._readers)), CLOSE_LIMIT)

    def _leave(self) -> None:
        with contextlib.suppress(BusError, SystemExit):  # that it could not be opened was told already
            close(self.session)

    def announce(self, kind: str = "node", type_name: str = "", key: str = "") -> Any:
        """Show a node or an endpoint in the graph for as long as the token is kept. Raises BusError."""
        from holozen import graph

        endpoint = graph.Endpoint(key, kind, type_name, self.node, self.id)
        with one_line(f"key {key!r}"):
            _ = kind == "node" or zenoh.KeyExpr(key)  # the token's own error would name the token
            return self.session.liveliness().declare_token(graph.token(endpoint))

    def publisher(self, key: str, kind: type[M], priority: str = "DATA", *, block: bool = False) -> Publisher[M]:
        """A writer of `kind` on `key`. Where a link is full it waits (`block`), or else drops what it is to send."""
        from holozen import codec
        from holozen.publisher import Publisher

        with one_line(f"key {key!r}"):
            publisher = self.session.declare_publisher(
                key, encoding=codec.encoding(self.wire, kind), priority=getattr(zenoh.Priority, priority), express=True,
                congestion_control=zenoh.CongestionControl.BLOCK if block else zenoh.CongestionControl.DROP,
            )  # fmt: skip
        number = partial(zenoh.SourceInfo, publisher.id)
        writer: Publisher[M] = Publisher(publisher, self.wire, self.source, number)
        queryable = self.session.declare_queryable(key, writer.answer)
        # Last, so that who learns of it may ask it at once.
        writer.ends += [queryable, self.announce("pub", kind.ROS, key)]
        return writer

    def subscribe(self, key: str, *kinds: type[M], depth: int = 64, limit: int = 0) -> Subscription[M]:
        """A reader of any of `kinds` that keeps the newest `depth`. Payloads over `limit` bytes are refused."""
        from holozen.readers import Subscription

        tap = self.tap(key, depth, limit)
        tap.ends.append(self.announce("sub", kinds[0].ROS, key))
        return Subscription(tap, kinds)

    def latest(self, key: str, kind: type[M]) -> Latest[M]:
        """The newest message on `key`, with its age."""
        from holozen.readers import Latest

        return Latest(self.subscribe(key, kind, depth=1))

    def tap(self, key: str, depth: int = 1024, limit: int = 0) -> Tap:
        """A reader of bytes on any key expression. Raises BusError for one that is none."""
        with one_line(f"key {key!r}"):
            tap = Tap(self.session.declare_subscriber(key, zenoh.handlers.RingChannel(depth)), limit)
        self._readers.add(tap)
        return tap

    def drop(self, reader: Subscription[Any] | Tap | Server) -> None:
        """Close a reader or a server before the bus; nothing of its key stays."""
        reader.close()
        self._readers.discard(getattr(reader, "tap", reader))

    def serve(self, key: str, request: type[M], reply: type[R], answer: Callable[[M], R]) -> Server:
        """Answer requests on `key`. The caller asks for the work: `answer_pending()` in a loop, or `start()`."""
        from holozen.server import Server

        token = self.announce("srv", reply.ROS, key)
        queryable = self.session.declare_queryable(key, zenoh.handlers.RingChannel(64), complete=True)
        server = Server(queryable, key, request, answer, self.wire)
        server.ends.append(token)
        self._readers.add(server)
        return server

    def call(self, key: str, request: Message, reply: type[R], timeout: float = 5.0) -> R:
        """Ask a service and wait for its reply, and for the service itself, for at most `timeout` seconds.

        Raises ServiceError with the service's own reason, when nobody answered, or for a reply that is none.
        """
        from holozen import caller

        return caller.call(self, key, request, reply, timeout)

    def ask(self, key: str, timeout: float, **request: Any) -> Replies:
        """Ask once, without waiting for the service."""
        with one_line(f"key {key!r}"):
            replies = self.session.get(key, timeout=timeout, attachment=self.source, **request)
        return Replies(replies)

    def served(self, key: str) -> Callable[[], bool]:
        """A function that says whether anyone answers on `key` by now, a stranger as well."""
        with one_line(f"key {key!r}"):
            querier = self.session.declare_querier(key)
        return lambda: bool(querier.matching_status.matching)

    def writers(self, key: str) -> Tap:
        """A reader that gets something whenever a publisher of ours on `key` is there, comes or goes."""
        from holozen import graph

        tokens = f"@holozen/*/*/pub/*/*/*/{graph.quoted(key)}"
        tap = Tap(self.session.liveliness().declare_subscriber(tokens, zenoh.handlers.RingChannel(64), history=True))
        self._readers.add(tap)
        return tap

    def ask_all(self, key: str, timeout: float) -> Replies:
        """Ask all who serve `key` without a payload, ahead of other traffic."""
        return self.ask(
            key, timeout, target=zenoh.QueryTarget.ALL, consolidation=zenoh.ConsolidationMode.NONE,
            priority=zenoh.Priority.REAL_TIME, express=True, congestion_control=zenoh.CongestionControl.BLOCK,
        )  # fmt: skip

    def graph(self, keys: str = "@holozen/**") -> Graph:
        """The endpoints of all nodes, or those with tokens like `keys`, kept up to date."""
        from holozen import graph

        live = self.session.liveliness()
        tokens = live.declare_subscriber(keys, zenoh.handlers.RingChannel(4096), history=True)
        return graph.Graph(
            lambda: _token_change(tokens.try_recv()),
            lambda: list(live.get(keys, timeout=ROLL_CALL)),
            lambda: map(str, self.session.info.peers_zid() if keys == graph.ALL else ()),
        )

    def connected(self) -> bool:
        """Whether this session has a link to any other. Raises BusError once the bus is closed."""
        if self._closing.is_set():
            raise BusError("closed")
        return bool(self.session.info.peers_zid() or self.session.info.routers_zid())


def _token_change(sample: Any) -> tuple[str, bool] | None:
    return sample and (str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)
