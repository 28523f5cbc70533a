"""Finds the numbers of a message that are NaN or infinite."""

import math
from collections.abc import Iterator
from typing import Any

import msgspec

from holozen.arrays import suspects
from holozen.messages import Message


def not_finite(message: Message) -> str:
    """The path of the first number in `message` that is NaN or infinite, such as `linear.x`; else empty."""
    return next(_bad_numbers(msgspec.to_builtins(message, enc_hook=suspects), ""), "")


def _bad_numbers(value: Any, path: str) -> Iterator[str]:
    if isinstance(value, float) and not math.isfinite(value):
        yield path
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _bad_numbers(inner, f"{path}.{name}" if path else name)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _bad_numbers(inner, f"{path}[{index}]")
