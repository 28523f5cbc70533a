"""Few points whose convex hull stands for that of many.

Of the points it keeps the farthest one along each of 256 fixed directions. The bounding box is exact, and no kept point
lies outside the true hull. The error: the hull reaches as far as the true one along the 256 directions, of which one is
within 10 degrees of any; a ball of radius r loses at most 1.6 % of r, a wheel about x, y or z at most 0.5 % between two
corners of its rim, and a polyhedron nothing as long as each of its corners is the farthest one somewhere, as a
box's are.
"""

from collections.abc import Iterable

import numpy as np

from holozen.robot.errors import RobotError
from holozen.robot.rotation import Array

COUNT = 250  # directions besides the six along the axes
AT_ONCE = 340  # points; with more the linear algebra library starts threads, which hinder each other on a busy machine
FARTHEST = 1e9  # of a coordinate; more is a mistake
THIN = 1e-4  # m; a hull that is thinner than this is no solid ...
THICK = 1e-3  # m; ... and is made this thick


def _directions() -> Array:
    """Points of a spiral that spread evenly over the sphere (a Fibonacci lattice): (COUNT, 3)."""
    index = np.arange(COUNT) + 0.5
    z, turn = 1 - 2 * index / COUNT, index * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


DIRECTIONS = _directions().astype(np.float32)  # it only picks points; their coordinates stay as they are
ALL = np.arange(COUNT)


def extremes(parts: Iterable[Array], place: str) -> Array:
    """The farthest points (k, 3) of all parts (n, 3), k <= 256; none of none. Raises RobotError for NaN."""
    farthest: _Farthest | None = None
    with np.errstate(all="ignore"):  # numpy would warn of the NaN that is looked for here
        for part in parts:
            _check(part, place)
            if len(part):
                farthest = farthest or _Farthest(part[0])
                farthest.take(part)
    return np.zeros((0, 3)) if farthest is None else np.unique(np.vstack([farthest.points, farthest.corners]), axis=0)


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
        # Seen from one of them, also points far from the origin lose no digits.
        near = (part - self.first).astype(np.float32)
        for start in range(0, len(part), AT_ONCE):
            heights = DIRECTIONS @ near[start : start + AT_ONCE].T
            best = heights.argmax(axis=1)
            height = heights[ALL, best]
            higher = height > self._heights
            self._heights[higher] = height[higher]
            self.points[higher] = part[start + best[higher]]


def solid(points: Array, place: str) -> Array:
    """The points (n, 3) in metres, doubled to both sides if they lie in a plane. Raises RobotError for a line."""
    away = points - points.mean(axis=0)
    axes = np.linalg.svd(away, full_matrices=False)[2]
    spans = np.ptp(away @ axes.T, axis=0)
    if len(spans) < 3 or spans[1] < THIN:
        size = " x ".join(f"{length:g}" for length in np.ptp(points, axis=0))
        raise RobotError(f"{place}: is {size} m, which has no volume; look at its scale")
    if spans[2] >= THIN:
        return points
    aside = axes[2] * THICK / 2
    return np.vstack([points - aside, points + aside])


def _check(part: Array, place: str) -> None:
    if not np.isfinite(part).all():
        raise RobotError(f"{place}: has a vertex that is NaN or infinite; export it again")
    if len(part) and np.abs(part).max() > FARTHEST:
        raise RobotError(f"{place}: has a vertex beyond {FARTHEST:g}; export it again, in metres")
