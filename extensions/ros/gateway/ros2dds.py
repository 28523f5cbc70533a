"""ROS 2 on Zenoh as zenoh-bridge-ros2dds has it: keys as ours, CDR without an Encoding, liveliness
tokens.

Each bridge has a token for whatever its ROS nodes read, write and serve, and makes a DDS endpoint
for each token of another bridge; an action has one token for all its parts. In a token § stands for
/. Samples state neither type nor sender: a token states the type, and Zenoh's timestamp the
bridge's session (zenoh-plugin-ros2dds 1.x, liveliness_mgt.rs).
"""

import re

from holozen.messages.definitions import Interface
from holozen.messages.type_hash import type_hash
from holozen.ros.gateway.rmw_zenoh import KINDS, Attachment, Endpoint
from holozen.transport.actions import BELOW, FEEDBACK, SEND, key_of
from holozen.transport.samples import Sample
from holozen.wire import ROS_TOPIC

QOS = ":1:0:0,10"  # no key; reliable, volatile, the last 10
LATCHED_QOS = ":1:1:0,1"  # transient local, the last one
_TYPE = re.compile(r"[A-Za-z]\w*/(msg|srv|action)/[A-Za-z]\w*")
_HASH = re.compile(r"typehash=(RIHS\d+_[0-9a-f]+)")
ACTION_SERVER, ACTION_CLIENT = "AS", "AC"
_LENGTHS = {"MP": 7, "MS": 7, "SS": 6, ACTION_CLIENT: 6}  # chunks of the tokens that are read
_CODES = {kind: code for code, kind in KINDS.items()}


class Form:
    """The keys and tokens on a network of bridges."""

    tokens = "@/*/@ros2_lv/**"
    # a bridge passes on our subscription only if there is a real one besides its token
    shows_readers = False

    def parse(self, token: str) -> Endpoint | None:
        """The endpoint that a token names; None for another kind, and for one that is malformed."""
        parts = token.split("/")
        start, code = parts[:3:2], "".join(parts[3:4])
        if start != ["@", "@ros2_lv"] or code not in _LENGTHS or len(parts) != _LENGTHS[code]:
            return None
        topic, type_name, qos = (part.replace("§", "/") for part in [*parts[4:], ""][:3])
        if not ROS_TOPIC.fullmatch(topic) or not _TYPE.fullmatch(type_name):
            return None
        found = _HASH.search(qos)
        hashed, latched = found[1] if found else "", qos.split(":")[2:3] == ["1"]
        node = f"bridge_{parts[1][:6]}"
        if code == ACTION_CLIENT:  # it reads the feedback
            return Endpoint(
                "sub", key_of(topic, FEEDBACK), f"{type_name}_FeedbackMessage", "", node, parts[1]
            )
        return Endpoint(KINDS[code], topic, type_name, hashed, node, parts[1], latched=latched)

    def key(self, endpoint: Endpoint) -> str:
        """The key of its samples or requests."""
        return endpoint.topic

    def node_token(self, session: str, number: int, node: str) -> str:
        """Empty: nodes have no token, and ROS 2 sees the bridge's."""
        return ""

    def token(self, endpoint: Endpoint, node_number: int) -> str:
        """The key of its liveliness token; empty for a part of an action whose token another part
        has.
        """
        code, topic, type_name = _CODES[endpoint.kind], endpoint.topic, endpoint.type
        if BELOW in topic:
            code, type_name = ACTION_SERVER, type_name.removesuffix("_SendGoal")
            topic, _, part = topic.partition(BELOW)
            if part != SEND:
                return ""
        start = f"@/{endpoint.session}/@ros2_lv/{code}"
        names = "/".join(name.replace("/", "§") for name in (topic, type_name))
        if endpoint.kind == "srv":
            return f"{start}/{names}"
        return (
            f"{start}/{names}/{LATCHED_QOS if endpoint.latched else QOS}:typehash={endpoint.hash};"
        )

    def hash(self, interface: Interface) -> str:
        """The hash of a type, as tokens have it."""
        return type_hash(interface)

    def mismatch(self, theirs: Endpoint, interface: Interface) -> str:
        """Why its type is not the one known here; empty if it is. ROS 2 Humble states no hash."""
        return (
            ""
            if theirs.hash in ("", self.hash(interface))
            else f"its {theirs.type} is not the one known here"
        )

    def attachment(self, number: int, gid: bytes) -> bytes | None:
        """None: samples and requests have no attachment."""
        return None

    def answered(self, request: bytes) -> bytes | None:
        """None: replies have no attachment."""
        return None

    def stamp(self, sample: Sample) -> Attachment | None:
        """When a bridge sent a sample; its gid is the bridge's session. None without a
        timestamp.
        """
        return sample.timestamp and Attachment(0, sample.timestamp[0], sample.timestamp[1].encode())

    def writer(self, stamp: Attachment) -> str:
        """The session that must have a token for the sample's topic and type."""
        return stamp.gid.decode()
