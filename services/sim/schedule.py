"""When things are due: the next step, telemetry at a rate, and each robot. No clock: times are arguments."""

import heapq
import math
from collections.abc import Hashable
from itertools import count
from typing import Generic, TypeVar

STALL = 0.1  # s; a sim that is later than this drops the backlog: an overrun
CATCH_UP = 0.5  # the least time between two steps, in periods: a late sim catches up at twice the pace, not in a burst
FACTORS = (0.0, 1000.0)  # real-time factors that may be set


class Pace:
    """Paces steps of `dt` simulated seconds at `rtf` times real time; with an `rtf` of 0 they never wait."""

    def __init__(self, dt: float, rtf: float, now: float) -> None:
        self._dt = dt
        self.set_factor(rtf, now)
        self.overruns = 0  # how often a backlog was dropped
        self.lost = 0.0  # s of real time in all of these

    def set_factor(self, rtf: float, now: float) -> None:
        """Run at `rtf` from `now` (s) on."""
        self.rtf, self._period, self._due, self._earliest = rtf, self._dt / rtf if rtf else 0.0, now, now

    def left(self, now: float) -> float:
        """Seconds until the next step; zero or less when it is due."""
        return max(self._due, self._earliest) - now if self._period else 0.0

    def stepped(self, now: float) -> None:
        """Record a step that began at `now` (s): the next one is due a period after this one was due."""
        self._due += self._period
        self._earliest = now + CATCH_UP * self._period
        if self._period and now - self._due > STALL:
            self.overruns += 1
            self.lost += now - self._due
            self._due = now


class Schedule:
    """When something with a rate in Hz is due, on a monotonic clock in seconds. `phase`, from 0 to 1, shifts it from
    others of the same rate.
    """

    def __init__(self, rate: float, phase: float = 0.0) -> None:
        self._phase = phase
        self.set_rate(rate)

    def set_rate(self, rate: float) -> None:
        """Set the rate; it is due at once."""
        self.rate, self._count = rate, -1

    def due(self, time: float) -> bool:
        """Whether a new period has begun since the last call, or the clock was set back."""
        count = int(time * self.rate + self._phase + 1e-6)
        began = count != self._count
        self._count = count
        return began

    @property
    def next(self) -> float:
        """The earliest time (s) at which it is due again."""
        return (self._count + 1 - self._phase - 1e-6) / self.rate if self.rate else math.inf


R = TypeVar("R", bound=Hashable)  # a robot


class Times(Generic[R]):
    """When each robot is due: at the time that was set last."""

    def __init__(self) -> None:
        self._at: dict[R, float] = {}
        self._all: list[tuple[float, int, R]] = []  # a heap, which also has times that were replaced
        self._count = count()

    def set(self, robot: R, at: float) -> None:
        """Let a robot be due at `at` (s)."""
        self._at[robot] = at
        if at < math.inf:
            heapq.heappush(self._all, (at, next(self._count), robot))

    def due(self, now: float) -> list[R]:
        """The robots that are due by `now` (s), the earliest first. They are not due again until that is set."""
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
    """What is due for each robot. Those that are `active` are moved at each step; the others go on as commanded until
    their time in `moves`. The times in `moves` and `statuses` are real times, those in `publishes` sim times.
    """

    def __init__(self) -> None:
        self.active: dict[R, None] = {}
        self.moves: Times[R] = Times()
        self.publishes: Times[R] = Times()
        self.statuses: Times[R] = Times()

    def forget(self, robot: R) -> None:
        """Remove a robot."""
        self.active.pop(robot, None)
        self.moves.forget(robot)
        self.publishes.forget(robot)
        self.statuses.forget(robot)
