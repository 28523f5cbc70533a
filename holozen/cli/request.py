"""What is sent to a service: a written value, checked by the type given, that of its server, or that of our table.

It is written as JSON, which every service reads; what the server says of it decides the rest.
"""

import json
import sys

from holozen import codec, wire
from holozen.bus import Bus
from holozen.cli import forms, values
from holozen.flags import nearest
from holozen.tell import say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse

    from holozen.graph import Endpoint
    from holozen.interfaces import Interface, Registry


def written(bus: Bus, args: "argparse.Namespace", text: str, given: str) -> tuple[bytes, str]:
    """The bytes of the request that `text` describes, and the service's type, empty if nobody knows it.

    `given` is the type that was given, or empty. Raises ValueError with the reason.
    """
    text = sys.stdin.read(values.LARGEST + 1) if text == "-" else text
    row = wire.service(args.key)
    name, wrong = _full(given), ""
    if row and name in ("", row.reply.ROS):
        try:
            return _by_row(text, row), row.reply.ROS
        except ValueError as error:
            wrong = f"{args.key}: refused: {error}"  # unless its server has another type
    servers = [end for end in bus.graph().settled(bus.connected) if end.kind == "srv"]
    told = next((end.type for end in servers if end.key == args.key), "")
    if wrong and told in ("", name, row.reply.ROS if row else ""):
        raise ValueError(wrong)
    from holozen.interfaces import Registry  # not sooner: most calls need no other definition than ours

    registry = Registry(dict(args.package))
    kind = _known(registry, told or (row.reply.ROS if row else ""))
    if name:
        kind = _given(registry, args.key, name, kind, told)
    if not (kind or told or args.any):
        raise ValueError(_untyped(args.key, servers))
    try:
        return _by_type(text, kind), kind.name if kind else ""
    except ValueError as error:
        raise ValueError(f"{args.key}: refused: {error}") from None


def _full(given: str) -> str:
    """A service's type as ROS 2 writes it, from PACKAGE/NAME too."""
    return given.replace("/", "/srv/") if given.count("/") == 1 else given


def _by_row(text: str, row: wire.Service) -> bytes:
    """As the table says. What was left out is left out here: its server may know the key by another type."""
    value = values.plain(text)
    filled = json.loads(codec.encode(values.message(value, (row.request,))))
    return json.dumps({name: inner for name, inner in filled.items() if name in value}).encode()


def _by_type(text: str, kind: "Interface | None") -> bytes:
    if kind and kind.request:
        return forms.Foreign(kind.request, "json", force=False).payload(text)
    return json.dumps(values.plain(text), default=str).encode()


def _known(registry: "Registry", name: str) -> "Interface | None":
    try:
        return registry.find(name) if name else None
    except ValueError:
        return None


def _given(registry: "Registry", key: str, name: str, other: "Interface | None", told: str) -> "Interface | None":
    """The type that was given; `other` and `told` are the one of the key, as far as it is known, and its name.

    Where its definition is missing, one of the same name in another package stands in. Raises ValueError.
    """
    told = other.name if other else told
    try:
        found = registry.find(name)
    except ValueError as error:
        if name == told:
            return None  # its server checks what is sent
        lost = not registry.places.names(name.partition("/")[0])
        if not (lost and name.rpartition("/")[2] == told.rpartition("/")[2]):
            raise ValueError(f"{key}: {error}{f'; its type is {told}' if told else ''}") from None
        say(f"holozen service call: {error}; until then the request is checked as {told}, which {key} has")
        return other
    if not found.request:
        raise ValueError(f"{key}: {name} is a message; a service has a type such as std_srvs/srv/Trigger")
    if other and _fields(found) != _fields(other):
        raise ValueError(f"{key}: its type is {told}, not {name}")
    return found


def _fields(kind: "Interface") -> list[list[str]]:
    """The names of a service's fields: what may pass for it has the same."""
    return [[field.name for field in half.fields] for half in (kind.request, kind.response) if half]


def _untyped(key: str, servers: "list[Endpoint]") -> str:
    known = [service.key for service in wire.SERVICES]
    near = nearest(key, dict.fromkeys([*(end.key for end in servers), *known]))
    return f"{key!r} has no known type{near}; known: {', '.join(known)}; give the type, or --any"
