"""A ROS 2 node on DDS, made of PyPI's cyclonedds, which shares no code with ours: types, topics,
services, its place in the ROS graph. Call it after `loopback()`.
"""

import os
import random
from typing import Any

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from holozen.messages.definitions import Field, Interface
from holozen.messages.registry import Registry

LOOPBACK = """<CycloneDDS><Domain id="any">
<General><AllowMulticast>false</AllowMulticast>
<Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""  # noqa: E501
"""Cyclone's configuration, also of the bridge: all traffic on loopback, no multicast."""

PLAIN = {"bool": bool, "string": str}
NUMBERS: dict[str, Any] = PLAIN | {
    "byte": types.uint8,
    "char": types.uint8,
    "int8": types.int8,
    "uint8": types.uint8,
    "int16": types.int16,
    "uint16": types.uint16,
    "int32": types.int32,
    "uint32": types.uint32,
    "int64": types.int64,
    "uint64": types.uint64,
    "float32": types.float32,
    "float64": types.float64,
}
CDR = Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False)
RELIABLE = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(100), CDR)
LATCHED = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)),
    Policy.Durability.TransientLocal,
    Policy.History.KeepLast(1),
    CDR,
)
# what rmw_cyclonedds_cpp puts before each request and reply
CALLER = {"client": types.uint64, "number": types.int64}
ARRAY: Any = types.array
SEQUENCE: Any = types.sequence
GID = ARRAY[types.uint8, 16]  # since Iron

REGISTRY = Registry()
_made: dict[str, Any] = {}


def loopback() -> int:
    """Keep the DDS of this process and of those that it starts on loopback. Returns a domain of a
    test's own.
    """
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
    return random.randint(2, 90)  # above, its ports are ephemeral ones


def hashed(type_hash: str) -> Qos:
    """RELIABLE, with the hash of a type as ROS 2 nodes announce it since Iron."""
    return RELIABLE + Qos(Policy.Userdata(f"typehash={type_hash};".encode()))


def dds_type(name: str) -> Any:
    """The class of a ROS type; of half a service, `std_srvs/srv/Trigger_Request`, with the caller
    before its fields.
    """
    if name not in _made:
        interface = REGISTRY.find(name)
        fields = {field.name: _field(field) for field in interface.fields}
        if not fields:
            fields = {"structure_needs_at_least_one_member": types.uint8}
        is_half = name.endswith(("_Request", "_Response"))
        _made[name] = _struct(name, (CALLER if is_half else {}) | fields)
    return _made[name]


def _struct(name: str, fields: dict[str, Any]) -> type[IdlStruct]:
    package, kind, last = name.split("/")
    return make_idl_struct(last, f"{package}.{kind}.dds_.{last}_", fields)


def _field(field: Field) -> Any:
    one = (
        dds_type(field.nested.name) if isinstance(field.nested, Interface) else NUMBERS[field.type]
    )
    if field.array == "fixed":
        return ARRAY[one, field.bound]
    return SEQUENCE[one] if field.array else one


def default(name: str) -> Any:
    """A message with nothing in it."""
    fields = REGISTRY.find(name).fields
    return dds_type(name)(**{each.name: _default(each) for each in fields})


def _default(field: Field) -> Any:
    if field.array:
        return [0] * field.bound if field.array == "fixed" else []
    return default(field.nested.name) if field.nested else PLAIN.get(field.type, int)()


NODE_ENTITIES: Any = _struct(
    "rmw_dds_common/msg/NodeEntitiesInfo",
    {
        "node_namespace": str,
        "node_name": str,
        "reader_gid_seq": SEQUENCE[GID],
        "writer_gid_seq": SEQUENCE[GID],
    },
)
ENTITIES: Any = _struct(
    "rmw_dds_common/msg/ParticipantEntitiesInfo",
    {"gid": GID, "node_entities_info_seq": SEQUENCE[NODE_ENTITIES]},
)


class Node:
    """A node in a DDS domain, which tells ROS's discovery what it reads and writes."""

    def __init__(self, domain: int, name: str) -> None:
        self._name, self._participant = name, DomainParticipant(domain)
        self._readers: list[Any] = []
        self._writers: list[Any] = []
        topic = Topic(self._participant, "ros_discovery_info", ENTITIES)
        self._graph = DataWriter(self._participant, topic, LATCHED)
        self._calls = 0

    def publisher(self, name: str, kind: str, qos: Qos = RELIABLE) -> Any:
        """A writer of a topic such as "/cmd_vel": `write(message)`."""
        return self._writer(f"rt{name}", kind, qos)

    def subscriber(self, name: str, kind: str, qos: Qos = RELIABLE) -> Any:
        """A reader of a topic: `take(100)`."""
        return self._reader(f"rt{name}", kind, qos)

    def endpoints(self) -> dict[tuple[str, str], tuple[str, bool, bool]]:
        """What the domain has now: ("pub" or "sub", topic) -> type, and whether it is reliable and
        transient local.
        """
        found = {}
        for kind, built_in in (
            ("pub", BuiltinTopicDcpsPublication),
            ("sub", BuiltinTopicDcpsSubscription),
        ):
            for one in BuiltinDataReader(self._participant, built_in).take(1000):
                reliable = isinstance(one.qos[Policy.Reliability], Policy.Reliability.Reliable)
                latched = one.qos[Policy.Durability] == Policy.Durability.TransientLocal
                found[kind, one.topic_name] = one.type_name, reliable, latched
        return found

    def client(self, name: str, kind: str) -> "Client":
        """A client of a service."""
        return Client(
            self._writer(f"rq{name}Request", f"{kind}_Request", RELIABLE),
            self._reader(f"rr{name}Reply", f"{kind}_Response", RELIABLE),
        )

    def server(self, name: str, kind: str) -> tuple[Any, Any]:
        """The reader of a service's requests, and the writer of its replies, which repeat the
        caller.
        """
        reader = self._reader(f"rq{name}Request", f"{kind}_Request", RELIABLE)
        return reader, self._writer(f"rr{name}Reply", f"{kind}_Response", RELIABLE)

    def _writer(self, topic: str, kind: str, qos: Qos) -> Any:
        writer = DataWriter(self._participant, Topic(self._participant, topic, dds_type(kind)), qos)
        self._writers.append(writer)
        self._tell()
        return writer

    def _reader(self, topic: str, kind: str, qos: Qos) -> Any:
        reader = DataReader(self._participant, Topic(self._participant, topic, dds_type(kind)), qos)
        self._readers.append(reader)
        self._tell()
        return reader

    def _tell(self) -> None:
        """The bridge maps nothing that no node claims."""
        gids = [[list(one.guid.bytes) for one in ends] for ends in (self._readers, self._writers)]
        node = NODE_ENTITIES("/", self._name, *gids)
        self._graph.write(ENTITIES(list(self._participant.guid.bytes), [node]))


class Client:
    """Calls a service: `call(field=value)` sends a request, `reply()` reads its reply, or None.
    `sent` is the number of requests.
    """

    def __init__(self, requests: Any, replies: Any) -> None:
        self._requests, self._replies, self.sent = requests, replies, 0

    def call(self, **fields: Any) -> None:
        """Send a request."""
        self.sent += 1
        kind = self._requests.topic.data_type
        values = fields or {"structure_needs_at_least_one_member": 0}
        self._requests.write(kind(client=0x1234, number=self.sent, **values))

    def reply(self, first: int = 0) -> Any:
        """The reply to the last request, or to any from the `first` one on; None before."""
        since = first or self.sent
        return next((one for one in self._replies.take(100) if one.number >= since), None)
