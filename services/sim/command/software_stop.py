"""The software stop of one robot: what it refuses while it is set, and after its release. No clock, no socket."""

import math

from holozen.wire import COMMAND_SILENCE

MAX_SOURCES = 100  # names of each rank, since they come over the wire; those beyond share one entry
NEVER = 1e9  # s
STOPPED = "stopped: by {by}; `holozen release` lets it drive again"
LET_GO = "let go first: it commanded while the robot was stopped; send a stop{or_wait}"


class SoftwareStop:
    """Refuses every command while it is set.

    Releasing it moves nothing (as ISO 13850 asks of an emergency stop): a source that commanded during
    the stop drives again only after it has let go: it sent a stop, or was silent for the robot's watchdog timeout, at
    least 0.5 s. Where the watchdog is off (a `timeout` below zero), only a stop counts. A source without a record is
    assumed to have commanded at the moment of the stop.
    """

    def __init__(self, timeout: float) -> None:
        self.setter = ""  # who set it; empty while it is not set
        self.set_timeout(timeout)
        self._last_moves: dict[int, dict[str, float]] = {}  # rank -> source -> time of its last motion
        self._stopped = -math.inf  # when it was set: any source may have commanded until then
        self._others: dict[int, float] = {}  # rank -> the same for all sources beyond MAX_SOURCES

    def set_timeout(self, timeout: float) -> None:
        """Set the timeout of the watchdog."""
        self._silence = max(timeout, COMMAND_SILENCE) if timeout >= 0 else NEVER

    def set(self, by: str, driver: tuple[str, int] | None, now: float) -> None:
        """Stop at `now`, while `driver`, a source and its rank, moves the robot. The first setter remains."""
        if not self.setter:
            self._last_moves = {
                rank: {source: time for source, time in sources.items() if self.must_let_go(source, rank, now)}
                for rank, sources in self._last_moves.items()
            }
            self._stopped = now
        if driver:
            self._note(*driver, now)
        self.setter = self.setter or by or "an unknown caller"

    def release(self) -> None:
        """Let sources that have let go drive again."""
        self.setter = ""

    def refusal(self, source: str, rank: int, stops: bool, now: float) -> str:
        """Why a command is refused at `now`, or ""; `stops`: whether it is a stop."""
        waits = self.must_let_go(source, rank, now)
        if self.setter or waits:
            self._note(source, rank, -math.inf if stops else now)
        if self.setter:
            return STOPPED.format(by=self.setter)
        or_wait = f" or be silent for {self._silence:g} s" if self._silence < NEVER else ""
        return LET_GO.format(or_wait=or_wait) if waits and not stops else ""

    def must_let_go(self, source: str, rank: int, now: float) -> bool:
        """Whether a source still has to let go before it may drive."""
        sources = self._last_moves.get(rank, {})
        if source in sources:
            return now - sources[source] <= self._silence
        return now - max(self._stopped, self._others.get(rank, -math.inf)) <= COMMAND_SILENCE

    def inherit(self, other: "SoftwareStop") -> None:
        """Copy the state of another one."""
        self.setter, self._stopped, self._others = other.setter, other._stopped, dict(other._others)
        self._last_moves = {rank: dict(sources) for rank, sources in other._last_moves.items()}

    def _note(self, source: str, rank: int, when: float) -> None:
        sources = self._last_moves.setdefault(rank, {})
        if source in sources or len(sources) < MAX_SOURCES:
            sources[source] = when
        else:
            self._others[rank] = max(self._others.get(rank, -math.inf), when)
