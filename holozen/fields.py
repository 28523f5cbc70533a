"""Fields of messages: picked by a dotted path, such as `pose.pose.position.x`, or tested by an
expression (`--filter`).

An expression, such as `m.linear.x > 0.2 and not m.angular.z`, is one of Python, as in ros2cli: its
user could run any other program too. `m` is the message, a bare name one of its fields.
"""

import builtins
import re
from types import SimpleNamespace
from typing import Any

from holozen.suggest import suggest

Path = tuple[str | int, ...]

_PART = re.compile(r"([^.\[\]]+)|\[(\d{1,6})\]")
LONGEST_PATH = 500  # characters of a path


def path(text: str) -> Path:
    """The names and indices of a field's path. Raises ValueError for an invalid one."""
    parts: list[str | int] = []
    at = 0
    while at < len(text) <= LONGEST_PATH and (
        found := _PART.match(text, at + (text[at] == "." and at > 0))
    ):
        parts.append(found[1] if found[1] is not None else int(found[2]))
        at = found.end()
    if not parts or at < len(text):
        raise ValueError(
            f"{text[:80]!r} is not a field; write names with dots, such as pose.pose.position.x"
        )
    return tuple(parts)


def pick(value: Any, path: Path) -> Any:
    """The field of `value` at a path. Raises LookupError that lists the fields, if it has no such
    one.
    """
    for part in path:
        if isinstance(part, int) and isinstance(value, list):
            if part >= len(value):
                raise LookupError(f"no [{part}]; the list has {len(value)} values")
            value = value[part]
        elif isinstance(value, dict) and part in value:
            value = value[part]
        else:
            raise LookupError(_missing(value, part))
    return value


def _missing(value: Any, part: str | int) -> str:
    if not isinstance(value, dict):
        return (
            f"no field {part!r} in a "
            f"{'list; write [0]' if isinstance(value, list) else type(value).__name__}"
        )
    names = [str(name) for name in value]
    return f"no field {part!r}{suggest(str(part), names)}; there are {', '.join(names) or 'none'}"


class Fields(SimpleNamespace):
    """A message: its fields are attributes, and also items, for names that Python reserves:
    `m["from"]`.
    """

    def __getitem__(self, name: str) -> Any:
        return vars(self)[name]


def as_object(value: Any) -> Any:
    """A value, with all messages in it as Fields."""
    if isinstance(value, dict):
        return Fields(**{name: as_object(inner) for name, inner in value.items()})
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [as_object(inner) for inner in value]
    return value


class Filter:
    """An expression that a message passes or not. Raises ValueError with one line for an invalid
    one.
    """

    def __init__(self, text: str) -> None:
        try:
            self._code = compile(text.strip(), "<filter>", "eval")
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            why = error.msg if isinstance(error, SyntaxError) else "nested too deeply"
            raise ValueError(
                f"filter {text!r}: {why}; write one such as m.linear.x > 0.2"
            ) from None

    def passes(self, message: Any) -> bool:
        """Whether it is true of a message; false for one that lacks a field, or has a value of
        another type there.
        """
        try:
            return bool(self._value(message))
        except Exception:
            return False

    def lacking(self, message: Any) -> str:
        """An error line about the first field that `message` lacks, with the nearest one that it
        has; empty if it lacks none.
        """
        try:
            self._value(message)
        except AttributeError as error:
            return _missing(
                vars(error.obj) if isinstance(error.obj, Fields) else error.obj, error.name or ""
            )
        except NameError as error:
            return _missing(message, error.name or "")
        except Exception:  # it has a value of another type
            pass
        return ""

    def _value(self, message: Any) -> Any:
        fields = as_object(message)
        names = vars(fields) if isinstance(fields, Fields) else {}
        return eval(self._code, {**names, "m": fields, "__builtins__": builtins})
