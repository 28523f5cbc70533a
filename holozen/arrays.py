"""Arrays of numbers (`array.array`) within messages. On the wire they are lists; msgspec does not know them."""

import struct
from array import array
from collections.abc import Sequence
from math import isfinite
from typing import Any

CODES = {
    "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q",
    "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""The typecodes of those numbers of ROS that have one."""


def packed(code: str, values: Sequence[Any]) -> "array[Any]":
    """The array of a list of numbers. Raises OverflowError for one beyond a float32, struct.error for an integer."""
    if code == "B":
        return array(code, bytes(values))
    made: array[Any] = array(code)
    made.frombytes(struct.pack(f"={len(values)}{code}", *values))
    return made


def listed(value: Any) -> list[Any]:
    """An array as a list. Raises TypeError for anything else."""
    if isinstance(value, array):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} is nothing that a message holds")


def suspects(value: Any) -> list[Any]:
    """An array as a list if some of its numbers may be no finite ones, else an empty list. Raises TypeError."""
    if isinstance(value, array) and (value.typecode not in "fd" or isfinite(sum(value))):
        return []
    return listed(value)
