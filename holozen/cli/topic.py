"""`holozen topic`: list, info, echo, hz, pub."""

import argparse
import json

from holozen import connection
from holozen.bus import Bus
from holozen.flags import count, key, number
from holozen.graph import on_key
from holozen.tell import printable, say

PATIENCE = 3.0  # s; a client waits this long for its router


def parser(only: str = "") -> argparse.ArgumentParser:
    """The parser of all verbs; of one alone it is ready sooner."""
    parser = argparse.ArgumentParser(prog="holozen topic", description="Look at topics, and write to them.")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)
    for name, (help_line, example, add_arguments) in VERBS.items():
        if name == only or only not in VERBS:
            verb = verbs.add_parser(name, help=help_line, description=help_line, epilog=f"example: {example}")
            add_arguments(verb)
            connection.add_arguments(verb)
    return parser


def _list_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-t", "--show-types", action="store_true", help="with their types")


def _info_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", type=key)


def _echo_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", type=key, help="a key or key expression, such as odom or */odom")
    parser.add_argument("--once", action="store_true", help="end after the first message")
    parser.add_argument(
        "--timeout", type=number(0.01, 1e6, "s"), metavar="S", help="end with exit code 1 after S seconds without any"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a line")


def _hz_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", type=key)
    parser.add_argument("-w", "--window", type=count(2), default=1000, metavar="N", help="average over the last N")


def _pub_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", type=key)
    parser.add_argument("value", help="JSON or YAML; - reads it from standard input")
    parser.add_argument(
        "-r", "--rate", type=number(0.01, 10_000, "Hz"), metavar="HZ", help="(default: the topic's own rate)"
    )
    parser.add_argument("-1", "--once", action="store_true", help="publish once, as soon as somebody subscribes")
    parser.add_argument("-t", "--times", type=count(1), metavar="N", help="publish N times")


VERBS = {
    "list": ("the keys that nodes read and write", "holozen topic list -t", _list_arguments),
    "info": ("a key's type, publishers and subscribers", "holozen topic info cmd_vel", _info_arguments),
    "echo": ("print what comes on a key", "holozen topic echo odom --once", _echo_arguments),
    "hz": ("how often messages come on a key", "holozen topic hz odom", _hz_arguments),
    "pub": ("write messages to a key", """holozen topic pub cmd_vel '{"linear": {"x": 0.3}}'""", _pub_arguments),
}


def main(argv: list[str]) -> int:
    args = parser(argv[0] if argv else "").parse_args(argv)
    if args.verb == "hz":
        from holozen.cli.hz import hz as verb
    elif args.verb == "pub":
        from holozen.cli.pub import pub as verb
    else:
        verb = {"list": list_topics, "info": info, "echo": echo}[args.verb]
    return verb(args)


def list_topics(args: argparse.Namespace) -> int:
    """Print each key that somebody reads or writes, once."""
    with _bus("list", args) as bus:
        endpoints = bus.graph().settled(bus.connected)
    ends = [e for e in endpoints if e.kind in ("pub", "sub") and "*" not in e.key]
    topics = sorted({(e.key, e.type) for e in ends if not e.type.startswith("any/")})
    for name, kind in topics:
        print(printable(f"{name} [{kind}]" if args.show_types else name))
    if not topics:
        say("no topics: nobody is there; `holozen up` starts a robot")
    return 0


def info(args: argparse.Namespace) -> int:
    """Print a key's type, who publishes and who subscribes."""
    with _bus("info", args) as bus:
        endpoints = bus.graph().settled(bus.connected)
    pubs, subs = on_key(endpoints, args.key, "pub"), on_key(endpoints, args.key, "sub")
    if not pubs + subs:
        known = ", ".join(sorted({e.key for e in endpoints if e.kind in ("pub", "sub")})) or "none"
        say(f"holozen topic: unknown key {args.key!r}; known: {known}")
        return 1
    types = sorted({e.type for e in pubs + subs if not e.type.startswith("any/")})
    print(printable(f"Type: {', '.join(types) or 'unknown'}"))
    for title, found in (("Publisher", pubs), ("Subscription", subs)):
        print(f"{title} count: {len(found)}")
        for endpoint in found:
            print(printable(f"  {endpoint.node} ({endpoint.session[:6]})"))
    return 0


def echo(args: argparse.Namespace) -> int:
    """Print every message of a key, until interrupted."""
    import threading
    from functools import partial

    from holozen.cli.show import decode, lines
    from holozen.errors import BusError

    with _bus("echo", args) as bus:
        tap = bus.tap(args.key)
        tap.ends.append(bus.announce("sub", "any/msg/Any", args.key))
        say_so = partial(say, f"waiting for {args.key}; nothing came yet")
        late = threading.Timer(args.timeout or 1.0, tap.close if args.timeout else say_so)
        late.daemon = True
        late.start()
        while True:
            try:
                sample = tap.recv()
            except BusError:
                say(f"holozen topic: nothing came on {args.key} within {args.timeout:g} s")
                return 1
            late.cancel()
            value = decode(sample.payload, sample.encoding)
            if args.json:
                print(json.dumps(value), flush=True)
            else:
                print("\n".join([*lines(value), "---"]), flush=True)
            if args.once:
                return 0


def _bus(verb: str, args: argparse.Namespace) -> Bus:
    return Bus(f"topic_{verb}", connection.from_arguments(args), patience=PATIENCE)
