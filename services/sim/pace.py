"""Pacing: when the next step is due, on a monotonic clock and without drift."""

STALL = 0.1  # s; a sim that is later than this drops the backlog instead of racing to catch up

FACTORS = (0.0, 1000.0)  # real-time factors that may be set


class Pace:
    """Steps of `dt` simulated seconds at `rtf` times real time; an `rtf` of 0 never waits."""

    def __init__(self, dt: float, rtf: float, now: float) -> None:
        self._dt = dt
        self.set_factor(rtf, now)
        self.lost = 0.0  # s of real time given up after stalls

    def set_factor(self, rtf: float, now: float) -> None:
        """Run at `rtf` from `now` on."""
        self.rtf, self._period, self._due = rtf, self._dt / rtf if rtf else 0.0, now

    def left(self, now: float) -> float:
        """Seconds until the next step; zero or less when it is due."""
        return self._due - now if self._period else 0.0

    def stepped(self, now: float) -> None:
        """Record a step: the next is due one period after this one was due."""
        self._due += self._period
        if now - self._due > STALL:
            self.lost += now - self._due
            self._due = now
