"""Whether goals that arrive now may be old: they waited for this process, or in a link."""

SUSPENDED = 2.0  # s between two updates, or without odom: this process, or a link, was held up
CATCHING_UP = 1.5  # s after that, in which goals that were sent before may still arrive
LATE = "the controller was suspended when it was sent; send it again"
HELD_UP = "no odom came before it, so a link may have held it up; send it again once odom comes"


class Backlog:
    """Refuses goals for a while after this process was suspended, or after odom was silent."""

    def __init__(self) -> None:
        self._updated: float | None = None  # s
        self._until: float | None = None  # s; goals are refused until then
        self._why = ""

    def update(self, now: float, is_silent: bool) -> str:
        """Why a goal that arrives at `now` (s) is refused; empty if it cannot be old. `is_silent`:
        no odom comes.

        Call it at each poll for goals, before it: a gap between two calls means that this process
        was suspended.
        """
        was_suspended = self._updated is not None and now - self._updated > SUSPENDED
        self._updated = now
        if was_suspended or not self._refuses(now):
            self._why = LATE if was_suspended else HELD_UP
        if was_suspended or is_silent:
            self._until = now + CATCHING_UP
        return self._why if self._refuses(now) else ""

    def _refuses(self, now: float) -> bool:
        return self._until is not None and now < self._until
