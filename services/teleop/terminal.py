"""The terminal itself: its modes, its bytes, its size. Left as it was found, however the teleop ends."""

import contextlib
import os
import select
import sys
import termios
import time
from typing import Any, Self

FULL = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"  # a screen of its own without a cursor
REPORTS = "\x1b[?2004h\x1b[?1004h", "\x1b[?1004l\x1b[?2004l"  # pastes and the focus are told apart from keys
ASK_KEYBOARD, ASK_TERMINAL, ASK_ALIVE = "\x1b[?u", "\x1b[c", "\x1b[5n"
# Of the Kitty protocol: unambiguous codes, releases, the key's place on a US keyboard, all keys.
RELEASES_ON, RELEASES_SET, RELEASES_OFF = "\x1b[>15u", "\x1b[=15;1u", "\x1b[<u"
FAREWELL = 0.1  # s for answers that are on their way; they would be typed into the shell
MOST = 65536  # bytes read at once


class Terminal:
    """Keys in, picture out, in `with`. `full`: on a screen of its own."""

    def __init__(self, full: bool = True) -> None:
        self.releases = False  # whether it was told to tell them
        self._full = full
        self._in = sys.stdin.fileno()
        self._out = _writer(sys.stdout.fileno())
        self._before: list[Any] = []
        self._unsent = b""
        self._asked = 0  # questions without an answer

    def __enter__(self) -> Self:
        try:
            self.enter()
        except BaseException:
            self.leave()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        self.leave()

    def enter(self) -> None:
        """Take the terminal. What was typed before is dropped."""
        if not self._before:
            self._before = termios.tcgetattr(self._in)
        modes = termios.tcgetattr(self._in)
        modes[0] &= ~(termios.IXON | termios.ICRNL | termios.INLCR | termios.IGNCR | termios.ISTRIP | termios.BRKINT)
        modes[3] &= ~(termios.ICANON | termios.ECHO | termios.ISIG | termios.IEXTEN)
        modes[6][termios.VMIN], modes[6][termios.VTIME] = 1, 0
        termios.tcsetattr(self._in, termios.TCSAFLUSH, modes)
        self.greet()

    def greet(self) -> None:
        """Set up what shows the picture and sends the keys, and ask what it is; it may have changed."""
        self.write((FULL[0] if self._full else "") + REPORTS[0])
        self.ask(ASK_KEYBOARD + ASK_TERMINAL)

    def leave(self) -> None:
        """Give it back. A terminal that is gone is no reason to fail."""
        if not self._before:
            return
        with contextlib.suppress(OSError, termios.error):
            self.write((RELEASES_OFF if self.releases else "") + REPORTS[1] + (FULL[1] if self._full else ""))
            self._flush(time.monotonic() + FAREWELL)
            self._hear_answers(time.monotonic() + FAREWELL)
            termios.tcsetattr(self._in, termios.TCSAFLUSH, self._before)
        self.releases, self._before, self._unsent = False, [], b""

    def fileno(self) -> int:
        """For select."""
        return self._in

    def read(self) -> bytes:
        """What was typed; waits for it. Raises OSError when the terminal is gone."""
        if not (data := os.read(self._in, MOST)):
            raise OSError("the terminal was closed")
        return data

    def ask(self, question: str) -> None:
        """Send a question that it answers."""
        self._asked += 1
        self.write(question)

    def answered(self) -> None:
        """A question was answered."""
        self._asked = max(0, self._asked - 1)

    def tell_releases(self, flags: int) -> None:
        """Have it tell releases; `flags` are those that are on."""
        if not self.releases:
            self.write(RELEASES_ON)
        elif flags != 15:
            self.write(RELEASES_SET)  # it is another terminal than before: somebody attached anew
        self.releases = True

    def tell_no_releases(self) -> None:
        """Have it send plain keys again."""
        if self.releases:
            self.write(RELEASES_OFF)
        self.releases = False

    def write(self, text: str) -> None:
        """Show text. Never waits: what the terminal does not take now is sent later."""
        self._unsent += text.encode()
        self.ready()

    def ready(self) -> bool:
        """Whether it took all that was written."""
        while self._unsent:
            try:
                sent = os.write(self._out, self._unsent)
            except BlockingIOError:
                return False
            self._unsent = self._unsent[sent:]
        return True

    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        try:
            rows, columns = termios.tcgetwinsize(self._in)
        except termios.error:
            return 80, 24
        return columns or 80, rows or 24

    def _flush(self, until: float) -> None:
        while not self.ready() and (left := until - time.monotonic()) > 0:
            select.select([], [self._out], [], left)

    def _hear_answers(self, until: float) -> None:
        while self._asked and (left := until - time.monotonic()) > 0:
            if select.select([self._in], [], [], left)[0]:
                self._asked -= self.read().count(b"\x1b[")


def _writer(fileno: int) -> int:
    """A descriptor of the same terminal that never blocks; ours is shared with the shell, which wants it to."""
    try:
        return os.open(os.ttyname(fileno), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return fileno
