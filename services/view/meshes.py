"""Visual shapes -> triangles of one colour, which a browser draws."""

import contextlib
import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import trimesh

from holozen.robot.description import Appearance, Mesh, read
from holozen.robot.model import Pose, Shape

RGB = tuple[int, int, int]
PLAIN = (0.7, 0.7, 0.7, 1.0)  # Gazebo's grey, for shapes without a colour
ORANGE = (1.0, 0.55, 0.0, 1.0)
FINEST = 200_000  # triangles of a shape; a phone draws no more of them well


class Part(NamedTuple):
    """Vertices (n, 3) in metres in the shape's frame, triangles (m, 3) of their indexes, and a colour."""

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    color: RGB
    opacity: float


Parts = list[tuple[Pose, Part]]
"""The parts of a link, each with the pose of its shape in the link."""


@lru_cache(maxsize=64)
def appearance(text: str) -> tuple[Appearance, list[Parts]]:
    """The links and joints of a description, and the parts of each link, which all robots with that text share. A mesh
    that cannot be read is left out. Raises RobotError.
    """
    found = read(text)
    return found, [
        [(shape.pose, part) for shape, meshes in shapes for part in _parts(shape, meshes)]
        for _, shapes in found.shapes()
    ]


def arrow() -> Parts:
    """An arrow along x, for a robot that has no description."""
    shaft = Shape("box", (0.3, 0.1, 0.06), Pose((-0.05, 0.0, 0.03)))
    head = Shape("cone", (0.12, 0.2), Pose((0.1, 0.0, 0.03), (0.0, math.pi / 2, 0.0)))
    return [(shape.pose, _part(_solid(shape), ORANGE)) for shape in (shaft, head)]


def _parts(shape: Shape, meshes: tuple[Mesh, ...]) -> Iterator[Part]:
    if shape.kind != "mesh":
        yield _part(_solid(shape), shape.color or PLAIN)
    for mesh in meshes:
        with contextlib.suppress(ValueError):  # it is left out
            vertices, faces = mesh.arrays()
            if 0 < len(faces) <= FINEST:
                yield _part((vertices * shape.size, faces), shape.color or mesh.color or PLAIN)


def _part(mesh: tuple[Any, Any], color: tuple[float, ...]) -> Part:
    red, green, blue, alpha = color
    rgb = (round(255 * red), round(255 * green), round(255 * blue))
    # An STL has three vertices for each triangle; joined ones let the page simplify meshes that are far away.
    vertices, corners = np.unique(np.asarray(mesh[0], np.float32), axis=0, return_inverse=True)
    return Part(vertices, corners.reshape(-1)[mesh[1]].astype(np.uint32), rgb, alpha)


def _solid(shape: Shape) -> tuple[Any, Any]:
    match shape.kind:
        case "box":
            solid = trimesh.creation.box(shape.size)
        case "cylinder":
            solid = trimesh.creation.cylinder(shape.size[0], shape.size[1], sections=32)
        case "cone":
            solid = trimesh.creation.cone(shape.size[0], shape.size[1])
        case _:
            solid = trimesh.creation.icosphere(subdivisions=3, radius=shape.size[0])
    return solid.vertices, solid.faces
