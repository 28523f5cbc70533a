"""Duration and Time: spans and moments in whole nanoseconds. Times are compared only with times of
the same clock.
"""

import functools
from enum import IntEnum
from numbers import Real
from typing import Any

from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.generated import find
from holozen.suggest import article

__all__ = ["CONVERSION_CONSTANT", "S_TO_NS", "ClockType", "Duration", "Infinite", "Time"]

S_TO_NS = CONVERSION_CONSTANT = 1_000_000_000
LARGEST = 2**63  # nanoseconds; ROS keeps them in signed 64-bit integers


class ClockType(IntEnum):
    """The clock of a time."""

    UNINITIALIZED = 0
    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3


def _total(seconds: float, nanoseconds: float, what: str) -> int:
    """The sum in nanoseconds. Raises OverflowError for more than ROS can store."""
    if not isinstance(seconds, Real):  # a text times 10**9 would be a longer text
        raise TypeError(
            f"the seconds of a {what} must be a number; {seconds!r} is "
            f"{article(type(seconds).__name__)}"
        )
    total = int(seconds * S_TO_NS) + int(nanoseconds)
    if not -LARGEST <= total < LARGEST:
        raise OverflowError(f"{total} nanoseconds are too many for a {what}: it has 64 bits")
    return total


def _from_msg(msg: Any, name: str) -> int:
    """The nanoseconds of a builtin_interfaces message of that name. Raises TypeError for
    another.
    """
    if getattr(msg, "ROS", "") != f"builtin_interfaces/msg/{name}":
        raise TypeError(
            f"cannot make a {name} from a {type(msg).__name__}; pass a "
            f"builtin_interfaces.msg.{name}"
        )
    return int(msg.sec) * S_TO_NS + int(msg.nanosec)


@functools.total_ordering
class Duration(HelpfulAttributes):
    """A span of time; it may be negative. Raises OverflowError beyond 292 years."""

    __slots__ = ("_nanoseconds",)

    def __init__(self, *, seconds: float = 0, nanoseconds: float = 0) -> None:
        self._nanoseconds = _total(seconds, nanoseconds, "duration")

    @property
    def nanoseconds(self) -> int:
        """Its length in nanoseconds."""
        return self._nanoseconds

    def to_msg(self) -> Any:
        """As a builtin_interfaces.msg.Duration."""
        sec, nanosec = divmod(self._nanoseconds, S_TO_NS)
        return find("builtin_interfaces/msg/Duration")(sec=sec, nanosec=nanosec)

    @classmethod
    def from_msg(cls, msg: Any) -> "Duration":
        """From a builtin_interfaces.msg.Duration. Raises TypeError for anything else."""
        return cls(nanoseconds=_from_msg(msg, "Duration"))

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self._nanoseconds})"

    def __str__(self) -> str:
        return f"{self._nanoseconds} nanoseconds"

    def __hash__(self) -> int:
        return hash(("Duration", self._nanoseconds))

    def __eq__(self, other: object) -> bool:
        # A comparison with a number would always be False, which is hard to notice.
        return self._nanoseconds == self._of(other)._nanoseconds

    def __lt__(self, other: object) -> bool:
        return self._nanoseconds < self._of(other)._nanoseconds

    def __add__(self, other: object) -> "Duration":
        if not isinstance(other, Duration):
            return NotImplemented
        return Duration(nanoseconds=self._nanoseconds + other._nanoseconds)

    def __sub__(self, other: object) -> "Duration":
        if not isinstance(other, Duration):
            return NotImplemented
        return Duration(nanoseconds=self._nanoseconds - other._nanoseconds)

    def __mul__(self, factor: object) -> "Duration":
        if isinstance(factor, bool) or not isinstance(factor, int | float):
            return NotImplemented
        return Duration(nanoseconds=self._nanoseconds * factor)

    __rmul__ = __mul__

    @staticmethod
    def _of(other: object) -> "Duration":
        if isinstance(other, Duration):
            return other
        raise TypeError(
            f"cannot compare a Duration with a {type(other).__name__}; use Duration(seconds=...)"
        )


Infinite = Duration(nanoseconds=LARGEST - 1)


@functools.total_ordering
class Time(HelpfulAttributes):
    """A moment of a clock, counted from its zero.

    Raises ValueError if it is negative, OverflowError after 292 years, TypeError for a clock_type
    of another type.
    """

    __slots__ = ("_clock_type", "_nanoseconds")

    def __init__(
        self,
        *,
        seconds: float = 0,
        nanoseconds: float = 0,
        clock_type: ClockType = ClockType.SYSTEM_TIME,
    ) -> None:
        if not isinstance(clock_type, ClockType):
            raise TypeError(f"clock_type is {article(type(clock_type).__name__)}; use a ClockType")
        if seconds < 0 or nanoseconds < 0:
            name, value = ("seconds", seconds) if seconds < 0 else ("nanoseconds", nanoseconds)
            raise ValueError(f"{name} value must not be negative, and is {value}")
        self._nanoseconds, self._clock_type = _total(seconds, nanoseconds, "time"), clock_type

    @property
    def nanoseconds(self) -> int:
        """Nanoseconds since the clock's zero."""
        return self._nanoseconds

    @property
    def clock_type(self) -> ClockType:
        """Its clock."""
        return self._clock_type

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Whole seconds, and the remaining nanoseconds."""
        return divmod(self._nanoseconds, S_TO_NS)

    def to_msg(self) -> Any:
        """As a builtin_interfaces.msg.Time."""
        sec, nanosec = self.seconds_nanoseconds()
        return find("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)

    @classmethod
    def from_msg(cls, msg: Any, clock_type: ClockType = ClockType.ROS_TIME) -> "Time":
        """From a builtin_interfaces.msg.Time, by default of the ROS clock. Raises TypeError for
        anything else.
        """
        return cls(nanoseconds=_from_msg(msg, "Time"), clock_type=clock_type)

    def __repr__(self) -> str:
        return f"Time(nanoseconds={self._nanoseconds}, clock_type={self._clock_type.name})"

    def __hash__(self) -> int:
        return hash((self._nanoseconds, self._clock_type))

    def __eq__(self, other: object) -> bool:
        return self._nanoseconds == self._of(other)._nanoseconds

    def __lt__(self, other: object) -> bool:
        return self._nanoseconds < self._of(other)._nanoseconds

    def __add__(self, other: object) -> "Time":
        return self._moved(other.nanoseconds) if isinstance(other, Duration) else NotImplemented

    __radd__ = __add__

    def __sub__(self, other: object) -> Any:
        """A Duration if `other` is a Time, a Time if it is a Duration."""
        if isinstance(other, Duration):
            return self._moved(-other.nanoseconds)
        if not isinstance(other, Time):
            return NotImplemented
        return Duration(nanoseconds=self._nanoseconds - self._of(other, "subtract")._nanoseconds)

    def _moved(self, nanoseconds: int) -> "Time":
        total = self._nanoseconds + nanoseconds
        if total < 0:
            raise ValueError(f"the result is before the clock's zero: {total} nanoseconds")
        return Time(nanoseconds=total, clock_type=self._clock_type)

    def _of(self, other: object, verb: str = "compare") -> "Time":
        if not isinstance(other, Time):
            raise TypeError(
                f"cannot {verb} a Time with a {type(other).__name__}; use Time.from_msg() of a "
                "message"
            )
        if other._clock_type != self._clock_type:
            raise TypeError(
                f"cannot {verb} times with different clock types: {self._clock_type.name}, "
                f"{other._clock_type.name}"
            )
        return other
