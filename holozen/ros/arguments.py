"""ROS's words on a command line: `--ros-args -r from:=to -p name:=value --params-file FILE --log-level LEVEL --`."""

import difflib
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from holozen.ros import names, parameter_file
from holozen.ros.exceptions import NameValidationException, RCLInvalidROSArgsError, UnknownROSArgsError
from holozen.ros.parameter_file import Section
from holozen.ros.severity import LoggingSeverity
from holozen.ros.yaml_values import Value
from holozen.tell import printable

START, END = "--ros-args", "--"
REMAP, PARAM, FILE, LEVEL = "--remap", "--param", "--params-file", "--log-level"
SHORT = {"-r": REMAP, "-p": PARAM, "-e": "--enclave"}
WITH_VALUE = (REMAP, PARAM, FILE, LEVEL, "--enclave", "--log-config-file", "--log-file-name")
SWITCHES = ("rosout-logs", "stdout-logs", "external-lib-logs")
ALONE = tuple(f"--{verb}-{name}" for verb in ("enable", "disable") for name in SWITCHES)
QUIET = "--disable-stdout-logs"


@dataclass(frozen=True, slots=True)
class Arguments:
    """What a command line says to all nodes of a process, or `cli_args` to one."""

    remaps: tuple[names.Remap, ...] = ()
    sections: tuple[Section, ...] = ()
    levels: tuple[tuple[str, LoggingSeverity], ...] = ()
    """Loggers ("" is every one without a level of its own) and their levels."""
    quiet: bool = False
    """Whether loggers print nothing."""
    unparsed: list[str] = field(default_factory=list)
    """The words that are none of ROS's."""

    def node_name(self, given: str) -> str:
        """The name of a node that its script calls `given`."""
        return next((r.replacement for r in self.remaps if r.match == "__node" and r.applies_to(given)), given)

    def namespace(self, given: str, node: str) -> str:
        """The namespace of a node for which its script says `given`."""
        return next((r.replacement for r in self.remaps if r.match == "__ns" and r.applies_to(node)), given)

    def remap(self, fqn: str, node: str, namespace: str, *, kind: str = "topic") -> str:
        """The absolute name that stands for another one in a node, by the first rule for it."""
        for rule in self.remaps:
            if rule.renames(fqn, node, namespace, kind):
                return names.expand(rule.replacement, node, namespace, kind=kind)
        return fqn

    def parameters_for(self, fqn: str) -> dict[str, Value]:
        """The values for a node. Of two values for one name the later word has it."""
        found: dict[str, Value] = {}
        for section in self.sections:
            if section.is_for(fqn):
                found |= section.values
        return found

    def merged(self, first: "Arguments") -> "Arguments":
        """These, and before them those of one node."""
        return replace(
            self, remaps=first.remaps + self.remaps, sections=self.sections + first.sections,
            levels=self.levels + first.levels, quiet=self.quiet or first.quiet,
        )  # fmt: skip

    def apply_log_levels(self) -> None:
        """Set the loggers' levels, or make them silent."""
        from holozen.ros.logging import print_nothing, set_logger_level

        if self.quiet:
            print_nothing()
        for name, level in self.levels:
            set_logger_level(name, level)


def parse(args: Sequence[str] | None = None) -> Arguments:
    """What `args` say, by default the process's own.

    Raises RCLInvalidROSArgsError for a value that cannot be read, UnknownROSArgsError for a flag that there is not.
    """
    found = _Found()
    words = iter(sys.argv if args is None else args)
    for text in words:
        if not isinstance(text, str):
            raise TypeError(f"arguments are a list of str, and {text!r} is a {type(text).__name__}")
        if text != START:
            found.unparsed.append(text)
            continue
        for flag in words:
            if flag == END:
                break
            found.take(flag, words)
    return Arguments(
        tuple(found.remaps), tuple(found.sections), tuple(found.levels), found.quiet, unparsed=found.unparsed
    )


def remove_ros_args(args: Sequence[str] | None = None) -> list[str]:
    """The words that are none of ROS's, the program's name as well."""
    return parse(args).unparsed


class _Found:
    """What was read by now."""

    def __init__(self) -> None:
        self.remaps: list[names.Remap] = []
        self.sections: list[Section] = []
        self.levels: list[tuple[str, LoggingSeverity]] = []
        self.quiet = False
        self.unparsed: list[str] = []

    def take(self, flag: str, words: Iterator[str]) -> None:
        """Read one flag, and its value from the words after it."""
        if flag == START or flag in ALONE:
            self.quiet = self.quiet or flag == QUIET
            return
        full = SHORT.get(flag, flag)
        if full not in WITH_VALUE:
            close = difflib.get_close_matches(flag, (*WITH_VALUE, *SHORT, *ALONE), 1)
            hint = f"did you mean {close[0]}?" if close else "end ROS's words with -- before your own"
            raise UnknownROSArgsError(f"unknown ROS argument {flag!r}; {hint}")
        text = next(words, None)
        if text is None or text == END:
            raise RCLInvalidROSArgsError(f"{flag} needs a value")
        try:
            self._read(full, text)
        except (ValueError, NameValidationException) as error:
            raise RCLInvalidROSArgsError(printable(f"{flag} {text}: {error}")) from None

    def _read(self, flag: str, text: str) -> None:
        readers: dict[str, Callable[[str], Any]] = {
            REMAP: lambda text: self.remaps.append(names.remap(text)),
            PARAM: lambda text: self.sections.append(parameter_file.assigned(text)),
            FILE: lambda text: self.sections.extend(parameter_file.read(text)),
            LEVEL: lambda text: self.levels.append(_level(text)),
        }
        readers.get(flag, str)(text)  # the others are taken and mean nothing here


def _level(text: str) -> tuple[str, LoggingSeverity]:
    name, _, level = text.rpartition(":=")
    try:
        return name, LoggingSeverity[level.upper()]
    except KeyError:
        raise ValueError(
            f"no level {level!r}; use one of {', '.join(s.name.lower() for s in LoggingSeverity)}"
        ) from None
