"""Pacing: when the next step is due, on a monotonic clock and without drift."""

STALL = 0.1  # s; a sim that is later than this starts anew from now instead of racing to catch up


class Pace:
    """Steps of `dt` simulated seconds at `rtf` times real time; an `rtf` of 0 never waits."""

    def __init__(self, dt: float, rtf: float, now: float) -> None:
        self._period = dt / rtf if rtf else 0.0
        self._due = now
        self.lost = 0.0  # s of real time given up after stalls

    def left(self, now: float) -> float:
        """Seconds until the next step; zero or less when it is due."""
        return self._due - now if self._period else 0.0

    def stepped(self, now: float) -> None:
        """A step was made: the next is one period after the time this one was due."""
        self._due += self._period
        if now - self._due > STALL:
            self.lost += now - self._due
            self._due = now
