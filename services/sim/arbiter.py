"""Who drives: the highest Zenoh priority among the fresh commands. No clock, no socket."""

from dataclasses import dataclass

from holozen.limits import STOP
from holozen.readers import PRIORITIES
from holozen.wire import COMMAND_SILENCE

from .motion import JointMotion, Motion, is_stop

PERSON = PRIORITIES.index("INTERACTIVE_HIGH")  # nobody stands above a person: stronger priorities count as this one
AUTOPILOT = PRIORITIES.index("DATA_LOW")  # from here on down a source never takes a robot that others have driven
MOST_HELD = 1000  # names come over the wire; with so many held, every new one is held too
OVERRULED = "overruled: {driver} drives"
HELD = "held: a higher source took over; `holozen controller --resume` lets it drive again"


@dataclass(slots=True)
class Driver:
    """The source that is obeyed, when its last command came at the earliest, and what it said. Rank 0 is highest."""

    source: str
    rank: int
    motion: Motion
    heard: float


class Arbiter:
    """Chooses among the sources of one robot.

    Among equals the one that drives goes on driving, but each of them may stop the robot. A source that a higher one
    overruled, or that another one stopped, is held: it moves the robot again only after `resume`. So is every
    autopilot once anyone above it drove. `timeout` is the silence in seconds after which a source is no longer
    obeyed; below zero a silent source is obeyed until another one speaks.
    """

    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
        self.resumed = 0  # calls of `resume` that were granted
        self._driver: Driver | None = None
        self._held: set[str] = set()
        self._highest = AUTOPILOT + 1  # the best rank that drove since the last resume

    def offer(self, source: str, rank: int, motion: Motion, now: float, heard: float | None = None) -> str:
        """Take a command at time `now` that came at `heard` at the earliest. Returns why it is not obeyed, or ""."""
        rank = max(rank, PERSON)
        driver = self.driver(now)
        other = driver if driver and driver.source != source else None
        stops = is_stop(motion) and driver is not None and rank <= driver.rank
        if other and rank >= other.rank and not stops and now - other.heard <= COMMAND_SILENCE:
            if rank > other.rank:
                self._hold(source)
            return OVERRULED.format(driver=other.source)
        if not stops and (self._is_held(source) or (rank >= AUTOPILOT and rank > self._highest)):
            return HELD
        if other and (stops or rank < other.rank):
            self._hold(other.source)
        self._driver = Driver(source, rank, motion, now if heard is None else heard)
        self._highest = min(self._highest, rank)
        return ""

    def driver(self, now: float) -> Driver | None:
        """The source that is obeyed at `now`; None when all are silent."""
        driver = self._driver
        if driver is None:
            return None
        timeout = COMMAND_SILENCE if isinstance(driver.motion, JointMotion) else self.timeout
        return None if 0 <= timeout < now - driver.heard else driver

    def motion(self, now: float) -> Motion:
        """What the robot is to do at `now`."""
        driver = self.driver(now)
        return driver.motion if driver else STOP

    @property
    def held(self) -> bool:
        """Whether every autopilot waits for `resume`: a source above them drove."""
        return self._highest < AUTOPILOT

    def resume(self, now: float) -> str:
        """Let every source drive again. Returns why not, if somebody above an autopilot moves the robot at `now`."""
        driver = self.driver(now)
        if driver and driver.rank < AUTOPILOT and not is_stop(driver.motion):
            return f"{driver.source} drives; stop first"
        self._driver = driver if driver and driver.rank >= AUTOPILOT else None
        self._held.clear()
        self._highest = AUTOPILOT + 1
        self.resumed += 1
        return ""

    def inherit(self, other: "Arbiter") -> None:
        """Hold whom another one held: a robot that was replaced."""
        self._held, self._highest = set(other._held), other._highest

    def _is_held(self, source: str) -> bool:
        return source in self._held or len(self._held) >= MOST_HELD

    def _hold(self, source: str) -> None:
        if len(self._held) < MOST_HELD:
            self._held.add(source)
