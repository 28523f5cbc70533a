"""Decodes samples of any node to plain values, and formats them in the layout of `ros2 topic
echo`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from holozen.transport.graph import on_key
from holozen.transport.node import Node
from holozen.transport.samples import Sample

if TYPE_CHECKING:
    from pathlib import Path

    Packages = Iterable[tuple[str, Path]]

MAX_ON_A_LINE = 128  # values of a list on one line
CDR = "application/cdr"
UNSPECIFIC = ("", "zenoh/bytes", "application/octet-stream")
CDR_STARTS = (b"\0\0", b"\0\1")  # the encapsulation of plain CDR: big and little endian


class Hex(str):
    """The hex dump of bytes that could not be decoded."""

    __slots__ = ()


class SampleReader:
    """Decodes the samples of a bus. `type_name` is the type of CDR payloads if neither sample nor
    publisher names it; `packages` are those of `--package`.

    Raises ValueError for an unknown type.
    """

    def __init__(self, type_name: str = "", packages: Packages = ()) -> None:
        self.why = ""  # the reason why the last sample that failed could not be decoded
        self._given, self._packages = type_name, packages
        self._interfaces: dict[str, Any] = {}
        self._registry: Any = None
        self._announced: dict[str, str] = {}  # key -> the type that its publishers announce
        self.given = self._interface(type_name).name if type_name else ""  # in full

    def read(self, sample: Sample, bus: Node, usual: str = "") -> Any:
        """The value of a sample; a Hex if its bytes cannot be decoded. `usual`: its type if it does
        not name one.
        """
        name, _, schema = sample.encoding.partition(";")
        if name != CDR and (name not in UNSPECIFIC or sample.payload[:2] not in CDR_STARTS):
            value = decode(sample.payload, sample.encoding)
            self.why = "neither text, JSON nor CDR" if isinstance(value, Hex) else self.why
            return value
        try:
            if kind := self._given or schema or usual or self._announced_type(sample.key, bus):
                from holozen.messages import cdr

                return cdr.read(self._interface(kind, bus.definition), sample.payload)
            self.why = "for CDR give the type: --type T"
        except ValueError as error:  # bytes of another type, or a type that is not known here
            other = f", its encoding is {schema}" if schema not in ("", self._given) else ""
            self.why = (
                f"{error}; --type is wrong, or the bytes are{other}" if self._given else str(error)
            )
        return hex_dump(sample.payload, sample.encoding)

    def _interface(self, name: str, define: Callable[[str], str] = lambda _: "") -> Any:
        """The definition of a type; an unknown one is learned from its publisher."""
        if name not in self._interfaces:
            from holozen.messages.registry import Registry

            self._registry = self._registry or Registry(dict(self._packages))
            self._interfaces[name] = self._registry.learn(name, define)
        return self._interfaces[name]

    def _announced_type(self, key: str, bus: Node) -> str:
        if key not in self._announced:
            types = {end.type for end in on_key(bus.endpoints(), key, "pub")}
            self._announced[key] = min(types, default="")
        return self._announced[key]


def decode(payload: bytes, encoding: str) -> Any:
    """The plain value in a payload: of JSON its value, other text as it is, else a Hex."""
    try:
        text = payload.decode()
    except UnicodeDecodeError:
        return hex_dump(payload, encoding)
    if "\0" in text:  # so it is binary data
        return hex_dump(payload, encoding)
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def hex_dump(payload: bytes, encoding: str) -> Hex:
    """The size, the encoding and the first bytes of a payload."""
    start = payload[:32].hex(" ")
    return Hex(f"{len(payload)} bytes of {encoding}: {start}{' ...' if len(payload) > 32 else ''}")


def strict(value: Any) -> Any:
    """A value that is valid JSON: numbers that are not finite become strings, such as "NaN"."""
    if isinstance(value, float) and value - value != 0:
        return {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}[repr(value)]
    if isinstance(value, dict):
        return {name: strict(inner) for name, inner in value.items()}
    return [strict(inner) for inner in value] if isinstance(value, list) else value


def lines(value: Any, indent: str = "", longest: int | None = None) -> list[str]:
    """`value` as indented lines of `name: value`; on one line if it is nested too deeply for that.

    A list on one line shows at most `longest` values; 0 means all, None the default.
    """
    try:
        return _lines(value, indent, MAX_ON_A_LINE if longest is None else longest)
    except RecursionError:
        return [json.dumps(value)]


def _lines(value: Any, indent: str, longest: int) -> list[str]:
    if isinstance(value, dict):
        rows = [
            line for name, inner in value.items() for line in _named(name, inner, indent, longest)
        ]
        return rows or [f"{indent}{{}}"]
    if isinstance(value, list) and not _is_flat(value):
        rows = []
        for inner in value:
            first, *rest = _lines(inner, indent + "  ", longest)
            rows += [f"{indent}- {first.strip()}", *rest]
        return rows
    return [f"{indent}{_scalar(value, longest)}"]


def _named(name: str, value: Any, indent: str, longest: int) -> list[str]:
    if isinstance(value, dict | list) and value and not _is_flat(value):
        return [f"{indent}{_scalar(name)}:", *_lines(value, indent + "  ", longest)]
    return [f"{indent}{_scalar(name)}: {_scalar(value, longest)}"]


def _is_flat(value: Any) -> bool:
    return isinstance(value, list) and not set(map(type, value)) & {dict, list}


def _scalar(value: Any, longest: int = 0) -> str:
    if type(value) is int or (type(value) is float and value - value == 0):
        return repr(value)  # the same as json.dumps, but faster
    if isinstance(value, list):
        kept = value[:longest] if longest else value
        shown = ", ".join(map(_scalar, kept)) if str in map(type, kept) else _numbers(kept)
        return (
            f"[{shown}{f', ... {len(value) - len(kept)} more' if len(kept) < len(value) else ''}]"
        )
    if isinstance(value, str):
        return value if value.isprintable() and value else json.dumps(value)
    return json.dumps(value)


def _numbers(values: list[Any]) -> str:
    text = repr(values)[1:-1]
    # Python writes them as JSON does, except for None, nan, inf, True and False.
    return json.dumps(values)[1:-1] if any(letter in text for letter in "nTF") else text


def cut(value: Any, longest: int = 0, arrays: bool = True, texts: bool = True) -> Any:
    """`value` with lists and texts of at most `longest` values or characters (0: all of them).

    Without `arrays` a list is replaced by its length, without `texts` a text is.
    """
    if isinstance(value, dict):
        return {name: cut(inner, longest, arrays, texts) for name, inner in value.items()}
    if isinstance(value, list):
        if not arrays:
            return f"<{len(value)} values>"
        kept = [cut(inner, longest, arrays, texts) for inner in value[: longest or None]]
        return kept + ([f"... {len(value) - longest} more"] if 0 < longest < len(value) else [])
    if isinstance(value, str):
        if not texts:
            return f"<{len(value)} characters>"
        return value[:longest] + "..." if 0 < longest < len(value) else value
    return value


def csv_row(value: Any) -> str:
    """The values of a message as one line of comma-separated values, in their order."""
    return ",".join(_cells(value))


def _cells(value: Any) -> list[str]:
    if isinstance(value, dict):
        return [cell for inner in value.values() for cell in _cells(inner)]
    if isinstance(value, list):
        return [cell for inner in value for cell in _cells(inner)]
    if isinstance(value, str):
        text = value if value.isprintable() else json.dumps(value)[1:-1]
        return ['"' + text.replace('"', '""') + '"' if set(text) & set(',"') else text]
    return [json.dumps(value)]
