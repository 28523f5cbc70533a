"""`holozen service`: inspect services, and call them."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

from holozen import wire
from holozen.background import background
from holozen.bus import Bus
from holozen.cli.hints import suggest_key
from holozen.cli.verb import (
    Noun,
    Verb,
    argument,
    by_name,
    key_argument,
    list_arguments,
    on_node,
    open_bus,
    type_and_value,
)
from holozen.console import Failure, report
from holozen.flags import add_packages, key, number
from holozen.output import Hex, SampleReader, lines
from holozen.process import deferred_interrupt
from holozen.suggest import suggest
from holozen.transport.errors import NoReply
from holozen.transport.graph import Endpoint
from holozen.transport.services import call_bytes

if TYPE_CHECKING:
    from holozen.messages.definitions import Interface
    from holozen.messages.registry import Registry


def call(args: argparse.Namespace) -> int:
    """Send a request and print the reply; a service's error is one line and exit code 1."""
    given, text = type_and_value(args, "srv", "REQUEST")
    with open_bus(args) as bus:
        looking = background(bus.endpoints)
        with deferred_interrupt():  # while the session opens and queries the graph
            from holozen.cli import values  # noqa: F401
            from holozen.messages import definitions, registry  # noqa: F401

        payload, kind = _request(looking(), args, "{}" if text is None else text, given)
        return _call(bus, args, payload, kind)


def _request(
    found: Iterable[Endpoint], args: argparse.Namespace, text: str, given: str
) -> tuple[bytes, str]:
    """The request that `text` describes, as JSON, and the service's type, empty if unknown.

    `found` are the endpoints of all nodes; `given` is the type on the command line, or empty.
    Raises Failure.
    """
    from holozen.cli import values
    from holozen.messages.registry import Registry

    servers = [end for end in found if end.kind == "srv"]
    announced = next((end.type for end in servers if end.key == args.key), "")
    registry = Registry(dict(args.package))
    kind = _known(registry, announced or _usual(args.key))
    if given:
        kind = _given(registry, args.key, given, kind, announced)
    if not (kind or announced or args.any):
        raise Failure(_untyped(args.key, servers))
    try:
        value = values.checked(text, kind.request) if kind and kind.request else values.plain(text)
    except ValueError as error:
        raise Failure(f"{args.key}: refused: {error}") from None
    return json.dumps(value, default=str).encode(), kind.name if kind else ""


def _usual(key: str) -> str:
    """The type of a service that no node has now, by the wire table; empty if that does not have
    it.
    """
    row = wire.service(key)
    return row.type_name if row else ""


def _known(registry: Registry, name: str) -> Interface | None:
    try:
        return registry.find(name) if name else None
    except ValueError:
        return None


def _given(
    registry: Registry, key: str, name: str, other: Interface | None, announced: str
) -> Interface | None:
    """The definition of the type `name` given on the command line; `other` and `announced` are the
    definition and the name of the key's own type, if known.

    If the definition is missing, that of the key's type is used, provided that its name is the
    same. Raises Failure.
    """
    actual = other.name if other else announced
    try:
        found = registry.find(name)
    except ValueError as error:
        if name == actual:
            return None  # the server validates the request
        lost = not registry.places.names(name.partition("/")[0])
        if not (lost and name.rpartition("/")[2] == actual.rpartition("/")[2]):
            raise Failure(f"{key}: {error}{f'; its type is {actual}' if actual else ''}") from None
        report(
            f"holozen service call: {error}; until then the request is checked as {actual}, which "
            f"{key} has"
        )
        return other
    if not found.request:
        raise Failure(
            f"{key}: {name} is a message; a service has a type such as std_srvs/srv/Trigger"
        )
    if other and _fields(found) != _fields(other):
        raise Failure(f"{key}: its type is {actual}, not {name}")
    return found


def _fields(kind: Interface) -> list[list[str]]:
    """The field names of a service's request and response; those of compatible types are equal."""
    return [[field.name for field in half.fields] for half in (kind.request, kind.response) if half]


def _untyped(key: str, servers: list[Endpoint]) -> str:
    known = [service.key for service in wire.SERVICES]
    near = suggest(key, dict.fromkeys([*(end.key for end in servers), *known]))
    return f"{key!r} has no known type{near}; known: {', '.join(known)}; give the type, or --any"


def _call(bus: Bus, args: argparse.Namespace, payload: bytes, kind: str) -> int:
    reader = SampleReader(packages=args.package)
    try:
        _ask(bus, args, payload, reader, kind)
        while args.rate:
            time.sleep(1 / args.rate)
            _ask(bus, args, payload, reader, kind)
    except NoReply as error:
        raise NoReply(f"{error}{suggest_key(bus, [args.key], ('srv',))}") from None
    return 0


def _ask(
    bus: Bus, args: argparse.Namespace, payload: bytes, reader: SampleReader, kind: str
) -> None:
    reply = call_bytes(bus, args.key, payload, "application/json", args.timeout)[0]
    value = reader.read(reply, bus, kind and f"{kind}_Response")
    print(
        json.dumps(value)
        if args.json
        else "\n".join([*lines(value), *(["---"] if args.rate else [])]),
        flush=True,
    )
    if isinstance(value, Hex):
        report(f"holozen service call: {args.key}: the reply could not be decoded: {reader.why}")


def _call_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("key", type=key)
    add("words", nargs="*", metavar="[TYPE] REQUEST", help="JSON or YAML (default: all zeros)")
    add("--any", action="store_true", help="send the request unchecked if its type is unknown")
    add_packages(parser)
    add(
        "-r",
        "--rate",
        type=number(0.01, 1000, "Hz"),
        metavar="HZ",
        help="call again and again, at this rate",
    )
    add(
        "--timeout",
        type=number(0.01, 1e6, "s"),
        default=5.0,
        metavar="S",
        help="seconds to wait (default: 5)",
    )


VERBS = by_name(
    Noun("service", "inspect and call services"),
    Verb(
        "service list",
        "list the services that nodes offer",
        "-t",
        list_arguments("service"),
        on_node("keys", "list_services"),
    ),
    Verb(
        "service type",
        "show a service's type",
        "next_goal",
        key_argument,
        on_node("keys", "service_type"),
    ),
    Verb(
        "service find",
        "find the services of a type",
        "std_srvs/srv/Trigger",
        argument("type", help="such as std_srvs/srv/Trigger, or Trigger"),
        on_node("keys", "find_services"),
    ),
    Verb(
        "service info",
        "show a service's type and servers",
        "next_goal",
        key_argument,
        on_node("keys", "service_info"),
    ),
    Verb(
        "service call",
        "call a service and print its reply",
        """next_goal '{"request_goal": 0}'""",
        _call_arguments,
        call,
    ),
)
