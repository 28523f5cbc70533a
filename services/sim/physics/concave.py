"""Meshes that do not move and are not convex: their triangles, and convex pieces for an engine that
takes no others.
"""

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from holozen.console import report
from holozen.robot.files.meshes import normals_of, welded
from holozen.robot.model import Shape
from holozen.rotation import XYZ

from .engine import Array

WELD = 1e-5  # m; corners that are nearer are one
# m; how far a piece reaches behind its face, so that nothing passes through it between two steps
BEHIND = 0.01
LEVEL = 0.9999  # the least cosine of the angle between two faces of one piece
FLAT = 1e-9  # m^2; a corner that turns right by less is on a straight line
OFF = 1e-3  # m; the farthest that a corner may be from the plane of its piece
MAX_PIECES = 2000  # of one shape: the engine compiles them anew with each robot


def corners_of(shape: Shape) -> tuple[Array, npt.NDArray[np.int64]]:
    """The different corners (k, 3) of a shape's triangles, and these (n, 3) as indexes into
    them.
    """
    return welded(
        np.frombuffer(shape.triangles, np.float32).reshape(-1, 3, 3).astype(np.float64), WELD
    )


@lru_cache(16)
def convex_pieces(shape: Shape) -> tuple[tuple[XYZ, ...], ...]:
    """The corners of convex pieces along the surface of a shape, each a part of its faces with some
    thickness; of one with too many of them, its convex hull, which is reported.
    """
    points, triangles = corners_of(shape)
    faces = _merged(points, triangles)
    if len(faces) > MAX_PIECES:
        report(
            f"sim: warning: a mesh has {len(faces)} flat parts; at most {MAX_PIECES} collide, so "
            "its hull does"
        )
        return (shape.points,)
    return tuple(_slab(points[face], normal) for face, normal in faces)


def _slab(corners: Array, normal: list[float]) -> tuple[XYZ, ...]:
    both = np.vstack([corners, corners - BEHIND * np.array(normal)])
    return tuple((float(x), float(y), float(z)) for x, y, z in both)


Face = tuple[list[int], list[float]]
"""The corners of a convex polygon, counter-clockwise seen from outside, and its normal."""


def _merged(points: Array, triangles: npt.NDArray[np.int64]) -> list[Face]:
    """The triangles, joined to as large convex polygons as removing one edge after the other gives
    (Hertel and Mehlhorn).
    """
    places, normals = points.tolist(), normals_of(points[triangles])
    has_area = np.any(normals, axis=1).tolist()
    faces: dict[int, Face] = {
        index: (face, normal)
        for index, (face, normal) in enumerate(
            zip(triangles.tolist(), normals.tolist(), strict=True)
        )
        if has_area[index]
    }
    owner: dict[tuple[int, int], int] = {}
    for index, (face, _) in faces.items():
        owner |= dict.fromkeys(zip(face, face[1:] + face[:1], strict=True), index)
    shared = [edge for edge in owner if edge[0] < edge[1] and edge[::-1] in owner]
    for a, b in sorted(shared, key=lambda edge: -math.dist(places[edge[0]], places[edge[1]])):
        one, other = owner[a, b], owner[b, a]
        if one != other and (joined := _joined(places, faces[one], faces[other], (a, b))):
            for edge in zip(
                faces[other][0], faces[other][0][1:] + faces[other][0][:1], strict=True
            ):
                owner[edge] = one
            faces[one] = joined
            del faces[other]
    return list(faces.values())


def _joined(
    places: list[list[float]], one: Face, other: Face, edge: tuple[int, int]
) -> Face | None:
    """The polygon of two that share an edge; None if it is not flat or not convex."""
    (first, normal), (second, normal2), (a, b) = one, other, edge
    if _dot(normal, normal2) < LEVEL:
        return None
    start, start2 = first.index(b), second.index(a)
    # b ... a, and a ... b
    left, right = (first[start:] + first[:start], second[start2:] + second[:start2])
    if left[-1] != a or right[-1] != b:
        return None
    height = _dot(places[a], normal)
    if any(abs(_dot(places[corner], normal) - height) > OFF for corner in right):
        return None
    # Both are convex: so is the whole if it is at the two ends of the edge.
    for before, corner, after in ((left[-2], a, right[1]), (right[-2], b, left[1])):
        if _turn(places[before], places[corner], places[after], normal) < -FLAT:
            return None
    return left + right[1:-1], normal


def _dot(one: list[float], other: list[float]) -> float:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def _turn(
    before: list[float], corner: list[float], after: list[float], normal: list[float]
) -> float:
    """The area that two sides span, negative if they turn right as seen against the normal."""
    ax, ay, az = (corner[axis] - before[axis] for axis in range(3))
    bx, by, bz = (after[axis] - corner[axis] for axis in range(3))
    return _dot([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], normal)
