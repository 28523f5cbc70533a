"""When a message of a bag is due. Pure: time is an argument, in seconds of a clock that never goes back."""


class Pace:
    """Bag time (ns) -> time here (s), at `rate`. All is measured from one origin, so nothing drifts."""

    def __init__(self, rate: float) -> None:
        self._rate, self._at, self._now = rate, 0, 0.0

    def jump(self, at: int, now: float) -> None:
        """From `now` on, the bag stands at `at`."""
        self._at, self._now = at, now

    def due(self, at: int) -> float:
        """When a message that was recorded at `at` is due."""
        return self._now + (at - self._at) / 1e9 / self._rate

    def position(self, now: float) -> int:
        """Where the bag stands at `now`."""
        return self._at + round((now - self._now) * self._rate * 1e9)
