"""What is seen: the picture, or a line a second."""

from .dials import Dials
from .painter import Painter
from .plain import line
from .terminal import Terminal
from .view import render

REDRAW, LINE_EVERY = 0.05, 1.0  # s


class Screen:
    """Shows the dials. `plain`: a line a second, for screen readers and logs. `ascii`: for terminals without more."""

    def __init__(self, terminal: Terminal, dials: Dials, plain: bool, ascii: bool, colour: bool) -> None:
        self._terminal, self._dials, self._plain, self._ascii = terminal, dials, plain, ascii
        self._painter = Painter(terminal.write, colour)
        self.due = 0.0  # when something is to be shown

    def show(self, now: float, why: str) -> None:
        """Show what is new, when it is due and the terminal takes it."""
        if now < self.due or not self._terminal.ready():
            return
        self.due = now + (LINE_EVERY if self._plain else REDRAW)
        state = self._dials.state(why, now, self._ascii)
        if self._plain:
            self._terminal.write(f"{line(state)}\r\n")
        else:
            columns, rows = self._terminal.size()
            self._painter.paint(render(state, columns, rows), columns, rows)

    def forget(self) -> None:
        """Show everything anew."""
        self.due = 0.0
        self._painter.forget()
