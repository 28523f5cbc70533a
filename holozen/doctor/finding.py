"""What a check found."""

from typing import NamedTuple

OK, WARNING, ERROR = "ok", "warning", "error"


class Finding(NamedTuple):
    """One line: what was looked at, how it is, and how to mend it (empty if there is nothing to mend)."""

    check: str
    level: str
    text: str
    mend: str = ""

    def __str__(self) -> str:
        return f"{self.level:<8} {self.check}: {self.text}" + (f" -> {self.mend}" if self.mend else "")


def first_error(findings: list[Finding]) -> int:
    """The exit code: 1 if something is wrong; warnings are none."""
    return int(any(finding.level == ERROR for finding in findings))
