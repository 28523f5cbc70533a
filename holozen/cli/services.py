"""`holozen service list`, `type`, `find` and `info`: which services there are, and who serves them."""

import json

from holozen.cli.noun import Verb, nobody, open_bus
from holozen.cli.topics import listed, unknown
from holozen.flags import key, nearest
from holozen.graph import Endpoint
from holozen.tell import printable, say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse


def _served(args: "argparse.Namespace") -> tuple[list[Endpoint], str]:
    """The services there are, and where they were looked for."""
    with open_bus(args) as bus:
        return [end for end in bus.graph().settled(bus.connected) if end.kind == "srv"], bus.where


def list_services(args: "argparse.Namespace") -> int:
    """Print each service key once."""
    served, where = _served(args)
    found = sorted({(end.key, end.type) for end in served})
    if args.count_services:
        print(json.dumps({"count": len(found)}) if args.json else len(found))
        return 0
    for name, kind in found:
        shown = f"{name} [{kind}]" if args.show_types else name
        print(json.dumps({"key": name, "type": kind}) if args.json else printable(shown))
    if not found:
        say(nobody("services", where, "`holozen up` starts some"))
    return 0


def type_of(args: "argparse.Namespace") -> int:
    """Print a service's type; exit code 1 if nobody serves it."""
    served, where = _served(args)
    types = sorted({end.type for end in served if end.key == args.key})
    for name in types:
        print(json.dumps({"key": args.key, "type": name}) if args.json else printable(name))
    if not types:
        say(f"holozen service type: {unknown(args.key, sorted({end.key for end in served}), where)}")
    return 0 if types else 1


def find(args: "argparse.Namespace") -> int:
    """Print the keys of a type; exit code 1 if there are none."""
    served, _ = _served(args)
    keys = sorted({end.key for end in served if f"/{end.type}".endswith(f"/{args.type}")})
    for name in keys:
        print(json.dumps({"key": name, "type": args.type}) if args.json else printable(name))
    if not keys:
        types = sorted({end.type for end in served})
        near = nearest(args.type, types)
        say(f"holozen service find: no service of type {args.type!r}{near}; types: {listed(types)}")
    return 0 if keys else 1


def info(args: "argparse.Namespace") -> int:
    """Print a service's type and who serves it; exit code 1 if nobody does."""
    served, where = _served(args)
    servers = [end for end in served if end.key == args.key]
    if not servers:
        say(f"holozen service info: {unknown(args.key, sorted({end.key for end in served}), where)}")
        return 1
    types = sorted({end.type for end in servers})
    if args.json:
        who = [{"node": end.node, "session": end.session} for end in servers]
        print(json.dumps({"key": args.key, "types": types, "servers": who}))
        return 0
    print(printable(f"Type: {', '.join(types)}"))
    print(f"Services count: {len(servers)}")
    for end in servers:
        print(printable(f"  {end.node} ({end.session[:6]})"))
    return 0


def _list_arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("-t", "--show-types", action="store_true", help="with their types")
    parser.add_argument("-c", "--count-services", action="store_true", help="only how many there are")


def _key_arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("key", type=key)


def _find_arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("type", help="such as std_srvs/srv/Trigger, or Trigger")


VERBS = {
    "list": Verb("the services that nodes offer", "holozen service list -t", _list_arguments, list_services),
    "type": Verb("a service's type", "holozen service type next_goal", _key_arguments, type_of),
    "find": Verb("the services of a type", "holozen service find std_srvs/srv/Trigger", _find_arguments, find),
    "info": Verb("a service's type and who serves it", "holozen service info next_goal", _key_arguments, info),
}
