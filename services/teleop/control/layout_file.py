"""Reads a layout from a TOML file, and checks it."""

import os
import re
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from .. import toml_file
from ..toml_file import InputError, cut, one_of
from .layouts import ACTIONS, FIXED, LAYOUTS, Direction, KeyNameError, Layout, key_name

T = TypeVar("T")

MOTIONS: dict[str, Direction] = {
    "forward": (1, 0, 0, 0),
    "back": (-1, 0, 0, 0),
    "left": (0, 1, 0, 0),
    "right": (0, -1, 0, 0),
    "up": (0, 0, 1, 0),
    "down": (0, 0, -1, 0),
    "turn-left": (0, 0, 0, 1),
    "turn-right": (0, 0, 0, -1),
}
MAX_PERCENT = 90.0
_FACTOR = re.compile(r"(\S+)\s+([+-]\d{1,3}(?:\.\d{1,3})?)\s?%")
_TOP = ["name", "positional", "moves", "speeds", "actions"]


def load(name_or_path: str) -> Layout:
    """The layout with this name, or else the one in this file. Raises InputError."""
    return LAYOUTS.get(name_or_path) or read(name_or_path)


def read(path: str) -> Layout:
    """The layout in the file at `path`. Raises InputError."""
    if not os.path.lexists(path) and os.sep not in path:
        raise InputError(f"{path}: no such file, and no such layout{one_of(path, [*LAYOUTS])}")
    try:
        return _layout(path, toml_file.read(path))
    except _Wrong as error:
        raise InputError(f"{path}: {error}") from None


class _Wrong(ValueError):
    """An error in the file; the text begins with its place."""


def _layout(path: str, found: Mapping[str, Any]) -> Layout:
    for name in found:
        if name not in _TOP:
            raise _Wrong(f"{cut(name)} is unknown{one_of(name, _TOP)}")
    name = found.get("name", os.path.splitext(os.path.basename(path))[0])
    if not isinstance(name, str) or not (0 < len(name) <= 40) or not name.isprintable():
        raise _Wrong(f"name is {cut(name)}; write up to 40 letters in quotes")
    positional = found.get("positional", False)
    if not isinstance(positional, bool):
        raise _Wrong(f"positional is {cut(positional)}; write true or false")
    taken: dict[str, str] = {}
    moves = _section(found, "moves", _motion, taken)
    speeds = _section(found, "speeds", _factors, taken)
    actions = _section(found, "actions", _action, taken)
    if not moves:
        raise _Wrong(
            '[moves] has no key, so nothing would drive; write lines such as w = "forward"'
        )
    return Layout(name, moves, speeds, {**FIXED, **actions}, positional)


def _section(
    found: Mapping[str, Any], section: str, meaning: Callable[[str], T], taken: dict[str, str]
) -> dict[str, T]:
    """The meanings in a section, by canonical key names. `taken`, the keys of earlier sections, is
    extended.
    """
    lines = found.get(section, {})
    if not isinstance(lines, dict):
        raise _Wrong(f"{section} is {cut(lines)}; write a section [{section}] of lines")
    entries: dict[str, T] = {}
    for key, value in lines.items():
        try:
            entries[_key(key, section, taken)] = _meaning(meaning, value)
        except (KeyNameError, _Wrong) as error:
            raise _Wrong(f"[{section}] {cut(key)} {error}") from None
    return entries


def _key(text: str, section: str, taken: dict[str, str]) -> str:
    name = key_name(text)
    if name in FIXED:
        raise _Wrong(f"is fixed: it means {FIXED[name]} in every layout")
    if name in taken:
        raise _Wrong(f"is given twice, before in [{taken[name]}]")
    taken[name] = section
    return name


def _meaning(meaning: Callable[[str], T], value: object) -> T:
    if not isinstance(value, str):
        # A dotted key without quotes is a table to TOML.
        raise _Wrong(f"= {cut(value)}; put key and meaning in quotes")
    try:
        return meaning(value)
    except _Wrong as error:
        raise _Wrong(f"= {cut(value)}: {error}") from None


def _motion(text: str) -> Direction:
    total = [0, 0, 0, 0]
    for word in text.split("+"):
        one = MOTIONS.get(word.strip())
        if one is None:
            raise _Wrong(f"{cut(word.strip())} is not a motion{one_of(word.strip(), [*MOTIONS])}")
        axis = next(index for index, value in enumerate(one) if value)
        if total[axis]:
            raise _Wrong(f"{cut(word.strip())} is there already, or its opposite")
        total[axis] = one[axis]
    return (total[0], total[1], total[2], total[3])


def _factors(text: str) -> tuple[float, float]:
    match = _FACTOR.fullmatch(text.strip())
    if not match or abs(float(match[2])) > MAX_PERCENT:
        raise _Wrong(
            f"write both, speed or turn and up to {MAX_PERCENT:.0f} %, such as 'both +10%'"
        )
    factor = round(1 + float(match[2]) / 100, 6)
    which = {"both": (factor, factor), "speed": (factor, 1.0), "turn": (1.0, factor)}
    if match[1] not in which:
        raise _Wrong(f"{cut(match[1])} is unknown{one_of(match[1], [*which])}")
    return which[match[1]]


def _action(text: str) -> str:
    if text not in ACTIONS:
        raise _Wrong(f"is unknown{one_of(text, [*ACTIONS])}")
    return text
