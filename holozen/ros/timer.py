"""Timer: a callback every so often on a clock. Rate: sleep so that a loop keeps a rate."""

from collections.abc import Callable
from typing import Any

from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.clock import Clock
from holozen.ros.context import Context
from holozen.ros.exceptions import InvalidHandle, ROSInterruptException
from holozen.ros.inbox import Waker
from holozen.ros.missing import Told

__all__ = ["Rate", "Timer"]


class Timer(Told):
    """Made by `Node.create_timer`. A call that is late is made once; the next keeps to the period's own beat."""

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
        self._waker = Waker()
        self._destroyed = False
        if autostart:
            self.reset()
        clock.watchers.add(self._look_again)

    @property
    def clock(self) -> Clock:
        """The clock it goes by."""
        return self._clock

    @property
    def timer_period_ns(self) -> int:
        """Nanoseconds between two calls. A new one holds from the next call on."""
        return self._period

    @timer_period_ns.setter
    def timer_period_ns(self, value: int) -> None:
        """Hold from the next call on."""
        self._period = int(value)

    def is_ready(self) -> bool:
        """Whether a call is due."""
        return not self._cancelled and self._clock.nanoseconds() >= self._next

    def is_canceled(self) -> bool:
        """Whether it was cancelled and not reset."""
        return self._cancelled

    def cancel(self) -> None:
        """Call no more, until `reset`."""
        self._cancelled = True

    def reset(self) -> None:
        """Begin anew: the next call is a period from now."""
        if self._destroyed:
            raise InvalidHandle("this timer was destroyed")
        self._last = self._clock.nanoseconds()
        self._next, self._cancelled = self._last + self._period, False
        self._look_again()

    def time_since_last_call(self) -> int:
        """Nanoseconds since it was called, or reset."""
        return self._clock.nanoseconds() - self._last

    def time_until_next_call(self) -> int | None:
        """Nanoseconds, below zero if it is late; None if it was cancelled."""
        return None if self._cancelled else self._next - self._clock.nanoseconds()

    def destroy(self) -> None:
        """Never call again."""
        self._destroyed = self._cancelled = True
        self._clock.watchers.discard(self._look_again)

    def silence(self) -> None:
        """Never call again; its node is about to leave."""
        self.destroy()

    def take(self) -> Callable[[], Any] | None:
        """The callback if it is due; then the next call is a period later."""
        if self._cancelled:
            return None
        now = self._clock.nanoseconds()
        if self._last > now or not self._last:  # the clock was set back, or simulated time begins
            self._last, self._next = now, now + self._period
        if now < self._next or not now:
            return None
        self._last = now
        missed = (now - self._next) // self._period if self._period else 0
        self._next = self._next + (missed + 1) * self._period if self._period else now
        return self.callback

    def arm(self, waker: Waker) -> None:
        """Wake `waker` when simulated time moves."""
        self._waker = waker

    def wait_seconds(self) -> float | None:
        """Seconds until it is due; None if it is never, or simulated time says when."""
        return None if self._cancelled else self._clock.wait_seconds(self._next)

    def _look_again(self) -> None:
        self._waker.wake()


class Rate(Told):
    """Made by `Node.create_rate`: `sleep()` in a loop makes it go round that often. Needs nobody who spins."""

    def __init__(self, period_ns: int, clock: Clock, context: Context) -> None:
        self._period, self._clock, self._context = period_ns, clock, context
        self._next = clock.nanoseconds() + period_ns
        self._destroyed = False

    def sleep(self) -> None:
        """Sleep until the period is over, or the clock is set back, as that of a sim that is started again.

        Raises ROSInterruptException when rclpy is shut down.
        """
        if self._destroyed:
            raise RuntimeError("Rate cannot sleep because it has been destroyed")
        if not self._context.ok():
            raise ROSInterruptException
        now = self._clock.nanoseconds()
        if self._next - now > self._period or now - self._next > self._period:  # set back, or the loop was late
            self._next = now if now > self._next else now + self._period
        self._clock._sleep(self._next, self._context, since=now)
        self._next += self._period
        if not self._context.ok():
            raise ROSInterruptException

    def destroy(self) -> None:
        """Sleep no more."""
        self._destroyed = True

    def silence(self) -> None:
        """Sleep no more; its node is about to leave."""
        self.destroy()
