"""The robot file under check, read as far as possible."""

import re
from collections.abc import Collection, Iterator, Mapping
from functools import cached_property
from pathlib import Path

from msgspec import Struct

from holozen.check.geometry import Placed, Wheel, find_wheels, place_shapes
from holozen.check.mistake import Location, Mistake, Severity
from holozen.robot.errors import RobotError
from holozen.robot.files import reader
from holozen.robot.files.elements import Tag, read_text, read_xml, repair_xml
from holozen.robot.files.gazebo_plugins import DRIVES, KNOWN, kind_of
from holozen.robot.files.loading import parse
from holozen.robot.files.sources import SourceFile, macro_calls, read_sources, trace
from holozen.robot.files.xacro import Outcome, is_xacro, unasked
from holozen.robot.keys import shared
from holozen.robot.model import RobotModel
from holozen.robot.rigid import check_simulated

_WHERE = re.compile(r"(?P<file>.*?)(?:, line (?P<line>\d+))?: (?P<text>.*)", re.DOTALL)

PLUGIN_OWNERS = ("model", "world", "sensor")  # in SDF


class Requirements(Struct, frozen=True):
    """Requirements on the robot. `fits`: the largest length, width and optionally height in metres;
    empty for none. `require`: a file with the names of links and joints.
    """

    fits: tuple[float, ...] = ()
    require: Path | None = None


class Subject(Struct, eq=False, dict=True):
    """The file under check. `root` is its <robot>, with xacro expanded, or its <model> for an SDF
    file (`sdf`). `model` is None if the file cannot be loaded; `messages` are the loader's.
    `origins` maps elements to their source lines, `calls` to the name and the call of the macro
    that made them. `forgiven` are XML mistakes that Gazebo tolerates.
    """

    path: Path
    root: Tag
    sources: list[SourceFile]
    packages: Mapping[str, Path] = {}
    requirements: Requirements = Requirements()
    sdf: bool = False
    model: RobotModel | None = None
    messages: list[tuple[Severity, Mistake]] = []
    origins: Mapping[Tag, Location] = {}
    calls: Mapping[Tag, tuple[str, Location]] = {}
    forgiven: list[Mistake] = []

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
    def loaded(self) -> RobotModel:
        """The model, for code that runs only if the file could be loaded."""
        assert self.model is not None
        return self.model

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
        """Every <plugin> that a simulator reads: in URDF inside a <gazebo>, in SDF in a model,
        world or sensor.
        """
        holders = [self.root] if self.sdf else self.root.all("gazebo")
        found = [plugin for holder in holders for plugin in holder.below("plugin")]
        return [
            tag
            for tag in found
            if not self.sdf or (tag.parent and tag.parent.name in PLUGIN_OWNERS)
        ]

    @cached_property
    def settings(self) -> list[Tag]:
        """The elements in known plugins: those in other plugins may mean anything."""
        return [
            tag for plugin in self.plugins if kind_of(plugin) in KNOWN for tag in plugin.children
        ]

    @cached_property
    def drives(self) -> list[Tag]:
        """The drive plugins; the first one drives the robot."""
        return [plugin for plugin in self.plugins if kind_of(plugin) in DRIVES]

    @cached_property
    def plugin_joints(self) -> list[tuple[Tag, str]]:
        """(element, joint name) for each joint that a known plugin names, one of a wheel."""
        tags = [tag for tag in self.settings if tag.name.lower().replace("_", "").endswith("joint")]
        return [(tag, name) for tag in tags for name in tag.text.replace(",", " ").split()]

    def part(self, tag: Tag) -> Tag:
        """The direct child of the robot, such as a link, that is or contains `tag`; the robot for
        its own element.
        """
        while tag.parent is not None and tag is not self.root and tag.parent is not self.root:
            tag = tag.parent
        return tag

    def place(self, at: Tag | Location | None) -> Location:
        """The location of an element: in its source file if known."""
        if isinstance(at, Location):
            return at
        if at is None:
            return Location(str(self.path))
        return self.origins.get(at) or Location(at.place.removesuffix(f", line {at.line}"), at.line)

    def is_source(self, tag: Tag) -> bool:
        """Whether the element is in the robot file itself, not in an included one."""
        return self.place(tag).file == str(self.path)


def named(tags: list[Tag]) -> dict[str, Tag]:
    """Name -> element; the first of duplicates, none for elements without a name. Names are exact,
    as in the loader.
    """
    found: dict[str, Tag] = {}
    for tag in tags:
        if (name := tag.attributes.get("name", "")).strip():
            found.setdefault(name, tag)
    return found


def split(message: str, path: Path) -> tuple[Location, str]:
    """Location and text of a message "FILE, line N: text" or "FILE: text"; for any other one `path`
    and the message.
    """
    match = _WHERE.fullmatch(message)
    if match is None or not (match["line"] or match["file"].startswith(str(path))):
        return Location(str(path)), message
    return Location(match["file"], int(match["line"] or 0)), match["text"]


# Loading.


EXPANDED = " (expanded)"  # after the file's name, in messages about the expanded text
SEE_WORLD = "; see it with: holozen sim --world FILE"
FORGIVEN = "correct it"


def read(
    path: Path, given: Collection[str], packages: Mapping[str, Path], requirements: Requirements
) -> Subject:
    """The file, expanded and loaded as far as possible. `given` are the names of its arguments.
    Runs in a worker of `reader.run`. Raises RobotError unless it is the XML of a robot.
    """
    text = read_text(path)
    expanded = is_xacro(path, text)
    outcome = reader.ask("expand") if expanded else Outcome(text, warnings=unasked(path, given))
    if outcome.error:
        raise RobotError(outcome.error)
    plain, place = outcome.text, f"{path}{EXPANDED}" if expanded else str(path)
    plain, mistakes = (plain, []) if expanded else repair_xml(plain)
    root = read_xml(plain, place)
    sources = read_sources(path, packages) if expanded else []
    robot = _robot(root)
    subject = Subject(path, robot, sources, packages, requirements, robot.name == "model")
    subject.forgiven = [
        Mistake(Location(place, line), problem, FORGIVEN) for line, problem in mistakes
    ]
    if expanded:
        subject.origins, subject.calls = _origins(subject, root)
    subject.messages += [_message("warning", *split(line, path)) for line in outcome.warnings]
    if not (expanded and is_library(subject)):
        _load(subject, root, plain, place)
    return subject


def is_library(subject: Subject) -> bool:
    """Whether a xacro file only has colours, properties and macros for other files to include."""
    own = subject.sources[0].root.children if subject.sources else []
    offers = any(
        tag.name in ("xacro:macro", "xacro:property", "xacro:include", "material", "gazebo")
        for tag in own
    )
    return offers and all(tag.name in ("material", "gazebo") for tag in subject.root.children)


def loader_mistakes(subject: Subject, severity: Severity) -> list[Mistake]:
    """The loader's messages of this severity."""
    return [message for found, message in subject.messages if found == severity]


def _message(severity: Severity, at: Tag | Location, text: str) -> tuple[Severity, Mistake]:
    fix = "fix it as described" if severity == "error" else "check that this is intended"
    if text.startswith("<robot> has no name="):
        fix = "add one; to check a file that others include, check the file that includes it"
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
    raise root.wrong(
        "is not a robot; a URDF file starts with <robot name=...>, an SDF file with <sdf "
        "version=...>"
    )


def _load(subject: Subject, root: Tag, text: str, place: str) -> None:
    by_line: dict[int, list[Tag]] = {}
    for tag in root.walk():
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
        # A line may contain several elements; the message starts with the one that it refers to.
        at = next(
            (tag for tag in here if message.startswith(f"{tag} ")), here[0] if here else where
        )
        subject.messages.append(_message(severity, at, message))


def _refusals(subject: Subject) -> Iterator[tuple[Severity, Mistake]]:
    """The reason why a sim refuses a robot that could be loaded, if it does."""
    try:
        check_simulated(subject.loaded)
    except RobotError as error:
        yield _message("error", subject.root, str(error))
    key, problem = shared(subject.loaded, subject.loaded.name)
    if key:
        named = (
            tag
            for tag in subject.settings
            if (topic := tag.value().strip("/")) and f"/{key}".endswith(f"/{topic}")
        )
        yield _message("error", next(named, subject.root), problem)


def _origins(
    subject: Subject, root: Tag
) -> tuple[dict[Tag, Location], dict[Tag, tuple[str, Location]]]:
    """Element of the expanded text -> its place in a source file or, if that is unknown, in the
    text; and the calls.
    """
    try:
        known = trace(subject.sources, root, subject.packages)
    except (RobotError, OSError):
        known = []
    places = {tag: Location(str(subject.path), tag.line, True) for tag in root.walk()}
    calls = macro_calls(subject.sources, known)
    return (
        places | {tag: Location(str(file), line) for tag, file, line in known},
        {tag: (name, Location(str(file), line)) for tag, (name, file, line) in calls.items()},
    )
