"""The robot descriptions that this process makes of files, and the files that they come from.

With its file a robot is spawned as by `holozen spawn FILE`: messages name the lines of the file,
and meshes are searched for beside it.
"""

from collections.abc import Mapping
from pathlib import Path

from holozen.console import report
from holozen.robot.files.elements import read_text
from holozen.robot.files.xacro import XacroFile, expanded
from holozen.ros import packages

origins: dict[str, list[str]] = {}
"""The robot in a text, without blanks -> the words with which `holozen spawn` makes it."""

_reported: set[str] = set()  # warnings: a launch file may name one robot for several nodes


def expand(path: Path, values: Mapping[str, str]) -> str:
    """The text that xacro generates from a file. Its warnings are printed. Raises RobotError with
    file and line.
    """
    known = packages.known_to(path)
    outcome = expanded(XacroFile(path, values, known, packages.allow_env))
    for warning in dict.fromkeys(outcome.warnings):
        if warning not in _reported:
            report(f"warning: {warning}")
    _reported.update(outcome.warnings)
    words = [str(path), *(f"{name}:={value}" for name, value in values.items())]
    for name in known.keys() & outcome.inputs.get("find", {}):
        words += ["--package", f"{name}={known[name]}"]
    remember(outcome.text, words)
    return outcome.text


def read(path: Path) -> str:
    """The text of a file. Raises RobotError."""
    text = read_text(path)
    remember(text, [str(path)])
    return text


def remember(text: str, words: list[str]) -> None:
    """Remember with which words `holozen spawn` makes the robot in a text."""
    origins[_key(text)] = words


def origin(text: str) -> list[str] | None:
    """The words for `holozen spawn` that stand for a text; None if it is of no file, or was
    changed.
    """
    return origins.get(_key(text))


def _key(text: str) -> str:
    """The robot in a text, however it is indented."""
    return "".join(text[max(text.find("<robot"), 0) :].split())
