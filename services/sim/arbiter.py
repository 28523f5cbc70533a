"""Who drives: the highest Zenoh priority among the fresh commands. No clock, no socket."""

from dataclasses import dataclass, replace

from holozen.limits import STOP
from holozen.readers import PRIORITIES
from holozen.wire import COMMAND_SILENCE

from .latch import STOPPED, Latch
from .motion import JointMotion, Motion, is_stop

PERSON = PRIORITIES.index("INTERACTIVE_HIGH")  # nobody stands above a person: stronger priorities count as this one
AUTOPILOT = PRIORITIES.index("DATA_LOW")  # from here on down a source never takes a robot that others have driven
MOST_HELD = 1000  # names come over the wire; with so many held, every new one is held too
LATE = "late: it waited up to {age:.1f} s for the sim"
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
    obeyed; below zero a silent source is obeyed until another one speaks. The `latch` is above all of them.
    """

    def __init__(self, timeout: float) -> None:
        self.timeout, self.latch = timeout, Latch(timeout)
        self.resumed = 0  # calls of `resume` that were granted
        self._driver: Driver | None = None
        self._held: set[str] = set()
        self._highest = AUTOPILOT + 1  # the best rank that drove since the last resume

    def offer(self, source: str, rank: int, motion: Motion, now: float, heard: float | None = None) -> str:
        """Take a command at time `now` that came at `heard` at the earliest. Returns why it is not obeyed, or ""."""
        heard = now if heard is None else heard
        if reason := self.latch.refusal(source, is_stop(motion), now):
            return reason
        if now - heard > COMMAND_SILENCE and not is_stop(motion):
            return LATE.format(age=now - heard)
        return self._choose(Driver(source, max(rank, PERSON), motion, heard), now)

    def _choose(self, new: Driver, now: float) -> str:
        source, rank, motion = new.source, new.rank, new.motion
        driver = self.driver(now)
        other = driver if driver and driver.source != source else None
        stops = is_stop(motion) and driver is not None and rank <= driver.rank
        if other and rank >= other.rank and not stops and now - other.heard <= COMMAND_SILENCE:
            if rank > other.rank:
                self._hold(source)
            return OVERRULED.format(driver=other.source)
        if not stops and self._is_held(source, rank):
            return HELD
        if other and (stops or rank < other.rank):
            self._hold(other.source)
        self._driver = new
        self._highest = min(self._highest, rank)
        return ""

    def wait_for(self, timeout: float, now: float) -> None:
        """Take another `timeout` from `now` on. Who fell silent before stays so: a longer one moves nothing."""
        self._driver = self.driver(now)
        self.timeout = timeout
        self.latch.wait_for(timeout)

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

    def stop(self, by: str, now: float) -> None:
        """Set the software stop: nobody drives until it is released, and no autopilot before `resume`."""
        driver = self.driver(now)
        self.latch.set(by, driver.source if driver and not is_stop(driver.motion) else "", now)
        self._driver, self._highest = None, PERSON

    def forget(self, source: str) -> None:
        """The process behind a source is gone: if it drove, the robot stands.

        It counts as a stop that the source sent with its last command, so that nobody drives any sooner for it.
        """
        if self._driver and self._driver.source == source:
            self._driver = replace(self._driver, motion=STOP)

    def holds(self, source: str, rank: int, now: float) -> bool:
        """Whether a source has to wait for `resume`, or to let go, before it is obeyed."""
        return self._is_held(source, rank) or self.latch.waits(source, now)

    @property
    def held(self) -> bool:
        """Whether every autopilot waits for `resume`: a source above them drove."""
        return self._highest < AUTOPILOT

    def resume(self, now: float) -> str:
        """Let every source drive again. Returns why not, if somebody above an autopilot moves the robot at `now`, or it
        is stopped.
        """
        if self.latch.setter:
            return STOPPED.format(by=self.latch.setter)
        driver = self.driver(now)
        if driver and driver.rank < AUTOPILOT and not is_stop(driver.motion):
            return f"{driver.source} drives; stop first"
        self._driver = driver if driver and driver.rank >= AUTOPILOT else None
        self._held.clear()
        self._highest = AUTOPILOT + 1
        self.resumed += 1
        return ""

    def inherit(self, other: "Arbiter") -> None:
        """Hold whom another one held, and stop if it did: a robot that was replaced."""
        self._held, self._highest = set(other._held), other._highest
        self.latch.inherit(other.latch)

    def _is_held(self, source: str, rank: int) -> bool:
        autopilot = rank >= AUTOPILOT and rank > self._highest
        return autopilot or source in self._held or len(self._held) >= MOST_HELD

    def _hold(self, source: str) -> None:
        if len(self._held) < MOST_HELD:
            self._held.add(source)
