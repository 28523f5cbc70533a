"""`holozen service`: inspect services, and call them."""

from __future__ import annotations

import argparse
import json
import time

from holozen.background import background
from holozen.bus import Bus
from holozen.cli.hints import none_found, suggest_key, unknown
from holozen.cli.output import CDR, Hex, Reader, lines
from holozen.cli.verb import Noun, Verb, by_name, open_bus
from holozen.console import printable, report
from holozen.flags import add_packages, key, number
from holozen.process import deferred_interrupt
from holozen.suggest import listed, suggest
from holozen.transport.errors import NoReply
from holozen.transport.graph import Endpoint
from holozen.transport.services import call_bytes


def _served(args: argparse.Namespace) -> tuple[list[Endpoint], str]:
    """The services found, and where they were looked for."""
    with open_bus(args) as bus:
        return _services(bus.endpoints()), bus.where


def _services(ends: list[Endpoint]) -> list[Endpoint]:
    return [end for end in ends if end.kind == "srv"]


def list_services(args: argparse.Namespace) -> int:
    """Print each service key once."""
    with open_bus(args) as bus:
        ends, where = bus.endpoints(), bus.where
    found = sorted({(end.key, end.type) for end in _services(ends)})
    if args.count_services:
        print(json.dumps({"count": len(found)}) if args.json else len(found))
        return 0
    for name, kind in found:
        shown = f"{name} [{kind}]" if args.show_types else name
        print(json.dumps({"key": name, "type": kind}) if args.json else printable(shown))
    if not found:
        report(none_found("services", ends, where))
    return 0


def type_of(args: argparse.Namespace) -> int:
    """Print a service's type; exit code 1 if it has no server."""
    served, where = _served(args)
    types = sorted({end.type for end in served if end.key == args.key})
    for name in types:
        print(json.dumps({"key": args.key, "type": name}) if args.json else printable(name))
    if not types:
        report(f"holozen service type: {unknown(args.key, sorted({end.key for end in served}), where)}")
    return 0 if types else 1


def find(args: argparse.Namespace) -> int:
    """Print the keys of a type; exit code 1 if there are none."""
    served, _ = _served(args)
    keys = sorted({end.key for end in served if f"/{end.type}".endswith(f"/{args.type}")})
    for name in keys:
        print(json.dumps({"key": name, "type": args.type}) if args.json else printable(name))
    if not keys:
        types = sorted({end.type for end in served})
        near = suggest(args.type, types)
        report(f"holozen service find: no service of type {args.type!r}{near}; types: {listed(types)}")
    return 0 if keys else 1


def info(args: argparse.Namespace) -> int:
    """Print a service's type and servers; exit code 1 if it has none."""
    served, where = _served(args)
    servers = [end for end in served if end.key == args.key]
    if not servers:
        report(f"holozen service info: {unknown(args.key, sorted({end.key for end in served}), where)}")
        return 1
    types = sorted({end.type for end in servers})
    if args.json:
        rows = [{"node": end.node, "session": end.session} for end in servers]
        print(json.dumps({"key": args.key, "types": types, "servers": rows}))
        return 0
    print(printable(f"Type: {', '.join(types)}"))
    print(f"Services count: {len(servers)}")
    for end in servers:
        print(printable(f"  {end.node} ({end.session[:6]})"))
    return 0


def call(args: argparse.Namespace) -> int:
    """Send a request and print the reply; a service's error is one line and exit code 1."""
    with open_bus(args) as bus:
        looking = background(bus.endpoints)
        with deferred_interrupt():  # while the session opens and queries the graph
            from holozen.cli import values

        words = list(args.words)
        given = words.pop(0) if words and values.TYPE.fullmatch(words[0]) else ""
        if len(words) > 1:
            report(f"holozen service call: {args.key}: {words[-1]!r} is too much; write KEY [TYPE] REQUEST")
            return 2
        try:
            payload, kind = values.request(looking(), args, words[0] if words else "{}", given)
        except ValueError as error:
            report(f"holozen service call: {error}")
            return 1
        return _call(bus, args, payload, kind)


def _call(bus: Bus, args: argparse.Namespace, payload: bytes, kind: str) -> int:
    reader = Reader(packages=args.package)
    try:
        _ask(bus, args, payload, reader, kind)
        while args.rate:
            time.sleep(1 / args.rate)
            _ask(bus, args, payload, reader, kind)
    except NoReply as error:
        raise NoReply(f"{error}{suggest_key(bus, [args.key], ('srv',))}") from None
    return 0


def _ask(bus: Bus, args: argparse.Namespace, payload: bytes, reader: Reader, kind: str) -> None:
    reply = call_bytes(bus, args.key, payload, "application/json", args.timeout)[0]
    if kind and reply.encoding == CDR:  # whose encoding does not name the type
        reply.encoding = f"{CDR};{kind}_Response"
    value = reader.read(reply, bus)
    print(json.dumps(value) if args.json else "\n".join([*lines(value), *(["---"] if args.rate else [])]), flush=True)
    if isinstance(value, Hex):
        report(f"holozen service call: {args.key}: the reply could not be decoded: {reader.why}")


def _list_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-t", "--show-types", action="store_true", help="with their types")
    parser.add_argument("-c", "--count-services", action="store_true", help="only how many there are")


def _key_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", type=key)


def _find_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("type", help="such as std_srvs/srv/Trigger, or Trigger")


def _call_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("key", type=key)
    add("words", nargs="*", metavar="[TYPE] REQUEST", help="JSON or YAML (default: all zeros)")
    add("--any", action="store_true", help="send the request unchecked if its type is unknown")
    add_packages(parser)
    add("-r", "--rate", type=number(0.01, 1000, "Hz"), metavar="HZ", help="call again and again, at this rate")
    add("--timeout", type=number(0.01, 1e6, "s"), default=5.0, metavar="S", help="seconds to wait (default: 5)")


VERBS = by_name(
    Noun("service", "Inspect and call services.",
        dict.fromkeys(("list", "type", "find", "info", "call"), "service")),
    Verb("service list", "the services that nodes offer", "-t", _list_arguments, list_services),
    Verb("service type", "a service's type", "next_goal", _key_arguments, type_of),
    Verb("service find", "the services of a type", "std_srvs/srv/Trigger", _find_arguments, find),
    Verb("service info", "a service's type and servers", "next_goal", _key_arguments, info),
    Verb("service call", "call a service and print its reply", """next_goal '{"request_goal": 0}'""",
        _call_arguments, call),
)  # fmt: skip
