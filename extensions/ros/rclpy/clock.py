"""Clocks: the system's, a steady one, and ROS's, which shows simulated time while a TimeSource
provides it.
"""

import threading
import time
import traceback
from collections.abc import Callable
from enum import IntEnum
from typing import Any, Self
from weakref import WeakSet

from msgspec import Struct

from holozen.messages import Clock as ClockMessage
from holozen.ros import tracebacks
from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.rclpy import names
from holozen.ros.rclpy.context import get_default_context
from holozen.ros.rclpy.exceptions import NotInitializedException
from holozen.ros.rclpy.parameter import Parameter
from holozen.ros.rclpy.time import ClockType, Duration, Time
from holozen.suggest import article
from holozen.transport.errors import BusError
from holozen.transport.pubsub import Subscription

__all__ = [
    "USE_SIM_TIME",
    "Clock",
    "ClockChange",
    "JumpHandle",
    "JumpThreshold",
    "ROSClock",
    "TimeJump",
    "TimeSource",
]

USE_SIM_TIME = "use_sim_time"
TOPIC = "/clock"


class ClockChange(IntEnum):
    """How the source of a clock's time changed."""

    ROS_TIME_NO_CHANGE = 1
    ROS_TIME_ACTIVATED = 2
    ROS_TIME_DEACTIVATED = 3
    SYSTEM_TIME_NO_CHANGE = 4


SOURCE_CHANGES = (ClockChange.ROS_TIME_ACTIVATED, ClockChange.ROS_TIME_DEACTIVATED)


class TimeJump(Struct, frozen=True):
    """How far a clock jumped, and why."""

    clock_change: ClockChange
    delta: Duration


class JumpThreshold:
    """Which jumps are reported: forward by `min_forward` or more, backward by `min_backward`
    (negative) or more.

    None reports none of them; `on_clock_change` reports when simulated time begins or ends. Raises
    ValueError.
    """

    def __init__(
        self,
        *,
        min_forward: Duration | None,
        min_backward: Duration | None,
        on_clock_change: bool = True,
    ) -> None:
        for name, value in (("min_forward", min_forward), ("min_backward", min_backward)):
            if value is not None and not isinstance(value, Duration):
                raise TypeError(
                    f"{name} must be a Duration or None; {value!r} is "
                    f"{article(type(value).__name__)}"
                )
        if min_forward is not None and min_forward <= Duration():
            raise ValueError(f"min_forward must be positive, not {min_forward}")
        if min_backward is not None and min_backward >= Duration():
            raise ValueError(f"min_backward must be negative, not {min_backward}")
        if min_forward is None and min_backward is None and not on_clock_change:
            raise ValueError(
                "it would report no jump; give min_forward, min_backward or on_clock_change"
            )
        self.min_forward, self.min_backward, self.on_clock_change = (
            min_forward,
            min_backward,
            on_clock_change,
        )

    def is_passed(self, jump: TimeJump) -> bool:
        """Whether that jump is reported."""
        if jump.clock_change in SOURCE_CHANGES:
            return self.on_clock_change
        forward = self.min_forward is not None and jump.delta >= self.min_forward
        return forward or (self.min_backward is not None and jump.delta <= self.min_backward)


class JumpHandle:
    """The callbacks before and after a jump, until `unregister()`."""

    def __init__(
        self,
        handles: set["JumpHandle"],
        threshold: JumpThreshold,
        before: Callable[[], object] | None,
        after: Callable[[TimeJump], object] | None,
    ) -> None:
        self.handles, self.threshold, self.before, self.after = handles, threshold, before, after
        handles.add(self)

    def unregister(self) -> None:
        """Stop calling them. A second time does nothing."""
        self.handles.discard(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.unregister()


class _Sleepers:
    """Those who sleep on a clock: all are woken when one moves, or a context is shut down."""

    def __init__(self) -> None:
        self.count = 0
        self._lock = threading.Lock()  # see holozen.ros.rclpy.waitable
        self._more = threading.Condition(self._lock)

    def notify(self) -> None:
        with self._lock:
            self.count += 1
            self._more.notify_all()

    def wait(self, seen: int, seconds: float | None) -> None:
        with self._lock:
            self._more.wait_for(lambda: self.count != seen, seconds)


_sleepers = _Sleepers()
_watched: WeakSet[Any] = WeakSet()  # contexts that notify `_sleepers` when they are shut down


class Clock(HelpfulAttributes):
    """A clock of one type. ROS_TIME creates a ROSClock. Raises TypeError for anything but a
    ClockType.
    """

    def __new__(cls, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> "Clock":
        if not isinstance(clock_type, ClockType) or clock_type == ClockType.UNINITIALIZED:
            raise TypeError(
                f"clock_type is {clock_type!r}; use ClockType.SYSTEM_TIME, STEADY_TIME or ROS_TIME"
            )
        is_ros = clock_type == ClockType.ROS_TIME and cls is Clock
        return object.__new__(ROSClock if is_ros else cls)

    def __init__(self, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> None:
        self._clock_type = clock_type
        self._handles: set[JumpHandle] = set()
        self.watchers: set[Callable[[], None]] = set()
        """Called from any thread when simulated time moved, began or ended. They must be quick."""

    @property
    def clock_type(self) -> ClockType:
        """Its type."""
        return self._clock_type

    def __repr__(self) -> str:
        return f"Clock(clock_type={self._clock_type.name})"

    def now(self) -> Time:
        """The current time."""
        return Time(nanoseconds=self.nanoseconds(), clock_type=self._clock_type)

    def nanoseconds(self) -> int:
        """The current time as a number."""
        return time.monotonic_ns() if self._clock_type == ClockType.STEADY_TIME else time.time_ns()

    def wait_seconds(self, until: int) -> float | None:
        """Real seconds until it shows `until` nanoseconds, at least 0; None if that depends on
        simulated time.
        """
        return max(0.0, (until - self.nanoseconds()) * 1e-9)

    def create_jump_callback(
        self,
        threshold: JumpThreshold,
        *,
        pre_callback: Callable[[], object] | None = None,
        post_callback: Callable[[TimeJump], object] | None = None,
    ) -> JumpHandle:
        """Call `pre_callback()` before and `post_callback(TimeJump)` after a jump beyond the
        threshold.

        Raises ValueError if neither is given.
        """
        if pre_callback is None and post_callback is None:
            raise ValueError("give a pre_callback, a post_callback, or both")
        return JumpHandle(self._handles, threshold, pre_callback, post_callback)

    def sleep_until(self, until: Time, context: Any = None) -> bool:
        """Sleep until a time. Returns False if rclpy is shut down, or simulated time begins or
        ends, before that.

        Raises ValueError for a time of another clock type, NotInitializedException if rclpy is not
        running.
        """
        if not isinstance(until, Time):
            raise TypeError(f"until must be a Time; {until!r} is {article(type(until).__name__)}")
        if until.clock_type != self._clock_type:
            raise ValueError(
                f"this is a clock of {self._clock_type.name}, and the time is of "
                f"{until.clock_type.name}"
            )
        return self.sleep_nanoseconds(until.nanoseconds, context)

    def sleep_for(self, rel_time: Duration, context: Any = None) -> bool:
        """Sleep for a duration, see `sleep_until`."""
        if not isinstance(rel_time, Duration):
            raise TypeError(
                f"rel_time must be a Duration; {rel_time!r} is {article(type(rel_time).__name__)}"
            )
        until = max(0, self.nanoseconds() + rel_time.nanoseconds)
        return self.sleep_until(Time(nanoseconds=until, clock_type=self._clock_type), context)

    def sleep_nanoseconds(self, until: int, context: Any, since: int = 0) -> bool:
        """`sleep_until` in nanoseconds; also false, and ends, if the clock is set back to before
        `since`.
        """
        context = _running(context)
        source = self._source()
        while True:
            seen = _sleepers.count
            if not context.ok() or self._source() != source or self.nanoseconds() < since:
                return False
            wait = self.wait_seconds(until)
            if wait == 0.0:
                return True
            # The system's clock may be set while it sleeps, so it looks now and then.
            _sleepers.wait(seen, None if wait is None else min(wait, 1.0))

    def _source(self) -> bool:
        """Whether its time is simulated now."""
        return False


class ROSClock(Clock):
    """The clock of nodes: simulated time while that is active, else the system's. Simulated time
    starts at zero.
    """

    def __init__(self, **_options: Any) -> None:
        super().__init__(clock_type=ClockType.ROS_TIME)
        self._active, self._shown = False, 0

    @property
    def ros_time_is_active(self) -> bool:
        """Whether it shows simulated time."""
        return self._active

    def nanoseconds(self) -> int:
        """The current time as a number."""
        return self._shown if self._active else time.time_ns()

    def wait_seconds(self, until: int) -> float | None:
        """Real seconds until it shows `until` nanoseconds; None for simulated time that has not
        been reached.
        """
        return None if self._active and self._shown < until else super().wait_seconds(until)

    def set_ros_time_override(self, now: Time) -> None:
        """Show that time while simulated time is active. Raises TypeError for anything but a Time
        of ROS_TIME.
        """
        if not isinstance(now, Time) or now.clock_type != ClockType.ROS_TIME:
            raise TypeError(f"simulated time must be a Time of ROS_TIME, not {now!r}")
        if not self._active:
            self._shown = now.nanoseconds
            return
        change = ClockChange.ROS_TIME_NO_CHANGE
        self._jump(
            change, now.nanoseconds - self._shown, lambda: setattr(self, "_shown", now.nanoseconds)
        )

    def _set_ros_time_is_active(self, active: bool) -> None:
        """Show simulated time from now on, or the system's."""
        if active == self._active:
            return
        change = ClockChange.ROS_TIME_ACTIVATED if active else ClockChange.ROS_TIME_DEACTIVATED
        delta = self._shown - time.time_ns()
        self._jump(change, delta if active else -delta, lambda: setattr(self, "_active", active))

    def _jump(self, change: ClockChange, delta: int, move: Callable[[], None]) -> None:
        jump = TimeJump(change, Duration(nanoseconds=delta))
        concerned = [handle for handle in list(self._handles) if handle.threshold.is_passed(jump)]
        for handle in concerned:
            if handle.before:
                handle.before()
        move()
        for handle in concerned:
            if handle.after:
                handle.after(jump)
        _sleepers.notify()
        for watcher in list(self.watchers):
            watcher()

    def _source(self) -> bool:
        return self._active


def _running(context: Any) -> Any:
    """The context to sleep in, whose shutdown wakes the sleepers. Raises
    NotInitializedException.
    """
    context = get_default_context() if context is None else context
    if not context.ok():
        raise NotInitializedException
    if context not in _watched:
        _watched.add(context)

        def notify() -> None:
            _watched.discard(context)
            _sleepers.notify()

        context.on_shutdown(notify)
    return context


class TimeSource:
    """Gives the clocks of a node simulated time, from its own thread: time passes while no executor
    spins.

    The node must have declared the boolean parameter `use_sim_time`.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._clocks: list[ROSClock] = []
        self._lock = threading.Lock()
        self._reader: Subscription[ClockMessage] | None = None
        self._shown = Time(clock_type=ClockType.ROS_TIME)
        self._active = False
        node.add_post_set_parameters_callback(self._follow)
        self._follow([node.get_parameter(USE_SIM_TIME)])

    @property
    def ros_time_is_active(self) -> bool:
        """Whether the clocks show simulated time."""
        return self._active

    @ros_time_is_active.setter
    def ros_time_is_active(self, active: bool) -> None:
        """Show simulated time from now on, or the system's."""
        with self._lock:
            if active == self._active:
                return
            self._active = active
            if active:
                self._listen()
            elif self._reader:
                self._reader.close()
                self._reader = None
        for clock in self._clocks:
            clock._set_ros_time_is_active(active)

    def attach_clock(self, clock: Clock) -> None:
        """Give a clock this time too. Raises ValueError for any clock but a ROSClock."""
        if not isinstance(clock, ROSClock):
            raise ValueError(f"only clocks of ROS_TIME show simulated time, not {clock!r}")
        clock.set_ros_time_override(self._shown)
        clock._set_ros_time_is_active(self._active)
        self._clocks.append(clock)

    def detach_clock(self, clock: Clock) -> None:
        """Stop giving a clock this time."""
        if clock in self._clocks:
            self._clocks.remove(clock)

    def close(self) -> None:
        """Stop reading; the clocks show the system's time."""
        self.ros_time_is_active = False

    def _follow(self, parameters: list[Parameter]) -> None:
        for each in parameters:
            if each.name == USE_SIM_TIME:
                self.ros_time_is_active = bool(each.value)

    def _listen(self) -> None:
        node = self._node
        topic = node.resolve_topic_name(TOPIC)
        reader = node._holozen.bus.subscribe(names.key(topic), ClockMessage, depth=1)
        self._reader = reader
        threading.Thread(target=self._read, args=(reader,), daemon=True, name="ros clock").start()

    def _read(self, reader: Subscription[ClockMessage]) -> None:
        while self._reader is reader:
            try:
                received = reader.recv()
            except BusError:
                return
            message = received.message
            if message is None or message.clock.sec < 0:
                reason = received.error or "it is negative"
                self._node.get_logger().warning(
                    f"invalid time on {TOPIC}: {reason}", throttle_duration_sec=10.0
                )
                continue
            if self._reader is not reader:
                return
            self._shown = Time(
                seconds=message.clock.sec,
                nanoseconds=message.clock.nanosec,
                clock_type=ClockType.ROS_TIME,
            )
            try:
                for clock in list(self._clocks):
                    clock.set_ros_time_override(self._shown)
            except Exception as error:  # from a jump callback; time must go on
                tracebacks.clean(error)
                self._node.get_logger().error(
                    f"a jump callback of the clock failed:\n{traceback.format_exc()}"
                )
