"""Values written on the command line, as validated bytes of a message (`topic pub`) or a request (`service call`)."""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from msgspec import to_builtins

from holozen import messages as m
from holozen import wire
from holozen.bus import Bus
from holozen.console import report
from holozen.messages import CodecError, Message, codec
from holozen.messages.message import not_finite
from holozen.suggest import suggest
from holozen.transport.graph import Endpoint

if TYPE_CHECKING:
    from pathlib import Path

    from holozen.messages.definitions import Interface
    from holozen.messages.registry import Registry

LARGEST = 1_000_000  # bytes of a value
TYPE = re.compile(r"\w+/((msg|srv)/)?\w+")
FORCE = "; --force sends it all the same"
Kinds = tuple[type[Message], ...]


def kinds_named(name: str) -> Kinds:
    """Our type of a ROS name, such as geometry_msgs/msg/Twist or geometry_msgs/Twist; empty if we have none."""
    package, _, last = name.replace("/msg/", "/").partition("/")
    ours = [kind for kind in vars(m).values() if isinstance(kind, type) and issubclass(kind, Message)]
    ours += [kind for row in wire.TOPICS for kind in row.types]
    return tuple({kind: 0 for kind in ours if f"{package}/msg/{last}" == kind.ROS})


def kinds_of(types: set[str]) -> Kinds:
    """Our types for the given ROS types: all that the wire table's row accepts, if there is one."""
    row = next((row for row in wire.TOPICS if {kind.ROS for kind in row.types} & types), None)
    return row.types if row else next((found for name in sorted(types) if (found := kinds_named(name))), ())


def read_message(text: str, kinds: Kinds) -> Message:
    """The message that `text` (JSON or YAML, or - for standard input) describes. Raises ValueError with the reason."""
    message = draft(text, kinds)
    codec.encode(message)  # fail now if it cannot be sent
    return message


def draft(text: str, kinds: Kinds) -> Message:
    """`read_message` that accepts numbers that are not finite."""
    return message(plain(text), kinds)


def message(value: Any, kinds: Kinds) -> Message:
    """`draft` of a plain value."""
    try:
        return codec.convert(value, kinds)
    except CodecError as error:
        raise ValueError(f"{error}{_field_hint(str(error), value, kinds)}") from None


def forced(message: Message, name: str) -> bytes:
    """The bytes of a message with numbers that are not finite, which `codec.encode` refuses."""
    if name == "json":
        return json.dumps(to_builtins(message)).encode()
    import msgspec

    if name == "msgpack":
        return msgspec.msgpack.encode(message)
    from holozen.messages import cdr
    from holozen.messages.registry import Registry

    return cdr.write(Registry().find(message.ROS), to_builtins(message))


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
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"neither JSON nor YAML: {' '.join(str(error).split())}") from None


def _field_hint(reason: str, value: Any, kinds: Kinds) -> str:
    """The valid names in place of an unknown field in `reason`, the closest first."""
    word = reason.partition("unknown field `")[2].partition("`")[0]
    if not word:
        return ""
    place = reason.partition(" - at `$.")[2].partition("`")[0]
    known: Any = {}
    for kind in kinds:
        known = to_builtins(kind())
        for name in filter(None, place.split(".")):
            known = known.get(name, {}) if isinstance(known, dict) else {}
        if known:
            break
    names = list(known) if isinstance(known, dict) else []
    return f"{suggest(word, names)}; there are {', '.join(names) or 'none'}"


class Ours:
    """Encodes values as one of our types, the first of `kinds` that fits."""

    def __init__(self, kinds: Kinds, key: str, encoding: str, force: bool) -> None:
        self.kind, self._kinds, self._wire, self._force = kinds[0], kinds, encoding, force
        self._is_command = wire.is_command(key, kinds)

    def payload(self, text: str) -> bytes:
        """The bytes of a written value; sets `kind` to its type. Raises ValueError with the reason."""
        message = draft(text, self._kinds)
        self.kind = type(message)
        self._kinds = (self.kind,) if len(self._kinds) == 1 else self._kinds
        if (bad := not_finite(message)) and self._force:
            return forced(message, self._wire)
        if bad:
            raise ValueError(f"{self.kind.__name__}.{bad} is not a finite number{FORCE}")
        if self._is_command and not self._force and (bad := wire.implausible(message)):
            raise ValueError(f"{self.kind.__name__}.{bad}{FORCE}")
        return codec.encode(message, self._wire)

    def stop(self) -> bytes | None:
        """The bytes that stop a robot; None if this is no command."""
        moves = self.kind.__name__ in ("Twist", "TwistStamped")
        return codec.encode(self.kind(), self._wire) if moves else None


class Foreign:
    """Encodes values as any type that has a definition."""

    def __init__(self, interface: Interface, wire: str, force: bool) -> None:
        self._interface, self._wire, self._force = interface, wire, force
        self.kind: type[Message] = type("Foreign", (Message,), {"__module__": __name__})
        self.kind.ROS = interface.name  # not the name that follows from the module

    def payload(self, text: str) -> bytes:
        """The bytes of a written value. Raises ValueError with the reason."""
        from holozen.messages.definitions import completed

        value: Any = completed(self._interface, plain(text))  # not_finite walks plain dicts too
        if not self._force and (bad := not_finite(value)):
            raise ValueError(f"{bad} is not a finite number{FORCE}")
        if self._wire == "cdr":
            from holozen.messages import cdr

            return cdr.write(self._interface, value)
        if self._wire == "msgpack":
            import msgspec

            return msgspec.msgpack.encode(value)
        return json.dumps(value).encode()

    def stop(self) -> bytes | None:
        """None: no command of ours."""
        return None


Form = Ours | Foreign


def form_named(name: str, key: str, wire: str, force: bool, packages: Iterable[tuple[str, Path]] = ()) -> Form:
    """The form of a type for a `key`; `packages` are those of `--package`. Raises ValueError for an unknown type,
    naming the closest known one.
    """
    given = dict(packages)
    if name.partition("/")[0] not in given and (kinds := kinds_named(name)):
        return Ours(kinds, key, wire, force)
    from holozen.messages.registry import Registry

    return Foreign(Registry(given).find(name), wire, force)


def request(bus: Bus, args: argparse.Namespace, text: str, given: str) -> tuple[bytes, str]:
    """The bytes of the request that `text` describes, and the service's type, empty if unknown.

    `given` is the type from the command line, or empty. Raises ValueError with the reason.
    """
    text = sys.stdin.read(LARGEST + 1) if text == "-" else text
    row = wire.service(args.key)
    name, wrong = _full(given), ""
    if row and name in ("", row.reply.ROS):
        try:
            return _by_row(text, row), row.reply.ROS
        except ValueError as error:
            wrong = f"{args.key}: refused: {error}"  # unless its server has another type
    servers = [end for end in bus.endpoints() if end.kind == "srv"]
    announced = next((end.type for end in servers if end.key == args.key), "")
    if wrong and announced in ("", name, row.reply.ROS if row else ""):
        raise ValueError(wrong)
    from holozen.messages.registry import Registry  # here, since most calls need only our definitions

    registry = Registry(dict(args.package))
    kind = _known(registry, announced or (row.reply.ROS if row else ""))
    if name:
        kind = _given(registry, args.key, name, kind, announced)
    if not (kind or announced or args.any):
        raise ValueError(_untyped(args.key, servers))
    try:
        return _by_type(text, kind), kind.name if kind else ""
    except ValueError as error:
        raise ValueError(f"{args.key}: refused: {error}") from None


def _full(given: str) -> str:
    """A service's type in the form of ROS 2, also from PACKAGE/NAME."""
    return given.replace("/", "/srv/") if given.count("/") == 1 else given


def _by_row(text: str, row: wire.Service) -> bytes:
    """The request of the wire table's type. Omitted fields stay out, since the server may have another type."""
    value = plain(text)
    filled = json.loads(codec.encode(message(value, (row.request,))))
    return json.dumps({name: inner for name, inner in filled.items() if name in value}).encode()


def _by_type(text: str, kind: Interface | None) -> bytes:
    if kind and kind.request:
        return Foreign(kind.request, "json", force=False).payload(text)
    return json.dumps(plain(text), default=str).encode()


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
    known = [service.key for service in wire.SERVICES]
    near = suggest(key, dict.fromkeys([*(end.key for end in servers), *known]))
    return f"{key!r} has no known type{near}; known: {', '.join(known)}; give the type, or --any"
