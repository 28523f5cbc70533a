"""Mesh files (.dae, .stl, .obj) -> triangles, and the points of a convex hull, in metres in the
link's frame.
"""

import base64
import binascii
import gzip
import io
import os
import re
import stat
import warnings
import zlib
from array import array
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Tag, read_xml
from holozen.robot.model import Color, Vector
from holozen.robot.rotation import Array, triple
from holozen.suggest import cut

# Approximate the convex hull of many points by the farthest one along each of 256 fixed directions.
# The bounding box is exact, and no kept point lies outside the true hull. The hull has the true
# extent along the 256 directions, one of which is within 10 degrees of any direction: a ball of
# radius r loses at most 1.6 % of r, a wheel about x, y or z at most 0.5 % between two corners of
# its rim, and a polyhedron nothing if each of its corners is the farthest one along some direction,
# as a box's are.


COUNT = 250  # directions besides the six along the axes
# points; with more the linear algebra library starts threads, which slow each other down on a busy
# machine
POINTS_AT_ONCE = 340
FARTHEST = 1e9  # largest coordinate; larger ones are mistakes
THIN = 1e-4  # m; a hull thinner than this is not a solid ...
THICK = 1e-3  # m; ... and is made this thick


def _directions() -> Array:
    """Points evenly spread over the sphere on a spiral (a Fibonacci lattice): (COUNT, 3)."""
    index = np.arange(COUNT) + 0.5
    z, turn = 1 - 2 * index / COUNT, index * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


# only selects points; their coordinates keep full precision
DIRECTIONS = _directions().astype(np.float32)
ALL = np.arange(COUNT)


def extremes(parts: Iterable[Array], place: str) -> Array:
    """The farthest points (k, 3) of all parts (n, 3), k <= 256; empty for empty input. Raises
    RobotError for a coordinate that is not finite, or beyond FARTHEST.
    """
    farthest: _Farthest | None = None
    with np.errstate(all="ignore"):  # numpy would warn about the NaN that is checked for here
        for part in parts:
            _check(part, place)
            if len(part):
                farthest = farthest or _Farthest(part[0])
                farthest.take(part)
    return (
        np.zeros((0, 3))
        if farthest is None
        else np.unique(np.vstack([farthest.points, farthest.corners]), axis=0)
    )


class _Farthest:
    """The farthest of the points seen so far along each direction, and for the bounding box."""

    def __init__(self, first: Array) -> None:
        self.first = first
        self.points = np.tile(first, (COUNT, 1))
        self.corners = np.tile(first, (6, 1))
        self._heights = np.zeros(COUNT, np.float32)

    def take(self, part: Array) -> None:
        ends = np.vstack([self.corners, part])
        self.corners = ends[np.concatenate([ends.argmin(axis=0), ends.argmax(axis=0)])]
        # Relative to one of the points, those far from the origin lose no digits.
        near = (part - self.first).astype(np.float32)
        for start in range(0, len(part), POINTS_AT_ONCE):
            heights = DIRECTIONS @ near[start : start + POINTS_AT_ONCE].T
            best = heights.argmax(axis=1)
            height = heights[ALL, best]
            higher = height > self._heights
            self._heights[higher] = height[higher]
            self.points[higher] = part[start + best[higher]]


def solid(points: Array, place: str) -> Array:
    """The points (n, 3) in metres; if they lie in a plane, a copy of them on each side of it.
    Raises RobotError if they lie on a line.
    """
    away = points - points.mean(axis=0)
    axes = np.linalg.svd(away, full_matrices=False)[2]
    spans = np.ptp(away @ axes.T, axis=0)
    if len(spans) < 3 or spans[1] < THIN:
        size = " x ".join(f"{length:g}" for length in np.ptp(points, axis=0))
        raise RobotError(f"{place}: is {size} m, which has no volume; check its scale")
    if spans[2] >= THIN:
        return points
    aside = axes[2] * THICK / 2
    return np.vstack([points - aside, points + aside])


def _check(part: Array, place: str) -> None:
    if not np.isfinite(part).all():
        raise RobotError(f"{place}: has a vertex that is NaN or infinite; export it again")
    if len(part) and np.abs(part).max() > FARTHEST:
        raise RobotError(f"{place}: has a vertex beyond {FARTHEST:g}; export it again, in metres")


class Surface(Struct, frozen=True):
    """Points (n, 3) in metres, and triangles (m, 3) as indices into them; None: every three points
    are a triangle. `color` is the one that the file gives, if any. `uv` (n, 2) are the points'
    places in an image, from its lower left corner to (1, 1); `image` is the file's name for that,
    and `material` that of a material in another file.
    """

    points: Array
    triangles: npt.NDArray[np.int64] | None = None
    color: Color | None = None
    uv: Array | None = None
    image: str = ""
    material: str = ""


# STL, binary and ASCII -> triangles.


HEAD = 84  # bytes: 80 of any text, then the number of triangles
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
TRIANGLES_AT_ONCE = 50_000  # triangles; a huge file is never in memory as a whole
BLOCK = 4_000_000  # bytes of text at once

_VERTEX = re.compile(rb"vertex\s+(\S+\s+\S+\s+\S+)")


def read_stl(file: BinaryIO, size: int, place: str) -> Iterator[Surface]:
    """The triangles, one part of the file at a time. `size` is the file's in bytes. Raises
    RobotError.
    """
    head = file.read(HEAD)
    count = int.from_bytes(head[80:HEAD], "little")
    whole = HEAD + count * TRIANGLE.itemsize
    # A binary file may also start with "solid", so its size decides.
    if size != whole and head.lstrip().lower().startswith(b"solid"):
        yield from map(Surface, _ascii(file, head, place))
    elif len(head) < HEAD or size < whole:
        expected = (
            f"{count} triangles take {whole}"
            if len(head) == HEAD
            else f"the head alone takes {HEAD}"
        )
        raise RobotError(
            f"{place}: is truncated: it has {size} bytes, but {expected}; export it again as STL"
        )
    else:
        yield from map(Surface, _binary(file, count))


def write_stl(points: Array) -> bytes:
    """A binary STL with these points (n, 3) as corners, the last one repeated. Its triangles do not
    form a surface.
    """
    missing = -len(points) % 3
    triangles = np.zeros((len(points) + missing) // 3, TRIANGLE)
    triangles["corners"] = corners = np.vstack(
        [points, points[-1:].repeat(missing, axis=0)]
    ).reshape(-1, 3, 3)
    triangles["normal"] = normals_of(corners)
    return bytes(HEAD - 4) + len(triangles).to_bytes(4, "little") + triangles.tobytes()


def normals_of(corners: Array) -> Array:
    """The unit normals (n, 3) of triangles (n, 3, 3), counter-clockwise seen from outside; 0 for
    one without area.
    """
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(across, axis=1, keepdims=True)
    found: Array = np.divide(across, lengths, out=np.zeros_like(across), where=lengths > 0)
    return found


def _binary(file: BinaryIO, count: int) -> Iterator[Array]:
    for start in range(0, count, TRIANGLES_AT_ONCE):
        part = np.frombuffer(
            file.read(min(TRIANGLES_AT_ONCE, count - start) * TRIANGLE.itemsize), TRIANGLE
        )
        yield part["corners"].reshape(-1, 3).astype(np.float64)


def _ascii(file: BinaryIO, head: bytes, place: str) -> Iterator[Array]:
    count, rest = 0, head.lower()
    while block := file.read(BLOCK).lower():
        done, facet, rest = (rest + block).rpartition(b"endfacet")
        if not facet and len(rest) > 2 * BLOCK:
            break  # not STL, so stop collecting
        part = _ascii_corners(done, place)
        count += len(part)
        if len(part):
            yield part
    if count % 3 or b"endsolid" not in rest:
        raise RobotError(
            f"{place}: is truncated: it does not end with 'endsolid'; export it again as STL"
        )


def _ascii_corners(text: bytes, place: str) -> Array:
    words = b" ".join(_VERTEX.findall(text)).split()
    try:
        return np.fromiter(map(float, words), np.float64, len(words)).reshape(-1, 3)
    except ValueError as error:
        raise RobotError(f"{place}: a vertex is not a number: {str(error)[:200]}") from None


# Wavefront OBJ -> triangles: each face is a fan of them about its first corner.


VERTEX = (b"v ", b"v\t")
FACE = (b"f ", b"f\t")
ON_IMAGE = (b"vt ", b"vt\t")
USES = b"usemtl"


def read_obj(file: BinaryIO, size: int, place: str) -> Iterator[Surface]:
    """The triangles of all faces, by material. Raises RobotError with the line."""
    vertices, on_image, used, placed = array("d"), array("d"), array("q"), array("q")
    before = 0  # corners in `used` before the face that is read
    starts = [(0, "")]  # of each material: its first corner in `used`
    for number, line in enumerate(file, 1):
        try:
            if line.startswith(VERTEX):
                vertices.extend(_vertex(line.split()[1:4]))
            elif line.startswith(FACE):
                words = line.split()[1:]
                _fan_out(_face_corners(words, len(vertices) // 3), used)
                if on_image:
                    # for the faces before the first place
                    placed.extend([-1] * (before - len(placed)))
                    _fan_out(_face_places(words, len(on_image) // 2), placed)
                before = len(used)
            elif line.startswith(ON_IMAGE):
                on_image.extend(_place(line.split()[1:3]))
            elif line.startswith(USES):
                starts.append((len(used), line[len(USES) :].decode("utf-8", "replace").strip()))
        except (OverflowError, ValueError) as error:
            lost = "a face refers to a vertex that does not exist"
            why = lost if isinstance(error, OverflowError) else str(error)[:200]
            raise RobotError(f"{place}, line {number}: {why}") from None
    points, uv = np.array(vertices).reshape(-1, 3), np.array(on_image).reshape(-1, 2)
    placed.extend([-1] * (len(used) - len(placed)) if on_image else ())
    all_corners, all_places = np.array(used), np.array(placed)
    for material, parts in _by_material(starts, len(used)).items():
        own = _joined(all_corners, parts)
        if len(own):
            yield _chosen(points, own, uv, _joined(all_places, parts), material, place)


def _joined(values: npt.NDArray[np.int64], parts: list[slice]) -> npt.NDArray[np.int64]:
    return np.concatenate([values[part] for part in parts])


def _by_material(starts: list[tuple[int, str]], count: int) -> dict[str, list[slice]]:
    """The parts of `count` corners that each material has, from the corners at which it starts."""
    groups: dict[str, list[slice]] = {}
    for (start, material), (end, _) in pairwise([*starts, (count, "")]):
        groups.setdefault(material, []).append(slice(start, end))
    return groups


def _fan_out(corners: list[int], into: "array[int]") -> None:
    """Add the triangles of a face."""
    if len(corners) < 3:
        corners += corners[-1:] * (3 - len(corners))  # no area, but part of the hull
    for second, third in pairwise(corners[1:]):
        into.extend((corners[0], second, third))


def _vertex(words: list[bytes]) -> tuple[float, ...]:
    values = tuple(map(float, words))
    if len(values) != 3:
        raise ValueError(f"a vertex with {len(values)} numbers instead of 3")
    return values


def _place(words: list[bytes]) -> tuple[float, float]:
    """Of a point on an image; 0 for what is no number, since the shape is right without it."""
    try:
        return float(words[0]), float(words[1]) if len(words) > 1 else 0.0
    except (ValueError, IndexError):
        return 0.0, 0.0


def _face_corners(words: list[bytes], count: int) -> list[int]:
    """Indexes from 0. The file counts from 1, or back from the newest vertex: -1."""
    numbers = [int(word.partition(b"/")[0]) for word in words]
    return [number - 1 if number > 0 else count + number for number in numbers]


def _face_places(words: list[bytes], count: int) -> list[int]:
    """Indexes from 0 of a face's corners on the image; -1 if they have none."""
    second = [word.split(b"/")[1] if b"/" in word else b"" for word in words]
    return _face_corners(second, count) if all(second) else [-1] * len(words)


def _chosen(
    vertices: Array,
    used: npt.NDArray[np.int64],
    uv: Array,
    placed: npt.NDArray[np.int64],
    material: str,
    place: str,
) -> Surface:
    low, high = int(used.min()), int(used.max())
    if low < 0 or high >= len(vertices):
        raise RobotError(
            f"{place}: a face refers to vertex {(low if low < 0 else high) + 1} of {len(vertices)}"
        )
    if len(placed) != len(used) or placed.min() < 0 or placed.max() >= len(uv):
        chosen = np.zeros(len(vertices), bool)
        chosen[used] = True
        return Surface(
            vertices[chosen], (np.cumsum(chosen) - 1)[used].reshape(-1, 3), material=material
        )
    points, on_image, triangles = _paired(used, placed)
    return Surface(vertices[points], triangles, uv=uv[on_image], material=material)


def _paired(
    used: npt.NDArray[np.int64], placed: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The different pairs of indexes of corners, into points and into places on an image, and the
    triangles (m, 3) as indexes into those.
    """
    most = int(placed.max()) + 1
    pairs, triangles = np.unique(used * most + placed, return_inverse=True)
    return pairs // most, pairs % most, triangles.reshape(-1, 3)


# COLLADA -> triangles in metres, z up. Following the COLLADA 1.4 specification, `<unit>` is the
# file's unit of length in metres, `<up_axis>` (Y_UP by default) is rotated to z, and each geometry
# is placed by the nodes of the scene.


UP = {
    "Z_UP": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "Y_UP": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "X_UP": ((0, -1, 0), (0, 0, -1), (1, 0, 0)),
}
"""The rotation that takes each up axis to z."""
LONGEST_CHAIN = 4  # references from a texture to its image
MAX_NODES = 20_000  # nodes that instantiate nodes can make a short file expand without bound
MAX_POINTS = 20_000_000  # and one geometry may be instantiated by many nodes


def read_dae(file: BinaryIO, size: int, place: str) -> Iterator[Surface]:
    """The triangles of each geometry of the scene, by material. Raises RobotError."""
    root = read_xml(file.read(size).decode("utf-8-sig", "replace"), place, most=size)
    if root.name != "COLLADA":
        raise root.wrong("is not a <COLLADA>; a .dae file starts with one")
    scene, turned, total = _Scene.of(root), _unit(root) * np.array(UP[_up(root)], float), 0
    for geometry, frame, instance in scene.placed(root):
        for surface, material in scene.surfaces(geometry):
            total += len(surface.points)
            if total > MAX_POINTS:
                raise RobotError(
                    f"{place}: has more than {MAX_POINTS} corners in its scene; simplify it"
                )
            if len(surface.points):
                points = (surface.points @ frame[:3, :3].T + frame[:3, 3]) @ turned.T
                image = scene.image(instance, material) if surface.uv is not None else ""
                yield Surface(
                    points, surface.triangles, scene.color(instance, material), surface.uv, image
                )


def _unit(root: Tag) -> float:
    unit = next(root.below("unit"), root.empty("unit"))
    meter = unit.number("meter", 1.0)
    if meter <= 0:
        raise unit.wrong(f"meter is {meter:g}; a length must be positive")
    return meter


def _up(root: Tag) -> str:
    tag = next(root.below("up_axis"), root.empty("up_axis"))
    up = tag.text.strip() or "Y_UP"
    if up not in UP:
        raise tag.wrong(f"is {cut(up)}; it must be one of {', '.join(UP)}")
    return up


class _Scene(Struct):
    """The elements of a file by kind and id, and the surfaces of each geometry read so far, with
    the symbol of their material.
    """

    elements: dict[tuple[str, str], Tag]
    read: dict[int, list[tuple[Surface, str]]] = {}

    @classmethod
    def of(cls, root: Tag) -> "_Scene":
        tags = [tag for tag in root.walk() if "id" in tag.attributes]
        # of duplicates, the first
        return cls({(tag.name, tag.attributes["id"]): tag for tag in reversed(tags)})

    def named(self, kind: str, tag: Tag, attribute: str = "url") -> Tag:
        """The element that an attribute such as url="#deck" refers to."""
        name = tag.word(attribute).strip().removeprefix("#")
        found = self.elements.get((kind, name))
        if found is None:
            raise tag.wrong(f"{attribute}={cut(name)} names no <{kind}> of this file")
        return found

    def placed(self, root: Tag) -> Iterator[tuple[Tag, Array, Tag]]:
        """Each `<geometry>` of the scene, its 4 x 4 frame, and the element that places it there."""
        scenes = root.child("scene").all("instance_visual_scene")
        waiting = [(self.named("visual_scene", tag), np.eye(4)) for tag in scenes]
        for _ in range(MAX_NODES):
            if not waiting:
                return
            node, above = waiting.pop()
            frame = above @ _transform(node)
            yield from (
                (self.named("geometry", tag), frame, tag) for tag in node.all("instance_geometry")
            )
            waiting += [(tag, frame) for tag in node.all("node")]
            waiting += [(self.named("node", tag), frame) for tag in node.all("instance_node")]
        raise root.wrong(
            f"has more than {MAX_NODES} nodes in its scene, or one that contains itself"
        )

    def color(self, instance: Tag, symbol: str) -> Color | None:
        """The diffuse colour of a geometry's material where it is placed; None if it has none or is
        a texture.
        """
        try:
            effect = self._effect(instance, symbol)
            red, green, blue, alpha = color = next(
                next(effect.below("diffuse")).below("color")
            ).content(4)
        except (StopIteration, RobotError):
            return None
        return (red, green, blue, alpha) if all(0 <= part <= 1 for part in color) else None

    def image(self, instance: Tag, symbol: str) -> str:
        """The name of the diffuse texture's image of a geometry's material where it is placed;
        empty if it has none.
        """
        try:
            effect = self._effect(instance, symbol)
            name = next(next(effect.below("diffuse")).below("texture")).word("texture")
            found = {tag.attributes.get("sid", ""): tag for tag in effect.below("newparam")}
            for _ in range(LONGEST_CHAIN):  # texture -> sampler -> surface -> image
                if name not in found:
                    break
                inside = found[name]
                by_url = next(inside.below("instance_image"), None)
                link = (
                    by_url or next(inside.below("source"), None) or next(inside.below("init_from"))
                )
                name = link.word("url").removeprefix("#") if by_url else link.text.strip()
            start = next(self.elements["image", name].below("init_from"))
            return (start.first("ref") or start).text.strip()
        except (StopIteration, KeyError, RobotError):
            return ""

    def _effect(self, instance: Tag, symbol: str) -> Tag:
        """The effect of a geometry's material. Raises StopIteration or RobotError."""
        bound = (
            tag
            for tag in instance.below("instance_material")
            if tag.attributes.get("symbol") == symbol
        )
        material = self.named("material", next(bound), "target")
        return self.named("effect", next(material.below("instance_effect")))

    def surfaces(self, geometry: Tag) -> list[tuple[Surface, str]]:
        """The triangles of a geometry in its own frame, each with the symbol of its material."""
        if id(geometry) not in self.read:
            mesh = geometry.first("mesh") or geometry
            found = [
                (self._surface(tag), tag.attributes.get("material", ""))
                for tag in mesh.children
                if tag.name in _TRIANGLES
            ]
            self.read[id(geometry)] = found
        return self.read[id(geometry)]

    def _surface(self, faces: Tag) -> Surface:
        inputs = {tag.attributes.get("semantic"): tag for tag in faces.all("input")}
        if "VERTEX" not in inputs:
            raise faces.wrong("has no <input semantic='VERTEX'>")
        stride = max(int(tag.number("offset", 0.0)) for tag in faces.all("input")) + 1
        parts = [_numbers(faces, p.text) for p in faces.below("p")]
        corners = self._corners(faces, parts, inputs["VERTEX"], stride)
        points = self._positions(self.named("vertices", inputs["VERTEX"], "source"))
        used, triangles = np.unique(corners, return_inverse=True)
        if len(used) and not 0 <= used[0] <= used[-1] < len(points):
            raise faces.wrong(
                f"names vertex {used[0] if used[0] < 0 else used[-1]} of {len(points)}"
            )
        on_image = next(
            (tag for tag in faces.all("input") if tag.attributes.get("semantic") == "TEXCOORD"),
            None,
        )
        if on_image is not None and len(used):
            uv = self._values(self.named("source", on_image, "source"), 2)
            placed = self._corners(faces, parts, on_image, stride)
            if placed.shape == corners.shape and 0 <= placed.min() <= placed.max() < len(uv):
                used, where, pairs = _paired(corners.ravel(), placed.ravel())
                return Surface(points[used], pairs, uv=uv[where])
        return Surface(points[used], triangles.reshape(-1, 3))

    def _corners(
        self, faces: Tag, parts: list[Array], source: Tag, stride: int
    ) -> npt.NDArray[np.int64]:
        """The corners of all triangles (m, 3), as indexes into the values of an `<input>`."""
        offset = int(source.number("offset", 0.0))
        found = (_TRIANGLES[faces.name](faces, part[offset::stride]) for part in parts)
        return np.concatenate([np.zeros((0, 3)), *found]).astype(np.int64)

    def _positions(self, vertices: Tag) -> Array:
        inputs = [
            tag for tag in vertices.all("input") if tag.attributes.get("semantic") == "POSITION"
        ]
        if not inputs:
            raise vertices.wrong("has no <input semantic='POSITION'>")
        return self._values(self.named("source", inputs[0], "source"), 3)

    def _values(self, source: Tag, count: int) -> Array:
        """The vectors (n, `count`) of a `<source>`."""
        values = source.needed("float_array")
        accessor = next(source.below("accessor"), source.empty("accessor"))
        start, stride = (
            int(accessor.number("offset", 0.0)),
            int(accessor.number("stride", float(count))),
        )
        if start < 0 or stride < count:
            raise accessor.wrong(
                f"has offset {start} and stride {stride}; a position takes {count} numbers"
            )
        numbers = _numbers(values, values.text)[start:]
        return numbers[: len(numbers) // stride * stride].reshape(-1, stride)[:, :count]


def _triples(_faces: Tag, corners: Array) -> Array:
    missing = -len(corners) % 3  # the corners of a truncated triangle count for the hull
    return np.concatenate([corners, corners[-1:].repeat(missing)]).reshape(-1, 3)


def _fan(faces: Tag, corners: Array) -> Array:
    """The triangles of one convex polygon."""
    if len(corners) < 3:
        return _triples(faces, corners)
    return np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1)


def _polygons(faces: Tag, corners: Array) -> Array:
    """The triangles of polygons, of which `<vcount>` gives the number of corners."""
    tag = faces.first("vcount")
    counts = np.zeros(0) if tag is None else _numbers(tag, tag.text)
    if (len(counts) and counts.min() < 0) or counts.sum() != len(corners):
        raise faces.wrong(f"has {len(corners)} corners, but <vcount> adds up to another number")
    whole = counts.astype(np.int64)
    fans = np.maximum(whole - 2, 0)
    first = np.repeat(np.cumsum(whole) - whole, fans)
    next_one = first + 1 + np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans)
    triangles: Array = corners[np.stack([first, next_one, next_one + 1], axis=1)]
    return triangles


_TRIANGLES: dict[str, Callable[[Tag, Array], Array]] = {
    "triangles": _triples,
    "polylist": _polygons,
    "polygons": _fan,
    "trifans": _fan,
}
"""Element -> the function that turns the corners in one of its <p> into triangles (m, 3)."""


def _transform(node: Tag) -> Array:
    """The 4 x 4 product of a node's transforms; the first one is outermost."""
    frame = np.eye(4)
    for tag in node.children:
        if tag.name in ("lookat", "skew"):
            raise tag.wrong(
                "is not supported; apply the transforms in the modelling tool and export again"
            )
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
        frame[:3, :3] = (
            np.cos(angle) * np.eye(3)
            + np.sin(angle) * across
            + (1 - np.cos(angle)) * np.outer(u, u)
        )
    return frame


_TRANSFORMS = {"matrix": _matrix, "translate": _translate, "scale": _scale, "rotate": _rotate}


def _values(tag: Tag, count: int) -> Array:
    values = _numbers(tag, tag.text)
    if len(values) != count:
        raise tag.wrong(f"has {len(values)} numbers instead of {count}")
    return values


def _numbers(tag: Tag, text: str) -> npt.NDArray[np.float64]:
    """Numbers separated by white space; a double represents every index exactly."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # older numpy only warns, and stops reading
            return np.fromstring(text, np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        raise tag.wrong("contains something that is not a number") from None


# Mesh files. Each is read once by a process, which lives no longer than the reading of a robot, see
# reader.py.


UNSCALED = (1.0, 1.0, 1.0)
MAX_DATA = 1_000_000  # characters of a data: URI; the hull of any mesh takes 6000
# the start of a placeholder for a file that was not fetched
POINTER = b"version https://git-lfs.github.com/spec/v1"

MeshReader = Callable[[BinaryIO, int, str], Iterator[Surface]]
READERS: dict[str, tuple[MeshReader, int]] = {
    ".dae": (read_dae, 100_000_000),
    ".obj": (read_obj, 80_000_000),
    ".stl": (read_stl, 300_000_000),
}
"""File name extension -> its reader, and the maximum size in bytes: what a slow machine reads in 10
s.
"""

MAX_SHOWN = 20_000_000  # bytes of a visual mesh that is embedded
# file name extension -> media type below model/
KINDS = {".dae": "vnd.collada+xml", ".obj": "obj", ".stl": "stl"}

_FILE = re.compile(r"data:model/(vnd\.collada\+xml|obj|stl)\+gzip;base64,")
_DATA = re.compile(r"data:(model|application)/[a-z.+-]*stl[a-z.+-]*;base64,", re.IGNORECASE)


def hull(path: Path, scale: Vector = UNSCALED) -> tuple[Vector, ...]:
    """The points, at most 512, whose convex hull approximates a mesh; for the accuracy see
    `extremes`.

    `scale` is the URDF's, applied to the file's coordinates in metres. Raises RobotError naming the
    file.
    """
    return _solid(_extremes(path), scale, str(path))


MAX_TRIANGLES = 100_000  # of a mesh that collides as it is; an engine takes about a second for them
NEARLY = 1e-3  # of a mesh's size; how far points may be outside a face of one that counts as convex


def triangles_of(path: Path, scale: Vector = UNSCALED) -> bytes:
    """The corners of a mesh that is not convex, as `Shape.triangles`; empty for a convex one.
    Raises RobotError, also for more than MAX_TRIANGLES.
    """
    return _concave(_corners_in(_surfaces(path)), _extremes(path), scale, str(path))


def triangles_uri(path: Path) -> str:
    """A mesh that is not convex as a `data:` URI of at most MAX_DATA characters; of a convex one
    its hull. Raises RobotError.
    """
    triangles = triangles_of(path)
    if not triangles:
        return data_uri(path)
    content = write_stl(np.frombuffer(triangles, np.float32).reshape(-1, 3).astype(np.float64))
    uri = f"data:model/stl+gzip;base64,{base64.b64encode(gzip.compress(content, mtime=0)).decode()}"
    if len(uri) > MAX_DATA:
        raise RobotError(
            f"{path}: takes {len(uri) / 1e6:.1f} MB compressed, more than {MAX_DATA / 1e6:g}; "
            "simplify it"
        )
    return uri


def data_triangles(uri: str, scale: Vector = UNSCALED) -> bytes:
    """As `triangles_of`, of the STL in a URI of `triangles_uri`."""
    if not _FILE.match(uri.lstrip()):
        return b""
    surfaces = list(read_surfaces(*file_in(uri)))
    return _concave(
        _corners_in(surfaces), _farthest(iter(surfaces), "data: URI"), scale, "data: URI"
    )


def _corners_in(surfaces: Iterable[Surface]) -> Array:
    """The corners of all triangles (n, 3, 3)."""
    parts = [np.zeros((0, 3, 3))]
    for surface in surfaces:
        whole = surface.points[: len(surface.points) // 3 * 3]
        parts.append(
            whole.reshape(-1, 3, 3)
            if surface.triangles is None
            else surface.points[surface.triangles]
        )
        if sum(map(len, parts)) > MAX_TRIANGLES:
            raise RobotError(f"has more than {MAX_TRIANGLES} triangles; simplify it")
    return np.concatenate(parts)


def _concave(corners: Array, farthest_points: Array, scale: Vector, place: str) -> bytes:
    corners, farthest_points = corners * scale, farthest_points * scale
    if np.prod(scale) < 0:  # mirrored
        corners = corners[:, ::-1]
    normals = normals_of(corners)
    kept = np.abs(normals).max(axis=1) > 0
    corners, normals = corners[kept], normals[kept]
    size = float(np.ptp(farthest_points, axis=0).max())
    if (
        not len(corners)
        or size < THIN
        or (_is_closed(corners, size) and _is_convex(corners, normals, farthest_points, size))
    ):
        return b""
    return corners.astype(np.float32).tobytes()


def _is_convex(corners: Array, normals: Array, points: Array, size: float) -> bool:
    """Whether all points are on one side of each triangle's plane."""
    for start in range(0, len(corners), POINTS_AT_ONCE):
        part = slice(start, start + POINTS_AT_ONCE)
        heights = normals[part] @ points.T - np.sum(
            normals[part] * corners[part, 0], axis=1, keepdims=True
        )
        if (np.minimum(heights.max(axis=1), -heights.min(axis=1)) > NEARLY * size).any():
            return False
    return True


def _is_closed(corners: Array, size: float) -> bool:
    """Whether each edge is that of two triangles or more."""
    _, numbers = welded(corners, NEARLY / 10 * size)
    edges = np.sort(
        np.concatenate([numbers[:, (0, 1)], numbers[:, (1, 2)], numbers[:, (2, 0)]]), axis=1
    )
    edges = edges[edges[:, 0] != edges[:, 1]]
    return bool((np.unique(edges, axis=0, return_counts=True)[1] > 1).all())


def welded(corners: Array, within: float) -> tuple[Array, npt.NDArray[np.int64]]:
    """The different corners (k, 3) of triangles (n, 3, 3), equal ones within a distance joined; and
    the triangles (n, 3) as indexes into them.
    """
    _, first, numbers = np.unique(
        np.round(corners.reshape(-1, 3) / within).astype(np.int64),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    return corners.reshape(-1, 3)[first], numbers.reshape(-1, 3)


def bounds(path: Path, scale: Vector = UNSCALED) -> tuple[Vector, Vector]:
    """The lowest and the highest x, y, z of a mesh in metres. Raises RobotError."""
    coordinates = list(zip(*hull(path, scale), strict=True))
    return triple(map(min, coordinates)), triple(map(max, coordinates))


def data_uri(path: Path) -> str:
    """The unscaled hull of a mesh as a `data:` URI, to replace the file's name. Raises
    RobotError.
    """
    return "data:model/stl;base64," + base64.b64encode(write_stl(_extremes(path))).decode()


def data_hull(uri: str, scale: Vector = UNSCALED) -> tuple[Vector, ...]:
    """The hull of the STL that a `data:` URI holds, as `hull`. Raises RobotError."""
    if len(uri) > MAX_DATA:
        raise RobotError(f"a data: URI of {len(uri)} characters; at most {MAX_DATA} are read")
    if _FILE.match(uri.lstrip()):
        return _solid(_farthest(read_surfaces(*file_in(uri)), "data: URI"), scale, "data: URI")
    head = _DATA.match(uri.lstrip())
    if head is None:
        raise RobotError(f"{cut(uri)} is not supported; write data:model/stl;base64,...")
    try:
        data = base64.b64decode("".join(uri.lstrip()[head.end() :].split()), validate=True)
    except (binascii.Error, ValueError):
        raise RobotError(f"{cut(uri)} is not valid base64") from None
    return _solid(
        _farthest(read_stl(io.BytesIO(data), len(data), "data: URI"), "data: URI"),
        scale,
        "data: URI",
    )


@lru_cache
def file_uri(path: Path) -> str:
    """A whole mesh file, compressed, as a `data:` URI to replace its name, for viewers. Raises
    RobotError.
    """
    size = _size(path)
    # a link may lead to private data
    kind = KINDS.get(os.path.splitext(os.path.realpath(path))[1].lower())
    if kind is None or not 0 < size <= MAX_SHOWN:
        raise RobotError(
            f"{path}: a mesh to show is a {', '.join(KINDS)} file of up to {MAX_SHOWN / 1e6:.0f} MB"
        )
    try:
        content = path.read_bytes()
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror}") from None
    return f"data:model/{kind}+gzip;base64,{base64.b64encode(gzip.compress(content, mtime=0)).decode()}"  # noqa: E501


def file_in(uri: str) -> tuple[str, bytes]:
    """The file name extension and the content of the mesh file in a URI of `file_uri`. Raises
    RobotError.
    """
    head = _FILE.match(uri.lstrip())
    if head is None:
        raise RobotError(f"{cut(uri)} holds no mesh; write data:model/stl+gzip;base64,...")
    try:
        unpacker = zlib.decompressobj(wbits=31)  # of gzip
        content = unpacker.decompress(
            base64.b64decode(uri.lstrip()[head.end() :], validate=True), MAX_SHOWN
        )
    except (binascii.Error, ValueError, zlib.error) as error:
        raise RobotError(f"{cut(uri)} is not valid: {error}") from None
    if unpacker.unconsumed_tail:
        raise RobotError(f"{cut(uri)} holds more than {MAX_SHOWN / 1e6:.0f} MB")
    return next(suffix for suffix, kind in KINDS.items() if kind == head[1]), content


def read_surfaces(suffix: str, content: bytes) -> Iterator[Surface]:
    """The triangles of a mesh file's content. Raises RobotError."""
    for part in READERS[suffix][0](io.BytesIO(content), len(content), f"the {suffix[1:]} mesh"):
        _check(part.points, f"the {suffix[1:]} mesh")
        yield part


def _size(path: Path) -> int:
    """The size of a file in bytes. Raises RobotError for anything but a regular one: a FIFO would
    block.
    """
    try:
        state = os.stat(path)
    except (OSError, ValueError) as error:
        raise RobotError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(state.st_mode):
        raise RobotError(f"{path}: is not a file that could contain a mesh")
    return state.st_size


@lru_cache
def _extremes(path: Path) -> Array:
    return _farthest(_surfaces(path), str(path))


def _surfaces(path: Path) -> Iterator[Surface]:
    """The triangles of a mesh file. Raises RobotError."""
    size, suffix = _size(path), path.suffix.lower()
    if suffix not in READERS:
        raise RobotError(f"{path}: is not a supported mesh; use a {', '.join(READERS)} file")
    reader, most = READERS[suffix]
    if size == 0:
        raise RobotError(f"{path}: is empty (0 bytes)")
    if size > most:
        raise RobotError(
            f"{path}: has {size / 1e6:.0f} MB, at most {most / 1e6:.0f} MB are read; simplify the "
            "mesh"
        )
    try:
        with open(path, "rb") as file:
            if file.read(len(POINTER)) == POINTER:
                raise RobotError(f"{path}: is a Git LFS pointer, not a mesh; run: git lfs pull")
            file.seek(0)
            yield from reader(file, size, str(path))
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror}") from None


def _farthest(parts: Iterator[Surface], place: str) -> Array:
    found = extremes((part.points for part in parts), place)
    if not len(found):
        raise RobotError(f"{place}: has no faces")
    return found


def _solid(points: Array, scale: Vector, place: str) -> tuple[Vector, ...]:
    return tuple(triple(point) for point in solid(points * scale, place))
