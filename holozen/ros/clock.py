"""Clocks: the system's, a steady one, and ROS's, which shows simulated time where somebody gives it."""

import threading
import time
from collections.abc import Callable
from typing import Any
from weakref import WeakSet

from holozen.ros import jumps
from holozen.ros.clock_type import ClockType
from holozen.ros.duration import Duration
from holozen.ros.exceptions import NotInitializedException
from holozen.ros.jumps import ClockChange, JumpHandle, JumpThreshold, TimeJump
from holozen.ros.missing import Told
from holozen.ros.time import Time

__all__ = [
    "Clock", "ClockChange", "ClockType", "Duration", "JumpHandle", "JumpThreshold", "ROSClock", "Time", "TimeJump",
]  # fmt: skip


class _Moves:
    """Counts what wakes all who sleep: a clock moved, or a context was shut down."""

    def __init__(self) -> None:
        self.count = 0
        self._more = threading.Condition()

    def tell(self) -> None:
        with self._more:
            self.count += 1
            self._more.notify_all()

    def wait(self, seen: int, seconds: float | None) -> None:
        with self._more:
            self._more.wait_for(lambda: self.count != seen, seconds)


_moves = _Moves()
_watched: WeakSet[Any] = WeakSet()  # contexts that tell when they are shut down


class Clock(Told):
    """A clock of one type. ROS_TIME makes a ROSClock. Raises TypeError for no ClockType."""

    def __new__(cls, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> "Clock":
        if not isinstance(clock_type, ClockType) or clock_type == ClockType.UNINITIALIZED:
            raise TypeError(f"clock_type is {clock_type!r}; use ClockType.SYSTEM_TIME, STEADY_TIME or ROS_TIME")
        is_ros = clock_type == ClockType.ROS_TIME and cls is Clock
        return object.__new__(ROSClock if is_ros else cls)

    def __init__(self, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> None:
        self._clock_type = clock_type
        self._handles: set[JumpHandle] = set()
        self.watchers: set[Callable[[], None]] = set()
        """Called, from any thread, when simulated time moved, began or ended. They must be quick."""

    @property
    def clock_type(self) -> ClockType:
        """Its type."""
        return self._clock_type

    def __repr__(self) -> str:
        return f"Clock(clock_type={self._clock_type.name})"

    def now(self) -> Time:
        """The time it shows."""
        return Time(nanoseconds=self.nanoseconds(), clock_type=self._clock_type)

    def nanoseconds(self) -> int:
        """The time it shows, as a number."""
        return time.monotonic_ns() if self._clock_type == ClockType.STEADY_TIME else time.time_ns()

    def wait_seconds(self, until: int) -> float | None:
        """Real seconds until it shows `until` nanoseconds, at least 0; None for simulated time, which nobody knows."""
        return max(0.0, (until - self.nanoseconds()) * 1e-9)

    def create_jump_callback(
        self,
        threshold: JumpThreshold,
        *,
        pre_callback: Callable[[], object] | None = None,
        post_callback: Callable[[TimeJump], object] | None = None,
    ) -> JumpHandle:
        """Call `pre_callback()` before and `post_callback(TimeJump)` after a jump beyond the threshold.

        Raises ValueError without any of the two.
        """
        if pre_callback is None and post_callback is None:
            raise ValueError("give a pre_callback, a post_callback, or both")
        return JumpHandle(self._handles, threshold, pre_callback, post_callback)

    def sleep_until(self, until: Time, context: Any = None) -> bool:
        """Wait for a time; whether it came. False if rclpy was shut down, or simulated time began or ended.

        Raises ValueError for a time of another clock type, NotInitializedException where rclpy is not running.
        """
        if not isinstance(until, Time):
            raise TypeError(f"it sleeps until a Time, and {until!r} is a {type(until).__name__}")
        if until.clock_type != self._clock_type:
            raise ValueError(f"it is a clock of {self._clock_type.name}, and the time of {until.clock_type.name}")
        return self._sleep(until.nanoseconds, context)

    def sleep_for(self, rel_time: Duration, context: Any = None) -> bool:
        """Wait for some time, see `sleep_until`."""
        if not isinstance(rel_time, Duration):
            raise TypeError(f"it sleeps for a Duration, and {rel_time!r} is a {type(rel_time).__name__}")
        until = max(0, self.nanoseconds() + rel_time.nanoseconds)
        return self.sleep_until(Time(nanoseconds=until, clock_type=self._clock_type), context)

    def _sleep(self, until: int, context: Any, since: int = 0) -> bool:
        """`sleep_until`, in nanoseconds; it ends, with False, also where the clock was set back below `since`."""
        context = _running(context)
        source = self._source()
        while True:
            seen = _moves.count
            if not context.ok() or self._source() != source or self.nanoseconds() < since:
                return False
            wait = self.wait_seconds(until)
            if wait == 0.0:
                return True
            # The system's clock may be set meanwhile, so nobody sleeps for long without looking.
            _moves.wait(seen, None if wait is None else min(wait, 1.0))

    def _source(self) -> bool:
        """Whether its time is simulated."""
        return False


class ROSClock(Clock):
    """The clock of nodes: simulated time while that is active, else the system's. Simulated time begins at zero."""

    def __new__(cls, **_options: Any) -> "ROSClock":
        return object.__new__(cls)

    def __init__(self, **_options: Any) -> None:
        super().__init__(clock_type=ClockType.ROS_TIME)
        self._active, self._shown = False, 0

    @property
    def ros_time_is_active(self) -> bool:
        """Whether it shows simulated time."""
        return self._active

    def nanoseconds(self) -> int:
        """The time it shows, as a number."""
        return self._shown if self._active else time.time_ns()

    def wait_seconds(self, until: int) -> float | None:
        """Real seconds until it shows `until` nanoseconds; None for simulated time that is not there yet."""
        return None if self._active and self._shown < until else super().wait_seconds(until)

    def set_ros_time_override(self, now: Time) -> None:
        """Show that time while simulated time is active. Raises TypeError for no Time of the ROS clock."""
        if not isinstance(now, Time) or now.clock_type != ClockType.ROS_TIME:
            raise TypeError(f"simulated time is a Time of ROS_TIME, and not {now!r}")
        if not self._active:
            self._shown = now.nanoseconds
            return
        change = ClockChange.ROS_TIME_NO_CHANGE
        self._jump(change, now.nanoseconds - self._shown, lambda: setattr(self, "_shown", now.nanoseconds))

    def _set_ros_time_is_active(self, active: bool) -> None:
        """Show simulated time from now on, or the system's."""
        if active == self._active:
            return
        change = ClockChange.ROS_TIME_ACTIVATED if active else ClockChange.ROS_TIME_DEACTIVATED
        delta = self._shown - time.time_ns()
        self._jump(change, delta if active else -delta, lambda: setattr(self, "_active", active))

    def _jump(self, change: ClockChange, delta: int, move: Callable[[], None]) -> None:
        if self._handles:
            jumps.told(self._handles, TimeJump(change, Duration(nanoseconds=delta)), move)
        else:
            move()
        _moves.tell()
        for watcher in list(self.watchers):
            watcher()

    def _source(self) -> bool:
        return self._active


def _running(context: Any) -> Any:
    """The context to sleep in, which wakes who sleeps when it is shut down. Raises NotInitializedException."""
    if context is None:
        from holozen.ros.context import get_default_context

        context = get_default_context()
    if not context.ok():
        raise NotInitializedException
    if context not in _watched:
        _watched.add(context)

        def tell() -> None:
            _watched.discard(context)
            _moves.tell()

        context.on_shutdown(tell)
    return context
