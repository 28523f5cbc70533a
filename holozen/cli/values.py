"""Values written on the command line, as JSON or YAML: plain, or as the validated bytes of a request."""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from holozen.console import report
from holozen.limits import not_finite
from holozen.suggest import suggest
from holozen.transport.graph import Endpoint

if TYPE_CHECKING:
    from holozen.messages.definitions import Interface
    from holozen.messages.registry import Registry

LARGEST = 1_000_000  # bytes of a value
TYPE = re.compile(r"\w+/((msg|srv)/)?\w+")
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


def is_time_dependent(text: str) -> bool:
    """Whether a value may have `header: auto` or `stamp: now`, which must be filled in anew for each message."""
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
        raise ValueError(f"no JSON: {why_no_json}; to write YAML: pip install pyyaml") from None

    class Loader(yaml.SafeLoader):
        """As YAML 1.2 and JSON, it takes 1e-3 for a number; YAML 1.1 asks for a point."""

    Loader.add_implicit_resolver("tag:yaml.org,2002:float", EXPONENT, list("-+.0123456789"))
    try:
        return yaml.load(text, Loader)
    except yaml.YAMLError as error:
        raise ValueError(f"neither JSON nor YAML: {' '.join(str(error).split())}") from None


def request(found: Iterable[Endpoint], args: argparse.Namespace, text: str, given: str) -> tuple[bytes, str]:
    """The bytes of the request that `text` describes, and the service's type, empty if unknown.

    `found` are the endpoints of all nodes; `given` is the type from the command line, or empty. Raises ValueError with
    the reason.
    """
    from holozen.messages.registry import Registry  # here, since `topic pub` needs only our own types

    text = sys.stdin.read(LARGEST + 1) if text == "-" else text
    servers = [end for end in found if end.kind == "srv"]
    announced = next((end.type for end in servers if end.key == args.key), "")
    registry = Registry(dict(args.package))
    kind = _known(registry, announced or _usual(args.key))
    if name := _full(given):
        kind = _given(registry, args.key, name, kind, announced)
    if not (kind or announced or args.any):
        raise ValueError(_untyped(args.key, servers))
    try:
        return _payload(text, kind), kind.name if kind else ""
    except ValueError as error:
        raise ValueError(f"{args.key}: refused: {error}") from None


def _usual(key: str) -> str:
    """The type of a service that no node has now, by the wire table; empty if that does not have it."""
    from holozen import wire  # loads all messages, which a call of a service that is there does not need

    row = wire.service(key)
    return row.reply.ROS if row else ""


def _full(given: str) -> str:
    """A service's type in the form of ROS 2, also from PACKAGE/NAME."""
    return given.replace("/", "/srv/") if given.count("/") == 1 else given


def _payload(text: str, kind: Interface | None) -> bytes:
    """In JSON. Omitted fields stay out: a server of another version may not know them."""
    from holozen.messages.definitions import completed

    value = plain(text)
    if kind and kind.request:
        checked = completed(kind.request, value)
        if bad := not_finite(checked):
            raise ValueError(f"{bad} is not a finite number")
        value = {name: checked[name] for name in value}
    return json.dumps(value, default=str).encode()


def _known(registry: Registry, name: str) -> Interface | None:
    try:
        return registry.find(name) if name else None
    except ValueError:
        return None


def _given(registry: Registry, key: str, name: str, other: Interface | None, announced: str) -> Interface | None:
    """The definition of the given type; `other` and `announced`: definition and name of the key's type, if known.

    If its definition is missing, the key's type is used if it has the same name. Raises ValueError.
    """
    actual = other.name if other else announced
    try:
        found = registry.find(name)
    except ValueError as error:
        if name == actual:
            return None  # the server validates the request
        lost = not registry.places.names(name.partition("/")[0])
        if not (lost and name.rpartition("/")[2] == actual.rpartition("/")[2]):
            raise ValueError(f"{key}: {error}{f'; its type is {actual}' if actual else ''}") from None
        report(f"holozen service call: {error}; until then the request is checked as {actual}, which {key} has")
        return other
    if not found.request:
        raise ValueError(f"{key}: {name} is a message; a service has a type such as std_srvs/srv/Trigger")
    if other and _fields(found) != _fields(other):
        raise ValueError(f"{key}: its type is {actual}, not {name}")
    return found


def _fields(kind: Interface) -> list[list[str]]:
    """The field names of a service's request and response; compatible types have the same."""
    return [[field.name for field in half.fields] for half in (kind.request, kind.response) if half]


def _untyped(key: str, servers: list[Endpoint]) -> str:
    from holozen import wire

    known = [service.key for service in wire.SERVICES]
    near = suggest(key, dict.fromkeys([*(end.key for end in servers), *known]))
    return f"{key!r} has no known type{near}; known: {', '.join(known)}; give the type, or --any"
