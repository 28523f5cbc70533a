"""The radius of a wheel that has no round collision shape."""

from itertools import product

import numpy as np

from holozen.robot.parts import Link, Shape
from holozen.robot.rotation import Array, matrix_of
from holozen.robot.shapes import solid
from holozen.robot.tag import Vector

SIMPLE = ("box", "cylinder", "sphere")  # visual meshes are not read


def radius_across(link: Link, axle: Vector) -> float:
    """Half of the link's larger extent across its axle, a unit vector in the link's frame, in metres; 0 without shapes.

    The collision shapes count, else the visual ones that are no meshes.
    """
    shapes = link.collisions or [shape for shape in link.visuals if shape.kind in SIMPLE]
    corners = [part for shape in shapes if len(part := _corners(solid(shape)))]
    if not corners:
        return 0.0
    along = np.array(axle)
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.linalg.norm(aside)
    across = np.stack([aside, np.cross(along, aside)], axis=1)
    return float(np.ptp(np.vstack(corners) @ across, axis=0).max() / 2)


def _corners(shape: Shape) -> Array:
    """Points (n, 3) in the link's frame whose bounding box is that of the shape, as long as its axes are the link's."""
    match shape.kind:
        case "hull":
            points = np.array(shape.points)
        case "box":
            points = _box(shape.size)
        case "cylinder":
            points = _box((2 * shape.size[0], 2 * shape.size[0], shape.size[1]))
        case "sphere":
            points = _box((2 * shape.size[0],) * 3)
        case _:
            return np.zeros((0, 3))
    return np.array(shape.pose.xyz) + points @ matrix_of(shape.pose.rpy).T


def _box(size: tuple[float, ...]) -> Array:
    return np.array(list(product((-0.5, 0.5), repeat=3))) * size
