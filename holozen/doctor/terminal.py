"""What this terminal can do: the teleop and the pictures depend on it."""

import contextlib
import os
import re
import select
import sys
import time
from collections.abc import Iterator, Mapping
from typing import IO

from holozen.doctor.finding import OK, WARNING, Finding

PATIENCE = 0.3  # s for a terminal to answer; far away over ssh it may take longer
SMALL = (80, 24)  # columns, rows
ASK_KEYBOARD, ASK_TERMINAL = b"\x1b[?u", b"\x1b[c"  # of the Kitty protocol, and DA1, which every terminal answers
ANSWER = re.compile(rb"\x1b\[\?[\d;]*c")
KEYBOARD = re.compile(rb"\x1b\[\?\d+u")


def look(
    given: IO[str] | None = None, shown: IO[str] | None = None, environ: Mapping[str, str] = os.environ
) -> Iterator[Finding]:
    """The findings about the terminal of standard input and output."""
    given, shown = given or sys.stdin, shown or sys.stdout
    encoding = (getattr(shown, "encoding", "") or "ascii").lower().replace("-", "")
    if encoding != "utf8":
        mend = "export LANG=C.UTF-8 (or PYTHONUTF8=1)"
        yield Finding("terminal", WARNING, f"the encoding is {encoding}; braille pictures fall back to ASCII", mend)
    if not (_is_terminal(given) and _is_terminal(shown)):
        yield Finding("terminal", OK, "input or output is none, so its abilities are not looked at")
        return
    yield _size(shown.fileno())
    yield _colour(environ)
    yield _keys(given.fileno(), shown.fileno(), environ)


def _is_terminal(stream: IO[str]) -> bool:
    try:
        return stream.isatty()
    except (OSError, ValueError, AttributeError):  # closed
        return False


def _size(shown: int) -> Finding:
    columns, rows = os.get_terminal_size(shown)
    text = f"{columns} columns, {rows} rows"
    if columns >= SMALL[0] and rows >= SMALL[1]:
        return Finding("terminal", OK, text)
    return Finding("terminal", WARNING, f"{text}; pictures want {SMALL[0]} x {SMALL[1]}", "make the window larger")


def _colour(environ: Mapping[str, str]) -> Finding:
    term = environ.get("TERM", "")
    if term in ("", "dumb"):
        text = f"TERM is {term!r}, a terminal without cursor or colour"
        return Finding("terminal", WARNING, text, "export TERM=xterm-256color, if it can do more")
    if environ.get("NO_COLOR"):
        return Finding("terminal", OK, "no colour, as NO_COLOR asks")
    many = "16 million colours" if environ.get("COLORTERM") in ("truecolor", "24bit") else None
    return Finding("terminal", OK, many or ("256 colours" if "256" in term else "8 colours"))


def _keys(given: int, shown: int, environ: Mapping[str, str]) -> Finding:
    inside = "tmux" if environ.get("TMUX") else "screen" if environ.get("STY") else ""
    answer = ask(given, shown)
    if answer is None:
        return Finding("terminal", OK, "its keyboard is not asked: this runs in the background")
    if KEYBOARD.search(answer):
        return Finding("terminal", OK, f"it tells when a key is let go (Kitty protocol){inside and ', in ' + inside}")
    if not answer:
        return Finding(
            "terminal", WARNING, f"it answers no question within {PATIENCE:g} s{inside and ', in ' + inside}"
        )
    if inside:
        text = f"{inside} does not tell when a key is let go; the teleop goes by key repeat"
        return Finding("terminal", OK, text)
    return Finding("terminal", OK, "it does not tell when a key is let go; the teleop goes by key repeat")


def ask(given: int, shown: int) -> bytes | None:
    """What the terminal answers; None where asking would stop this process, as in the background."""
    import termios
    import tty

    try:
        if os.tcgetpgrp(given) != os.getpgrp():
            return None
        before = termios.tcgetattr(given)
    except (OSError, termios.error):
        return None
    try:
        tty.setcbreak(given, termios.TCSADRAIN)  # Ctrl-C still works
        os.write(shown, ASK_KEYBOARD + ASK_TERMINAL)
        return _answer(given)
    except OSError:
        return b""
    finally:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(given, termios.TCSADRAIN, before)


def _answer(given: int) -> bytes:
    answer, ends = b"", time.monotonic() + PATIENCE
    while not ANSWER.search(answer) and (left := ends - time.monotonic()) > 0:
        if select.select([given], [], [], left)[0]:
            if not (more := os.read(given, 1000)):
                break
            answer += more
    return answer
