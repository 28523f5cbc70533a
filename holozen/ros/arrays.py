"""Fields that hold an array of numbers (`array.array`), as in ROS: sequences of all numbers but bool and byte."""

import struct
from array import array
from collections.abc import Callable
from typing import Any

from holozen.arrays import CODES, packed
from holozen.cdr import CodecError
from holozen.interfaces import Field

# How numpy names its whole numbers of 64 bits depends on the machine.
_LONGS = dict(zip("lL", "qQ" if struct.calcsize("l") == 8 else "iI", strict=True))


def code(field: Field) -> str:
    """The typecode of a field's array; empty for a field that holds no array."""
    return CODES.get(field.type, "") if field.array in ("sequence", "bounded") else ""


def check(field: Field, listed: Callable[[Any], list[Any]]) -> Callable[[Any], Any]:
    """The check of such a field. As in ROS, an array of its typecode is the one that is held; all else is copied.

    `listed` gives what else is assigned as a list of what the field takes, or raises.
    """
    kind, most = code(field), field.bound

    def checked(given: Any) -> Any:
        values = given if type(given) is array and given.typecode == kind else _copied(kind, given)
        if values is None or 0 < most < len(values):
            return packed(kind, listed(given))
        return values

    return checked


def settled(owner: str, field: Field) -> Callable[[Any], Any]:
    """The check of an array before it is written: of its length, as numbers may have been appended."""

    def of(values: Any) -> Any:
        if 0 < field.bound < len(values):
            raise CodecError(f"{owner}.{field.name}: {len(values)} values is not what a {field.spelled()} holds")
        return values

    return of


def filled(name: str, kind: str, values: list[Any]) -> "array[Any]":
    """The array of what a reader gave as a list, of the field `name`. Raises ValueError, which readers tell."""
    try:
        return packed(kind, values)
    except (OverflowError, struct.error):
        index = next(index for index, value in enumerate(values) if not _fits(kind, value))
        raise ValueError(f"{name}[{index}] of {values[index]!r} is too large") from None


def _fits(kind: str, value: Any) -> bool:
    try:
        return bool(packed(kind, [value]))
    except (OverflowError, struct.error):
        return False


def _copied(kind: str, given: Any) -> "array[Any] | None":
    """An array of the same numbers, from what lies in memory as one does (bytes, numpy); None for all else."""
    if type(given) is list:
        return None
    try:
        view = memoryview(given)
    except (TypeError, ValueError):
        return None
    if view.ndim != 1 or _LONGS.get(view.format, view.format) != kind:
        return None
    made: array[Any] = array(kind)
    made.frombytes(view.tobytes())
    return made
