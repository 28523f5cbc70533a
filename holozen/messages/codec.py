"""Encodes and decodes messages: JSON or CDR, by the Zenoh Encoding that travels with the bytes."""

import threading
from collections.abc import Callable
from functools import lru_cache, partial
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from holozen.console import printable
from holozen.messages import WIRES, CodecError, encoding_of
from holozen.messages.message import Message, listed, not_finite
from holozen.suggest import article, shorten

if TYPE_CHECKING:
    from holozen.messages.definitions import Interface

__all__ = [
    "WIRES",
    "CodecError",
    "convert",
    "decode",
    "decoder",
    "encode",
    "encoding",
    "form",
    "transcoded",
    "writer",
    "written",
]

M = TypeVar("M", bound=Message)
Makers = tuple[tuple[type[M], Callable[[Any], M]], ...]

# Encodings that do not describe the content, or mean JSON, which is what people write by hand.
JSON = {"", "zenoh/bytes", "zenoh/string", "text/plain", "text/json", "application/json"}

MAX_REASON = 200  # characters of a reason
N, U = ord("n"), ord("u")
UNTYPED = (
    "CDR without its Encoding, so of no certain type; what a bridge to ROS 2 sends comes in "
    "by `holozen ros2 --bridge`"
)

_encode_json = msgspec.json.Encoder(enc_hook=listed).encode


def encode(message: Message, wire: str = "json") -> bytes:
    """The bytes of `message`. A NaN or an infinity raises CodecError, as JSON has none.

    CDR has them, and writes them for types with ANY_NUMBER.
    """
    payload, finite = _write(message, wire)
    if not finite and not (wire == "cdr" and message.ANY_NUMBER) and (bad := not_finite(message)):
        raise CodecError(f"{type(message).__name__}.{bad} is not a finite number")
    return payload


def written(message: Message, wire: str) -> tuple[bytes, str]:
    """The bytes of `message`, and their wire: CDR for one with ANY_NUMBER that holds a NaN or an
    infinity.
    """
    if not message.ANY_NUMBER or wire == "cdr":
        return encode(message, wire), wire
    payload, finite = _write(message, wire)
    if finite:
        return payload, wire
    try:
        cdr, finite = _structs().write(message)  # faster than `not_finite`
    except CodecError as error:
        if bad := not_finite(message):
            reason = f"{type(message).__name__}.{bad} is not a finite number, which needs CDR"
            raise CodecError(f"{reason}, and that cannot hold the rest: {error}") from None
        return payload, wire
    return (payload, wire) if finite else (cdr, "cdr")


def writer(kind: type[M], wire: str, checks: bool) -> Callable[[M], tuple[bytes, str | None]]:
    """A function that returns the bytes of a message of `kind`, and their Encoding if it is not
    that of `wire`. If it `checks`, it raises CodecError for a field with a value of another type:
    JSON writes what it is given, and only a reader would find it.
    """
    parse_json = _decoders((kind,), WIRES["json"], "json")[0][1] if checks else None

    def write(message: M) -> tuple[bytes, str | None]:
        payload, used = written(message, wire)
        if parse_json and used == "json":  # CDR's writer checks
            try:
                parse_json(payload)
            except (msgspec.DecodeError, CodecError):  # the long way has the reason
                decode(payload, WIRES[used], (kind,))
        return payload, None if used == wire else encoding(used, type(message))

    def write_json(message: M) -> tuple[bytes, str | None]:
        try:
            payload = _encode_json(message)
            if parse_json:
                parse_json(payload)
        except (UnicodeEncodeError, msgspec.DecodeError, CodecError):
            return write(message)  # the long way has the reason
        # One byte is found ten times faster than four, and most messages have at most one of these,
        # in "angular".
        before, _, after = payload.partition(b"u")
        if (U not in after and before[-1] != N) or not _has_null(payload):
            return payload, None
        return write(message)

    return write_json if wire == "json" and not kind.SETTLE else write


def _write(message: Message, wire: str) -> tuple[bytes, bool]:
    """The bytes, and whether all numbers are certainly finite."""
    try:
        if message.SETTLE:
            message.SETTLE()
        return _WRITERS[wire](message)
    except UnicodeEncodeError as error:
        raise CodecError(
            f"{type(message).__name__}: a text is not Unicode: {error.reason}"
        ) from None


def encoding(wire: str, kind: type[Message]) -> str:
    """The Encoding of a message, see `encoding_of`."""
    return encoding_of(wire, _structs().ros_name(kind) if wire == "cdr" else "")


def decode(payload: bytes, encoding: str, types: tuple[type[M], ...], tolerant: bool = False) -> M:
    """The message in `payload`, of the first of `types` that fits. Raises CodecError with the
    reason.

    Unknown fields are refused, or ignored if `tolerant` (`wire.is_command` has the rule).
    """
    wire = "json" if payload[:1] == b"{" and encoding in JSON else form(payload, encoding)
    makers: Makers[M] = _decoders(types, encoding, wire)
    try:
        return _first(makers, payload)
    except CodecError:
        if not tolerant or wire == "cdr":
            raise
    return _first(tuple((kind, partial(_without_unknown, kind)) for kind in types), payload)


class Encoded(Protocol):
    """A payload and its Encoding."""

    payload: bytes

    @property
    def encoding(self) -> str: ...


def decoder(types: tuple[type[M], ...], tolerant: bool = False) -> Callable[[Encoded], M]:
    """`decode` for these types, faster for the first one in JSON.

    If `tolerant`, an object in JSON is read whatever its Encoding says: to ask takes as long as to
    decode a Twist. If not, CDR without its Encoding is refused.
    """
    first: Callable[[bytes], M] = _decoders(types, "", "json")[0][1]

    def read(sample: Encoded) -> M:
        payload = sample.payload
        if payload[:1] == b"{" if tolerant else sample.encoding in JSON:
            try:
                return first(payload)
            except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, CodecError):
                pass  # the long way has the reason
        if not tolerant and payload[:1] == b"\0" and sample.encoding.partition(";")[0] in JSON:
            raise CodecError(UNTYPED)
        return decode(payload, sample.encoding, types, tolerant)

    return read


def _without_unknown(kind: type[M], payload: bytes) -> M:
    value = msgspec.json.decode(payload)
    known = _known(kind, value)
    # an object with unknown fields alone is another message
    return msgspec.convert(known or value, kind)


def _known(hint: Any, value: Any) -> Any:
    """`value` without the fields that its type, a message or a list of messages, does not have."""
    if isinstance(value, list) and get_origin(hint) is list:
        return [_known(get_args(hint)[0], inner) for inner in value]
    if isinstance(value, dict) and isinstance(hint, type) and issubclass(hint, Message):
        fields = _fields(hint)
        return {
            name: _known(fields[name], inner) for name, inner in value.items() if name in fields
        }
    return value


@lru_cache(maxsize=256)
def _fields(kind: type[Message]) -> dict[str, Any]:
    return {
        name: hint for name, hint in get_type_hints(kind).items() if name in kind.__struct_fields__
    }


def convert(value: Any, types: tuple[type[M], ...], strict: bool = False) -> M:
    """`decode` for the dicts, lists and numbers of parsed JSON or YAML. Unknown fields are refused;
    if `strict`, so are texts in place of numbers.
    """
    _decoders(types, "", "json")  # prepares the types
    makers = tuple((kind, partial(msgspec.convert, type=kind, strict=strict)) for kind in types)
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
            reasons.append(_short(f"not {article(kind.__name__)}: {error}"))
    # A message with a header was meant as the stamped type.
    raise CodecError(
        next((reason for reason in reasons if "field `header`" not in reason), reasons[0])
    )


def _short(text: str) -> str:
    """One line: a field's name in it came over the wire and may be anything."""
    return shorten(printable(text), MAX_REASON)


def _write_json(message: Message) -> tuple[bytes, bool]:
    payload = _encode_json(message)
    return payload, not _has_null(payload)


def _has_null(payload: bytes) -> bool:
    """Whether JSON may hold a NaN or an infinity, which msgspec writes as null; no message has one
    otherwise.
    """
    return b"null" in payload


_WRITERS: dict[str, Callable[[Message], tuple[bytes, bool]]] = {
    "json": _write_json,
    "cdr": lambda message: _structs().write(message),
}


_preparing = threading.Lock()
"""msgspec crashes where two threads prepare the first decoder of a type at once."""


@lru_cache(maxsize=64)
def _decoders(types: tuple[type[M], ...], encoding: str, form: str) -> Makers[M]:
    if form == "cdr":
        kinds = _named(types, encoding.partition(";")[2])
        return tuple((kind, _structs().codec(kind).read) for kind in kinds)
    with _preparing:
        return tuple((kind, msgspec.json.Decoder(kind).decode) for kind in types)


def _named(types: tuple[type[M], ...], schema: str) -> tuple[type[M], ...]:
    """Those of `types` that an Encoding's schema names; all if it names none."""
    from holozen.messages.definitions import InterfaceError
    from holozen.messages.registry import full_name

    try:
        name = full_name(schema)
    except InterfaceError:
        return types
    found = tuple(kind for kind in types if _structs().ros_name(kind) == name)
    if not found:
        raise CodecError(_short(f"not {article(types[0].__name__)}: its encoding names {name}"))
    return found


def form(payload: bytes, encoding: str) -> str:
    """The wire of a payload: "json" or "cdr". Raises CodecError for any other Encoding."""
    name = encoding.partition(";")[0]  # a schema may follow
    if name in JSON:
        # Bridges to ROS 2 write CDR without an Encoding; no text begins with a NUL.
        return "cdr" if payload[:1] == b"\0" else "json"
    found = next((wire for wire, written in WIRES.items() if written == name), None)
    if found is None:
        raise CodecError(f"unknown encoding {name[:80]!r}; known: {', '.join(WIRES.values())}")
    return found


def transcoded(interface: "Interface", payload: bytes, encoding: str) -> bytes:
    """A message in JSON or CDR, in CDR. Raises CodecError."""
    from holozen.messages import cdr

    wire = form(payload, encoding)
    if wire == "cdr":
        cdr.read(interface, payload)
        return payload
    try:
        value: Any = msgspec.json.decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise CodecError(_short(str(error))) from None
    return cdr.write(interface, value)


def _structs() -> ModuleType:
    """CDR of our messages, loaded on first use: it takes 18 ms."""
    from holozen.messages import struct_cdr

    return struct_cdr
