"""Plays messages in time: paused and stepped by keys, ended by an event."""

import threading
import time
from collections.abc import Callable, Iterable
from typing import Protocol

from holozen.bag.pace import Pace
from holozen.bag.reader import Message

PAUSE, STEP = "pause", "step"
LOOK = 0.05  # s between two looks at the keys and at `stop`


class Keys(Protocol):
    """Where a person presses keys."""

    def read(self, timeout: float) -> str:
        """PAUSE or STEP, or "" if nothing was pressed for `timeout` seconds."""
        ...


class Player:
    """Calls `publish` with each message when it is due, and `hold` when it is paused.

    `paused` and `position` (ns, of the last message) are for whoever shows them.
    """

    def __init__(
        self,
        publish: Callable[[Message], None],
        hold: Callable[[], None],
        keys: Keys,
        stop: threading.Event,
        rate: float = 1.0,
    ) -> None:
        self.paused, self.position, self.count = False, 0, 0
        self._publish, self._hold, self._keys, self._stop = publish, hold, keys, stop
        self._pace = Pace(rate)
        self._looked = -LOOK
        self._held = 0  # where the bag stands while it is paused, ns

    def play(self, messages: Iterable[Message], told: Callable[[float], None] = lambda _: None) -> bool:
        """Play them all, the first at once; False if `stop` ended it. `told` is called again and again."""
        begun = False
        for message in messages:
            if not begun:
                self._pace.jump(message.at, time.monotonic())
                begun = True
            if not self._wait_for(message.at, told):
                return False
            self._publish(message)
            self.position, self.count = message.at, self.count + 1
        return not self._stop.is_set()

    def _wait_for(self, at: int, told: Callable[[float], None]) -> bool:
        """Wait until a message is due; False if `stop` is set."""
        while not self._stop.is_set():
            now = time.monotonic()
            left = LOOK if self.paused else self._pace.due(at) - now
            if left <= 0 and now - self._looked < LOOK:
                return True
            key = self._keys.read(max(0.0, min(left, LOOK)))  # a look also when every message is late
            self._looked = time.monotonic()
            told(self._looked)
            if self._obey(key, at):
                return True
        return False

    def _obey(self, key: str, at: int) -> bool:
        """Do what a key says; whether the next message is to be played at once."""
        now = time.monotonic()
        if key == PAUSE and self.paused:
            self.paused = False
            self._pace.jump(self._held, now)
        elif key == PAUSE:
            self.paused, self._held = True, self._pace.position(now)
            self._hold()
        elif key == STEP and self.paused:
            self._held = at
            return True
        return False
