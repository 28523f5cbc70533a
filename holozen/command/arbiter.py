"""Which source drives: the highest Zenoh priority among the fresh commands, unless the software stop is set.

No clock, no socket.
"""

import math
from collections.abc import Callable, Iterable
from copy import deepcopy
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from holozen.command.motion import AppliedForce, AppliedForces, Motion, is_stop
from holozen.limits import STOP
from holozen.transport.samples import PRIORITIES
from holozen.wire import COMMAND_SILENCE, resume_command

PERSON = PRIORITIES.index("INTERACTIVE_HIGH")  # no source ranks above a person: stronger priorities count as this one
AUTOPILOT = PRIORITIES.index("DATA_LOW")  # from here down, a source waits for `resume` once a higher one has driven
MAX_HELD = 100  # held names of each rank, which come over the wire; beyond, all of the rank but its driver is held
MAX_PARTS = 100  # sources whose moving topics or joints are known
MAX_PER_RANK = 100  # recorded names of each rank, which come over the wire; those beyond share one record
NEVER = 1e9  # s
ROUNDING = 1e-6  # s of tolerance: which step ends a silence must not depend on rounding errors of the clock
STOPPED = "stopped: by {by}; `holozen release` lets it drive again"
LET_GO = "let go first: it commanded while another drove or the robot was stopped; send a stop{or_wait}"
LATE = "late: it waited up to {age:.1f} s for the sim"
OVERRULED = "overruled: {driver} drives"
HELD = "held: another source took over; `{resume}` lets it drive again"


class CommandTime:
    """The clock that measures the silence of sources, in seconds. It follows real time while the sim plays, and only
    the sim's steps while that is paused: so the effect of a command over a number of steps does not depend on the speed
    of the computer. It never goes back.
    """

    def __init__(self) -> None:
        self._ahead = 0.0  # of real time
        self._paused_at = 0.0
        self._stepped = 0.0  # s of steps since then
        self.is_paused = False
        self.slack = 0.0  # s of tolerance when a silence is compared with its limit

    def at(self, now: float) -> float:
        """The time on this clock at the real time `now`."""
        return self._paused_at + self._stepped if self.is_paused else now + self._ahead

    def real(self, time: float) -> float:
        """The real time at which this clock will show `time`; long past while it is paused, when that is unknown."""
        return -1.0 if self.is_paused else time - self._ahead

    def pause(self, now: float) -> None:
        """Advance by steps only."""
        self._paused_at, self._stepped, self.is_paused, self.slack = self.at(now), 0.0, True, ROUNDING

    def step(self, dt: float) -> None:
        """Advance by a step of `dt` seconds, if it is paused."""
        self._stepped += dt

    def play(self, now: float) -> None:
        """Follow real time."""
        self._ahead, self.is_paused, self.slack = self.at(now) - now, False, 0.0


class Sent(NamedTuple):
    """When a command was sent, in s: not before `earliest`, and not after `latest`, or if others that its source sent
    before it are missing, they may have been sent since `latest`. For `silence` its source had sent nothing before it,
    by the source's own clock; infinite if that is unknown.
    """

    earliest: float
    latest: float
    silence: float = math.inf


class SoftwareStop:
    """Refuses every command while it is set.

    Releasing it moves nothing, as ISO 13850 requires of an emergency stop: a source that commanded during the stop
    drives again only after it has let go, by sending a stop or by being silent for the robot's watchdog timeout, at
    least 0.5 s. A link or a receiver that is held up for that long is no silence. Where the watchdog is off (a
    `timeout` below zero), only a stop counts. A source without a record is assumed to have commanded at the moment of
    the stop.
    """

    def __init__(self, timeout: float) -> None:
        self.setter = ""  # the node that set it; empty while it is not set
        self.set_timeout(timeout)
        # Rank -> source -> time of the last motion that came from it; -inf once it has let go.
        self._last_moves: dict[int, dict[str, float]] = {}
        self._stopped = -math.inf  # when it was set: any source may have commanded until then
        self._released = -math.inf  # when it was last released
        self._others: dict[int, float] = {}  # rank -> time of the last motion of any source beyond MAX_PER_RANK

    def set_timeout(self, timeout: float) -> None:
        """Set the watchdog's timeout in s."""
        self._silence = max(timeout, COMMAND_SILENCE) if timeout >= 0 else NEVER

    def set(self, by: str, driver: tuple[str, int] | None, now: float) -> None:
        """Set the stop at `now`. `driver` is the source that moves the robot, with its rank. The first setter stays."""
        if not self.setter:
            self._last_moves = {
                rank: {
                    source: time for source, time in sources.items() if self.must_let_go(source, rank, Sent(now, now))
                }
                for rank, sources in self._last_moves.items()
            }
            self._stopped = now
        if driver:
            self._note(*driver, now)
        self.setter = self.setter or by or "an unknown caller"

    def release(self, now: float) -> None:
        """Let sources that have let go drive again."""
        if self.setter:
            self._released = now
        self.setter = ""

    def refusal(
        self, source: str, rank: int, stops: bool, now: float, sent: Sent | None = None, lets_go: bool = True
    ) -> str:
        """Why a command is refused at `now`, or ""; `stops`: it is a stop, by which its source `lets_go`. Without
        `sent`, it was sent now.
        """
        waits = self.must_let_go(source, rank, sent or Sent(now, now))
        if self.setter or waits:
            self._note(source, rank, -math.inf if stops and lets_go else now)
        elif source in self._last_moves.get(rank, {}):
            self._note(source, rank, -math.inf)
        if self.setter:
            return STOPPED.format(by=self.setter)
        or_wait = f" or be silent for {self._silence:g} s" if self._silence < NEVER else ""
        return LET_GO.format(or_wait=or_wait) if waits and not stops else ""

    def overrule(self, source: str, rank: int, now: float) -> None:
        """Let a source let go before it drives, as if it had commanded during a stop. Of too many, the one that has let
        go, or was silent for the longest time, is forgotten: those without a record are free.
        """
        sources = self._last_moves.setdefault(rank, {})
        if source not in sources and len(sources) >= MAX_PER_RANK:
            del sources[min(sources, key=lambda each: sources[each])]
        sources[source] = now

    def must_let_go(self, source: str, rank: int, sent: Sent) -> bool:
        """Whether a source still has to let go before it may drive, by a command that was `sent` then."""
        sources = self._last_moves.get(rank, {})
        if source in sources:
            last = sources[source]
            return last > -math.inf and min(sent.earliest - last, sent.silence) <= self._silence + ROUNDING
        stopped = max(self._stopped, self._others.get(rank, -math.inf))
        return sent.latest < self._released or sent.latest - stopped <= COMMAND_SILENCE + ROUNDING

    def settle(self, now: float) -> None:
        """Nothing listens from `now` on: sources that have let go until then have, whatever they send after it."""
        if not self.setter:
            for rank, sources in self._last_moves.items():
                for source in sources:
                    if not self.must_let_go(source, rank, Sent(now, now)):
                        sources[source] = -math.inf

    def inherit(self, other: "SoftwareStop", now: float) -> None:
        """Take over the state of another one at `now`. Whoever has not let go may have commanded until now, since
        nothing listened; if that one is set, so may any source that has not sent a stop.
        """
        self.setter, self._stopped, self._released = other.setter, other._stopped, other._released
        self._others = dict(other._others)
        self._last_moves = deepcopy(other._last_moves)
        for sources in self._last_moves.values():
            sources.update({source: now for source, time in sources.items() if time > -math.inf})
        if self.setter:
            self._stopped = now

    def _note(self, source: str, rank: int, when: float) -> None:
        sources = self._last_moves.setdefault(rank, {})
        if source in sources or len(sources) < MAX_PER_RANK:
            sources[source] = when
        else:
            self._others[rank] = max(self._others.get(rank, -math.inf), when)


class Parts:
    """The topics or joints that each source has set moving in the last 0.5 s, and not stopped since.

    A source may command them one by one: then a zero for one is no stop while it moves another. Names come over the
    wire, so of too many sources the one that has been silent for the longest time is forgotten.
    """

    def __init__(self) -> None:
        self._moving: dict[tuple[str, int], dict[str, float]] = {}

    def record(self, source: str, rank: int, parts: Iterable[tuple[str, bool]], time: float) -> bool:
        """Record which `parts` a command moves, and which it stops, at `time` (s). Returns whether its source still
        moves any.
        """
        mine = {name: at for name, at in self._moving.pop((source, rank), {}).items() if time - at <= COMMAND_SILENCE}
        for name, moves in parts:
            mine.pop(name, None)
            if moves:
                mine[name] = time
        if mine:
            self._moving[source, rank] = mine
            if len(self._moving) > MAX_PARTS:
                del self._moving[next(iter(self._moving))]
        return bool(mine)

    def settle(self, time: float) -> None:
        """Forget what no source has moved for 0.5 s by `time` (s)."""
        for source, parts in self._moving.items():
            self._moving[source] = {name: at for name, at in parts.items() if time - at <= COMMAND_SILENCE}

    def inherit(self, other: "Parts", time: float) -> None:
        """Take over those of a robot that is replaced at `time` (s): nothing listened until then."""
        self._moving = {source: dict.fromkeys(parts, time) for source, parts in other._moving.items()}


class Driver(Struct):
    """The source that drives, its motion, and the earliest time (s) at which that was sent. Rank 0 is the highest. Of
    one that is `gone`, no command is obeyed.
    """

    source: str
    rank: int
    motion: Motion
    sent: float
    gone: bool = False


class Held:
    """The held sources of one rank. Once it is full it holds every source of the rank, except the one that drives at
    that time: so a flood of names frees no source, and holds none of another rank.
    """

    def __init__(self) -> None:
        self._names: set[str] = set()
        self._all, self._free = False, ""

    def add(self, source: str, driver: str) -> None:
        """Hold a source; `driver` is the source of this rank that drives, or empty."""
        if len(self._names) < MAX_HELD:
            self._names.add(source)
        elif source not in self._names:
            self._all = True
        if driver or source == self._free:
            self._free = driver

    def __contains__(self, source: str) -> bool:
        return source in self._names or (self._all and source != self._free)


class Arbiter:
    """Chooses which source drives one robot.

    Among equals the current driver keeps driving, but each of them may stop the robot. A source that a higher one
    overruled, or that another one stopped, is held: it moves the robot again only after `resume`. So is every autopilot
    once a source above it has driven. A person whom another one overruled has to let go before driving: a key that is
    held, or was latched, moves nothing once the robot is free. A source is a name with a rank, since senders choose
    their names freely. A source stops driving after `timeout` seconds of silence; below zero, it drives until another
    one commands. The `software_stop` overrides them all. Silence is measured on the clock `time`; all methods take real
    times in s. Reasons name the `robot`.
    """

    def __init__(self, timeout: float, time: CommandTime | None = None, robot: str = "") -> None:
        self._robot, self.time = robot, time or CommandTime()
        self.timeout, self.software_stop, self.parts = timeout, SoftwareStop(timeout), Parts()
        self.resumed = 0  # how often `resume` succeeded
        self.stopped_at = -math.inf  # s; the last time that the software stop was set, or set again
        self.taken_at = -math.inf  # s; the last time that a source did what makes others wait for `resume`
        self.due = -math.inf  # s; until when `motion` stays the same, unless an event invalidates it
        self.changed: Callable[[], None] = lambda: None  # called on each such event
        self._driver: Driver | None = None
        self._held: dict[int, Held] = {}  # by rank
        self._highest = AUTOPILOT + 1  # the highest rank that has driven since the last resume

    def offer(
        self, source: str, rank: int, motion: Motion, now: float, sent: Sent | None = None, lets_go: bool = True
    ) -> str:
        """Take a command at `now`; without `sent`, it was sent now. Returns why it is refused, or "". `lets_go`: by a
        stop its source lets go of the robot.
        """
        age, here, rank = now - sent.earliest if sent else 0.0, self._here(now, sent), max(rank, PERSON)
        time = self.time.at(now)
        if reason := self.software_stop.refusal(source, rank, is_stop(motion), time, here, lets_go):
            return reason
        if age > COMMAND_SILENCE and not is_stop(motion):
            return LATE.format(age=age)
        return self._choose(Driver(source, rank, motion, here.earliest), time, now)

    def note_refused(self, source: str, rank: int, now: float, sent: Sent | None = None) -> None:
        """Record a command that was refused earlier: its source has not let go of a stopped robot."""
        rank, time = max(rank, PERSON), self.time.at(now)
        self.software_stop.refusal(source, rank, False, time, self._here(now, sent))
        driver = self._driver_at(time)
        if driver and driver.source != source:
            self._overrule(source, rank, driver, time)

    def _here(self, now: float, sent: Sent | None) -> Sent:
        """When a command was sent, on our clock; while the sim is paused, it does not age, and nor does a silence."""
        time = self.time.at(now)
        if sent is None or self.time.is_paused:
            return Sent(time, time)
        return Sent(time - (now - sent.earliest), time - max(0.0, now - sent.latest), sent.silence)

    def _choose(self, new: Driver, now: float, real: float) -> str:
        source, rank, motion = new.source, new.rank, new.motion
        driver = self._driver_at(now)
        other = driver if driver and (driver.source, driver.rank) != (source, rank) else None
        stops = is_stop(motion) and driver is not None and rank <= driver.rank
        if other and rank >= other.rank and not stops and now - other.sent <= COMMAND_SILENCE:
            if rank > other.rank:
                self._hold(source, rank, new)
            self._overrule(source, rank, other, now)
            return OVERRULED.format(driver=other.source)
        if not stops and self._is_held(source, rank):
            if rank == PERSON:
                self.software_stop.overrule(source, rank, now)
            return HELD.format(resume=resume_command(self._robot))
        if other and (stops or rank < other.rank):
            self._hold(other.source, other.rank, new)
            self._overrule(other.source, other.rank, other, now)
        if (rank < AUTOPILOT and not is_stop(motion)) or (other and stops and not is_stop(other.motion)):
            self.taken_at = real
        self._drive(new)
        self._highest = min(self._highest, rank)
        return ""

    def set_timeout(self, timeout: float, now: float) -> None:
        """Set the `timeout` in s from `now` on. A longer one does not revive a source that has fallen silent."""
        self._drive(self.driver(now))
        self.timeout = timeout
        self.software_stop.set_timeout(timeout)

    def driver(self, now: float) -> Driver | None:
        """The source that drives at `now`; None if all are silent."""
        return self._driver_at(self.time.at(now))

    def _driver_at(self, time: float) -> Driver | None:
        driver = self._driver
        return None if driver is None or 0 <= self._patience(driver) < time - driver.sent - self.time.slack else driver

    def is_driver(self, source: str, rank: int, now: float) -> bool:
        """Whether a source of that rank drives at `now`, with a stop or a motion."""
        driver = self.driver(now)
        return driver is not None and (driver.source, driver.rank) == (source, max(rank, PERSON))

    def moves(self, source: str, now: float) -> bool:
        """Whether a source moves the robot at `now`."""
        driver = self.driver(now)
        return driver is not None and driver.source == source and not is_stop(driver.motion)

    def motion(self, now: float) -> Motion:
        """The commanded motion at `now`."""
        self.due = math.inf
        driver = self.driver(now)
        if driver is None:
            return STOP
        if (patience := self._patience(driver)) >= 0:
            self.due = self.time.real(driver.sent + patience)
        return driver.motion

    def pushes(self, now: float) -> list[AppliedForce] | None:
        """The forces that act at `now`, except those of silent topics. None if no source drives."""
        motion = self.motion(now)
        if not isinstance(motion, AppliedForces):
            return None
        return list(motion.since(self.time.at(now) - self.time.slack - COMMAND_SILENCE))

    def pushes_of(self, source: str, rank: int, now: float) -> AppliedForces:
        """The forces of a source at `now`; none unless it drives."""
        driver = self.driver(now) if self.is_driver(source, rank, now) else None
        return driver.motion if driver and isinstance(driver.motion, AppliedForces) else AppliedForces(())

    def _patience(self, driver: Driver) -> float:
        """The silence in s after which a driver no longer drives; below zero: never."""
        return self.timeout if isinstance(driver.motion, tuple) else COMMAND_SILENCE

    def drop_driver(self, without_watchdog: bool = True) -> None:
        """Forget the driver, so that only a new command moves the robot; a driver that no watchdog ends only if
        `without_watchdog`. Held sources and the software stop remain.
        """
        self.invalidate()
        if self._driver and (without_watchdog or self._patience(self._driver) >= 0):
            self._drive(None)

    def _drive(self, driver: Driver | None) -> None:
        self._driver = driver
        self.invalidate()

    def invalidate(self) -> None:
        """An event may have changed the motion: let it be asked for again."""
        self.due = -math.inf
        self.changed()

    def stop(self, by: str, now: float) -> None:
        """Set the software stop: no source drives until it is released, and no autopilot before `resume`."""
        driver = self.driver(now)
        moving = (driver.source, driver.rank) if driver and not is_stop(driver.motion) else None
        self.software_stop.set(by, moving, self.time.at(now))
        self.stopped_at = self.taken_at = now
        self._drive(None)
        self._highest = PERSON

    def release(self, now: float) -> None:
        """End the software stop."""
        self.software_stop.release(self.time.at(now))

    def forget(self, source: str, of_members: bool = False) -> None:
        """Stop the robot if this source drove: its process is gone.

        It counts as a stop sent with its last command, so that no other source takes over any sooner. `of_members`: the
        name of a source begins with that of a member, as in the secure set-up, and that is ignored.
        """
        if self._driver and source == (self._driver.source.partition("/")[2] if of_members else self._driver.source):
            self._drive(replace(self._driver, motion=STOP, gone=True))

    def holds(self, source: str, rank: int, now: float) -> bool:
        """Whether a source has to wait for `resume`, or has to let go, before it may drive."""
        rank = max(rank, PERSON)
        return self._is_held(source, rank) or self.software_stop.must_let_go(source, rank, self._here(now, None))

    @property
    def held(self) -> bool:
        """Whether every autopilot waits for `resume`, since a source above them has driven."""
        return self._highest < AUTOPILOT

    def resume_refusal(self, now: float) -> str:
        """Why `resume` is refused at `now`, or "". It is while the robot is stopped, or moved by a person or script."""
        if self.software_stop.setter:
            return STOPPED.format(by=self.software_stop.setter)
        driver = self.driver(now)
        if driver and driver.rank < AUTOPILOT and not is_stop(driver.motion):
            return f"{driver.source} drives; stop first"
        return ""

    def resume(self, now: float) -> str:
        """Let every source drive again. Returns the `resume_refusal`, if there is any."""
        if reason := self.resume_refusal(now):
            return reason
        driver = self.driver(now)
        self._drive(driver if driver and driver.rank >= AUTOPILOT else None)
        self._held.clear()
        self._highest = AUTOPILOT + 1
        self.resumed += 1
        return ""

    def settle(self, now: float) -> None:
        """The robot is removed at `now`; another one may `inherit` from this one."""
        self.software_stop.settle(self.time.at(now))
        self.parts.settle(self.time.at(now))

    def inherit(self, other: "Arbiter", now: float) -> None:
        """Take over the held sources and the software stop of a robot that is replaced at `now`."""
        self._held = deepcopy(other._held)
        self._highest, self.stopped_at, self.taken_at = other._highest, other.stopped_at, other.taken_at
        self.software_stop.inherit(other.software_stop, self.time.at(now))
        self.parts.inherit(other.parts, self.time.at(now))

    def _is_held(self, source: str, rank: int) -> bool:
        autopilot = rank >= AUTOPILOT and rank > self._highest
        return autopilot or (rank in self._held and source in self._held[rank])

    def _overrule(self, source: str, rank: int, driver: Driver, now: float) -> None:
        """Let a person's source let go before it drives, if the `driver` is a person's too, and moves the robot."""
        if rank == driver.rank == PERSON and not is_stop(driver.motion):
            self.software_stop.overrule(source, rank, now)

    def _hold(self, source: str, rank: int, new: Driver) -> None:
        free = new.source if new.rank == rank and new.source != source else ""
        self._held.setdefault(rank, Held()).add(source, free)
