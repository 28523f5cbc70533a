"""A robot: its links, joints and drive, checked."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from holozen.robot.drives import Drive
from holozen.robot.errors import RobotError
from holozen.robot.gazebo import read_gazebo
from holozen.robot.massless import check_drive, massless, tell_massless, without
from holozen.robot.materials import read_materials
from holozen.robot.mimics import check_mimics
from holozen.robot.parts import Inertial, Joint, Limits, Link, Pose, Sensor, Shape, Transmission
from holozen.robot.plugins import read_plugins
from holozen.robot.sensors import read_sensors
from holozen.robot.source import Source
from holozen.robot.tag import Tag, read_xml
from holozen.robot.transmissions import read_transmissions
from holozen.robot.tree import root_of
from holozen.robot.urdf import read_joint, read_link
from holozen.robot.xacro import expand, is_xacro, read_text

__all__ = [
    "Drive", "Inertial", "Joint", "Limits", "Link", "Pose", "RobotError", "RobotModel", "Shape",
    "load", "parse", "planar_drive",
]  # fmt: skip

HERE = Pose()
WORLD = "world"  # a root of this name is the ground: Gazebo holds what is fixed to it
MOST_PARTS = 1000  # links, and joints; an engine has long lost real time by then
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


def load(
    path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}, strict: bool = False
) -> RobotModel:
    """The robot in a xacro, URDF or SDF file. `args` and `packages` as for `xacro.expand`. Raises RobotError; with
    `strict` for a missing or bad mesh too, instead of a box in its place and a warning.
    """
    text, place = read_text(path), ""
    if is_xacro(path, text):
        # Lines are those of the expanded text, so messages have to say so.
        text, place = expand(path, args, packages), f"{path} (as `holozen xacro` prints it)"
    return parse(text, path, packages, place, strict)


def parse(
    text: str,
    origin: Path,
    packages: Mapping[str, Path] = {},
    place: str = "",
    strict: bool = False,
    confined: bool = False,
) -> RobotModel:
    """The robot in a URDF or SDF text. `origin` is the file that the text comes from: relative paths and packages
    start there, and messages name it, or `place` if that is given. `strict` as for `load`; `confined` is for a text
    that came over the wire, which may open files of known packages only. Raises RobotError.
    """
    tag = read_xml(text, place or str(origin))
    source = Source(origin, packages, strict=strict, confined=confined)
    if tag.name == "sdf":
        from holozen.robot.sdf.models import parse_sdf  # which builds a RobotModel itself

        return parse_sdf(tag, source)
    if tag.name != "robot":
        raise tag.wrong("is no robot; a URDF file starts with <robot name=...>, an SDF file with <sdf version=...>")
    return _urdf(tag, source)


def planar_drive(model: RobotModel) -> RobotModel:
    """The model with planar_move on its root, for `--drive planar_move`; one that has a drive keeps it."""
    return model if model.drive else replace(model, drive=Drive(robot_base_frame=model.root))


def _urdf(robot: Tag, source: Source) -> RobotModel:
    materials = read_materials(robot, source)
    links = _by_name(robot, "link", lambda tag: read_link(tag, source, materials))
    joints = _by_name(robot, "joint", lambda tag: read_joint(tag, source))
    if not links:
        raise robot.wrong("has no <link>; a robot has at least one")
    root = root_of(robot, links, joints)
    check_mimics(robot, joints, source)
    dressed, static = read_gazebo(robot, links, joints, source)
    lost = massless(links, joints, root)
    tell_massless(robot, links, joints, lost, source)
    kept, moving = without(dressed, joints, lost)
    drive = read_plugins(robot, kept, joints, root, source)
    check_drive(robot, drive, links, joints, root, lost, source)
    return RobotModel(
        name=robot.word("name"),
        root=root,
        links=kept,
        joints=moving,
        drive=drive,
        sensors=tuple(sensor for sensor in read_sensors(robot, links, root, source) if sensor.link in kept),
        transmissions=read_transmissions(robot, joints, source),
        static=static or root == WORLD,
        warnings=tuple(source.warnings),
    )


def _by_name(robot: Tag, name: str, read: Callable[[Tag], Part]) -> dict[str, Part]:
    tags = robot.all(name)
    if len(tags) > MOST_PARTS:
        raise robot.wrong(f"has {len(tags)} {name}s; a robot has at most {MOST_PARTS} links and {MOST_PARTS} joints")
    parts: dict[str, Part] = {}
    for tag in tags:
        part = read(tag)
        if part.name in parts:
            raise tag.wrong("is there twice; give each its own name")
        parts[part.name] = part
    return parts
