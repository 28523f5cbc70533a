"""What is drawn over and over in a terminal: pictures of text, and single lines."""

import contextlib
import os
import sys
from types import TracebackType
from typing import Self

from holozen.tell import printable

EVERY = {True: 0.1, False: 1.0}  # s between two pictures, in a terminal and elsewhere
SIZE = (80, 24)
_BEGIN, _END = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"  # a screen of its own without a cursor, and back


class Line:
    """A line on standard error that is written over. Where there is no terminal, nobody sees it."""

    def __init__(self, hidden: bool = False) -> None:
        self.shown = sys.stderr.isatty() and not hidden

    def show(self, text: str) -> None:
        """Write it over the last one."""
        if self.shown:
            with contextlib.suppress(OSError):  # the terminal is gone, and SIGHUP follows
                sys.stderr.write(f"\r{printable(text)}\x1b[K")
                sys.stderr.flush()


class Screen:
    """Pictures, one after the other without a terminal. Use it in `with`: a terminal is given back as it was."""

    def __init__(self, once: bool, ascii: bool = False) -> None:
        self.terminal = sys.stdout.isatty() and not once
        self.every = EVERY[self.terminal]
        encoding = (sys.stdout.encoding or "").lower().replace("-", "")
        self.ascii = ascii or encoding != "utf8"

    def __enter__(self) -> Self:
        self._write(_BEGIN)
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _: TracebackType | None
    ) -> None:
        self._write(_END)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the terminal; 80 x 24 where there is none."""
        if not self.terminal:
            return SIZE
        columns, rows = os.get_terminal_size(sys.stdout.fileno())
        return max(columns, 20), max(rows, 4)

    def show(self, lines: list[str]) -> None:
        """Draw a picture."""
        if self.terminal:
            # Line by line over the old one: a cleared screen would flicker.
            self._write("\x1b[H" + "\x1b[K\r\n".join(lines[: self.size[1]]) + "\x1b[K\x1b[J")
        else:
            print("\n".join(line.rstrip() for line in lines), flush=True)

    def _write(self, text: str) -> None:
        if not self.terminal:
            return
        try:
            sys.stdout.write(text)
            sys.stdout.flush()
        except OSError:  # the terminal is gone: as quiet as with a closed pipe
            raise BrokenPipeError from None
