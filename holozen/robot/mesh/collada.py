"""COLLADA files (.dae) -> the corners of their faces in metres, z up.

As the COLLADA 1.4 specification says: `<unit>` is the file's length in metres, `<up_axis>` (Y_UP unless it is given) is
turned to z, and each geometry stands where the nodes of the scene put it.
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from holozen.robot.errors import RobotError, cut
from holozen.robot.rotation import Array
from holozen.robot.tag import Tag, read_xml

FACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
UP = {
    "Z_UP": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "Y_UP": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "X_UP": ((0, -1, 0), (0, 0, -1), (1, 0, 0)),
}
"""The rotation that makes each up-axis z."""
MOST_NODES = 20_000  # nodes that name nodes can make a short file endless
MOST_POINTS = 20_000_000  # and one geometry may stand at many nodes


def read(file: BinaryIO, size: int, place: str) -> Iterator[Array]:
    """Corners (n, 3) of each geometry of the scene. Raises RobotError."""
    root = read_xml(file.read(size).decode("utf-8-sig", "replace"), place, most=size)
    if root.name != "COLLADA":
        raise root.wrong("is no <COLLADA>; a .dae file starts with it")
    scene, turned, total = _Scene.of(root), _unit(root) * np.array(UP[_up(root)], float), 0
    for geometry, frame in scene.placed(root):
        points = scene.corners(geometry)
        total += len(points)
        if total > MOST_POINTS:
            raise RobotError(f"{place}: has more than {MOST_POINTS} corners in its scene; simplify it")
        if len(points):
            yield (points @ frame[:3, :3].T + frame[:3, 3]) @ turned.T


def _unit(root: Tag) -> float:
    unit = next(root.below("unit"), Tag("unit", {}, root.place, root))
    meter = unit.number("meter", 1.0)
    if meter <= 0:
        raise unit.wrong(f"meter is {meter:g}; a length is above 0")
    return meter


def _up(root: Tag) -> str:
    tag = next(root.below("up_axis"), Tag("up_axis", {}, root.place, root))
    up = tag.text.strip() or "Y_UP"
    if up not in UP:
        raise tag.wrong(f"is {cut(up)}; there are {', '.join(UP)}")
    return up


@dataclass(slots=True)
class _Scene:
    """The elements of a file by kind and id, and the corners of geometries that were read."""

    elements: dict[tuple[str, str], Tag]
    read: dict[int, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, root: Tag) -> "_Scene":
        elements: dict[tuple[str, str], Tag] = {}
        waiting = [root]
        while waiting:
            tag = waiting.pop()
            elements[tag.name, tag.attributes.get("id", "")] = tag
            waiting += tag.children
        return cls(elements)

    def named(self, kind: str, tag: Tag, attribute: str = "url") -> Tag:
        """The element that an attribute such as url="#deck" names."""
        name = tag.word(attribute).strip().removeprefix("#")
        found = self.elements.get((kind, name))
        if found is None:
            raise tag.wrong(f"{attribute}={cut(name)} names no <{kind}> of this file")
        return found

    def placed(self, root: Tag) -> Iterator[tuple[Tag, Array]]:
        """Each `<geometry>` of the scene, and the 4 x 4 frame that it stands in."""
        scene = root.first("scene") or Tag("scene", {}, root.place, root)
        waiting = [(self.named("visual_scene", tag), np.eye(4)) for tag in scene.all("instance_visual_scene")]
        for _ in range(MOST_NODES):
            if not waiting:
                return
            node, above = waiting.pop()
            frame = above @ _transform(node)
            yield from ((self.named("geometry", tag), frame) for tag in node.all("instance_geometry"))
            yield from (self._skin(tag, frame) for tag in node.all("instance_controller"))
            waiting += [(tag, frame) for tag in node.all("node")]
            waiting += [(self.named("node", tag), frame) for tag in node.all("instance_node")]
        raise root.wrong(f"has more than {MOST_NODES} nodes in its scene, or one that holds itself")

    def _skin(self, tag: Tag, frame: Array) -> tuple[Tag, Array]:
        controller = self.named("controller", tag)
        skin = controller.first("skin")
        if skin is None:
            raise controller.wrong("has no <skin>; other controllers are not read")
        bind = skin.first("bind_shape_matrix")
        return self.named("geometry", skin, "source"), frame if bind is None else frame @ _matrix(bind)

    def corners(self, geometry: Tag) -> Array:
        """The vertices (n, 3) that the faces of a geometry use, in its own frame."""
        if id(geometry) not in self.read:
            mesh = geometry.first("mesh") or geometry
            parts = [self._used(tag) for tag in mesh.children if tag.name in FACES]
            self.read[id(geometry)] = np.vstack([np.zeros((0, 3)), *parts])
        return self.read[id(geometry)]

    def _used(self, faces: Tag) -> Array:
        inputs = {tag.attributes.get("semantic"): tag for tag in faces.all("input")}
        if "VERTEX" not in inputs:
            raise faces.wrong("has no <input semantic='VERTEX'>")
        offsets = [int(tag.number("offset", 0.0)) for tag in inputs.values()]
        offset, stride = int(inputs["VERTEX"].number("offset", 0.0)), max(offsets) + 1
        texts = [p.text for p in faces.below("p")]
        used = np.unique(np.concatenate([np.zeros(0, np.int64), *(_numbers(faces, t)[offset::stride] for t in texts)]))
        points = self._positions(self.named("vertices", inputs["VERTEX"], "source"))
        indexes = used.astype(np.int64)
        if len(indexes) and not 0 <= indexes[0] <= indexes[-1] < len(points):
            raise faces.wrong(f"names vertex {indexes[0] if indexes[0] < 0 else indexes[-1]} of {len(points)}")
        return points[indexes]

    def _positions(self, vertices: Tag) -> Array:
        inputs = [tag for tag in vertices.all("input") if tag.attributes.get("semantic") == "POSITION"]
        if not inputs:
            raise vertices.wrong("has no <input semantic='POSITION'>")
        source = self.named("source", inputs[0], "source")
        values = source.first("float_array")
        if values is None:
            raise source.wrong("has no <float_array>")
        accessor = next(source.below("accessor"), Tag("accessor", {}, source.place, source))
        start, stride = int(accessor.number("offset", 0.0)), int(accessor.number("stride", 3.0))
        if start < 0 or stride < 3:
            raise accessor.wrong(f"has offset {start} and stride {stride}; a position takes 3 numbers")
        numbers = _numbers(values, values.text)[start:]
        return numbers[: len(numbers) // stride * stride].reshape(-1, stride)[:, :3]


def _transform(node: Tag) -> Array:
    """The 4 x 4 product of a node's transforms; the first one is outermost."""
    frame = np.eye(4)
    for tag in node.children:
        if tag.name in ("lookat", "skew"):
            raise tag.wrong("is not read; apply the transforms in the modeller and export again")
        if tag.name in _TRANSFORMS:
            frame = frame @ _TRANSFORMS[tag.name](tag)
    return frame


def _matrix(tag: Tag) -> Array:
    return _values(tag, 16).reshape(4, 4)


def _translate(tag: Tag) -> Array:
    frame = np.eye(4)
    frame[:3, 3] = _values(tag, 3)
    return frame


def _scale(tag: Tag) -> Array:
    return np.diag([*_values(tag, 3), 1.0])


def _rotate(tag: Tag) -> Array:
    """Rodrigues' formula: cos I + sin [u] + (1 - cos) u u^T."""
    x, y, z, degrees = _values(tag, 4)
    length = float(np.hypot(np.hypot(x, y), z))
    frame = np.eye(4)
    if length > 0:
        u, angle = np.array([x, y, z]) / length, np.radians(degrees)
        across = np.cross(np.eye(3), u)
        frame[:3, :3] = np.cos(angle) * np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * np.outer(u, u)
    return frame


_TRANSFORMS = {"matrix": _matrix, "translate": _translate, "scale": _scale, "rotate": _rotate}


def _values(tag: Tag, count: int) -> Array:
    values = _numbers(tag, tag.text)
    if len(values) != count:
        raise tag.wrong(f"has {len(values)} numbers instead of {count}")
    return values


def _numbers(tag: Tag, text: str) -> npt.NDArray[np.float64]:
    """Numbers with white space between them; a double holds every index exactly."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # older numpy only warns, and stops reading
            return np.fromstring(text, np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        raise tag.wrong("holds something that is no number") from None
