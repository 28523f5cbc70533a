"""A robot: its links, joints and drive, checked."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from holozen.robot.drives import Drive
from holozen.robot.errors import RobotError
from holozen.robot.parts import Inertial, Joint, Limits, Link, Pose, Sensor, Shape, Transmission
from holozen.robot.plugins import read_plugins
from holozen.robot.source import Source
from holozen.robot.tag import Tag, read_xml
from holozen.robot.tree import root_of
from holozen.robot.urdf import read_joint, read_link
from holozen.robot.xacro import expand, is_xacro, read_text

__all__ = [
    "Drive", "Inertial", "Joint", "Limits", "Link", "Pose", "RobotError", "RobotModel", "Shape",
    "load", "parse",
]  # fmt: skip

HERE = Pose()
Part = TypeVar("Part", Link, Joint)


@dataclass(frozen=True, slots=True)
class RobotModel:
    """A tree of links from `root`, in the order of the file.

    `drive` is None for a robot without a plugin that drives it. Each of `warnings` is a line that names file, line,
    element and what was done instead. A `static` one never moves. `pose` is where the file itself puts it (SDF).
    """

    name: str
    root: str
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    drive: Drive | None
    warnings: tuple[str, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    transmissions: tuple[Transmission, ...] = ()
    static: bool = False
    pose: Pose = HERE


def load(path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}) -> RobotModel:
    """The robot in a xacro or URDF file. `args` and `packages` as for `xacro.expand`. Raises RobotError."""
    text, place = read_text(path), ""
    if is_xacro(path, text):
        # Lines are those of the expanded text, so messages have to say so.
        text, place = expand(path, args, packages), f"{path} (as `holozen xacro` prints it)"
    return parse(text, path, packages, place)


def parse(text: str, origin: Path, packages: Mapping[str, Path] = {}, place: str = "") -> RobotModel:
    """The robot in a URDF text. `origin` is the file that the text comes from: relative paths and packages
    start there, and messages name it, or `place` if that is given. Raises RobotError.
    """
    robot = read_xml(text, place or str(origin))
    if robot.name != "robot":
        raise robot.wrong("is no <robot>; a URDF file starts with <robot name=...>")
    source = Source(origin, packages)
    links = _by_name(robot.all("link"), read_link, source)
    joints = _by_name(robot.all("joint"), read_joint, source)
    if not links:
        raise robot.wrong("has no <link>; a robot has at least one")
    root = root_of(robot, links, joints)
    drive = read_plugins(robot, links, root, source)
    return RobotModel(robot.word("name"), root, links, joints, drive, tuple(source.warnings))


def _by_name(tags: list[Tag], read: Callable[[Tag, Source], Part], source: Source) -> dict[str, Part]:
    parts: dict[str, Part] = {}
    for tag in tags:
        part = read(tag, source)
        if part.name in parts:
            raise tag.wrong("is there twice; give each its own name")
        parts[part.name] = part
    return parts
