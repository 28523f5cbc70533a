"""Values written on the command line, as JSON or YAML."""

from __future__ import annotations

import json
import re
import sys
import time
from collections import Counter
from typing import TYPE_CHECKING, Any

from holozen.limits import not_finite
from holozen.suggest import cut, yaml_problem

if TYPE_CHECKING:
    from holozen.messages.definitions import Interface

LARGEST = 1_000_000  # bytes of a value
ODD_NUMBER = re.compile(r".*[:_]|[-+]?0\d")
"""1:30, 1_0 and 010: YAML 1.1 reads them as 90, 10 and 8, and who wrote them may not know that."""
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
    """The fields that `text` gives a message of a type. Omitted ones are not added: a node of
    another version may not know them. Raises ValueError for fields that do not fit the type, and
    for numbers that are not finite.
    """
    from holozen.messages.definitions import completed

    value = plain(text)
    whole = completed(kind, value)
    if bad := not_finite(whole):
        raise ValueError(f"{bad} is not a finite number")
    return {name: whole[name] for name in value}


def is_time_dependent(text: str) -> bool:
    """Whether a value may have `header: auto` or `stamp: now`, for which each message needs the
    time anew.
    """
    return "auto" in text or "now" in text


def _read(text: str) -> Any:
    try:
        return json.loads(text, object_pairs_hook=_unique)
    except ValueError as error:
        return _yaml(text, error)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object. Raises ValueError if it has a name twice: which value was meant is unknown."""
    if (double := _double([name for name, _ in pairs])) is not None:
        raise ValueError(f"{cut(double)} is given twice")
    return dict(pairs)


def _double(names: list[str]) -> str | None:
    """The first name that is there twice."""
    return next((name for name, times in Counter(names).items() if times > 1), None)


def _timed(value: Any) -> Any:
    """A value with `header: auto` and `stamp: now` replaced by the current time, as in `ros2 topic
    pub`.
    """
    if isinstance(value, list):
        return [_timed(inner) for inner in value]
    if not isinstance(value, dict):
        return value
    sec, nanosec = divmod(time.time_ns(), 1_000_000_000)
    stamp = {"sec": sec, "nanosec": nanosec}
    filled = {("header", "auto"): {"stamp": stamp}, ("stamp", "now"): stamp}
    return {
        name: filled[name, inner]
        if isinstance(inner, str) and (name, inner) in filled
        else _timed(inner)
        for name, inner in value.items()
    }


def _yaml(text: str, why_no_json: ValueError) -> Any:
    try:
        import yaml
    except ModuleNotFoundError:
        raise ValueError(
            f"{cut(text)} is not valid JSON: {why_no_json}; to write YAML: pip install pyyaml"
        ) from None

    class Loader(yaml.SafeLoader):
        """Reads numbers as YAML 1.2 and JSON do: 1e-3 is one, without a decimal point. Refuses a
        name that is given twice.
        """

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            double = _double([name.value for name, _ in node.value if isinstance(name.value, str)])
            if double is not None:
                raise yaml.constructor.ConstructorError(
                    None, None, f"{cut(double)} is given twice", node.start_mark
                )
            return super().construct_mapping(node, deep)

    def number(loader: Loader, node: Any) -> Any:
        if ODD_NUMBER.match(node.value):
            return node.value
        read = (
            loader.construct_yaml_int if node.tag.endswith(":int") else loader.construct_yaml_float
        )
        return read(node)

    for kind in ("int", "float"):
        Loader.add_constructor(f"tag:yaml.org,2002:{kind}", number)
    Loader.add_implicit_resolver("tag:yaml.org,2002:float", EXPONENT, list("-+.0123456789"))
    try:
        return yaml.load(text, Loader)
    except yaml.YAMLError as error:
        raise ValueError(f"{cut(text)} is not valid JSON or YAML: {yaml_problem(error)}") from None
