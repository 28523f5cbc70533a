"""Bytes <-> messages, by the Zenoh Encoding that travels with them."""

from collections.abc import Callable
from functools import lru_cache, partial
from types import ModuleType
from typing import Any, TypeVar

import msgspec

from holozen import arrays
from holozen.cdr import CodecError
from holozen.finite import not_finite
from holozen.messages import Message
from holozen.tell import printable

__all__ = ["WIRES", "CodecError", "convert", "decode", "encode", "encoding", "written"]

M = TypeVar("M", bound=Message)
Makers = tuple[tuple[type[M], Callable[[Any], M]], ...]

WIRES = {"json": "application/json", "msgpack": "application/msgpack", "cdr": "application/cdr"}
"""What `--wire` may name, and the Encoding it writes."""

# Encodings that say nothing of the content; our default is JSON, which is what people put by hand.
_JSON = {"", "zenoh/bytes", "zenoh/string", "text/plain", "text/json", "application/json"}

LONGEST = 200  # characters of a reason

_encode_json = msgspec.json.Encoder(enc_hook=arrays.listed).encode
_encode_msgpack = msgspec.msgpack.Encoder(enc_hook=arrays.listed).encode


def encode(message: Message, wire: str = "json") -> bytes:
    """The bytes of `message`. A NaN or an infinity raises CodecError: JSON would turn it into a null.

    As CDR, a type that takes any number is written with them.
    """
    payload, fine = _write(message, wire)
    if not fine and not (wire == "cdr" and message.ANY_NUMBER) and (bad := not_finite(message)):
        raise CodecError(f"{type(message).__name__}.{bad} is not a finite number")
    return payload


def written(message: Message, wire: str) -> tuple[bytes, str]:
    """The bytes of `message`, and the wire they are for: CDR for one that holds what no other wire has."""
    if not message.ANY_NUMBER or wire == "cdr":
        return encode(message, wire), wire
    payload, fine = _write(message, wire)
    if fine:
        return payload, wire
    try:
        cdr, fine = _structs().write(message)  # sees it sooner than `not_finite`
    except CodecError as error:
        if bad := not_finite(message):
            told = f"{type(message).__name__}.{bad} is not a finite number, which takes CDR"
            raise CodecError(f"{told}, and that cannot hold the rest: {error}") from None
        return payload, wire
    return (payload, wire) if fine else (cdr, "cdr")


def _write(message: Message, wire: str) -> tuple[bytes, bool]:
    """The bytes, and whether all its numbers are finite for certain."""
    try:
        if message.SETTLE:
            message.SETTLE()
        return _WRITERS[wire](message)
    except UnicodeEncodeError as error:
        raise CodecError(f"{type(message).__name__}: a text that is not Unicode: {error.reason}") from None


def encoding(wire: str, kind: type[Message]) -> str:
    """The Encoding of a message. CDR says nothing of itself, so the type goes along, as Zenoh's schema."""
    return f"{WIRES[wire]};{_structs().ros_name(kind)}" if wire == "cdr" else WIRES[wire]


def decode(payload: bytes, encoding: str, types: tuple[type[M], ...]) -> M:
    """The message in `payload`, of the first of `types` that fits. Raises CodecError with the reason."""
    makers: Makers[M] = _decoders(types, encoding, _is_cdr(payload))
    return _first(makers, payload)


def convert(value: Any, types: tuple[type[M], ...]) -> M:
    """`decode` for plain dicts, lists and numbers (what JSON or YAML gave)."""
    makers = tuple((kind, partial(msgspec.convert, type=kind, strict=False)) for kind in types)
    made: M = _first(makers, value)
    return made


def _first(makers: Makers[M], value: Any) -> M:
    reasons = []
    for kind, make in makers:
        try:
            return make(value)
        except CodecError as error:
            reasons.append(_short(str(error)))
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            reasons.append(_told(kind, error))
    # What has a header was meant as the stamped type.
    raise CodecError(next((reason for reason in reasons if "field `header`" not in reason), reasons[0]))


def _told(kind: type[Message], error: Exception) -> str:
    """One line; a field's name in it came over the wire and may be anything."""
    return _short(f"not a {kind.__name__}: {error}")


def _short(text: str) -> str:
    text = printable(text)
    return text if len(text) <= LONGEST else text[:LONGEST] + " ..."


def _write_json(message: Message) -> tuple[bytes, bool]:
    payload = _encode_json(message)
    return payload, b"null" not in payload  # no message has a null of its own, so only one with it needs a look


_WRITERS: dict[str, Callable[[Message], tuple[bytes, bool]]] = {
    "json": _write_json,
    "msgpack": lambda message: (_encode_msgpack(message), False),
    "cdr": lambda message: _structs().write(message),
}


@lru_cache(maxsize=64)
def _decoders(types: tuple[type[M], ...], encoding: str, is_cdr: bool) -> Makers[M]:
    form = _format(encoding, is_cdr)
    if form == "cdr":
        kinds = _named(types, encoding.partition(";")[2])
        return tuple((kind, _structs().codec(kind).read) for kind in kinds)
    module = msgspec.json if form == "json" else msgspec.msgpack
    return tuple((kind, module.Decoder(kind).decode) for kind in types)


def _named(types: tuple[type[M], ...], schema: str) -> tuple[type[M], ...]:
    """Those of `types` that an Encoding's schema names; all of them if it names no type."""
    from holozen.interfaces import InterfaceError
    from holozen.interfaces.registry import full_name

    try:
        said = full_name(schema)
    except InterfaceError:
        return types
    found = tuple(kind for kind in types if _structs().ros_name(kind) == said)
    if not found:
        raise CodecError(_short(f"not a {types[0].__name__}: its encoding says {said}"))
    return found


def _format(encoding: str, is_cdr: bool) -> str:
    """The wire of an Encoding, which may carry a schema after a semicolon."""
    name = encoding.partition(";")[0]
    if name in _JSON:
        # Bridges to ROS 2 write CDR and do not say so; no text begins with a NUL.
        return "cdr" if is_cdr else "json"
    found = next((wire for wire, written in WIRES.items() if written == name), None)
    if found is None:
        raise CodecError(f"encoding {name[:80]!r} is not understood; known: {', '.join(WIRES.values())}")
    return found


def _is_cdr(payload: bytes) -> bool:
    return payload[:1] == b"\0"


def _structs() -> ModuleType:
    """CDR of our messages, loaded when it is first needed."""
    from holozen.cdr import structs

    return structs
