"""Command and measured velocity side by side, each as a number and a bar."""

import math

from holozen.limits import Planar

from .state import Line, State
from .words import amount, number

NUMBER = 7  # characters
AXES = (("x forward", "x", "m/s"), ("y left", "y", "m/s"), ("turn left", "turn", "rad/s"))
SHORT = 39  # columns that the bars need at least
LONG = 72  # columns from which on the axes have their long names and units


def table(state: State, columns: int) -> list[Line]:
    """Five lines: a header, one for each of x, y and turn, and the speeds that are set with their limits."""
    long = columns >= LONG
    label, unit, gap = (11, 6, 3) if long else (6, 0, 1)
    cells = min(41, max(3, (columns - label - unit - gap) // 2 - NUMBER))
    cells -= 1 - cells % 2  # one in the middle is zero
    half = cells + NUMBER + gap
    measured = state.measured if state.known else None
    lines = [_header(state, label, half)]
    for axis, (full, short, of) in enumerate(AXES):
        most = _scale(state, axis)
        line = [("", f" {full if long else short}".ljust(label))]
        line += _cell(state.command, axis, most, cells, "driving", state.ascii)
        line += [("", " " * gap), *_cell(measured, axis, most, cells, "good", state.ascii)]
        lines.append([*line, ("dim", f" {of}")] if long else line)
    return [*lines, _settings(state, label + half if long else 0)]


def _header(state: State, label: int, half: int) -> Line:
    style, text = ("driving" if state.moving else "", "command") if state.command else ("dim", "command: silent")
    known = ("", "measured") if state.known else ("dim", "measured: unknown")
    return [("", " " * label), (style, text.ljust(half)), known]


def _settings(state: State, second: int) -> Line:
    """The turn begins at the column `second`, or where the speed ends."""
    speed, turn = amount(state.speed), amount(state.turn)
    most, fastest = f"{state.speed_limit:.4g}", f"{state.turn_limit:.4g}"
    if not second:
        return [("", f" speed {speed}"), ("dim", f" of {most}"), ("", f"  turn {turn}"), ("dim", f" of {fastest}")]
    parts = [("", f" speed     {speed}"), ("dim", f" m/s, limit {most}")]
    parts.append(("", " " * (second - sum(len(text) for _, text in parts))))
    return [*parts, ("", f"turn {turn}"), ("dim", f" rad/s, limit {fastest}")]


def _scale(state: State, axis: int) -> float:
    """What a full bar is: the speed that is set, or more if there is more. x and y have one scale."""
    axes, setting = ((2,), state.turn) if axis == 2 else ((0, 1), state.speed)
    shown = [state.command] if state.command else []
    shown += [state.measured] if state.known else []
    sizes = [abs(velocity[each]) for velocity in shown for each in axes]
    return max([setting, *(size for size in sizes if math.isfinite(size))])


def _cell(velocity: Planar | None, axis: int, most: float, cells: int, style: str, ascii: bool) -> Line:
    if velocity is None:
        return [*bar(0.0, cells, style, ascii), ("dim", "-".rjust(NUMBER))]
    value = velocity[axis]
    part = value / most if most > 0 and math.isfinite(value) else 0.0
    # Left is positive for y and for a turn, as in ROS; the bar goes where the robot goes.
    still = number(value) == number(0.0)
    return [
        *bar(part if axis == 0 else -part, cells, style, ascii),
        ("" if still else style, number(value).rjust(NUMBER)),
    ]


def bar(part: float, cells: int, style: str, ascii: bool = False) -> Line:
    """A bar of an odd number of cells from the middle to the right, or to the left for a part below zero (-1 to 1)."""
    full, half, rest = ("=", "=", "-") if ascii else ("▄", "▖" if part > 0 else "▗", "▁")
    side = cells // 2
    halves = min(2 * side, round(abs(part) * 2 * side))
    filled = full * (halves // 2) + half * (halves % 2)
    empty = rest * (side - len(filled))
    if part > 0:
        return [("dim", f"{rest * side}|"), (style, filled), ("dim", empty)]
    return [("dim", empty), (style, filled[::-1]), ("dim", f"|{rest * side}")]
