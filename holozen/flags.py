"""Flags: checked values, and the parser, which is loaded when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    from holozen.parser import Formatter as Formatter
    from holozen.parser import Parser as Parser


def __getattr__(name: str) -> Any:
    if name not in ("Formatter", "Parser"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from holozen import parser

    return getattr(parser, name)


def refused(text: str) -> Exception:
    """The error of a parser for a value, with what is wrong."""
    from argparse import ArgumentTypeError

    return ArgumentTypeError(text)


def number(low: float, high: float, unit: str = "") -> Callable[[str], float]:
    """A parser for a finite number from `low` to `high`."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise refused(f"{text!r}: use a number from {low:g} to {high:g} {unit}".rstrip())
        return value

    return parse


def count(low: int = 0) -> Callable[[str], int]:
    """A parser for a whole number from `low` up."""

    def parse(text: str) -> int:
        if not text.isdecimal() or int(text) < low:
            raise refused(f"{text!r}: use a whole number from {low} up")
        return int(text)

    return parse


def nearest(word: str, words: Iterable[str]) -> str:
    """`; did you mean ...?` with the closest of `words`; empty if none is close. For the end of a line that refuses."""
    from difflib import SequenceMatcher

    def likeness(other: str) -> float:
        """How alike they are; a word that was not written to its end is nearly as good."""
        whole, start = (SequenceMatcher(None, word, text).ratio() for text in (other, other[: len(word)]))
        return max(whole, 0.95 * start)

    closest = max(words, key=likeness, default="")
    return f"; did you mean {closest!r}?" if closest and likeness(closest) > 0.65 else ""


def key(text: str) -> str:
    """A parser for a key; ROS's leading slash is taken off, which no Zenoh key has."""
    return text.removeprefix("/")


def robot(text: str) -> str:
    """A parser for a robot's name; an empty one is the robot at the root."""
    from holozen.wire import robot_name

    try:
        return robot_name(text) if text else ""
    except ValueError as error:
        raise refused(str(error)) from None


def package(text: str) -> tuple[str, Path]:
    """A parser for NAME=DIR, a package and its folder."""
    from pathlib import Path

    name, equals, folder = text.partition("=")
    if not (name and equals and folder):
        raise refused(f"{text!r}: write NAME=DIR, such as holo=~/ws/src/holo")
    return name, Path(folder).expanduser()


def robot_file(text: str) -> tuple[Path, str]:
    """A parser for FILE or FILE=NAME, a robot's file and its name."""
    from pathlib import Path

    path, equals, name = text.rpartition("=")
    if not equals or Path(text).exists():
        return Path(text), ""
    return Path(path), robot(name)
