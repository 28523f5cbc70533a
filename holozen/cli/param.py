"""`holozen param`: read and set the parameters of running nodes.

Values are written on the command line, or in a file in ROS 2's format:

/sim:
  ros__parameters:
    max_linear: 5.0
"""

from __future__ import annotations

import argparse
import json
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from holozen import parameter_yaml
from holozen.cli.verb import Noun, Verb, by_name, open_bus
from holozen.console import printable, report
from holozen.flags import key, number
from holozen.parameter_nodes import Nodes
from holozen.parameter_yaml import Value, written
from holozen.transport.errors import BusError

if TYPE_CHECKING:
    from holozen.messages import rcl_interfaces as r

_PLAIN = re.compile(r"/?[A-Za-z][A-Za-z0-9_./]*")
_NO_NAMES = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")  # not strings in YAML 1.1


def list_names(args: argparse.Namespace) -> int:
    """Print the names of one node's parameters, or of all nodes', each node once."""
    code = 0
    with open_bus(args) as bus:
        nodes = Nodes(bus, args.timeout)
        for node in [nodes.only(args.node)] if args.node else sorted(nodes.sessions):
            if len(nodes.sessions[node]) > 1:
                report(
                    f"holozen {args.verb}: {nodes.twins(node)}; only one of them is shown: end "
                    "the others"
                )
                code = 1
            names = nodes.names(node, args.param_prefixes)
            described = (
                nodes.descriptors(node, names) if names and (args.param_type or args.json) else []
            )
            kinds = {row.name: _word(row.type) for row in described}
            if not args.node and not args.json:
                print(printable(f"{node}:"))
            for name in names:
                row = {"node": node, "name": name, "type": kinds.get(name)}
                _show(
                    args, row, f"  {name}" + (f" (type: {kinds[name]})" if args.param_type else "")
                )
    if not nodes.sessions:
        report("no parameters: no node has any; `holozen up` starts a robot")
    return code


def get(args: argparse.Namespace, nodes: Nodes, node: str) -> int:
    """Print one value."""
    (value,) = nodes.values(node, [args.name])
    plain = value.plain()
    text = "" if args.hide_type else f"{_word(value.type).title()} value is: "
    _show(
        args,
        _row(node, args.name, value),
        text + (plain if isinstance(plain, str) else json.dumps(plain)),
    )
    return 0


def set_values(args: argparse.Namespace) -> int:
    """Set the values that are given, all or none of them."""
    if len(args.pairs) % 2:
        wrong = f"{args.pairs[-1]!r} has no value; write NODE NAME VALUE, or more such pairs"
        VERBS["param set"].parser().error(wrong)
    names = args.pairs[::2]
    if len(set(names)) < len(names):
        raise BusError(f"a parameter is named twice: {', '.join(names)}")
    return _set(args, dict(zip(names, map(typed, args.pairs[1::2]), strict=True)))


def load(args: argparse.Namespace) -> int:
    """Set the values in a file, all or none of them."""
    return _set(args, read_file(args.file, args.node, not args.no_use_wildcard))


def _set(args: argparse.Namespace, wanted: dict[str, Any]) -> int:
    """Set values and report the result of each; 1 if they were refused."""
    with open_bus(args) as bus:
        nodes = Nodes(bus, args.timeout)
        node = nodes.only(args.node)
        results = nodes.set(node, wanted)
    for (name, value), result in zip(wanted.items(), results, strict=True):
        row = {
            "node": node,
            "name": name,
            "value": value,
            "successful": result.successful,
            "reason": result.reason,
        }
        what = (
            f"Set parameter {name}"
            if len(wanted) > 1 or args.verb == "param load"
            else "Set parameter"
        )
        if result.successful or args.json:
            _show(args, row, f"{what} successful")
        # that reason only means that another one was refused
        elif not result.reason.startswith("not set"):
            report(f"holozen {args.verb}: {what.replace('Set', 'setting')} failed: {result.reason}")
    done = all(result.successful for result in results)
    if not done and len(wanted) > 1:
        report(f"holozen {args.verb}: none of the {len(wanted)} was set")
    return 0 if done else 1


def describe(args: argparse.Namespace, nodes: Nodes, node: str) -> int:
    """Print the descriptions of parameters."""
    for row in nodes.descriptors(node, args.names):
        ranges: list[Any] = [*row.floating_point_range, *row.integer_range]
        low, high = (ranges[0].from_value, ranges[0].to_value) if ranges else (None, None)
        described = {
            "node": node,
            "name": row.name,
            "type": _word(row.type),
            "description": row.description,
            "read_only": row.read_only,
            "min": low,
            "max": high,
            "constraints": row.additional_constraints,
        }
        lines = [
            f"Parameter name: {row.name}",
            f"  Type: {_word(row.type)}",
            f"  Description: {row.description}",
        ]
        lines += ["  Constraints:"] + ["    Read only: true"] * row.read_only
        lines += [f"    Min value: {low}", f"    Max value: {high}"] if ranges else []
        lines += [f"    Additional constraints: {row.additional_constraints}"] * bool(
            row.additional_constraints
        )
        _show(args, described, *lines)
    return 0


def dump(args: argparse.Namespace, nodes: Nodes, node: str) -> int:
    """Print all values of a node."""
    names = nodes.names(node)
    values = dict(zip(names, nodes.values(node, names), strict=True))
    if args.json:
        lines = [json.dumps(_row(node, name, value)) for name, value in values.items()]
    else:
        lines = file_lines(node, {name: value.plain() for name, value in values.items()})
    for line in lines:
        print(line)
    return 0


def _row(node: str, name: str, value: r.ParameterValue) -> dict[str, Any]:
    return {"node": node, "name": name, "type": _word(value.type), "value": value.plain()}


def _word(kind: int) -> str:
    from holozen.messages.rcl_interfaces import WORDS

    return WORDS[kind] if kind < len(WORDS) else "unknown"


def _show(args: argparse.Namespace, row: dict[str, Any], *lines: str) -> None:
    for line in (json.dumps(row),) if args.json else lines:
        print(printable(line))


def typed(text: str) -> Value:
    """The value that a word has in a parameter file; what has none there stays text, which a node
    that expects another type refuses.
    """
    try:
        found = parameter_yaml.parse(text)
    except ValueError:
        return text
    is_endless = isinstance(found, float) and not math.isfinite(found)
    return text if is_endless or isinstance(found, dict) else found


def file_lines(node: str, values: dict[str, Any]) -> list[str]:
    """The lines of the file that holds a node's `values`."""
    rows = [f"    {_written_name(name)}: {written(value)}" for name, value in values.items()]
    return [
        f"{_written_name('/' + node)}:",
        f"  {parameter_yaml.KEY}:" + ("" if rows else " {}"),
        *rows,
    ]


def read_file(path: str, node: str, wildcards: bool = True) -> dict[str, Value]:
    """The values that a file has for a node. Raises BusError with the reason and the file's
    sections.
    """
    try:
        sections = parameter_yaml.read(path)
    except ValueError as error:
        raise BusError(str(error)) from None
    full = f"/{node}"
    mine = [
        section
        for section in sections
        if (section.is_for(full) if wildcards else section.place == full)
    ]
    if not mine:
        there = (
            ", ".join(section.place for section in sections) or f"none with {parameter_yaml.KEY}"
        )
        raise BusError(f"{path}: it has no section for the node {node!r}; sections: {there}")
    found: dict[str, Value] = {}
    for section in mine:  # its own section comes last, and overrides those with wildcards
        found |= section.values
    if not found:
        raise BusError(f"{path}: it has no parameter for the node {node!r}")
    for name, value in found.items():
        numbers = [
            each
            for each in (value if isinstance(value, list) else [value])
            if isinstance(each, float)
        ]
        if not all(map(math.isfinite, numbers)):
            raise BusError(f"{path}: {name} is {value}; write a finite number")
    return found


def _written_name(name: str) -> str:
    return name if _PLAIN.fullmatch(name) and name.lower() not in _NO_NAMES else written(name)


def _of_node(
    work: Callable[[argparse.Namespace, Nodes, str], int],
) -> Callable[[argparse.Namespace], int]:
    """The `run` of a verb that works on the one node that its arguments name."""

    def run(args: argparse.Namespace) -> int:
        with open_bus(args) as bus:
            nodes = Nodes(bus, args.timeout)
            return work(args, nodes, nodes.only(args.node))

    return run


def _arguments(verb: str) -> Callable[[argparse.ArgumentParser], None]:
    """A function that adds the flags of a verb to its parser."""

    def fill(parser: argparse.ArgumentParser) -> None:
        add = parser.add_argument
        if verb == "list":
            add("node", nargs="?", type=key, metavar="NODE")
            add("--param-type", action="store_true", help="with their types")
            add(
                "--param-prefixes",
                nargs="+",
                default=[],
                metavar="PREFIX",
                help="only those below: PREFIX.name",
            )
        else:
            add("node", type=key, metavar="NODE")
        if verb == "get":
            add("name", metavar="NAME")
            add("--hide-type", action="store_true", help="the value alone")
        elif verb == "set":
            add("pairs", nargs="+", metavar="NAME VALUE")
        elif verb == "describe":
            add("names", nargs="+", metavar="NAME")
        elif verb == "load":
            add("file", metavar="FILE", help="YAML, or JSON; - for standard input")
            add("--no-use-wildcard", action="store_true", help="ignore the file's section /**")
        text = "seconds to wait for a reply (default: 3)"
        add("--timeout", type=number(0.01, 1e6, "s"), default=3.0, metavar="S", help=text)

    return fill


VERBS = by_name(
    Noun("param", "read and set the parameters of running nodes"),
    *(
        Verb(f"param {name}", about, example, _arguments(name), run)
        for name, about, example, run in (
            ("list", "list the parameters of all nodes, or of one", "", list_names),
            ("get", "show the value of one", "sim max_linear", _of_node(get)),
            ("set", "set one or more, all or none of them", "sim max_linear 0.5", set_values),
            (
                "describe",
                "describe parameters, and the values that they accept",
                "sim max_linear",
                _of_node(describe),
            ),
            (
                "dump",
                "print all values of a node, as YAML that `load` reads",
                "controller > controller.yaml",
                _of_node(dump),
            ),
            (
                "load",
                "set the values of a file that `dump` wrote, all or none of them",
                "controller controller.yaml",
                load,
            ),
        )
    ),
)
