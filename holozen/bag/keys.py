"""The keys of who watches a bag being played."""

import contextlib
import os
import select
import sys
import threading
import time
from collections.abc import Iterator

from holozen.bag.player import PAUSE, STEP

STEPS = (b"s", b"\x1b[C", b"\x1bOC")  # s, and the right arrow as terminals send it


class TerminalKeys:
    """Space and the right arrow (or s), read from a terminal."""

    def __init__(self, number: int) -> None:
        self._number = number

    def read(self, timeout: float) -> str:
        """What was pressed within `timeout` seconds."""
        if not select.select([self._number], [], [], timeout)[0]:
            return ""
        try:
            pressed = os.read(self._number, 1)
            if pressed == b"\x1b" and select.select([self._number], [], [], 0)[0]:
                pressed += os.read(self._number, 2)
        except OSError:
            pressed = b""
        if not pressed:  # the terminal is gone; SIGHUP follows
            time.sleep(timeout)
        return meaning(pressed)


class NoKeys:
    """Nobody can press any."""

    def __init__(self, stop: threading.Event) -> None:
        self._stop = stop

    def read(self, timeout: float) -> str:
        """Wait until `timeout` is over, or the end."""
        self._stop.wait(timeout)
        return ""


def meaning(pressed: bytes) -> str:
    """PAUSE, STEP or "" for what a terminal sent."""
    return PAUSE if pressed == b" " else STEP if pressed in STEPS else ""


@contextlib.contextmanager
def keys(stop: threading.Event) -> Iterator[TerminalKeys | NoKeys]:
    """The keys of standard input, if that is a terminal which is ours. It is left as it was."""
    number = sys.stdin.fileno() if sys.stdin and sys.stdin.isatty() else -1
    if number < 0 or os.tcgetpgrp(number) != os.getpgrp():
        yield NoKeys(stop)
        return
    import termios
    import tty

    before = termios.tcgetattr(number)
    tty.setcbreak(number)
    try:
        yield TerminalKeys(number)
    finally:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(number, termios.TCSADRAIN, before)
