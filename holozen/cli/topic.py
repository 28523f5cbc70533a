"""`holozen topic`: inspect topics, and publish to them."""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from functools import partial
from typing import Any

from holozen.background import background
from holozen.bus import Bus
from holozen.cli.output import Hex, Reader, csv_row, cut, decode, lines, strict
from holozen.cli.verb import (
    PUB_EXAMPLE,
    PUB_PATIENCE,
    Noun,
    Verb,
    add_packages,
    by_name,
    listed,
    none_found,
    open_bus,
    suggest_key,
    unknown,
)
from holozen.console import printable, report
from holozen.flags import count, key, nearest, number
from holozen.process import deferred_interrupt
from holozen.transport.connection import FORBIDDEN
from holozen.transport.errors import BusError
from holozen.transport.graph import Endpoint, on_key
from holozen.transport.pubsub import RawSubscriber, Sample
from holozen.transport.services import Replies

LISTEN = 1.0  # s to listen for samples of foreign nodes, also by `info -v`
LOOK = 0.002  # s between two polls


class Topic:
    """A key: its types, and how many publish and subscribe."""

    def __init__(self, key: str, ends: list[Endpoint]) -> None:
        self.key = key
        self.types = sorted({end.type for end in ends if not end.type.startswith("any/")})
        self.publishers = sum(end.kind == "pub" for end in ends)
        self.subscriptions = sum(end.kind == "sub" for end in ends)

    def line(self, counted: str, number: int) -> str:
        """The line of `list -v`."""
        return f" * {self.key} [{', '.join(self.types) or 'unknown'}] {number} {counted}{'s' * (number != 1)}"


def topics(endpoints: list[Endpoint]) -> list[Topic]:
    """The keys that nodes read or write, sorted; without key expressions and keys that only tools such as echo read."""
    ends: dict[str, list[Endpoint]] = {}
    for end in endpoints:
        if end.kind in ("pub", "sub") and "*" not in end.key:
            ends.setdefault(end.key, []).append(end)
    found = (Topic(key, its) for key, its in sorted(ends.items()))
    return [topic for topic in found if topic.types or topic.publishers]


def list_topics(args: argparse.Namespace) -> int:
    """Print each key that nodes read or write, once."""
    with open_bus(args) as bus:
        heard: set[str] = set()
        if args.heard:
            tap, deadline = bus.subscribe_raw("**"), time.monotonic() + args.heard
            while time.monotonic() < deadline:
                while (sample := tap.try_recv()) is not None:
                    heard.add(sample.key)
                time.sleep(0.005)
        ends = bus.endpoints()
        hint = FORBIDDEN if bus.connected() and not ends else ""
    found = topics(ends)
    found += [Topic(name, []) for name in sorted(heard - {topic.key for topic in found})]
    if args.count_topics:
        print(json.dumps({"count": len(found)}) if args.json else len(found))
    elif args.json:
        for topic in found:
            print(json.dumps(vars(topic)))
    elif args.verbose:
        _print_verbose(found)
    else:
        for topic in found:
            shown = f"{topic.key} [{', '.join(topic.types) or 'unknown'}]" if args.show_types else topic.key
            print(printable(shown))
    if not found:
        report(none_found("topics", ends, bus.where) + hint)
    return 0


def _print_verbose(found: list[Topic]) -> None:
    print("Published topics:")
    for topic in found:
        if topic.publishers or not topic.subscriptions:
            print(printable(topic.line("publisher", topic.publishers)))
    print("\nSubscribed topics:")
    for topic in found:
        if topic.subscriptions:
            print(printable(topic.line("subscriber", topic.subscriptions)))


def type_of(args: argparse.Namespace) -> int:
    """Print a key's type; exit code 1 if no node states it."""
    with open_bus(args) as bus:
        found = topics(bus.endpoints())
        types = next((topic.types for topic in found if topic.key == args.key), [])
        met = None if types else foreign_sample(bus, args.key)
    if met and (found_type := type_in(met[0].encoding)):
        types = [found_type]
    for name in types:
        print(json.dumps({"key": args.key, "type": name}) if args.json else printable(name))
    if met and not types:
        report(f"holozen topic type: {args.key!r} has no known type; its samples are {met[0].encoding}")
    elif not types:
        report(f"holozen topic type: {unknown(args.key, [topic.key for topic in found], bus.where)}")
    return 0 if types else 1


def find(args: argparse.Namespace) -> int:
    """Print the keys of a type; exit code 1 if there are none."""
    with open_bus(args) as bus:
        found = topics(bus.endpoints())
    keys = [topic.key for topic in found if any(f"/{name}".endswith(f"/{args.type}") for name in topic.types)]
    if args.count_topics:
        print(json.dumps({"count": len(keys)}) if args.json else len(keys))
    else:
        for name in keys:
            print(json.dumps({"key": name, "type": args.type}) if args.json else printable(name))
    if not keys:
        types = sorted({name for topic in found for name in topic.types})
        report(f"holozen topic find: no topic of type {args.type!r}{nearest(args.type, types)}; types: {listed(types)}")
    return 0 if keys else 1


Row = dict[str, Any]
"""A publisher or a subscription, as `info --json` prints it."""

SOURCE = {"source": str, "priority": str, "rate": int | float, "obeyed": bool, "held": bool}  # of CommandSource
ASK = 0.5  # s
ENOUGH = 200  # samples, after which `info -v` stops listening


def info(args: argparse.Namespace) -> int:
    """Print a key's type, publishers and subscribers."""
    with open_bus(args) as bus:
        endpoints = bus.endpoints()
        publishers = [_row(end) for end in on_key(endpoints, args.key, "pub")]
        subscriptions = [_row(end) for end in on_key(endpoints, args.key, "sub")]
        status = _status(bus, args.key, endpoints)
        if args.verbose:
            _add_heard(publishers, _listen(bus, args.key))
        if not publishers + subscriptions:
            _add_foreign(publishers, bus, args.key)
    _add_status(publishers, status)
    if not publishers + subscriptions:
        report(f"holozen topic info: {unknown(args.key, [topic.key for topic in topics(endpoints)], bus.where)}")
        return 1
    types = sorted({row["type"] for row in publishers + subscriptions} - {"", "any/msg/Any"})
    if args.json:
        summary = {"key": args.key, "types": types, "publishers": publishers, "subscriptions": subscriptions}
        print(json.dumps(summary | ({"status": status} if status else {})))
        return 0
    print(printable(f"Type: {', '.join(types) or 'unknown'}"))
    for title, rows in (("Publisher", publishers), ("Subscription", subscriptions)):
        print(f"{title} count: {len(rows)}")
        for row in rows:
            print(printable(f"  {_line(row)}"))
    if status:
        print(printable(f"Obeyed: {status.get('obeyed') or 'none'}{_stop(status)}"))
    return 0


def _row(end: Endpoint) -> Row:
    return {"node": end.node, "session": end.session, "type": end.type, "source": f"{end.node}@{end.session[:6]}"}


def _status(bus: Bus, name: str, endpoints: list[Endpoint]) -> Row:
    """The sim's status of the commands on a key; empty if it publishes none."""
    if not on_key(endpoints, f"{name}_status", "pub"):
        return {}
    answers = bus.ask(f"{name}_status", ASK)  # publishers answer queries with their last message
    sample = next((answer for answer in answers if isinstance(answer, Sample)), None)
    status = decode(sample.payload, sample.encoding) if sample else {}
    return status if isinstance(status, dict) else {}


def _add_status(publishers: list[Row], status: Row) -> None:
    """Add the sim's status to each publisher; sources without a token become rows of their own."""
    by_source = {row["source"]: row for row in publishers}
    for source in _sources(status):
        row = by_source.get(source["source"])
        if row is None:
            publishers.append(row := {"node": source["source"], "session": "", "type": "", "source": source["source"]})
        row |= {name: source[name] for name in ("priority", "rate", "obeyed", "held")}


def _sources(status: Row) -> list[Row]:
    """The well-formed sources of a status, which came over the wire and was not validated."""
    found = status.get("sources")
    rows = [row for row in found if isinstance(row, dict)] if isinstance(found, list) else []
    return [row for row in rows if all(isinstance(row.get(name), kind) for name, kind in SOURCE.items())]


def _listen(bus: Bus, name: str) -> dict[str, list[Sample]]:
    """The samples of a key by source, received within LISTEN seconds or until there are ENOUGH."""
    heard: dict[str, list[Sample]] = {}
    tap, deadline, count = bus.subscribe_raw(name), time.monotonic() + LISTEN, 0
    while time.monotonic() < deadline and count < ENOUGH:
        if (sample := tap.try_recv()) is None:
            time.sleep(LOOK)
            continue
        heard.setdefault(sample.source, []).append(sample)
        count += 1
    return heard


def _add_heard(publishers: list[Row], heard: dict[str, list[Sample]]) -> None:
    by_source = {row["source"]: row for row in publishers}
    for source, samples in heard.items():
        name = source or "anonymous"
        row = by_source.get(source)
        if row is None:
            publishers.append(row := {"node": name, "session": "", "type": "", "source": name})
        last = samples[-1]
        row["type"] = row["type"] or type_in(last.encoding)
        congestion, express = last.delivery
        row |= {"priority": last.priority, "encoding": last.encoding, "congestion": congestion, "express": express}


def _add_foreign(publishers: list[Row], bus: Bus, name: str) -> None:
    """Add a node without a token that publishes a key or answers queries for it."""
    if found := foreign_sample(bus, name):
        sample, answered = found
        _add_heard(publishers, {sample.source: [sample]})
        publishers[-1]["node"] += ", when asked" * answered


def _line(row: Row) -> str:
    """One publisher or subscriber: `teleop (ab12cd)  INTERACTIVE_HIGH  20.0 Hz  obeyed`."""
    session = row["session"]
    words = [f"{row['node']} ({session[:6]})" if session else str(row["node"])]
    words += [row[name] for name in ("priority",) if name in row]
    words += [f"{row['rate']:.1f} Hz"] if "rate" in row else []
    words += [name for name in ("obeyed", "held") if row.get(name)]
    words += [row["encoding"]] if "encoding" in row else []
    words += [f"{row['congestion']} when full{', at once' * row['express']}"] if "congestion" in row else []
    return "  ".join(map(str, words))


def _stop(status: Row) -> str:
    text = f"; stopped by {status['stopped']}" if status.get("stopped") else ""
    return text + ("; sources below a person are held until `resume`" if status.get("held") else "")


def foreign_sample(bus: Bus, key: str) -> tuple[Sample, bool] | None:
    """The first sample of a key within LISTEN seconds, and whether it is a reply to our query.

    Foreign nodes hold no tokens: only their samples and replies reveal them.
    """
    if not bus.connected():
        return None
    # `key/**` includes the key itself, and no service takes such a query for a request.
    tap, replies, deadline = bus.subscribe_raw(key), bus.ask(f"{key}/**", LISTEN), time.monotonic() + LISTEN
    while time.monotonic() < deadline:
        if sample := tap.try_recv():
            return sample, False
        if answer := _answer(replies, key):
            return answer, True
        time.sleep(LOOK)
    return None


def type_in(encoding: str) -> str:
    """The type named by an encoding such as `application/cdr;geometry_msgs/msg/Twist`; empty if it names none."""
    schema = encoding.partition(";")[2]
    return schema if schema.count("/") == 2 else ""


def _answer(replies: Replies, key: str) -> Sample | None:
    try:
        reply = replies.try_recv()
    except BusError:  # all have answered
        return None
    return reply if isinstance(reply, Sample) and key in (reply.key, "**") else None


WAITING = 1.0  # s without a message until that is reported


def echo(args: argparse.Namespace) -> int:
    """Print every message of a key, until interrupted."""
    with open_bus(args, early=True) as bus:
        try:
            printer, reader = Printer(args), Reader(args.type_flag or args.type or "", args.package)
        except ValueError as error:
            report(f"holozen topic echo: {error}")
            return 2
        tap = bus.subscribe_raw(args.key)
        tap.ends.append(bus.announce("sub", "any/msg/Any", args.key))
        return _echo(args, bus, tap, printer, reader)


def _echo(args: argparse.Namespace, bus: Bus, tap: RawSubscriber, printer: Printer, reader: Reader) -> int:
    what = "no message that passes the filter" if args.filter else "no messages"
    late = threading.Timer(
        args.timeout or WAITING, tap.close if args.timeout else partial(_wait, args, bus, what, printer)
    )
    late.daemon = True
    late.start()
    try:
        while True:
            try:
                sample = tap.recv()
            except BusError:
                nothing = f"{what} on {args.key} within {args.timeout:g} s"
                report(f"holozen topic echo: {nothing}{_hint(args, bus, printer)}")
                return 1
            if not args.filter:
                late.cancel()
            if printer.show(sample, reader.read(sample, bus)):
                late.cancel()
                if args.once:
                    return 0
    except LookupError as error:
        report(f"holozen topic echo: {args.key}: {error.args[0]}")
        return 1
    finally:
        printer.report_skipped(reader.why)


def _wait(args: argparse.Namespace, bus: Bus, what: str, printer: Printer) -> None:
    try:
        report(f"waiting for {args.key}; {what} yet{_hint(args, bus, printer)}")
    except Exception:  # the session was closed in the meantime, for which zenoh raises an error of its own
        return


def _hint(args: argparse.Namespace, bus: Bus, printer: Printer) -> str:
    if printer.stopped:
        from holozen.cli.fields import lacking

        return f"; {why}" if (why := lacking(args.filter, printer.stopped)) else ""
    return suggest_key(bus, [args.key])


class Printer:
    """Prints values according to the flags, and counts those it cannot show. Raises ValueError for an invalid flag."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._args, self._many = args, "*" in args.key
        self._count = self._undecoded = self._fieldless = 0
        self._path = self._passes = None
        self.stopped: Any = None  # the last message that the filter rejected
        if args.field:
            from holozen.cli import fields

            self._path, self._pick = fields.path(args.field), fields.pick
        if args.filter:
            from holozen.cli import fields

            self._passes = fields.compiled(args.filter)
        self._short = args.truncate_length or args.no_arr or args.no_str

    def show(self, sample: Sample, value: Any) -> bool:
        """Print a value; returns whether it was shown. Raises LookupError if the field is missing."""
        self._count += 1
        self._undecoded += isinstance(value, Hex)
        if self._passes and not self._passes(value):
            self.stopped = value
            return False
        if self._path:
            try:
                value = self._pick(value, self._path)
            except LookupError:
                if not self._many and not isinstance(value, Hex):
                    raise
                self._fieldless += 1
                return False
        if self._short:
            value = cut(value, self._args.truncate_length, not self._args.no_arr, not self._args.no_str)
        self._write(sample, value)
        return True

    def _write(self, sample: Sample, value: Any) -> None:
        if self._args.raw:
            return self._write_raw(sample.payload)
        if self._args.json:
            text = self._as_json(sample, value)
        elif self._args.csv:
            text = csv_row([sample.key, value] if self._many else value)
        else:
            head = [printable(f"# {sample.key}")] if self._many else []
            text = "\n".join([*head, *lines(value, longest=0 if self._args.full_length else None), "---"])
        print(text, flush=True)
        return None

    def _as_json(self, sample: Sample, value: Any) -> str:
        """One JSON object: the message, or anything that is not one under `value` or `hex`."""
        # An object received as one line of JSON is printed unchanged.
        whole = not (self._many or self._path or self._short) and isinstance(value, dict)
        text = sample.payload.decode() if whole and sample.payload.startswith(b"{") and sample.payload.isascii() else ""
        if text and text.isprintable() and "NaN" not in text and "Infinity" not in text:
            return text
        if isinstance(value, Hex):
            found = {"hex": sample.payload.hex(), "size": sample.size, "encoding": sample.encoding}
        elif isinstance(value, dict) and not self._many:
            found = value
        else:
            found = {"value": value}
        return json.dumps(strict({"key": sample.key, **found} if self._many else found))

    def _write_raw(self, payload: bytes) -> None:
        """The bytes as received; escaped on a terminal, which control sequences could harm."""
        if sys.stdout.isatty():
            print(payload, flush=True)
        else:
            sys.stdout.buffer.write(payload if self._args.once else payload + b"\n")
            sys.stdout.buffer.flush()

    def report_skipped(self, why: str) -> None:
        """Report how many samples could not be shown, if any, and `why` for the last of them."""
        if self._undecoded:
            last = "the last: " * (self._undecoded > 1)
            report(f"{self._undecoded} of {self._count} samples could not be decoded; {last}{why}")
        if self._fieldless:
            report(f"{self._fieldless} of {self._count} samples have no field {self._args.field}")


def pub(args: argparse.Namespace) -> int:
    """Publish a value once, N times, or until interrupted; a robot that it moved is stopped at the end."""
    with open_bus(args, early=True) as bus:
        looking = bus.endpoints if args.no_wait else background(bus.endpoints)
        with deferred_interrupt():  # while the session opens and queries the graph
            from holozen.cli.publish import publish

        return publish(bus, args, looking)


def _list_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-t", "--show-types", action="store_true", help="with their types")
    add("-c", "--count-topics", action="store_true", help="only how many there are")
    add("-v", "--verbose", action="store_true", help="with types, and how many publish and subscribe")
    text = "also keys on which a message from any node arrives within S seconds"
    add("--heard", type=number(0.01, 1e6, "s"), metavar="S", help=text)


def _info_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", type=key)
    text = f"listen for {LISTEN:g} s, and show the priority, encoding and delivery of its messages"
    parser.add_argument("-v", "--verbose", action="store_true", help=text)


def _type_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", type=key)


def _find_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("type", help="such as geometry_msgs/msg/Twist, or Twist")
    parser.add_argument("-c", "--count-topics", action="store_true", help="only how many there are")


def _echo_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("key", type=key, help="a key or key expression, such as odom or */odom")
    add("type", nargs="?", metavar="TYPE", help="the same as --type")
    text = "the type of CDR payloads, where no node states it, such as geometry_msgs/msg/Twist"
    add("--type", dest="type_flag", metavar="TYPE", help=text)
    add_packages(parser)
    add("--once", action="store_true", help="end after the first message")
    add("--timeout", type=number(0.01, 1e6, "s"), metavar="S", help="exit code 1 after S seconds without any")
    add("--field", metavar="A.B", help="only this field, such as pose.pose.position or transforms[0].child_frame_id")
    add("--filter", metavar="EXPR", help="only messages of which this is true, such as 'm.linear.x > 0.2'")
    add("--csv", action="store_true", help="values with commas, a message a line")
    add("--raw", action="store_true", help="the bytes as they came; on a terminal, escaped")
    add("--no-arr", action="store_true", help="only the length of lists")
    add("--no-str", action="store_true", help="only the length of texts")
    text = "show at most N values of a list and characters of a text (default: 128 values of a list)"
    add("-l", "--truncate-length", type=count(1), default=0, metavar="N", help=text)
    add("-f", "--full-length", action="store_true", help="lists in full")


def _pub_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("key", type=key)
    add("words", nargs="*", metavar="[TYPE] VALUE", help="JSON or YAML; - reads it from standard input."
        " The type, where no node states it, such as geometry_msgs/msg/Twist")  # fmt: skip
    add("-r", "--rate", type=number(0.01, 10_000, "Hz"), metavar="HZ", help="(default: the topic's own rate, or 1)")
    add("-1", "--once", action="store_true", help="publish once, as soon as there is a subscriber")
    add("-t", "--times", type=count(1), metavar="N", help="publish N times")
    add("-w", "--wait", "--wait-matching-subscriptions", type=count(1), metavar="N",
        help=f"wait for N subscribers, for ever (default: for one, {PUB_PATIENCE:g} s)")  # fmt: skip
    add("--max-wait", "--max-wait-time-secs", type=number(0.01, 1e6, "s"), metavar="S", help="wait at most S seconds")
    add("--no-wait", action="store_true", help="do not wait for a subscriber")
    add("--force", action="store_true", help="also send numbers that are not finite")
    add_packages(parser)
    add("--stdin", action="store_true", help="one value a line on standard input")


VERBS = by_name(
    Noun(
        "topic",
        "Inspect topics, and publish to them.",
        {
            "list": "topic", "info": "topic", "type": "topic", "find": "topic", "echo": "topic",
            "hz": "stats", "bw": "stats", "delay": "stats", "pub": "topic", "plot": "plot",
        },
    ),
    Verb("topic list", "the keys that nodes read and write", "-t", _list_arguments, list_topics),
    Verb("topic info", "a key's type, publishers and subscribers", "cmd_vel", _info_arguments, info),
    Verb("topic type", "a key's type", "odom", _type_arguments, type_of),
    Verb("topic find", "the keys of a type", "nav_msgs/msg/Odometry", _find_arguments, find),
    Verb("topic echo", "print the messages of a key", "odom --once", _echo_arguments, echo),
    Verb("topic pub", "write messages to a key", PUB_EXAMPLE, _pub_arguments, pub),
)  # fmt: skip
