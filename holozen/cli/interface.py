"""`holozen interface`: list, show, proto."""

import argparse
import json
from collections.abc import Iterator
from typing import Any

from holozen.cli.verb import Noun, Verb, by_name, open_bus
from holozen.console import printable
from holozen.flags import add_packages, packages_in
from holozen.messages.definitions import Interface, InterfaceError, prototype
from holozen.messages.registry import Registry


def list_types(args: argparse.Namespace) -> int:
    """Print the name of each type."""
    names = Registry(dict(args.package)).names()
    kinds = [
        ("msg", "Messages", args.only_msgs),
        ("srv", "Services", args.only_srvs),
        ("action", "Actions", args.only_actions),
    ]
    all_kinds = not any(wanted for _, _, wanted in kinds)
    for kind, title, wanted in kinds:
        found = [name for name in names if f"/{kind}/" in name] if wanted or all_kinds else []
        if args.json:
            print(
                "".join(json.dumps({"name": name, "kind": kind}) + "\n" for name in found), end=""
            )
        elif found:
            print("\n    ".join([f"{title}:", *found]))
    return 0


def show(args: argparse.Namespace) -> int:
    """Print the definition of a type, with nested fields indented."""
    interface = _found(args)
    print(
        json.dumps(described(interface))
        if args.json
        else "\n".join(map(printable_line, definition(interface)))
    )
    return 0


def _found(args: argparse.Namespace) -> Interface:
    """The type that is named, or that of the named key; one that is unknown here is learned from
    its publisher.
    """
    registry = Registry(dict(args.package))
    try:
        return registry.find(args.type)
    except InterfaceError:
        package = args.type.partition("/")[0]
        if package.isidentifier() and registry.places.names(package):
            raise  # the package is here, without that type
        from holozen.transport.graph import on_key

        with open_bus(args) as bus:
            ends, key = bus.endpoints(), args.type.removeprefix("/")
            types = {end.type for kind in ("pub", "sub", "srv") for end in on_key(ends, key, kind)}
            name = min((one for one in types if not one.startswith("any/")), default="")
            if name or bus.connected():
                return registry.learn(name or args.type, bus.definition)
        raise


def proto(args: argparse.Namespace) -> int:
    """Print a message, the request of a service or the goal of an action, with all fields at their
    defaults.
    """
    interface = Registry(dict(args.package)).find(args.type)
    value = prototype(interface.parts[0] if interface.parts else interface)
    print(json.dumps(value) if args.json else "\n".join(yaml(value)) or "{}")
    return 0


def definition(interface: Interface, indent: str = "") -> Iterator[str]:
    """The lines of a .msg, .srv or .action file."""
    for number, part in enumerate(sections(interface)):
        yield from (*(["---"] if number else []), *definition(part))
    for constant in interface.constants:
        yield indent + constant.line()
    for field in interface.fields:
        yield indent + field.line(interface.package)
        if field.nested:
            yield from definition(field.nested, indent + "\t")


def sections(interface: Interface) -> tuple[Interface, ...]:
    """The messages that the file of a service or an action defines; none for a message."""
    return interface.parts[: 3 if interface.kind == "action" else 2]


def printable_line(line: str) -> str:
    """A line without control characters, apart from leading tabs."""
    bare = line.lstrip("\t")
    return line[: len(line) - len(bare)] + printable(bare)


def described(interface: Interface) -> dict[str, Any]:
    """A type as plain values."""
    row: dict[str, Any] = {"name": interface.name, "kind": interface.kind}
    if interface.parts:
        names = (
            ("request", "response") if interface.kind == "srv" else ("goal", "result", "feedback")
        )
        return row | {
            name: described(part) for name, part in zip(names, sections(interface), strict=True)
        }
    fields = [
        field._asdict() | {"nested": field.nested and described(field.nested)}
        for field in interface.fields
    ]
    return row | {
        "fields": fields,
        "constants": [constant._asdict() for constant in interface.constants],
    }


# names that YAML reads as another type
NOT_TEXT = ("yes", "no", "on", "off", "true", "false", "null")


def yaml(value: dict[str, Any], indent: str = "") -> Iterator[str]:
    """The lines of a message in YAML. Lists are on one line, as in JSON."""
    for field, inner in value.items():
        name = json.dumps(field) if field in NOT_TEXT else field
        if isinstance(inner, dict) and inner:
            yield f"{indent}{name}:"
            yield from yaml(inner, indent + "  ")
        else:
            yield f"{indent}{name}: {json.dumps(inner)}"


def _list_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-m", "--only-msgs", action="store_true", help="only messages")
    parser.add_argument("-s", "--only-srvs", action="store_true", help="only services")
    parser.add_argument("-a", "--only-actions", action="store_true", help="only actions")
    add_packages(parser)


def _show_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("type", metavar="TYPE|KEY", help=f"{SUCH}; or a key, such as odom")
    add_packages(parser)


def _proto_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("type", metavar="TYPE", help=SUCH)
    add_packages(parser)


def _types(before: list[str], _current: str) -> list[str]:
    return Registry(packages_in(before)).names()


SUCH = "such as geometry_msgs/msg/Twist, std_srvs/srv/Trigger, nav2_msgs/action/NavigateToPose"
VERBS = by_name(
    Noun("interface", "show message, service and action types"),
    Verb(
        "interface list",
        "list all known types",
        "--only-srvs",
        _list_arguments,
        list_types,
        bus=False,
    ),
    Verb(
        "interface show",
        "show the fields of a type, nested ones included",
        "geometry_msgs/msg/Twist",
        _show_arguments,
        show,
        candidates={"type": _types},
    ),
    Verb(
        "interface proto",
        "print a message with all fields, to edit and publish",
        "geometry_msgs/msg/Twist | holozen topic pub cmd_vel -",
        _proto_arguments,
        proto,
        bus=False,
        candidates={"type": _types},
    ),
)
