"""The table of docs/cli.md, made from the parsers of the command line."""

import argparse
from collections.abc import Iterable, Iterator
from typing import Any

from holozen import cli
from holozen.cli.verb import ROS2_TITLE, Noun, Service
from holozen.flags import Instead

LEFT_OUT = ("zenoh", ROS2_TITLE)  # groups of flags that many verbs have


def table(verbs: Iterable[str] = cli.VERBS) -> str:
    """A row for each verb: its command line, what it does, an example, its flags."""
    rows = [_row(parser) for verb in verbs for parser in _parsers(cli.command(verb))]
    return "\n".join(["| command | does | flags |", "|---|---|---|", *rows])


def _parsers(command: Any) -> Iterator[argparse.ArgumentParser]:
    """The parsers of a verb, of the verbs of a noun, or of a service and its verbs."""
    if not isinstance(command, Noun) or isinstance(command, Service):
        yield command.parser()
    if isinstance(command, Noun):
        yield from (command.verb(name).parser() for name in command.modules)


def _row(parser: argparse.ArgumentParser) -> str:
    groups = [group for group in parser._action_groups if group.title in LEFT_OUT]
    left_out = {id(action) for group in groups for action in group._group_actions}
    shown = (action for action in parser._actions if not isinstance(action, Instead))
    actions = [action for action in shown if id(action) not in left_out and action.dest != "help"]
    places = [_place(action) for action in actions if not action.option_strings]
    flags = [f"`{_flag(action)}`" for action in actions if action.option_strings]
    does = " ".join((parser.description or "").split())
    example = (parser.epilog or "").partition("example: ")[2]
    cell = f"{does}<br>`{example}`" if example else does
    return (
        " | ".join(
            (
                f"| `{_cell(' '.join([parser.prog, *places]))}`",
                _cell(cell),
                " ".join(map(_cell, flags)),
            )
        )
        + " |"
    )


def _place(action: argparse.Action) -> str:
    name = action.dest.upper() if action.metavar is None else str(action.metavar)
    if name.startswith("["):
        return name  # it tells itself how often it may be given
    return {"?": f"[{name}]", "*": f"[{name} ...]", "+": f"{name} ..."}.get(str(action.nargs), name)


def _flag(action: argparse.Action) -> str:
    names = ", ".join(action.option_strings)
    if action.nargs == 0:
        return names
    choices = "/".join(map(str, action.choices)) if action.choices else ""
    return f"{names} {action.metavar or choices or action.dest.upper()}"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
