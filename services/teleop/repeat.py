"""A terminal's auto-repeat, learned from what it sends. Pure: times are given, in seconds.

A terminal without key releases shows a held key only by repeating it: once after a first delay, then at an interval.
A key counts as held until a repeat is overdue.
"""

import statistics
from collections import deque

FIRST = 0.7  # s; a first delay that is not known yet is not longer: X has 0.66, most others 0.25 to 0.5
EVERY = 0.2  # s; an interval that is not known yet is not longer
SLACK = 0.045  # s that a repeat may be late by
SHORTEST, LONGEST = 0.15, 0.75  # s; a first delay is between these
SLOWEST = 0.25  # s; an interval is shorter than this
LAST = 16  # gaps that the interval is taken from
SURE = 4  # repeats; fewer may be a person who taps


class Repeat:
    """Follows one key at a time. `patience` is how long after its last event it still counts as held."""

    def __init__(self) -> None:
        self.first: float | None = None  # s; the measured first delay
        self._gaps: deque[float] = deque(maxlen=LAST)
        self._key = ""
        self._at = 0.0  # when its last event came
        self._repeats = 0
        self._maybe = 0.0  # a gap that is the first delay if repeats follow

    @property
    def every(self) -> float | None:
        """The interval in seconds; None before it was measured."""
        return statistics.median(self._gaps) if self._gaps else None

    def see(self, key: str, now: float) -> bool:
        """A key was typed. Whether it is a repeat, and not a new press."""
        gap, same = now - self._at, key == self._key
        again = same and self._is_repeat(gap)
        if same and not again and self._repeats > 1 and gap < SLOWEST:
            self._gaps.append(gap)  # a repeat that came too late, on a slow line; the next may
        self._key, self._at = key, now
        if not again:
            self._repeats, self._maybe = 0, 0.0
            return False
        self._repeats += 1
        if self._repeats == 1 and gap > SHORTEST:
            self._maybe = gap
        elif gap < SLOWEST:
            self._gaps.append(gap)
            if self._maybe and self._repeats >= SURE:
                self.first, self._maybe = self._maybe, 0.0
        return True

    def patience(self) -> float:
        """How long after the last event its key counts as held."""
        if self._repeats == 0:
            return (FIRST if self.first is None else 1.1 * self.first) + SLACK
        return (max(self._gaps) if self._gaps else EVERY) + SLACK

    def _is_repeat(self, gap: float) -> bool:
        if self._repeats:
            return gap <= self.patience()
        if self.every is not None and gap <= 1.5 * self.every:
            return True  # nobody types as fast
        if self.first is None:
            return SHORTEST <= gap <= LONGEST
        return 0.7 * self.first <= gap <= min(1.3 * self.first, LONGEST)
