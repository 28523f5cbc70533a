"""Bytes <-> messages, by the Zenoh Encoding that travels with them."""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, TypeVar

import msgspec

from holozen.messages import Message, not_finite
from holozen.tell import printable

M = TypeVar("M", bound=Message)

WIRES = {"json": "application/json", "msgpack": "application/msgpack"}
"""What `--wire` may name, and the Encoding it writes."""

# Encodings that say nothing of the content; our default is JSON, which is what people put by hand.
_JSON = {"", "zenoh/bytes", "zenoh/string", "text/plain", "text/json", "application/json"}

LONGEST = 200  # characters of a reason

_encode_json = msgspec.json.Encoder().encode
_encode_msgpack = msgspec.msgpack.Encoder().encode


class CodecError(ValueError):
    """Bytes that are no such message, or a message that has no bytes. The text is one line."""


def encode(message: Message, wire: str = "json") -> bytes:
    """The bytes of `message`. A NaN or an infinity raises CodecError: JSON would turn it into a null."""
    try:
        payload = _encode_json(message) if wire == "json" else _encode_msgpack(message)
    except UnicodeEncodeError as error:
        raise CodecError(f"{type(message).__name__}: a text that is not Unicode: {error.reason}") from None
    # No message has a null of its own, so only a payload with one needs the slow look.
    if (wire != "json" or b"null" in payload) and (bad := not_finite(message)):
        raise CodecError(f"{type(message).__name__}.{bad} is not a finite number")
    return payload


def decode(payload: bytes, encoding: str, types: tuple[type[M], ...]) -> M:
    """The message in `payload`, of the first of `types` that fits. Raises CodecError with the reason."""
    return _first(types, _decoders(types, encoding), payload)


def convert(value: Any, types: tuple[type[M], ...]) -> M:
    """`decode` for plain dicts, lists and numbers (what JSON or YAML gave)."""
    return _first(types, tuple(partial(msgspec.convert, type=kind, strict=False) for kind in types), value)


def _first(types: tuple[type[M], ...], makers: tuple[Callable[[Any], M], ...], value: Any) -> M:
    reasons = []
    for kind, make in zip(types, makers, strict=True):
        try:
            return make(value)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            reasons.append(_told(kind, error))
    # What has a header was meant as the stamped type.
    raise CodecError(next((reason for reason in reasons if "field `header`" not in reason), reasons[0]))


def _told(kind: type[Message], error: Exception) -> str:
    """One line; a field's name in it came over the wire and may be anything."""
    text = printable(str(error))
    return f"not a {kind.__name__}: {text if len(text) <= LONGEST else text[:LONGEST] + ' ...'}"


@lru_cache(maxsize=64)
def _decoders(types: tuple[type[M], ...], encoding: str) -> tuple[Callable[[bytes], M], ...]:
    module = msgspec.json if _format(encoding) == "json" else msgspec.msgpack
    return tuple(module.Decoder(kind).decode for kind in types)


def _format(encoding: str) -> str:
    """`json` or `msgpack`. An Encoding may carry a schema after a semicolon."""
    name = encoding.partition(";")[0]
    if name in _JSON:
        return "json"
    if name == WIRES["msgpack"]:
        return "msgpack"
    raise CodecError(f"encoding {name[:80]!r} is not understood; known: {', '.join(WIRES.values())}")
