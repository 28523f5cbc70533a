"""`holozen topic info`: who publishes and who subscribes, and of a robot's command key: who is obeyed."""

import json
import time

from holozen.bus import Bus
from holozen.cli.noun import Verb, open_bus
from holozen.cli.strangers import type_in
from holozen.cli.topics import topics, unknown
from holozen.flags import key
from holozen.graph import Endpoint, on_key
from holozen.tap import Sample
from holozen.tell import printable, say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse
    from typing import Any

    Row = dict[str, Any]

LISTEN = 1.0  # s that -v listens for what goes over the wire
SOURCE = {"source": str, "priority": str, "rate": int | float, "obeyed": bool, "held": bool}  # of CommandSource
ASK = 0.5  # s
ENOUGH = 200  # samples are enough to tell


def info(args: "argparse.Namespace") -> int:
    """Print a key's type, who publishes and who subscribes."""
    with open_bus(args) as bus:
        endpoints = bus.graph().settled(bus.connected)
        publishers = [_row(end) for end in on_key(endpoints, args.key, "pub")]
        subscriptions = [_row(end) for end in on_key(endpoints, args.key, "sub")]
        status = _status(bus, args.key, endpoints)
        if args.verbose:
            _add_heard(publishers, _listen(bus, args.key))
        if not publishers + subscriptions:
            _add_stranger(publishers, bus, args.key)
    _add_status(publishers, status)
    if not publishers + subscriptions:
        say(f"holozen topic info: {unknown(args.key, [topic.key for topic in topics(endpoints)], bus.where)}")
        return 1
    types = sorted({row["type"] for row in publishers + subscriptions} - {"", "any/msg/Any"})
    if args.json:
        told = {"key": args.key, "types": types, "publishers": publishers, "subscriptions": subscriptions}
        print(json.dumps(told | ({"status": status} if status else {})))
        return 0
    print(printable(f"Type: {', '.join(types) or 'unknown'}"))
    for title, rows in (("Publisher", publishers), ("Subscription", subscriptions)):
        print(f"{title} count: {len(rows)}")
        for row in rows:
            print(printable(f"  {_line(row)}"))
    if status:
        print(printable(f"Obeyed: {status.get('obeyed') or 'nobody'}{_stop(status)}"))
    return 0


def _row(end: Endpoint) -> "Row":
    return {"node": end.node, "session": end.session, "type": end.type, "source": f"{end.node}@{end.session[:6]}"}


def _status(bus: Bus, name: str, endpoints: list[Endpoint]) -> "Row":
    """What the sim says of the commands on a key; empty where it says nothing."""
    if not on_key(endpoints, f"{name}_status", "pub"):
        return {}
    from holozen.cli.show import decode

    answers = bus.ask(f"{name}_status", ASK)  # a publisher keeps its last message for whoever asks
    sample = next((answer for answer in answers if isinstance(answer, Sample)), None)
    told = decode(sample.payload, sample.encoding) if sample else {}
    return told if isinstance(told, dict) else {}


def _add_status(publishers: "list[Row]", status: "Row") -> None:
    """To each publisher what the sim says of it; those without a token are added."""
    by_source = {row["source"]: row for row in publishers}
    for told in _sources(status):
        row = by_source.get(told["source"])
        if row is None:
            publishers.append(row := {"node": told["source"], "session": "", "type": "", "source": told["source"]})
        row |= {name: told[name] for name in ("priority", "rate", "obeyed", "held")}


def _sources(status: "Row") -> "list[Row]":
    """The sources of a status; without what is none, since it came over the wire and was not checked."""
    told = status.get("sources")
    rows = [row for row in told if isinstance(row, dict)] if isinstance(told, list) else []
    return [row for row in rows if all(isinstance(row.get(name), kind) for name, kind in SOURCE.items())]


def _listen(bus: Bus, name: str) -> "dict[str, list[Sample]]":
    """The samples of a key by their source, heard in a second or until there are enough."""
    heard: dict[str, list[Sample]] = {}
    tap, deadline, count = bus.tap(name), time.monotonic() + LISTEN, 0
    while time.monotonic() < deadline and count < ENOUGH:
        if (sample := tap.try_recv()) is None:
            time.sleep(0.002)
            continue
        heard.setdefault(sample.source, []).append(sample)
        count += 1
    return heard


def _add_heard(publishers: "list[Row]", heard: "dict[str, list[Sample]]") -> None:
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


def _add_stranger(publishers: "list[Row]", bus: Bus, name: str) -> None:
    """Who has no token, and sends on a key or answers when it is asked for."""
    from holozen.cli.strangers import met

    if found := met(bus, name):
        sample, answered = found
        _add_heard(publishers, {sample.source: [sample]})
        publishers[-1]["node"] += ", when asked" * answered


def _line(row: "Row") -> str:
    """One publisher or subscriber: `teleop (ab12cd)  INTERACTIVE_HIGH  20.0 Hz  obeyed`."""
    session = row["session"]
    words = [f"{row['node']} ({session[:6]})" if session else str(row["node"])]
    words += [row[name] for name in ("priority",) if name in row]
    words += [f"{row['rate']:.1f} Hz"] if "rate" in row else []
    words += [name for name in ("obeyed", "held") if row.get(name)]
    words += [row["encoding"]] if "encoding" in row else []
    words += [f"{row['congestion']} when full{', at once' * row['express']}"] if "congestion" in row else []
    return "  ".join(map(str, words))


def _stop(status: "Row") -> str:
    told = f"; stopped by {status['stopped']}" if status.get("stopped") else ""
    return told + ("; sources below a person are held until `resume`" if status.get("held") else "")


def _arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("key", type=key)
    told = f"listen for {LISTEN:g} s, and tell priority, encoding and delivery of what comes"
    parser.add_argument("-v", "--verbose", action="store_true", help=told)


VERBS = {"info": Verb("a key's type, publishers and subscribers", "holozen topic info cmd_vel", _arguments, info)}
