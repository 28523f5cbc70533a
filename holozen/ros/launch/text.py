"""Texts of a launch file, known only when it runs, and where in the file something was written."""

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from holozen.ros.launch.context import LaunchContext

_OURS = str(Path(__file__).resolve().parents[2]) + os.sep
_TRUE, _FALSE = ("true", "1", "yes", "on"), ("false", "0", "no", "off")


class LaunchError(Exception):
    """A launch file cannot be followed. One line; `place` is its file and line."""

    def __init__(self, told: str, place: str = "") -> None:
        super().__init__(told)
        self.place = place

    def at(self, place: str) -> "LaunchError":
        """This, with a place unless it has one."""
        self.place = self.place or place
        return self

    def __str__(self) -> str:
        return ": ".join(filter(None, (self.place, super().__str__())))


class Substitution:
    """A text that is known only when the launch file runs."""

    def perform(self, context: "LaunchContext") -> str:
        """The text. Raises LaunchError."""
        raise LaunchError(f"{type(self).__name__} gives no text")

    def describe(self) -> str:
        """What stands for it in words."""
        return type(self).__name__


Text = Any
"""A str, a path, a Substitution, or several of them after each other (ROS calls it SomeSubstitutionsType)."""


def text(context: "LaunchContext", value: Text) -> str:
    """What a text is now. Raises LaunchError."""
    if isinstance(value, str | os.PathLike):
        return os.fspath(value)
    if isinstance(value, Substitution):
        return value.perform(context)
    if isinstance(value, Iterable):
        return "".join(text(context, part) for part in value)
    raise LaunchError(f"{value!r} is no text; write a str, a substitution, or a list of both")


def pairs(value: Any, what: str, place: str) -> list[tuple[Any, Any]]:
    """A dict, or a list of pairs, as a list of pairs. Raises LaunchError for anything else."""
    found = list(value.items() if hasattr(value, "items") else value or ())
    if any(isinstance(each, str) or not isinstance(each, list | tuple) or len(each) != 2 for each in found):
        raise LaunchError(f"{what}={value!r:.80} is no list of pairs; write such as [('cmd_vel', '/drive')]", place)
    return [(each[0], each[1]) for each in found]


def shown(value: Text) -> str:
    """A text as it can be shown before the launch file runs."""
    if isinstance(value, str | os.PathLike):
        return os.fspath(value)
    if isinstance(value, Substitution):
        return f"<{value.describe()}>"
    return "".join(map(shown, value)) if isinstance(value, Iterable) else str(value)


def truth(context: "LaunchContext", value: Any, what: str) -> bool:
    """Whether a text says true. Raises LaunchError."""
    word = str(value) if isinstance(value, bool | int) else text(context, value)
    if word.strip().lower() not in (*_TRUE, *_FALSE):
        raise LaunchError(f"{what} is {word!r}; it has to be true or false")
    return word.strip().lower() in _TRUE


def number(context: "LaunchContext", value: Any, what: str) -> float:
    """The number, not below zero, that a text says. Raises LaunchError."""
    word = str(value) if isinstance(value, int | float) else text(context, value)
    try:
        found = float(word)
    except ValueError:
        found = -1.0
    if not 0.0 <= found < 1e9:
        raise LaunchError(f"{what} is {word!r}; it has to be a number from 0 up")
    return found


def here() -> str:
    """The file and line of the user's code that is running."""
    frame = sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_OURS):
        frame = frame.f_back
    return f"{frame.f_code.co_filename}:{frame.f_lineno}"
