"""The time by which commands grow old, and since when those may have waited that are read."""

STALL = 0.1  # s without reading; commands may have waited this long
DISTRUST = 0.1  # s after a stall in which the network's buffers may still bring old commands
ROUNDING = 1e-6  # s; by which times may be off: the step that ends a silence must not depend on the clock's value


class CommandTime:
    """Real time while the sim plays; while it is held, only its steps pass, so that what a command does in a number of
    steps depends on no computer's speed. It never goes back. In seconds.
    """

    def __init__(self) -> None:
        self._ahead = 0.0  # of real time
        self._held = 0.0  # the time at which it was held
        self._passed = 0.0  # in steps since then
        self.is_held = False  # whether only steps pass
        self.slack = 0.0  # s; a silence that is longer by less has not ended

    def at(self, now: float) -> float:
        """The time when it is `now` in real time."""
        return self._held + self._passed if self.is_held else now + self._ahead

    def real(self, time: float) -> float:
        """The real time at which it will be `time`; while it is held that is not known: long ago."""
        return -1.0 if self.is_held else time - self._ahead

    def hold(self, now: float) -> None:
        """Let only steps pass."""
        self._held, self._passed, self.is_held, self.slack = self.at(now), 0.0, True, ROUNDING

    def step(self, dt: float) -> None:
        """Let a step of `dt` seconds pass, if it is held."""
        self._passed += dt

    def play(self, now: float) -> None:
        """Let real time pass."""
        self._ahead, self.is_held, self.slack = self.at(now) - now, False, 0.0


class Reads:
    """When commands were read, from `now` (s) on."""

    def __init__(self, now: float) -> None:
        self._last = self._before_stall = now
        self._trusted_from = 0.0

    def since(self, now: float) -> float:
        """Commands are read at `now`: the time at or after which those came that wait."""
        if now - self._last > STALL:
            self._before_stall, self._trusted_from = self._last, now + DISTRUST
        since = self._last if now >= self._trusted_from else self._before_stall
        self._last = now
        return since
