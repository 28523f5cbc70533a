"""Pacing: when the next step is due, on a monotonic clock and without drift."""

STALL = 0.1  # s; a sim that is later than this drops the backlog: an overrun
CATCH_UP = 0.5  # of a period, at least, between two steps: what is late is made good at twice the pace, not in a burst
FACTORS = (0.0, 1000.0)  # real-time factors that may be set


class Pace:
    """Steps of `dt` simulated seconds at `rtf` times real time; an `rtf` of 0 never waits."""

    def __init__(self, dt: float, rtf: float, now: float) -> None:
        self._dt = dt
        self.set_factor(rtf, now)
        self.overruns = 0  # how often a backlog was dropped
        self.lost = 0.0  # s of real time that was dropped with them

    def set_factor(self, rtf: float, now: float) -> None:
        """Run at `rtf` from `now` on."""
        self.rtf, self._period, self._due, self._earliest = rtf, self._dt / rtf if rtf else 0.0, now, now

    def left(self, now: float) -> float:
        """Seconds until the next step; zero or less when it is due."""
        return max(self._due, self._earliest) - now if self._period else 0.0

    def stepped(self, now: float) -> None:
        """Record a step that began at `now`: the next is due one period after this one was due."""
        self._due += self._period
        self._earliest = now + CATCH_UP * self._period
        if self._period and now - self._due > STALL:
            self.overruns += 1
            self.lost += now - self._due
            self._due = now
