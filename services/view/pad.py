"""The dead-man of one robot: held buttons of pages -> commanded velocity. No clock, no socket; times in s."""

import math

from holozen.limits import STOP, Planar

HELD = 0.3  # s without a report after which a button is not held
SETTLING = 1.0  # s; the longest that a stop is repeated, until the robot rests

DIRECTIONS: dict[str, Planar] = {
    "forward": (1.0, 0.0, 0.0), "backward": (-1.0, 0.0, 0.0),
    "turn left": (0.0, 0.0, 1.0), "turn right": (0.0, 0.0, -1.0),
    "left": (0.0, 1.0, 0.0), "right": (0.0, -1.0, 0.0),
}  # fmt: skip
"""What a button does: forward, left, counter-clockwise."""
OTHER = "another page drives this robot"
SILENT = f"the button was silent for {HELD:g} s, and counts as let go"
ENDS = "the view ends, and drives no more"
LOST = "odometry was lost, and the button counts as let go"
RESET = "the robot was reset, and the button counts as let go"


class Pad:
    """The held buttons of a robot. One page drives at a time, until it lets go.

    A button that is no longer reported counts as let go. Its page was hidden, frozen or cut off, and may go on
    reporting it later: so it has `expired`, and counts again only once the page has put a new button in its place.
    """

    def __init__(self) -> None:
        self._held: dict[str, float] = {}  # button -> its last report
        self._page = -1  # the one that drives
        self._expired: dict[tuple[int, str], str] = {}  # page and button -> why it counts as let go
        self._stopping = -math.inf  # when the last stop began
        self._ended = False

    def hold(self, page: int, button: str, now: float) -> str:
        """A page reports a held button. Returns why it does not count, or ""."""
        self._expire(now)
        if self._ended:
            return ENDS
        if (page, button) in self._expired:
            return self._expired[page, button]
        if self._held and page != self._page:
            self._expired[page, button] = OTHER  # else it would drive by itself once the other page lets go
            return OTHER
        self._page = page
        self._held[button] = now
        return ""

    def release(self, page: int, button: str, now: float) -> None:
        """A page reports that a button was let go."""
        if page == self._page and self._held.pop(button, None) is not None and not self._held:
            self._stopping = now

    def expired(self, page: int, now: float) -> dict[str, str]:
        """The buttons that a page has to replace, and why they count as let go."""
        self._expire(now)
        return {button: why for (other, button), why in self._expired.items() if other == page}

    def renew(self, page: int, button: str) -> None:
        """A page has replaced a button."""
        self._expired.pop((page, button), None)

    def close(self, page: int, now: float) -> None:
        """A page is gone: stop if it drives."""
        if page == self._page:
            self.stop(now)
        self._expired = {button: why for button, why in self._expired.items() if button[0] != page}

    def stop(self, now: float, why: str = "") -> None:
        """Let go of all buttons, and note `why`. Those that are held have to be pressed again."""
        if self._held:
            self._expired |= {(self._page, button): why for button in self._held}
            self._held.clear()
            self._stopping = now

    def end(self, now: float) -> None:
        """Stop for good: no button counts from now on."""
        self._ended = True
        self.stop(now)

    def stopping_since(self, now: float) -> float | None:
        """When the stop in progress began; None if there is none."""
        self._expire(now)
        return self._stopping if not self._held and now - self._stopping < SETTLING else None

    def command(self, now: float, rests: bool) -> Planar | None:
        """The motion to command, each part from -1 to 1, or None. `rests`: the robot has rested since the stop."""
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
            self.stop(now, SILENT)
