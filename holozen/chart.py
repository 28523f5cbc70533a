"""Numbers over time, as text. Pure: points in, lines out."""

from collections.abc import Mapping, Sequence

from holozen.braille import Canvas

LABEL = 10  # characters left of the picture, for the scale
LARGEST = 1e300  # what is beyond, or no number, is left out
LEAST_ROWS = 3  # of a panel: its title, and two of picture
Point = tuple[float, float]


def panels(
    series: Mapping[str, Sequence[Point]], now: float, window: float, size: tuple[int, int], ascii: bool = False
) -> list[str]:
    """One panel for each name, one under the other, over the last `window` seconds. `size`: columns and rows.

    Points are (seconds, value), the oldest first. Where there is no room for all, the last ones are left out.
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
        return [f"{name}: nothing came"] + [""] * (rows - 1)
    low, high = _range([value for _, value in points])
    canvas = Canvas(columns - LABEL, rows - 1)
    right, bottom = canvas.width - 1, canvas.height - 1
    dots = [(right * (1 - (now - t) / window), bottom * (high - v) / (high - low)) for t, v in points]
    for (x0, y0), (x1, y1) in zip(dots, dots[1:] or dots, strict=False):
        canvas.line(x0, y0, x1, y1)
    labels = [""] * (rows - 1)
    labels[0], labels[-1] = _short(high), _short(low)
    title = f"{name}: {points[-1][1]:.6g}"
    return [title, *(f"{label:>{LABEL - 1}} {row}" for label, row in zip(labels, canvas.lines(ascii), strict=True))]


def _range(values: list[float]) -> tuple[float, float]:
    """The lowest and highest number of the scale; a line that stays level is in the middle."""
    low, high = min(values), max(values)
    # Less than this is noise of the numbers themselves.
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
