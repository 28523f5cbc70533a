"""Which keys are held. Pure: times are arguments, in seconds.

In the mode `hold` a key counts while it is held: from press to release if the terminal reports
both, else while it repeats. A terminal without key releases only repeats a held key, once after a
first delay, and then at an interval. Both are measured, and a key counts as held until a repeat is
overdue. In the mode `latch` a key counts until another one is pressed.
"""

import math
import statistics
from collections import deque

FIRST = 0.7  # s; bound of an unknown first delay: X has 0.66, most others 0.25 to 0.5
EVERY = 0.2  # s; bound of an unknown interval
SLACK = 0.045  # s; tolerance for a late repeat
MIN_FIRST_DELAY, MAX_FIRST_DELAY = 0.15, 0.75  # s; range of a first delay
SLOWEST = 0.25  # s; bound of an interval
LAST = 16  # gaps over which the interval is measured
SURE = 4  # repeats; fewer may be taps


class Repeat:
    """Measures the repeats of one key at a time, and tells them from new presses."""

    def __init__(self) -> None:
        self.first: float | None = None  # s; the measured first delay
        self._gaps: deque[float] = deque(maxlen=LAST)
        self._key: str | None = None  # the last one; None before the first
        self._at = 0.0  # time of its last event
        self._repeats = 0
        self._maybe: float | None = None  # a gap that is the first delay if repeats follow

    @property
    def every(self) -> float | None:
        """The interval in seconds; None until it has been measured."""
        return statistics.median(self._gaps) if self._gaps else None

    def see(self, key: str, now: float) -> bool:
        """Take a typed key; returns whether it is a repeat rather than a new press."""
        gap, same = now - self._at, key == self._key
        again = same and self._is_repeat(gap)
        if same and not again and self._repeats > 1 and gap < SLOWEST:
            self._gaps.append(gap)  # a late repeat on a slow line; the next one may be as late
        self._key, self._at = key, now
        if not again:
            self._repeats, self._maybe = 0, None
            return False
        self._repeats += 1
        if self._repeats == 1 and gap > MIN_FIRST_DELAY:
            self._maybe = gap
        elif gap < SLOWEST:
            self._gaps.append(gap)
            if self._maybe and self._repeats >= SURE:
                self.first, self._maybe = self._maybe, None
        return True

    def patience(self) -> float:
        """How long (s) the key counts as held after its last event."""
        if self._repeats == 0:
            return (FIRST if self.first is None else 1.1 * self.first) + SLACK
        return (max(self._gaps) if self._gaps else EVERY) + SLACK

    def _is_repeat(self, gap: float) -> bool:
        if self._repeats:
            return gap <= self.patience()
        if self.every is not None and gap <= 1.5 * self.every:
            return True  # no person types that fast
        if self.first is None:
            return MIN_FIRST_DELAY <= gap <= MAX_FIRST_DELAY
        return 0.7 * self.first <= gap <= min(1.3 * self.first, MAX_FIRST_DELAY)


HOLD, LATCH = "hold", "latch"


class KeyState:
    """The held keys. With a `timeout` a typed key counts for that many seconds; without, while it
    repeats.
    """

    def __init__(self, mode: str = HOLD, timeout: float | None = None) -> None:
        self.mode = mode
        self.repeat = Repeat()
        self.timeout = timeout
        self._pressed: dict[str, str] = {}  # code -> key
        self._typed: str | None = None  # the held key whose release will not be reported
        self._at = 0.0  # when it was typed
        # a typed key, released while it repeats: it counts again only once it is pressed again
        self._spent: str | None = None
        # when the spent key was last seen, if it must not count before it is released; else None
        self._ignored_at: float | None = None

    @property
    def keys(self) -> tuple[str, ...]:
        """The held keys, in the order of their presses."""
        return (*self._pressed.values(), *([self._typed] if self._typed is not None else []))

    def press(self, key: str, code: str) -> None:
        """Take a press whose release will be reported."""
        if self.mode == LATCH:
            self._pressed, self._typed = {}, key
        else:
            self._pressed[code], self._typed = key, None

    def release(self, code: str) -> bool:
        """Take a release; returns whether the key was held."""
        return self._pressed.pop(code, None) is not None

    def type(self, key: str, now: float) -> bool:
        """Take a typed key, whose release will not be reported; returns whether it counts as
        held.
        """
        again = self.repeat.see(key, now)
        ignored_at = self._ignored_at if self._spent == key else None
        if ignored_at is not None and now - ignored_at <= MAX_FIRST_DELAY:
            self._ignored_at = now  # it may have been held all the time
            return False
        if again and self._spent == key:
            return False
        self._pressed, self._typed, self._at, self._spent = {}, key, now, None
        return True

    def interrupt(self, key: str, now: float) -> None:
        """Take a typed key that moves nothing. It ends the repeats of other keys: typed again, they
        are new presses.
        """
        self.repeat.see(key, now)
        self._spent = None

    def ignore(self, key: str, now: float) -> None:
        """Take a typed key that counts only after it has been released for longer than any first
        delay.
        """
        self.repeat.see(key, now)
        self._spent, self._ignored_at = key, now

    def let_go(self) -> None:
        """Release all keys; one that is still down counts again once it is released and pressed."""
        if self._typed is not None:
            self._spent, self._ignored_at = self._typed, None
        self._pressed, self._typed = {}, None

    def expire(self, now: float) -> bool:
        """Release a typed key that no longer repeats; returns whether there was one."""
        if now < self.expires:
            return False
        self._typed = None
        return True

    @property
    def expires(self) -> float:
        """When a typed key stops counting unless it is typed again; infinite if none ever does."""
        is_lasting = self.mode == LATCH or self._typed is None
        return math.inf if is_lasting else self._at + self.patience()

    def patience(self) -> float:
        """How long a typed key counts after its last event, in seconds."""
        return self.repeat.patience() if self.timeout is None else self.timeout
