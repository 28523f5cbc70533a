"""A small map of where the robot is, which way it faces and where it came from."""

import itertools
import math
from collections.abc import Iterator, Sequence

from holozen.braille import Canvas, glyph

from .state import Line, State
from .words import number

GRID = 12  # dots from one point of the grid to the next; a whole number of characters both ways
FINEST = 0.5  # m between the points of the grid
MARGIN = 4  # dots that the arrow needs around the robot's centre
FARTHEST = 1e6  # m; what claims to be beyond it is not drawn
ARROW = ((5.0, 0.0), (4.0, 2.5), (4.0, -2.5))  # dots and radians from the centre: tip, and the two ends of the tail
Point = tuple[float, float]


def chart(state: State, columns: int, rows: int) -> list[Line]:
    """The map, `rows` lines of `columns` characters, the last with its scale. North of it is y of odom, east is x."""
    pose, trail = _seen(state)
    rows -= 1
    if columns < 8 or rows < 2:
        return []
    view = _View(columns, rows, [*trail, *([pose[:2]] if pose else [])])
    grid, path, robot = view.grid(), view.path(trail), Canvas(columns, rows)
    if pose:
        _arrow(robot, *view.place(pose[:2]), pose[2])
    lines = [_row(state, row, grid, path, robot) for row in range(rows)]
    if pose and state.ascii:
        _letter(lines, *view.place(pose[:2]), pose[2])
    return [*lines, _caption(pose, view.step, columns)]


class _View:
    """Which part of the plane is shown: its centre, and the step of the grid in metres."""

    def __init__(self, columns: int, rows: int, points: Sequence[Point]) -> None:
        self.columns, self.rows = columns, rows
        self.centre, self.step = (0.0, 0.0), FINEST
        if not points:
            return
        spans = [(min(axis), max(axis)) for axis in zip(*points, strict=True)]
        halves = max(1, columns - MARGIN), max(1, 2 * rows - MARGIN)  # dots to either side
        for self.step in _steps():
            x, y = (round((low + high) / 2 / self.step) * self.step for low, high in spans)
            self.centre = x, y
            reach = [max(high - middle, middle - low) for (low, high), middle in zip(spans, (x, y), strict=True)]
            if all(far * GRID / self.step <= half for far, half in zip(reach, halves, strict=True)):
                return

    def place(self, point: Point) -> Point:
        """Metres to dots; y points up there and down here."""
        scale = GRID / self.step
        return self.columns + (point[0] - self.centre[0]) * scale, 2 * self.rows - (point[1] - self.centre[1]) * scale

    def grid(self) -> Canvas:
        """A dot at every step; the centre is on one."""
        canvas = Canvas(self.columns, self.rows)
        for x in range(self.columns % GRID, canvas.width, GRID):
            for y in range(2 * self.rows % GRID, canvas.height, GRID):
                canvas.dot(x, y)
        return canvas

    def path(self, trail: Sequence[Point]) -> Canvas:
        """The way through all points."""
        canvas = Canvas(self.columns, self.rows)
        scale, (x0, y0) = GRID / self.step, self.place((0.0, 0.0))
        dots = [(round(x0 + x * scale), round(y0 - y * scale)) for x, y in trail]
        dots = [dot for dot, _ in itertools.groupby(dots)]
        for start, end in itertools.pairwise(dots):
            canvas.line(*start, *end)
        return canvas


def _steps() -> Iterator[float]:
    """0.5, 1, 2, 5, 10 ... metres, as far as there may be something."""
    for power in range(-1, 7):
        yield from (digit * 10.0**power for digit in (1, 2, 5) if digit * 10.0**power >= FINEST)


def _seen(state: State) -> tuple[tuple[float, float, float] | None, list[Point]]:
    """The pose and the trail without what is no place."""
    trail = [point for point in state.trail if abs(point[0]) < FARTHEST and abs(point[1]) < FARTHEST]
    pose = state.pose
    if pose and not (abs(pose[0]) < FARTHEST and abs(pose[1]) < FARTHEST and math.isfinite(pose[2])):
        pose = None
    return pose, trail


def _arrow(canvas: Canvas, x: float, y: float, yaw: float) -> None:
    corners = [(x + far * math.cos(yaw + angle), y - far * math.sin(yaw + angle)) for far, angle in ARROW]
    for corner in corners[1:]:
        canvas.line(*corners[0], *corner)
        canvas.line(x, y, *corner)
    canvas.line(x, y, *corners[0])


def _row(state: State, row: int, grid: Canvas, path: Canvas, robot: Canvas) -> Line:
    """One line of the three layers; a character has the style of the topmost layer with a dot in it."""
    span = slice(row * grid.columns, (row + 1) * grid.columns)
    below, over = "good" if state.known else "dim", "driving" if state.known else "dim"
    if not (state.ascii or any(path.cells[span]) or any(robot.cells[span])):
        return [("dim", "".join(map(glyph, grid.cells[span])))]
    layers = zip(grid.cells[span], path.cells[span], robot.cells[span], strict=True)
    if state.ascii:
        letters = [("", glyph(p, True)) if p else ("dim", "+") if g else ("", " ") for g, p, _ in layers]
    else:
        letters = [(over if r else below if p else "dim" if g else "", glyph(g | p | r)) for g, p, r in layers]
    runs = itertools.groupby(letters, lambda letter: letter[0])
    return [(style, "".join(text for _, text in run)) for style, run in runs]


def _letter(lines: list[Line], x: float, y: float, yaw: float) -> None:
    """Put the robot on a map of ASCII: one letter that points its way."""
    row, column = int(y) // 4, int(x) // 2
    if not 0 <= row < len(lines):
        return
    text = "".join(words for _, words in lines[row])
    letter = ">^<v"[round(yaw / (math.pi / 2)) % 4]
    lines[row] = [("", text[:column]), ("driving", letter), ("", text[column + 1 :])]


def _caption(pose: tuple[float, float, float] | None, step: float, columns: int) -> Line:
    scale = f"grid {step:g} m"
    place = f"x {number(pose[0])} y {number(pose[1])}" if pose else "no pose yet"
    turned = f"  {math.degrees(math.remainder(pose[2], math.tau)):+.0f} deg" if pose else ""
    for text in (place + turned, place, ""):
        if len(text) + 2 + len(scale) <= columns:
            return [("", text), ("dim", scale.rjust(columns - len(text)))]
    return [("dim", scale[:columns].rjust(columns))]
