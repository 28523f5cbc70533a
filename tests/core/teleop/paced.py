"""A clock for what has to happen in time, on a machine that may hold a process up for seconds."""

import threading
import time
from types import SimpleNamespace

import pytest

MOST = 0.02  # s
TIMED = (
    "holozen.odometry",
    "holozen.transport.pubsub",
    "services.teleop.script",
    "services.teleop.session",
)
"""The modules in which a teleop looks at the time."""


class Paced:
    """Call it for the time in s: that of time.monotonic, but from one look to the next it goes on
    by MOST at most.
    """

    def __init__(self) -> None:
        self._seen = self._now = time.monotonic()
        self._lock = threading.Lock()

    def __call__(self) -> float:
        with self._lock:
            seen = time.monotonic()
            self._now += min(seen - self._seen, MOST)
            self._seen = seen
            return self._now

    def sleep(self, seconds: float) -> None:
        """Let so much time pass, without waiting for it."""
        with self._lock:
            self._now += seconds


now = Paced()


def set_pace(monkeypatch: pytest.MonkeyPatch, **more: object) -> None:
    """Let `now` be the clock of all of a teleop; `more` replaces other functions of `time`."""
    paced = SimpleNamespace(**{"monotonic": now, "sleep": time.sleep, "time": time.time, **more})
    for module in TIMED:
        monkeypatch.setattr(f"{module}.time", paced)
