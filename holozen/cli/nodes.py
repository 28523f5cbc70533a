"""`holozen node list` and `info`: who runs, and what each reads, writes and serves."""

import json

from holozen.cli.noun import Verb, nobody, open_bus
from holozen.cli.topics import listed
from holozen.flags import key, nearest
from holozen.graph import Endpoint
from holozen.tell import printable, say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse

TITLES = {"sub": "Subscribers", "pub": "Publishers", "srv": "Service Servers"}


def list_nodes(args: "argparse.Namespace") -> int:
    """Print the name of each node, as often as it runs."""
    with open_bus(args) as bus:
        endpoints = bus.graph().settled(bus.connected)
    nodes = sorted((end.node, end.session) for end in endpoints if end.kind == "node")
    if args.count_nodes:
        print(json.dumps({"count": len(nodes)}) if args.json else len(nodes))
        return 0
    for name, session in nodes:
        print(json.dumps({"node": name, "session": session}) if args.json else printable(name))
    if not nodes:
        say(nobody("nodes", bus.where, "`holozen up` starts some"))
    return 0


def info(args: "argparse.Namespace") -> int:
    """Print what a node reads, writes and serves; exit code 1 if there is none of that name."""
    with open_bus(args) as bus:
        endpoints = bus.graph().settled(bus.connected)
    name, _, session = args.name.partition("@")
    ends = [end for end in endpoints if end.node == name and end.session.startswith(session)]
    if not ends:
        names = sorted({end.node for end in endpoints})
        told = f"known: {listed(names)}" if names else f"nobody is there at {bus.where}"
        say(f"holozen node info: unknown node {args.name!r}{nearest(name, names)}; {told}")
        return 1
    for session in sorted({end.session for end in ends}):
        _print(name, [end for end in ends if end.session == session], args.json)
    return 0


def _print(name: str, ends: list[Endpoint], as_json: bool) -> None:
    shown = [end for end in ends if not end.type.startswith("any/")]
    kinds = {kind: [{"key": end.key, "type": end.type} for end in shown if end.kind == kind] for kind in TITLES}
    session = ends[0].session
    if as_json:
        named = {"subscribers": kinds["sub"], "publishers": kinds["pub"], "services": kinds["srv"]}
        print(json.dumps({"node": name, "session": session, **named}))
        return
    print(printable(f"{name} ({session[:6]})"))
    for kind, title in TITLES.items():
        print(f"  {title}:")
        for end in kinds[kind]:
            print(printable(f"    {end['key']}: {end['type']}"))


def _list_arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("-c", "--count-nodes", action="store_true", help="only how many there are")


def _info_arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("name", type=key, help="such as sim, or sim@a1b2c3 where there are more")


VERBS = {
    "list": Verb("the names of the nodes", "holozen node list", _list_arguments, list_nodes),
    "info": Verb("what a node reads, writes and serves", "holozen node info sim", _info_arguments, info),
}
