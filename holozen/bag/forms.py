"""How a sample stands in a bag: MCAP's message encoding, and the schema where the type is known.

The payload stays as it came, whatever it is, and so does its Zenoh Encoding (as the channel's metadata).
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import msgspec

from holozen import codec, wire
from holozen.bag.schemas import json_schema, known, msg_schema
from holozen.messages import Message

# Encodings by which JSON travels; the first ones say nothing of the content.
_MAYBE_JSON = {"", "zenoh/bytes", "zenoh/string", "text/plain", "text/json", "application/json"}
_MCAP = {"application/msgpack": "msgpack", "application/cdr": "cdr", "application/protobuf": "protobuf"}


class Form(NamedTuple):
    """What a channel of a bag says of its messages. `schema` is a ROS name, empty if the type is unknown."""

    encoding: str
    zenoh_encoding: str
    schema: str = ""
    schema_encoding: str = ""
    schema_data: bytes = b""


def form_of(payload: bytes, encoding: str, types: tuple[type[Message], ...]) -> tuple[Form, Message | None]:
    """The form of a sample, and its message if it is one of `types`."""
    message = _message(payload, encoding, types)
    mcap = _mcap_encoding(payload, encoding, message)
    return _form(mcap, encoding, type(message) if message is not None else None), message


def as_cdr(message: Message) -> tuple[Form, bytes]:
    """A message as ROS 2 writes it, and its form. Raises CodecError for a number that is not finite."""
    return _form("cdr", codec.encoding("cdr", type(message)), type(message)), codec.encode(message, "cdr")


def types_of(key: str, names: Callable[[], set[str]]) -> tuple[type[Message], ...]:
    """The types that a key may carry: those of the table, else those that its publishers named (`names`)."""
    row = wire.topic(key)
    return row.types if row else tuple(known()[name] for name in sorted(names()) if name in known())


@lru_cache(maxsize=1024)
def _form(mcap: str, encoding: str, kind: type[Message] | None) -> Form:
    if mcap == "json" and kind:
        return Form(mcap, encoding, kind.ROS, "jsonschema", json_schema(kind))
    name = kind.ROS if kind else encoding.partition(";")[2]
    if mcap == "cdr" and (schema := msg_schema(name)):
        return Form(mcap, encoding, name, "ros2msg", schema)
    return Form(mcap, encoding, kind.ROS if kind else "")


def _message(payload: bytes, encoding: str, types: tuple[type[Message], ...]) -> Message | None:
    if not types:
        return None
    try:
        return codec.decode(payload, encoding, types)
    except codec.CodecError:
        return None


def _mcap_encoding(payload: bytes, encoding: str, message: Message | None) -> str:
    name = encoding.partition(";")[0]
    if name in _MAYBE_JSON:
        if message is not None and payload[:1] == b"\0":  # bridges to ROS 2 write CDR and do not say so
            return "cdr"
        return "json" if message is not None or _is_json(payload) else name or "zenoh/bytes"
    return _MCAP.get(name, name)


def _is_json(payload: bytes) -> bool:
    """Whether it is an object or a list in JSON; a lone word or number is a text like any other."""
    if payload[:1] not in (b"{", b"["):
        return False
    try:
        msgspec.json.decode(payload, type=msgspec.Raw)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False
    return True
