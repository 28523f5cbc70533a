"""The appearance of a robot or object as a self-contained URDF text: the sim writes it, viewers
read it.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files import reader
from holozen.robot.files.elements import Source, again
from holozen.robot.files.meshes import Surface, file_uri
from holozen.robot.files.textures import Texture, picture_in, surfaces_in
from holozen.robot.files.urdf import read_joint, read_link
from holozen.robot.files.uris import NOWHERE
from holozen.robot.model import Color, Joint, Link, Pose, RobotModel, Shape
from holozen.robot.rigid import compose

# characters of embedded meshes in a text; a reader accepts MAX_TEXT characters in all
MAX_SHOWN = 3_000_000
THIN = 0.002  # m; the thickness at which a plane is drawn


class Mesh(Struct, frozen=True):
    """Triangles as raw bytes from the reader's process, which only `arrays` and `on_picture`
    validate. `color` is the mesh file's, if it gives one, else the mean of its picture; `picture`
    is the index of that in the appearance's.
    """

    points: bytes
    triangles: bytes
    color: Color | None = None
    uv: bytes = b""
    picture: int | None = None

    def arrays(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
        """Points (n, 3) in metres, before the scale of the shape, and triangles (m, 3) as indices
        into them.

        Raises ValueError for an index out of range, and for points that are not finite.
        """
        points = np.frombuffer(self.points, np.float32).reshape(-1, 3)
        triangles = np.frombuffer(self.triangles, np.uint32).reshape(-1, 3)
        if not np.isfinite(points).all() or (len(triangles) and triangles.max() >= len(points)):
            raise ValueError(
                "a mesh with an index out of range, or with points that are not finite"
            )
        return points, triangles

    def picture_of(self, pictures: Sequence[Texture]) -> Texture | None:
        """Its picture among those of the appearance; None if it has none, or not that one."""
        if self.picture is None or not 0 <= self.picture < len(pictures):
            return None
        return pictures[self.picture]

    def on_picture(self) -> npt.NDArray[np.float32]:
        """The places (n, 2) of its points on its picture, from the lower left corner to (1, 1).
        Raises ValueError as `arrays` does, and if they are not as many as the points.
        """
        places = np.frombuffer(self.uv, np.float32).reshape(-1, 2)
        if not np.isfinite(places).all() or 8 * len(self.points) != 12 * len(self.uv):
            raise ValueError(
                "a mesh with places on its picture that are not finite, or not those of its points"
            )
        return places


class Appearance(Struct, frozen=True):
    """Links with their visual shapes, and the joints between them. `meshes`, by link and by visual
    shape, are the triangles of a mesh, and of a box that carries a picture; empty for an unreadable
    mesh and for any other shape.
    """

    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    meshes: tuple[tuple[tuple[Mesh, ...], ...], ...] = ()
    pictures: tuple[Texture, ...] = ()

    def shapes(self) -> Iterator[tuple[Link, list[tuple[Shape, tuple[Mesh, ...]]]]]:
        """Each link with its visual shapes, and each shape with its meshes."""
        for link, meshes in zip(self.links, self.meshes, strict=True):
            yield link, [*zip(link.visuals, meshes, strict=True)]


def written(model: RobotModel) -> str:
    """The URDF of a model's links, visual shapes and joints, with up to MAX_SHOWN characters of
    embedded meshes.

    Equal ones are embedded once, and one that cannot be is left out. A model without any visual
    shape is written with its collision shapes, and so is a link of which nothing is left. A plane
    becomes a thin box, a hull its bounds.
    """
    robot = ElementTree.Element("robot", name=model.name)
    has_visuals = any(link.visuals for link in model.links.values())
    room, whole = MAX_SHOWN, set[str]()
    for link in model.links.values():
        shapes = list(map(_portable, link.visuals if has_visuals else link.collisions))
        kept = list[Shape]()
        for shape in shapes:
            new = {shape.data, shape.texture} - whole - {""}
            if (shape.kind != "mesh" or shape.data) and (size := sum(map(len, new))) <= room:
                kept.append(_once(shape, whole))
                room, whole = room - size, whole | new
        if shapes and not kept:
            kept = [shape for shape in map(_portable, link.collisions) if shape.kind != "mesh"]
        tag = ElementTree.SubElement(robot, "link", name=link.name)
        for shape in kept:
            _visual(tag, shape)
    for joint in model.joints.values():
        _joint(robot, joint)
    return ElementTree.tostring(robot, encoding="unicode")


def _once(shape: Shape, whole: Collection[str]) -> Shape:
    """The shape, with a reference in place of each data that is in `whole`."""
    data, texture = (again(part) if part in whole else part for part in (shape.data, shape.texture))
    return replace(shape, data=data, texture=texture)


def read(text: str) -> Appearance:
    """The appearance that a URDF text describes, such as one of `written`. Parsed in a process of
    its own, which opens no file. Raises RobotError.
    """
    return reader.run(Appearance, "robot_description", _read, text, only_known=True)


def _read(text: str) -> Appearance:
    source = Source(NOWHERE / "robot_description", {}, confined=True)
    robot = source.read(text, "")
    if robot.name != "robot":
        raise robot.wrong("is not a robot")
    links = [read_link(tag, source) for tag in robot.all("link")]
    joints = tuple(read_joint(tag, source) for tag in robot.all("joint"))
    album: dict[Texture, int] = {}
    meshes = tuple(tuple(tuple(_meshes(shape, album)) for shape in link.visuals) for link in links)
    stripped = (
        replace(link, visuals=tuple(replace(shape, data="", texture="") for shape in link.visuals))
        for link in links
    )
    return Appearance(tuple(stripped), joints, meshes, tuple(album))


def _meshes(shape: Shape, album: dict[Texture, int]) -> list[Mesh]:
    """The meshes of a shape; their pictures are added to the album."""
    picture = None
    try:
        with suppress(RobotError, ImportError):
            picture = picture_in(shape.texture) if shape.texture else None
        if shape.kind == "box" and picture:
            return [_mesh(_box(shape.size), picture, album)]
        return (
            [_mesh(surface, picture or own, album) for surface, own in surfaces_in(shape.data)]
            if shape.data
            else []
        )
    except (RobotError, ArithmeticError, ValueError):
        return []


def _mesh(surface: Surface, picture: Texture | None, album: dict[Texture, int]) -> Mesh:
    count, color = len(surface.points), surface.color
    triangles = np.arange(count - count % 3) if surface.triangles is None else surface.triangles
    points, corners = (
        surface.points.astype(np.float32).tobytes(),
        triangles.astype(np.uint32).tobytes(),
    )
    if picture is None or surface.uv is None:
        return Mesh(points, corners, color)
    number = album.setdefault(picture, len(album))
    return Mesh(points, corners, picture.mean, surface.uv.astype(np.float32).tobytes(), number)


def _box(size: tuple[float, ...]) -> Surface:
    """A box with a whole image on each side, upright on the four around it; the one on top is seen
    from y up.
    """
    half, corners = np.array(size) / 2, np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    # axis of a side -> the image's axes to the right and up
    points, up = ([], {0: (1, 2), 1: (0, 2), 2: (0, 1)})
    for axis, (right, above) in up.items():
        for sign in (1, -1):
            side = np.zeros((4, 3))
            turned = sign * (-1 if axis == 1 else 1)  # so that each image is read from outside
            side[:, axis], side[:, right], side[:, above] = (
                sign,
                turned * corners[:, 0],
                corners[:, 1],
            )
            points.append(side * half)
    triangles = (np.arange(6)[:, None, None] * 4 + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    return Surface(np.vstack(points), triangles, uv=np.tile((corners + 1) / 2.0, (6, 1)))


def _portable(shape: Shape) -> Shape:
    """The shape as URDF can hold it without another file; a mesh that cannot be embedded is
    unchanged.
    """
    if shape.kind == "mesh" and shape.path and not shape.data:
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
    ElementTree.SubElement(
        ElementTree.SubElement(visual, "geometry"), shape.kind, dict(_geometry(shape))
    )
    if shape.color or shape.texture:
        material = ElementTree.SubElement(visual, "material", name="")
        if shape.color:
            ElementTree.SubElement(material, "color", rgba=_numbers(shape.color))
        if shape.texture:
            ElementTree.SubElement(material, "texture", filename=shape.texture)


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
        ElementTree.SubElement(
            tag, "limit", {name: repr(getattr(joint.limits, name)) for name in names}
        )


def _origin(tag: ElementTree.Element, pose: Pose) -> None:
    ElementTree.SubElement(tag, "origin", xyz=_numbers(pose.xyz), rpy=_numbers(pose.rpy))


def _numbers(values: Iterable[float]) -> str:
    return " ".join(map(repr, values))
