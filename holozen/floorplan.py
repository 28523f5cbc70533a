"""The plane from above, as text: robots, where they came from, goals and objects. Pure; metres, radians.

East is x, north is y. Braille's dots are as far apart in both directions where characters are twice as high as wide.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from holozen.braille import Canvas

FARTHEST = 1e6  # m; what claims to be beyond it is not drawn
LEAST = 1.0  # m that are shown at least, in both directions
MARGIN = 6  # dots around everything, for letters and names
ARROWS = "→↗↑↖←↙↓↘"
ASCII_ARROWS = ">/^\\<,v."
GOAL, OBJECT = "x", "□"
ASCII_OBJECT = "#"
Point = tuple[float, float]


class Robot(NamedTuple):
    """Where a robot is, and its way there. An empty name is the robot at the root."""

    name: str
    x: float
    y: float
    yaw: float
    trail: Sequence[Point] = ()


class Plane(NamedTuple):
    """All there is to draw. `note` stands below it."""

    robots: Sequence[Robot] = ()
    goals: Sequence[Point] = ()
    objects: Mapping[str, Point] = {}
    note: str = ""


def draw(plane: Plane, size: tuple[int, int], ascii: bool = False) -> list[str]:
    """The picture in `size` columns and rows; the last row says how long a metre is."""
    columns, rows = size[0], size[1] - 1
    view = _View(columns, rows, list(_points(plane)))
    canvas = Canvas(columns, rows)
    for robot in plane.robots:
        for start, end in pairwise(view.place(point) for point in robot.trail if _is_near(point)):
            canvas.line(*start, *end)
    lines = [list(line) for line in canvas.lines(ascii)]
    for goal in plane.goals:
        _put(lines, view, goal, GOAL)
    for name, point in plane.objects.items():
        _put(lines, view, point, (ASCII_OBJECT if ascii else OBJECT) + name[:12])
    for robot in plane.robots:
        arrow = (ASCII_ARROWS if ascii else ARROWS)[_eighth(robot.yaw)]
        _put(lines, view, (robot.x, robot.y), arrow + robot.name[:12])
    return ["".join(line) for line in lines] + [_caption(plane, view, columns, ascii)]


class _View:
    """Metres to dots: the same scale both ways, with everything in sight."""

    def __init__(self, columns: int, rows: int, points: list[Point]) -> None:
        xs, ys = [x for x, _ in points] or [0.0], [y for _, y in points] or [0.0]
        self.centre = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
        self.middle = columns - 1.0, 2 * rows - 1.0  # dots
        wide, high = max(max(xs) - min(xs), LEAST), max(max(ys) - min(ys), LEAST)
        self.scale = min(max(2 * columns - 2 * MARGIN, 2) / wide, max(4 * rows - 2 * MARGIN, 2) / high)  # dots a metre

    def place(self, point: Point) -> Point:
        """The dot of a point; y points down there."""
        x, y = ((value - centre) * self.scale for value, centre in zip(point, self.centre, strict=True))
        return self.middle[0] + x, self.middle[1] - y


def _points(plane: Plane) -> Iterable[Point]:
    everything = [*plane.goals, *plane.objects.values(), *((robot.x, robot.y) for robot in plane.robots)]
    for robot in plane.robots:
        everything += robot.trail
    return filter(_is_near, everything)


def _is_near(point: Point) -> bool:
    return abs(point[0]) < FARTHEST and abs(point[1]) < FARTHEST  # a NaN is not


def _eighth(yaw: float) -> int:
    """Which arrow points where the robot faces."""
    return round(math.remainder(yaw, math.tau) / (math.pi / 4)) % 8 if math.isfinite(yaw) else 0


def _put(lines: list[list[str]], view: _View, point: Point, text: str) -> None:
    """Write a text that begins at a point, as far as there is room."""
    if not _is_near(point):
        return
    x, y = view.place(point)
    row, column = round(y) // 4, round(x) // 2
    if 0 <= row < len(lines) and 0 <= column < len(lines[row]):
        room = len(lines[row]) - column
        lines[row][column : column + min(len(text), room)] = text[:room]


def _caption(plane: Plane, view: _View, columns: int, ascii: bool) -> str:
    """How long a round number of metres is, what the signs mean, and the note."""
    metres = next(m for m in _steps() if m * view.scale / 2 >= 8)
    bar = f"|{('-' if ascii else '─') * (round(metres * view.scale / 2) - 1)}| {metres:g} m"
    signs = [f"{GOAL} goal"] if plane.goals else []
    signs += [f"{ASCII_OBJECT if ascii else OBJECT} object"] if plane.objects else []
    return "   ".join(part for part in (bar, *signs, plane.note) if part)[:columns]


def _steps() -> Iterable[float]:
    """1, 2, 5, 10 ... metres, from a millimetre on."""
    return (digit * 10.0**power for power in range(-3, 9) for digit in (1, 2, 5))
