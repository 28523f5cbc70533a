"""The declaration of the command line's verbs, their common flags, and their bus. Imports only what
the flags need.
"""

import argparse
import importlib
import re
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from holozen.cli import table
from holozen.flags import Parser, count, key, number
from holozen.process import deferred_interrupt
from holozen.suggest import suggest
from holozen.transport import connection

if TYPE_CHECKING:
    from types import ModuleType

    from holozen.transport.bus import Bus
    from holozen.transport.node import Node

JSON = "print the output as JSON, one object per line"
ROS2_TITLE = "accepted for compatibility with ros2"

# Flags of ros2 without effect here, accepted so that its command lines work unchanged. Their values
# are checked: a misspelt one would seem to have been understood.
_EVERY = ("--spin-time S", "--no-daemon")
_QOS = (
    "--qos-profile NAME",
    "--qos-depth N",
    "--qos-history NAME",
    "--qos-reliability NAME",
    "--qos-durability NAME",
    "--qos-liveliness NAME",
    "--qos-liveliness-lease-duration-seconds S",
)
_WRITTEN, _READ = ("-s mcap", "--storage mcap"), ("-s FORMAT", "--storage FORMAT")
_NODES, _TOPICS, _SERVICES = (
    "--include-hidden-nodes",
    "--include-hidden-topics",
    "--include-hidden-services",
)
_ROS2 = {
    "topic find": (_TOPICS,),
    "topic type": (_TOPICS,),
    "topic info": (_TOPICS,),
    "topic echo": (
        *(flag for flag in _QOS if "durability" not in flag),
        _TOPICS,
        "--lost-messages",
        "--no-lost-messages",
    ),
    "topic pub": (*_QOS, "--keep-alive S"),
    "service find": (_SERVICES,),
    "launch": ("-n", "--noninteractive", "-d", "--debug", "-a", "--show-all-subprocesses-output"),
    "node list": ("-a", "--all"),
    "node info": ("--include-hidden",),
    "param list": (_NODES,),
    "param get": (_NODES,),
    "param set": (_NODES,),
    "param describe": (_NODES,),
    "param dump": (_NODES,),
    "param load": (_NODES,),
    "xacro": ("--inorder",),
    "doctor": ("-r", "--report", "--include-warnings"),
    "record": _WRITTEN,
    "bag record": _WRITTEN,
    "replay": _READ,
    "bag play": _READ,
    "bag info": _READ,
}

ELSEWHERE = {
    "interface package": "write `holozen interface list`",
    "interface packages": "write `holozen interface list`",
    "sim start": "`holozen sim` starts one, `holozen sim play` continues a paused one",
    "sim stop": "`holozen sim pause` pauses it, `holozen stop` stops robots, Ctrl-C ends it",
    "param delete": "a parameter is there as long as its node",
    "service echo": "services cannot be watched here",
    "tf view_frames": "`holozen view` draws the frames",
    "tf monitor": "write `holozen topic hz tf`",
}
"""Verbs of ros2 behind our nouns and other likely guesses, with what to use instead."""

DURABILITIES = ("system_default", "transient_local", "volatile", "unknown", "best_available")
_POLICIES = {
    "profile": (
        "unknown",
        "default",
        "system_default",
        "sensor_data",
        "services_default",
        "parameters",
        "parameter_events",
        "action_status_default",
        "best_available",
    ),
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": DURABILITIES,
    "liveliness": ("system_default", "automatic", "manual_by_topic", "unknown", "best_available"),
}
_FORMATS = {"mcap": ("mcap",), "FORMAT": ("mcap", "sqlite3")}
_VALUES: dict[str, Callable[[str], object]] = {"S": number(0, 1e9, "s"), "N": count()}

Candidates = Callable[[list[str], str], list[str]]
_TYPE = re.compile(r"\w+/((msg|srv|action)/)?\w+")


class Verb(NamedTuple):
    """A verb, such as `topic list` or `plot`.

    `about` is its line of help, `arguments` adds its flags to a parser, `run` does the work and
    returns the exit code. `json` is the help of its flag `--json`, None if it has none; `notes`
    precede the example in its help. `bus`: if it has the flags of a connection. `candidates`:
    argument -> what lists words for it, from those before it and its beginning. The parsed flags
    also hold its name as `verb`, and the parser's method `error`.
    """

    name: str
    about: str
    example: str
    arguments: Callable[[argparse.ArgumentParser], object]
    run: Callable[[argparse.Namespace], int]
    json: str | None = JSON
    notes: str = ""
    usage: str | None = None
    bus: bool = True
    candidates: Mapping[str, Candidates] = {}

    def main(self, argv: list[str]) -> int:
        """Run it with its part of the command line; returns the exit code."""
        parser = self.parser()
        if any(action.nargs == argparse.REMAINDER for action in parser._actions):
            return self.run(parser.parse_args(argv))
        # flags may stand anywhere, also before a last value
        return self.run(parser.parse_intermixed_args(argv))

    def parser(self) -> Parser:
        """A parser for this verb alone."""
        parser = Parser(**self.options())
        self.fill(parser)
        return parser

    def options(self) -> dict[str, Any]:
        """The keyword arguments with which to create its parser."""
        prog = f"holozen {self.name}"
        example = f"example: {prog} {self.example}".rstrip()
        epilog = f"{self.notes}\n\n{example}" if self.notes else example
        return {"prog": prog, "usage": self.usage, "description": self.about, "epilog": epilog}

    def fill(self, parser: argparse.ArgumentParser) -> None:
        """Add all its flags to a parser."""
        parser.set_defaults(verb=self.name, error=parser.error)
        self.arguments(parser)
        if self.json:
            parser.add_argument("--json", action="store_true", help=self.json)
        if self.bus:
            connection.add_arguments(parser, table.role(self.name))
        if self.name.partition(" ")[0] in ("topic", "service", "action", "node", "param"):
            _add_ros2_flags(parser, (*_EVERY, *_ROS2.get(self.name, ())))
        elif self.name in _ROS2:
            _add_ros2_flags(parser, _ROS2[self.name])


class Noun:
    """A noun, such as `topic`. `modules`: verb -> the module that defines it in VERBS; `by_name`
    adds the verbs of the noun's own module, before the others.
    """

    def __init__(self, name: str, about: str, modules: dict[str, str] = {}) -> None:
        self.name, self.about, self.modules = name, about, modules

    def main(self, argv: list[str]) -> int:
        """Run the verb that `argv` starts with."""
        if argv and argv[0] in self.modules:
            return self.verb(argv[0]).main(argv[1:])
        self._check_here(argv)
        self.parser().parse_args(argv)
        return 2

    def _check_here(self, argv: list[str]) -> None:
        """Exits with code 2 for a verb of ELSEWHERE."""
        if instead := ELSEWHERE.get(" ".join([self.name, *argv[:1]])):
            self.parser().error(f"no verb {argv[0]!r}; {instead}")

    def parser(self) -> Parser:
        """The parser of all its verbs."""
        parser = Parser(prog=f"holozen {self.name}", description=self.about)
        verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)
        for name in self.modules:
            verb = self.verb(name)
            verb.fill(verbs.add_parser(name, help=verb.about, **verb.options()))
        return parser

    def verb(self, name: str) -> Verb:
        """One of its verbs."""
        module = importlib.import_module(self.modules[name])
        found: Verb = module.VERBS[f"{self.name} {name}"]
        return found


class Service(Noun):
    """A noun that starts a service, its `module`, unless a verb follows: `holozen sim` starts
    one.
    """

    def __init__(self, name: str, module: "ModuleType", modules: Mapping[str, str]) -> None:
        super().__init__(name, "", dict(modules))
        self.module = module

    def main(self, argv: list[str]) -> int:
        """Run the verb that `argv` starts with, or else the service."""
        if argv and argv[0] in self.modules:
            return super().main(argv)
        self._check_here(argv)
        if argv and argv[0][:1] != "-" and (near := suggest(argv[0], self.modules)):
            self.parser().error(f"no verb {argv[0]!r}{near}")
        return int(self.module.main(argv))

    def parser(self) -> Any:
        """The parser of the service."""
        return self.module.parser()


def no_arguments(_parser: argparse.ArgumentParser) -> None:
    """Add nothing: for a Verb without arguments of its own."""


def argument(*names: str, **options: Any) -> Callable[[argparse.ArgumentParser], object]:
    """For a Verb with a single argument: a function that adds it to a parser. The arguments are
    argparse's.
    """
    return lambda parser: parser.add_argument(*names, **options)


key_argument = argument("key", type=key)


def type_and_value(args: argparse.Namespace, kind: str, what: str) -> tuple[str, str | None]:
    """The words after a key, `[TYPE] VALUE`: the full name of the type, empty if none is given; and
    the value, None if none is given. `kind` is msg, srv or action, `what` the name of the value in
    the help. Exits with code 2 if there are more words.
    """
    words = list(args.words)
    given = words.pop(0) if words and _TYPE.fullmatch(words[0]) else ""
    if len(words) == 2 and words[0].isidentifier():
        args.error(
            f"{args.key}: {words[0]!r} has no package; write a type as geometry_msgs/msg/Twist"
        )
    if len(words) > 1:
        args.error(f"{args.key}: {words[-1]!r} is one argument too many; write KEY [TYPE] {what}")
    full = given.replace("/", f"/{kind}/") if given.count("/") == 1 else given
    return full, words[0] if words else None


def list_arguments(noun: str) -> Callable[[argparse.ArgumentParser], None]:
    """A function that adds the flags of the verb `list` of topics, services and actions."""

    def fill(parser: argparse.ArgumentParser) -> None:
        parser.add_argument("-t", "--show-types", action="store_true", help="with their types")
        add_count(parser, noun)
        if noun != "action":
            text = "also those whose name has a part that begins with _, such as those of actions"
            parser.add_argument(
                f"--include-hidden-{noun}s", dest="hidden", action="store_true", help=text
            )

    return fill


def add_count(parser: argparse.ArgumentParser, noun: str) -> None:
    """Add the flag that prints a number instead of a list."""
    parser.add_argument(
        "-c", f"--count-{noun}s", dest="count", action="store_true", help="print only their number"
    )


def by_name(*verbs: Noun | Verb) -> dict[str, Any]:
    """The table VERBS of a module: the nouns and verbs by name."""
    found: dict[str, Any] = {verb.name: verb for verb in verbs}
    for noun in (one for one in verbs if isinstance(one, Noun)):
        own = [
            name.removeprefix(f"{noun.name} ") for name in found if name.startswith(f"{noun.name} ")
        ]
        noun.modules = dict.fromkeys(own, table.VERBS[noun.name].module) | noun.modules
    return found


def _add_ros2_flags(parser: argparse.ArgumentParser, flags: Iterable[str]) -> None:
    group = parser.add_argument_group(ROS2_TITLE, "They have no effect here.")
    for flag in flags:
        option, _, value = flag.partition(" ")
        if value:
            choices = _POLICIES.get(option.removeprefix("--qos-")) or _FORMATS.get(value)
            group.add_argument(option, metavar=value, type=_VALUES.get(value, str), choices=choices)
        else:
            group.add_argument(option, action="store_true")


def on_node(module: str, function: str) -> Callable[[argparse.Namespace], int]:
    """A verb's `run` that calls a function of a module of holozen.cli with the flags and a Node,
    for verbs that handle samples as bytes. The module is imported while the session opens.
    """

    def run(args: argparse.Namespace) -> int:
        node: Node
        with _open(args, None, "node", "Node") as node:
            with deferred_interrupt():
                work = importlib.import_module(f"holozen.cli.{module}")
            return int(getattr(work, function)(args, node))

    return run


def open_bus(args: argparse.Namespace, stop: threading.Event | None = None) -> "Bus":
    """The bus of a verb, connected according to its flags. The session opens while this and the
    caller import modules. `stop` as in Opening.
    """
    bus: Bus = _open(args, stop, "bus", "Bus")
    return bus


def _open(args: argparse.Namespace, stop: threading.Event | None, module: str, name: str) -> Any:
    from holozen.transport.session import Opening  # loads zenoh

    opening = Opening(connection.from_arguments(args), stop=stop, early=True)
    try:
        kind = getattr(importlib.import_module(f"holozen.transport.{module}"), name)
    except BaseException:  # Ctrl-C
        opening.closing.set()
        raise
    return kind(args.verb.replace(" ", "_"), opening)
