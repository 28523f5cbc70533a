"""Visual shapes -> triangles of one colour or with a picture on them, which a browser draws."""

import contextlib
import io
import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import trimesh
from PIL import Image

from holozen.robot.files.description import Appearance, Mesh, read
from holozen.robot.files.textures import Texture
from holozen.robot.model import Pose, Shape

RGB = tuple[int, int, int]
PLAIN = (0.7, 0.7, 0.7, 1.0)  # Gazebo's grey, for shapes without a colour
ORANGE = (1.0, 0.55, 0.0, 1.0)
QUALITY = 90  # of the JPEG of a picture, from 1 to 95
FINEST = 200_000  # triangles of a shape; a phone draws no more of them well


class Part(NamedTuple):
    """What is drawn in one go.

    vertices: (n, 3), in metres in the shape's frame.
    faces: Triangles (m, 3) of indexes into the vertices.
    color: The colour, or the mean of the picture.
    opacity: From 0 to 1.
    glb: The same with its picture, as a file of binary glTF; empty without a picture.
    """

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    color: RGB
    opacity: float
    glb: bytes = b""


Parts = list[tuple[Pose, Part]]
"""The parts of a link, each with the pose of its shape in the link."""


@lru_cache(maxsize=64)
def appearance(text: str) -> tuple[Appearance, list[Parts]]:
    """The links and joints of a description, and the parts of each link, which all robots with that
    text share. A mesh that cannot be read is left out. Raises RobotError.
    """
    found = read(text)
    return found, [
        [
            (shape.pose, part)
            for shape, meshes in shapes
            for part in _parts(shape, meshes, found.pictures)
        ]
        for _, shapes in found.shapes()
    ]


def arrow() -> Parts:
    """An arrow along x, for a robot that has no description."""
    shaft = Shape("box", (0.3, 0.1, 0.06), Pose((-0.05, 0.0, 0.03)))
    head = Shape("cone", (0.12, 0.2), Pose((0.1, 0.0, 0.03), (0.0, math.pi / 2, 0.0)))
    return [(shape.pose, _part(_solid(shape), ORANGE)) for shape in (shaft, head)]


def _parts(shape: Shape, meshes: tuple[Mesh, ...], pictures: tuple[Texture, ...]) -> Iterator[Part]:
    is_drawn_as_mesh = shape.kind == "mesh" or any(mesh.picture is not None for mesh in meshes)
    if not is_drawn_as_mesh:
        yield _part(_solid(shape), shape.color or PLAIN)
    scale = shape.size if shape.kind == "mesh" else (1.0, 1.0, 1.0)
    for mesh in meshes if is_drawn_as_mesh else ():
        with contextlib.suppress(ValueError):  # it is left out
            vertices, faces = mesh.arrays()
            if not 0 < len(faces) <= FINEST:
                continue
            part = _part((vertices * scale, faces), shape.color or mesh.color or PLAIN)
            if picture := mesh.picture_of(pictures):
                glb = _with_picture(vertices * scale, faces, mesh.on_picture(), picture)
                part = part._replace(glb=glb)
            yield part


def _with_picture(vertices: Any, faces: Any, places: Any, picture: Texture) -> bytes:
    """A mesh with a picture on it, as a file of binary glTF."""
    size, file = (picture.width, picture.height), io.BytesIO()
    Image.frombytes("RGB", size, picture.pixels).save(file, "JPEG", quality=QUALITY)
    made: Any = trimesh.visual  # it has no types
    material = made.material.PBRMaterial(
        baseColorTexture=Image.open(file), metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True
    )
    look = made.TextureVisuals(uv=places, material=material)
    glb: Any = trimesh.Trimesh(vertices, faces, visual=look, process=False).export(None, "glb")
    return bytes(glb)


def _part(mesh: tuple[Any, Any], color: tuple[float, ...]) -> Part:
    red, green, blue, alpha = color
    rgb = (round(255 * red), round(255 * green), round(255 * blue))
    # An STL has three vertices for each triangle; joined ones let the page simplify meshes that are
    # far away.
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
