"""Shapes as lists of goals: x, y in metres, theta in radians, odom frame. Each begins and ends at
the origin.
"""

import math
from collections.abc import Callable
from pathlib import Path

Goal = tuple[float, float, float]
Point = tuple[float, float]

INFINITY_POINTS = 24
MAX_VALUE = 1e6  # m, rad
MAX_TEXT = 1_000_000  # characters of a file of goals; a device may have no end


class GoalsError(ValueError):
    """A list of goals that cannot be used. The text is one line with the reason."""


def square(size: float) -> list[Goal]:
    """A square with sides of `size`."""
    return _tour([(0, 0), (size, 0), (size, size), (0, size)])


def triangle(size: float) -> list[Goal]:
    """An equilateral triangle with sides of `size`."""
    return _tour([(0, 0), (size, 0), (size / 2, size * math.sqrt(3) / 2)])


def rectangle(size: float) -> list[Goal]:
    """A rectangle of `size` by half of that."""
    return _tour([(0, 0), (size, 0), (size, size / 2), (0, size / 2)])


def hexagon(size: float) -> list[Goal]:
    """A regular hexagon with sides of `size`."""
    corners, x, y = [], 0.0, 0.0
    for side in range(6):
        corners.append((x, y))
        x, y = x + size * math.cos(side * math.pi / 3), y + size * math.sin(side * math.pi / 3)
    return _tour(corners)


def infinity(size: float) -> list[Goal]:
    """A lemniscate of Gerono, `size` to each side: x = size sin t, y = size sin t cos t."""
    steps = [i * math.tau / INFINITY_POINTS for i in range(INFINITY_POINTS)]
    return _tour([(size * math.sin(t), size * math.sin(t) * math.cos(t)) for t in steps])


SHAPES: dict[str, Callable[[float], list[Goal]]] = {
    "square": square,
    "triangle": triangle,
    "rectangle": rectangle,
    "infinity": infinity,
    "hexagon": hexagon,
}


def _tour(corners: list[Point]) -> list[Goal]:
    """From the first corner to all others and back. At each goal the robot faces the next one."""
    goals = []
    for here, ahead in zip(corners[1:] + corners[:1], corners[2:] + corners[:2], strict=True):
        goals.append((*here, math.atan2(ahead[1] - here[1], ahead[0] - here[0])))
    return goals


def read_goals(path: Path) -> list[Goal]:
    """The goals in a text file, an `x y theta` on each line: commas count as spaces, theta is
    optional, and # begins a comment. Raises GoalsError.
    """
    try:
        with path.open() as file:
            text = file.read(MAX_TEXT + 1)
    except OSError as error:
        raise GoalsError(f"goals {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise GoalsError(f"goals {path}: not a text in UTF-8") from None
    if len(text) > MAX_TEXT:
        raise GoalsError(f"goals {path}: more than {MAX_TEXT:,} characters; give a shorter file")
    lines = text.splitlines()
    goals = [
        _goal(line, f"{path}:{number}") for number, line in enumerate(lines, 1) if _content(line)
    ]
    if not goals:
        raise GoalsError(f"goals {path}: no goals; write one x y theta per line")
    return goals


def _content(line: str) -> list[str]:
    return line.partition("#")[0].replace(",", " ").split()


def _goal(line: str, where: str) -> Goal:
    try:
        values = [float(part) for part in _content(line)]
    except ValueError:
        values = []
    if len(values) not in (2, 3) or not all(abs(value) <= MAX_VALUE for value in values):
        raise GoalsError(
            f"goals {where}: {line.strip()!r}; write x y theta in metres and radians, such as 1.0 "
            "0 1.57"
        )
    return values[0], values[1], values[2] if len(values) == 3 else 0.0
