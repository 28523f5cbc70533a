"""ROS 2 on Zenoh as rmw_zenoh has it: keys, liveliness tokens, attachments (see design.md of
ros2/rmw_zenoh).

Messages travel on `domain/topic/type/hash`, a service's requests on such a key with the service's
type. Each node and endpoint has a liveliness token. Each sample, request and reply has an
attachment. In a token `%` stands for `/`.
"""

from __future__ import annotations

import hashlib
import math
import re
import struct
import time
from typing import NamedTuple

from holozen.messages.definitions import Interface
from holozen.messages.type_hash import type_hash
from holozen.transport.errors import ServiceError
from holozen.transport.samples import Sample
from holozen.wire import ROS_TOPIC

QOS = "::,10:,:,:,,"  # ROS 2's default: reliable, volatile, the last 10
LATCHED_QOS = ":1:,1:,:,:,,"  # transient local, the last one
PACE = 0.6  # s between two samples that show that their publisher keeps pace
# s; a sample that is faster by more than any before it shows that its sender's clock was set ahead
JUMP = 0.5
KINDS = {"MP": "pub", "MS": "sub", "SS": "srv"}
NO_HASH = "TypeHashNotSupported"  # in the place of hashes in ROS 2 Humble
_CODES = {kind: code for code, kind in KINDS.items()}
_ATTACHMENT = struct.Struct("<qqB16s")
_NUMBER = re.compile(r"[0-9]{1,20}")
_TYPE = re.compile(r"([A-Za-z]\w*)::(msg|srv|action)::dds_::([A-Za-z]\w*)_")


class Endpoint(NamedTuple):
    """A publisher ("pub"), subscriber ("sub") or service ("srv") of a ROS node.

    `topic` has no leading slash; `type` is the ROS name, such as `std_msgs/msg/String`.
    """

    kind: str
    topic: str
    type: str
    hash: str
    node: str = ""
    session: str = ""
    number: int = 0  # within its session
    latched: bool = False


class Form:
    """The keys, tokens and attachments in a domain. `humble`: without the hashes of types."""

    shows_readers = True  # by their tokens

    def __init__(self, domain: int, humble: bool = False) -> None:
        self.domain, self.humble = domain, humble

    @property
    def tokens(self) -> str:
        """Where the liveliness tokens are."""
        return f"@ros2_lv/{self.domain}/**"

    def parse(self, token: str) -> Endpoint | None:
        """The endpoint that a token names; None for that of a node, and for one that is
        malformed.
        """
        parts = token.split("/")
        if (
            len(parts) != 13
            or parts[0] != "@ros2_lv"
            or parts[5] not in KINDS
            or not _NUMBER.fullmatch(parts[4])
        ):
            return None
        _, _, session, _, number, kind, _, space, node, topic, dds, hashed, qos = parts
        found, topic = _TYPE.fullmatch(dds), topic.replace("%", "/").lstrip("/")
        if not found or not ROS_TOPIC.fullmatch(topic):
            return None
        name = f"{space.replace('%', '/')}/{node}".strip("/").replace("//", "/")
        latched = qos.split(":")[1:2] == ["1"]
        return Endpoint(
            KINDS[kind],
            topic,
            "/".join(found.groups()),
            hashed,
            name,
            session,
            int(number),
            latched,
        )

    def key(self, endpoint: Endpoint) -> str:
        """The key of its samples or requests."""
        return f"{self.domain}/{endpoint.topic}/{dds_type(endpoint.type)}/{endpoint.hash}"

    def node_token(self, session: str, number: int, node: str) -> str:
        """The key of a node's liveliness token."""
        return f"@ros2_lv/{self.domain}/{session}/{number}/{number}/NN/%/%/{node}"

    def token(self, endpoint: Endpoint, node_number: int) -> str:
        """The key of its liveliness token; `node_number` is that of its node."""
        place = f"{endpoint.session}/{node_number}/{endpoint.number}/{_CODES[endpoint.kind]}/%/%/{endpoint.node}"  # noqa: E501
        name, qos = _mangled(endpoint.topic), LATCHED_QOS if endpoint.latched else QOS
        return (
            f"@ros2_lv/{self.domain}/{place}/{name}/{dds_type(endpoint.type)}/{endpoint.hash}/{qos}"
        )

    def hash(self, interface: Interface) -> str:
        """The hash of a type, as keys and tokens have it."""
        return NO_HASH if self.humble else type_hash(interface)

    def mismatch(self, theirs: Endpoint, interface: Interface) -> str:
        """Why its samples cannot be read; empty if they can."""
        if theirs.hash == self.hash(interface):
            return ""
        if (theirs.hash == NO_HASH) != self.humble:
            return f"{theirs.node} is {'not ' if self.humble else ''}of ROS 2 Humble; see --humble"
        return f"its {theirs.type} is not the one known here"

    def attachment(self, number: int, gid: bytes) -> bytes | None:
        """The attachment of a sample or a request of ours, with its sequence number and our gid."""
        return Attachment(number, time.time_ns(), gid).packed()

    def answered(self, request: bytes) -> bytes | None:
        """The attachment of a reply, made from that of its request. Raises ServiceError if that is
        malformed.
        """
        stamp = attachment(request)
        if stamp is None:
            raise ServiceError("a request of rmw_zenoh has an attachment of 33 bytes")
        return stamp._replace(sent=time.time_ns()).packed()

    def stamp(self, sample: Sample) -> Attachment | None:
        """When and by whom a sample was sent; None if it does not say so."""
        return attachment(sample.attachment)

    def writer(self, stamp: Attachment) -> str:
        """The session that must have a token for the sample's topic and type; empty, as the key
        states both.
        """
        return ""


def dds_type(name: str) -> str:
    """How a key writes a type: `std_msgs::msg::dds_::String_`."""
    package, kind, last = name.split("/")
    return f"{package}::{kind}::dds_::{last}_"


def _mangled(name: str) -> str:
    return "%" + name.replace("/", "%")


class Attachment(NamedTuple):
    """The attachment of a sample, a request or a reply: its sequence number, when it was sent (ns
    since 1970, by the sender's clock), and the 16 bytes that identify its sender (gid). A reply
    repeats number and gid of its request.
    """

    number: int
    sent: int
    gid: bytes

    def packed(self) -> bytes:
        """Its bytes."""
        return _ATTACHMENT.pack(self.number, self.sent, len(self.gid), self.gid)


def attachment(payload: bytes) -> Attachment | None:
    """The attachment in `payload`; None if it has another form."""
    if len(payload) != _ATTACHMENT.size:
        return None
    number, sent, length, gid = _ATTACHMENT.unpack(payload)
    return Attachment(number, sent, gid) if length == len(gid) else None


def gid(token: str) -> bytes:
    """A gid for the endpoint with this token."""
    return hashlib.sha256(token.encode()).digest()[:16]


class Ages:
    """The ages of one publisher's samples, without a common clock: the fastest sample so far counts
    as new.

    So a sample that waited in a buffer while the link was cut is old; a delay that all samples have
    does not show. The first samples may have waited themselves, so until `kept_pace` their age is
    that by the clocks of both machines.
    What waited arrives at once: a publisher has kept pace when two samples came about as far apart
    as they were sent.
    """

    def __init__(self) -> None:
        self.kept_pace = False
        self._offset = math.inf  # s; the least difference of arrival and sending
        self._last = (-1, 0.0)
        # when the sample was sent and read from which pace is measured
        self._begun: tuple[float, float] | None = None

    def of(self, stamp: Attachment, now: float, clock: float) -> float:
        """The age in s of a sample that is read at `now`, s of our monotonic clock, and `clock`, s
        since 1970. It is as large for one from the future.
        """
        sent = stamp.sent / 1e9
        number, before = self._last
        # their clock was set
        if stamp.number > number and (sent < before or now - sent < self._offset - JUMP):
            self.kept_pace, self._offset, self._begun = False, math.inf, None
        self._last = (stamp.number, sent)
        self._offset = min(self._offset, now - sent)
        if not self.kept_pace:
            self._measure_pace(sent, now)
        return now - sent - self._offset if self.kept_pace else abs(clock - sent)

    def _measure_pace(self, sent: float, now: float) -> None:
        begun_sent, begun_now = self._begun or (sent, now)
        self.kept_pace = (
            sent - begun_sent >= PACE and now - begun_now >= sent - begun_sent - PACE / 4
        )
        if self._begun is None or sent - begun_sent >= PACE:
            self._begun = sent, now
