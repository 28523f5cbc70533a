"""What an expansion came to, and what it was made from: files, wildcards, environment variables and packages."""

import glob
import hashlib
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.robot.packages import find_package
from holozen.robot.tag import MOST_TEXT

Answer = str | list[str] | None
Inputs = dict[str, dict[str, Answer]]
"""Kind ("file", "glob", "env", "find") -> what was asked for -> what the answer was then."""

SAVED = ("file", "glob")  # the kinds that change when somebody saves


@dataclass(frozen=True, slots=True)
class Outcome:
    """What an expansion came to: a text, or else an error of one line.

    `inputs` are those met until then. `pure` says that the text depends on nothing else.
    """

    text: str = ""
    error: str = ""
    inputs: Inputs = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    pure: bool = False


def answer(kind: str, asked: str, start: Path, packages: Mapping[str, Path]) -> Answer:
    """What `asked` gives now; None for a file, a variable or a package that is not there."""
    if kind == "file":
        return digest(asked)
    if kind == "glob":
        return sorted(glob.glob(asked))
    if kind == "env":
        return os.environ.get(asked)
    return _folder(asked, start, packages)


def digest(path: str) -> str | None:
    """A file is known by its content: two saves within a tick of the clock may leave size and times the same."""
    try:
        state = os.stat(path)
        if not stat.S_ISREG(state.st_mode) or state.st_size > MOST_TEXT:
            return f"{state.st_mode} {state.st_size} {state.st_mtime_ns}"  # nothing that would be expanded
        with open(path, "rb") as file:
            return hashlib.sha256(file.read()).hexdigest()
    except (OSError, ValueError):
        return None


def now(inputs: Inputs, start: Path, packages: Mapping[str, Path]) -> Inputs:
    """The same questions, with the answers of now."""
    return {
        kind: {asked: answer(kind, asked, start, packages) for asked in answers} for kind, answers in inputs.items()
    }


def unchanged(
    inputs: Inputs, start: Path, packages: Mapping[str, Path], kinds: tuple[str, ...] = (*SAVED, "env", "find")
) -> bool:
    """Whether each input of `kinds` gives the answer that it gave then."""
    return all(
        answer(kind, asked, start, packages) == then for kind in kinds for asked, then in inputs.get(kind, {}).items()
    )


def _folder(name: str, start: Path, packages: Mapping[str, Path]) -> str | None:
    try:
        return str(find_package(name, start, packages))
    except RobotError:
        return None
