"""How messages are stored in a bag: MCAP's message encoding, and a schema where the type is known.

Payloads stay as they arrived, and so does their Zenoh Encoding, in the channel's metadata. Viewers
(Foxglove, Lichtblick) and ROS 2 choose what to draw by the schema's name, which is the ROS name:
`nav_msgs/msg/Odometry`. Their readers of JSON schemas do not resolve `$ref`, so nested types are
written out. For CDR the schema is the text of the .msg files, one after another.
"""

import json
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any, NamedTuple

import msgspec

from holozen import wire
from holozen.bags import ZENOH
from holozen.messages import Message, codec, encoding_of
from holozen.messages.definitions import MAPPED, Interface, InterfaceError, whole_text
from holozen.messages.registry import Registry
from holozen.transport.graph import is_latched

_MCAP = {encoding: name for name, encoding in ZENOH.items()}
_FOREVER = {"sec": 9223372036, "nsec": 854775807}
_JSON_TYPES = {
    "bool": "boolean",
    "string": "string",
    "wstring": "string",
    "float32": "number",
    "float64": "number",
}

REGISTRY = Registry()
"""The known types; `learn` adds one."""


class Format(NamedTuple):
    """The description of a channel in a bag. `schema` is a ROS name, empty if the type is
    unknown.
    """

    encoding: str
    zenoh_encoding: str
    schema: str = ""
    schema_encoding: str = ""
    schema_data: bytes = b""


def format_of(
    payload: bytes, encoding: str, types: tuple[type[Message], ...]
) -> tuple[Format, Message | None]:
    """The format of a sample, and its message if it is one of `types`."""
    message = _message(payload, encoding, types)
    mcap = _mcap_encoding(payload, encoding, message)
    return _format(mcap, encoding, type(message) if message is not None else None), message


def as_cdr(message: Message) -> tuple[Format, bytes]:
    """A message as ROS 2 writes it, and its format. Raises CodecError for a number that is not
    finite.
    """
    return _format("cdr", codec.encoding("cdr", type(message)), type(message)), codec.encode(
        message, "cdr"
    )


def offered_qos(topic: str) -> str:
    """The QoS profiles of a topic's publishers, as YAML; empty for ROS 2's default.

    The numbers are those of rmw: keep last, reliable, transient local, automatic liveliness.
    """
    if not is_latched(topic):
        return ""
    profile = {
        "history": 1,
        "depth": 1,
        "reliability": 1,
        "durability": 1,
        "deadline": _FOREVER,
        "lifespan": _FOREVER,
        "liveliness": 1,
        "liveliness_lease_duration": _FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    return json.dumps([profile])


def interface_as_cdr(name: str, payload: bytes, encoding: str) -> tuple[Format, bytes]:
    """A message of a type without a Struct as ROS 2 writes it, and its format. Raises CodecError,
    InterfaceError.
    """
    form = Format("cdr", encoding_of("cdr", name), name, "ros2msg", msg_schema(name))
    return form, codec.transcoded(REGISTRY.find(name), payload, encoding)


def types_of(key: str, names: Callable[[], set[str]]) -> tuple[type[Message], ...]:
    """The types that a key may carry: those of the wire's table, else those that its publishers
    announce (`names`).
    """
    row = wire.topic(key)
    return row.types if row else tuple(known()[name] for name in sorted(names()) if name in known())


@lru_cache(maxsize=1024)
def _format(mcap: str, encoding: str, kind: type[Message] | None) -> Format:
    if mcap == "json" and kind:
        return Format(mcap, encoding, kind.ROS, "jsonschema", json_schema(kind.ROS))
    name = kind.ROS if kind else encoding.partition(";")[2]
    if mcap == "cdr" and (schema := msg_schema(name)):
        return Format(mcap, encoding, name, "ros2msg", schema)
    return Format(mcap, encoding, kind.ROS if kind else "")


def _message(payload: bytes, encoding: str, types: tuple[type[Message], ...]) -> Message | None:
    if not types:
        return None
    try:
        return codec.decode(
            payload, encoding, types, tolerant=not wire.is_command("", (kind.ROS for kind in types))
        )
    except codec.CodecError:
        return None


def _mcap_encoding(payload: bytes, encoding: str, message: Message | None) -> str:
    name = encoding.partition(";")[0]
    if name in codec.JSON:
        # bridges to ROS 2 write CDR without an Encoding
        if message is not None and payload[:1] == b"\0":
            return "cdr"
        return "json" if message is not None or _is_json(payload) else name or "zenoh/bytes"
    return _MCAP.get(name, name)


def _is_json(payload: bytes) -> bool:
    """Whether it is an object or a list in JSON; a single word or number counts as text."""
    if payload[:1] not in (b"{", b"["):
        return False
    try:
        msgspec.json.decode(payload, type=msgspec.Raw)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False
    return True


@cache
def known() -> dict[str, type[Message]]:
    """The messages that travel on topics, by their ROS names."""
    return {
        name: kind
        for row in wire.TOPICS
        for name, kind in zip(row.type_names, row.types, strict=True)
    }


@lru_cache(maxsize=1024)
def msg_schema(name: str) -> bytes:
    """The definitions of a ROS type and of the types nested in it; empty for an unknown type."""
    try:
        return whole_text(REGISTRY.find(name)).encode()
    except InterfaceError:
        return b""


@cache
def json_schema(name: str) -> bytes:
    """The JSON schema of a ROS type; empty for an unknown type."""
    try:
        return json.dumps({"title": name, **_object(REGISTRY.find(name))}).encode()
    except InterfaceError:
        return b""


def _object(interface: Interface) -> dict[str, Any]:
    properties: dict[str, Any] = {}
    for field in interface.fields:
        one = (
            _object(field.nested)
            if field.nested
            else {"type": _JSON_TYPES.get(field.type, "integer")}
        )
        properties[field.name] = {"type": "array", "items": one} if field.array else one
        if field.type == MAPPED:
            # viewers expect properties here too
            properties[field.name] = {"type": "object", "properties": {}}
    return {"type": "object", "properties": properties}
