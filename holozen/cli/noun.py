"""What `holozen topic`, `service` and `node` share: a noun with verbs, each loaded when it is named."""

from __future__ import annotations

import importlib

from holozen import connection
from holozen.bus import Bus
from holozen.cli import quick, ros2_flags
from holozen.flags import package

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable
    from typing import Any

    from holozen.parser import Parser

PATIENCE = 3.0  # s; a client waits this long for its router


class Verb:
    """One verb: a line of help, an example, what adds its flags, and what does the work and gives the exit code."""

    def __init__(
        self,
        about: str,
        example: str,
        arguments: Callable[[argparse.ArgumentParser], None],
        run: Callable[[argparse.Namespace], int],
    ) -> None:
        self.about, self.example, self.arguments, self.run = about, example, arguments, run


class Noun:
    """A noun of the command line. `modules` names for each verb the module of holozen.cli whose VERBS has it."""

    def __init__(self, name: str, about: str, modules: dict[str, str]) -> None:
        self.name, self.about, self.modules = name, about, modules

    def main(self, argv: list[str]) -> int:
        """Run the verb that `argv` starts with. Its parser alone is ready sooner than that of all."""
        if argv and argv[0] in self.modules:
            args = quick.parsed(lambda parser: self._fill(parser, argv[0]), argv[1:])
            return self.verb(argv[0]).run(args or self.one(argv[0]).parse_args(argv[1:]))
        self.parser().parse_args(argv)
        return 2

    def one(self, verb: str) -> Parser:
        """The parser of one verb alone."""
        from holozen.parser import Parser

        parser = Parser(**self._words(verb))
        self._fill(parser, verb)
        return parser

    def parser(self) -> Parser:
        """The parser of all verbs."""
        from holozen.parser import Parser

        parser = Parser(prog=f"holozen {self.name}", description=self.about)
        verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)
        for name in self.modules:
            self._fill(verbs.add_parser(name, help=self.verb(name).about, **self._words(name)), name)
        return parser

    def verb(self, name: str) -> Verb:
        """The verb of a name; loads its module."""
        found: Verb = importlib.import_module(f"holozen.cli.{self.modules[name]}").VERBS[name]
        return found

    def _words(self, name: str) -> dict[str, Any]:
        verb = self.verb(name)
        prog = f"holozen {self.name} {name}"
        return {"prog": prog, "description": verb.about, "epilog": f"example: {verb.example}"}

    def _fill(self, parser: Any, name: str) -> None:
        parser.set_defaults(node=f"{self.name}_{name}")
        self.verb(name).arguments(parser)
        parser.add_argument("--json", action="store_true", help="one JSON object a line")
        connection.add_arguments(parser)
        ros2_flags.add(parser, self.name, name)


def open_bus(args: argparse.Namespace, early: bool = False) -> Bus:
    """The bus of a verb, where its flags say. `early` is that of Bus."""
    return Bus(args.node, connection.from_arguments(args), patience=PATIENCE, early=early)


def add_packages(parser: argparse.ArgumentParser) -> None:
    """Add the flag `--package`, for verbs that look types up."""
    parser.add_argument("--package", type=package, action="append", default=[], metavar="NAME=DIR",
        help="the folder of package NAME, whose msg and srv files tell its types")  # fmt: skip


def nobody(what: str, where: str, mend: str) -> str:
    """What to say where nothing was found."""
    return f"no {what}: nobody is there at {where}; {mend}"
