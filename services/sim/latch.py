"""The software stop of one robot: what it refuses while it holds, and after it was released. No clock, no socket."""

import math

from holozen.wire import COMMAND_SILENCE

MOST = 1000  # names come over the wire; those beyond are told apart no more
NEVER = 1e9  # s
STOPPED = "stopped: by {by}; `holozen release` lets it drive again"
LET_GO = "let go first: it commanded while the robot was stopped; send a stop{or_wait}"


class Latch:
    """Refuses every command while it is set.

    Releasing it moves nothing (as ISO 13850 asks of an emergency stop): a source that commanded meanwhile is obeyed
    again only after it sent a stop, or was silent for as long as the robot's watchdog takes, at least 0.5 s. Where the
    watchdog is off (a `timeout` below zero), only a stop counts. A source that was not heard is taken to have spoken
    at the moment of the stop.
    """

    def __init__(self, timeout: float) -> None:
        self.setter = ""  # who set it; empty while it does not hold
        self.wait_for(timeout)
        self._spoke: dict[str, float] = {}  # source -> when it wanted to move last
        self._others = -math.inf  # and all those that are not named there

    def wait_for(self, timeout: float) -> None:
        """Take another timeout of the watchdog."""
        self._silence = max(timeout, COMMAND_SILENCE) if timeout >= 0 else NEVER

    def set(self, by: str, driver: str, now: float) -> None:
        """Stop at `now`, while `driver` moves the robot (empty: nobody). Who set it first stays its setter."""
        if not self.setter:
            self._spoke = {source: spoke for source, spoke in self._spoke.items() if self.waits(source, now)}
            self._others = now
        if driver:
            self._note(driver, now)
        self.setter = self.setter or by or "somebody"

    def release(self) -> None:
        """Let those drive who let go."""
        self.setter = ""

    def refusal(self, source: str, stops: bool, now: float) -> str:
        """Why a command is not obeyed at `now`, or ""; `stops` says whether it is a stop."""
        waits = self.waits(source, now)
        if self.setter or waits:
            self._note(source, -math.inf if stops else now)
        if self.setter:
            return STOPPED.format(by=self.setter)
        or_wait = f" or be silent for {self._silence:g} s" if self._silence < NEVER else ""
        return LET_GO.format(or_wait=or_wait) if waits and not stops else ""

    def waits(self, source: str, now: float) -> bool:
        """Whether a source still has to let go, as it is not known to have done so."""
        if source in self._spoke:
            return now - self._spoke[source] <= self._silence
        return now - self._others <= COMMAND_SILENCE

    def inherit(self, other: "Latch") -> None:
        """Hold as another one does."""
        self.setter, self._spoke, self._others = other.setter, dict(other._spoke), other._others

    def _note(self, source: str, when: float) -> None:
        if source in self._spoke or len(self._spoke) < MOST:
            self._spoke[source] = when
        else:
            self._others = max(self._others, when)
