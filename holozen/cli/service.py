"""`holozen service`: inspect services, and call them."""

from __future__ import annotations

import argparse
import json
import time

from holozen.background import background
from holozen.bus import Bus
from holozen.cli.hints import suggest_key
from holozen.cli.output import CDR, Hex, Reader, lines
from holozen.cli.verb import Noun, Verb, by_name, key_argument, list_arguments, on_node, open_bus
from holozen.console import report
from holozen.flags import add_packages, key, number
from holozen.process import deferred_interrupt
from holozen.transport.errors import NoReply
from holozen.transport.services import call_bytes


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
    Verb("service list", "the services that nodes offer", "-t", list_arguments("service"),
        on_node("keys", "list_services")),
    Verb("service type", "a service's type", "next_goal", key_argument, on_node("keys", "service_type")),
    Verb("service find", "the services of a type", "std_srvs/srv/Trigger", _find_arguments,
        on_node("keys", "find_services")),
    Verb("service info", "a service's type and servers", "next_goal", key_argument, on_node("keys", "service_info")),
    Verb("service call", "call a service and print its reply", """next_goal '{"request_goal": 0}'""",
        _call_arguments, call),
)  # fmt: skip
