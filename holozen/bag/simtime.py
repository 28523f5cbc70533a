"""The time of the simulation, by its `clock`. Pure: all times are arguments, in ns."""

KEY = "clock"
LONGEST = 100_000_000  # ns; between two ticks the time goes on by no more than this, as when the sim stands still


class SimTime:
    """What the sim's clock shows when a sample comes, between its ticks too."""

    def __init__(self) -> None:
        self._tick = self._came = self._last = -1

    def tick(self, shows: int, at: int) -> None:
        """The clock said `shows`, at `at` by our own clock."""
        if shows < self._tick:  # the sim was reset
            self._last = shows
        self._tick, self._came = shows, at

    def of(self, at: int) -> int | None:
        """The sim's time at `at`; None before the first tick. It goes back only with a reset."""
        if self._tick < 0:
            return None
        self._last = max(self._last, self._tick + min(at - self._came, LONGEST))
        return self._last
