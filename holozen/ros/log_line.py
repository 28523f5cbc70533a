"""One line of a log, as ROS's consoles show it, and where it goes.

The environment says more, with ROS's variables: RCUTILS_CONSOLE_OUTPUT_FORMAT, RCUTILS_COLORIZED_OUTPUT (0 or 1) and
RCUTILS_LOGGING_USE_STDOUT (1).
"""

import contextlib
import os
import re
import sys
import time
from typing import NamedTuple, TextIO

from holozen.ros.severity import LoggingSeverity

FORMAT = "[{severity}] [{time}] [{name}]: {message}"
COLORS = {LoggingSeverity.DEBUG: 32, LoggingSeverity.WARN: 33, LoggingSeverity.ERROR: 31, LoggingSeverity.FATAL: 31}
"""Numbers of the terminal's colours: green, yellow, red."""
ESCAPE = {r"\n": "\n", r"\t": "\t", r"\r": "\r", r"\a": "\a", r"\\": "\\"}


class Place(NamedTuple):
    """Where in a script something is logged."""

    file: str
    function: str
    line: int
    offset: int = 0  # in Python's code: a line may hold two calls


def write(severity: LoggingSeverity, name: str, message: str, place: Place) -> None:
    """Print a line to standard error. A terminal that is gone is no reason to fail."""
    stream = sys.stdout if os.environ.get("RCUTILS_LOGGING_USE_STDOUT") == "1" else sys.stderr
    line = formatted(severity, name, message, place, time.time_ns())
    if severity in COLORS and _colored(stream):
        line = f"\033[{COLORS[severity]}m{line}\033[0m"
    with contextlib.suppress(OSError, ValueError):
        stream.write(line + "\n")  # at once: lines of two threads must not mix
        stream.flush()


def formatted(severity: LoggingSeverity, name: str, message: str, place: Place, now: int) -> str:
    """The line, at `now` nanoseconds since 1970."""
    seconds, rest = divmod(now, 1_000_000_000)
    words = {
        "severity": severity.name, "name": name, "message": message, "time": f"{seconds}.{rest:09}",
        "time_as_nanoseconds": str(now), "function_name": place.function, "file_name": place.file,
        "line_number": str(place.line),
        "date_time_with_ms": time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds)) + f".{rest // 1_000_000:03}",
    }  # fmt: skip
    form = os.environ.get("RCUTILS_CONSOLE_OUTPUT_FORMAT") or FORMAT
    form = re.sub(r"\\.", lambda found: ESCAPE.get(found[0], found[0]), form)
    return re.sub(r"\{(\w+)\}", lambda found: words.get(found[1], found[0]), form)


def _colored(stream: TextIO) -> bool:
    said = os.environ.get("RCUTILS_COLORIZED_OUTPUT", "")
    return said == "1" if said in ("0", "1") else stream.isatty()
