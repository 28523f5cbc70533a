"""The bus: a node on the wire, typed. The codec is loaded with the first publisher, subscriber or
server.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, TypeVar

import zenoh

from holozen import wire
from holozen.suggest import cut, shorten
from holozen.transport import services
from holozen.transport.beat import (
    BEAT,
    Beat,
    Echoes,
    Hearing,
    OwnTime,
    beat_key,
    name_for,
    tokens_of,
)
from holozen.transport.errors import BusError
from holozen.transport.graph import definition, quoted
from holozen.transport.node import Node, checked_wire
from holozen.transport.pubsub import Gets, Latest, Publisher, RawPublisher, Subscription
from holozen.transport.samples import PRIORITIES, Dealer, Numbers, RawSubscriber, Ring, stamps
from holozen.transport.services import RING, ROOM, Server
from holozen.transport.session import is_matched, one_line, tokens

if TYPE_CHECKING:
    from holozen.messages import Message
    from holozen.transport.authenticator import Verifier

M = TypeVar("M", bound="Message")
P = TypeVar("P", bound=RawPublisher)
R = TypeVar("R", bound="Message")

LARGEST_STATE = 1_000_000  # bytes; an odom takes about 1,500
DEALT = 1 << 14  # samples, or requests, of all keys of a Dealer that wait for it
LONGEST_CALL = 1e9  # s; Zenoh takes no infinite timeout
ASKED = 1.0  # s for a receiver to answer with its beat
HOLDERS = 1024  # tokens of one key that come or go between two commands
# waiting queries for a publisher's last value, or for our beat; beyond, the oldest get no reply
GETS = 256


class Bus(Node):
    """A node with typed topics and services."""

    @cached_property
    def _defined(self) -> set[str]:
        """The types whose definition this node answers with."""
        return set()

    @cached_property
    def _gets(self) -> dict[str, Gets]:
        """What answers gets, by key expression."""
        return {}

    def stamps(self, key: str) -> Callable[..., bytes]:
        """A function that makes the attachments of our samples on a key, of a command from its
        echoes.
        """
        return stamps(self._signer, self.id, self._numbers.setdefault(key, Numbers()))

    @cached_property
    def own_time(self) -> OwnTime:
        """The time of this session, for the age of what echoes it."""
        return OwnTime(self.id)

    def beat(self, name: str = BEAT) -> Beat:
        """The beat of this node, for those who command it: `poll` it at least 20 times a second in
        the loop that obeys them. Made by the first call. `name`: one of beat.py.
        """
        if name not in self._beats:
            key, quality = beat_key(self.id, name), zenoh.CongestionControl.DROP
            publisher = self.session.declare_publisher(
                key, priority=zenoh.Priority.REAL_TIME, express=True, congestion_control=quality
            )
            queryable = self.session.declare_queryable(key, zenoh.handlers.RingChannel(GETS))
            # The token comes last, and before those of what it obeys: who finds those hears it.
            self._beats[name] = self._keep(
                Beat(self.own_time, key, publisher, queryable, self.announce(name))
            )
        return self._beats[name]

    @cached_property
    def _beats(self) -> dict[str, Beat]:
        """Our beats, by name."""
        return {}

    def echoes(self, key: str, matched: Callable[[], bool] = lambda: False) -> Echoes:
        """What commands on `key` return of the beats of those who obey them. `matched` as in
        Echoes. Raises BusError for a wrong key.
        """
        with one_line(f"key {key!r}"):
            zenoh.KeyExpr(key)  # raises ZError; that of the token would name the token
        if (
            name := name_for(key)
        ) not in self._hearings:  # first, so that its tokens are known first
            beating = tokens_of(name)
            call = partial(self._roll_call, beating)
            self._hearings[name] = self._keep(
                Hearing(name, tokens(self.session, beating), self._hear, call)
            )
        holders = tokens(self.session, f"@holozen/*/*/sub/*/*/*/{quoted(key)}", HOLDERS)
        return self._keep(Echoes(key, self._hearings[name], holders, matched))

    def _hear(self, key: str) -> tuple[Any, Any]:
        """A subscription to a beat, and the replies to a query for it."""
        subscriber = self.session.declare_subscriber(key, zenoh.handlers.RingChannel(1))
        return subscriber, self.session.get(
            key, timeout=ASKED, priority=zenoh.Priority.REAL_TIME, express=True
        )

    def _roll_call(self, keys: str, timeout: float) -> None:
        for _ in self.session.liveliness().get(keys, timeout=timeout):
            pass

    @cached_property
    def _hearings(self) -> dict[str, Hearing]:
        """The receivers whose beats our commands return, by the name of these."""
        return {}

    @cached_property
    def _numbers(self) -> dict[str, Numbers]:
        """Numbers our samples on each key."""
        return {}

    def publisher(
        self,
        key: str,
        kind: type[M],
        priority: str = "DATA",
        *,
        block: bool = False,
        wire: str = "",
        dead_man: bool = True,
    ) -> Publisher[M]:
        """A writer of `kind` on `key`. On a full link it waits (`block`), or else drops messages.
        `wire` replaces the node's. `dead_man`: a publisher of commands is listed as a node, so that
        its end stops the robot at once; without, its last command counts as long as that of a
        foreign program. Raises BusError for a wildcard, or a key, priority or wire that does not
        exist, and TypeError for a `kind` that is not the class of a message.
        """
        from holozen.messages import codec

        _check_types(key, kind)
        self.define(kind)
        wire = checked_wire(wire or self.wire)
        make: Callable[..., Publisher[M]] = partial(Publisher, kind, wire, self._queued)
        return self._publish(
            make, key, kind.ROS, codec.encoding(wire, kind), priority, block, dead_man
        )

    def publisher_raw(
        self,
        key: str,
        type_name: str,
        encoding: str,
        priority: str = "DATA",
        *,
        block: bool = False,
        dead_man: bool = True,
    ) -> RawPublisher:
        """A writer of bytes, in that encoding by default; otherwise as `publisher`."""
        return self._publish(RawPublisher, key, type_name, encoding, priority, block, dead_man)

    def _publish(
        self,
        make: Callable[..., P],
        key: str,
        type_name: str,
        encoding: str,
        priority: str,
        block: bool,
        dead_man: bool,
    ) -> P:
        if priority not in PRIORITIES:
            raise BusError(
                f"key {key!r}: no priority {priority!r}; there are {', '.join(PRIORITIES)}"
            )
        commands = wire.is_command(key, (type_name,))
        with one_line(f"key {key!r}"):
            if "*" in str(zenoh.KeyExpr(key)):
                raise BusError(f"key {key!r}: write to one key; a wildcard would reach every robot")
            publisher = self.session.declare_publisher(
                key,
                encoding=encoding,
                priority=getattr(zenoh.Priority, priority),
                express=commands,
                congestion_control=zenoh.CongestionControl.BLOCK
                if block
                else zenoh.CongestionControl.DROP,
            )
        watch = partial(publisher.declare_matching_listener, zenoh.handlers.RingChannel(1))
        sign = partial(self.member.attachment, key, priority) if self.member and commands else None
        echoes = self.echoes(key, partial(is_matched, publisher)) if commands else None
        writer = make(publisher, self.stamps(key), watch, sign, echoes)
        self._answer_gets(writer, key)
        if commands and dead_man:
            self.announce_node()
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
        """A ring for a robot's key, `Fred/cmd_vel`, of what comes on those of all robots,
        `*/cmd_vel`; None for the requests to a key without a robot's name.
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
            dealer = self._dealers[expression, is_queryable] = self._keep(
                Dealer(declared, is_queryable)
            )
        if not is_queryable and key not in self._known:
            # Zenoh looks up its way once for a key that is declared here, and for any other with
            # each sample. It is never undeclared: senders may still use its number.
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
        """Answer with the definition of a type that other processes may not have: one from the
        files of a package.
        """
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
        """A reader of any of `kinds` that keeps the newest `depth`. Payloads over `limit` bytes are
        refused, and in the secure set-up commands without proof. `dealt`: for a WaitSet, which
        reads higher priorities first; the newest `depth` of each are kept, and all robots' keys of
        that name share a subscriber. Raises BusError for a wrong key, and TypeError without
        `kinds`, or for one that is not the class of a message.
        """
        from holozen.messages import codec

        _check_types(key, *kinds or (None,))
        # The token comes first: a sender that has a match knows whose beat to echo.
        token = self.announce("sub", kinds[0].ROS, key)
        ring = self._ring(key, depth) if dealt else None
        raw = (
            self._keep(RawSubscriber(ring, limit))
            if ring
            else self.subscribe_raw(key, depth, limit)
        )
        raw.ends.append(token)
        is_command = wire.is_command(key, (kind.ROS for kind in kinds))
        decode = codec.decoder(kinds, tolerant=not is_command)
        return Subscription(
            raw, decode, self._verifier.refusal if is_command and self._verifier else None
        )

    @cached_property
    def _verifier(self) -> Verifier | None:
        """Checks the proofs of others; None outside the secure set-up."""
        if not self._secure:
            return None
        from holozen.transport.authenticator import authenticator

        return authenticator().verifier(self._secure)

    def latest(self, key: str, kind: type[M]) -> Latest[M]:
        """The newest message on `key`, with its age. Payloads over LARGEST_STATE bytes are
        ignored.
        """
        return Latest(self.state(key, kind))

    def state(self, key: str, kind: type[M]) -> Subscription[M]:
        """A reader of the newest message on `key`, as `latest` has."""
        return self.subscribe(key, kind, depth=1, limit=LARGEST_STATE)

    def serve(
        self,
        key: str,
        request: type[M],
        reply: type[R],
        answer: Callable[[M], R],
        room: int = ROOM,
        shared: bool = False,
        dealt: bool = False,
        stops: bool = False,
    ) -> Server:
        """Answer requests on `key`. The caller runs it: `answer_pending()` in a loop, or `start()`.

        At most `room` requests wait; more are refused as busy. A request on a `shared` key goes to
        all of its servers; those that have no part in it raise Elsewhere. `dealt`: all robots' keys
        of that name share a queryable, which a WaitSet reads. `stops` as in Server. Raises BusError
        for a wrong key, and TypeError for a `request` or a `reply` that is not the class of a
        message.
        """
        _check_types(key, request, reply)
        token = self.announce("srv", reply.ROS, key)
        queryable: Any = self._ring(key, RING, is_queryable=True) if dealt else None
        if not queryable:
            queryable = self.session.declare_queryable(
                key, zenoh.handlers.RingChannel(RING), complete=not shared
            )
        server = self._keep(
            Server(queryable, key, request, reply, answer, self.wire, self.own_time, room, stops)
        )
        server.ends.append(token)
        return server

    def call(self, key: str, request: Message, reply: type[R], timeout: float = 5.0) -> R:
        """Call a service; waits for it to appear and to reply, for at most `timeout` seconds.

        Raises ServiceError with the service's own reason, without a reply, or for a malformed one;
        BusError for a wrong key or `timeout`, and TypeError for a wrong type.
        """
        _check_call(key, request, reply, timeout)
        return services.call(self, key, request, reply, timeout)[0]

    def call_all(self, key: str, request: Message, reply: type[R], timeout: float = 5.0) -> list[R]:
        """As `call`, with the replies of all servers of the key that did not refuse. Raises
        ServiceError if all did.
        """
        _check_call(key, request, reply, timeout)
        return services.call(self, key, request, reply, timeout, everyone=True)


def _of_all(key: str) -> str:
    """The key expression of all robots' keys of that name: `*/odom` for `Fred/odom`, and `odom` for
    `odom`.
    """
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
        raise TypeError(
            f"key {key!r}: the request {shorten(repr(request))} is not a message, such as "
            "TriggerRequest()"
        )
    if not (isinstance(timeout, int | float) and 0 <= timeout <= LONGEST_CALL):
        raise BusError(f"key {key!r}: timeout {timeout!r}: use 0 to {LONGEST_CALL:g} s")
