"""Time: a moment of a clock in whole nanoseconds, compared only with others of that clock."""

import functools
from typing import Any

from holozen.ros.clock_type import ClockType
from holozen.ros.duration import S_TO_NS, Duration, message, nanoseconds_of, whole
from holozen.ros.missing import Told

__all__ = ["CONVERSION_CONSTANT", "S_TO_NS", "ClockType", "Duration", "Time"]

CONVERSION_CONSTANT = S_TO_NS


@functools.total_ordering
class Time(Told):
    """A moment of a clock, from its zero on.

    Raises ValueError for negative ones, OverflowError after 292 years, TypeError for no ClockType.
    """

    __slots__ = ("_clock_type", "_nanoseconds")

    def __init__(
        self, *, seconds: float = 0, nanoseconds: float = 0, clock_type: ClockType = ClockType.SYSTEM_TIME
    ) -> None:
        if not isinstance(clock_type, ClockType):
            raise TypeError(f"clock_type is a {type(clock_type).__name__}; use a ClockType")
        if seconds < 0 or nanoseconds < 0:
            name, value = ("seconds", seconds) if seconds < 0 else ("nanoseconds", nanoseconds)
            raise ValueError(f"{name} value must not be negative, and is {value}")
        self._nanoseconds, self._clock_type = whole(seconds, nanoseconds, "time"), clock_type

    @property
    def nanoseconds(self) -> int:
        """Nanoseconds since the clock's zero."""
        return self._nanoseconds

    @property
    def clock_type(self) -> ClockType:
        """The clock it is of."""
        return self._clock_type

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Whole seconds, and the nanoseconds left over."""
        return divmod(self._nanoseconds, S_TO_NS)

    def to_msg(self) -> Any:
        """As a builtin_interfaces.msg.Time."""
        sec, nanosec = self.seconds_nanoseconds()
        return message("Time")(sec=sec, nanosec=nanosec)

    @classmethod
    def from_msg(cls, msg: Any, clock_type: ClockType = ClockType.ROS_TIME) -> "Time":
        """Of a builtin_interfaces.msg.Time, of the ROS clock. Raises TypeError for anything else."""
        return cls(nanoseconds=nanoseconds_of(msg, "Time"), clock_type=clock_type)

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
        """A Duration after another Time, a Time before a Duration."""
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
            raise TypeError(f"cannot {verb} a Time with a {type(other).__name__}; use Time.from_msg() of a message")
        if other._clock_type != self._clock_type:
            raise TypeError(
                f"cannot {verb} times with different clock types: {self._clock_type.name}, {other._clock_type.name}"
            )
        return other
