"""Types as .msg, .srv and .action files define them, parsed from their text; values as plain dicts,
lists and numbers.

The parser is written by hand, since the grammar is one line per field, libraries for it (rosbags,
rosidl) need numpy or ROS, and `topic echo` has to start at once. The spellings of ROS 1 are read
too: Header, time and duration.
"""

import json
import math
import re
import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from holozen.console import Failure
from holozen.suggest import shorten, suggest

LARGEST = 16_000_000  # bytes of the smallest message of a type; nested fixed arrays multiply
MAX_FIELDS = 10_000  # of a type, nested ones included; each level can double them

INTEGERS = {
    "byte": (0, 2**8 - 1),
    "char": (0, 2**8 - 1),
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
"""The least and the largest value of each integer type. As in ROS 2, byte and char are unsigned."""
FLOATS = ("float32", "float64")
TEXTS = ("string", "wstring")
PRIMITIVES = ("bool", *INTEGERS, *FLOATS, *TEXTS)

LARGEST_FILE = 1_000_000  # characters
LARGEST_ARRAY = 2**32 - 1  # elements, as many as CDR can count
OLD = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}
FLOAT32 = 3.4028235677973366e38  # from here up a number rounds to infinity as a float32 (IEEE 754)
TYPECODES = {
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
"""The typecodes (of `array` and `struct`) of those numbers that have one."""

_WORD = r"[A-Za-z][A-Za-z0-9_]*"
_LINE = re.compile(
    rf"(?P<type>{_WORD}(?:/{_WORD}){{0,2}})(?:<=(?P<longest>\d{{1,10}}))?(?P<array>\[(?:<=)?\d{{0,10}}\])?"
    rf"\s+(?P<name>{_WORD})(?:\s*=\s*(?P<constant>\S.*)|\s+(?P<default>\S.*))?"
)
_FIELD_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_CONSTANT_NAME = re.compile(r"[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_ITEM = re.compile(r"""\s*("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'|[^,"']+?)\s*(?:,|$)""")
_BOOLS = {"true": True, "1": True, "false": False, "0": False}
_SIZES = {"bool": 1, "byte": 1, "string": 4, "wstring": 4} | {
    name: struct.calcsize(f"<{code}") for name, code in TYPECODES.items()
}
"""The bytes of each primitive; of a text, those of its length."""


class InterfaceError(Failure, ValueError):
    """An unknown type, a malformed definition, or a value that does not fit its field. The text is
    one line.
    """


class Field(NamedTuple):
    """One field. `type` is a primitive of ROS, or the full name of a message, which is then in
    `nested`.

    `array` is empty for a single value, else "fixed" (`bound` elements), "bounded" (at most
    `bound`) or "sequence". `longest` is N of a `string<=N`, 0 without. `default` is None where the
    definition gives none.
    """

    name: str
    type: str
    array: str = ""
    bound: int = 0
    default: Any = None
    longest: int = 0
    nested: "Interface | None" = None

    def spelled(self, package: str = "") -> str:
        """The type as a .msg file of `package` writes it, such as `float64[36]`."""
        home, _, rest = self.type.partition("/msg/")
        name = self.type if not rest else rest if home == package else f"{home}/{rest}"
        ends = {
            "": "",
            "fixed": f"[{self.bound}]",
            "bounded": f"[<={self.bound}]",
            "sequence": "[]",
        }
        return name + (f"<={self.longest}" if self.longest else "") + ends[self.array]

    def line(self, package: str = "") -> str:
        """Its line in a .msg file of `package`."""
        return (
            f"{self.spelled(package)} "
            f"{self.name}{'' if self.default is None else f' {_written(self.default)}'}"
        )


class Constant(NamedTuple):
    """A named value."""

    name: str
    type: str
    value: Any

    def line(self) -> str:
        """Its line in a .msg file."""
        return f"{self.type} {self.name}={_written(self.value)}"


def _written(value: Any) -> str:
    """A value as a .msg file has it. Texts are in quotes: some are empty, or have a `#`."""
    if isinstance(value, list):
        return f"[{', '.join(map(_written, value))}]"
    return (
        '"' + re.sub(r'["\\]', r"\\\g<0>", value) + '"'
        if isinstance(value, str)
        else json.dumps(value)
    )


class Interface:
    """A message type; or a service type, which has a `request` and a `response`, or an action type,
    which has `parts`; neither of them has fields of its own.

    `kind` is "msg", "srv" or "action". The messages of a service are messages:
    `std_srvs/srv/Trigger_Request`. Those of an action, and its two services, are its `parts`, see
    `action_parts`.
    """

    __slots__ = (
        "constants",
        "fields",
        "kind",
        "least",
        "name",
        "parts",
        "request",
        "response",
        "width",
    )

    def __init__(
        self,
        name: str,
        kind: str,
        fields: tuple[Field, ...] = (),
        constants: tuple[Constant, ...] = (),
        parts: "tuple[Interface, ...]" = (),
    ) -> None:
        self.name, self.kind, self.fields, self.constants, self.parts = (
            name,
            kind,
            fields,
            constants,
            parts,
        )
        self.request = parts[0] if kind == "srv" else None
        self.response = parts[1] if kind == "srv" else None
        self.least: int = max(1, sum(map(_field_size, fields)))  # bytes; an empty message has one
        self.width: int = 1 + sum(field.nested.width if field.nested else 1 for field in fields)
        if self.least > LARGEST or self.width > MAX_FIELDS:
            raise InterfaceError(
                f"{name} is too large: at least {self.least} bytes and {self.width} fields"
            )

    @property
    def package(self) -> str:
        """The first part of the name."""
        return self.name.partition("/")[0]


def element_size(field: Field) -> int:
    """The least number of bytes of one element of a field, without padding."""
    return field.nested.least if field.nested else _SIZES[field.type]


def _field_size(field: Field) -> int:
    return (
        4
        if field.array in ("sequence", "bounded")
        else element_size(field) * (field.bound if field.array else 1)
    )


class PlacedError(InterfaceError):
    """An error that already names its file and line."""


ACTION_PARTS = ("Goal", "Result", "Feedback", "FeedbackMessage", "SendGoal", "GetResult")
"""The endings of the names of an action's parts: its sections, the message of its topic, and its
services.
"""


def action_parts(name: str, sections: "list[Section]", resolve: "Resolve") -> list[Interface]:
    """The parts of an action, in the order of ACTION_PARTS, from the sections of its file.

    Source: ROS 2's design, "Actions", and rosidl, which adds the goal's id to what is sent.
    """
    goal, result, feedback = (
        Interface(f"{name}_{part}", "msg", *section)
        for part, section in zip(ACTION_PARTS, sections, strict=False)
    )
    uuid = resolve("unique_identifier_msgs/UUID")

    def nested(name: str, kind: Interface) -> Field:
        return Field(name, kind.name, nested=kind)

    def service(part: str, request: list[Field], response: list[Field]) -> Interface:
        halves = zip(("Request", "Response"), (request, response), strict=True)
        return Interface(
            f"{name}_{part}",
            "srv",
            parts=tuple(
                Interface(f"{name}_{part}_{half}", "msg", tuple(fields)) for half, fields in halves
            ),
        )

    identified = nested("goal_id", uuid)
    accepted = [Field("accepted", "bool"), nested("stamp", resolve("builtin_interfaces/Time"))]
    return [
        goal,
        result,
        feedback,
        Interface(f"{name}_FeedbackMessage", "msg", (identified, nested("feedback", feedback))),
        service("SendGoal", [identified, nested("goal", goal)], accepted),
        service("GetResult", [identified], [Field("status", "int8"), nested("result", result)]),
    ]


class Section(NamedTuple):
    """The fields and constants of a message, or of a part of a service or an action."""

    fields: tuple[Field, ...]
    constants: tuple[Constant, ...]


Resolve = Callable[[str], Interface]


def parse(
    text: str, where: str, resolve: Resolve, first: int = 1, strict: bool = False
) -> list[Section]:
    """The sections of a file, separated by `---`. `resolve` returns the message for a name such as
    `Pose`.

    Raises InterfaceError with `where` and the line, counted from `first`; if `strict`, also for the
    names of fields and constants that ROS 2 refuses, and ROS 1 does not.
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
                if strict:
                    _check_name(sections[-1][-1])
            except PlacedError:
                raise  # it names the file of the nested type
            except InterfaceError as error:
                raise PlacedError(f"{where}:{number}: {error}") from None
    return [
        Section(
            tuple(member for member in members if isinstance(member, Field)),
            tuple(member for member in members if isinstance(member, Constant)),
        )
        for members in sections
    ]


def _bare(line: str) -> str:
    """The line without its comment. A `#` in quotes does not start one, unless the quotes are
    unbalanced.
    """
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
        if not line.strip("-"):
            raise InterfaceError(f"{line[:80]!r} is not a field; the line between two parts is ---")
        forms = (
            "TYPE NAME, TYPE NAME DEFAULT, TYPE NAME=VALUE, or # COMMENT; an array is TYPE[] NAME"
        )
        raise InterfaceError(f"{line[:80]!r} is not a field; write {forms}")
    name = found["name"]
    if name in PRIMITIVES and found["type"] not in PRIMITIVES:
        raise InterfaceError(
            f"{line[:80]!r} is not a field; the type comes first: {name} {found['type']}"
        )
    if any(member.name == name for member in before):
        raise InterfaceError(f"{name!r} is defined twice")
    field = _field(found, resolve)
    if found["constant"] is None:
        return field
    if field.array or field.nested:
        raise InterfaceError(f"{name!r}: a constant is one number, bool or string")
    return Constant(name, field.type, value_of(field, found["constant"]))


def _check_name(member: Field | Constant) -> None:
    """Raise InterfaceError for a name that ROS 2 refuses."""
    words = _HUMP.sub("_", member.name).split("_")
    right = "_".join(filter(None, words)).lower()
    if isinstance(member, Field) and not _FIELD_NAME.fullmatch(member.name):
        rule = "ROS 2 allows lower-case letters, digits, and single underscores between them"
        raise InterfaceError(f"{member.name!r} is not a valid name of a field; {rule}: {right}")
    if isinstance(member, Constant) and not _CONSTANT_NAME.fullmatch(member.name):
        default = f", or for a field with a default {member.type} {member.name} {member.value}"
        raise InterfaceError(
            f"{member.name!r} is not a valid name of a constant; write {right.upper()}{default}"
        )


def _field(found: re.Match[str], resolve: Resolve) -> Field:
    kind, nested, longest = found["type"], None, int(found["longest"] or 0)
    if kind not in PRIMITIVES:
        nested = resolve(OLD.get(kind, kind))
        kind = nested.name
    if found["longest"] and (kind not in TEXTS or not longest):
        raise InterfaceError(
            f"{found['type']}<={found['longest']}: only a string has a bound, from 1 up"
        )
    array, bound = _array(found["array"])
    field = Field(found["name"], kind, array, bound, None, longest, nested)
    return (
        field
        if found["default"] is None
        else field._replace(default=_parsed_default(field, found["default"]))
    )


def _array(text: str | None) -> tuple[str, int]:
    if text is None or text == "[]":
        return ("sequence" if text else ""), 0
    bound = int(text.strip("[<=]") or 0)
    if not 0 < bound <= LARGEST_ARRAY:
        raise InterfaceError(f"{text}: an array has from 1 to {LARGEST_ARRAY} elements")
    return ("bounded" if "<" in text else "fixed"), bound


def _parsed_default(field: Field, text: str) -> Any:
    if field.nested:
        raise InterfaceError(f"{field.name!r}: a message has no default")
    if not field.array:
        return value_of(field, text)
    if not (text.startswith("[") and text.endswith("]")):
        raise InterfaceError(f"{field.name!r}: {text[:80]!r} is not a list; write [1, 2]")
    values = [value_of(field, item) for item in _items(field, text[1:-1])]
    if not fits_length(field, len(values)):
        raise InterfaceError(f"{field.name!r}: {len(values)} values for {field.spelled()}")
    return values


def fits_length(field: Field, length: int) -> bool:
    """Whether an array field may have `length` elements."""
    return (
        length == field.bound
        if field.array == "fixed"
        else not field.bound or length <= field.bound
    )


def _items(field: Field, text: str) -> list[str]:
    items, at = [], 0
    while at < len(text.rstrip()):
        found = _ITEM.match(text, at)
        if not found:
            raise InterfaceError(f"{field.name!r}: {text[at : at + 80]!r} is not a list of values")
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
    raise InterfaceError(f"{field.name!r}: {text[:80]!r} is not a valid {field.type}")


def _text(field: Field, text: str) -> str:
    if len(text) > 1 and text[0] in "\"'" and text[0] == text[-1]:
        text = re.sub(r"\\([\\\"'])", r"\1", text[1:-1])
    if field.longest and len(text) > field.longest:
        raise ValueError
    return text


def prototype(interface: Interface) -> dict[str, Any]:
    """A message with each field at its default: the one in the definition, else zero, empty or
    false.
    """
    return {field.name: _default(field) for field in interface.fields}


def completed(
    interface: Interface, value: Any, path: str = "", tolerant: bool = False
) -> dict[str, Any]:
    """`value` with missing fields at their defaults.

    Raises InterfaceError with the path of the first field that does not exist (and the most similar
    one that does) or whose value has the wrong type, range or length. If `tolerant`, fields that do
    not exist are left out. NaN and infinities are numbers. A mapping stands for a list of pairs.
    """
    names = [field.name for field in interface.fields]
    if not isinstance(value, dict):
        fix = f"; write {{{shorten(': ..., '.join(names))}: ...}}" if names else ""
        raise InterfaceError(
            f"{path or interface.name}: {shorten(repr(value))} is not a mapping of fields{fix}"
        )
    for name in value:
        if name not in names and not tolerant:
            where = f"{path}.{name}" if path else f"{name}"
            hint = _slip(name, value[name]) or field_hint(str(name), names)
            raise InterfaceError(f"{interface.name} has no field {where[:80]!r}{hint}")
    return {
        field.name: _checked(field, value[field.name], f"{path}.{field.name}".lstrip("."), tolerant)
        if field.name in value
        else _default(field)
        for field in interface.fields
    }


MAPPED = "holozen/msg/RefusalCount"
"""A sequence of these pairs is an object in JSON."""


def with_mappings(interface: Interface, value: dict[str, Any]) -> dict[str, Any]:
    """A message with all its fields as JSON has it, see MAPPED."""
    mapped = [field for field in interface.fields if field.nested and field.nested.name == MAPPED]
    return value | {
        field.name: dict(pair.values() for pair in value[field.name]) for field in mapped
    }


def _slip(name: object, value: object) -> str:
    """The end of an error line about a name that only YAML's rules made of what was written; else
    empty.
    """
    if ":" in str(name):
        return "; write a space after ':'"
    return "; write a decimal point, not a comma" if value is None and str(name).isdecimal() else ""


def field_hint(name: str, names: Sequence[str]) -> str:
    """The end of an error line about a field that a message does not have: the most similar one, or
    all.
    """
    return suggest(name, names) or f"; it has {', '.join(names) or 'none'}"


def _default(field: Field) -> Any:
    if field.default is not None:
        return list(field.default) if isinstance(field.default, list) else field.default
    if field.array:
        return [zero(field) for _ in range(field.bound if field.array == "fixed" else 0)]
    return zero(field)


def zero(field: Field) -> Any:
    """One element of a field without a default."""
    if field.nested:
        return prototype(field.nested)
    if field.type in TEXTS:
        return ""
    return False if field.type == "bool" else 0.0 if field.type in FLOATS else 0


def _checked(field: Field, value: Any, path: str, tolerant: bool) -> Any:
    if not field.array:
        return _element(field, value, path, tolerant)
    if isinstance(value, dict) and (names := _pair(field)):
        value = [dict(zip(names, item, strict=True)) for item in value.items()]
    if not isinstance(value, list | tuple):
        raise InterfaceError(f"{path}: {shorten(repr(value))} is not a list")
    if not fits_length(field, len(value)):
        raise InterfaceError(f"{path}: {len(value)} values for {field.spelled()}")
    return [
        _element(field, inner, f"{path}[{index}]", tolerant) for index, inner in enumerate(value)
    ]


def _pair(field: Field) -> list[str]:
    names = [inner.name for inner in field.nested.fields] if field.nested else []
    return names if len(names) == 2 else []


def _element(field: Field, value: Any, path: str, tolerant: bool) -> Any:
    if field.nested:
        return completed(field.nested, value, path, tolerant)
    if _fits(field, value):
        return float(value) if field.type in FLOATS else value
    raise InterfaceError(
        f"{path}: {shorten(repr(value))} is not a valid {field._replace(array='').spelled()}"
    )


def _fits(field: Field, value: Any) -> bool:
    if field.type == "bool" or isinstance(value, bool):
        return field.type == "bool" and isinstance(value, bool)
    if field.type in TEXTS:
        return (
            isinstance(value, str)
            and _is_unicode(value)
            and not 0 < field.longest < len(value.encode())
        )
    if field.type in FLOATS:
        return isinstance(value, float | int) and _is_number(field.type, value)
    low, high = INTEGERS[field.type]
    return isinstance(value, int) and low <= value <= high


def _is_number(kind: str, value: float) -> bool:
    try:
        number = float(value)
    except OverflowError:  # a whole number beyond all floats
        return False
    return kind == "float64" or not math.isfinite(number) or abs(number) < FLOAT32


def _is_unicode(text: str) -> bool:
    return not any("\ud800" <= letter <= "\udfff" for letter in text)


SEPARATOR = "=" * 80  # between two definitions


def whole_text(interface: Interface) -> str:
    """The definitions of a message and of those nested in it, as ROS 2 joins them in bags."""
    parts: dict[str, Interface] = {}
    _collect(interface, parts)
    others = [
        f"{SEPARATOR}\nMSG: {one.name.replace('/msg/', '/')}\n{_definition(one)}"
        for one in parts.values()
    ]
    return "\n".join([_definition(interface), *others])


def split_text(name: str, text: str) -> dict[str, str]:
    """The definition of each message in the `whole_text` of `name`, by full names. Raises
    InterfaceError.
    """
    if len(text) > LARGEST_FILE:
        raise InterfaceError(
            f"{name}: a definition of {len(text)} characters; at most {LARGEST_FILE} are read"
        )
    first, *others = text.split(f"{SEPARATOR}\nMSG: ")
    found = {name: first}
    for other in others:
        package, _, rest = other.partition("/")
        last, _, lines = rest.partition("\n")
        found[f"{package}/{last}" if "/" in last else f"{package}/msg/{last}"] = (
            lines  # that of an action has its kind
        )
    return found


def _collect(interface: Interface, found: dict[str, Interface]) -> None:
    for field in interface.fields:
        if field.nested and field.nested.name not in found:
            found[field.nested.name] = field.nested
            _collect(field.nested, found)


def _definition(interface: Interface) -> str:
    return "\n".join(
        [*(one.line() for one in interface.constants), *(one.line() for one in interface.fields)]
    )
