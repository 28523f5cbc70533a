"""The text of a .msg or .srv file -> its fields and constants.

Written by hand, for the grammar is one line a field: libraries that read it (rosbags, rosidl) bring numpy or ROS
along, and an echo has to start at once. Spellings of ROS 1 are read too: Header, time and duration.
"""

import re
from collections.abc import Callable
from typing import Any, NamedTuple

from holozen.interfaces.definition import (
    FLOATS,
    INTEGERS,
    PRIMITIVES,
    TEXTS,
    Constant,
    Field,
    Interface,
    InterfaceError,
)

LARGEST_FILE = 1_000_000  # characters
LARGEST_ARRAY = 2**32 - 1  # elements, as many as CDR can count
OLD = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}

_WORD = r"[A-Za-z][A-Za-z0-9_]*"
_LINE = re.compile(
    rf"(?P<type>{_WORD}(?:/{_WORD}){{0,2}})(?:<=(?P<longest>\d{{1,10}}))?(?P<array>\[(?:<=)?\d{{0,10}}\])?"
    rf"\s+(?P<name>{_WORD})(?:\s*=\s*(?P<constant>\S.*)|\s+(?P<default>\S.*))?"
)
_ITEM = re.compile(r"""\s*("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'|[^,"']+?)\s*(?:,|$)""")
_BOOLS = {"true": True, "1": True, "false": False, "0": False}


class PlacedError(InterfaceError):
    """An error that says its file and line."""


class Section(NamedTuple):
    """The fields and constants of a message, or of one half of a service."""

    fields: tuple[Field, ...]
    constants: tuple[Constant, ...]


Resolve = Callable[[str], Interface]


def parse(text: str, where: str, resolve: Resolve, first: int = 1) -> list[Section]:
    """The sections of a file, which `---` divides. `resolve` gives the message of a name such as `Pose`.

    Raises InterfaceError with `where` and the line, counted from `first`.
    """
    if len(text) > LARGEST_FILE:
        raise InterfaceError(f"{where}: {len(text)} characters; at most {LARGEST_FILE} are read")
    sections: list[list[Field | Constant]] = [[]]
    for number, line in enumerate(text.splitlines(), first):
        bare = _bare(line)
        if bare == "---":
            sections.append([])
        elif bare:
            try:
                sections[-1].append(_member(bare, resolve, sections[-1]))
            except PlacedError:
                raise  # the file of a type within this one says it best
            except InterfaceError as error:
                raise PlacedError(f"{where}:{number}: {error}") from None
    return [_section(members) for members in sections]


def _section(members: list[Field | Constant]) -> Section:
    fields = tuple(member for member in members if isinstance(member, Field))
    return Section(fields, tuple(member for member in members if isinstance(member, Constant)))


def _bare(line: str) -> str:
    """The line without its comment. A `#` in quotes begins none, unless the quotes do not end."""
    quote = ""
    for at, letter in enumerate(line):
        if quote:
            quote = "" if letter == quote and line[at - 1] != "\\" else quote
        elif letter == "#":
            return line[:at].strip()
        elif letter in "\"'":
            quote = letter
    return (line.partition("#")[0] if quote else line).strip()


def _member(line: str, resolve: Resolve, before: list[Field | Constant]) -> Field | Constant:
    found = _LINE.fullmatch(line)
    if not found:
        raise InterfaceError(f"{line[:80]!r} is no field; write TYPE NAME, TYPE NAME DEFAULT or TYPE NAME=VALUE")
    name = found["name"]
    if any(member.name == name for member in before):
        raise InterfaceError(f"{name!r} is there twice")
    field = _field(found, resolve)
    if found["constant"] is None:
        return field
    if field.array or field.nested:
        raise InterfaceError(f"{name!r}: a constant is one number, bool or string")
    return Constant(name, field.type, value_of(field, found["constant"]))


def _field(found: re.Match[str], resolve: Resolve) -> Field:
    kind, nested, longest = found["type"], None, int(found["longest"] or 0)
    if kind not in PRIMITIVES:
        nested = resolve(OLD.get(kind, kind))
        kind = nested.name
    if found["longest"] and (kind not in TEXTS or not longest):
        raise InterfaceError(f"{found['type']}<={found['longest']}: only a string has a bound, from 1 up")
    array, bound = _array(found["array"])
    field = Field(found["name"], kind, array, bound, None, longest, nested)
    return field if found["default"] is None else field._replace(default=_default(field, found["default"]))


def _array(text: str | None) -> tuple[str, int]:
    if text is None or text == "[]":
        return ("sequence" if text else ""), 0
    bound = int(text.strip("[<=]") or 0)
    if not 0 < bound <= LARGEST_ARRAY:
        raise InterfaceError(f"{text}: an array has from 1 to {LARGEST_ARRAY} elements")
    return ("bounded" if "<" in text else "fixed"), bound


def _default(field: Field, text: str) -> Any:
    if field.nested:
        raise InterfaceError(f"{field.name!r}: a message has no default")
    if not field.array:
        return value_of(field, text)
    if not (text.startswith("[") and text.endswith("]")):
        raise InterfaceError(f"{field.name!r}: {text[:80]!r} is no list; write [1, 2]")
    values = [value_of(field, item) for item in _items(field, text[1:-1])]
    wrong = len(values) != field.bound if field.array == "fixed" else 0 < field.bound < len(values)
    if wrong:
        raise InterfaceError(f"{field.name!r}: {len(values)} values for {field.spelled()}")
    return values


def _items(field: Field, text: str) -> list[str]:
    items, at = [], 0
    while at < len(text.rstrip()):
        found = _ITEM.match(text, at)
        if not found:
            raise InterfaceError(f"{field.name!r}: {text[at : at + 80]!r} is no list of values")
        items.append(found[1])
        at = found.end()
    return items


def value_of(field: Field, text: str) -> Any:
    """The value that `text` writes for one element of a field. Raises InterfaceError."""
    try:
        if field.type in TEXTS:
            return _text(field, text)
        if field.type == "bool":
            return _BOOLS[text.lower()]
        if field.type in FLOATS:
            return float(text)
        low, high = INTEGERS[field.type]
        value = int(text, 0)
        if low <= value <= high:
            return value
    except (ValueError, KeyError):
        pass
    raise InterfaceError(f"{field.name!r}: {text[:80]!r} is no {field.type}")


def _text(field: Field, text: str) -> str:
    if len(text) > 1 and text[0] in "\"'" and text[0] == text[-1]:
        text = re.sub(r"\\([\\\"'])", r"\1", text[1:-1])
    if field.longest and len(text) > field.longest:
        raise ValueError
    return text
