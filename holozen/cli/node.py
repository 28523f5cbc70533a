"""`holozen node` and `graph`: which nodes run, and what they write, read and serve."""

from __future__ import annotations

import argparse
import json
from functools import partial

from holozen.cli.hints import is_any, no_nodes
from holozen.cli.keys import print_rows
from holozen.cli.verb import Noun, Verb, add_count, argument, by_name, open_bus
from holozen.console import Failure, printable, report
from holozen.flags import key
from holozen.suggest import listed, suggest
from holozen.transport.actions import BELOW, found_in
from holozen.transport.graph import Endpoint, includes

TITLES = {"subscribers": "Subscribers", "publishers": "Publishers", "services": "Service Servers"}
TITLES |= {"action_servers": "Action Servers", "action_clients": "Action Clients"}


def list_nodes(args: argparse.Namespace) -> int:
    """Print the name of each running node; of several with one name, each."""
    with open_bus(args) as bus:
        endpoints = bus.endpoints()
    nodes = sorted((end.node, end.session) for end in endpoints if end.kind == "node")
    print_rows(args, [({"node": name, "session": session}, name) for name, session in nodes])
    if not nodes and not args.count:
        report(no_nodes(bus.where))
    return 0


def info(args: argparse.Namespace) -> int:
    """Print what a node reads, writes and serves. Raises Failure if there is no node of that
    name.
    """
    with open_bus(args) as bus:
        endpoints = bus.endpoints()
    name, _, session = args.name.partition("@")
    ends = [end for end in endpoints if end.node == name and end.session.startswith(session)]
    if not ends:
        names = sorted({end.node for end in endpoints})
        known = f"known: {listed(names)}" if names else no_nodes(bus.where)
        raise Failure(f"unknown node {args.name!r}{suggest(name, names)}; {known}")
    for session in sorted({end.session for end in ends}):
        _print_node(name, [end for end in ends if end.session == session], args.json)
    return 0


def _print_node(name: str, ends: list[Endpoint], as_json: bool) -> None:
    parts = {"sub": "subscribers", "pub": "publishers", "srv": "services"}
    shown = [end for end in ends if end.kind in parts and not (is_any(end) or BELOW in end.key)]
    rows = [(parts[end.kind], end.key, end.type) for end in shown]
    rows += [
        ("action_servers" if one.is_server else "action_clients", one.key, one.type)
        for one in found_in(ends)
    ]
    named = {
        part: [{"key": key, "type": type} for where, key, type in rows if where == part]
        for part in TITLES
    }
    session = ends[0].session
    if as_json:
        print(json.dumps({"node": name, "session": session, **named}))
        return
    print(printable(f"{name} ({session[:6]})"))
    for part, title in TITLES.items():
        print(f"  {title}:")
        for row in named[part]:
            print(printable(f"    {row['key']}: {row['type']}"))


def graph(args: argparse.Namespace) -> int:
    """Print the graph as arrows, JSON or Graphviz."""
    with open_bus(args) as bus:
        found = [end for end in bus.endpoints() if not is_any(end)]
    ends = [end for end in found if end.kind != "node"]
    for row in dot(ends) if args.dot else [] if args.json else arrows(ends):
        print(printable(row))
    for end in ends if args.json else []:
        print(json.dumps(end._asdict()))
    if not found:
        report(no_nodes(bus.where))
    return 0


def arrows(ends: list[Endpoint]) -> list[str]:
    """One line per key: `teleop -> cmd_vel -> sim`; then one per service: `get_pose:
    pose_service`.
    """
    rows = []
    for topic in sorted(
        {end.key for end in ends if end.kind in ("pub", "sub") and "*" not in end.key}
    ):
        writers = sorted({end.node for end in ends if end.kind == "pub" and end.key == topic})
        readers = sorted(
            {end.node for end in ends if end.kind == "sub" and includes(end.key, topic)}
        )
        rows.append(f"{', '.join(writers) or '-'} -> {topic} -> {', '.join(readers) or '-'}")
    servers = [end for end in ends if end.kind == "srv"]
    for service in sorted({end.key for end in servers}):
        rows.append(
            f"{service}: {', '.join(sorted({end.node for end in servers if end.key == service}))}"
        )
    return rows


def dot(ends: list[Endpoint]) -> list[str]:
    """The lines of a digraph in Graphviz's language: nodes as boxes, topics as ellipses, services
    as dashed ones.
    """
    nodes, services = (
        sorted({end.node for end in ends}),
        {end.key for end in ends if end.kind == "srv"},
    )
    keys = sorted({end.key for end in ends if "*" not in end.key})
    edges = set()
    for end in ends:
        if end.kind == "sub":
            edges |= {
                (key, f"node {end.node}")
                for key in keys
                if includes(end.key, key) and key not in services
            }
        else:
            edges.add((f"node {end.node}", end.key))
    return [
        "digraph holozen {",
        "  rankdir=LR;",
        *(f"  {_quoted(f'node {name}')} [shape=box, label={_quoted(name)}];" for name in nodes),
        *(
            f"  {_quoted(key)} [shape=ellipse{', style=dashed' * (key in services)}];"
            for key in keys
        ),
        *(f"  {_quoted(a)} -> {_quoted(b)};" for a, b in sorted(edges)),
        "}",
    ]


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


VERBS = by_name(
    Noun("node", "inspect the running nodes"),
    Verb(
        "node list", "list the names of the nodes", "", partial(add_count, noun="node"), list_nodes
    ),
    Verb(
        "node info",
        "show what a node reads, writes and serves",
        "sim",
        argument("name", type=key, help="such as sim, or sim@a1b2c3 if there are several"),
        info,
    ),
    Verb(
        "graph",
        "show which nodes write, read and serve which keys",
        "--dot | dot -Tsvg > g.svg",
        argument("--dot", action="store_true", help="in the language of Graphviz"),
        graph,
        "print the ends of keys as JSON, one object per line",
    ),
)
