"""The clock that measures silence."""

# s of tolerance: which step ends a silence must not depend on rounding errors of the clock
ROUNDING = 1e-6


class CommandTime:
    """The clock that measures the silence of sources, in seconds. It follows real time while the
    sim plays, and only the sim's steps while that is paused: so the effect of a command over a
    number of steps does not depend on the speed of the computer. It never goes back.
    """

    def __init__(self) -> None:
        self._ahead = 0.0  # of real time
        self._paused_at = 0.0
        self._stepped = 0.0  # s of steps since then
        self.is_paused = False
        self.slack = 0.0  # s of tolerance when a silence is compared with its limit

    def at(self, now: float) -> float:
        """The time on this clock at the real time `now`."""
        return self._paused_at + self._stepped if self.is_paused else now + self._ahead

    def real(self, time: float) -> float | None:
        """The real time at which this clock will show `time`; None while it is paused, when that is
        unknown.
        """
        return None if self.is_paused else time - self._ahead

    def pause(self, now: float) -> None:
        """Advance by steps only."""
        self._paused_at = self.at(now)
        self._stepped = 0.0
        self.is_paused = True
        self.slack = ROUNDING

    def step(self, dt: float) -> None:
        """Advance by a step of `dt` seconds, if it is paused."""
        self._stepped += dt

    def play(self, now: float) -> None:
        """Follow real time."""
        self._ahead = self.at(now) - now
        self.is_paused = False
        self.slack = 0.0
