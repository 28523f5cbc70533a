"""Timer: a callback at a fixed period of a clock. Rate: a sleep that keeps a loop at a rate."""

import contextlib
from collections.abc import Callable
from typing import Any

from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.clock import Clock
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.exceptions import (
    InvalidHandle,
    NotInitializedException,
    ROSInterruptException,
)
from holozen.ros.rclpy.waitable import Waitable

__all__ = ["Rate", "Timer"]


class Timer(HelpfulAttributes, Waitable):
    """Created by `Node.create_timer`. One call makes up for all missed ones; the next keeps to the
    original period.
    """

    def __init__(
        self,
        callback: Callable[..., Any] | None,
        callback_group: CallbackGroup | None,
        timer_period_ns: int,
        clock: Clock,
        *,
        context: Context | None = None,
        autostart: bool = True,
    ) -> None:
        if timer_period_ns < 0:
            raise ValueError(f"timer period must be non-negative, and {timer_period_ns} ns is not")
        self.callback, self.callback_group, self._clock = callback, callback_group, clock
        self._period, self._cancelled = timer_period_ns, not autostart
        self._last = self._next = 0  # ns
        self._destroyed = False
        if autostart:
            self.reset()
        clock.watchers.add(self._wake)

    @property
    def clock(self) -> Clock:
        """Its clock."""
        return self._clock

    @property
    def timer_period_ns(self) -> int:
        """Nanoseconds between two calls. A new value takes effect after the next call."""
        return self._period

    @timer_period_ns.setter
    def timer_period_ns(self, value: int) -> None:
        """Takes effect after the next call."""
        self._period = int(value)

    def is_ready(self) -> bool:
        """Whether a call is due."""
        return not self._cancelled and self._clock.nanoseconds() >= self._next

    def is_canceled(self) -> bool:
        """Whether it was cancelled and not reset."""
        return self._cancelled

    def cancel(self) -> None:
        """Make no calls until `reset`."""
        self._cancelled = True

    def reset(self) -> None:
        """Start again: the next call is one period from now."""
        if self._destroyed:
            raise InvalidHandle("this timer was destroyed")
        self._last = self._clock.nanoseconds()
        self._next, self._cancelled = self._last + self._period, False
        self._wake()

    def time_since_last_call(self) -> int:
        """Nanoseconds since the last call or reset."""
        return self._clock.nanoseconds() - self._last

    def time_until_next_call(self) -> int | None:
        """Nanoseconds, negative if the call is late; None if it was cancelled."""
        return None if self._cancelled else self._next - self._clock.nanoseconds()

    def destroy(self) -> None:
        """Never call again."""
        self._destroyed = self._cancelled = True
        self._clock.watchers.discard(self._wake)

    detach = destroy

    def take(self) -> Callable[[], Any] | None:
        """The callback if it is due; the next call is then one period later."""
        if self._cancelled:
            return None
        now = self._clock.nanoseconds()
        # the clock was set back, or simulated time has begun
        if self._last > now or not self._last:
            self._last, self._next = now, now + self._period
        if now < self._next or not now:
            return None
        self._last = now
        missed = (now - self._next) // self._period if self._period else 0
        self._next = self._next + (missed + 1) * self._period if self._period else now
        return self.callback

    def wait_seconds(self) -> float | None:
        """Seconds until it is due; None if it was cancelled, or if simulated time decides."""
        return None if self._cancelled else self._clock.wait_seconds(self._next)

    def _wake(self) -> None:
        self._waker.wake()


class Rate(HelpfulAttributes):
    """Created by `Node.create_rate`: `sleep()` keeps a loop at that rate. It does not need the node
    to be spun.
    """

    def __init__(self, period_ns: int, clock: Clock, context: Context) -> None:
        self._period, self._clock, self._context = period_ns, clock, context
        self._next = clock.nanoseconds() + period_ns
        self._destroyed = False

    def sleep(self) -> None:
        """Sleep until the end of the period, or until the clock is set back, as by a restarted sim.

        Raises ROSInterruptException when rclpy is shut down.
        """
        if not self._context.ok():
            raise ROSInterruptException
        if self._destroyed:
            raise RuntimeError("Rate cannot sleep because it has been destroyed")
        now = self._clock.nanoseconds()
        # set back, or the loop was late
        if self._next - now > self._period or now - self._next > self._period:
            self._next = now if now > self._next else now + self._period
        with contextlib.suppress(NotInitializedException):  # shut down since
            self._clock.sleep_nanoseconds(self._next, self._context, since=now)
        self._next += self._period
        if not self._context.ok():
            raise ROSInterruptException

    def destroy(self) -> None:
        """Sleep no more."""
        self._destroyed = True

    detach = destroy
