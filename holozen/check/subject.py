"""A robot file under check: its elements, its source files, and the robot that it loads as."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from holozen.check.finding import Place
from holozen.check.placed import Placed, place_shapes
from holozen.check.sources import SourceFile, elements
from holozen.check.wheels import Wheel, find_wheels
from holozen.robot.model import RobotModel
from holozen.robot.tag import Tag

_WHERE = re.compile(r"(?P<file>.*?)(?:, line (?P<line>\d+))?: (?P<told>.*)", re.DOTALL)

PLUGIN_OWNERS = ("model", "world", "sensor")  # in SDF


@dataclass(frozen=True, slots=True)
class Told:
    """A line of the loader's, and the element that it speaks of, where that is known."""

    severity: str
    at: Tag | Place | None
    text: str


@dataclass(frozen=True, slots=True)
class Wanted:
    """What the robot has to be. `fits`: length, width and, if given, height in metres. `require`: a file of names."""

    fits: tuple[float, ...] = ()
    require: Path | None = None


@dataclass(eq=False)
class Subject:
    """`root` is the <robot>, or the <model> of an SDF file (`sdf`), xacro expanded. `model` is None where the file
    cannot be loaded; `told` is what the loader said. `origins` leads from an element to its source line.
    """

    path: Path
    root: Tag
    sources: list[SourceFile]
    packages: Mapping[str, Path] = field(default_factory=dict)
    wanted: Wanted = Wanted()
    sdf: bool = False
    model: RobotModel | None = None
    told: list[Told] = field(default_factory=list)
    origins: Mapping[Tag, Place] = field(default_factory=dict)

    @cached_property
    def links(self) -> dict[str, Tag]:
        """Link name -> its element; of two with one name the first."""
        return named(self.root.all("link"))

    @cached_property
    def joints(self) -> dict[str, Tag]:
        """Joint name -> its element; of two with one name the first."""
        return named(self.root.all("joint"))

    @cached_property
    def placed(self) -> list[Placed]:
        """Every shape where it is with all joints at zero; empty for a robot that cannot be loaded."""
        return list(place_shapes(self.model)) if self.model else []

    @property
    def guessed(self) -> bool:
        """Whether a mesh is missing, so that nobody knows how far a part of the robot reaches."""
        return any("is replaced by a box" in told.text for told in self.told)

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
        """(element, joint name) for each joint that a plugin names as one of its wheels'."""
        return [pair for plugin in self.plugins for tag in plugin.children for pair in _joint_names(tag)]

    def part(self, tag: Tag) -> Tag:
        """The link, joint or other direct child of the robot that `tag` stands in; the robot itself for its own tag."""
        while tag.parent is not None and tag is not self.root and tag.parent is not self.root:
            tag = tag.parent
        return tag

    def place(self, at: Tag | Place | None) -> Place:
        """Where an element stands: in its source file if that is known."""
        if isinstance(at, Place):
            return at
        if at is None:
            return Place(str(self.path))
        return self.origins.get(at) or read_place(at.place)

    def is_source(self, tag: Tag) -> bool:
        """Whether the element stands in the robot file itself, and not in one that it includes."""
        return self.place(tag).file == str(self.path)

    def tags(self) -> Iterator[Tag]:
        """Every element of the robot."""
        return elements(self.root)


def named(tags: list[Tag]) -> dict[str, Tag]:
    """Name -> element; of two with one name the first, and none without a name."""
    return {name: tag for tag in reversed(tags) if (name := tag.attributes.get("name", "").strip())}


def read_place(text: str) -> Place:
    """The place in "FILE, line N"."""
    file, comma, line = text.rpartition(", line ")
    return Place(file, int(line)) if comma and line.isdecimal() else Place(text)


def split(message: str, path: Path) -> tuple[Place, str]:
    """Place and text of a message "FILE, line N: text" or "FILE: text"; of another the file and all of it."""
    match = _WHERE.fullmatch(message)
    if match is None or not (match["line"] or match["file"].startswith(str(path))):
        return Place(str(path)), message
    return Place(match["file"], int(match["line"] or 0)), match["told"]


def _joint_names(tag: Tag) -> Iterator[tuple[Tag, str]]:
    if tag.name.lower().replace("_", "").endswith("joint"):
        yield from ((tag, name) for name in tag.text.replace(",", " ").split())
