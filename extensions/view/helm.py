"""The dead-man of one robot: what pages hold -> the velocity to command. No clock, no socket; times
in s.
"""

from typing import NamedTuple

from holozen.limits import Planar

HELD = 0.4  # s without a report after which nothing is held
SETTLING = 1.0  # s; the longest that a stop is repeated, until the robot rests

OTHER = "another page drives this robot"
SILENT = f"nothing was heard of this page for {HELD:g} s; press again"
ENDS = "the view ends, and drives no more"
LOST = "odometry was lost; press again once it is back"
RESET = "the robot was reset; press again"
STOPPED = "the robot was stopped"


class Hold(NamedTuple):
    """What drives a robot.

    Attributes:
        page: The page on which it is held.
        press: The number of the press there, from 1.
        motion: What it commands.
        heard_at: When the page last reported it, in s.
    """

    page: int
    press: int
    motion: Planar
    heard_at: float


class Helm:
    """Which page drives a robot, and with which press: what a person holds until all of it is let
    go.

    One page drives at a time. A press that is no longer reported counts as let go: its page was
    hidden, frozen or cut off, and may go on reporting it later. So a press that has ended never
    counts again; its person has to let go, and press again.
    """

    def __init__(self) -> None:
        self._held: Hold | None = None
        self._ended: dict[int, int] = {}  # page -> its last press that has ended
        self._dropped: dict[
            int, tuple[int, str]
        ] = {}  # page -> a press that counts as let go, and why
        self._stopping: float | None = None  # when the last stop began; None once the robot rests
        self._has_ended = False

    @property
    def page(self) -> int | None:
        """The page that drives; None if none does."""
        return self._held.page if self._held else None

    def hold(self, page: int, press: int, motion: Planar, now: float) -> bool:
        """A page reports what is held. Returns whether that counts."""
        self.expire(now)
        if press <= self._ended.get(page, 0):
            return False
        if self._has_ended or self.page not in (None, page):
            self._drop(page, press, ENDS if self._has_ended else OTHER)
            return False
        self._held = Hold(page, press, motion, now)
        return True

    def let_go(self, page: int, press: int, now: float) -> bool:
        """A page reports that all was let go. Returns whether that was what drove the robot."""
        held = self._held
        drives = held is not None and page == held.page and held.press <= press
        self._ended[page] = max(press, self._ended.get(page, 0))
        if drives:
            self._held, self._stopping = None, now
        return drives

    def dropped(self, page: int) -> tuple[int, str] | None:
        """The press of a page that counts as let go since the last call, and why."""
        return self._dropped.pop(page, None)

    def close(self, page: int, now: float) -> None:
        """A page is gone: stop if it drives."""
        if page == self.page:
            self.stop(now, "")
        self._ended.pop(page, None)
        self._dropped.pop(page, None)

    def stop(self, now: float, why: str) -> None:
        """Let go of what is held, and note `why`: it has to be pressed again."""
        if held := self._held:
            self._drop(held.page, held.press, why)
            self._held, self._stopping = None, now

    def end(self, now: float) -> None:
        """Stop for good: nothing counts from now on."""
        self._has_ended = True
        self.stop(now, ENDS)

    def expire(self, now: float) -> None:
        """Let go of what was not reported for HELD."""
        if self._held and now - self._held.heard_at > HELD:
            self.stop(now, SILENT)

    def stopping_since(self, now: float) -> float | None:
        """When the stop in progress began; None if there is none."""
        if self._held or self._stopping is None or now - self._stopping >= SETTLING:
            return None
        return self._stopping

    def rest(self) -> None:
        """The robot has rested since the stop, which ends that."""
        self._stopping = None

    @property
    def motion(self) -> Planar | None:
        """What is held; None if nothing is."""
        return self._held.motion if self._held else None

    def _drop(self, page: int, press: int, why: str) -> None:
        self._ended[page] = max(press, self._ended.get(page, 0))
        self._dropped[page] = press, why
