"""`holozen interface`: list, show, proto."""

import argparse
import json
from collections.abc import Iterator
from typing import Any

from holozen import flags
from holozen.console import printable, report
from holozen.messages.definitions import Interface, InterfaceError, prototype
from holozen.messages.registry import Registry
from holozen.transport import connection


def parser() -> flags.Parser:
    parser = flags.Parser(prog="holozen interface", description="Show message and service types.")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)
    for name, (about, example) in VERBS.items():
        verb = verbs.add_parser(name, help=about, description=about, epilog=f"example: {example}")
        if name == "list":
            verb.add_argument("-m", "--only-msgs", action="store_true", help="no services")
            verb.add_argument("-s", "--only-srvs", action="store_true", help="no messages")
        else:
            verb.add_argument("type", metavar="TYPE|KEY" if name == "show" else "TYPE",
                help="such as geometry_msgs/msg/Twist or std_srvs/srv/Trigger"
                     + "; or a key, such as odom" * (name == "show"))  # fmt: skip
        verb.add_argument("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR",
            help="the folder of package NAME, with msg and srv folders in it")  # fmt: skip
        verb.add_argument("--json", action="store_true", help="one JSON object per line")
        if name == "show":
            connection.add_arguments(verb)
    return parser


VERBS = {
    "list": ("all known types", "holozen interface list --only-srvs"),
    "show": ("the fields of a type, nested ones included", "holozen interface show geometry_msgs/msg/Twist"),
    "proto": (
        "a message with all fields, to edit and publish",
        "holozen interface proto geometry_msgs/msg/Twist | holozen topic pub cmd_vel -",
    ),
}


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    try:
        return {"list": list_types, "show": show, "proto": proto}[args.verb](args)
    except InterfaceError as error:
        report(f"holozen interface {args.verb}: {error}")
        return 1


def list_types(args: argparse.Namespace) -> int:
    """Print the name of each type."""
    names = Registry(dict(args.package)).names()
    wanted = [("msg", "Messages", args.only_srvs), ("srv", "Services", args.only_msgs)]
    for kind, title, left_out in wanted:
        found = [] if left_out and not (args.only_msgs and args.only_srvs) else [n for n in names if f"/{kind}/" in n]
        if args.json:
            print("".join(json.dumps({"name": name, "kind": kind}) + "\n" for name in found), end="")
        elif found:
            print("\n    ".join([f"{title}:", *found]))
    return 0


def show(args: argparse.Namespace) -> int:
    """Print the definition of a type, with nested fields indented."""
    interface = _found(args)
    print(json.dumps(described(interface)) if args.json else "\n".join(map(printable_line, definition(interface))))
    return 0


def _found(args: argparse.Namespace) -> Interface:
    """The type that is named, or that of a key; one that is not here comes from the node that publishes it."""
    registry = Registry(dict(args.package))
    try:
        return registry.find(args.type)
    except InterfaceError:
        package = args.type.partition("/")[0]
        if package.isidentifier() and registry.places.names(package):
            raise  # it is here, without that type
        from holozen.bus import Bus
        from holozen.transport.graph import on_key

        with Bus("interface_show", connection.from_arguments(args)) as bus:
            ends, key = bus.endpoints(), args.type.removeprefix("/")
            types = {end.type for kind in ("pub", "sub", "srv") for end in on_key(ends, key, kind)}
            name = min((one for one in types if not one.startswith("any/")), default="")
            if name or bus.connected():
                return registry.learn(name or args.type, bus.definition)
        raise


def proto(args: argparse.Namespace) -> int:
    """Print a message, or the request of a service, with all fields at their defaults."""
    interface = Registry(dict(args.package)).find(args.type)
    value = prototype(interface.request or interface)
    print(json.dumps(value) if args.json else "\n".join(yaml(value)) or "{}")
    return 0


def definition(interface: Interface, indent: str = "") -> Iterator[str]:
    """The lines of a .msg or .srv file."""
    if interface.request and interface.response:
        yield from (*definition(interface.request), "---", *definition(interface.response))
    for constant in interface.constants:
        value = constant.value if isinstance(constant.value, str) else json.dumps(constant.value)
        yield f"{indent}{constant.type} {constant.name}={value}"
    for field in interface.fields:
        default = "" if field.default is None else f" {json.dumps(field.default)}"
        yield f"{indent}{field.spelled(interface.package)} {field.name}{default}"
        if field.nested:
            yield from definition(field.nested, indent + "\t")


def printable_line(line: str) -> str:
    """A line without control characters, apart from leading tabs."""
    bare = line.lstrip("\t")
    return line[: len(line) - len(bare)] + printable(bare)


def described(interface: Interface) -> dict[str, Any]:
    """A type as plain values."""
    row: dict[str, Any] = {"name": interface.name, "kind": interface.kind}
    if interface.request and interface.response:
        return row | {"request": described(interface.request), "response": described(interface.response)}
    fields = [field._asdict() | {"nested": field.nested and described(field.nested)} for field in interface.fields]
    return row | {"fields": fields, "constants": [constant._asdict() for constant in interface.constants]}


def yaml(value: dict[str, Any], indent: str = "") -> Iterator[str]:
    """The lines of a message in YAML. Lists are on one line, as in JSON."""
    for name, inner in value.items():
        if isinstance(inner, dict) and inner:
            yield f"{indent}{name}:"
            yield from yaml(inner, indent + "  ")
        else:
            yield f"{indent}{name}: {json.dumps(inner)}"
