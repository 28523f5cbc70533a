"""`holozen param`: list, get, set, describe, dump, load."""

from __future__ import annotations

import json

from holozen import connection
from holozen.bus import Bus
from holozen.cli import quick, ros2_flags
from holozen.cli.param_nodes import Nodes
from holozen.errors import BusError
from holozen.flags import key, number
from holozen.tell import printable, say

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    import argparse
    from typing import Any

    from holozen import rcl_interfaces as r
    from holozen.parser import Parser

VERBS = {
    "list": "the parameters of all nodes, or of one",
    "get": "the value of one",
    "set": "set one or more, all or none of them",
    "describe": "what parameters are, and which values they take",
    "dump": "all values of a node, as YAML that `load` reads",
    "load": "set what a file of `dump` says, all or nothing",
}

EXAMPLES = """examples:
  holozen param list
  holozen param get sim max_linear
  holozen param set sim max_linear 0.5
  holozen param describe sim max_linear
  holozen param dump controller > controller.yaml
  holozen param load controller controller.yaml"""


def parser() -> Parser:
    """The parser of all verbs."""
    from argparse import RawDescriptionHelpFormatter

    from holozen.parser import Parser

    parser = Parser(
        prog="holozen param", description="Read and set the parameters of running nodes.", epilog=EXAMPLES,
        formatter_class=RawDescriptionHelpFormatter,
    )  # fmt: skip
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)
    for name, text in VERBS.items():
        example = next(line.strip() for line in EXAMPLES.splitlines() if line.startswith(f"  holozen param {name}"))
        _arguments(verbs.add_parser(name, help=text, description=text, epilog=f"example: {example}"), name)
    return parser


def _arguments(parser: Any, verb: str) -> None:
    add = parser.add_argument
    if verb == "list":
        add("node", nargs="?", type=key, metavar="NODE")
        add("--param-type", action="store_true", help="with their types")
        add("--param-prefixes", nargs="+", default=[], metavar="PREFIX", help="only those below: PREFIX.name")
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
        add("--no-use-wildcard", action="store_true", help="leave out what the file says for /**")
    add("--json", action="store_true", help="one JSON object a line")
    told = "seconds to wait for a reply (default: 3)"
    add("--timeout", type=number(0.01, 1e6, "s"), default=3.0, metavar="S", help=told)
    parser.set_defaults(verb=verb)
    connection.add_arguments(parser)
    ros2_flags.add(parser, "param", verb)


def _parsed(argv: list[str]) -> Any:
    """The flags; those of one verb alone are ready sooner than those of all."""
    if argv and argv[0] in VERBS and (args := quick.parsed(lambda words: _arguments(words, argv[0]), argv[1:])):
        return args
    return parser().parse_args(argv)


def main(argv: list[str]) -> int:
    args = _parsed(argv)
    if args.verb == "set" and len(args.pairs) % 2:
        parser().error(f"{args.pairs[-1]!r} has no value; write NAME VALUE, or more such pairs")
    with Bus(f"param_{args.verb}", connection.from_arguments(args), patience=3.0, early=True) as bus:
        wanted = _wanted(args) if args.verb in ("set", "load") else {}
        nodes = Nodes(bus, args.timeout)
        if args.verb == "list":
            return list_names(args, nodes)
        node = nodes.only(args.node)
        if wanted:
            return set_values(args, nodes, node, wanted)
        return {"get": get, "describe": describe, "dump": dump}[args.verb](args, nodes, node)


def _wanted(args: argparse.Namespace) -> dict[str, Any]:
    from holozen.cli import param_file

    if args.verb == "load":
        return param_file.read(args.file, args.node, not args.no_use_wildcard)
    names = args.pairs[::2]
    if len(set(names)) < len(names):
        raise BusError(f"a name is there twice among {', '.join(names)}")
    return dict(zip(names, map(param_file.typed, args.pairs[1::2]), strict=True))


def list_names(args: argparse.Namespace, nodes: Nodes) -> int:
    """Print the names of one node's parameters, or of all nodes', each node only once."""
    code = 0
    for node in [nodes.only(args.node)] if args.node else sorted(nodes.sessions):
        if len(nodes.sessions[node]) > 1:
            say(f"holozen param {args.verb}: {nodes.twins(node)}; only one of them is shown: end the others")
            code = 1
        names = nodes.names(node, args.param_prefixes)
        kinds = _kinds(nodes, node, names) if args.param_type or args.json else {}
        if not args.node and not args.json:
            print(printable(f"{node}:"))
        for name in names:
            row = {"node": node, "name": name, "type": kinds.get(name)}
            _show(args, row, f"  {name}" + (f" (type: {kinds[name]})" if args.param_type else ""))
    if not nodes.sessions:
        say("no parameters: nobody is there who has any; `holozen up` starts some")
    return code


def get(args: argparse.Namespace, nodes: Nodes, node: str) -> int:
    """Print one value."""
    (value,) = nodes.values(node, [args.name])
    text = _text(value.plain())
    _show(
        args, _row(node, args.name, value), text if args.hide_type else f"{_word(value.type).title()} value is: {text}"
    )
    return 0


def set_values(args: argparse.Namespace, nodes: Nodes, node: str, wanted: dict[str, Any]) -> int:
    """Set values, and say of each what became of it; 1 if they were refused."""
    results = nodes.set(node, wanted)
    for (name, value), result in zip(wanted.items(), results, strict=True):
        row = {"node": node, "name": name, "value": value, "successful": result.successful, "reason": result.reason}
        what = f"Set parameter {name}" if len(wanted) > 1 or args.verb == "load" else "Set parameter"
        if result.successful or args.json:
            _show(args, row, f"{what} successful")
        elif not result.reason.startswith("not set"):  # which says no more than that another one was refused
            say(f"holozen param {args.verb}: {what.replace('Set', 'setting')} failed: {result.reason}")
    done = all(result.successful for result in results)
    if not done and len(wanted) > 1:
        say(f"holozen param {args.verb}: none of the {len(wanted)} was set")
    return 0 if done else 1


def describe(args: argparse.Namespace, nodes: Nodes, node: str) -> int:
    """Print what parameters are."""
    for row in nodes.descriptors(node, args.names):
        ranges: list[Any] = [*row.floating_point_range, *row.integer_range]
        low, high = (ranges[0].from_value, ranges[0].to_value) if ranges else (None, None)
        told = {
            "node": node, "name": row.name, "type": _word(row.type), "description": row.description,
            "read_only": row.read_only, "min": low, "max": high, "constraints": row.additional_constraints,
        }  # fmt: skip
        lines = [f"Parameter name: {row.name}", f"  Type: {_word(row.type)}", f"  Description: {row.description}"]
        lines += ["  Constraints:"] + ["    Read only: true"] * row.read_only
        lines += [f"    Min value: {low}", f"    Max value: {high}"] if ranges else []
        lines += [f"    Additional constraints: {row.additional_constraints}"] * bool(row.additional_constraints)
        _show(args, told, *lines)
    return 0


def dump(args: argparse.Namespace, nodes: Nodes, node: str) -> int:
    """Print all values of a node."""
    from holozen.cli import param_file

    names = nodes.names(node)
    values = nodes.values(node, names)
    if not args.json:
        print(
            "\n".join(param_file.lines(node, {name: value.plain() for name, value in zip(names, values, strict=True)}))
        )
    for name, value in zip(names, values, strict=True) if args.json else ():
        print(json.dumps(_row(node, name, value)))
    return 0


def _kinds(nodes: Nodes, node: str, names: list[str]) -> dict[str, str]:
    return {row.name: _word(row.type) for row in nodes.descriptors(node, names)} if names else {}


def _row(node: str, name: str, value: r.ParameterValue) -> dict[str, Any]:
    return {"node": node, "name": name, "type": _word(value.type), "value": value.plain()}


def _word(kind: int) -> str:
    from holozen.rcl_interfaces import WORDS

    return WORDS[kind] if kind < len(WORDS) else "unknown"


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _show(args: argparse.Namespace, row: dict[str, Any], *lines: str) -> None:
    for line in (json.dumps(row),) if args.json else lines:
        print(printable(line))
