"""How far a robot's trail is from the shape that it should have drawn. Pure, but for
`read_path`.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from holozen.bags import BagError
from holozen.suggest import cut

Point = tuple[float, float]
ARRIVED = 0.05  # m; nearer to the first corner, a robot has arrived at its shape
MAX_POINTS = 200  # of a path: a trail of 20,000 points is compared with all its sides


class Deviation(NamedTuple):
    """The distances in m of a trail from the nearest point of its path."""

    mean: float
    most: float

    def __str__(self) -> str:
        return f"{1000 * self.mean:.1f} mm off on average, {1000 * self.most:.1f} mm at most"


def read_path(file: Path) -> list[Point]:
    """The corners of a closed path in m, from a text file with an `x y` on each line, as
    `pose-service --goals` reads it: commas count as spaces, more numbers are ignored, and # begins
    a comment. Raises BagError.
    """
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BagError(f"cannot read {file}: {getattr(error, 'strerror', None) or error}") from None
    path = []
    for number, line in enumerate(lines, 1):
        if words := line.partition("#")[0].replace(",", " ").split():
            try:
                x, y = map(float, words[:2])
            except ValueError:
                x = y = math.nan
            if not (math.isfinite(x) and math.isfinite(y)):
                raise BagError(
                    f"{file}:{number}: {cut(line.strip())}; write x y in metres, such as 1.0 0.5"
                )
            path.append((x, y))
    if not 2 <= len(path) <= MAX_POINTS:
        raise BagError(
            f"{file}: a path has 2 to {MAX_POINTS} corners, one x y per line; this one has "
            f"{len(path)}"
        )
    return path


def closed(path: Sequence[Point]) -> list[Point]:
    """The path, back to its first corner."""
    return [*path, path[0]]


def deviation(trail: Sequence[Point], path: Sequence[Point]) -> Deviation:
    """The deviation of a trail from a closed path, from when it arrives at the path's first corner;
    from its beginning if it never does.
    """
    began = next(
        (index for index, point in enumerate(trail) if math.dist(point, path[0]) < ARRIVED), 0
    )
    sides = list(pairwise(closed(path)))
    off = [min(_distance(point, *side) for side in sides) for point in trail[began:]]
    return Deviation(sum(off) / len(off), max(off))


def _distance(point: Point, start: Point, end: Point) -> float:
    """The distance in m of a point from a side."""
    (x, y), (x0, y0), (x1, y1) = point, start, end
    dx, dy = x1 - x0, y1 - y0
    length = dx * dx + dy * dy
    share = min(1.0, max(0.0, ((x - x0) * dx + (y - y0) * dy) / length)) if length else 0.0
    return math.hypot(x - x0 - share * dx, y - y0 - share * dy)
