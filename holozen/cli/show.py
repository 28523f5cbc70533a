"""Values as people read them: the layout of `ros2 topic echo`."""

import json
from typing import Any

LONGEST = 36  # numbers of a list on one line


def decode(payload: bytes, encoding: str) -> Any:
    """The plain value in a payload: JSON or msgpack as values, other text as text, else a hex dump's text."""
    name = encoding.partition(";")[0]
    if name == "application/msgpack":
        import msgspec

        try:
            return _plain(msgspec.msgpack.decode(payload))
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return _hex(payload, encoding)
    try:
        text = payload.decode()
    except UnicodeDecodeError:
        return _hex(payload, encoding)
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def lines(value: Any, indent: str = "") -> list[str]:
    """`value` as indented lines of `name: value`; on one line if it is nested too deeply for that."""
    try:
        return _lines(value, indent)
    except RecursionError:
        return [json.dumps(value)]


def _lines(value: Any, indent: str) -> list[str]:
    if isinstance(value, dict):
        return [line for name, inner in value.items() for line in _named(name, inner, indent)] or [f"{indent}{{}}"]
    if isinstance(value, list) and not _is_flat(value):
        rows = []
        for inner in value:
            first, *rest = _lines(inner, indent + "  ")
            rows += [f"{indent}- {first.strip()}", *rest]
        return rows
    return [f"{indent}{_scalar(value)}"]


def _named(name: str, value: Any, indent: str) -> list[str]:
    if isinstance(value, dict | list) and value and not _is_flat(value):
        return [f"{indent}{_scalar(name)}:", *_lines(value, indent + "  ")]
    return [f"{indent}{_scalar(name)}: {_scalar(value)}"]


def _is_flat(value: Any) -> bool:
    return isinstance(value, list) and not any(isinstance(inner, dict | list) for inner in value)


def _scalar(value: Any) -> str:
    if isinstance(value, list) and len(value) > LONGEST:
        return f"[{', '.join(map(_scalar, value[:LONGEST]))}, ... {len(value) - LONGEST} more]"
    if isinstance(value, list):
        return f"[{', '.join(map(_scalar, value))}]"
    if isinstance(value, str):
        return value if value.isprintable() and value else json.dumps(value)
    return json.dumps(value)


def _plain(value: Any) -> Any:
    """`value` with bytes, times and keys that JSON does not know as text."""
    if isinstance(value, dict):
        return {key if isinstance(key, str) else str(_plain(key)): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, bytes):
        return value.hex(" ")
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _hex(payload: bytes, encoding: str) -> str:
    start = payload[:32].hex(" ")
    return f"{len(payload)} bytes of {encoding}: {start}{' ...' if len(payload) > 32 else ''}"
