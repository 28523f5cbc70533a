"""The bus: a node on the wire, typed. The codec is loaded with the first publisher, subscriber or server."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, TypeVar

import zenoh

from holozen.transport import services
from holozen.transport.graph import Definition
from holozen.transport.node import Node
from holozen.transport.peer_clocks import PeerClocks, clock_key
from holozen.transport.pubsub import Gets, Latest, Publisher, Subscription
from holozen.transport.samples import Declared, Replies, Sample, stamps
from holozen.transport.services import RING, ROOM, Server
from holozen.transport.session import one_line

if TYPE_CHECKING:
    from holozen.messages import Message
    from holozen.transport.members import Verifier

M = TypeVar("M", bound="Message")
R = TypeVar("R", bound="Message")

LARGEST_STATE = 1_000_000  # bytes; an odom takes about 1,500
NO_ENCODING = "zenoh/bytes"  # Zenoh's default
UNTYPED = (
    "CDR without an Encoding, so of no certain type; what a bridge to ROS 2 sends comes in by `holozen ros2 --bridge`"
)
GETS = 256  # waiting queries for a publisher's last value; beyond, the oldest get no reply


class Bus(Node):
    """A node with typed topics and services."""

    @cached_property
    def clock_asked(self) -> threading.Event:
        """Set once another node has asked for this session's clock."""
        return threading.Event()

    @cached_property
    def _defined(self) -> set[str]:
        """The types whose definition this node answers with."""
        return set()

    @cached_property
    def _gets(self) -> dict[str, Gets]:
        """What answers gets, by key expression."""
        return {}

    @cached_property
    def stamp(self) -> Callable[[], bytes]:
        """Makes the attachments of our samples. From then on, readers of a stamp may ask for our clock."""
        key, member = clock_key(self.id), self.member

        def answer(query: zenoh.Query) -> None:  # runs in Zenoh's thread, the only work done there
            with query:
                clock: str | bytes = str(time.monotonic_ns())
                if member:
                    clock = member.answer(self.id, bytes(query.payload or b"")[:64], str(clock))
                query.reply(key, clock, express=True)
            self.clock_asked.set()

        self._keep(Declared(self.session.declare_queryable(key, answer)))
        return stamps(self._signer, self.id)

    def publisher(
        self, key: str, kind: type[M], priority: str = "DATA", *, block: bool = False, wire: str = ""
    ) -> Publisher[M]:
        """A writer of `kind` on `key`. On a full link it waits (`block`), or else drops messages. `wire` is another one
        than the node's.
        """
        from holozen.messages import codec
        from holozen.wire import is_command

        with one_line(f"key {key!r}"):
            publisher = self.session.declare_publisher(
                key, encoding=codec.encoding(wire or self.wire, kind), priority=getattr(zenoh.Priority, priority),
                express=is_command(key, (kind,)),
                congestion_control=zenoh.CongestionControl.BLOCK if block else zenoh.CongestionControl.DROP,
            )  # fmt: skip
        number = partial(zenoh.SourceInfo, publisher.id)
        watch = partial(publisher.declare_matching_listener, zenoh.handlers.RingChannel(1))
        sign = None
        if self.member and is_command(key, (kind,)):
            sign = partial(self.member.attachment, key, priority)
        writer: Publisher[M] = Publisher(publisher, wire or self.wire, self.stamp, number, watch, sign)
        self._answer_gets(writer, key)
        self.define(kind)
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

    def define(self, kind: type[Message]) -> None:
        """Answer with the definition of a type that other processes may not have: one from the files of a package."""
        from holozen.messages import definitions, registry

        interface = getattr(kind, "__interface__", None)
        if interface is None or interface.name in self._defined or registry.table(interface.package):
            return
        self._defined.add(interface.name)
        text = definitions.whole_text(interface)
        self._keep(Definition(self.session, zenoh.handlers.RingChannel(16), interface.name, text))

    def subscribe(self, key: str, *kinds: type[M], depth: int = 64, limit: int = 0) -> Subscription[M]:
        """A reader of any of `kinds` that keeps the newest `depth`. Payloads over `limit` bytes are refused, and in the
        secure set-up commands without proof.
        """
        from holozen import wire

        raw = self.subscribe_raw(key, depth, limit)
        raw.ends.append(self.announce("sub", kinds[0].ROS, key))
        is_command = wire.is_command(key, kinds)
        return Subscription(raw, kinds, tolerant=not is_command, refusal=self._refusal if is_command else None)

    def _refusal(self, sample: Sample) -> str:
        """Why a command is not read, before its payload is."""
        if sample.encoding == NO_ENCODING and sample.payload[:1] == b"\0":
            return UNTYPED
        return self._unproven(sample) if self._unproven else ""

    @cached_property
    def _unproven(self) -> Callable[[Sample], str] | None:
        """Why a command is refused for want of proof; None outside the secure set-up."""
        return self._verifier.refusal if self._verifier else None

    @cached_property
    def _verifier(self) -> Verifier | None:
        """Checks the proofs of others; None outside the secure set-up."""
        if not self._secure:
            return None
        from holozen.transport.members import Verifier  # loads cryptography

        return Verifier(self._secure)

    def latest(self, key: str, kind: type[M]) -> Latest[M]:
        """The newest message on `key`, with its age. Payloads over LARGEST_STATE bytes are ignored."""
        return Latest(self.state(key, kind))

    def state(self, key: str, kind: type[M]) -> Subscription[M]:
        """A reader of the newest message on `key`, as `latest` has."""
        return self.subscribe(key, kind, depth=1, limit=LARGEST_STATE)

    def serve(
        self, key: str, request: type[M], reply: type[R], answer: Callable[[M], R], room: int = ROOM,
        shared: bool = False,
    ) -> Server:  # fmt: skip
        """Answer requests on `key`. The caller runs it: `answer_pending()` in a loop, or `start()`.

        At most `room` requests wait; more are refused as busy. A request on a `shared` key goes to all of its servers;
        those that have no part in it raise Elsewhere.
        """
        token = self.announce("srv", reply.ROS, key)
        queryable = self.session.declare_queryable(key, zenoh.handlers.RingChannel(RING), complete=not shared)
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

    def peer_clocks(self, has: Callable[[str], bool]) -> PeerClocks:
        """The clocks of other sessions, to measure the age of their commands. `has`: whether a session is alive."""

        def ask(session: str, nonce: bytes, timeout: float) -> Replies:
            # All servers are asked, since any session may serve this key.
            return self.ask(
                clock_key(session), timeout, session, payload=nonce or None, target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE, priority=zenoh.Priority.REAL_TIME, express=True,
            )  # fmt: skip

        return PeerClocks(ask, has, signer=self._verifier.answerer if self._verifier else None)
