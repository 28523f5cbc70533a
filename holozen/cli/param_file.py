"""Values of parameters as people write them: a word on the command line, or a file as ROS 2 has it.

/sim:
  ros__parameters:
    max_linear: 5.0
"""

import json
import math
import re
import sys
from collections.abc import Iterator
from typing import Any

from holozen.errors import BusError

LARGEST = 1_000_000  # characters of a file
DEEPEST = 20  # sections within sections
HERE = "ros__parameters"
_EXPONENT = re.compile(r"[+-]?[0-9]+[eE][+-]?[0-9]+")  # a number for everybody but YAML 1.1
_PLAIN = re.compile(r"/?[A-Za-z][A-Za-z0-9_./]*")
_NO_NAMES = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")  # to YAML 1.1
Word = bool | int | float | str
Value = Word | list[bool] | list[int] | list[float] | list[str]


def typed(text: str) -> Value:
    """The value that a word means, or a list such as `[1.0, 2.5]`.

    What is no finite number, or no list of one type, stays text, which a node that wants another type refuses.
    """
    if text.startswith("["):
        from holozen.ros import yaml_values

        try:
            found = yaml_values.value(text)
        except ValueError:
            return text
        return found if isinstance(found, list) else text
    return _word(text)


def _word(text: str) -> Word:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    if re.fullmatch(r"[+-]?[0-9]{1,18}", text):
        return int(text)
    try:
        value = float(text)
    except ValueError:
        return text
    return value if math.isfinite(value) and "_" not in text else text


def lines(node: str, values: dict[str, Any]) -> list[str]:
    """The file that holds `values`."""
    rows = [f"    {_name(name)}: {_written(value)}" for name, value in values.items()]
    return [f"{_name('/' + node)}:", f"  {HERE}:" + ("" if rows else " {}"), *rows]


def read(path: str, node: str, wildcards: bool = True) -> dict[str, Value]:
    """What a file says for a node. Raises BusError with the reason, and what the file has."""
    sections = list(_sections(_parsed(path), "", path))
    wanted = {node, "**", "*"} if wildcards else {node}
    mine = [(place, values) for place, values in sections if place in wanted]
    if not mine:
        there = ", ".join(place for place, _ in sections) or f"none with {HERE}"
        raise BusError(f"{path}: it has no section for the node {node!r}; sections: {there}")
    found: dict[str, Value] = {}
    for place, values in sorted(mine, key=lambda section: section[0] == node):  # its own say the last word
        found |= dict(_flat(values, "", f"{path}: {place}"))
    if not found:
        raise BusError(f"{path}: it has no parameter for the node {node!r}")
    return found


def _parsed(path: str) -> Any:
    text = _text(path)
    try:
        return json.loads(text)
    except RecursionError:
        raise BusError(f"{path}: it is nested too deeply") from None
    except ValueError:
        pass
    try:
        import yaml
    except ModuleNotFoundError:
        raise BusError(f"{path}: it is no JSON; to read YAML: pip install pyyaml") from None
    try:
        return yaml.safe_load(text)
    except RecursionError:
        raise BusError(f"{path}: it is nested too deeply") from None
    except (yaml.YAMLError, ValueError) as error:  # a ValueError: a date that is none
        raise BusError(f"{path}: it is no YAML: {' '.join(str(error).split())}") from None


def _text(path: str) -> str:
    try:
        if path == "-":
            text = sys.stdin.read(LARGEST + 1)
        else:
            with open(path, encoding="utf-8") as file:
                text = file.read(LARGEST + 1)
    except OSError as error:
        raise BusError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise BusError(f"{path}: it is not UTF-8 text") from None
    if len(text) > LARGEST:
        raise BusError(f"{path}: it is longer than {LARGEST} characters")
    return text


def _sections(value: Any, place: str, path: str, depth: int = 0) -> Iterator[tuple[str, dict[Any, Any]]]:
    """(node, values) of each section, and of those within: ROS 2 nests namespaces."""
    if not isinstance(value, dict):
        where = f"section {place!r}" if place else "it"
        raise BusError(f"{path}: {where} has no names with values; write NODE: {{{HERE}: {{NAME: VALUE}}}}")
    for name, inner in value.items():
        if name == HERE and place:
            if not isinstance(inner, dict):
                raise BusError(f"{path}: {HERE} of {place!r} has no names with values")
            yield place, inner
        elif depth < DEEPEST:
            yield from _sections(inner, f"{place}/{str(name).strip('/')}".strip("/"), path, depth + 1)


def _flat(values: dict[Any, Any], prefix: str, where: str, depth: int = 0) -> Iterator[tuple[str, Value]]:
    for name, value in values.items():
        full = f"{prefix}{name}"
        if isinstance(value, dict) and depth < DEEPEST:
            yield from _flat(value, f"{full}.", where, depth + 1)
        elif isinstance(value, bool):
            yield full, value
        elif isinstance(value, str):
            yield full, _word(value) if _EXPONENT.fullmatch(value) else value
        elif isinstance(value, int | float):
            yield full, value if math.isfinite(value) and abs(value) < 2**63 else str(value)
        elif isinstance(value, list):
            yield full, _listed(value, f"{where}: {full}")
        else:
            wanted = "write a number, a word, true or false, or a list of one of them"
            raise BusError(f"{where}: {full} is a {type(value).__name__}; {wanted}")


def _listed(values: list[Any], where: str) -> Any:
    words = [_word(each) if isinstance(each, str) and _EXPONENT.fullmatch(each) else each for each in values]
    kinds = sorted({type(each).__name__ for each in words})
    if len(kinds) > 1 or not set(kinds) <= {"bool", "int", "float", "str"}:
        wanted = "write a list of numbers, of words, or of true and false"
        raise BusError(f"{where} is a list of {', '.join(kinds)}; {wanted}")
    return words


def _name(name: str) -> str:
    return name if _PLAIN.fullmatch(name) and name.lower() not in _NO_NAMES else _written(name)


def _written(value: Value) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_written, value))}]"
    if isinstance(value, str):
        quoted = json.dumps(value, ensure_ascii=False)
        return "".join(c if c.isascii() and c.isprintable() else f"\\U{ord(c):08x}" for c in quoted)
    text = json.dumps(value)
    # YAML 1.1 knows no number without a point before its exponent.
    return text.replace("e", ".0e") if isinstance(value, float) and "." not in text else text
