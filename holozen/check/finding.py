"""A mistake in a robot file: where, what, why it matters, and how to mend it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from holozen.robot.tag import Tag

if TYPE_CHECKING:
    from holozen.check.subject import Subject

Severity = Literal["error", "warning"]


@dataclass(frozen=True, slots=True)
class Place:
    """A file and line; line 0 means the file as a whole. `expanded`: a line of the text that `holozen xacro` prints."""

    file: str
    line: int = 0
    expanded: bool = False

    def __str__(self) -> str:
        if not self.line:
            return self.file
        return f"{self.file}:{self.line}" + (" (line of `holozen xacro`'s output)" if self.expanded else "")


@dataclass(frozen=True, slots=True)
class Mistake:
    """What a rule found: at an element, at a place, or (None) in the file as a whole."""

    at: Tag | Place | None
    problem: str
    mend: str


@dataclass(frozen=True, slots=True)
class Rule:
    """`finds` and `why` are for people; `find` looks through a robot file. An error keeps a robot from being used as
    it is meant; with a warning it can be used.
    """

    name: str
    severity: Severity
    finds: str
    why: str
    find: "Callable[[Subject], Iterator[Mistake]]"


@dataclass(frozen=True, slots=True)
class Finding:
    """A mistake with the rule that found it."""

    rule: str
    severity: Severity
    place: Place
    problem: str
    why: str
    mend: str

    def __str__(self) -> str:
        return f"{self.place}: {self.severity}: {self.problem} [{self.rule}]\n    {self.why}; {self.mend}"

    def fields(self) -> dict[str, object]:
        """For JSON: flat, with the line as a number or null."""
        return {
            "severity": self.severity,
            "rule": self.rule,
            "file": self.place.file,
            "line": self.place.line or None,
            "expanded": self.place.expanded,
            "problem": self.problem,
            "reason": self.why,
            "mend": self.mend,
        }
