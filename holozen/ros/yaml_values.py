"""Values of parameters as YAML writes them, by ROS's rules: what is plain has a type, what is quoted is text.

Only lists, maps and files need the YAML library; a plain word does not.
"""

import re
from typing import Any

Value = bool | int | float | str | list[bool] | list[int] | list[float] | list[str]

LARGEST = 1_000_000  # characters of a file or a value
DEEPEST = 20  # maps within maps
MOST = 100_000  # values in one text
YES = frozenset(("y", "Y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"))
NO = frozenset(("n", "N", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"))
INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|[0-9]+)")
DOUBLE = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
SPECIAL = re.compile(r"([+-]?)\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
PLAIN = re.compile(r"[A-Za-z0-9_./+~-][^\s:#,\[\]{}\"'&*!|>%@`]*")


def word(text: str) -> bool | int | float | str:
    """The value that a plain word means. Raises ValueError for a whole number of more than 64 bits."""
    if text in YES or text in NO:
        return text in YES
    if INTEGER.fullmatch(text):
        digits = text.lstrip("+-").lower()
        base = 16 if digits.startswith("0x") else 8 if re.fullmatch("0[0-7]+", digits) else 10
        value = int(text, base)
        if not -(2**63) <= value < 2**63:
            raise ValueError(f"{text} is no integer of 64 bits; write {text}.0 for a double")
        return value
    if DOUBLE.fullmatch(text):
        return float(text)
    if SPECIAL.fullmatch(text):
        return float(text.replace(".", "").lower())
    return text


def value(text: str) -> Value | dict[str, Any]:
    """The value that YAML describes: a word, a list of one type, or a map. Raises ValueError with one line."""
    stripped = text.strip()
    if PLAIN.fullmatch(stripped):
        return word(stripped)
    found: Value | dict[str, Any] = _Reader(text).found
    return found


def document(text: str) -> dict[str, Any]:
    """The map that a file holds; empty for an empty one. Raises ValueError with one line."""
    found = _Reader(text).found
    if found == "":
        return {}
    if not isinstance(found, dict):
        raise ValueError("it has no names with values; write NODE: {ros__parameters: {NAME: VALUE}}")
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
        raise ValueError(f"it is no YAML: {' '.join(str(error).split())}") from None


class _Reader:
    """What one text says."""

    def __init__(self, text: str) -> None:
        self._seen = 0
        self.found = self._of(_composed(text), 0)

    def _of(self, node: Any, depth: int) -> Any:
        """The value of a node that the YAML library made."""
        if node is None:
            return ""
        self._seen += 1  # what an alias stands for counts again: a few lines can stand for millions
        if depth > DEEPEST or self._seen > MOST:
            raise ValueError(f"it is nested deeper than {DEEPEST}, or has more than {MOST} values")
        line = node.start_mark.line + 1
        if node.id == "scalar":
            quoted = node.style is not None or node.tag == "!!str"
            return node.value if quoted else word(node.value)
        if node.id == "sequence":
            return _list([self._of(each, depth + 1) for each in node.value], line)
        found: dict[str, Any] = {}
        for name, inner in node.value:
            if name.id != "scalar":
                raise ValueError(f"line {line}: a name is no word")
            found[name.value] = self._of(inner, depth + 1)
        return found


def _list(values: list[Any], line: int) -> list[Any]:
    kinds = {type(each).__name__: type(each) for each in values}
    if "list" in kinds or "dict" in kinds:
        raise ValueError(f"line {line}: a list within a list, or of maps, is no value of a parameter")
    if len(kinds) > 1:
        hint = "; write 1.0 for 1" if set(kinds) == {"int", "float"} else ""
        raise ValueError(f"line {line}: a list has values of one type, and not {', '.join(sorted(kinds))}{hint}")
    return values
