"""Who drives: the highest Zenoh priority among the fresh commands. No clock, no socket."""

from dataclasses import dataclass

from holozen.limits import STOP, Planar
from holozen.wire import COMMAND_SILENCE

AUTOPILOT = 5  # the rank of DATA_LOW; from here on down a source never takes a robot that others have driven
OVERRULED = "overruled: {driver} drives"
HELD = "held: a higher source took over; `holozen controller --resume` lets it drive again"


@dataclass(slots=True)
class Driver:
    """The source that is obeyed, since when silent, and what it last said. Rank 0 is the highest priority."""

    source: str
    rank: int
    velocity: Planar
    heard: float


class Arbiter:
    """Chooses among the sources of one robot.

    A source that was overruled is held: it moves the robot again only after `resume`. So is every autopilot once
    anyone above it drove. `timeout` is the silence in seconds after which a source is no longer obeyed; below
    zero a silent source is obeyed until another one speaks.
    """

    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
        self.resumed = 0  # calls of `resume` that were granted
        self._driver: Driver | None = None
        self._held: set[str] = set()
        self._highest = AUTOPILOT + 1  # the best rank that drove since the last resume

    def offer(self, source: str, rank: int, velocity: Planar, now: float) -> str:
        """Hear a command at time `now`. Returns why it is not obeyed, or an empty text."""
        driver = self.driver(now)
        if driver and source != driver.source and rank >= driver.rank and not self._silent(driver, now):
            if rank > driver.rank:
                self._hold(source)
            return OVERRULED.format(driver=driver.source)
        if source in self._held or (rank >= AUTOPILOT and rank > self._highest):
            return HELD
        if driver and source != driver.source and rank < driver.rank:
            self._hold(driver.source)
        self._driver = Driver(source, rank, velocity, now)
        self._highest = min(self._highest, rank)
        return ""

    def driver(self, now: float) -> Driver | None:
        """The source that is obeyed at `now`; None when all are silent."""
        driver = self._driver
        if driver and 0 <= self.timeout < now - driver.heard:
            return None
        return driver

    def velocity(self, now: float) -> Planar:
        """What the robot is to do at `now`."""
        driver = self.driver(now)
        return driver.velocity if driver else STOP

    @property
    def held(self) -> bool:
        """Whether every autopilot waits for `resume`: a source above them drove."""
        return self._highest < AUTOPILOT

    def resume(self, now: float) -> str:
        """Let every source drive again. Returns why not, if somebody above an autopilot moves the robot at `now`."""
        driver = self.driver(now)
        if driver and driver.rank < AUTOPILOT and driver.velocity != STOP:
            return f"{driver.source} drives; stop first"
        self._driver = driver if driver and driver.rank >= AUTOPILOT else None
        self._held.clear()
        self._highest = AUTOPILOT + 1
        self.resumed += 1
        return ""

    def _silent(self, driver: Driver, now: float) -> bool:
        # Without a timeout the word of a dead source holds on, but it must not keep others from stopping the robot.
        return now - driver.heard > (self.timeout if self.timeout >= 0 else COMMAND_SILENCE)

    def _hold(self, source: str) -> None:
        if len(self._held) < 1000:  # names come over the wire
            self._held.add(source)
