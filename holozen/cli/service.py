"""`holozen service`: list, call."""

import argparse
import json

from holozen import codec, connection, wire
from holozen.bus import Bus
from holozen.cli.pub import read_message
from holozen.cli.show import decode, lines
from holozen.flags import key, number
from holozen.tell import printable, say


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="holozen service", description="Look at services, and call them.")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)
    add = verbs.add_parser("list", help="the services that nodes offer")
    add.add_argument("-t", "--show-types", action="store_true", help="with their types")
    add = verbs.add_parser("call", help="call a service and print its reply",
        epilog="""example: holozen service call next_goal '{"request_goal": 0}'""")  # fmt: skip
    add.add_argument("key", type=key)
    add.add_argument("request", nargs="?", default="{}", help="JSON or YAML (default: all zeros)")
    add.add_argument(
        "--timeout", type=number(0.01, 1e6, "s"), default=5.0, metavar="S", help="seconds to wait (default: 5)"
    )
    add.add_argument("--json", action="store_true", help="the reply as one JSON object")
    for sub in verbs.choices.values():
        connection.add_arguments(sub)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    return {"list": list_services, "call": call}[args.verb](args)


def list_services(args: argparse.Namespace) -> int:
    """Print each service key once."""
    with _bus(args) as bus:
        endpoints = bus.graph().settled(bus.connected)
    found = sorted({(e.key, e.type) for e in endpoints if e.kind == "srv"})
    for name, kind in found:
        print(printable(f"{name} [{kind}]" if args.show_types else name))
    if not found:
        say("no services: nobody is there; `holozen up` starts some")
    return 0


def call(args: argparse.Namespace) -> int:
    """Send one request and print the reply; a service's error is one line and exit code 1."""
    row = wire.service(args.key)
    if row is None:
        say(f"holozen service call: {args.key!r} has no known type; known: {', '.join(s.key for s in wire.SERVICES)}")
        return 1
    try:
        request = read_message(args.request, (row.request,))
    except ValueError as error:
        say(f"holozen service call {args.key}: refused: {error}")
        return 1
    with _bus(args) as bus:
        reply = bus.call_bytes(args.key, codec.encode(request), codec.WIRES["json"], args.timeout)
    value = decode(reply.payload, reply.encoding)
    print(json.dumps(value) if args.json else "\n".join(lines(value)))
    return 0


def _bus(args: argparse.Namespace) -> Bus:
    return Bus(f"service_{args.verb}", connection.from_arguments(args), patience=3.0)
