"""The appearance of a robot or object as a self-contained URDF text: the sim writes it, viewers read it."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import replace

from holozen.robot import reader
from holozen.robot.elements import Source
from holozen.robot.errors import RobotError
from holozen.robot.meshes import Surface, file_uri, surfaces_in
from holozen.robot.model import Color, Joint, Link, Pose, RobotModel, Shape
from holozen.robot.packages import NOWHERE
from holozen.robot.rigid import compose
from holozen.robot.urdf import read_joint, read_link

MAX_SHOWN = 3_000_000  # characters of embedded meshes in a text; a reader accepts MAX_TEXT characters in all
THIN = 0.002  # m; the thickness at which a plane is drawn


class Mesh(Struct, frozen=True):
    """Triangles as raw bytes from the reader's process, which only `arrays` validates. `color` is the mesh file's, if
    it gives one.
    """

    points: bytes
    triangles: bytes
    color: Color | None = None

    def arrays(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
        """Points (n, 3) in metres, before the scale of the shape, and triangles (m, 3) as indices into them.

        Raises ValueError for an index out of range, and for points that are not finite.
        """
        points = np.frombuffer(self.points, np.float32).reshape(-1, 3)
        triangles = np.frombuffer(self.triangles, np.uint32).reshape(-1, 3)
        if not np.isfinite(points).all() or (len(triangles) and triangles.max() >= len(points)):
            raise ValueError("a mesh with an index out of range, or with points that are not finite")
        return points, triangles


class Appearance(Struct, frozen=True):
    """Links with their visual shapes, and the joints between them. `meshes`, by link and by visual shape, are the
    triangles of a mesh; empty for an unreadable mesh and for any other shape.
    """

    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    meshes: tuple[tuple[tuple[Mesh, ...], ...], ...] = ()

    def shapes(self) -> Iterator[tuple[Link, list[tuple[Shape, tuple[Mesh, ...]]]]]:
        """Each link with its visual shapes, and each shape with its meshes."""
        for link, meshes in zip(self.links, self.meshes, strict=True):
            yield link, [*zip(link.visuals, meshes, strict=True)]


def written(model: RobotModel) -> str:
    """The URDF of a model's links, visual shapes and joints, with up to MAX_SHOWN characters of embedded meshes.

    A model without any visual shape is written with its collision shapes, and so is a link whose meshes cannot be
    embedded. A plane becomes a thin box, a hull its bounding box.
    """
    robot = ElementTree.Element("robot", name=model.name)
    has_visuals = any(link.visuals for link in model.links.values())
    room = MAX_SHOWN
    for link in model.links.values():
        shapes = list(map(_portable, link.visuals if has_visuals else link.collisions))
        room -= sum(len(shape.data) for shape in shapes)
        if any(shape.kind == "mesh" and not shape.data for shape in shapes) or room < 0:
            shapes = [shape for shape in map(_portable, link.collisions) if shape.kind != "mesh"]
        tag = ElementTree.SubElement(robot, "link", name=link.name)
        for shape in shapes:
            _visual(tag, shape)
    for joint in model.joints.values():
        _joint(robot, joint)
    return ElementTree.tostring(robot, encoding="unicode")


def read(text: str) -> Appearance:
    """The appearance that a URDF text describes, such as one of `written`. Parsed in a process of its own, which opens
    no file. Raises RobotError.
    """
    return reader.run(Appearance, "robot_description", _read, text, only_known=True)


def _read(text: str) -> Appearance:
    source = Source(NOWHERE / "robot_description", {}, confined=True)
    robot = source.read(text, "")
    if robot.name != "robot":
        raise robot.wrong("is not a robot")
    links = [read_link(tag, source) for tag in robot.all("link")]
    joints = tuple(read_joint(tag, source) for tag in robot.all("joint"))
    meshes = tuple(tuple(tuple(_meshes(shape)) for shape in link.visuals) for link in links)
    stripped = (replace(link, visuals=tuple(replace(shape, data="") for shape in link.visuals)) for link in links)
    return Appearance(tuple(stripped), joints, meshes)


def _meshes(shape: Shape) -> list[Mesh]:
    if not shape.data:
        return []
    try:
        return [_mesh(surface) for surface in surfaces_in(shape.data)]
    except (RobotError, ArithmeticError, ValueError):
        return []


def _mesh(surface: Surface) -> Mesh:
    count = len(surface.points)
    triangles = np.arange(count - count % 3) if surface.triangles is None else surface.triangles
    return Mesh(surface.points.astype(np.float32).tobytes(), triangles.astype(np.uint32).tobytes(), surface.color)


def _portable(shape: Shape) -> Shape:
    """The shape as URDF can hold it without another file; a mesh that cannot be embedded is unchanged."""
    if shape.kind == "mesh" and shape.path:
        try:
            return replace(shape, data=file_uri(shape.path))
        except RobotError:
            return shape
    if shape.kind == "plane":
        down = Pose((0.0, 0.0, -THIN / 2))
        return replace(shape, kind="box", size=(*shape.size, THIN), pose=compose(shape.pose, down))
    if shape.kind == "hull":
        low, high = (tuple(map(end, zip(*shape.points, strict=True))) for end in (min, max))
        middle = Pose(tuple((a + b) / 2 for a, b in zip(low, high, strict=True)))
        size = tuple(max(b - a, THIN) for a, b in zip(low, high, strict=True))
        return replace(shape, kind="box", size=size, pose=compose(shape.pose, middle))
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
