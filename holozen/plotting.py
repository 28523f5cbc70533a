"""Pictures as text: a canvas of braille dots, numbers over time (`panels`), and the plane from
above (`draw`).

Pure: points in, lines out. Metres, radians, seconds; on the plane x points east (right) and y north
(up). Braille dots are equally far apart in both directions if characters are twice as high as wide.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby, pairwise
from typing import NamedTuple

Point = tuple[float, float]

# Unicode's numbering of the dots of a braille character: 1 2 3 7 down the left, 4 5 6 8 down the
# right.
_BITS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
_UPPER, _LOWER = 0x1B, 0xE4  # the two top rows of dots, and the two bottom ones
# fonts draw the empty pattern as rings, or not at all
_BRAILLE = [" ", *map(chr, range(0x2801, 0x2900))]
_ASCII = [" '.:"[bool(dots & _UPPER) + 2 * bool(dots & _LOWER)] for dots in range(256)]


class Canvas:
    """`columns` x `rows` characters; dots are counted from (0, 0) at the top left, y downwards.

    Dots outside are not drawn. Coordinates must be finite.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self.width, self.height = 2 * columns, 4 * rows  # dots
        self.cells = bytearray(columns * rows)  # row by row, the dots of each character

    def dot(self, x: int, y: int) -> None:
        """Set one dot."""
        if 0 <= x < self.width and 0 <= y < self.height:
            self.cells[(y >> 2) * self.columns + (x >> 1)] |= _BITS[x & 1][y & 3]

    def line(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Set the dots from one point to another, both included."""
        inside = _clip(x0, y0, x1, y1, self.width - 1, self.height - 1)
        if inside is None:
            return
        x0, y0, x1, y1 = inside
        steps = max(1, round(max(abs(x1 - x0), abs(y1 - y0))))
        for step in range(steps + 1):
            self.dot(round(x0 + (x1 - x0) * step / steps), round(y0 + (y1 - y0) * step / steps))

    def lines(self, ascii: bool = False) -> list[str]:
        """The picture, one string a row, each `columns` long."""
        drawn = [glyph(dots, ascii) for dots in self.cells]
        return [
            "".join(drawn[row * self.columns : (row + 1) * self.columns])
            for row in range(self.rows)
        ]


def glyph(dots: int, ascii: bool = False) -> str:
    """The character for the dots of one cell. In ASCII it distinguishes only the upper and the
    lower half.
    """
    return (_ASCII if ascii else _BRAILLE)[dots]


def _clip(
    x0: float, y0: float, x1: float, y1: float, right: float, bottom: float
) -> tuple[float, float, float, float] | None:
    """The part of a line inside [0, right] x [0, bottom], by Liang and Barsky; None if there is
    none.
    """
    dx, dy = x1 - x0, y1 - y0
    enter, leave = 0.0, 1.0
    for slope, room in ((-dx, x0), (dx, right - x0), (-dy, y0), (dy, bottom - y0)):
        if slope == 0:
            if room < 0:
                return None
        elif slope < 0:
            enter = max(enter, room / slope)
        else:
            leave = min(leave, room / slope)
    if enter > leave:
        return None
    return x0 + enter * dx, y0 + enter * dy, x0 + leave * dx, y0 + leave * dy


LABEL = 10  # characters left of the picture, for the scale
LARGEST = 1e300  # larger values and NaN are skipped
LEAST_ROWS = 3  # of a panel: its title, and two of picture


def panels(
    series: Mapping[str, Sequence[Point]],
    now: float,
    window: float,
    size: tuple[int, int],
    ascii: bool = False,
) -> list[str]:
    """One panel for each name, stacked, over the last `window` seconds. `size`: columns and rows.

    Points are (seconds, value), the oldest first. Without room for all, the last ones are left out.
    """
    columns, rows = size
    shown = list(series)[: max(1, (rows - 1) // LEAST_ROWS)]
    height, more = divmod(max(LEAST_ROWS, rows - 1), len(shown))
    lines = []
    for index, name in enumerate(shown):
        points = [(t, v) for t, v in series[name] if now - window <= t <= now and abs(v) < LARGEST]
        lines += _panel(name, points, now, window, columns, height + (index < more), ascii)
    axis = f"{-window:g} s".ljust(columns - LABEL - 3) + "now"
    return [line[:columns] for line in (*lines, " " * LABEL + axis)]


def _panel(
    name: str, points: list[Point], now: float, window: float, columns: int, rows: int, ascii: bool
) -> list[str]:
    if not points:
        return [f"{name}: no messages"] + [""] * (rows - 1)
    low, high = _range([value for _, value in points])
    canvas = Canvas(columns - LABEL, rows - 1)
    right, bottom = canvas.width - 1, canvas.height - 1
    dots = [
        (right * (1 - (now - t) / window), bottom * (high - v) / (high - low)) for t, v in points
    ]
    for (x0, y0), (x1, y1) in zip(dots, dots[1:] or dots, strict=False):
        canvas.line(x0, y0, x1, y1)
    labels = [""] * (rows - 1)
    labels[0], labels[-1] = _short(high), _short(low)
    title = f"{name}: {points[-1][1]:.6g}"
    return [
        title,
        *(
            f"{label:>{LABEL - 1}} {row}"
            for label, row in zip(labels, canvas.lines(ascii), strict=True)
        ),
    ]


def _range(values: list[float]) -> tuple[float, float]:
    """The lowest and highest number of the scale; a constant line is in the middle."""
    low, high = min(values), max(values)
    # Less than this is numerical noise.
    if high - low <= 1e-9 * max(abs(low), abs(high), 1.0):
        room = max(abs(low) * 0.1, 0.1)
        return low - room, high + room
    return low, high


def _short(value: float) -> str:
    """At most LABEL - 1 characters."""
    for digits in (4, 3, 2, 1):
        if len(text := f"{value:.{digits}g}") < LABEL:
            return text
    return text[: LABEL - 1]


FARTHEST = 1e6  # m; farther points are not drawn
STEP = 12  # dots from one point of the grid to the next; a whole number of characters both ways
FINEST = 0.2  # m between the points of the grid, at least
# dots and radians from the centre: tip, and the two ends of the tail
ARROW = ((5.0, 0.0), (4.0, 2.5), (4.0, -2.5))
MARGIN = 6  # dots around everything, for letters and names
ARROWS = "→↗↑↖←↙↓↘"
ASCII_ARROWS = ">/^\\<,v."
GOAL, OBJECT = "x", "□"
ASCII_OBJECT, ASCII_GRID = "#", "+"

Cell = tuple[str, str]
"""What is drawn ("grid", "trail", "sign" or ""), and its character."""


class Robot(NamedTuple):
    """The pose and trail of a robot. An empty name is the robot at the root of the keys."""

    name: str
    x: float
    y: float
    yaw: float
    trail: Sequence[Point] = ()


class Plane(NamedTuple):
    """The content of a map. `note` is shown below it, `seen` are the points that sensors see."""

    robots: Sequence[Robot] = ()
    goals: Sequence[Point] = ()
    objects: Mapping[str, Point] = {}
    note: str = ""
    seen: Sequence[Point] = ()


def draw(plane: Plane, size: tuple[int, int], ascii: bool = False) -> list[str]:
    """The map in `size` columns and rows; the last row is the scale."""
    rows, caption = drawn(plane, size, ascii)
    return ["".join(character for _, character in row) for row in rows] + [caption]


def drawn(
    plane: Plane, size: tuple[int, int], ascii: bool = False, grid: bool = False
) -> tuple[list[list[Cell]], str]:
    """As `draw`, but as cells and the caption. With `grid` there is a dot at every step of a grid,
    whose length is the caption, and robots are arrows of dots, which show the heading to a few
    degrees but no name.
    """
    columns, rows = size[0], size[1] - 1
    view = _View(columns, rows, list(_points(plane)))
    trails, arrows, points = Canvas(columns, rows), Canvas(columns, rows), Canvas(columns, rows)
    if grid:
        view.mark(points)
    for robot in plane.robots:
        dots = [view.place(point) for point in robot.trail if _is_near(point)]
        for start, end in pairwise(
            dot for dot, _ in groupby((round(x), round(y)) for x, y in dots)
        ):
            trails.line(*start, *end)
        if grid and not ascii and _is_near((robot.x, robot.y)) and math.isfinite(robot.yaw):
            _arrow(arrows, *view.place((robot.x, robot.y)), robot.yaw)
    for point in filter(_is_near, plane.seen):
        x, y = view.place(point)
        trails.dot(round(x), round(y))
    layers = zip(arrows.cells, trails.cells, points.cells, strict=True)
    cells = [_cell(arrow, trail, point, ascii) for arrow, trail, point in layers]
    lines = [cells[row * columns : (row + 1) * columns] for row in range(rows)]
    for goal in plane.goals:
        _put(lines, view, goal, GOAL)
    for point in plane.objects.values():
        _put(lines, view, point, ASCII_OBJECT if ascii else OBJECT)
    robots = plane.robots if ascii or not grid else ()
    for robot in robots:
        _put(
            lines, view, (robot.x, robot.y), (ASCII_ARROWS if ascii else ARROWS)[_eighth(robot.yaw)]
        )
    for name, point in [
        *((robot.name, (robot.x, robot.y)) for robot in robots),
        *plane.objects.items(),
    ]:
        _label(lines, view, point, name)
    return lines, f"grid {view.step:g} m" if grid else _caption(plane, view, columns, ascii)


class _View:
    """Metres to dots: the same scale both ways, with everything in view.

    Its centre lies on the grid and its scale is a round number, so the picture does not move with
    the robot.
    """

    def __init__(self, columns: int, rows: int, points: list[Point]) -> None:
        self.columns, self.rows = columns, rows
        self.centre, self.step = (0.0, 0.0), FINEST
        spans = [(min(axis), max(axis)) for axis in zip(*points, strict=True)]
        halves = max(1, columns - MARGIN), max(1, 2 * rows - MARGIN)  # dots to either side
        for self.step in _steps(FINEST) if spans else ():
            x, y = (round((low + high) / 2 / self.step) * self.step for low, high in spans)
            self.centre = x, y
            reach = [
                max(high - middle, middle - low)
                for (low, high), middle in zip(spans, (x, y), strict=True)
            ]
            if all(far * self.scale <= half for far, half in zip(reach, halves, strict=True)):
                break

    @property
    def scale(self) -> float:
        """Dots a metre."""
        return STEP / self.step

    def place(self, point: Point) -> Point:
        """The dot of a point; y points down there."""
        x, y = (
            (value - centre) * self.scale for value, centre in zip(point, self.centre, strict=True)
        )
        return self.columns + x, 2 * self.rows - y

    def mark(self, canvas: Canvas) -> None:
        """A dot at every step; the centre is on one."""
        for x in range(self.columns % STEP, canvas.width, STEP):
            for y in range(2 * self.rows % STEP, canvas.height, STEP):
                canvas.dot(x, y)


def _arrow(canvas: Canvas, x: float, y: float, yaw: float) -> None:
    corners = [
        (x + far * math.cos(yaw + angle), y - far * math.sin(yaw + angle)) for far, angle in ARROW
    ]
    for corner in corners[1:]:
        canvas.line(*corners[0], *corner)
        canvas.line(x, y, *corner)
    canvas.line(x, y, *corners[0])


def _cell(arrow: int, trail: int, grid: int, ascii: bool) -> Cell:
    """The cell in the style of its topmost layer."""
    if arrow:
        return "sign", glyph(arrow | trail | grid)
    if trail:
        return "trail", glyph(trail if ascii else trail | grid, ascii)
    if grid:
        return "grid", ASCII_GRID if ascii else glyph(grid)
    return "", " "


def _points(plane: Plane) -> Iterable[Point]:
    everything = [
        *plane.goals,
        *plane.objects.values(),
        *((robot.x, robot.y) for robot in plane.robots),
    ]
    everything += plane.seen
    for robot in plane.robots:
        everything += robot.trail
    return filter(_is_near, everything)


def _is_near(point: Point) -> bool:
    return abs(point[0]) < FARTHEST and abs(point[1]) < FARTHEST  # a NaN is not


def _eighth(yaw: float) -> int:
    """The index of the arrow in the robot's heading."""
    return round(math.remainder(yaw, math.tau) / (math.pi / 4)) % 8 if math.isfinite(yaw) else 0


def _place(lines: list[list[Cell]], view: _View, point: Point) -> tuple[int, int] | None:
    """Row and column of a point; None if it is not in the picture."""
    if not _is_near(point):
        return None
    x, y = view.place(point)
    row, column = round(y) // 4, round(x) // 2
    return (row, column) if 0 <= row < len(lines) and 0 <= column < len(lines[row]) else None


def _put(lines: list[list[Cell]], view: _View, point: Point, sign: str) -> None:
    """Draw a sign at a point."""
    if place := _place(lines, view, point):
        lines[place[0]][place[1]] = "sign", sign


def _label(lines: list[list[Cell]], view: _View, point: Point, name: str) -> None:
    """Write a name beside the sign at a point, right or left of it, or else in the nearest row with
    room, so that it covers no other sign or name. It is cut only if it is longer than a row.
    """
    if not name or not (place := _place(lines, view, point)):
        return
    row, column = place
    columns = len(lines[row])
    name = name[:columns]
    inside = min(column, columns - len(name))  # where it begins in another row
    beside = [(row, column + 1), (row, column - len(name))]
    others = sorted(range(len(lines)), key=lambda other: abs(other - row))
    for at, start in [*beside, *((other, inside) for other in others)]:
        span = lines[at][max(start, 0) : start + len(name)]
        if start >= 0 and len(span) == len(name) and all(kind != "sign" for kind, _ in span):
            lines[at][start : start + len(name)] = [("sign", letter) for letter in name]
            return


def _caption(plane: Plane, view: _View, columns: int, ascii: bool) -> str:
    """A scale bar, a legend of the signs, and the note."""
    metres = next(m for m in _steps(1e-3) if m * view.scale / 2 >= 8)
    bar = f"|{('-' if ascii else '─') * (round(metres * view.scale / 2) - 1)}| {metres:g} m"
    signs = [f"{GOAL} goal"] if plane.goals else []
    signs += [f"{ASCII_OBJECT if ascii else OBJECT} object"] if plane.objects else []
    return "   ".join(part for part in (bar, *signs, plane.note) if part)[:columns]


def _steps(least: float) -> Iterable[float]:
    """1, 2, 5, 10 ... metres, from the least one on."""
    steps = (digit * 10.0**power for power in range(-3, 9) for digit in (1, 2, 5))
    return (step for step in steps if step >= least)
