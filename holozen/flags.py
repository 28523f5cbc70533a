"""Checked values for command-line flags."""

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def number(low: float, high: float, unit: str = "") -> Callable[[str], float]:
    """A parser for a finite number from `low` to `high`."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: use a number from {low:g} to {high:g} {unit}".rstrip())
        return value

    return parse


def count(low: int = 0) -> Callable[[str], int]:
    """A parser for a whole number from `low` up."""

    def parse(text: str) -> int:
        if not text.isdecimal() or int(text) < low:
            raise argparse.ArgumentTypeError(f"{text!r}: use a whole number from {low} up")
        return int(text)

    return parse


def key(text: str) -> str:
    """A parser for a key; ROS's leading slash is taken off, which no Zenoh key has."""
    return text.removeprefix("/")


def robot(text: str) -> str:
    """A parser for a robot's name; an empty one is the robot at the root."""
    from holozen.wire import robot_name

    try:
        return robot_name(text) if text else ""
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def package(text: str) -> "tuple[str, Path]":
    """A parser for NAME=DIR, a package and its folder."""
    from pathlib import Path

    name, equals, folder = text.partition("=")
    if not (name and equals and folder):
        raise argparse.ArgumentTypeError(f"{text!r}: write NAME=DIR, such as holo=~/ws/src/holo")
    return name, Path(folder).expanduser()


def robot_file(text: str) -> "tuple[Path, str]":
    """A parser for FILE or FILE=NAME, a robot's file and its name."""
    from pathlib import Path

    path, equals, name = text.rpartition("=")
    if not equals or Path(text).exists():
        return Path(text), ""
    return Path(path), robot(name)
