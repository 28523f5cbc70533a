"""Values as people read them: the layout of `ros2 topic echo`."""

from holozen import plain_json

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

LONGEST = 128  # values of a list on one line


class Hex(str):
    """The hex dump of bytes that could not be decoded."""

    __slots__ = ()


def strict(value: "Any") -> "Any":
    """A value as JSON has it: numbers that are not finite are texts, such as "NaN"."""
    if isinstance(value, float) and value - value != 0:
        return {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}[repr(value)]
    if isinstance(value, dict):
        return {name: strict(inner) for name, inner in value.items()}
    return [strict(inner) for inner in value] if isinstance(value, list) else value


def decode(payload: bytes, encoding: str) -> "Any":
    """The plain value in a payload: JSON or msgpack as values, other text as text, else a hex dump's text."""
    name = encoding.partition(";")[0]
    if name == "application/msgpack":
        import msgspec

        try:
            return _plain(msgspec.msgpack.decode(payload))
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return hex_dump(payload, encoding)
    try:
        text = payload.decode()
    except UnicodeDecodeError:
        return hex_dump(payload, encoding)
    if "\0" in text:  # no text has one; small numbers in binary do
        return hex_dump(payload, encoding)
    try:
        return plain_json.loads(text)
    except (ValueError, RecursionError):
        return text


def lines(value: "Any", indent: str = "", longest: int | None = None) -> list[str]:
    """`value` as indented lines of `name: value`; on one line if it is nested too deeply for that.

    A list on one line shows at most `longest` values; 0 means all, None the default.
    """
    try:
        return _lines(value, indent, LONGEST if longest is None else longest)
    except RecursionError:
        return [_json(value)]


def _lines(value: "Any", indent: str, longest: int) -> list[str]:
    if isinstance(value, dict):
        rows = [line for name, inner in value.items() for line in _named(name, inner, indent, longest)]
        return rows or [f"{indent}{{}}"]
    if isinstance(value, list) and not _is_flat(value):
        rows = []
        for inner in value:
            first, *rest = _lines(inner, indent + "  ", longest)
            rows += [f"{indent}- {first.strip()}", *rest]
        return rows
    return [f"{indent}{_scalar(value, longest)}"]


def _named(name: str, value: "Any", indent: str, longest: int) -> list[str]:
    if isinstance(value, dict | list) and value and not _is_flat(value):
        return [f"{indent}{_scalar(name)}:", *_lines(value, indent + "  ", longest)]
    return [f"{indent}{_scalar(name)}: {_scalar(value, longest)}"]


def _is_flat(value: "Any") -> bool:
    return isinstance(value, list) and not set(map(type, value)) & {dict, list}


def _scalar(value: "Any", longest: int = 0) -> str:
    if type(value) is int or (type(value) is float and value - value == 0):
        return repr(value)  # what json writes too, but sooner
    if isinstance(value, list):
        kept = value[:longest] if longest else value
        shown = ", ".join(map(_scalar, kept)) if str in map(type, kept) else _numbers(kept)
        return f"[{shown}{f', ... {len(value) - len(kept)} more' if len(kept) < len(value) else ''}]"
    if isinstance(value, str):
        return value if value.isprintable() and value else _json(value)
    return _json(value)


def _numbers(values: "list[Any]") -> str:
    text = repr(values)[1:-1]
    # Python writes them as JSON does, but for None, nan and inf, True and False.
    return _json(values)[1:-1] if any(letter in text for letter in "nTF") else text


def _json(value: "Any") -> str:
    import json  # not sooner: it takes 3 ms, and most messages are of numbers and names

    return json.dumps(value)


def _plain(value: "Any") -> "Any":
    """`value` with bytes, times and keys that JSON does not know as text."""
    if isinstance(value, dict):
        return {key if isinstance(key, str) else str(_plain(key)): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, bytes):
        return value.hex(" ")
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def hex_dump(payload: bytes, encoding: str) -> Hex:
    """The size, the encoding and the first bytes of a payload."""
    start = payload[:32].hex(" ")
    return Hex(f"{len(payload)} bytes of {encoding}: {start}{' ...' if len(payload) > 32 else ''}")
