"""Whether this process hears itself over its own session: if not, no stop may get through to it
either.
"""

import threading
from collections.abc import Callable

from holozen.bus import Bus
from holozen.console import report
from holozen.transport.errors import BusError
from holozen.transport.samples import Declared

EVERY = 0.1  # s between an answer and the next question
NORMAL = 0.15  # s between two answers, as a rule
LIMIT = 0.5  # s without an answer after which a process is deaf
# s, where a router answers too: longer than a robot drives on in silence after a cut
BY_ROUTER = 1.0
PASS = 0.05  # s; the longest pass of a loop that keeps its rate
PATIENCE = 10.0  # s for an answer, which is late by then, and ends the deafness
BY = "itself, since it may not hear a stop"
DEAF = (
    "it has not heard its own messages for {limit:g} s, so it may not hear a stop either: {robots} "
    "until `holozen release`"
)


class Deafness:
    """Measures for how long no answer has come. A pass of the loop counts as `longest` seconds at
    most, so that a suspension, or a slow machine, is no deafness.
    """

    def __init__(self, longest: float = PASS) -> None:
        self._longest = longest
        self._answers = 0
        self._passed = 0.0  # s since the last answer
        self._at = 0.0

    def judge(
        self, now: float, answers: int, limit: float, matters: Callable[[], bool] = lambda: True
    ) -> bool:
        """Whether the number of `answers` has been the same for `limit` seconds at `now` (s). While
        that does not matter, by `matters`, nothing is measured, as if an answer had come.
        """
        passed, self._at = min(now - self._at, self._longest), now
        if answers != self._answers:
            self._answers, self._passed = answers, 0.0
        else:
            self._passed += passed
        if self._passed > NORMAL and not matters():
            self._passed = 0.0
        return self._passed >= limit


class Ears(Declared):
    """Notices that this process can no longer be heard: the roll call of its own session goes
    unanswered.

    It calls in a thread of its own. While Zenoh's tables are locked, the call waits, and so does a
    stop from elsewhere.

    `longest`: The longest pass, in s, of a loop that keeps its rate. Robots are stopped only while
    they move. Where there is a router, it is the one to answer: where a cable is cut robots stand
    by silence, and drive on once it is back.
    """

    def __init__(self, bus: Bus, reporter: str, robots: str, longest: float = PASS) -> None:
        super().__init__()
        self._bus, self._reporter, self._robots = bus, reporter, robots
        self._closing = threading.Event()
        self._answers, self._by_router, self._is_deaf = 0, False, False
        self._deafness = Deafness(longest)
        self.ends = [self]
        self.thread = threading.Thread(target=self._ask, daemon=True)
        self.thread.start()

    def are_deaf(self, now: float, moving: Callable[[], bool]) -> bool:
        """Whether the robots have to be stopped at `now` (s). Call it at each pass of the loop.
        `moving`: whether any is commanded to move.
        """
        limit = BY_ROUTER if self._by_router else LIMIT
        is_deaf = self._deafness.judge(now, self._answers, limit, moving)
        if is_deaf and not self._is_deaf:
            report(f"{self._reporter}: {DEAF.format(limit=limit, robots=self._robots)}")
        self._is_deaf = is_deaf
        return is_deaf

    def undeclare(self) -> None:
        """End the questions."""
        self._closing.set()

    def _ask(self) -> None:
        while not self._closing.wait(EVERY):
            try:
                by_router = self._bus.has_router
                if self._bus.roll_call(PATIENCE):
                    self._answers += 1
                    self._by_router = by_router
            except BusError:
                return  # it is closed
