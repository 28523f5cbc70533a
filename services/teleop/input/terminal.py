"""The terminal: its modes, input, output and size. It is restored however the teleop ends."""

import contextlib
import os
import select
import sys
import termios
import time
from typing import Any, Self

from holozen.terminal import ASK_KEYBOARD, ASK_TERMINAL

# the alternate screen without a cursor
FULL = ("\x1b[?1049h\x1b[?25l\x1b[H", "\x1b[m\x1b[?7h\x1b[?25h\x1b[?1049l")
# brackets around pastes, and reports of focus changes
REPORTS = ("\x1b[?2004h\x1b[?1004h", "\x1b[?1004l\x1b[?2004l")
ASK_ALIVE = "\x1b[5n"
# The Kitty protocol, with unambiguous codes, releases, the key's place on a US keyboard, for all
# keys.
RELEASES_ON, RELEASES_SET, RELEASES_OFF = "\x1b[>15u", "\x1b[=15;1u", "\x1b[<u"
FAREWELL = 0.1  # s to wait at the end for pending replies, which would else reach the shell
MAX_READ = 65536  # bytes read at once


class Terminal:
    """A terminal, set up in a `with` block: stdin's, or that of `fileno`. `full`: on the alternate
    screen.
    """

    def __init__(self, full: bool = True, fileno: int | None = None) -> None:
        self.releases = False  # whether it has been asked to report key releases
        self._full = full
        self._in = sys.stdin.fileno() if fileno is None else fileno
        self._out = _writer(sys.stdout.fileno() if fileno is None else fileno)
        self._before: list[Any] = []
        self._unsent = b""
        self._asked = 0  # queries without a reply

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
        """Set up the terminal. Pending input is dropped."""
        if not self._before:
            self._before = termios.tcgetattr(self._in)
        modes = termios.tcgetattr(self._in)
        modes[0] &= ~(
            termios.IXON
            | termios.ICRNL
            | termios.INLCR
            | termios.IGNCR
            | termios.ISTRIP
            | termios.BRKINT
        )
        modes[3] &= ~(termios.ICANON | termios.ECHO | termios.ISIG | termios.IEXTEN)
        modes[6][termios.VMIN], modes[6][termios.VTIME] = 1, 0
        termios.tcsetattr(self._in, termios.TCSAFLUSH, modes)
        self.greet()

    def greet(self) -> None:
        """Set up screen and reports, and query the terminal's identity, which may have changed.
        Does nothing after `leave`, when a late signal may call it: the terminal is the shell's.
        """
        if not self._before:
            return
        self.write((FULL[0] if self._full else "") + REPORTS[0])
        self.ask(ASK_KEYBOARD + ASK_TERMINAL)

    def leave(self) -> None:
        """Restore the terminal, unless it is gone."""
        if not self._before:
            return
        with contextlib.suppress(OSError, termios.error):
            self.write(
                (RELEASES_OFF if self.releases else "")
                + REPORTS[1]
                + (FULL[1] if self._full else "")
            )
            self._flush(time.monotonic() + FAREWELL)
            self._hear_answers(time.monotonic() + FAREWELL)
            termios.tcsetattr(self._in, termios.TCSAFLUSH, self._before)
        self.releases, self._before, self._unsent = False, [], b""

    def fileno(self) -> int:
        """The descriptor to wait for input on."""
        return self._in

    def read(self) -> bytes:
        """The available input; blocks until there is some. Raises OSError if the terminal is
        gone.
        """
        if not (data := os.read(self._in, MAX_READ)):
            raise OSError("the terminal was closed")
        return data

    def ask(self, question: str) -> None:
        """Send a query, to which the terminal replies."""
        self._asked += 1
        self.write(question)

    def answered(self) -> None:
        """Count a reply to a query."""
        self._asked = max(0, self._asked - 1)

    def report_releases(self, flags: int) -> None:
        """Make it report key releases; `flags` are the protocol's flags that are on now."""
        if not self.releases:
            self.write(RELEASES_ON)
        elif flags != 15:
            self.write(RELEASES_SET)  # a different terminal was attached
        self.releases = True

    def send_plain_keys(self) -> None:
        """Make it send plain keys again."""
        if self.releases:
            self.write(RELEASES_OFF)
        self.releases = False

    def write(self, text: str) -> None:
        """Write text without blocking; the part that the terminal does not accept now is sent
        later.
        """
        self._unsent += text.encode()
        self.ready()

    def ready(self) -> bool:
        """Send pending text. Returns whether all of it has been sent."""
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
    """A descriptor of the same terminal that never blocks; the shell shares the given one, and
    needs it to block.
    """
    try:
        return os.open(os.ttyname(fileno), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return fileno
