"""Values written on the command line, as JSON or YAML."""

from __future__ import annotations

import json
import re
import sys
import time
from typing import TYPE_CHECKING, Any

from holozen.limits import not_finite
from holozen.suggest import cut

if TYPE_CHECKING:
    from holozen.messages.definitions import Interface

LARGEST = 1_000_000  # bytes of a value
EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")


def plain(text: str) -> Any:
    """The value that JSON or YAML describes; - reads standard input. Raises ValueError."""
    if text == "-":
        text = sys.stdin.read(LARGEST + 1)
    if len(text) > LARGEST:
        raise ValueError(f"the value is longer than {LARGEST} bytes")
    try:
        value = _read(text)
        return _timed(value) if is_time_dependent(text) else value
    except RecursionError:
        raise ValueError("the value is nested too deeply") from None


def checked(text: str, kind: Interface) -> dict[str, Any]:
    """The fields that `text` gives a message of a type. Omitted ones are not added: a node of another version may not
    know them. Raises ValueError for fields that do not fit the type, and for numbers that are not finite.
    """
    from holozen.messages.definitions import completed

    value = plain(text)
    whole = completed(kind, value)
    if bad := not_finite(whole):
        raise ValueError(f"{bad} is not a finite number")
    return {name: whole[name] for name in value}


def is_time_dependent(text: str) -> bool:
    """Whether a value may have `header: auto` or `stamp: now`, for which each message needs the time anew."""
    return "auto" in text or "now" in text


def _read(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError as error:
        return _yaml(text, error)


def _timed(value: Any) -> Any:
    """A value with `header: auto` and `stamp: now` replaced by the current time, as in `ros2 topic pub`."""
    if isinstance(value, list):
        return [_timed(inner) for inner in value]
    if not isinstance(value, dict):
        return value
    sec, nanosec = divmod(time.time_ns(), 1_000_000_000)
    stamp = {"sec": sec, "nanosec": nanosec}
    filled = {("header", "auto"): {"stamp": stamp}, ("stamp", "now"): stamp}
    return {
        name: filled[name, inner] if isinstance(inner, str) and (name, inner) in filled else _timed(inner)
        for name, inner in value.items()
    }


def _yaml(text: str, why_no_json: ValueError) -> Any:
    try:
        import yaml
    except ModuleNotFoundError:
        raise ValueError(f"{cut(text)} is not valid JSON: {why_no_json}; to write YAML: pip install pyyaml") from None

    class Loader(yaml.SafeLoader):
        """Reads 1e-3 as a number, as YAML 1.2 and JSON do; YAML 1.1 requires a decimal point."""

    Loader.add_implicit_resolver("tag:yaml.org,2002:float", EXPONENT, list("-+.0123456789"))
    try:
        return yaml.load(text, Loader)
    except yaml.YAMLError as error:
        why = getattr(error, "problem", None) or " ".join(str(error).split())
        mark = getattr(error, "problem_mark", None)
        where = f" (line {mark.line + 1}, column {mark.column + 1})" if mark else ""
        raise ValueError(f"{cut(text)} is not valid JSON or YAML: {why}{where}") from None
