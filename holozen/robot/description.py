"""What a robot or object looks like, as URDF text that needs no other file: written by the sim, read by viewers."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from holozen.robot.elements import Source
from holozen.robot.errors import RobotError
from holozen.robot.meshes import file_uri
from holozen.robot.model import Joint, Link, Pose, RobotModel, Shape
from holozen.robot.packages import NOWHERE
from holozen.robot.rigid import Frame
from holozen.robot.urdf import read_joint, read_link

MOST_SHOWN = 3_000_000  # characters of meshes in a text; a reader accepts MOST_TEXT in all
THIN = 0.002  # m; how thick a plane is shown


@dataclass(frozen=True, slots=True)
class Appearance:
    """Links with their visual shapes, whose meshes are in `data`, and joints, of which every child has one."""

    links: tuple[Link, ...]
    joints: tuple[Joint, ...]


def written(model: RobotModel) -> str:
    """The URDF of a model's links, visual shapes and joints, with the meshes in it, up to MOST_SHOWN.

    A model without visual shapes has its collision shapes instead, and so has a link whose meshes cannot be sent. A
    plane becomes a thin box, a hull its bounding box.
    """
    robot = ElementTree.Element("robot", name=model.name)
    bare = not any(link.visuals for link in model.links.values())
    room = MOST_SHOWN
    for link in model.links.values():
        shapes = list(map(_sent, link.collisions if bare else link.visuals))
        room -= sum(len(shape.data) for shape in shapes)
        if any(shape.kind == "mesh" and not shape.data for shape in shapes) or room < 0:
            shapes = [shape for shape in map(_sent, link.collisions) if shape.kind != "mesh"]
        tag = ElementTree.SubElement(robot, "link", name=link.name)
        for shape in shapes:
            _visual(tag, shape)
    for joint in model.joints.values():
        _joint(robot, joint)
    return ElementTree.tostring(robot, encoding="unicode")


def read(text: str) -> Appearance:
    """What `written`, or any URDF, describes; no file is opened. Raises RobotError."""
    source = Source(NOWHERE / "robot_description", {}, confined=True)
    robot = source.read(text, "")
    if robot.name != "robot":
        raise robot.wrong("is not a robot")
    links = tuple(read_link(tag, source) for tag in robot.all("link"))
    return Appearance(links, tuple(read_joint(tag, source) for tag in robot.all("joint")))


def _sent(shape: Shape) -> Shape:
    if shape.kind == "mesh" and shape.path:
        try:
            return replace(shape, data=file_uri(shape.path))
        except RobotError:
            return shape
    if shape.kind == "plane":
        down = Pose((0.0, 0.0, -THIN / 2))
        return replace(shape, kind="box", size=(*shape.size, THIN), pose=(Frame.of(shape.pose) @ Frame.of(down)).pose)
    if shape.kind == "hull":
        low, high = (tuple(map(end, zip(*shape.points, strict=True))) for end in (min, max))
        middle = Pose(tuple((a + b) / 2 for a, b in zip(low, high, strict=True)))
        size = tuple(max(b - a, THIN) for a, b in zip(low, high, strict=True))
        return replace(shape, kind="box", size=size, pose=(Frame.of(shape.pose) @ Frame.of(middle)).pose)
    return shape


def _visual(link: ElementTree.Element, shape: Shape) -> None:
    visual = ElementTree.SubElement(link, "visual")
    _origin(visual, shape.pose)
    ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), shape.kind, dict(_geometry(shape)))
    if shape.color:
        material = ElementTree.SubElement(visual, "material", name="")
        ElementTree.SubElement(material, "color", rgba=_numbers(shape.color))


def _geometry(shape: Shape) -> Iterator[tuple[str, str]]:
    match shape.kind:
        case "box":
            yield "size", _numbers(shape.size)
        case "cylinder":
            yield from zip(("radius", "length"), map(repr, shape.size), strict=True)
        case "sphere":
            yield "radius", repr(shape.size[0])
        case "mesh":
            yield from (("filename", shape.data), ("scale", _numbers(shape.size)))


def _joint(robot: ElementTree.Element, joint: Joint) -> None:
    tag = ElementTree.SubElement(robot, "joint", name=joint.name, type=joint.kind)
    _origin(tag, joint.pose)
    ElementTree.SubElement(tag, "parent", link=joint.parent)
    ElementTree.SubElement(tag, "child", link=joint.child)
    ElementTree.SubElement(tag, "axis", xyz=_numbers(joint.axis))
    if joint.kind in ("revolute", "prismatic"):
        names = ("effort", "velocity", "lower", "upper")
        ElementTree.SubElement(tag, "limit", {name: repr(getattr(joint.limits, name)) for name in names})


def _origin(tag: ElementTree.Element, pose: Pose) -> None:
    ElementTree.SubElement(tag, "origin", xyz=_numbers(pose.xyz), rpy=_numbers(pose.rpy))


def _numbers(values: Iterable[float]) -> str:
    return " ".join(map(repr, values))
