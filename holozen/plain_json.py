"""JSON read without the module `json`, which compiles patterns before it reads anything, for 3 ms.

What reads is the scanner in C that `json` itself uses. Where there is none, or the text is no JSON, `json` is asked.
"""

from __future__ import annotations

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

SPACE = " \t\n\r"  # what may stand around a value


def loads(text: str) -> Any:
    """`json.loads` of a text."""
    try:
        value, end = _scan(text, len(text) - len(text.lstrip(SPACE)))
    except StopIteration:  # no value begins there
        end = 0
    if end == 0 or text[end:].strip(SPACE):
        import json

        return json.loads(text)
    return value


class _Ways:
    """What the scanner asks for: the way json.loads reads by default."""

    strict = True
    object_hook = object_pairs_hook = array_hook = None
    parse_float, parse_int = float, int
    parse_constant = {"NaN": float("nan"), "Infinity": float("inf"), "-Infinity": float("-inf")}.__getitem__
    memo: dict[str, str] = {}  # noqa: RUF012 - of the scanner


def _scanner() -> Callable[[str, int], tuple[Any, int]]:
    try:
        from _json import make_scanner

        ways: Any = _Ways()
        scan: Callable[[str, int], tuple[Any, int]] = make_scanner(ways)
    except (ImportError, AttributeError):
        return lambda text, at: (None, 0)
    return scan


_scan = _scanner()
