"""The dead-man of one robot: held buttons of pages -> the commanded velocity. No clock, no socket; times in s."""

import math

from holozen.limits import STOP, Planar

HELD = 0.3  # s; a button that was not reported for so long is not held
SETTLING = 1.0  # s in which a stop is repeated while the robot does not rest

DIRECTIONS: dict[str, Planar] = {
    "forward": (1.0, 0.0, 0.0), "backward": (-1.0, 0.0, 0.0),
    "turn left": (0.0, 0.0, 1.0), "turn right": (0.0, 0.0, -1.0),
    "left": (0.0, 1.0, 0.0), "right": (0.0, -1.0, 0.0),
}  # fmt: skip
"""What a button does: forward, left, counter-clockwise."""
OTHER = "another page drives this robot"


class Pad:
    """One page drives at a time, until it lets go.

    A button whose reports stay away counts as let go. Its page was hidden, frozen or cut off, and may go on reporting
    it later: so it is `worn`, and counts again only once the page has a new button in its place.
    """

    def __init__(self) -> None:
        self._held: dict[str, float] = {}  # button -> its last report
        self._page = -1  # that drives
        self._worn: set[tuple[int, str]] = set()
        self._stopping = -math.inf  # since when

    def hold(self, page: int, button: str, now: float) -> str:
        """A page reports a held button. Returns why it does not count, or nothing."""
        self._expire(now)
        if (page, button) in self._worn:
            return ""
        if self._held and page != self._page:
            return OTHER
        self._page = page
        self._held[button] = now
        return ""

    def release(self, page: int, button: str, now: float) -> None:
        """A page reports that a button was let go."""
        if page == self._page and self._held.pop(button, None) is not None and not self._held:
            self._stopping = now

    def worn(self, page: int, now: float) -> list[str]:
        """The buttons that this page has to replace."""
        self._expire(now)
        return [button for other, button in self._worn if other == page]

    def renew(self, page: int, button: str) -> None:
        """A page has replaced a button."""
        self._worn.discard((page, button))

    def close(self, page: int, now: float) -> None:
        """A page is gone: what it drives stops."""
        if page == self._page:
            self.stop(now)
        self._worn = {worn for worn in self._worn if worn[0] != page}

    def stop(self, now: float) -> None:
        """Let go of everything; what is held has to be pressed again."""
        if self._held:
            self._worn |= {(self._page, button) for button in self._held}
            self._held.clear()
            self._stopping = now

    def stopping_since(self, now: float) -> float | None:
        """Since when a stop is repeated; None if none is."""
        self._expire(now)
        return self._stopping if not self._held and now - self._stopping < SETTLING else None

    def command(self, now: float, rests: bool) -> Planar | None:
        """The motion to command, each part from -1 to 1; None: nothing. `rests`: the robot stands since the stop."""
        if self.stopping_since(now) is not None:
            if rests:
                self._stopping = -math.inf
                return None
            return STOP
        if not self._held:
            return None
        x, y, turn = (sum(part) for part in zip(*(DIRECTIONS[button] for button in self._held), strict=True))
        length = max(1.0, math.hypot(x, y))
        return x / length, y / length, max(-1.0, min(1.0, turn))

    def _expire(self, now: float) -> None:
        if self._held and now - min(self._held.values()) > HELD:
            self.stop(now)
