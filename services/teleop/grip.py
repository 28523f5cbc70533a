"""Which keys are held. Pure: times are given, in seconds.

`hold`: a key counts while it is held: from press to release where the terminal tells both, else while it repeats.
`latch`: a key counts until another one is pressed.
"""

import math

from .repeat import Repeat

HOLD, LATCH = "hold", "latch"
FASTEST = 0.07  # s; nobody presses the same key twice as fast


class Grip:
    """The held keys. With a `timeout` a typed key counts that many seconds; without, as long as it repeats."""

    def __init__(self, mode: str = HOLD, timeout: float | None = None) -> None:
        self.mode = mode
        self.repeat = Repeat()
        self.timeout = timeout
        self._pressed: dict[str, str] = {}  # code -> key
        self._typed = ""
        self._at = 0.0  # when it was typed
        self._spent = ""  # a typed key that was let go while it repeats: it drives again after a new press only
        self._ignored = -FASTEST  # when a key was typed last that did not count

    @property
    def keys(self) -> tuple[str, ...]:
        """The held keys, in the order of their presses."""
        return (*self._pressed.values(), *([self._typed] if self._typed else []))

    def press(self, key: str, code: str) -> None:
        """A key went down, and its release will be told."""
        if self.mode == LATCH:
            self._pressed, self._typed = {}, key
        else:
            self._pressed[code], self._typed = key, ""

    def release(self, code: str) -> bool:
        """A key went up. Whether it was held."""
        return self._pressed.pop(code, None) is not None

    def type(self, key: str, now: float) -> bool:
        """A key was typed, and no release will be told. Whether it is held now."""
        again = self.repeat.see(key, now)
        if self._spent == key and now - self._ignored < FASTEST:
            self._ignored = now
            return False
        if again and self._spent == key:
            return False
        self._pressed, self._typed, self._at, self._spent = {}, key, now, ""
        return True

    def interrupt(self, key: str, now: float) -> None:
        """A key was typed that is not held here. No other one repeats on: if it is typed again, it was pressed anew."""
        self.repeat.see(key, now)
        self._spent = ""

    def ignore(self, key: str, now: float) -> None:
        """A key was typed that does not count; while it repeats it does not count either."""
        self.repeat.see(key, now)
        self._spent, self._ignored = key, now

    def let_go(self) -> None:
        """Hold nothing; a key that is still down counts again when it is pressed anew."""
        self._spent = self._typed or self._spent
        self._pressed, self._typed = {}, ""

    def expire(self, now: float) -> bool:
        """Let go of a typed key that no longer repeats. Whether one was."""
        if now < self.expires:
            return False
        self._typed = ""
        return True

    @property
    def expires(self) -> float:
        """When a typed key no longer counts, if nothing more is heard of it."""
        return math.inf if self.mode == LATCH or not self._typed else self._at + self.patience()

    def patience(self) -> float:
        """How long a typed key counts after its last event."""
        return self.repeat.patience() if self.timeout is None else self.timeout
