"""Parameter values in YAML, by ROS's rules: an unquoted word has a type, a quoted one is a string.

Only lists, maps and files need the YAML library. A file names the nodes that its values are for:

/ns/talker:
  ros__parameters:
    speed: 0.3
"""

import json
import math
import re
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any, NamedTuple

from holozen.suggest import yaml_problem

Value = bool | int | float | str | list[bool] | list[int] | list[float] | list[str]

LARGEST = 1_000_000  # characters of a file or a value
DEEPEST = 20  # maps within maps
MAX_VALUES = 100_000  # values in one text
YES = frozenset(("y", "Y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"))
NO = frozenset(("n", "N", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"))
INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|[0-9]+)")
DOUBLE = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
SPECIAL = re.compile(r"([+-]?)\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
PLAIN = re.compile(r"[A-Za-z0-9_./+~-][^\s:#,\[\]{}\"'&*!|>%@`]*")


def word(text: str) -> bool | int | float | str:
    """The value of an unquoted word. Raises ValueError for an integer of more than 64 bits."""
    if text in YES or text in NO:
        return text in YES
    if INTEGER.fullmatch(text):
        digits = text.lstrip("+-").lower()
        base = 16 if digits.startswith("0x") else 8 if re.fullmatch("0[0-7]+", digits) else 10
        value = int(text, base)
        if not -(2**63) <= value < 2**63:
            raise ValueError(f"{text} is not a 64-bit integer; write {text}.0 for a double")
        return value
    if DOUBLE.fullmatch(text):
        return float(text)
    if SPECIAL.fullmatch(text):
        return float(text.replace(".", "").lower())
    return text


def parse(text: str) -> Value | dict[str, Any]:
    """The value of a YAML text: a word, a list of one type, or a map. Raises ValueError with one
    line.
    """
    stripped = text.strip()
    if PLAIN.fullmatch(stripped):
        return word(stripped)
    found: Value | dict[str, Any] = _parsed(text)
    return found


def written(value: Any) -> str:
    """A value as YAML that is read as the same value, here and by other readers of YAML 1.1."""
    if isinstance(value, list):
        return f"[{', '.join(map(written, value))}]"
    if isinstance(value, str):
        quoted = json.dumps(value, ensure_ascii=False)
        return "".join(c if c.isascii() and c.isprintable() else f"\\U{ord(c):08x}" for c in quoted)
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    text = json.dumps(value)
    # YAML 1.1 requires a decimal point before the exponent.
    return text.replace("e", ".0e") if isinstance(value, float) and "." not in text else text


def document(text: str) -> dict[str, Any]:
    """The map in a YAML file; empty for an empty file. Raises ValueError with one line."""
    found = _parsed(text)
    if found == "":
        return {}
    if not isinstance(found, dict):
        raise ValueError(
            "it has no names with values; write NODE: {ros__parameters: {NAME: VALUE}}"
        )
    return found


def _composed(text: str) -> Any:
    if len(text) > LARGEST:
        raise ValueError(f"it is longer than {LARGEST} characters")
    try:
        import yaml
    except ModuleNotFoundError:
        raise ValueError("reading it needs YAML: pip install pyyaml") from None
    try:
        return yaml.compose(text, yaml.SafeLoader)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except (yaml.YAMLError, ValueError) as error:
        raise ValueError(f"invalid YAML: {yaml_problem(error)}") from None


def _parsed(text: str) -> Any:
    """The value of a YAML text."""
    seen = 0

    def value(node: Any, depth: int) -> Any:
        nonlocal seen
        if node is None:
            return ""
        seen += 1  # aliases count every time: a few lines can expand to millions of values
        if depth > DEEPEST or seen > MAX_VALUES:
            raise ValueError(
                f"it is nested deeper than {DEEPEST}, or has more than {MAX_VALUES} values"
            )
        line = node.start_mark.line + 1
        if node.id == "scalar":
            quoted = node.style is not None or node.tag == "!!str"
            return node.value if quoted else word(node.value)
        if node.id == "sequence":
            return _list([value(each, depth + 1) for each in node.value], line)
        found: dict[str, Any] = {}
        for name, inner in node.value:
            if name.id != "scalar":
                raise ValueError(f"line {line}: a name must be a word")
            found[name.value] = value(inner, depth + 1)
        return found

    return value(_composed(text), 0)


def _list(values: list[Any], line: int) -> list[Any]:
    kinds = {type(each).__name__: type(each) for each in values}
    if "list" in kinds or "dict" in kinds:
        raise ValueError(f"line {line}: a parameter cannot be a list of lists or maps")
    if len(kinds) > 1:
        hint = "; write 1.0 for 1" if set(kinds) == {"int", "float"} else ""
        raise ValueError(
            f"line {line}: all values of a list must have one type, not "
            f"{', '.join(sorted(kinds))}{hint}"
        )
    return values


KEY = "ros__parameters"
EVERY_NODE = "/**"


class Section(NamedTuple):
    """The values for a node, or for all that match its wildcards: `*` is one part of a name, `**`
    any number.
    """

    place: str
    values: dict[str, Value]
    file: str = ""
    """The file that it is from; empty for one of the command line."""

    def is_for(self, full_name: str) -> bool:
        """Whether it is for the node with that absolute name."""
        return bool(
            re.fullmatch("".join(_pattern(part) for part in self.place.split("/")[1:]), full_name)
        )


def assigned(text: str) -> Section:
    """The section of `name:=value` or `node:name:=value`. Raises ValueError."""
    name, sign, rest = text.partition(":=")
    if not sign or not name:
        raise ValueError("write NAME:=VALUE, or NODE:NAME:=VALUE")
    node, colon, name = name.rpartition(":")
    if not name or (colon and not node):
        raise ValueError("write NAME:=VALUE, or NODE:NAME:=VALUE")
    value = parse(rest)
    return Section(_place(node) if node else EVERY_NODE, dict(_flat({name: value}, "")))


def read(path: str) -> list[Section]:
    """The sections of a file ("-": of standard input), those with wildcards first. Raises
    ValueError with one line.
    """
    try:
        with nullcontext(sys.stdin) if path == "-" else open(path, encoding="utf-8") as file:
            text = file.read(LARGEST + 1)
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not UTF-8 text") from None
    try:
        found = list(_sections(document(text), ""))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return sorted(
        (each._replace(file=path) for each in found), key=lambda section: "*" not in section.place
    )


def _sections(node: dict[str, Any], place: str) -> Iterator[Section]:
    for name, inner in node.items():
        if name == KEY and place:
            if not isinstance(inner, dict) and inner != "":
                raise ValueError(f"{KEY} of {place} has no names with values")
            yield Section(place, dict(_flat(inner or {}, "")))
        elif isinstance(inner, dict):
            yield from _sections(inner, place + _place(name))
        else:
            what = f"section {place}" if place else "the file"
            raise ValueError(
                f"{what} has a value for {name!r} outside of {KEY}; write NODE: {{{KEY}: {{NAME: "
                f"VALUE}}}}"
            )


def _flat(values: dict[str, Any], prefix: str) -> Iterator[tuple[str, Value]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _place(name: str) -> str:
    return "/" + name.strip("/")


def _pattern(part: str) -> str:
    if part == "**":
        return "(/[^/]+)*"
    return "/" + re.escape(part).replace(r"\*", "[^/]*")
