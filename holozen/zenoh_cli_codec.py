"""The decoder `holozen` of PyPI's zenoh-cli: one readable line for JSON and CDR alike.

    zenoh subscribe -k odom --decoder holozen

zenoh-cli passes the key and the payload to a decoder, but not the Encoding, so the first byte of
the payload decides. CDR does not contain its type, which is known for the keys of `holozen.wire`.
"""

import json
from typing import Any

MAX_ITEMS = 12  # of a list that are shown
START = 32  # bytes of an unreadable payload that are shown
MAX_DEPTH = 20


def decode(key: object, payload: bytes) -> str:
    """The content of `payload` on one line. Never fails: zenoh-cli would print a traceback."""
    from holozen.console import printable

    try:
        return printable(_line(_value(str(key), payload)))
    except (ValueError, TypeError, RecursionError, MemoryError):
        more = " ..." if len(payload) > START else ""
        return f"{len(payload)} bytes: {payload[:START].hex(' ')}{more}"


def _value(key: str, payload: bytes) -> Any:
    """The content as plain values. Raises ValueError."""
    if payload[:1] == b"\0":
        return _cdr(key, payload)
    text = payload.decode()
    try:
        return json.loads(text)
    except ValueError:
        return text


def _cdr(key: str, payload: bytes) -> Any:
    import msgspec

    from holozen import wire
    from holozen.messages import codec

    topic, service = wire.topic(key), wire.service(key)
    types = topic.types if topic else (service.reply,) if service else ()
    if not types:
        raise ValueError(f"CDR of an unknown type on {key}")
    return msgspec.to_builtins(codec.decode(payload, codec.WIRES["cdr"], types))


def _line(value: Any) -> str:
    return (
        " ".join(_parts(value, "")) if isinstance(value, dict | list) and value else _scalar(value)
    )


def _parts(value: Any, name: str, depth: int = 0) -> list[str]:
    """`name=value` of all fields; ROS times and vectors are one value each."""
    if depth > MAX_DEPTH:
        raise RecursionError
    if isinstance(value, dict) and set(value) == {"sec", "nanosec"}:
        return [f"{name}={value['sec']}.{value['nanosec']:09d}"]
    if isinstance(value, dict) and list(value) in (["x", "y", "z"], ["x", "y", "z", "w"]):
        return [f"{name}=({', '.join(map(_scalar, value.values()))})"]
    if isinstance(value, dict) and value:
        rows = [
            _parts(inner, f"{name}.{field}" if name else str(field), depth + 1)
            for field, inner in value.items()
        ]
        return [part for row in rows for part in row]
    if isinstance(value, list) and any(isinstance(inner, dict | list) for inner in value):
        rows = [
            _parts(inner, f"{name}[{index}]", depth + 1)
            for index, inner in enumerate(value[:MAX_ITEMS])
        ]
        return [part for row in rows for part in row] + _rest(name, value)
    return [f"{name}={_scalar(value)}"]


def _rest(name: str, values: list[Any]) -> list[str]:
    return [f"{name}[...{len(values) - MAX_ITEMS} more]"] if len(values) > MAX_ITEMS else []


def _scalar(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        shown = ", ".join(map(_scalar, value[:MAX_ITEMS]))
        return f"[{shown}]" if len(value) <= MAX_ITEMS else f"[{len(value)} values: {shown}, ...]"
    if isinstance(value, str):
        return value or '""'
    return str(value) if not isinstance(value, dict) else "{}"
