"""Renders what a camera sees by numpy alone, where there is no pybullet: no graphics card, no
library of the system.

A picture takes three passes over all triangles: into the camera's frame and cut at the nearest
plane, onto the pixels with the nearest of each pixel kept, and colours of those alone. In the
camera's frame x is to the right, y down, and z ahead, in metres; on the picture x and y are in
pixels, and 1 / z is linear.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from holozen.messages import Exposure
from holozen.robot.files.description import Appearance, Mesh
from holozen.robot.files.meshes import normals_of
from holozen.robot.files.textures import Texture
from holozen.robot.model import Shape
from holozen.robot.rigid import Frame
from holozen.rotation import XYZW, Transform, rotate

from .picture import GREY, GROUND, Bytes, Picture

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

SKY = 255  # white, as pybullet's
# where it is, in the world; as pybullet's
LIGHT = np.array((-50.0, 30.0, 100.0)) / math.hypot(-50.0, 30.0, 100.0)
# of the light; together what pybullet's model of light gives within some percent
AMBIENT, DIFFUSE = (0.6, 0.37)
SEGMENTS = 32  # of a circle
LARGE = 1024  # pixels; the surroundings of a larger triangle are looked at by themselves
AT_ONCE = 1_000_000  # pixels in the surroundings of all triangles that are looked at together
# ROS's axes of a camera -> those of a picture
ACROSS = np.array(((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)))


@dataclass
class Surface:
    """Triangles of one colour, or with one picture on them.

    corners: (n, 3, 3), counter-clockwise seen from outside, in metres in the frame of its link.
    normals: (n, 3), there.
    color: red, green, blue from 0 to 1; ignored with a picture.
    uv: (n, 3, 2), places on the picture from its lower left corner to (1, 1), or None.
    picture: (height, width, 3), or None.
    """

    corners: Array
    normals: Array
    color: tuple[float, ...]
    uv: Array | None = None
    picture: Bytes | None = None


class Rasterizer:
    """A scene with all entities, in the poses of the exposure that is rendered."""

    def __init__(self) -> None:
        self._entities: dict[str, tuple[int, dict[str, list[Surface]]]] = {}
        self._ground = [*_surfaces(GROUND, (), ())]

    def renew(self) -> None:
        """Free what was removed, which needs no call here."""

    def knows(self, name: str, number: int) -> bool:
        """Whether it knows what an entity looks like."""
        return name in self._entities and self._entities[name][0] == number

    def add(self, name: str, number: int, looks: Appearance) -> None:
        """Add an entity, or replace the one that had its name."""
        links = {
            link.name: [
                surface
                for shape, meshes in shapes
                for surface in _surfaces(shape, meshes, looks.pictures)
            ]
            for link, shapes in looks.shapes()
        }
        self._entities[name] = number, links

    def remove(self, name: str) -> None:
        """Remove an entity, if it is there."""
        self._entities.pop(name, None)

    def close(self) -> None:
        """Free the scene."""
        self._entities.clear()

    def render(self, exposure: Exposure) -> Picture:
        """The picture of an exposure."""
        for name in self._entities.keys() - {entity.name for entity in exposure.entities}:
            self.remove(name)
        with np.errstate(all="ignore"):  # what is not finite is left out, or seen by no pixel
            return _rendered(exposure, [*self._placed(exposure)])

    def _placed(self, exposure: Exposure) -> Iterator[tuple[Surface, Array, Array]]:
        """All surfaces, with the rotation (3, 3) and position (3,) of their frame in the world."""
        if exposure.ground:
            yield self._ground[0], np.eye(3), np.zeros(3)
        for entity in exposure.entities:
            _, links = self._entities.get(entity.name, (0, {}))
            for link, pose in zip(entity.links, entity.poses, strict=True):
                if surfaces := links.get(link):
                    at = Transform.of(pose.position, pose.orientation)
                    rotation, position = _matrix(at.rotation), np.array(at.translation)
                    yield from ((surface, rotation, position) for surface in surfaces)


# Shapes -> surfaces.


def _surfaces(
    shape: Shape, meshes: tuple[Mesh, ...], pictures: tuple[Texture, ...]
) -> Iterator[Surface]:
    """The surfaces of a shape, in the frame of its link; none for a shape that cannot be drawn."""
    frame = Frame.of(shape.pose)

    def placed(
        corners: Array, color: tuple[float, ...], uv: Array | None = None, on: Bytes | None = None
    ) -> Surface:
        corners = corners @ frame.rotation.T + frame.position
        return Surface(corners, normals_of(corners), color[:3], uv, on)

    plain = shape.color or GREY
    match shape.kind:
        case "box" if not meshes:
            yield placed(_box() * shape.size, plain)
        case "cylinder":
            radius, length = shape.size
            yield placed(
                _turned(((0.0, -0.5), (1.0, -0.5), (1.0, 0.5), (0.0, 0.5)))
                * (radius, radius, length),
                plain,
            )
        case "sphere":
            angles = np.linspace(-math.pi / 2, math.pi / 2, SEGMENTS // 2 + 1)
            yield placed(
                _turned([(math.cos(a), math.sin(a)) for a in angles]) * shape.size[0], plain
            )
    scale = np.array(shape.size if shape.kind == "mesh" else (1.0, 1.0, 1.0))
    for mesh in meshes:
        try:
            points, triangles = mesh.arrays()
            picture = mesh.picture_of(pictures)
            on = (
                np.frombuffer(picture.pixels, np.uint8).reshape(picture.height, picture.width, 3)
                if picture
                else None
            )
            uv = mesh.on_picture()[triangles].astype(np.float64) if picture else None
        except ValueError:
            continue
        if np.prod(scale) < 0:  # mirrored
            triangles, uv = triangles[:, ::-1], uv if uv is None else uv[:, ::-1]
        corners = points[triangles].astype(np.float64) * scale
        yield placed(corners, shape.color or mesh.color or GREY, uv, on)


def _box() -> Array:
    """The triangles (12, 3, 3) of a cube of 1 m about the origin."""
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return corners[[corner for a, b, c, d in sides for corner in ((a, b, c), (a, c, d))]]


def _turned(profile: "list[tuple[float, float]] | tuple[tuple[float, float], ...]") -> Array:
    """The triangles of what a line of points (radius, z), upwards, sweeps as it turns about z."""
    angles = np.arange(SEGMENTS + 1) * (2 * math.pi / SEGMENTS)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = np.array(
        [np.column_stack([radius * circle, np.full(SEGMENTS + 1, z)]) for radius, z in profile]
    )
    low, high = rings[:-1], rings[1:]
    a, b, c, d = low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]
    return np.concatenate(
        [
            np.stack([a, b, c], axis=2).reshape(-1, 3, 3),
            np.stack([a, c, d], axis=2).reshape(-1, 3, 3),
        ]
    )


# Surfaces -> a picture.


def _rendered(exposure: Exposure, placed: list[tuple[Surface, Array, Array]]) -> Picture:
    width, height = exposure.width, exposure.height
    colors = np.full((height * width, 3), SKY, np.uint8)
    depth = np.full(height * width, np.inf, np.float32)
    corners, uv, owners, shades = _in_front(exposure, placed)
    focal = width / 2 / math.tan(exposure.field_of_view / 2)
    planes = Planes.of(corners, focal, width, height)
    nearest, seen = _nearest(planes, width, height)
    pixels = np.flatnonzero(nearest > 1 / exposure.far)
    depth[pixels] = 1 / nearest[pixels]
    triangles = planes.source[seen[pixels]]
    colors[pixels] = shades[triangles]
    for number, (surface, _, _) in enumerate(placed):
        if surface.picture is not None and surface.uv is not None:
            mine = owners[triangles] == number
            where = planes.places(seen[pixels[mine]], uv[triangles[mine]], pixels[mine], width)
            light = shades[triangles[mine], :1] / 255
            colors[pixels[mine]] = (_looked_up(surface.picture, where) * light).astype(np.uint8)
    return Picture(colors.reshape(height, width, 3), depth.reshape(height, width))


def _in_front(
    exposure: Exposure, placed: list[tuple[Surface, Array, Array]]
) -> tuple[Array, Array, Integers, Bytes]:
    """All triangles that reach beyond the nearest plane, cut there: corners (n, 3, 3) in the
    camera's frame, places on their pictures (n, 3, 2), numbers (n,) of their surfaces, and colours
    (n, 3), white for one with a picture.
    """
    eye = Transform.of(exposure.pose.position, exposure.pose.orientation)
    view = ACROSS @ _matrix(eye.rotation).T
    corners, uv, owners, shades = (
        [np.empty((0, 3, 3))],
        [np.empty((0, 3, 2))],
        [np.empty(0, np.int64)],
        [],
    )
    shades.append(np.empty((0, 3)))
    for number, (surface, rotation, position) in enumerate(placed):
        turn = view @ rotation
        mine = surface.corners @ turn.T + view @ (position - np.array(eye.translation))
        ahead = (mine[:, :, 2] > exposure.near).any(axis=1) & np.isfinite(mine).all(axis=(1, 2))
        light = AMBIENT + DIFFUSE * np.clip(
            surface.normals[ahead] @ (rotation.T @ LIGHT), 0.0, None
        )
        color = np.ones(3) if surface.picture is not None else np.array(surface.color)
        corners.append(mine[ahead])
        uv.append(np.zeros((int(ahead.sum()), 3, 2)) if surface.uv is None else surface.uv[ahead])
        owners.append(np.full(int(ahead.sum()), number))
        shades.append(light[:, None] * color)
    cut, places, source = _cut(np.concatenate(corners), np.concatenate(uv), exposure.near)
    bright = (np.concatenate(shades).clip(0.0, 1.0) * 255).astype(np.uint8)
    return cut, places, np.concatenate(owners)[source], bright[source]


def _cut(corners: Array, uv: Array, near: float) -> tuple[Array, Array, Integers]:
    """The parts of triangles beyond the plane z = near, as triangles, and from which each of them
    is.
    """
    whole = np.concatenate([corners, uv], axis=2)
    beyond = corners[:, :, 2] > near
    count = beyond.sum(axis=1)
    kept, sources = [whole[count == 3]], [np.flatnonzero(count == 3)]
    for beyond_count in (1, 2):
        chosen = np.flatnonzero(count == beyond_count)
        # the corner on its own side
        alone = np.argmax(beyond[chosen] == (beyond_count == 1), axis=1)
        order = (alone[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(whole[chosen], order[:, :, None], axis=1), 1, 0)
        ab, ac = _on_plane(a, b, near), _on_plane(a, c, near)
        parts = [(a, ab, ac)] if beyond_count == 1 else [(ab, b, c), (ab, c, ac)]
        kept += [np.stack(part, axis=1) for part in parts]
        sources += [chosen] * len(parts)
    found = np.concatenate(kept)
    return found[:, :, :3], found[:, :, 3:], np.concatenate(sources)


def _on_plane(a: Array, b: Array, near: float) -> Array:
    """Where the lines from a to b (n, 5) meet the plane z = near."""
    share = (near - a[:, 2:3]) / (b[:, 2:3] - a[:, 2:3])
    return a + share * (b - a)


@dataclass
class Planes:
    """Triangles on the picture that face the camera, as linear functions of x and y in pixels: a x
    + b y + c.

    edges: (n, 3, 3), by corner: the share of that corner, times 1 / z there, which is not below 0
        inside.
    inverse: (n, 3), 1 / z.
    box: (n, 4), the first and last column and row of the surroundings.
    source: (n,), the numbers of the triangles.
    """

    edges: Array
    inverse: Array
    box: Integers
    source: Integers

    @classmethod
    def of(cls, corners: Array, focal: float, width: int, height: int) -> "Planes":
        """Of corners (m, 3, 3) in the camera's frame, all of which are ahead."""
        z = corners[:, :, 2]
        x, y = (
            focal * corners[:, :, axis] / z + size / 2 for axis, size in ((0, width), (1, height))
        )
        low = np.stack([x.min(axis=1), y.min(axis=1)], axis=1)
        high = np.stack([x.max(axis=1), y.max(axis=1)], axis=1)
        # The sign of y is turned over on a picture, and so is the order of the corners of what
        # faces the camera.
        (x0, x1, x2), (y0, y1, y2) = x.T, y.T
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        shown = (area < 0) & (high > 0).all(axis=1) & (low < (width, height)).all(axis=1)
        x, y, z, low, high = x[shown], y[shown], z[shown], low[shown], high[shown]
        following, last = np.roll(np.arange(3), -1), np.roll(np.arange(3), 1)
        a = y[:, following] - y[:, last]
        b = x[:, last] - x[:, following]
        c = x[:, following] * y[:, last] - x[:, last] * y[:, following]
        edges = np.stack([a, b, c], axis=2) / area[shown][:, None, None] / z[:, :, None]
        limit = np.array((width, height))
        first = np.clip(np.floor(low), 0, limit - 1).astype(np.int64)
        end = np.clip(np.floor(high), 0, limit - 1).astype(np.int64)
        box = np.stack([first[:, 0], end[:, 0], first[:, 1], end[:, 1]], axis=1)
        return cls(edges, edges.sum(axis=1), box, np.flatnonzero(shown))

    def places(self, numbers: Integers, uv: Array, pixels: Integers, width: int) -> Array:
        """The places (n, 2) on their pictures that pixels show; `uv` (n, 3, 2) are those of the
        triangles' corners.
        """
        x, y = pixels % width + 0.5, pixels // width + 0.5
        edges = self.edges[numbers]
        shares = edges[:, :, 0] * x[:, None] + edges[:, :, 1] * y[:, None] + edges[:, :, 2]
        found: Array = (shares[:, :, None] * uv).sum(axis=1) / shares.sum(axis=1, keepdims=True)
        return found


def _nearest(planes: Planes, width: int, height: int) -> tuple[Array, Integers]:
    """For each pixel, row by row: 1 / z of the nearest triangle, 0 without one, and its number
    among the planes.
    """
    nearest, seen = np.zeros(width * height), np.zeros(width * height, np.int64)
    columns, rows = planes.box[:, 1] - planes.box[:, 0] + 1, planes.box[:, 3] - planes.box[:, 2] + 1
    around = columns * rows
    grid, grid_seen = nearest.reshape(height, width), seen.reshape(height, width)
    for number in np.flatnonzero(around > LARGE):
        _draw_large(planes, int(number), grid, grid_seen)
    small = np.flatnonzero(around <= LARGE)
    ends = np.cumsum(around[small])
    begin = 0
    while begin < len(small):
        end = max(
            int(np.searchsorted(ends, (ends[begin - 1] if begin else 0) + AT_ONCE)), begin + 1
        )
        _draw_small(planes, small[begin:end], columns, around, width, nearest, seen)
        begin = end
    return nearest, seen


def _draw_large(planes: Planes, number: int, nearest: Array, seen: Integers) -> None:
    """Draw one triangle on the rows and columns of its surroundings."""
    left, right, top, bottom = planes.box[number]
    x, y = np.arange(left, right + 1) + 0.5, (np.arange(top, bottom + 1) + 0.5)[:, None]
    first, second, third = (a * x + (b * y + c) for a, b, c in planes.edges[number])
    inverse = first + second + third
    part = np.s_[top : bottom + 1, left : right + 1]
    drawn = (first >= 0) & (second >= 0) & (third >= 0) & (inverse > nearest[part])
    nearest[part][drawn] = inverse[drawn]
    seen[part][drawn] = number


def _draw_small(
    planes: Planes,
    numbers: Integers,
    columns: Integers,
    around: Integers,
    width: int,
    nearest: Array,
    seen: Integers,
) -> None:
    """Draw many triangles together, each on all pixels of its surroundings."""
    counts = around[numbers]
    which = np.repeat(numbers, counts)
    within = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(within, columns[which])
    column, row = column + planes.box[which, 0], row + planes.box[which, 2]
    x, y, drawn = column + 0.5, row + 0.5, np.ones(len(which), bool)
    for corner in range(3):
        a, b, c = planes.edges[:, corner].T
        drawn &= a[which] * x + b[which] * y + c[which] >= 0
    which, pixels = which[drawn], (row * width + column)[drawn]
    a, b, c = planes.inverse[which].T
    inverse = a * x[drawn] + b * y[drawn] + c
    np.maximum.at(nearest, pixels, inverse)
    best = inverse == nearest[pixels]
    seen[pixels[best]] = which[best]


def _looked_up(picture: Bytes, where: Array) -> Bytes:
    """The colours (n, 3) of a picture at places (n, 2), beyond which it repeats."""
    height, width = picture.shape[:2]
    column = np.floor(where[:, 0] * width).astype(np.int64) % width
    row = np.floor((1 - where[:, 1]) * height).astype(np.int64) % height
    found: Bytes = picture[row, column]
    return found


def _matrix(rotation: XYZW) -> Array:
    """The matrix of a quaternion, whose columns are the rotated axes."""
    return np.array(
        [rotate(rotation, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    ).T
