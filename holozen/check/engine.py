"""The robot file under check, read as far as possible, and the types in which rules report mistakes."""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal

from holozen.check.geometry import Placed, Wheel, find_wheels, place_shapes
from holozen.robot import reader
from holozen.robot.elements import Tag, read_xml, repair_xml
from holozen.robot.errors import RobotError
from holozen.robot.gazebo_plugins import KNOWN, kind_of
from holozen.robot.loading import parse
from holozen.robot.model import RobotModel
from holozen.robot.rigid import check_simulated
from holozen.robot.sources import SourceFile, elements, read_sources, trace
from holozen.robot.xacro import Outcome, is_xacro, read_text

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
class Edit:
    """A correction that needs no judgement. `kind`: the name of an "element" or an "attribute" is `new` instead of
    `old`; or `new` is the <inertia> of a link, instead of the `old` one or, if that is empty, beside the mass. `owner`
    is the name of the element that has the attribute, or that of the link.
    """

    kind: Literal["element", "attribute", "inertia"]
    old: str
    new: str
    owner: str = ""


@dataclass(frozen=True, slots=True)
class Mistake:
    """A finding of a rule: at an element, at a place, or (None) in the file as a whole."""

    at: Tag | Place | None
    problem: str
    fix: str
    edit: Edit | None = None


@dataclass(frozen=True, slots=True)
class Rule:
    """`finds` and `why` are descriptions; `find` inspects a robot file. With an error the robot cannot be used as
    intended; with a warning it can.
    """

    name: str
    severity: Severity
    finds: str
    why: str
    find: "Find"


Find = Callable[["Subject"], Iterable[Mistake]]


def rule(name: str, severity: Severity, finds: str, why: str) -> Callable[[Find], Rule]:
    """Make a function that inspects a robot file a Rule."""
    return lambda find: Rule(name, severity, finds, why, find)


@dataclass(frozen=True, slots=True)
class Finding:
    """A mistake with the rule that found it."""

    rule: str
    severity: Severity
    place: Place
    problem: str
    why: str
    fix: str
    edit: Edit | None = None

    def __str__(self) -> str:
        return f"{self.place}: {self.severity}: {self.problem} [{self.rule}]\n    {self.why}; {self.fix}"

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
            "fix": self.fix,
        }


_WHERE = re.compile(r"(?P<file>.*?)(?:, line (?P<line>\d+))?: (?P<text>.*)", re.DOTALL)

PLUGIN_OWNERS = ("model", "world", "sensor")  # in SDF


@dataclass(frozen=True, slots=True)
class Requirements:
    """Requirements on the robot. `fits`: length, width and, if given, height in metres. `require`: a file of names."""

    fits: tuple[float, ...] = ()
    require: Path | None = None


@dataclass(eq=False)
class Subject:
    """`root` is the <robot>, or the <model> of an SDF file (`sdf`), xacro expanded. `model` is None if the file
    cannot be loaded; `messages` are the loader's. `origins` maps elements to their source lines.
    `forgiven` are XML mistakes that Gazebo tolerates.
    """

    path: Path
    root: Tag
    sources: list[SourceFile]
    args: Mapping[str, str] = field(default_factory=dict)
    packages: Mapping[str, Path] = field(default_factory=dict)
    allow_env: Collection[str] = ()
    requirements: Requirements = Requirements()
    sdf: bool = False
    model: RobotModel | None = None
    messages: list[tuple[Severity, Mistake]] = field(default_factory=list)
    origins: Mapping[Tag, Place] = field(default_factory=dict)
    forgiven: list[Mistake] = field(default_factory=list)

    @cached_property
    def links(self) -> dict[str, Tag]:
        """Link name -> its element; the first of duplicates."""
        return named(self.root.all("link"))

    @cached_property
    def joints(self) -> dict[str, Tag]:
        """Joint name -> its element; the first of duplicates."""
        return named(self.root.all("joint"))

    @cached_property
    def placed(self) -> list[Placed]:
        """Every shape, placed with all joints at zero; empty for a robot that cannot be loaded."""
        return list(place_shapes(self.model)) if self.model else []

    @property
    def guessed(self) -> bool:
        """Whether a mesh is missing, so that the extent of some part is unknown."""
        return any("is replaced by a box" in message.problem for _, message in self.messages)

    @cached_property
    def wheels(self) -> list[Wheel]:
        """The wheels; empty for a robot that cannot be loaded."""
        return find_wheels(self.model, self.placed, self.plugin_joints) if self.model else []

    @cached_property
    def plugins(self) -> list[Tag]:
        """Every <plugin> that a simulator reads: in URDF inside a <gazebo>, in SDF of a model, world or sensor."""
        holders = [self.root] if self.sdf else self.root.all("gazebo")
        found = [plugin for holder in holders for plugin in holder.below("plugin")]
        return [tag for tag in found if not self.sdf or (tag.parent and tag.parent.name in PLUGIN_OWNERS)]

    @cached_property
    def plugin_joints(self) -> list[tuple[Tag, str]]:
        """(element, joint name) for each joint that a known plugin names as one of its wheels'."""
        known = [plugin for plugin in self.plugins if kind_of(plugin) in KNOWN]
        return [pair for plugin in known for tag in plugin.children for pair in _joint_names(tag)]

    def part(self, tag: Tag) -> Tag:
        """The link, joint or other direct child of the robot that contains `tag`; the robot itself for its own tag."""
        while tag.parent is not None and tag is not self.root and tag.parent is not self.root:
            tag = tag.parent
        return tag

    def place(self, at: Tag | Place | None) -> Place:
        """The location of an element: in its source file if known."""
        if isinstance(at, Place):
            return at
        if at is None:
            return Place(str(self.path))
        return self.origins.get(at) or Place(at.place.removesuffix(f", line {at.line}"), at.line)

    def is_source(self, tag: Tag) -> bool:
        """Whether the element is in the robot file itself, not in an included one."""
        return self.place(tag).file == str(self.path)


def named(tags: list[Tag]) -> dict[str, Tag]:
    """Name -> element; the first of duplicates, none without a name. Names count to the letter, as in the loader."""
    found: dict[str, Tag] = {}
    for tag in tags:
        if (name := tag.attributes.get("name", "")).strip():
            found.setdefault(name, tag)
    return found


def split(message: str, path: Path) -> tuple[Place, str]:
    """Place and text of a message "FILE, line N: text" or "FILE: text"; else the file and the whole message."""
    match = _WHERE.fullmatch(message)
    if match is None or not (match["line"] or match["file"].startswith(str(path))):
        return Place(str(path)), message
    return Place(match["file"], int(match["line"] or 0)), match["text"]


def _joint_names(tag: Tag) -> Iterator[tuple[Tag, str]]:
    if tag.name.lower().replace("_", "").endswith("joint"):
        yield from ((tag, name) for name in tag.text.replace(",", " ").split())


# Loading.


EXPANDED = " (expanded)"  # after the file's name, in messages about the expanded text
SEE_WORLD = "; see it with: holozen sim --world FILE"
FORGIVEN = "correct it"


def read(
    path: Path,
    args: Mapping[str, str],
    packages: Mapping[str, Path],
    requirements: Requirements,
    allow_env: Collection[str] = (),
) -> Subject:
    """The file, expanded and loaded as far as possible, in the process that reads. Raises RobotError if it is not the
    XML of a robot.
    """
    text = read_text(path)
    expanded = is_xacro(path, text)
    outcome = reader.ask("expand") if expanded else Outcome(text)
    if outcome.error:
        raise RobotError(outcome.error)
    plain, place = outcome.text, f"{path}{EXPANDED}" if expanded else str(path)
    plain, mistakes = (plain, []) if expanded else repair_xml(plain)
    root = read_xml(plain, place)
    sources = read_sources(path, packages) if expanded else []
    robot = _robot(root)
    subject = Subject(path, robot, sources, args, packages, allow_env, requirements, robot.name == "model")
    subject.forgiven = [Mistake(Place(place, line), problem, FORGIVEN) for line, problem in mistakes]
    subject.origins = _origins(subject, root) if expanded else {}
    subject.messages += [_message("warning", *split(line, path)) for line in outcome.warnings]
    if not (expanded and is_library(subject)):
        _load(subject, root, plain, place)
    return subject


def is_library(subject: Subject) -> bool:
    """Whether a xacro file only contains colours, properties and macros for others to include."""
    own = subject.sources[0].root.children if subject.sources else []
    offers = any(tag.name in ("xacro:macro", "xacro:property", "xacro:include", "material", "gazebo") for tag in own)
    return offers and all(tag.name in ("material", "gazebo") for tag in subject.root.children)


def loader_mistakes(subject: Subject, severity: Severity) -> list[Mistake]:
    """The loader's messages of this severity."""
    return [message for found, message in subject.messages if found == severity]


def _message(severity: Severity, at: Tag | Place, text: str) -> tuple[Severity, Mistake]:
    fix = "fix it as described" if severity == "error" else "check that this is intended"
    if text.startswith("<robot> has no name="):
        fix = "add one; a file that others include is checked with the one that includes it"
    return severity, Mistake(at, text, fix)


def _robot(root: Tag) -> Tag:
    if root.name == "robot":
        return root
    if root.name == "sdf" and root.first("world") is None:
        model = root.first("model")
        if model is None:
            raise root.wrong("holds no <model>")
        return model
    if root.name == "sdf":
        raise root.wrong(f"is a world{SEE_WORLD}")
    raise root.wrong("is not a robot; a URDF file starts with <robot name=...>, an SDF file with <sdf version=...>")


def _load(subject: Subject, root: Tag, text: str, place: str) -> None:
    by_line: dict[int, list[Tag]] = {}
    for tag in elements(root):
        by_line.setdefault(tag.line, []).append(tag)
    severity: Severity = "warning"
    try:
        subject.model = parse(text, subject.path, subject.packages, place)
        lines = subject.model.warnings
        subject.messages += _refusals(subject)
    except RobotError as error:
        severity, lines = "error", (str(error),)
    for line in lines:
        where, message = split(line, subject.path)
        here = by_line.get(where.line, []) if where.file == place else []
        # A line may contain several elements; the message starts with the one it is about.
        at = next((tag for tag in here if message.startswith(f"{tag} ")), here[0] if here else where)
        subject.messages.append(_message(severity, at, message))


def _refusals(subject: Subject) -> Iterator[tuple[Severity, Mistake]]:
    """What a sim refuses in a robot that could be loaded."""
    assert subject.model is not None
    try:
        check_simulated(subject.model)
    except RobotError as error:
        yield _message("error", subject.root, str(error))


def _origins(subject: Subject, root: Tag) -> dict[Tag, Place]:
    """Element of the expanded text -> its place in a source file, or in the text if unknown."""
    try:
        marks = trace(subject.sources, root, subject.packages)
    except (RobotError, OSError):
        marks = []
    tags = list(elements(root))
    places = {tag: Place(str(subject.path), tag.line, True) for tag in tags}
    for tag, mark in zip(tags, marks, strict=False):
        number, colon, line = mark.partition(":")
        if colon:
            places[tag] = Place(str(subject.sources[int(number)].path), int(line))
    return places
