"""The picture of the teleop for the README: a state that never changes, drawn by the view, the
screen and a terminal.

`python -m tests.core.teleop.picture` prints it as SVG.
"""

import html
import math
import re
import sys
from collections.abc import Callable
from itertools import groupby

import pyte
from prompt_toolkit.application import Application
from prompt_toolkit.input import DummyInput
from prompt_toolkit.layout import Layout

from services.teleop.control.layout_file import load
from services.teleop.screen import STYLE, Picture, TerminalOutput
from services.teleop.view import Line, Source, State, render

COLUMNS, ROWS = 80, 24
WIDE, HIGH = 9, 19  # units of a character
EDGE, BAR = 20, 38  # units around the text, and of the window's bar above it
BACK, FRONT = "#11151c", "#d7dce4"
FONTS = "ui-monospace, SFMono-Regular, Menlo, Consolas, DejaVu Sans Mono, monospace"
COLORS = {
    "green": "#5fd38d",
    "cyan": "#4fc3f7",
    "red": "#ff6b6b",
    "brightblack": "#7d8899",
    "default": FRONT,
}
# left, width, height
BLOCKS = {"▄": (0, WIDE, 9), "▖": (0, 4.5, 9), "▗": (4.5, 4.5, 9), "▁": (0, WIDE, 2)}
# column and row of each bit of a braille letter
DOTS = ((0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3))


def scene() -> State:
    """A robot that has driven most of a figure of eight, and is being driven."""
    way = [index / 300 * math.tau for index in range(252)]
    trail = [(1.5 * math.sin(t), 0.95 * math.sin(2 * t)) for t in way]
    (x0, y0), (x, y) = trail[-2:]
    me = "teleop@1a2b3c"
    return State(
        robot="Fred",
        others=["Barney"],
        mode="hold",
        why="this terminal reports key releases",
        speed=0.5,
        turn=1.0,
        speed_limit=1.5,
        turn_limit=3.0,
        command=(0.5, 0.25, -1.0),
        measured=(0.4712, 0.2214, -0.8126),
        odom_age=0.012,
        stale=False,
        round_trip=0.00061,
        real_time_factor=1.0,
        listeners=["sim", "recorder"],
        sources=[
            Source(me, "INTERACTIVE_HIGH", 20.0, obeyed=True),
            Source("controller@9f8e7d", "DATA_LOW", 20.0, held=True),
        ],
        obeyed=me,
        held=True,
        source=me,
        key="Fred/cmd_vel",
        keys=load("ttk").help,
        pose=(x, y, math.atan2(y - y0, x - x0)),
        trail=trail,
    )


class Drawing:
    """Pictures on a terminal of this size, columns and rows; `write` gets what is drawn."""

    def __init__(
        self, write: Callable[[str], None], size: tuple[int, int], colour: bool = True
    ) -> None:
        self.size = size
        self._picture = Picture()
        output = TerminalOutput(write, lambda: self.size, colour)
        self._app: Application[None] = Application(
            layout=Layout(self._picture),
            style=STYLE,
            full_screen=True,
            input=DummyInput(),
            output=output,
        )

    def draw(self, lines: list[Line]) -> None:
        """Show these lines."""
        self._picture.lines = lines
        self._app.renderer.render(self._app, self._app.layout)

    def forget(self) -> None:
        """Treat the screen's content as unknown from now on."""
        self._app.renderer.reset(leave_alternate_screen=False)


def terminal(state: State, columns: int = COLUMNS, rows: int = ROWS) -> pyte.Screen:
    """A terminal that shows `state`."""
    screen = pyte.Screen(columns, rows)
    stream = pyte.Stream(screen)
    # pyte does not know faint letters; they are grey ones here.
    drawing = Drawing(
        lambda text: stream.feed(text.replace("\x1b[0;2m", "\x1b[0;90m")), (columns, rows)
    )
    drawing.draw(render(state, columns, rows))
    return screen


def svg(screen: pyte.Screen) -> str:
    """The terminal's text as a picture. Blocks and braille are shapes, so that no font can move
    them.
    """
    width, height = COLUMNS * WIDE + 2 * EDGE, ROWS * HIGH + EDGE + BAR + 8
    body: list[str] = []
    shapes: dict[str, list[str]] = {}
    for row in range(ROWS):
        cells = [screen.buffer[row][column] for column in range(COLUMNS)]
        column = 0
        for look, run in groupby(cells, lambda cell: (cell.fg, cell.bold, cell.reverse)):
            text = "".join(cell.data for cell in run)
            body += _run(text, *look, EDGE + column * WIDE, BAR + row * HIGH, shapes)
            column += len(text)
    return "\n".join([*_window(width, height), *body, *_shapes(shapes), "</svg>", ""])


def _window(width: int, height: int) -> list[str]:
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}"'
        f' font-size="15" font-family="{FONTS}">',
        "<title>The teleop of holozen in a terminal: velocities as bars, who drives, the keys, "
        "and a map</title>",
        "<style>.b { font-weight: bold }</style>",
        f'<rect width="{width}" height="{height}" rx="10" fill="{BACK}"/>',
        *(f'<circle cx="{x}" cy="19" r="6" fill="#3a4352"/>' for x in (24, 44, 64)),
    ]


def _run(
    text: str, color: str, bold: bool, reverse: bool, x: int, y: int, shapes: dict[str, list[str]]
) -> list[str]:
    """The letters of one style, word by word so that each stands in its column; blocks and dots go
    to `shapes`.
    """
    fill, drawn = COLORS[color], []
    if reverse:
        drawn.append(
            f'<rect x="{x}" y="{y}" width="{len(text) * WIDE}" height="{HIGH}" fill="{fill}"/>'
        )
        fill = BACK
    column = 0
    for is_shape, run in groupby(text, lambda letter: letter > "~"):
        part = "".join(run)
        if is_shape:
            for index, letter in enumerate(part):
                _shape(letter, x + (column + index) * WIDE, y, fill, shapes)
        else:
            drawn += _words(
                part, x + column * WIDE, y, f'fill="{fill}"' + (' class="b"' if bold else "")
            )
        column += len(part)
    return drawn


def _words(text: str, x: int, y: int, look: str) -> list[str]:
    """Words with one blank between them stay together; each such group is given its width."""
    return [
        f'<text x="{x + found.start() * WIDE}" y="{y + 14}" textLength="{len(found[0]) * WIDE}" '
        f"{look}>"
        f"{html.escape(found[0], quote=False)}</text>"
        for found in re.finditer(r"\S+(?: \S+)*", text)
    ]


def _shape(letter: str, x: int, y: int, fill: str, shapes: dict[str, list[str]]) -> None:
    """One character of dots or blocks; the dots are strokes of no length with round ends."""
    if letter in BLOCKS:
        left, wide, high = BLOCKS[letter]
        shapes.setdefault(fill, []).append(
            f"M{x + left:g} {y + 15 - high}h{wide:g}v{high}h-{wide:g}z"
        )
        return
    drawn = shapes.setdefault(f"{fill} dots", [])
    for bit, (column, row) in enumerate(DOTS):
        if (ord(letter) - 0x2800) >> bit & 1:
            drawn.append(f"M{x + 2.25 + 4.5 * column:g} {y + 2.4 + 4.75 * row:g}h0")


def _shapes(shapes: dict[str, list[str]]) -> list[str]:
    drawn = []
    for look, parts in shapes.items():
        fill, _, dots = look.partition(" ")
        paint = (
            f'stroke="{fill}" stroke-width="3.2" stroke-linecap="round"'
            if dots
            else f'fill="{fill}"'
        )
        drawn.append(f'<path {paint} d="{"".join(parts)}"/>')
    return drawn


if __name__ == "__main__":
    sys.stdout.write(svg(terminal(scene())))
