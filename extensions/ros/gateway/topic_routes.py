"""Forwards samples between our topics and those of ROS 2."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from functools import partial
from itertools import count
from typing import Any

from holozen import wire
from holozen.messages import CodecError, cdr, codec
from holozen.messages.definitions import InterfaceError
from holozen.ros.gateway import rmw_zenoh as rmw
from holozen.ros.gateway.sides import MANY, NODES, Ends, Sides, quietly
from holozen.transport import graph as graphs
from holozen.transport.samples import Numbers, Sample, stamps
from holozen.transport.session import is_matched

JITTER = 0.1  # s; the time under way that counts as none: what several nodes send stays in order
UNDER_WAY = f"a command was under way for more than {wire.MAX_COMMAND_AGE:g} s"
UNKNOWN_AGE = (
    f"a first command has a time of sending more than {wire.MAX_COMMAND_AGE:g} s from this "
    "machine's clock; it is late,"
    f" or the clocks differ: set them, or go on publishing, and after {rmw.PACE:g} s commands are "
    "forwarded"
)
SHARED = ("tf", "tf_static")  # topics with several publishers by nature


class _AgesOfWriters:
    """By gid: the ages of the samples of a writer, and its stamps, which `stamped` makes."""

    def __init__(self, stamped: Callable[[bytes], Callable[..., bytes]]) -> None:
        self._stamped = stamped
        self._known: dict[bytes, tuple[rmw.Ages, Callable[..., bytes]]] = {}

    def of(self, gid: bytes) -> tuple[rmw.Ages, Callable[..., bytes]]:
        """Those of one writer."""
        if gid not in self._known:
            if len(self._known) == MANY:
                self._known.clear()
            self._known[gid] = rmw.Ages(), self._stamped(gid)
        return self._known[gid]


class TopicRoutes:
    """What has to be forwarded of topics, in either direction."""

    def __init__(self, sides: Sides) -> None:
        self._sides = sides

    def wanted(self, ours: list[graphs.Endpoint]) -> dict[Any, Callable[[], Ends]]:
        """What has to be forwarded, with a function that begins it."""
        wanted: dict[Any, Callable[[], Ends]] = {}
        read = {
            (one.topic, one.type)
            for one in self._sides.theirs.values()
            if one.kind == "sub" and self._sides.is_known(one)
        }
        writers: dict[str, list[graphs.Endpoint]] = {}
        for one in ours:
            if one.kind == "pub":
                writers.setdefault(one.key, []).append(one)
        for one in ours:
            found = self._sides.exported(one) if one.kind == "pub" else None
            if found and (found.latched or (found.topic, found.type) in read):
                # A latched message may have been put before this session knew its publisher: each
                # new one is asked.
                asked = tuple(writers[found.topic]) if found.latched else ()
                wanted["out", found.topic, found.type, asked] = partial(
                    self._carry_out, found, asked
                )
        for theirs in self._sides.theirs.values():
            if (
                theirs.kind == "pub"
                and graphs.on_key(ours, theirs.topic, "sub")
                and self._may_enter(theirs, ours)
            ):
                wanted["in", theirs.topic, theirs.type] = partial(self._carry_in, theirs)
        return wanted

    def _carry_out(self, found: rmw.Endpoint, asked: Iterable[graphs.Endpoint]) -> Ends:
        """Our samples, in CDR, to ROS 2; first the last messages of the publishers that are
        `asked`.
        """
        interface = self._sides.registry.find(found.type)
        publisher, put_bytes = self.publisher(found)

        def put(sample: Sample) -> None:
            try:
                payload = codec.transcoded(interface, sample.payload, sample.encoding)
            except (CodecError, InterfaceError) as error:
                self._sides.refuse(found.topic, str(error))
                return
            put_bytes(payload)

        ends = [
            self._sides.reader(self._sides.bus.session, found.topic, put),
            quietly(publisher.undeclare),
        ]
        for sample in self._sides.bus.last_messages(asked):
            put(sample)
        return ends

    def publisher(self, found: rmw.Endpoint) -> tuple[Any, Callable[[bytes], None]]:
        """A publisher on ROS 2's side, and a function that puts bytes of CDR with it."""
        session, numbers = self._sides.there, count(1)
        key, gid = self._sides.form.key(found), rmw.gid(self._sides.form.token(found, 0))
        if found.latched:
            from zenoh.ext import CacheConfig, declare_advanced_publisher

            cache = CacheConfig(max_samples=1)
            publisher: Any = declare_advanced_publisher(
                session, key, cache=cache, publisher_detection=True
            )
        else:
            publisher = session.declare_publisher(key)

        def put(payload: bytes) -> None:
            attachment = self._sides.form.attachment(next(numbers), gid)
            publisher.put(payload, encoding="application/cdr", attachment=attachment)

        return publisher, put

    def _carry_in(self, theirs: rmw.Endpoint) -> Ends:
        """Samples of ROS 2 to our side, with a stamp of this session and the priority of plain
        data.

        A command also gets our echo of the robot's beat, less the time for which it was under way.
        One that waited in a buffer on its way here is dropped.
        """
        key, encoding = theirs.topic, f"application/cdr;{theirs.type}"
        is_command = wire.is_command(key, (theirs.type,))
        publisher = self._sides.bus.session.declare_publisher(
            key, encoding=encoding, express=is_command
        )
        numbers = Numbers()
        ages = _AgesOfWriters(
            lambda gid: stamps(self._source(theirs, gid), self._sides.bus.id, numbers)
        )
        matched = partial(is_matched, publisher)
        echoes = self._sides.bus.echoes(key, matched) if is_command else None
        if echoes:
            echoes.settle()

        def put(sample: Sample) -> None:
            stamp = self._sides.form.stamp(sample)
            if stamp is None:
                self._sides.refuse(
                    key, "a sample does not state when it was sent, as all of ROS 2 do"
                )
                return
            writer = self._sides.form.writer(stamp)
            if writer and (writer, key, theirs.type) not in self._sides.writers:
                self._sides.refuse(
                    key,
                    f"a sample came from {writer[:6]}, which announces no publisher of "
                    f"{theirs.type}",
                )
                return
            measured, stamped = ages.of(stamp.gid)
            if not echoes:
                publisher.put(sample.payload, attachment=stamped())
                return
            age = measured.of(stamp, time.monotonic(), time.time())
            if not self._stops(theirs.type, sample.payload):
                if age > wire.MAX_COMMAND_AGE:
                    self._sides.refuse(key, UNDER_WAY if measured.kept_pace else UNKNOWN_AGE)
                    return
                if not echoes.may_command():
                    return
            # Within JITTER all count as sent in the order in which they came here.
            echoed = echoes.attached(age if age > JITTER else 0.0)
            publisher.put(sample.payload, attachment=stamped(echoed))

        ends: Ends = [
            self._sides.reader(self._sides.there, self._sides.form.key(theirs), put),
            quietly(publisher.undeclare),
        ]
        return [*ends, *([quietly(echoes.close)] if echoes else [])]

    def _stops(self, type_name: str, payload: bytes) -> bool:
        """Whether a command is a velocity of zero, which is forwarded at any age."""
        if type_name not in wire.VELOCITIES:
            return False
        try:
            value = cdr.read(self._sides.registry.find(type_name), payload)
        except CodecError:
            return False
        twist = value.get("twist", value)
        return not any(number for part in ("linear", "angular") for number in twist[part].values())

    def _source(self, theirs: rmw.Endpoint, gid: bytes) -> str:
        """The name of a publisher on our side: that of its node, if no other publishes the
        topic.
        """
        nodes = {
            one.node
            for one in self._sides.theirs.copy().values()
            if one.kind == "pub" and one.topic == theirs.topic
        }
        return NODES + (nodes.pop() if len(nodes) == 1 else gid[:4].hex())

    def _may_enter(self, theirs: rmw.Endpoint, ours: list[graphs.Endpoint]) -> bool:
        """Whether samples of theirs may be forwarded to our side. What a robot reports has one
        publisher.
        """
        interface = self._sides.interface(theirs.type)
        if not interface:
            return self._sides.refuse(theirs.topic, f"its type {theirs.type} is not known here")
        if why := self._sides.form.mismatch(theirs, interface):
            return self._sides.refuse(theirs.topic, why)
        row = wire.topic(theirs.topic)
        writers = graphs.on_key(ours, theirs.topic, "pub")
        if row and not row.is_command and row.key not in SHARED and writers:
            return self._sides.refuse(
                theirs.topic, f"{writers[0].node} publishes {theirs.topic} here"
            )
        return True
