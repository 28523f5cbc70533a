"""What `check` reports: a mistake at a location, and a correction where that needs no judgement."""

from typing import Literal

from msgspec import Struct

from holozen.robot.files.elements import Tag

Severity = Literal["error", "warning"]


class Location(Struct, frozen=True):
    """A file and line; line 0 means the whole file. `expanded`: it is a line of the output of
    `holozen xacro`.
    """

    file: str
    line: int = 0
    expanded: bool = False

    def __str__(self) -> str:
        if not self.line:
            return self.file
        return f"{self.file}:{self.line}" + (
            " (line of `holozen xacro`'s output)" if self.expanded else ""
        )


class Edit(Struct, frozen=True):
    """A correction that needs no judgement. The kinds "element" and "attribute" change the name
    `old` to `new`; with "inertia", `new` is the <inertia> of a link, which replaces the `old` one
    or, if `old` is empty, is added. `owner` is the name of the element that has the attribute, or
    that of the link.
    """

    kind: Literal["element", "attribute", "inertia"]
    old: str
    new: str
    owner: str = ""


class Mistake(Struct, frozen=True):
    """A mistake that a rule found: at an element, at a place, or (None) in the whole file."""

    at: Tag | Location | None
    problem: str
    fix: str
    edit: Edit | None = None


class Finding(Struct, frozen=True):
    """A mistake with the rule that found it."""

    rule: str
    severity: Severity
    place: Location
    problem: str
    why: str
    fix: str
    edit: Edit | None = None

    def __str__(self) -> str:
        return (
            f"{self.place}: {self.severity}: {self.problem} [{self.rule}]\n    {self.why}; "
            f"{self.fix}"
        )

    def fields(self) -> dict[str, object]:
        """The finding as one flat object of JSON; the line of a whole file is null."""
        return {
            "severity": self.severity,
            "rule": self.rule,
            "file": self.place.file,
            "line": self.place.line or None,
            "expanded": self.place.expanded,
            "problem": self.problem,
            "reason": self.why,
            "fix": self.fix,
        }
