"""`holozen completion`: a shell script, which calls `holozen __complete WORD...` for the
candidates.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
from collections.abc import Callable, Iterable
from typing import Any

from holozen.bus import Bus
from holozen.cli.hints import is_any
from holozen.cli.verb import Noun, Service, Verb, argument, by_name
from holozen.flags import Parser
from holozen.transport import connection
from holozen.transport.actions import found_in
from holozen.transport.graph import Endpoint

BASH = """\
_holozen() {
    mapfile -t COMPREPLY < <(holozen __complete "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null)
}
complete -o default -F _holozen holozen
"""
ZSH = """\
#compdef holozen
_holozen() {
    local -a found
    found=("${(@f)$(holozen __complete "${(@)words[2,CURRENT]}" 2>/dev/null)}")
    if [[ -n "${found[1]}" ]]; then compadd -a found; else _files; fi
}
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }
compdef _holozen holozen
"""
FISH = """\
complete -c holozen -a '(holozen __complete (commandline -opc)[2..-1] (commandline -ct) 2>/dev/null)'
"""  # noqa: E501
SCRIPTS = {"bash": BASH, "zsh": ZSH, "fish": FISH}


def run(args: argparse.Namespace) -> int:
    """Print the script of a shell."""
    script = SCRIPTS[args.shell]
    print(
        json.dumps({"shell": args.shell, "script": script}) + "\n" if args.json else script, end=""
    )
    return 0


PATIENCE = 0.25  # s to find nodes
# words that need no quoting in a shell; keys come over the wire
SAFE = re.compile(r"[A-Za-z0-9_./@%+-]+")
PARAMETERS = "rcl_interfaces/srv/ListParameters"
LIVE = {
    "key": "keys",
    "keys": "keys",
    "robot": "robots",
    "robots": "robots",
    "delete names": "robots",
    "topic type": "types",
    "topic words": "types",
    "action key": "actions",
    "service key": "services",
    "service type": "services' types",
    "node name": "nodes",
    "param node": "nodes with parameters",
}
"""Argument, or verb and argument -> the kind of candidates that are looked up on the wire."""


def complete(words: list[str], verbs: Iterable[str], command: Callable[[str], Any]) -> int:
    """Print the candidates for the last word, one per line; nothing if anything fails.

    `verbs` are those of the command line; `command` returns the implementation of one.
    """
    with contextlib.redirect_stderr(io.StringIO()), contextlib.suppress(Exception, SystemExit):
        for word in _candidates(words or [""], verbs, command):
            print(word)
    return 0


def _candidates(words: list[str], verbs: Iterable[str], command: Callable[[str], Any]) -> list[str]:
    *before, current = words
    if not before:
        return [verb for verb in verbs if verb.startswith(current)]
    one, left = _verb(command(before[0]), before[1:])
    parser = one.parser()
    action = _wanted(parser, left)
    if isinstance(one, Service) and not left and not current.startswith("-"):
        found = list(one.modules)
    elif current.startswith("-"):
        flags = parser._option_string_actions.items()
        found = [
            flag
            for flag, action in flags
            if flag.startswith("--") and action.help != argparse.SUPPRESS
        ]
    elif action is None:
        return []
    elif action.choices is not None:
        found = [str(choice) for choice in action.choices]
    elif isinstance(one, Verb) and (listed := one.candidates.get(action.dest)):
        found = listed(left, current)
    else:
        kind = LIVE.get(f"{before[0]} {action.dest}") or LIVE.get(action.dest)
        slash = "/" * current.startswith("/")  # as ROS writes keys
        found = (
            [slash + word for word in _live(kind, before) if SAFE.fullmatch(word)] if kind else []
        )
    return [word for word in found if word.startswith(current)]


def _verb(command: Any, words: list[str]) -> tuple[Any, list[str]]:
    """A command, or the noun's verb that `words` begin with; and the remaining words."""
    if isinstance(command, Noun) and words and words[0] in command.modules:
        return command.verb(words[0]), words[1:]
    return command, words


def _wanted(parser: argparse.ArgumentParser, words: list[str]) -> argparse.Action | None:
    """The argument that the next word belongs to; None if there is none."""
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


def _live(kind: str, words: list[str]) -> list[str]:
    flags = Parser(add_help=False)
    connection.add_arguments(flags)
    where = connection.from_arguments(flags.parse_known_args(words)[0])
    with Bus("complete", where, patience=PATIENCE) as bus:
        ends = bus.endpoints(patience=PATIENCE)
    return sorted(set(_words(kind, [end for end in ends if not is_any(end)])))


def _words(kind: str, ends: list[Endpoint]) -> list[str]:
    topics = [end for end in ends if end.kind in ("pub", "sub")]
    services = [end for end in ends if end.kind == "srv"]
    found = {
        "keys": [end.key for end in topics],
        "types": [end.type for end in topics],
        "actions": [action.key for action in found_in(services)],
        "services": [end.key for end in services],
        "services' types": [end.type for end in services],
        "nodes": [end.node for end in ends],
        "nodes with parameters": [
            end.key.rpartition("/")[0] for end in services if end.type == PARAMETERS
        ],
        "robots": [end.key.rpartition("/")[0] for end in topics if end.key.endswith("/odom")],
    }[kind]
    return [word for word in found if word and "*" not in word]


VERBS = by_name(
    Verb(
        "completion",
        "print a script that completes verbs, flags, and the keys, types, "
        "services, nodes and robots"
        " found",
        "bash > ~/.local/share/bash-completion/completions/holozen",
        argument("shell", choices=SCRIPTS, help="for which shell"),
        run,
        "print the script as JSON, one object per line",
        bus=False,
    ),
)
