"""Whether the terminal, and the person before it, can still be reached. Pure: times are given, in seconds.

A key that is held says nothing while it is held, and a latched one never again: if the line to the terminal breaks, the
robot would drive on. So the terminal is asked again and again, and silence is a stop. Keys that come before the overdue
answer were typed while nobody could see the robot: they do not count.
"""

from collections import deque

EVERY, IDLE = 0.05, 0.5  # s between two questions, while it drives and while it does not
LIMIT = 0.4  # s for an answer; with EVERY less than the half second in which a robot has to stand
GIVE_UP = 2.0  # s until answers that did not come are no longer waited for, and it is asked anew


class Heartbeat:
    """Questions and answers. A terminal that never answered anything is not asked."""

    def __init__(self) -> None:
        self.answers = False  # whether this terminal is known to answer
        self.lost = False  # an answer was overdue, and none came since
        self._asked: deque[float] = deque()
        self._last = 0.0

    def due(self, now: float, drives: bool) -> bool:
        """Whether to ask now."""
        if not self.answers or now - self._last < (GIVE_UP if self.lost else EVERY if drives else IDLE):
            return False
        if self.lost:
            self._asked.clear()  # an answer was swallowed, or it is another terminal than the one that was asked
        self._asked.append(now)
        self._last = now
        return True

    def answered(self) -> None:
        """The oldest question was answered."""
        self.answers = True
        if self._asked:
            self._asked.popleft()
        self.lost = self.lost and bool(self._asked)

    def miss(self, now: float) -> bool:
        """Whether an answer has just become overdue."""
        if self.lost or not self._asked or now - self._asked[0] <= LIMIT:
            return False
        self.lost = True
        return True

    def hurry(self) -> None:
        """If answers are overdue, ask anew at once: something has changed."""
        if self.lost:
            self._last = -GIVE_UP

    def restart(self) -> None:
        """Expect nothing that was asked before."""
        self._asked.clear()
        self.lost = False
