"""ROS arguments of a command line: `--ros-args -r from:=to -p name:=value --params-file FILE
--log-level LEVEL --`.
"""

import sys
from collections.abc import Collection, Iterator, Sequence

from msgspec import Struct
from msgspec.structs import replace

from holozen import parameter_yaml
from holozen.console import printable
from holozen.parameter_yaml import Section, Value
from holozen.ros.rclpy import names
from holozen.ros.rclpy.exceptions import (
    NameValidationException,
    RCLInvalidROSArgsError,
    UnknownROSArgsError,
)
from holozen.ros.rclpy.logging import LoggingSeverity, get_logging_severity_from_string
from holozen.suggest import article, listed, suggest

START, END = "--ros-args", "--"
REMAP, PARAM, FILE, LEVEL = "--remap", "--param", "--params-file", "--log-level"
SHORT = {"-r": REMAP, "-p": PARAM, "-e": "--enclave"}
WITH_VALUE = (REMAP, PARAM, FILE, LEVEL, "--enclave", "--log-config-file", "--log-file-name")
SWITCHES = ("rosout-logs", "stdout-logs", "external-lib-logs")
WITHOUT_VALUE = tuple(f"--{verb}-{name}" for verb in ("enable", "disable") for name in SWITCHES)
QUIET = "--disable-stdout-logs"


class Arguments(Struct):
    """The ROS arguments of a command line, for all nodes of a process, or of `cli_args`, for one
    node.
    """

    remaps: list[names.Remap] = []
    sections: list[Section] = []
    levels: list[tuple[str, LoggingSeverity]] = []
    """Loggers and their levels; "" is the default of all others."""
    quiet: bool = False
    """Whether loggers print nothing."""
    unparsed: list[str] = []
    """The words that are not ROS arguments."""

    def node_name(self, given: str) -> str:
        """The name of a node that is called `given` in its script."""
        return next(
            (r.replacement for r in self.remaps if r.match == "__node" and r.applies_to(given)),
            given,
        )

    def namespace(self, given: str, node: str) -> str:
        """The namespace of a node that is created in `given`."""
        return next(
            (r.replacement for r in self.remaps if r.match == "__ns" and r.applies_to(node)), given
        )

    def remap(self, full_name: str, node: str, namespace: str, *, kind: str = "topic") -> str:
        """An absolute name after the first remap rule that matches it in a node."""
        for rule in self.remaps:
            if rule.renames(full_name, node, namespace, kind):
                return names.expand(rule.replacement, node, namespace, kind=kind)
        return full_name

    def parameters_for(self, full_name: str) -> dict[str, Value]:
        """The parameter values for a node. Of two values for one name the later wins."""
        found: dict[str, Value] = {}
        for section in self.sections:
            if section.is_for(full_name):
                found |= section.values
        return found

    def unused(self, names: Collection[str], declared: Collection[str]) -> Iterator[str]:
        """A line for each parameter that none of the nodes `names` declares, and each file that has
        none for them. Of those in a file's section for one of them, only what looks like a declared
        one: others may be of ROS itself.
        """
        mine = [section for section in self.sections if any(map(section.is_for, names))]
        given = {name for section in mine if not section.file for name in section.values}
        own = {name for section in mine if section.place in names for name in section.values}
        for name in sorted(
            (given | {name for name in own if suggest(name, declared)}) - {*declared}
        ):
            yield f"parameter {name!r} is given, but not declared{suggest(name, declared)}"
        for file in sorted(
            {section.file for section in self.sections} - {section.file for section in mine} - {""}
        ):
            places = listed(section.place for section in self.sections if section.file == file)
            yield f"{file} has no parameters for {listed(names)}; it has some for {places}"

    def merged(self, first: "Arguments") -> "Arguments":
        """These, with those of one node taking precedence."""
        return replace(
            self,
            remaps=first.remaps + self.remaps,
            sections=self.sections + first.sections,
            levels=self.levels + first.levels,
            quiet=self.quiet or first.quiet,
        )


def parse(args: Sequence[str] | None = None) -> Arguments:
    """The ROS arguments in `args`, by default the process's own.

    Raises RCLInvalidROSArgsError for a value that cannot be parsed, UnknownROSArgsError for an
    unknown flag.
    """
    if isinstance(args, str):
        raise TypeError(f"args={args!r} is one text; write a list of words: args={args.split()}")
    found = Arguments()
    words = iter(sys.argv if args is None else args)
    for text in words:
        if not isinstance(text, str):
            raise TypeError(
                f"arguments must be a list of str; {text!r} is {article(type(text).__name__)}"
            )
        if text != START:
            found.unparsed.append(text)
            continue
        for flag in words:
            if flag == END:
                break
            _take(found, flag, words)
    return found


def remove_ros_args(args: Sequence[str] | None = None) -> list[str]:
    """The words that are not ROS arguments, with the program's name."""
    return parse(args).unparsed


def _take(found: Arguments, flag: str, words: Iterator[str]) -> None:
    """Parse one flag, with its value from the words after it."""
    if flag == START or flag in WITHOUT_VALUE:
        found.quiet = found.quiet or flag == QUIET
        return
    full = SHORT.get(flag, flag)
    if full not in WITH_VALUE:
        known = (*WITH_VALUE, *SHORT, *WITHOUT_VALUE)
        hint = suggest(flag, known) or "; end the ROS arguments with -- before your own"
        raise UnknownROSArgsError(f"unknown ROS argument {flag!r}{hint}")
    text = next(words, None)
    if text is None or text == END:
        raise RCLInvalidROSArgsError(f"{flag} needs a value")
    try:
        if full == REMAP:
            found.remaps.append(names.remap(text))
        elif full == PARAM:
            found.sections.append(parameter_yaml.assigned(text))
        elif full == FILE:
            found.sections.extend(parameter_yaml.read(text))
        elif full == LEVEL:
            name, _, level = text.rpartition(":=")
            found.levels.append((name, get_logging_severity_from_string(level)))
        # The other flags are accepted and have no effect.
    except (ValueError, RuntimeError, NameValidationException) as error:
        given = flag if full == FILE else f"{flag} {text}"  # that error names the file
        raise RCLInvalidROSArgsError(printable(f"{given}: {error}")) from None
