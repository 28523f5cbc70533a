"""Which lines are shown of those that one place of a script logs again and again."""

import threading
import time
from typing import Any

from holozen.ros.log_line import Place
from holozen.ros.severity import LoggingSeverity

MOST = 10_000  # places that are remembered; a script that is generated without end must not eat the memory

Call = tuple[str, Place]  # a logger's name, and where it is called


class Filters:
    """Remembers the places that asked for fewer lines."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._levels: dict[Call, LoggingSeverity] = {}
        self._last: dict[Call, int] = {}

    def passes(
        self,
        name: str,
        place: Place,
        severity: LoggingSeverity,
        *,
        once: bool,
        skip_first: bool,
        seconds: float | None,
        clock: Any,
    ) -> bool:
        """Whether a line is shown. Raises ValueError for a place that logs at two levels, TypeError for no number."""
        if seconds is not None and (isinstance(seconds, bool) or not isinstance(seconds, int | float)):
            raise TypeError(f"throttle_duration_sec is a {type(seconds).__name__}; use seconds, as a number")
        call = (name, place)
        with self._lock:
            if len(self._levels) >= MOST:
                return True
            is_first = call not in self._levels
            if self._levels.setdefault(call, severity) != severity:
                raise ValueError(
                    f"{place.file}:{place.line} logs at {severity.name} and before at {self._levels[call].name}; "
                    "with once, skip_first or throttle_duration_sec a line of a script has one level"
                )
            if (once and not is_first) or (skip_first and is_first):
                return False
            return seconds is None or self._is_due(call, seconds, clock)

    def _is_due(self, call: Call, seconds: float, clock: Any) -> bool:
        now = clock.now().nanoseconds if hasattr(clock, "now") else time.monotonic_ns()
        last = self._last.get(call)
        if last is not None and last <= now < last + seconds * 1e9:  # a clock that was set back starts anew
            return False
        self._last[call] = now
        return True
