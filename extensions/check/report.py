"""A robot file -> all its mistakes: the table of rules, and their findings in order."""

import re
from collections.abc import Collection, Iterable, Mapping
from functools import partial
from itertools import islice
from pathlib import Path
from textwrap import indent
from urllib.parse import quote

from holozen.check import (
    rules_inertia,
    rules_joints,
    rules_meshes,
    rules_names,
    rules_plugins,
    rules_requirements,
    rules_wheels,
    rules_xml,
)
from holozen.check.examples import EXAMPLES
from holozen.check.mistake import Finding, Location, Mistake
from holozen.check.rule import Rule
from holozen.check.subject import (
    EXPANDED,
    Requirements,
    Subject,
    is_library,
    loader_mistakes,
    read,
    split,
)
from holozen.robot.errors import RobotError
from holozen.robot.files import reader
from holozen.robot.files.elements import Tag
from holozen.robot.files.gazebo_plugins import DRIVES, FORCE, OMNI, kind_of
from holozen.robot.files.sources import handlers
from holozen.robot.files.uris import readable
from holozen.robot.files.xacro import XacroFile
from holozen.robot.rigid import advised_drive
from holozen.suggest import listed, shorten

# The rules.


# `check` itself reports the first.
FATAL = Rule(
    "file",
    "error",
    "a file that is not a robot: broken XML, xacro that cannot be expanded",
    "nothing in it is usable",
    lambda _: (),
)
LOAD = Rule(
    "load",
    "error",
    "other mistakes that prevent loading",
    "the robot cannot be spawned",
    partial(loader_mistakes, severity="error"),
)
NOTE = Rule(
    "load-note",
    "warning",
    "other values that are replaced or ignored on loading",
    "the robot differs from the file",
    partial(loader_mistakes, severity="warning"),
)

MODULES = (
    rules_xml,
    rules_names,
    rules_joints,
    rules_inertia,
    rules_wheels,
    rules_plugins,
    rules_meshes,
    rules_requirements,
)
RULES = [value for module in MODULES for value in vars(module).values() if isinstance(value, Rule)]
"""The rules that inspect a file, in the order in which their findings are best fixed."""
EVERY = (FATAL, LOAD, NOTE, *RULES)


def table() -> str:
    """The rules as a table in Markdown."""
    rows = [
        f"| [`{rule.name}`](rules.md#{rule.name}) | {rule.severity} | {rule.finds} | {rule.why} |"
        for rule in EVERY
    ]
    return "\n".join(["| rule | severity | finds | since |", "|---|---|---|---|", *rows]) + "\n"


def page() -> str:
    """The rules as sections of Markdown, each with an example."""
    return "\n".join(
        f"## {rule.name}\n\n{rule.severity.capitalize()}: {rule.finds}.\n\n"
        f"```xml\n<!-- wrong -->\n{wrong.rstrip()}\n<!-- right -->\n{right.rstrip()}\n```\n"
        for rule in EVERY
        for wrong, right in [EXAMPLES[rule.name]]
    )


def explain(rule: Rule) -> str:
    """A rule as text: what it finds, why, and an example."""
    wrong, right = (indent(part.rstrip(), "    ") for part in EXAMPLES[rule.name])
    return (
        f"{rule.name} ({rule.severity}): {rule.finds}\n  since {rule.why}\n  wrong:\n{wrong}\n "
        f" right:\n{right}"
    )


def sarif(findings: Iterable[Finding], version: str) -> dict[str, object]:
    """The findings as a log in SARIF 2.1.0 (OASIS), for editors and CI."""
    rules = [
        {
            "id": rule.name,
            "shortDescription": {"text": rule.finds},
            "fullDescription": {"text": f"{rule.finds}, since {rule.why}"},
            "help": {"text": explain(rule)},
            "defaultConfiguration": {"level": rule.severity},
        }
        for rule in EVERY
    ]
    numbers = {rule.name: number for number, rule in enumerate(EVERY)}
    results = [
        {
            "ruleId": finding.rule,
            "ruleIndex": numbers[finding.rule],
            "level": finding.severity,
            "message": {
                "text": f"{finding.problem}; {finding.why}; {finding.fix}{_expanded(finding.place)}"
            },
            "locations": [{"physicalLocation": _location(finding.place)}],
        }
        for finding in findings
    ]
    tool = {"driver": {"name": "holozen check", "version": version, "rules": rules}}
    return {"version": "2.1.0", "$schema": SARIF, "runs": [{"tool": tool, "results": results}]}


def _location(place: Location) -> dict[str, object]:
    """SARIF's physicalLocation; an absolute path is a file URI, since relative references begin
    with no slash.
    """
    path = Path(place.file)
    location: dict[str, object] = {
        "artifactLocation": {"uri": path.as_uri() if path.is_absolute() else quote(path.as_posix())}
    }
    if place.line and not place.expanded:
        location["region"] = {"startLine": place.line}
    return location


def _expanded(place: Location) -> str:
    return f" ({place})" if place.expanded else ""


SARIF = "https://json.schemastore.org/sarif-2.1.0.json"


# The findings.


MAX_FINDINGS = 100  # findings of one rule
MAX_TEXT = 2000  # characters of a problem, and of its fix
# rules that name a link where the loader reports on the whole robot
WHOLE = ("tree", "no-inertia", "place", "tag")

_LONG = re.compile(r"\S{301,}")  # paths may be long


def check(
    path: Path,
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    requirements: Requirements = Requirements(),  # noqa: B008
    allow_env: Collection[str] = (),
) -> tuple[list[Finding], str]:
    """The findings in a xacro, URDF or SDF file, in the order of their places, and a one-line
    summary of the robot. `args`, `packages` and `allow_env` as for `xacro.expand_xacro`. For a file
    that cannot be read there is one finding and an empty summary.
    """
    try:
        return reader.run(
            tuple[list[Finding], str],
            path,
            _check,
            path,
            [*args],
            packages,
            requirements,
            readable=partial(_readable, path, packages, requirements),
            handlers=handlers(XacroFile(path, args, packages, allow_env)),
        )
    except RobotError as error:
        return [_fatal(path, str(error))], ""


def _readable(path: Path, packages: Mapping[str, Path], requirements: Requirements) -> list[str]:
    required = [requirements.require] if requirements.require else []
    return [*readable(path, packages), *map(str, required)]


def _check(
    path: Path, given: Collection[str], packages: Mapping[str, Path], requirements: Requirements
) -> tuple[list[Finding], str]:
    subject = read(path, given, packages, requirements)
    mistakes = [(rule, mistake) for rule in RULES for mistake in _first(rule, subject)]
    mistakes += [
        (rule, mistake) for rule in (LOAD, NOTE) for mistake in _unreported(rule, subject, mistakes)
    ]
    findings = [_finding(rule, mistake, subject) for rule, mistake in mistakes]
    found = sorted(
        _once(findings, bool(subject.sources)), key=lambda finding: _order(finding.place, str(path))
    )
    return found, _summary(subject)


MOVING = (*DRIVES, OMNI, FORCE)


def _summary(subject: Subject) -> str:
    """`9 links, 3 wheels, planar_move on cmd_vel`."""
    if is_library(subject):
        return "no links: a file for others to include, which cannot be spawned by itself"
    parts = [_counted(len(subject.links), "link")]
    if subject.wheels:
        parts.append(_counted(len(subject.wheels), "wheel"))
    model = subject.model
    if model and model.drive:
        kinds = [kind for plugin in subject.plugins if (kind := kind_of(plugin)) in MOVING]
        plugin = next((kind for kind in kinds if kind != FORCE), FORCE)
        forces = [force.topic for force in model.forces]
        topics = forces if plugin == FORCE else [model.drive.command_topic]
        parts.append(f"{plugin.removeprefix('gazebo_ros_')} on {listed(topics)}")
        if forces and plugin != FORCE:
            parts.append(f"forces on {listed(forces)}")
    elif subject.links and not (model and model.static):
        omni = (
            "--drive omni drives its wheels, " if model and advised_drive(model) == "omni" else ""
        )
        parts.append(f"no drive: holozen spawn {omni}--drive planar_move moves it as a whole")
    return ", ".join(parts)


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}" if count == 1 else f"{count or 'no'} {thing}s"


def _once(findings: Iterable[Finding], expanded: bool) -> Iterable[Finding]:
    """The findings without duplicates; of a line that a macro repeats, only the first of each rule
    and fix. All notes of the loader have the same fix.
    """
    first: dict[tuple[str, Location, str], Finding] = {}
    for finding in findings:
        is_repeated = (
            expanded
            and finding.place.line
            and not finding.place.expanded
            and finding.rule != NOTE.name
        )
        first.setdefault(
            (finding.rule, finding.place, finding.fix if is_repeated else finding.problem), finding
        )
    return first.values()


def _order(place: Location, file: str) -> tuple[bool, str, bool, int]:
    return place.file != file, place.file, place.expanded, place.line


def _first(rule: Rule, subject: Subject) -> list[Mistake]:
    """The first findings of a rule, at most MAX_FINDINGS: a file full of mistakes has to finish
    soon too.
    """
    found = list(islice(rule.find(subject), MAX_FINDINGS + 1))
    more = [
        Mistake(
            None, f"there are more than {MAX_FINDINGS} findings of this kind", "fix these first"
        )
    ]
    return found if len(found) <= MAX_FINDINGS else found[:MAX_FINDINGS] + more


def _fatal(path: Path, message: str) -> Finding:
    place, problem = split(message, path)
    if place.file == f"{path}{EXPANDED}":
        place = Location(str(path), place.line, True)
    fix = (
        "check takes a robot, or a single <model>"
        if "is a world" in problem
        else "fix this, then the rest is checked"
    )
    if "broken XML" in problem:  # such a message ends with the fix
        problem, _, fix = problem.rpartition("; ")
    return Finding(FATAL.name, FATAL.severity, place, problem, FATAL.why, fix)


def _unreported(
    rule: Rule, subject: Subject, mistakes: Iterable[tuple[Rule, Mistake]]
) -> list[Mistake]:
    """The loader's warnings about elements in which no rule found anything; its error unless a rule
    found an error in the same part of the robot: one mistake may be the cause of both.
    """
    found = [(other, mistake.at) for other, mistake in mistakes if isinstance(mistake.at, Tag)]
    if rule is NOTE:
        reported = [owner for _, at in found for owner in (at, _inertial(at))]
        return [mistake for mistake in rule.find(subject) if mistake.at not in reported]
    broken = [(other, at) for other, at in found if other.severity == "error"]
    parts = [
        part
        for other, at in broken
        for part in (subject.part(at), subject.root if other.name in WHOLE else at)
    ]
    return [
        mistake
        for mistake in rule.find(subject)
        if not isinstance(mistake.at, Tag) or subject.part(mistake.at) not in parts
    ]


def _inertial(tag: Tag) -> Tag:
    """The `<inertial>` around a mass or an inertia, to which the loader's messages refer; any other
    element itself.
    """
    return tag.parent if tag.parent and tag.parent.name == "inertial" else tag


def _finding(rule: Rule, mistake: Mistake, subject: Subject) -> Finding:
    problem, fix = _short(mistake.problem), _short(mistake.fix)
    return Finding(
        rule.name, rule.severity, subject.place(mistake.at), problem, rule.why, fix, mistake.edit
    )


def _short(text: str) -> str:
    """The text, truncated, and the long words in it too: they are from the file, and may have any
    length.
    """
    return shorten(_LONG.sub(lambda word: shorten(word[0]), text), MAX_TEXT)
