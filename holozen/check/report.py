"""A robot file -> everything that is wrong with it."""

import re
from collections.abc import Iterable, Mapping
from itertools import islice
from pathlib import Path

from holozen.check.broken import mend
from holozen.check.finding import Finding, Mistake, Place, Rule
from holozen.check.loading import EXPANDED, read
from holozen.check.rules import FATAL, LOAD, NOTE, RULES
from holozen.check.subject import Subject, Wanted, split
from holozen.robot.errors import RobotError
from holozen.robot.tag import Tag

MOST = 100  # findings of one rule
LONGEST = 2000  # characters of a problem, and of how to mend it
WHOLE = ("tree", "no-inertia", "place", "tag")  # the loader speaks of the robot as a whole where these name a link

_LONG = re.compile(r"\S{301,}")  # paths may be long


def check(
    path: Path,
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    wanted: Wanted = Wanted(),  # noqa: B008
) -> list[Finding]:
    """The findings in a xacro, URDF or SDF file, by place. `args` and `packages` as for `xacro.expand`. Any file will
    do; one that is no robot has a finding that says so.
    """
    try:
        subject = read(path, args, packages, wanted)
    except RobotError as error:
        return [_fatal(path, str(error))]
    mistakes = [(rule, mistake) for rule in RULES for mistake in _first(rule, subject)]
    mistakes += [(rule, mistake) for rule in (LOAD, NOTE) for mistake in _unsaid(rule, subject, mistakes)]
    findings = [_finding(rule, mistake, subject) for rule, mistake in mistakes]
    return sorted(_once(findings, bool(subject.sources)), key=lambda finding: _order(finding.place, str(path)))


def _once(findings: Iterable[Finding], expanded: bool) -> Iterable[Finding]:
    """Each finding once; of those that a macro makes of one line of an expanded file the first."""
    first: dict[tuple[str, Place, str], Finding] = {}
    for finding in findings:
        traced = expanded and finding.place.line and not finding.place.expanded
        first.setdefault((finding.rule, finding.place, finding.mend if traced else finding.problem), finding)
    return first.values()


def _order(place: Place, file: str) -> tuple[bool, str, bool, int]:
    return place.file != file, place.file, place.expanded, place.line


def _first(rule: Rule, subject: Subject) -> list[Mistake]:
    """What a rule finds, at most MOST times: a file that is wrong all over has to end soon too."""
    found = list(islice(rule.find(subject), MOST + 1))
    more = [Mistake(None, f"there are more than {MOST} findings of this kind", "mend those first")]
    return found if len(found) <= MOST else found[:MOST] + more


def _fatal(path: Path, message: str) -> Finding:
    place, told = split(message, path)
    if place.file == f"{path}{EXPANDED}":
        place = Place(str(path), place.line, True)
    return Finding(FATAL.name, FATAL.severity, place, told, FATAL.why, mend(place, told))


def _unsaid(rule: Rule, subject: Subject, mistakes: Iterable[tuple[Rule, Mistake]]) -> list[Mistake]:
    """What the loader said of parts in which no rule found anything as bad."""
    told: list[Tag] = []
    for other, mistake in mistakes:
        if isinstance(mistake.at, Tag) and (rule is NOTE or other.severity == "error"):
            told += [subject.part(mistake.at), *([subject.root] if other.name in WHOLE else [])]
    return [
        mistake
        for mistake in rule.find(subject)
        if not isinstance(mistake.at, Tag) or subject.part(mistake.at) not in told
    ]


def _finding(rule: Rule, mistake: Mistake, subject: Subject) -> Finding:
    place: Place = subject.place(mistake.at)
    return Finding(rule.name, rule.severity, place, _short(mistake.problem), rule.why, _short(mistake.mend))


def _short(text: str) -> str:
    """The text with its long words cut, and itself: both may hold what a file says, of any length."""
    text = _LONG.sub(lambda word: f"{word[0][:77]}...", text)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
