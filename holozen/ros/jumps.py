"""Jumps of a clock: simulated time that begins, ends, or moves by more than somebody accepts."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from types import TracebackType
from typing import Any, Self

from holozen.ros.duration import Duration

__all__ = ["ClockChange", "JumpHandle", "JumpThreshold", "TimeJump"]


class ClockChange(IntEnum):
    """What became of the source of a clock's time."""

    ROS_TIME_NO_CHANGE = 1
    ROS_TIME_ACTIVATED = 2
    ROS_TIME_DEACTIVATED = 3
    SYSTEM_TIME_NO_CHANGE = 4


CHANGES = (ClockChange.ROS_TIME_ACTIVATED, ClockChange.ROS_TIME_DEACTIVATED)


@dataclass(frozen=True, slots=True)
class TimeJump:
    """By how much a clock jumped, and why."""

    clock_change: ClockChange
    delta: Duration


class JumpThreshold:
    """Which jumps are told: forward by `min_forward` or more, backward by `min_backward` (negative) or more.

    None tells none of them; `on_clock_change` tells when simulated time begins or ends. Raises ValueError.
    """

    def __init__(
        self, *, min_forward: Duration | None, min_backward: Duration | None, on_clock_change: bool = True
    ) -> None:
        for name, value in (("min_forward", min_forward), ("min_backward", min_backward)):
            if value is not None and not isinstance(value, Duration):
                raise TypeError(f"{name} is a Duration or None, and {value!r} is a {type(value).__name__}")
        if min_forward is not None and min_forward <= Duration():
            raise ValueError(f"min_forward is more than zero, and not {min_forward}")
        if min_backward is not None and min_backward >= Duration():
            raise ValueError(f"min_backward is less than zero, and not {min_backward}")
        if min_forward is None and min_backward is None and not on_clock_change:
            raise ValueError("it would tell no jump; say min_forward, min_backward or on_clock_change")
        self.min_forward, self.min_backward, self.on_clock_change = min_forward, min_backward, on_clock_change

    def is_passed(self, jump: TimeJump) -> bool:
        """Whether that jump is told."""
        if jump.clock_change in CHANGES:
            return self.on_clock_change
        forward = self.min_forward is not None and jump.delta >= self.min_forward
        return forward or (self.min_backward is not None and jump.delta <= self.min_backward)


class JumpHandle:
    """What is called before and after a jump, until `unregister()`."""

    def __init__(
        self,
        handles: set["JumpHandle"],
        threshold: JumpThreshold,
        before: Callable[[], object] | None,
        after: Callable[[TimeJump], object] | None,
    ) -> None:
        self._handles, self.threshold, self.before, self.after = handles, threshold, before, after
        handles.add(self)

    def unregister(self) -> None:
        """Call nothing any more. A second time does nothing."""
        self._handles.discard(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.unregister()


def told(handles: set[JumpHandle], jump: TimeJump, move: Callable[[], Any]) -> None:
    """Move a clock between what is called before and after."""
    concerned = [handle for handle in list(handles) if handle.threshold.is_passed(jump)]
    for handle in concerned:
        if handle.before:
            handle.before()
    move()
    for handle in concerned:
        if handle.after:
            handle.after(jump)
