"""When things are due: the next step, telemetry at a rate, and each robot. No clock: times are
arguments.
"""

import heapq
import math
from collections.abc import Hashable
from itertools import count
from typing import Generic, TypeVar

STALL = 0.1  # s; a sim that is later than this drops the backlog: an overrun
# the least time between two steps, in periods: a late sim catches up at twice the pace, not in a
# burst
CATCH_UP = 0.5
FACTORS = (0.0, 1000.0)  # real-time factors that may be set


class Pace:
    """Paces steps of `dt` simulated seconds at `rtf` times real time; with an `rtf` of 0 they never
    wait.
    """

    def __init__(self, dt: float, rtf: float, now: float) -> None:
        self._dt = dt
        self.set_factor(rtf, now)
        self.overruns = 0  # how often a backlog was dropped
        self.lost = 0.0  # s of real time in all of these

    def set_factor(self, rtf: float, now: float) -> None:
        """Run at `rtf` from `now` (s) on."""
        self.rtf, self._period, self._due, self._earliest = (
            rtf,
            self._dt / rtf if rtf else 0.0,
            now,
            now,
        )

    def left(self, now: float) -> float:
        """Seconds until the next step; zero or less when it is due."""
        return max(self._due, self._earliest) - now if self._period else 0.0

    def stepped(self, now: float) -> None:
        """Record a step that began at `now` (s): the next one is due a period after this one was
        due.
        """
        self._due += self._period
        self._earliest = now + CATCH_UP * self._period
        if self._period and now - self._due > STALL:
            self.overruns += 1
            self.lost += now - self._due
            self._due = now


class Schedule:
    """When something with a rate in Hz is due, on a monotonic clock in seconds. `phase`, from 0 to
    1, shifts it from others of the same rate.
    """

    def __init__(self, rate: float, phase: float = 0.0) -> None:
        self._phase = phase
        self.set_rate(rate)

    def set_rate(self, rate: float) -> None:
        """Set the rate; it is due at once."""
        self.rate = rate
        # the number of the present period; None before the first one
        self._period: int | None = None

    def advance(self, time: float) -> bool:
        """Go on to `time` (s). Returns whether a new period has begun since the last call, or the
        clock was set back: then it is due.
        """
        period = int(time * self.rate + self._phase + 1e-6)
        began = period != self._period
        self._period = period
        return began

    @property
    def next(self) -> float:
        """The earliest time (s) at which it is due again; 0 if that is at once."""
        if self._period is None:
            return 0.0
        return (self._period + 1 - self._phase - 1e-6) / self.rate if self.rate else math.inf


R = TypeVar("R", bound=Hashable)  # a robot


class Times(Generic[R]):
    """When each robot is due: at the time that was set last."""

    def __init__(self) -> None:
        self._at: dict[R, float] = {}
        # a heap, which also has times that were replaced
        self._all: list[tuple[float, int, R]] = []
        self._count = count()

    def set(self, robot: R, at: float) -> None:
        """Let a robot be due at `at` (s)."""
        self._at[robot] = at
        if at < math.inf:
            heapq.heappush(self._all, (at, next(self._count), robot))

    def take(self, now: float) -> list[R]:
        """Take out the robots that are due by `now` (s), the earliest first. They are not due again
        until that is set.
        """
        found = []
        while self._all and self._all[0][0] <= now:
            at, _, robot = heapq.heappop(self._all)
            if self._at.get(robot) == at:
                del self._at[robot]
                found.append(robot)
        return found

    def forget(self, robot: R) -> None:
        """Let a robot never be due."""
        self._at.pop(robot, None)
        self._all = [one for one in self._all if one[2] is not robot]
        heapq.heapify(self._all)


class Agenda(Generic[R]):
    """What is due for each robot. Some are moved at each step; the others go on as commanded until
    their time comes, or they are woken.

    Attributes:
        publishes: When they publish, in sim time.
        statuses: When they publish the status of their commands, in real time.
    """

    def __init__(self) -> None:
        self._active: dict[R, None] = {}
        self._rests: Times[R] = Times()  # the ends of rests, in real time
        self.publishes: Times[R] = Times()
        self.statuses: Times[R] = Times()

    def add(self, robot: R) -> None:
        """Let everything of a robot be due at once."""
        self.wake(robot)
        self.publishes.set(robot, 0.0)
        self.statuses.set(robot, 0.0)

    def wake(self, robot: R) -> None:
        """Move a robot at each step again."""
        self._active[robot] = None

    def rest(self, robot: R, until: float) -> None:
        """Do not move a robot until a time (s)."""
        del self._active[robot]
        self._rests.set(robot, until)

    def take_moving(self, now: float) -> list[R]:
        """End the rests that are over by `now` (s). Returns the robots to be moved in the next
        step.
        """
        for robot in self._rests.take(now):
            self._active[robot] = None
        return list(self._active)

    def forget(self, robot: R) -> None:
        """Remove a robot."""
        self._active.pop(robot, None)
        self._rests.forget(robot)
        self.publishes.forget(robot)
        self.statuses.forget(robot)
