"""Lines to a terminal: only what changed since the last picture, in one write."""

from collections.abc import Callable

from .state import Line

COLORS = {"title": "1;7", "driving": "1;36", "good": "32", "warning": "1;31", "dim": "2", "alarm": "1;7;31"}
PLAIN = {"title": "1;7", "driving": "1", "warning": "1", "dim": "2", "alarm": "1;7"}
"""SGR codes of the styles, with colours and for those who want none (NO_COLOR)."""

# Synchronized update: a terminal that knows it shows the picture at once, others ignore it. Lines do not wrap
# meanwhile: a window that was made smaller just now shows them cut.
BEGIN, END = "\x1b[?2026h\x1b[?7l", "\x1b[?7h\x1b[?2026l"


class Painter:
    """Keeps what the terminal shows. `write` gets whole updates; it must write all of what it is given, or raise."""

    def __init__(self, write: Callable[[str], None], color: bool = True) -> None:
        self._write, self._codes = write, COLORS if color else PLAIN
        self._shown: list[Line] | None = None
        self._size = (0, 0)

    def forget(self) -> None:
        """The terminal may show anything now: the next picture is painted whole."""
        self._shown = None

    def paint(self, lines: list[Line], columns: int, rows: int) -> None:
        """Show `lines` in a terminal of this size; what is below them is blank."""
        if self._size != (columns, rows):
            self.forget()
        lines = lines[:rows]
        old, self._shown = self._shown, None  # unknown, if the write fails halfway
        changed = self._whole(lines, columns, rows) if old is None else self._changes(old, lines)
        if changed:
            self._write(f"{BEGIN}{changed}{END}")
        self._shown, self._size = lines, (columns, rows)

    def _whole(self, lines: list[Line], columns: int, rows: int) -> str:
        text = "".join(self._line(row, line, erase=_width(line) < columns) for row, line in enumerate(lines))
        return text + (f"\x1b[{len(lines) + 1}H\x1b[m\x1b[J" if len(lines) < rows else "")

    def _changes(self, old: list[Line], new: list[Line]) -> str:
        return "".join(
            self._change(row, old[row] if row < len(old) else [], new[row] if row < len(new) else [])
            for row in range(max(len(old), len(new)))
        )

    def _change(self, row: int, old: Line, new: Line) -> str:
        """From the first part that differs to the last one."""
        if old == new:
            return ""
        first, shrunk = _agree(old, new), _width(new) < _width(old)
        last = len(new)
        if _width(new) == _width(old):
            last -= _agree(old[first:][::-1], new[first:][::-1])
        return self._line(row, new[first:last], _width(new[:first]), erase=shrunk)

    def _line(self, row: int, line: Line, column: int = 0, *, erase: bool) -> str:
        """Erased after it, not before: but never at the last column, where that would take what was just written."""
        text, last = [f"\x1b[{row + 1};{column + 1}H"], None
        for style, words in line:
            if style != last:
                text.append(f"\x1b[0;{self._codes[style]}m" if style in self._codes else "\x1b[m")
                last = style
            text.append(words)
        text.append("\x1b[m\x1b[K" if erase else "\x1b[m")
        return "".join(text)


def _width(line: Line) -> int:
    return sum(len(text) for _, text in line)


def _agree(one: Line, other: Line) -> int:
    """How many parts are the same at the start of both."""
    parts = zip(one, other, strict=False)
    return next((count for count, (left, right) in enumerate(parts) if left != right), min(len(one), len(other)))
