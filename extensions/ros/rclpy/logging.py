"""Loggers: lines with a level, a time and a name on standard error.

ROS's environment variables apply: RCUTILS_CONSOLE_OUTPUT_FORMAT, RCUTILS_COLORIZED_OUTPUT (0 or 1)
and RCUTILS_LOGGING_USE_STDOUT (1).
"""

import os
import re
import sys
import threading
import time
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from holozen.console import log
from holozen.ros.catalog import HelpfulAttributes
from holozen.suggest import article

__all__ = [
    "LoggingSeverity",
    "RcutilsLogger",
    "clear_config",
    "get_logger",
    "get_logger_effective_level",
    "get_logger_level",
    "get_logging_directory",
    "get_logging_severity_from_string",
    "initialize",
    "set_logger_level",
    "shutdown",
]


class LoggingSeverity(IntEnum):
    """ROS's levels, with its numbers."""

    UNSET = 0
    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


FORMAT = "[{severity}] [{time}] [{name}]: {message}"
COLORS = {
    LoggingSeverity.DEBUG: 32,
    LoggingSeverity.WARN: 33,
    LoggingSeverity.ERROR: 31,
    LoggingSeverity.FATAL: 31,
}
"""The terminal's colour codes: green, yellow, red."""
ESCAPE = {r"\n": "\n", r"\t": "\t", r"\r": "\r", r"\a": "\a", r"\\": "\\"}


class CallSite(NamedTuple):
    """A call in a script that logs."""

    file: str
    function: str
    line: int
    offset: int = 0  # in the bytecode: a line may hold two calls


def _write(severity: LoggingSeverity, name: str, message: str, place: CallSite) -> None:
    """Print a line to standard error."""
    on_stdout = os.environ.get("RCUTILS_LOGGING_USE_STDOUT") == "1"
    stream = sys.stdout if on_stdout else sys.stderr
    line = formatted(severity, name, message, place, time.time_ns())
    if severity in COLORS and _colored(stream):
        line = f"\033[{COLORS[severity]}m{line}\033[0m"
    log(line, on_stdout)


def formatted(severity: LoggingSeverity, name: str, message: str, place: CallSite, now: int) -> str:
    """The line, at `now` nanoseconds since 1970."""
    seconds, rest = divmod(now, 1_000_000_000)
    words = {
        "severity": severity.name,
        "name": name,
        "message": message,
        "time": f"{seconds}.{rest:09}",
        "time_as_nanoseconds": str(now),
        "function_name": place.function,
        "file_name": place.file,
        "line_number": str(place.line),
        "date_time_with_ms": time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds))
        + f".{rest // 1_000_000:03}",
    }
    form = os.environ.get("RCUTILS_CONSOLE_OUTPUT_FORMAT") or FORMAT
    form = re.sub(r"\\.", lambda found: ESCAPE.get(found[0], found[0]), form)
    return re.sub(r"\{(\w+)\}", lambda found: words.get(found[1], found[0]), form)


def _colored(stream: TextIO) -> bool:
    setting = os.environ.get("RCUTILS_COLORIZED_OUTPUT", "")
    return setting == "1" if setting in ("0", "1") else stream.isatty()


MAX_CALLS = 10_000  # that are remembered: generated code must not fill the memory

Call = tuple[str, CallSite]  # the name of a logger, and where it is called


_filter_lock = threading.Lock()
_call_levels: dict[Call, LoggingSeverity] = {}
_last_lines: dict[Call, int] = {}  # when a call was printed, in ns


def _passes(
    call: Call,
    level: LoggingSeverity,
    once: bool,
    skip_first: bool,
    seconds: float | None,
    clock: Any,
) -> bool:
    """Whether a call with `once`, `skip_first` or `throttle_duration_sec` prints its line now.

    Raises ValueError if a call logs at two levels, TypeError for invalid seconds.
    """
    if seconds is not None and (isinstance(seconds, bool) or not isinstance(seconds, int | float)):
        raise TypeError(
            f"throttle_duration_sec is {article(type(seconds).__name__)}; use seconds, as a number"
        )
    with _filter_lock:
        if len(_call_levels) >= MAX_CALLS:
            return True
        is_first = call not in _call_levels
        if (before := _call_levels.setdefault(call, level)) != level:
            place = call[1]
            raise ValueError(
                f"{place.file}:{place.line} logs at {level.name}, and before at {before.name}; "
                "a call with once, skip_first or throttle_duration_sec must keep its level"
            )
        if (once and not is_first) or (skip_first and is_first):
            return False
        if seconds is None:
            return True
        now = clock.now().nanoseconds if hasattr(clock, "now") else time.monotonic_ns()
        last = _last_lines.get(call)
        # a clock that was set back starts again
        if last is not None and last <= now < last + seconds * 1e9:
            return False
        _last_lines[call] = now
        return True


DEFAULT = LoggingSeverity.INFO

_levels: dict[str, LoggingSeverity] = {}
_quiet = False


class RcutilsLogger(HelpfulAttributes):
    """A logger. Its parents are the loggers with the names before each dot of its name."""

    def __init__(self, name: str = "") -> None:
        self.name = name

    def get_child(self, name: str) -> "RcutilsLogger":
        """The logger of a name below this one. Raises ValueError for an empty name."""
        if not isinstance(name, str) or not name:
            raise ValueError(f"the name of a logger must be a str that is not empty, not {name!r}")
        return RcutilsLogger(f"{self.name}.{name}" if self.name else name)

    def set_level(self, level: int) -> None:
        """Print lines of this level and above. Raises ValueError for an unknown level."""
        set_logger_level(self.name, level)

    def get_effective_level(self) -> LoggingSeverity:
        """Its level, else its nearest parent's, else INFO."""
        return get_logger_effective_level(self.name)

    def is_enabled_for(self, severity: int) -> bool:
        """Whether a line of that level is printed."""
        return not _quiet and severity >= self.get_effective_level()

    def log(
        self,
        message: object,
        severity: int,
        *,
        once: bool = False,
        skip_first: bool = False,
        throttle_duration_sec: float | None = None,
        throttle_time_source_type: Any = None,
    ) -> bool:
        """Print a line. Returns whether it was printed.

        `once`, `skip_first` and `throttle_duration_sec` count for each call in the script, and each
        logger; seconds are measured on the steady clock, or on the Clock given.
        """
        level = _severity(severity)
        if not self.is_enabled_for(level):
            return False
        place = _caller()
        is_filtered = once or skip_first or throttle_duration_sec is not None
        if is_filtered and not _passes(
            (self.name, place),
            level,
            once,
            skip_first,
            throttle_duration_sec,
            throttle_time_source_type,
        ):
            return False
        _write(level, self.name, str(message), place)
        return True

    def debug(self, message: object, **options: Any) -> bool:
        """Print a line that helps to find a bug. Options are those of `log`."""
        return self.log(message, LoggingSeverity.DEBUG, **options)

    def info(self, message: object, **options: Any) -> bool:
        """Print a line about normal operation. Options are those of `log`."""
        return self.log(message, LoggingSeverity.INFO, **options)

    def warning(self, message: object, **options: Any) -> bool:
        """Print a line about what may be wrong. Options are those of `log`."""
        return self.log(message, LoggingSeverity.WARN, **options)

    warn = warning

    def error(self, message: object, **options: Any) -> bool:
        """Print a line about what failed. Options are those of `log`."""
        return self.log(message, LoggingSeverity.ERROR, **options)

    def fatal(self, message: object, **options: Any) -> bool:
        """Print a line about what ends the program. Options are those of `log`."""
        return self.log(message, LoggingSeverity.FATAL, **options)


def get_logger(name: str) -> RcutilsLogger:
    """The logger of a name. Raises ValueError for an empty one."""
    return RcutilsLogger().get_child(name)


def get_logging_severity_from_string(log_severity: str) -> LoggingSeverity:
    """The level of a name such as "warn". Raises RuntimeError for an unknown one."""
    try:
        return LoggingSeverity[log_severity.upper()]
    except KeyError:
        names = ", ".join(each.name.lower() for each in LoggingSeverity)
        raise RuntimeError(f"no level {log_severity!r}; use one of {names}") from None


def get_logger_effective_level(name: str) -> LoggingSeverity:
    """The level of a logger, else of its nearest parent, else INFO."""
    while name:
        if level := _levels.get(name):
            return level
        name = name.rpartition(".")[0]
    return _levels.get("") or DEFAULT


def get_logger_level(name: str) -> LoggingSeverity:
    """The logger's own level; UNSET if it has none."""
    return _levels.get(name, LoggingSeverity.UNSET)


def set_logger_level(name: str, level: int, detailed_error: bool = False) -> None:
    """Print lines of this level and above. Raises ValueError for an unknown level."""
    _levels[name] = _severity(level)


def silence(quiet: bool = True) -> None:
    """Silence all loggers."""
    global _quiet
    _quiet = quiet


def initialize() -> None:
    """Does nothing."""


def shutdown() -> None:
    """Does nothing."""


def clear_config() -> None:
    """Forget all levels."""
    _levels.clear()
    silence(False)


def get_logging_directory() -> Path:
    """Where ROS would keep its log files. There are none: all lines go to standard error."""
    return Path.home() / ".ros" / "log"


def _severity(level: int) -> LoggingSeverity:
    try:
        return LoggingSeverity(level)
    except ValueError:
        names = ", ".join(each.name for each in LoggingSeverity)
        raise ValueError(f"no level {level!r}; use LoggingSeverity: {names}") from None


def _caller() -> CallSite:
    """The innermost call from outside this file."""
    frame = sys._getframe(1)
    while frame.f_code.co_filename == __file__ and frame.f_back:
        frame = frame.f_back
    return CallSite(frame.f_code.co_filename, frame.f_code.co_name, frame.f_lineno, frame.f_lasti)
