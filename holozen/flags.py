"""Command-line arguments: the parser, which reports a mistake in one line, and checked values."""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NoReturn

from holozen.console import report
from holozen.suggest import cut, suggest, suggest_file

if TYPE_CHECKING:
    from pathlib import Path

DRIVES = ("planar_move", "omni")
DRIVE = (
    "planar_move for a robot whose file has no drive; omni: on its own wheels, instead of "
    "planar_move"
)
ENGINES = ("pybullet", "mujoco")
AUTO = "auto"  # pybullet where it is installed, else mujoco
ENGINE = (
    f"the physics engine; {AUTO}: {ENGINES[0]} where it is installed, else {ENGINES[1]} "
    f"(default: {AUTO})"
)
NAMED = "--robot FILE=NAME gives a robot's name"
NEGATIVE = re.compile(r"-\.?\d")  # begins a negative number; argparse itself takes -1e-3 for a flag
WIDTH = 100  # characters of a line of help where there is no terminal


class Formatter(argparse.HelpFormatter):
    """Help in paragraphs, as wide as the terminal. argparse itself would load shutil for that,
    which takes 3 ms.
    """

    def __init__(self, prog: str) -> None:
        try:
            width = os.get_terminal_size().columns
        except OSError:
            width = WIDTH
        super().__init__(prog, width=max(40, min(width, 120)), max_help_position=30)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n\n".join(
            super(Formatter, self)._fill_text(part, width, indent) for part in text.split("\n\n")
        )


class WriteJson(argparse.Action):
    """`--json` of a service."""

    def __call__(self, *_args: Any) -> None:
        """From now on, what it reports is JSON."""
        from holozen.console import write_json

        write_json()


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add the flag `--json` of a service."""
    text = "print what it reports as JSON, one object per line"
    parser.add_argument("--json", action=WriteJson, nargs=0, help=text)


CONNECTION = "zenoh"  # the title of the group of flags that say how to connect


class Parser(argparse.ArgumentParser):
    """A parser that reports a mistake in one line and suggests the closest valid word. Flags are
    written in full.
    """

    def __init__(self, **options: Any) -> None:
        self._words: list[str] = []  # the arguments
        super().__init__(**{"formatter_class": Formatter, "allow_abbrev": False, **options})

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse; all its other parse methods call this one."""
        self._words = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(args, namespace)

    def format_help(self) -> str:
        """As argparse, except that one line says where the flags of the connection are."""
        connection = self._connection()
        formatter = self._get_formatter()
        self._add_usage(formatter)
        formatter.add_text(self.description)
        for group in self._action_groups:
            if group not in connection:
                formatter.start_section(group.title)
                formatter.add_text(group.description)
                formatter.add_arguments(group._group_actions)
                formatter.end_section()
        if connection:
            formatter.add_text("connection flags: `holozen help network`")
        formatter.add_text(self.epilog)
        return formatter.format_help()

    def format_whole_help(self) -> str:
        """As argparse, with the flags of the connection."""
        return super().format_help()

    def format_usage(self) -> str:
        """As argparse, without the flags of the connection."""
        formatter = self._get_formatter()
        self._add_usage(formatter)
        return formatter.format_help()

    def _connection(self) -> list[Any]:
        """The groups with the flags of the connection."""
        return [group for group in self._action_groups if group.title == CONNECTION]

    def _add_usage(self, formatter: argparse.HelpFormatter) -> None:
        apart = {id(action) for group in self._connection() for action in group._group_actions}
        shown = [action for action in self._actions if id(action) not in apart]
        formatter.add_usage(self.usage, shown, self._mutually_exclusive_groups)

    def _parse_optional(self, arg_string: str) -> Any:
        """As argparse, except that a negative number is a value unless that very number is a
        flag.
        """
        if NEGATIVE.match(arg_string) and arg_string not in self._option_string_actions:
            return None
        return super()._parse_optional(arg_string)

    def _get_option_tuples(self, option_string: str) -> Any:
        """As argparse, except that `-m` is no abbreviation of `-model`; `-r10` is still `-r 10`."""
        return [found for found in super()._get_option_tuples(option_string) if len(found[1]) == 2]

    def error(self, message: str) -> NoReturn:
        """Report the mistake, and exit with code 2."""
        verbs = [
            action.choices
            for action in self._actions
            if isinstance(action, argparse._SubParsersAction)
        ]
        for choices in verbs:
            if self._words and self._words[0] in choices:
                choices[self._words[0]].error(message)  # the flags belong to this verb
        before, _, left = message.partition("unrecognized arguments: ")
        if left and not before:
            message = f"unexpected argument {left!r}"
            kind = "world" if left.endswith(".world") else "robot"
            if "--world" in self._option_string_actions and not left.startswith("-"):
                message += f"; a {kind}'s file goes after --{kind}"
        if not verbs and (flag := self._unknown_flag(message, [] if before else left.split())):
            message = f"no flag {flag!r}{suggest(flag, self._option_string_actions)}"
        report(f"{self.prog}: {message}; see `{self.prog} --help`")
        raise SystemExit(2)

    def _unknown_flag(self, message: str, left: list[str]) -> str:
        """The unknown flag: the first word in `left`, else the word before the value that `message`
        complains about, or in place of a required argument.
        """
        lacks_argument = "are required: " in message
        for word, value in [(word, word) for word in left] or zip(
            self._words, [*self._words[1:], ""], strict=False
        ):
            flag = word.partition("=")[0]
            unknown = (
                flag[:1] == "-"
                and flag not in self._option_string_actions
                and not NEGATIVE.match(flag)
            )
            if unknown and (left or lacks_argument or repr(value) in message):
                return flag
        return ""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            words = [str(choice) for choice in action.choices]
            be = "is" if len(words) == 1 else "are"
            raise argparse.ArgumentError(
                action, f"{value!r}{suggest(value, words)}; there {be} {', '.join(words)}"
            )


class Instead(argparse.Action):
    """A flag of ros2 without a meaning here, which is refused in one line with `advice` on what to
    use.
    """

    def __init__(self, option_strings: list[str], dest: str, advice: str) -> None:
        super().__init__(
            option_strings, dest, nargs="?", default=argparse.SUPPRESS, help=argparse.SUPPRESS
        )
        self._advice = advice

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        _args: object,
        _value: object,
        flag: str | None = None,
    ) -> None:
        """Refuse it."""
        parser.error(f"no flag {flag!r}; {self._advice}")


def refused(text: str) -> Exception:
    """The error that a parser of values raises."""
    return argparse.ArgumentTypeError(text)


def packages_in(words: Iterable[str]) -> dict[str, Path]:
    """The packages that words of a command line give: name -> folder."""
    return dict(package(value) for flag, value in pairwise(words) if flag == "--package")


def number(low: float, high: float, unit: str = "") -> Callable[[str], float]:
    """A parser for a finite number from `low` to `high`."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise refused(f"{text!r}: use a number from {low:g} to {high:g} {unit}".rstrip())
        return value

    return parse


def count(low: int = 0, high: float = math.inf) -> Callable[[str], int]:
    """A parser for a whole number from `low` to `high`."""

    def parse(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise refused(
                f"{text!r}: use a whole number from {low} "
                f"{'up' if high == math.inf else f'to {high}'}"
            )
        return int(text)

    return parse


port = count(0, 65535)
"""Parses the number of a TCP port; 0 stands for any that is free."""


def key(text: str) -> str:
    """Parses a key; removes ROS's leading slash, which Zenoh keys do not have."""
    from holozen.transport.errors import LONGEST_KEY

    if len(text) > LONGEST_KEY:
        raise refused(f"{cut(text)}: {len(text)} characters; a key has at most {LONGEST_KEY}")
    return text.removeprefix("/")


def robot(text: str) -> str:
    """Parses a robot's name; an empty one is the robot at the root of the keys."""
    from holozen.wire import robot_name  # most verbs do not need it

    try:
        return robot_name(text) if text else ""
    except ValueError as error:
        raise refused(str(error)) from None


def package(text: str) -> tuple[str, Path]:
    """Parses NAME=DIR, a package and its folder."""
    name, equals, folder = text.partition("=")
    if not (name and equals and folder):
        raise refused(f"{text!r}: write NAME=DIR, such as holo=~/ws/src/holo")
    found = path(folder).expanduser()
    if not found.is_dir():
        raise refused(f"{text!r}: there is no folder {str(found)!r}")
    return name, found


def add_packages(
    parser: argparse.ArgumentParser, use: str = "whose msg, srv and action files define its types"
) -> None:
    """Add the flag `--package`; `use`: what its folder is for."""
    parser.add_argument(
        "--package",
        type=package,
        action="append",
        default=[],
        metavar="NAME=DIR",
        help=f"the folder of package NAME, {use}",
    )


def add_robot_sources(parser: argparse.ArgumentParser) -> None:
    """Add the flags `--package` and `--allow-env`, for a verb that reads robot files."""
    add_packages(parser, "for $(find NAME) and package://NAME")
    parser.add_argument(
        "--allow-env",
        type=variable,
        action="append",
        default=[],
        metavar="NAME",
        help="let a file read this environment variable, as $(env NAME)",
    )


def pair(text: str) -> tuple[str, str]:
    """Parses name:=value."""
    name, assign, value = (part.strip() for part in text.partition(":="))
    if not assign or not name:
        raise refused(f"{text!r}: write {assigned([text]) or 'name:=value after the one FILE'}")
    return name, value


def assigned(words: Iterable[str]) -> str:
    """The first of the words that is name=value, as it is meant: name:=value. Empty without one."""
    parts = [word.partition("=") for word in words]
    return next(
        (f"{name}:={value}" for name, equals, value in parts if equals and name.isidentifier()), ""
    )


def path(text: str) -> Path:
    """Parses a path. pathlib is loaded only when there is one."""
    from pathlib import Path

    return Path(text)


def file(text: str) -> Path:
    """Parses the path of a file that exists."""
    if not (found := path(text)).is_file():
        raise refused(f"{text!r}: there is no such file{suggest_file(found)}")
    return found


def variable(text: str) -> str:
    """Parses the name of an environment variable."""
    if not text or "=" in text:
        raise refused(f"{text!r}: write the name of an environment variable, such as HOME")
    return text


def robot_file(text: str) -> tuple[Path, str]:
    """Parses FILE or FILE=NAME, a robot's file and its name."""
    before, equals, name = text.rpartition("=")
    if not equals or path(text).exists():
        return path(text), ""
    return path(before), robot(name)
