"""Duration: a span of time in whole nanoseconds."""

import functools
from typing import Any

from holozen.ros.missing import Told

__all__ = ["S_TO_NS", "Duration", "Infinite"]

S_TO_NS = 1_000_000_000
LARGEST = 2**63  # nanoseconds; ROS keeps them in 64 bits with a sign


def whole(seconds: float, nanoseconds: float, what: str) -> int:
    """Both in nanoseconds. Raises OverflowError for more than ROS keeps."""
    total = int(seconds * S_TO_NS) + int(nanoseconds)
    if not -LARGEST <= total < LARGEST:
        raise OverflowError(f"{total} nanoseconds are too many for a {what}: it has 64 bits")
    return total


@functools.total_ordering
class Duration(Told):
    """A span of time; it may be negative. Raises OverflowError beyond 292 years."""

    __slots__ = ("_nanoseconds",)

    def __init__(self, *, seconds: float = 0, nanoseconds: float = 0) -> None:
        self._nanoseconds = whole(seconds, nanoseconds, "duration")

    @property
    def nanoseconds(self) -> int:
        """The whole of it, in nanoseconds."""
        return self._nanoseconds

    def to_msg(self) -> Any:
        """As a builtin_interfaces.msg.Duration."""
        sec, nanosec = divmod(self._nanoseconds, S_TO_NS)
        return message("Duration")(sec=sec, nanosec=nanosec)

    @classmethod
    def from_msg(cls, msg: Any) -> "Duration":
        """Of a builtin_interfaces.msg.Duration. Raises TypeError for anything else."""
        return cls(nanoseconds=nanoseconds_of(msg, "Duration"))

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self._nanoseconds})"

    def __str__(self) -> str:
        return f"{self._nanoseconds} nanoseconds"

    def __hash__(self) -> int:
        return hash(("Duration", self._nanoseconds))

    def __eq__(self, other: object) -> bool:
        # A comparison with a number would be False for ever, which nobody would find.
        return self._nanoseconds == self._of(other, "compare")._nanoseconds

    def __lt__(self, other: object) -> bool:
        return self._nanoseconds < self._of(other, "compare")._nanoseconds

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
    def _of(other: object, verb: str) -> "Duration":
        if isinstance(other, Duration):
            return other
        raise TypeError(f"cannot {verb} a Duration with a {type(other).__name__}; use Duration(seconds=...)")


Infinite = Duration(nanoseconds=LARGEST - 1)


def message(name: str) -> Any:
    """The class of builtin_interfaces.msg of that name."""
    from holozen.ros.generated import find

    return find(f"builtin_interfaces/msg/{name}")


def nanoseconds_of(msg: Any, name: str) -> int:
    """The nanoseconds of a message of that name. Raises TypeError for another."""
    if getattr(msg, "ROS", "") != f"builtin_interfaces/msg/{name}":
        raise TypeError(f"cannot make a {name} of a {type(msg).__name__}; pass a builtin_interfaces.msg.{name}")
    return int(msg.sec) * S_TO_NS + int(msg.nanosec)
