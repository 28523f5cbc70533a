"""The bus: one Zenoh session, typed. The only file that imports zenoh.

Nothing here works in Zenoh's threads: samples wait in ring channels, so a slow reader delays nobody but itself.
The codec is imported where a type is first named: a process that only looks at bytes starts without it.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Self, TypeVar

import zenoh

from holozen import graph
from holozen.connection import Connection
from holozen.errors import BusError, NoReply, ServiceError
from holozen.publisher import Publisher
from holozen.readers import Latest, Sample, Subscription, Tap

if TYPE_CHECKING:
    from holozen.messages import Message
    from holozen.server import Server

__all__ = [
    "Bus", "BusError", "Latest", "NoReply", "Publisher", "Sample", "ServiceError", "Subscription", "Tap",
]  # fmt: skip

M = TypeVar("M", bound="Message")
R = TypeVar("R", bound="Message")

CLOSE_LIMIT = 0.15  # s; a session whose peer hangs would take 10 s to close
TIMEOUT = b"Timeout"  # what Zenoh itself replies for a service that says nothing
OPEN_STEP = 500  # ms between two looks at the signals while a client waits for its router


class Bus:
    """A node on the wire. Use it in `with`: an open session keeps a Python process from ending.

    `wire` is "json" or "msgpack", by default as the connection says. `patience` is how many seconds a client waits for
    its router (None: for ever, or until `stop`). `lasting` is for what runs long: it stands in the graph, and keeps
    the meeting point open when its holder is gone.
    """

    def __init__(
        self,
        node: str,
        connection: Connection | None = None,
        *,
        wire: str = "",
        patience: float | None = None,
        lasting: bool = False,
        stop: threading.Event | None = None,
    ) -> None:
        connection = connection or Connection()
        self.node, self.wire = node, wire or connection.wire
        self.session = _open(connection, patience, stop)
        self.id = str(self.session.zid())
        self.source = f"{node}@{self.id[:6]}"  # how others name the sender of our samples
        self._readers: set[Tap | Server] = set()  # they live until the bus is closed
        self._closing = threading.Event()
        self._door: threading.Thread | None = None
        self._token = self.announce("node") if lasting else None
        if lasting and connection.door:
            from holozen import door

            self._door = door.keep(connection.door, self._closing, _open_door)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave. Returns within 0.2 s, whatever the other side does."""
        self._closing.set()
        closer = threading.Thread(target=_close, args=(self.session,), daemon=True)
        closer.start()
        deadline = time.monotonic() + CLOSE_LIMIT
        # An interpreter that ends while a thread is inside Zenoh aborts.
        for thread in (closer, self._door, *(reader.thread for reader in self._readers)):
            if thread and thread is not threading.current_thread():
                thread.join(max(0.0, deadline - time.monotonic()))

    def announce(self, kind: str = "node", type_name: str = "", key: str = "") -> Any:
        """Show a node or an endpoint in the graph for as long as the token is kept. Raises BusError."""
        endpoint = graph.Endpoint(key, kind, type_name, self.node, self.id)
        with _one_line(f"key {key!r}"):
            _ = kind == "node" or zenoh.KeyExpr(key)  # the token's own error would name the token
            return self.session.liveliness().declare_token(graph.token(endpoint))

    def publisher(self, key: str, kind: type[M], priority: str = "DATA") -> Publisher[M]:
        """A writer of `kind` on `key`."""
        from holozen import codec

        token = self.announce("pub", kind.ROS, key)
        publisher = self.session.declare_publisher(
            key, encoding=codec.WIRES[self.wire], priority=getattr(zenoh.Priority, priority), express=True
        )
        writer: Publisher[M] = Publisher(publisher, self.wire, self.source)
        writer.ends += [self.session.declare_queryable(key, writer.answer), token]
        return writer

    def subscribe(self, key: str, *kinds: type[M], depth: int = 64, limit: int = 0) -> "Subscription[M]":
        """A reader of any of `kinds` that keeps the newest `depth`. Payloads over `limit` bytes are refused."""
        tap = self.tap(key, depth, limit)
        tap.ends.append(self.announce("sub", kinds[0].ROS, key))
        return Subscription(tap, kinds)

    def latest(self, key: str, kind: type[M]) -> "Latest[M]":
        """The newest message on `key`, with its age."""
        return Latest(self.subscribe(key, kind, depth=1))

    def tap(self, key: str, depth: int = 1024, limit: int = 0) -> Tap:
        """A reader of bytes on any key expression. Raises BusError for one that is none."""
        with _one_line(f"key {key!r}"):
            tap = Tap(self.session.declare_subscriber(key, zenoh.handlers.RingChannel(depth)), limit)
        self._readers.add(tap)
        return tap

    def drop(self, reader: "Subscription[Any] | Tap | Server") -> None:
        """Close a reader or a server before the bus; nothing of its key stays."""
        reader.close()
        self._readers.discard(reader.tap if isinstance(reader, Subscription) else reader)

    def serve(self, key: str, request: type[M], reply: type[R], answer: Callable[[M], R]) -> "Server":
        """Answer requests on `key`. The caller asks for the work: `answer_pending()` in a loop, or `start()`."""
        from holozen.server import Server

        token = self.announce("srv", reply.ROS, key)
        queryable = self.session.declare_queryable(key, zenoh.handlers.RingChannel(64), complete=True)
        server = Server(queryable, key, request, answer, self.wire)
        server.ends.append(token)
        self._readers.add(server)
        return server

    def call(self, key: str, request: "Message", reply: type[R], timeout: float = 5.0) -> R:
        """Ask a service and wait for its reply, and for the service itself, for at most `timeout` seconds.

        Raises ServiceError with the service's own reason, when nobody answered, or for a reply that is none.
        """
        from holozen import codec

        payload = codec.encode(request, self.wire)
        answer = self.call_bytes(key, payload, codec.WIRES[self.wire], timeout)
        try:
            return codec.decode(answer.payload, answer.encoding, (reply,))
        except codec.CodecError as error:
            raise ServiceError(f"the reply of {key!r} is {error}") from None

    def call_bytes(self, key: str, payload: bytes, encoding: str, timeout: float) -> Sample:
        """`call` without types."""
        from holozen.server import refusal

        deadline = time.monotonic() + timeout
        while (left := deadline - time.monotonic()) > 0:
            with _one_line(f"service {key!r}"):
                replies = self.session.get(key, payload=payload, encoding=encoding, timeout=left)
            for reply in replies:
                if reply.ok:
                    return Sample(reply.ok)
                if (answer := bytes(reply.err.payload)) != TIMEOUT:
                    raise refusal(answer)
            time.sleep(min(0.01, max(left, 0)))
        raise NoReply(f"no reply from {key!r} within {timeout:g} s; `holozen service list` shows who serves")

    def graph(self) -> graph.Graph:
        """The endpoints of all nodes, kept up to date."""
        tokens = self.session.liveliness().declare_subscriber(graph.ALL, zenoh.handlers.RingChannel(4096), history=True)
        return graph.Graph(lambda: _token_change(tokens.try_recv()))

    def connected(self) -> bool:
        """Whether this session has a link to any other."""
        return bool(self.session.info.peers_zid() or self.session.info.routers_zid())


def _token_change(sample: Any) -> tuple[str, bool] | None:
    return sample and (str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)


def _open(connection: Connection, patience: float | None, stop: threading.Event | None) -> Any:
    """A peer opens at once and connects when it can. A client has nothing without its router, and waits for it.

    Ends the process, in peace, when `stop` is set meanwhile.
    """
    deadline = None if patience is None else time.monotonic() + patience
    stop = stop or threading.Event()
    told = connection.mode != "client" or patience is not None
    while True:
        try:
            return zenoh.open(_config(connection))
        except zenoh.ZError as error:
            if connection.mode != "client" or (deadline and time.monotonic() > deadline):
                raise BusError(f"cannot open Zenoh: {_first_words(error)}") from None
        if not told:
            print(f"waiting for a Zenoh router at {', '.join(connection.connect or ())}", file=sys.stderr, flush=True)
            told = True
        if stop.wait(0.05):
            raise SystemExit(0)


def _config(connection: Connection) -> zenoh.Config:
    with _one_line(f"Zenoh configuration {connection.config}"):
        config = zenoh.Config.from_file(connection.config) if connection.config else zenoh.Config()
    settings = connection.settings()
    if connection.mode == "client":
        # Short tries, so that signals are seen in between. After the first success Zenoh reconnects for ever.
        short = {"connect/timeout_ms": str(OPEN_STEP), "connect/exit_on_failure": "true"}
        settings |= short | dict(connection.cfg)
    for path, value in settings.items():
        with _one_line(f"Zenoh setting {path}:{value}"):
            config.insert_json5(path, value)
    return config


def _open_door(endpoint: str) -> Callable[[], None] | None:
    """A session that only listens at `endpoint`: how to close it, or None if another process was faster."""
    cfg = (("listen/endpoints", f'["{endpoint}"]'), ("listen/exit_on_failure", "true"))
    try:
        session = zenoh.open(_config(Connection(connect=(), listen=(), cfg=cfg)))
    except zenoh.ZError:
        return None
    return lambda: _close(session)


def _close(session: Any) -> None:
    with contextlib.suppress(zenoh.ZError):
        session.close()


@contextlib.contextmanager
def _one_line(what: str) -> Iterator[None]:
    try:
        yield
    except zenoh.ZError as error:
        raise BusError(f"{what}: {_first_words(error)}") from None


def _first_words(error: Exception) -> str:
    """Zenoh's reason in one line, without the source files it comes from."""
    return " ".join(str(error).partition(" at /")[0].replace("\\n", " ").split()).rstrip(".")
