"""The verbs `list`, `type`, `find` and `info` of topics and services, and what those of actions
share with them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Mapping
from typing import Any

from holozen.cli.hints import none_found, unknown
from holozen.cli.topic import LISTEN
from holozen.console import Failure, printable, report
from holozen.output import decode
from holozen.suggest import listed, suggest
from holozen.transport.connection import FORBIDDEN
from holozen.transport.errors import BusError
from holozen.transport.graph import Endpoint, on_key
from holozen.transport.node import Node
from holozen.transport.samples import Replies, Sample
from holozen.wire import SENDERS

LOOK = 0.002  # s between two polls


class Topic:
    """A key: its types, and how many publish and subscribe."""

    def __init__(self, key: str, ends: list[Endpoint]) -> None:
        self.key = key
        self.types = sorted({end.type for end in ends if not end.type.startswith("any/")})
        self.publishers = sum(end.kind == "pub" for end in ends)
        self.subscriptions = sum(end.kind == "sub" for end in ends)

    @property
    def typed(self) -> str:
        """Its key and types."""
        return f"{self.key} [{', '.join(self.types) or 'unknown'}]"


def by_key(endpoints: list[Endpoint], *kinds: str) -> dict[str, list[Endpoint]]:
    """Key -> its endpoints of these kinds, by sorted keys."""
    found: dict[str, list[Endpoint]] = {}
    for end in sorted(endpoints):
        if end.kind in kinds:
            found.setdefault(end.key, []).append(end)
    return found


def topics(endpoints: list[Endpoint]) -> list[Topic]:
    """The keys that nodes read or write, sorted; without key expressions and keys that only tools
    such as echo read.
    """
    found = [
        Topic(key, ends) for key, ends in by_key(endpoints, "pub", "sub").items() if "*" not in key
    ]
    return [topic for topic in found if topic.types or topic.publishers]


def print_rows(args: argparse.Namespace, rows: list[tuple[dict[str, Any], str]]) -> None:
    """Print each row, as JSON or as text, or with -c only their number."""
    if getattr(args, "count", False):
        rows = [({"count": len(rows)}, str(len(rows)))]
    for row, text in rows:
        print(json.dumps(row) if args.json else printable(text))


def print_list(
    args: argparse.Namespace,
    noun: str,
    rows: Iterable[tuple[str, str]],
    ends: list[Endpoint],
    where: str,
) -> int:
    """Print each (key, type) once, or with -c only their number; `ends` are all endpoints at
    `where`.
    """
    found = sorted(set(rows))
    shown = "{} [{}]" if args.show_types else "{}"
    print_rows(args, [({"key": key, "type": kind}, shown.format(key, kind)) for key, kind in found])
    if not found:
        report(none_found(f"{noun}s", ends, where))
    return 0


def print_types(
    args: argparse.Namespace, types: Iterable[str], known: Iterable[str], where: str
) -> int:
    """Print the types of a key. Raises Failure if there are none. `known` are the keys at
    `where`.
    """
    if not (types := sorted(types)):
        raise Failure(unknown(args.key, sorted(known), where))
    print_rows(args, [({"key": args.key, "type": name}, name) for name in types])
    return 0


def print_keys_of(args: argparse.Namespace, types: Mapping[str, Iterable[str]]) -> int:
    """Print the keys of a type. Raises Failure if there are none. `types`: key -> its types."""
    keys = sorted(
        key
        for key, its in types.items()
        if any(f"/{name}".endswith(f"/{args.type}") for name in its)
    )
    print_rows(args, [({"key": key, "type": args.type}, key) for key in keys])
    if not keys:
        known = sorted({name for its in types.values() for name in its})
        what = f"{args.verb.partition(' ')[0]} of type {args.type!r}{suggest(args.type, known)}"
        raise Failure(f"no {what}; types: {listed(known)}")
    return 0


def print_sides(
    args: argparse.Namespace, types: Iterable[str], sides: Mapping[str, tuple[str, list[Any]]]
) -> int:
    """Print the types of a key and its nodes. `sides`: name in JSON -> title, and ends with a node
    and a session.
    """
    types = sorted(set(types))
    if args.json:
        rows = {
            name: [{"node": one.node, "session": one.session} for one in ones]
            for name, (_, ones) in sides.items()
        }
        print(json.dumps({"key": args.key, "types": types} | rows))
        return 0
    print(printable(f"Type: {', '.join(types)}"))
    for title, ones in sides.values():
        print(f"{title}: {len(ones)}")
        for one in ones:
            print(printable(f"  {one.node} ({one.session[:6]})"))
    return 0


def is_hidden(key: str) -> bool:
    """Whether a key is listed on request only, as in ROS 2: a part of it begins with _."""
    return key.startswith("_") or "/_" in key


# Services.


def list_services(args: argparse.Namespace, bus: Node) -> int:
    """Print each service key once."""
    ends = bus.endpoints()
    rows = (
        (end.key, end.type)
        for end in ends
        if end.kind == "srv" and (args.hidden or not is_hidden(end.key))
    )
    return print_list(args, "service", rows, ends, bus.where)


def service_type(args: argparse.Namespace, bus: Node) -> int:
    """Print a service's type. Raises Failure if it has no server."""
    served = by_key(bus.endpoints(), "srv")
    return print_types(args, {end.type for end in served.get(args.key, ())}, served, bus.where)


def find_services(args: argparse.Namespace, bus: Node) -> int:
    """Print the keys of a type. Raises Failure if there are none."""
    served = by_key(bus.endpoints(), "srv")
    return print_keys_of(args, {key: [end.type for end in ends] for key, ends in served.items()})


def service_info(args: argparse.Namespace, bus: Node) -> int:
    """Print a service's type and servers. Raises Failure if it has none."""
    served = by_key(bus.endpoints(), "srv")
    if not (servers := served.get(args.key)):
        raise Failure(unknown(args.key, sorted(served), bus.where))
    return print_sides(
        args, [end.type for end in servers], {"servers": ("Services count", servers)}
    )


# Topics.


def list_topics(args: argparse.Namespace, bus: Node) -> int:
    """Print each key that nodes read or write, once."""
    heard: set[str] = set()
    if args.heard:
        subscriber, deadline = bus.subscribe_raw("**"), time.monotonic() + args.heard
        while time.monotonic() < deadline:
            while (sample := subscriber.try_recv()) is not None:
                heard.add(sample.key)
            time.sleep(0.005)
    ends = bus.endpoints()
    hint = FORBIDDEN if bus.connected() and not ends else ""
    found = topics(ends)
    found += [Topic(name, []) for name in sorted(heard - {topic.key for topic in found})]
    found = [topic for topic in found if args.hidden or not is_hidden(topic.key)]
    if args.verbose and not (args.count or args.json):
        _print_verbose(found)
    else:
        print_rows(
            args, [(vars(topic), topic.typed if args.show_types else topic.key) for topic in found]
        )
    if not found:
        report(none_found("topics", ends, bus.where) + hint)
    return 0


def _print_verbose(found: list[Topic]) -> None:
    published = [
        (topic, topic.publishers) for topic in found if topic.publishers or not topic.subscriptions
    ]
    subscribed = [(topic, topic.subscriptions) for topic in found if topic.subscriptions]
    for title, counted, rows in (
        ("Published", "publisher", published),
        ("\nSubscribed", "subscriber", subscribed),
    ):
        print(f"{title} topics:")
        for topic, number in rows:
            print(printable(f" * {topic.typed} {number} {counted}{'s' * (number != 1)}"))


def topic_type(args: argparse.Namespace, bus: Node) -> int:
    """Print a key's type. Raises Failure if no node states it."""
    _check_one(args.key)
    found = topics(bus.endpoints())
    types = next((topic.types for topic in found if topic.key == args.key), [])
    met = None if types else foreign_sample(bus, args.key)
    if met and (found_type := type_in(met[0].encoding)):
        types = [found_type]
    if met and not types:
        raise Failure(f"{args.key!r} has no known type; its samples are {met[0].encoding}")
    return print_types(args, types, [topic.key for topic in found], bus.where)


def _check_one(key: str) -> None:
    if "*" in key:
        raise Failure(f"{key!r}: name one key; `holozen topic list` lists them")


def find_topics(args: argparse.Namespace, bus: Node) -> int:
    """Print the keys of a type. Raises Failure if there are none."""
    return print_keys_of(args, {topic.key: topic.types for topic in topics(bus.endpoints())})


Row = dict[str, Any]
"""A publisher or a subscription, in the form of `topic info --json`."""

# of CommandSource
SOURCE = {"source": str, "priority": str, "rate": int | float, "obeyed": bool, "held": bool}
ENOUGH = 200  # samples, after which `info -v` stops listening


def topic_info(args: argparse.Namespace, bus: Node) -> int:
    """Print a key's type, publishers and subscribers."""
    _check_one(args.key)
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
        raise Failure(unknown(args.key, [topic.key for topic in topics(endpoints)], bus.where))
    types = sorted({row["type"] for row in publishers + subscriptions} - {"", "any/msg/Any"})
    if args.json:
        summary = {
            "key": args.key,
            "types": types,
            "publishers": publishers,
            "subscriptions": subscriptions,
        }
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
    return {
        "node": end.node,
        "session": end.session,
        "type": end.type,
        "source": f"{end.node}@{end.session[:6]}",
    }


def _status(bus: Node, name: str, endpoints: list[Endpoint]) -> Row:
    """The sim's status of the commands on a key; empty if it publishes none."""
    sample = next(bus.last_messages(on_key(endpoints, f"{name}_status", "pub")), None)
    status = decode(sample.payload, sample.encoding) if sample else {}
    return status if isinstance(status, dict) else {}


def _add_status(publishers: list[Row], status: Row) -> None:
    """Add the sim's status of each source to its publisher."""
    sources = status.get("sources")
    for source in sources if isinstance(sources, list) else ():  # the status is not validated yet
        if isinstance(source, dict) and all(
            isinstance(source.get(name), kind) for name, kind in SOURCE.items()
        ):
            row = _row_of(publishers, source["source"])
            row |= {name: source[name] for name in SOURCE}


def _listen(bus: Node, name: str) -> dict[str, Sample]:
    """The last sample of each source of a key, received within LISTEN seconds or until there are
    ENOUGH.
    """
    heard: dict[str, Sample] = {}
    subscriber, deadline, count = bus.subscribe_raw(name), time.monotonic() + LISTEN, 0
    while time.monotonic() < deadline and count < ENOUGH:
        if (sample := subscriber.try_recv()) is None:
            time.sleep(LOOK)
            continue
        heard[sample.source] = sample
        count += 1
    return heard


def _row_of(publishers: list[Row], source: str) -> Row:
    """The row of a source; one without a token gets a new one."""
    row = next((row for row in publishers if row["source"] == source), None)
    if row is None:
        publishers.append(row := {"node": source, "session": "", "type": "", "source": source})
    return row


def _add_heard(publishers: list[Row], heard: dict[str, Sample]) -> None:
    for source, last in heard.items():
        row = _row_of(publishers, source or "anonymous")
        row["type"] = row["type"] or type_in(last.encoding)
        congestion, express = last.delivery
        row |= {
            "priority": last.priority,
            "encoding": last.encoding,
            "congestion": congestion,
            "express": express,
        }


def _add_foreign(publishers: list[Row], bus: Node, name: str) -> None:
    """Add the node without a token that publishes a key or answers queries for it, if there is
    one.
    """
    if found := foreign_sample(bus, name):
        sample, answered = found
        _add_heard(publishers, {sample.source: sample})
        publishers[-1]["node"] += ", which answers queries" * answered


def _line(row: Row) -> str:
    """One publisher or subscriber: `teleop (ab12cd)  person  20.0 Hz  obeyed`."""
    session = row["session"]
    words = [f"{row['node']} ({session[:6]})" if session else str(row["node"])]
    if "rate" in row:  # a source of commands
        priority = str(row["priority"])
        words += [SENDERS.get(priority, priority), f"{row['rate']:.1f} Hz"]
    elif "priority" in row:
        words += [row["priority"]]
    words += [name for name in ("obeyed", "held") if row.get(name)]
    words += [row["encoding"]] if "encoding" in row else []
    words += (
        [f"{row['congestion']} when full{', at once' * row['express']}"]
        if "congestion" in row
        else []
    )
    return "  ".join(map(str, words))


def _stop(status: Row) -> str:
    text = f"; stopped by {status['stopped']}" if status.get("stopped") else ""
    waits = "; the controller, and scripts that were overruled, wait for `resume`"
    return text + (waits if status.get("held") else "")


def foreign_sample(bus: Node, key: str) -> tuple[Sample, bool] | None:
    """The first sample of a key within LISTEN seconds, and whether it is a reply to our query; None
    without one.

    Foreign nodes hold no tokens: only their samples and replies reveal them.
    """
    if not bus.connected():
        return None
    # `key/**` includes the key itself, and no service takes such a query for a request.
    subscriber, replies, deadline = (
        bus.subscribe_raw(key),
        bus.ask(f"{key}/**", LISTEN),
        time.monotonic() + LISTEN,
    )
    while time.monotonic() < deadline:
        if sample := subscriber.try_recv():
            return sample, False
        if answer := _answer(replies, key):
            return answer, True
        time.sleep(LOOK)
    return None


def type_in(encoding: str) -> str:
    """The type named by an encoding such as `application/cdr;geometry_msgs/msg/Twist`; empty if it
    names none.
    """
    schema = encoding.partition(";")[2]
    return schema if schema.count("/") == 2 else ""


def _answer(replies: Replies, key: str) -> Sample | None:
    try:
        reply = replies.try_recv()
    except BusError:  # all have answered
        return None
    return reply if isinstance(reply, Sample) and key in (reply.key, "**") else None
