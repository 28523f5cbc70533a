"""`holozen graph`: who writes, reads and serves what, as arrows, JSON or a picture for Graphviz."""

import argparse
import json

from holozen import connection
from holozen.cli.noun import nobody, open_bus
from holozen.flags import Parser
from holozen.graph import Endpoint, includes
from holozen.tell import printable, say


def parser() -> Parser:
    about = "Show who writes, reads and serves what."
    parser = Parser(prog="holozen graph", description=about, epilog="example: holozen graph --dot | dot -Tsvg > g.svg")
    parser.add_argument("--dot", action="store_true", help="in the language of Graphviz")
    parser.add_argument("--json", action="store_true", help="one JSON object a line: an end of a key each")
    parser.set_defaults(node="graph")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    with open_bus(args) as bus:
        found = [end for end in bus.graph().settled(bus.connected) if not end.type.startswith("any/")]
    ends = [end for end in found if end.kind != "node"]
    _print(args, ends)
    if not found:
        say(nobody("nodes", bus.where, "`holozen up` starts some"))
    return 0


def _print(args: argparse.Namespace, ends: list[Endpoint]) -> None:
    for row in dot(ends) if args.dot else arrows(ends) if not args.json else []:
        print(printable(row))
    for end in ends if args.json else []:
        print(json.dumps(end._asdict()))


def arrows(ends: list[Endpoint]) -> list[str]:
    """A line a key: `teleop -> cmd_vel -> sim`; services after the topics, as `get_pose: pose_service`."""
    lines = []
    for key in sorted({end.key for end in ends if end.kind in ("pub", "sub") and "*" not in end.key}):
        writers = sorted({end.node for end in ends if end.kind == "pub" and end.key == key})
        readers = sorted({end.node for end in ends if end.kind == "sub" and includes(end.key, key)})
        lines.append(f"{', '.join(writers) or '-'} -> {key} -> {', '.join(readers) or '-'}")
    for key in sorted({end.key for end in ends if end.kind == "srv"}):
        lines.append(f"{key}: {', '.join(sorted({end.node for end in ends if end.kind == 'srv' and end.key == key}))}")
    return lines


def dot(ends: list[Endpoint]) -> list[str]:
    """A digraph: nodes as boxes, keys as ellipses, services as dashed ones."""
    nodes, services = sorted({end.node for end in ends}), {end.key for end in ends if end.kind == "srv"}
    keys = sorted({end.key for end in ends if "*" not in end.key})
    edges = set()
    for end in ends:
        if end.kind == "sub":
            edges |= {(key, f"node {end.node}") for key in keys if includes(end.key, key) and key not in services}
        else:
            edges.add((f"node {end.node}", end.key))
    return [
        "digraph holozen {",
        "  rankdir=LR;",
        *(f"  {_quoted(f'node {name}')} [shape=box, label={_quoted(name)}];" for name in nodes),
        *(f"  {_quoted(key)} [shape=ellipse{', style=dashed' * (key in services)}];" for key in keys),
        *(f"  {_quoted(a)} -> {_quoted(b)};" for a, b in sorted(edges)),
        "}",
    ]


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
