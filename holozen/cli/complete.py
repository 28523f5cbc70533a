"""`holozen __complete WORD...`: the words that may stand where the last one does, for the scripts of `completion`.

Quick, and silent whatever goes wrong: a person is typing.
"""

import argparse
import contextlib
import io
import re
from collections.abc import Callable
from itertools import pairwise
from types import ModuleType
from typing import TYPE_CHECKING

from holozen import cli, connection
from holozen.bus import Bus
from holozen.flags import Parser, package
from holozen.graph import Endpoint

if TYPE_CHECKING:
    from pathlib import Path

PATIENCE = 0.25  # s to look who is there
SAFE = re.compile(r"[A-Za-z0-9_./@%+-]+")  # what a shell takes as it is; keys come over the wire
PARAMETERS = "rcl_interfaces/srv/ListParameters"
LIVE = {
    "key": "keys", "keys": "keys", "robot": "robots", "robots": "robots", "delete names": "robots",
    "topic type": "types", "topic words": "types", "service key": "services", "service type": "services' types",
    "node name": "nodes", "param node": "nodes with parameters",
}  # fmt: skip
"""By argument, or by verb and argument, of what kind the words are that only the wire knows."""


def main(words: list[str]) -> int:
    """Print the words that fit, one a line."""
    with contextlib.redirect_stderr(io.StringIO()), contextlib.suppress(Exception, SystemExit):
        for word in candidates(words or [""]):
            print(word)
    return 0


def candidates(words: list[str]) -> list[str]:
    """What may stand where the last of `words` does."""
    *before, current = words
    if not before:
        return [verb for verb in cli.VERBS if verb.startswith(current)]
    parser, left = _parser(cli.module(before[0]), before[1:])
    action = _wanted(parser, left)
    if current.startswith("-"):
        found = [flag for flag in parser._option_string_actions if flag.startswith("--")]
    elif action is None:
        return []
    elif action.choices is not None:
        found = [str(choice) for choice in action.choices]
    elif look := LOOKED_UP.get(f"{before[0]} {action.dest}"):
        found = look(left, current)
    else:
        kind = LIVE.get(f"{before[0]} {action.dest}") or LIVE.get(action.dest)
        slash = "/" * current.startswith("/")  # as ROS writes keys
        found = [slash + word for word in _live(kind, before) if SAFE.fullmatch(word)] if kind else []
    return [word for word in found if word.startswith(current)]


def _parser(module: ModuleType, words: list[str]) -> tuple[argparse.ArgumentParser, list[str]]:
    """The parser of a verb of the command line, or of the noun's verb that `words` begin with."""
    noun = getattr(module, "NOUN", None)
    if noun and words and words[0] in noun.modules:
        return noun.one(words[0]), words[1:]
    return _innermost(module.parser(), words)


def _innermost(parser: argparse.ArgumentParser, words: list[str]) -> tuple[argparse.ArgumentParser, list[str]]:
    """The parser of the verb that `words` name, and the words that are left for it."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction) and words and words[0] in action.choices:
            return _innermost(action.choices[words[0]], words[1:])
    return parser, words


def _wanted(parser: argparse.ArgumentParser, words: list[str]) -> argparse.Action | None:
    """The argument whose word comes next; None if any file or text may."""
    if words and (flag := parser._option_string_actions.get(words[-1])) and flag.nargs != 0:
        return flag
    flags, taken, skip = parser._option_string_actions, 0, False
    for word in words:
        if skip:
            skip = False
        elif word.startswith("-") and len(word) > 1:
            found = flags.get(word)
            skip = found is not None and found.nargs != 0
        else:
            taken += 1
    places = [action for action in parser._actions if not action.option_strings]
    if places and taken >= len(places):
        return places[-1] if places[-1].nargs in ("*", "+") else None
    return places[taken] if places else None


def _types(left: list[str], _current: str) -> list[str]:
    from holozen.interfaces import Registry

    return Registry(_given(left)).names()


def _packages(left: list[str], current: str) -> list[str]:
    """Names of packages; none for nothing, for which the shell shows files."""
    from holozen.ros import packages

    packages.use(_given(left))
    return sorted(packages.around()) if current else []


def _executables(left: list[str], _current: str) -> list[str]:
    """Those of the package before them."""
    from holozen.ros import executables, packages

    packages.use(_given(left))
    return executables.names(left[-1])


def _given(left: list[str]) -> "dict[str, Path]":
    return dict(package(value) for flag, value in pairwise(left) if flag == "--package")


LOOKED_UP: dict[str, Callable[[list[str], str], list[str]]] = {
    "interface type": _types, "run target": _packages, "run words": _executables,
}  # fmt: skip
"""By verb and argument, what tells the words that need no wire, from the words before and the one at hand."""


def _live(kind: str, words: list[str]) -> list[str]:
    flags = Parser(add_help=False)
    connection.add_arguments(flags)
    where = connection.from_arguments(flags.parse_known_args(words)[0])
    with Bus("complete", where, patience=PATIENCE) as bus:
        ends = bus.graph().settled(bus.connected, PATIENCE)
    return sorted(set(_words(kind, [end for end in ends if not end.type.startswith("any/")])))


def _words(kind: str, ends: list[Endpoint]) -> list[str]:
    topics = [end for end in ends if end.kind in ("pub", "sub")]
    services = [end for end in ends if end.kind == "srv"]
    found = {
        "keys": [end.key for end in topics],
        "types": [end.type for end in topics],
        "services": [end.key for end in services],
        "services' types": [end.type for end in services],
        "nodes": [end.node for end in ends],
        "nodes with parameters": [end.key.rpartition("/")[0] for end in services if end.type == PARAMETERS],
        "robots": [end.key.rpartition("/")[0] for end in topics if end.key.endswith("/odom")],
    }[kind]
    return [word for word in found if word and "*" not in word]
