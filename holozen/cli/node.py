"""`holozen node`: list."""

import argparse

from holozen import connection
from holozen.bus import Bus
from holozen.tell import printable, say


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="holozen node", description="Look at the nodes that run.")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)
    connection.add_arguments(verbs.add_parser("list", help="the names of the nodes"))
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    with Bus("node_list", connection.from_arguments(args), patience=3.0) as bus:
        endpoints = bus.graph().settled(bus.connected)
    names = sorted(endpoint.node for endpoint in endpoints if endpoint.kind == "node")
    for name in names:
        print(printable(name))
    if not names:
        say("no nodes: nobody is there; `holozen up` starts some")
    return 0
