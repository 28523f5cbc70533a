"""The bus: a node on the wire, typed. The codec is loaded with the first publisher, subscriber or server."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from itertools import count
from typing import TYPE_CHECKING, Any, TypeVar

import zenoh

from holozen import wire
from holozen.suggest import cut, shorten
from holozen.transport import services
from holozen.transport.errors import BusError
from holozen.transport.graph import definition
from holozen.transport.node import Node, checked_wire
from holozen.transport.peer_clocks import PeerClocks, clock_key
from holozen.transport.pubsub import Gets, Latest, Publisher, RawPublisher, Subscription
from holozen.transport.samples import PRIORITIES, Answers, Dealer, RawSubscriber, Replies, Ring, stamps
from holozen.transport.services import RING, ROOM, Server
from holozen.transport.session import one_line

if TYPE_CHECKING:
    from holozen.messages import Message
    from holozen.transport.members import Verifier

M = TypeVar("M", bound="Message")
P = TypeVar("P", bound=RawPublisher)
R = TypeVar("R", bound="Message")

LARGEST_STATE = 1_000_000  # bytes; an odom takes about 1,500
DEALT = 1 << 14  # samples, or requests, of all keys of a Dealer that wait for it
LONGEST_CALL = 1e9  # s; Zenoh takes no infinite timeout
GETS = 256  # waiting queries for a publisher's last value, or for our clock; beyond, the oldest get no reply


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

    def stamps(self, key: str) -> Callable[[], bytes]:
        """A function that makes the attachments of our samples on a key."""
        _ = self.clock_server
        return stamps(self._signer, self.id, self._numbers.setdefault(key, count()))

    @cached_property
    def _numbers(self) -> dict[str, Iterator[int]]:
        """Numbers our samples on each key."""
        return {}

    @cached_property
    def clock_server(self) -> Answers:
        """Answers readers of a stamp that ask for our clock."""
        key, member = clock_key(self.id), self.member

        def answer(query: zenoh.Query) -> None:
            clock: str | bytes = str(time.monotonic_ns())
            if member:
                clock = member.answer(self.id, bytes(query.payload or b"")[:64], str(clock))
            query.reply(key, clock, express=True)
            self.clock_asked.set()

        # Not a callback: Zenoh would run it in a thread that keeps a program from ending which has not closed its bus.
        return self._keep(Answers(self.session.declare_queryable(key, zenoh.handlers.RingChannel(GETS)), answer))

    def publisher(
        self, key: str, kind: type[M], priority: str = "DATA", *, block: bool = False, wire: str = "",
        dead_man: bool = True,
    ) -> Publisher[M]:  # fmt: skip
        """A writer of `kind` on `key`. On a full link it waits (`block`), or else drops messages. `wire` replaces
        the node's. `dead_man`: a publisher of commands is listed as a node, so that its end stops the robot at once;
        without, its last command counts as long as that of a foreign program. Raises BusError for a wildcard, or a
        key, priority or wire that does not exist, and TypeError for a `kind` that is not the class of a message.
        """
        from holozen.messages import codec

        _check_types(key, kind)
        self.define(kind)
        wire = checked_wire(wire or self.wire)
        make: Callable[..., Publisher[M]] = partial(Publisher, kind, wire, self._queued)
        return self._publish(make, key, kind.ROS, codec.encoding(wire, kind), priority, block, dead_man)

    def publisher_raw(
        self, key: str, type_name: str, encoding: str, priority: str = "DATA", *, block: bool = False,
        dead_man: bool = True,
    ) -> RawPublisher:  # fmt: skip
        """A writer of bytes, in that encoding by default; otherwise as `publisher`."""
        return self._publish(RawPublisher, key, type_name, encoding, priority, block, dead_man)

    def _publish(
        self, make: Callable[..., P], key: str, type_name: str, encoding: str, priority: str, block: bool,
        dead_man: bool,
    ) -> P:  # fmt: skip
        if priority not in PRIORITIES:
            raise BusError(f"key {key!r}: no priority {priority!r}; there are {', '.join(PRIORITIES)}")
        commands = wire.is_command(key, (type_name,))
        with one_line(f"key {key!r}"):
            if "*" in str(zenoh.KeyExpr(key)):
                raise BusError(f"key {key!r}: write to one key; a wildcard would reach every robot")
            publisher = self.session.declare_publisher(
                key, encoding=encoding, priority=getattr(zenoh.Priority, priority), express=commands,
                congestion_control=zenoh.CongestionControl.BLOCK if block else zenoh.CongestionControl.DROP,
            )  # fmt: skip
        watch = partial(publisher.declare_matching_listener, zenoh.handlers.RingChannel(1))
        sign = partial(self.member.attachment, key, priority) if self.member and commands else None
        writer = make(publisher, self.stamps(key), watch, sign)
        self._answer_gets(writer, key)
        if commands and dead_man:
            _ = self.listing
        # Last, so that nodes that discover it can query it at once.
        writer.ends.append(self.announce("pub", type_name, key))
        return self._keep(writer)

    @cached_property
    def _dealers(self) -> dict[tuple[str, bool], Dealer]:
        """What deals samples, or requests, by key expression."""
        return {}

    @cached_property
    def _known(self) -> dict[str, Any]:
        """The keys of rings that were declared to Zenoh."""
        return {}

    def _ring(self, key: str, depth: int, is_queryable: bool = False) -> Ring | None:
        """A ring for a robot's key, `Fred/cmd_vel`, of what comes on those of all robots, `*/cmd_vel`; None for the
        requests to a key without a robot's name.
        """
        if (expression := _of_all(key)) == key and is_queryable:
            return None
        dealer = self._dealers.get((expression, is_queryable))
        if not dealer or not dealer.ends:
            channel: Any = zenoh.handlers.RingChannel(DEALT)
            with one_line(f"key {key!r}"):
                if is_queryable:  # not complete: others may serve some of these keys
                    declared: Any = self.session.declare_queryable(expression, channel)
                else:
                    declared = self.session.declare_subscriber(expression, channel)
            dealer = self._dealers[expression, is_queryable] = self._keep(Dealer(declared, is_queryable))
        if not is_queryable and key not in self._known:
            # Zenoh looks up its way once for a key that is declared here, and for any other with each sample. It is
            # never undeclared: senders may still use its number.
            self._known[key] = self.session.declare_keyexpr(key)
        return dealer.ring(key, depth)

    @cached_property
    def _queued(self) -> list[tuple[RawPublisher, bytes, str | None]]:
        """The messages that `send_queued` sends."""
        return []

    def send_queued(self) -> None:
        """Send what publishers have queued."""
        queued = self._queued.copy()
        self._queued.clear()  # publishers hold this list
        for publisher, payload, encoding in queued:
            publisher.put_bytes(payload, encoding)

    def _answer_gets(self, writer: RawPublisher, key: str) -> None:
        """Robots share a thread: that of `Fred/odom` answers on `*/odom`."""
        expression = _of_all(key)
        writer.gets = self._gets.get(expression)
        if not writer.gets or not writer.gets.add(writer):
            # A callback's queue would, when full, block Zenoh's thread and with it this link.
            queryable = self.session.declare_queryable(expression, zenoh.handlers.RingChannel(GETS))
            writer.gets = self._gets[expression] = self._keep(Gets(queryable))
            writer.gets.add(writer)

    def define(self, kind: type[Message]) -> None:
        """Answer with the definition of a type that other processes may not have: one from the files of a package."""
        interface = getattr(kind, "__interface__", None)
        if interface is None or interface.name in self._defined:
            return
        from holozen.messages import definitions, registry

        if registry.table(interface.package):
            return
        self._defined.add(interface.name)
        text = definitions.whole_text(interface)
        self._keep(definition(self.session, zenoh.handlers.RingChannel(16), interface.name, text))

    def subscribe(
        self, key: str, *kinds: type[M], depth: int = 64, limit: int = 0, dealt: bool = False
    ) -> Subscription[M]:
        """A reader of any of `kinds` that keeps the newest `depth`. Payloads over `limit` bytes are refused, and in the
        secure set-up commands without proof. `dealt`: for a WaitSet, which reads higher priorities first; the newest
        `depth` of each are kept, and all robots' keys of that name share a subscriber. Raises BusError for a wrong key,
        and TypeError without `kinds`, or for one that is not the class of a message.
        """
        from holozen.messages import codec

        _check_types(key, *kinds or (None,))
        ring = self._ring(key, depth) if dealt else None
        raw = self._keep(RawSubscriber(ring, limit)) if ring else self.subscribe_raw(key, depth, limit)
        raw.ends.append(self.announce("sub", kinds[0].ROS, key))
        is_command = wire.is_command(key, (kind.ROS for kind in kinds))
        decode = codec.decoder(kinds, tolerant=not is_command)
        return Subscription(raw, decode, self._verifier.refusal if is_command and self._verifier else None)

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
        shared: bool = False, dealt: bool = False, stops: bool = False,
    ) -> Server:  # fmt: skip
        """Answer requests on `key`. The caller runs it: `answer_pending()` in a loop, or `start()`.

        At most `room` requests wait; more are refused as busy. A request on a `shared` key goes to all of its servers;
        those that have no part in it raise Elsewhere. `dealt`: all robots' keys of that name share a queryable, which a
        WaitSet reads. `stops` as in Server. Raises BusError for a wrong key, and TypeError for a `request` or a `reply`
        that is not the class of a message.
        """
        _check_types(key, request, reply)
        token = self.announce("srv", reply.ROS, key)
        queryable: Any = self._ring(key, RING, is_queryable=True) if dealt else None
        if not queryable:
            queryable = self.session.declare_queryable(key, zenoh.handlers.RingChannel(RING), complete=not shared)
        server = self._keep(Server(queryable, key, request, reply, answer, self.wire, room, stops))
        server.ends.append(token)
        return server

    def call(self, key: str, request: Message, reply: type[R], timeout: float = 5.0) -> R:
        """Call a service; waits for it to appear and to reply, for at most `timeout` seconds.

        Raises ServiceError with the service's own reason, without a reply, or for a malformed one; BusError for a wrong
        key or `timeout`, and TypeError for a wrong type.
        """
        _check_call(key, request, reply, timeout)
        return services.call(self, key, request, reply, timeout)[0]

    def call_all(self, key: str, request: Message, reply: type[R], timeout: float = 5.0) -> list[R]:
        """As `call`, with the replies of all servers of the key that did not refuse. Raises ServiceError if all did."""
        _check_call(key, request, reply, timeout)
        return services.call(self, key, request, reply, timeout, everyone=True)

    def peer_clocks(self, has: Callable[[str], bool]) -> PeerClocks:
        """The clocks of other sessions, to measure the age of their commands. `has`: whether a session is alive."""

        def ask(session: str, nonce: bytes, timeout: float) -> Replies:
            # All servers are asked, since any session may serve this key.
            return self.ask_all(clock_key(session), timeout, replier=session, payload=nonce or None)

        return PeerClocks(ask, has, signer=self._verifier.answerer if self._verifier else None)


def _of_all(key: str) -> str:
    """The key expression of all robots' keys of that name: `*/odom` for `Fred/odom`, and `odom` for `odom`."""
    first, _, rest = key.partition("/")
    return f"*/{rest}" if rest and not first.startswith("@") else key


def _check_types(key: object, *kinds: object) -> None:
    """Raise TypeError unless `key` is a text and each of `kinds` the class of a message."""
    from holozen.messages import Message

    if not isinstance(key, str):
        raise TypeError(f"key {cut(repr(key))}: give a text, such as 'odom'")
    for kind in kinds:
        if not (isinstance(kind, type) and issubclass(kind, Message)):
            given = getattr(kind, "__name__", None) or shorten(repr(kind))
            raise TypeError(f"key {key!r}: {given} is not the class of a message, such as Twist")


def _check_call(key: object, request: object, reply: object, timeout: float) -> None:
    """Raise TypeError or BusError unless these can be the arguments of a call."""
    from holozen.messages import Message

    _check_types(key, reply)
    if not isinstance(request, Message):
        raise TypeError(f"key {key!r}: the request {shorten(repr(request))} is not a message, such as TriggerRequest()")
    if not (isinstance(timeout, int | float) and 0 <= timeout <= LONGEST_CALL):
        raise BusError(f"key {key!r}: timeout {timeout!r}: use 0 to {LONGEST_CALL:g} s")
