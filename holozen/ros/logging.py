"""Loggers: lines with a level, a time and a name on standard error."""

import sys
from pathlib import Path
from typing import Any

from holozen.ros import log_line
from holozen.ros.log_filters import Filters
from holozen.ros.log_line import Place
from holozen.ros.missing import Told
from holozen.ros.severity import LoggingSeverity

__all__ = [
    "LoggingSeverity", "RcutilsLogger", "clear_config", "get_logger", "get_logger_effective_level", "get_logger_level",
    "get_logging_directory", "get_logging_severity_from_string", "initialize", "set_logger_level", "shutdown",
]  # fmt: skip

DEFAULT = LoggingSeverity.INFO

_levels: dict[str, LoggingSeverity] = {}
_quiet = False
_filters = Filters()


class RcutilsLogger(Told):
    """A logger of one name. Its parents are the names before each dot."""

    def __init__(self, name: str = "") -> None:
        self.name = name

    def get_child(self, name: str) -> "RcutilsLogger":
        """The logger of a part of this one. Raises ValueError for an empty name."""
        if not isinstance(name, str) or not name:
            raise ValueError(f"a logger's name is a str that is not empty, and not {name!r}")
        return RcutilsLogger(f"{self.name}.{name}" if self.name else name)

    def set_level(self, level: int) -> None:
        """Show lines of this level or worse. Raises ValueError for a level that there is not."""
        set_logger_level(self.name, level)

    def get_effective_level(self) -> LoggingSeverity:
        """Its level, else its nearest parent's, else INFO."""
        return get_logger_effective_level(self.name)

    def is_enabled_for(self, severity: int) -> bool:
        """Whether a line of that level is shown."""
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
        """Print a line; whether it was shown.

        `once`, `skip_first` and `throttle_duration_sec` count by the logger and the place of the call in the script;
        the seconds are of the steady clock, or of the Clock given.
        """
        level = _severity(severity)
        if not self.is_enabled_for(level):
            return False
        place = _caller()
        if (once or skip_first or throttle_duration_sec is not None) and not _filters.passes(
            self.name, place, level, once=once, skip_first=skip_first, seconds=throttle_duration_sec,
            clock=throttle_time_source_type,
        ):  # fmt: skip
            return False
        log_line.write(level, self.name, str(message), place)
        return True

    def debug(self, message: object, **options: Any) -> bool:
        """Print a line for who looks for a fault. Options are those of `log`."""
        return self.log(message, LoggingSeverity.DEBUG, **options)

    def info(self, message: object, **options: Any) -> bool:
        """Print a line that says what happens. Options are those of `log`."""
        return self.log(message, LoggingSeverity.INFO, **options)

    def warning(self, message: object, **options: Any) -> bool:
        """Print a line about what may be wrong. Options are those of `log`."""
        return self.log(message, LoggingSeverity.WARN, **options)

    def warn(self, message: object, **options: Any) -> bool:
        """`warning`, by its older name."""
        return self.log(message, LoggingSeverity.WARN, **options)

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
    """The level of a word such as "warn". Raises RuntimeError for one that there is not."""
    try:
        return LoggingSeverity[log_severity.upper()]
    except KeyError:
        raise RuntimeError(f"no level {log_severity!r}; use one of {_words()}") from None


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
    """Show lines of this level or worse. Raises ValueError for a level that there is not."""
    _levels[name] = _severity(level)


def print_nothing(quiet: bool = True) -> None:
    """Whether all loggers are silent."""
    global _quiet
    _quiet = quiet


def initialize() -> None:
    """Nothing is to be done."""


def shutdown() -> None:
    """Nothing is to be done."""


def clear_config() -> None:
    """Forget all levels."""
    _levels.clear()
    print_nothing(False)


def get_logging_directory() -> Path:
    """Where ROS would keep its log files. There are none: all lines are on standard error."""
    return Path.home() / ".ros" / "log"


def _severity(level: int) -> LoggingSeverity:
    try:
        return LoggingSeverity(level)
    except ValueError:
        raise ValueError(f"no level {level!r}; use LoggingSeverity: {_words()}") from None


def _words() -> str:
    return ", ".join(each.name for each in LoggingSeverity)


def _caller() -> Place:
    """The first place outside of this file."""
    frame = sys._getframe(1)
    while frame.f_code.co_filename == __file__ and frame.f_back:
        frame = frame.f_back
    return Place(frame.f_code.co_filename, frame.f_code.co_name, frame.f_lineno, frame.f_lasti)
