"""Which robots have to be moved, and which have something to publish, without asking each of them at each step."""

import heapq
import math
from collections.abc import Hashable
from itertools import count
from typing import Generic, TypeVar

R = TypeVar("R", bound=Hashable)  # a robot


class Times(Generic[R]):
    """When each robot is due: at the time that was set last."""

    def __init__(self) -> None:
        self._at: dict[R, float] = {}
        self._all: list[tuple[float, int, R]] = []  # a heap, also of times that have been replaced
        self._count = count()

    def set(self, robot: R, at: float) -> None:
        """It is due at `at`, in s."""
        self._at[robot] = at
        if at < math.inf:
            heapq.heappush(self._all, (at, next(self._count), robot))

    def due(self, now: float) -> list[R]:
        """The robots that are due by `now`, the earliest first. They are not due again until that is set."""
        found = []
        while self._all and self._all[0][0] <= now:
            at, _, robot = heapq.heappop(self._all)
            if self._at.get(robot) == at:
                del self._at[robot]
                found.append(robot)
        return found

    def forget(self, robot: R) -> None:
        """It is never due."""
        self._at.pop(robot, None)
        self._all = [one for one in self._all if one[2] is not robot]
        heapq.heapify(self._all)


class Agenda(Generic[R]):
    """Who is `restless`: has to be moved at each step. The others go on as they were commanded until a time, which is
    real and in `moves`, as are those of `statuses`. Those in `publishes` are sim times.
    """

    def __init__(self) -> None:
        self.restless: dict[R, None] = {}
        self.moves: Times[R] = Times()
        self.publishes: Times[R] = Times()
        self.statuses: Times[R] = Times()

    def forget(self, robot: R) -> None:
        """It was removed."""
        self.restless.pop(robot, None)
        self.moves.forget(robot)
        self.publishes.forget(robot)
        self.statuses.forget(robot)
