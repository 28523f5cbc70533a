"""Who drives one robot. No clock, no socket.

1. The highest rank (person, script, autopilot: the Zenoh priority) with a fresh command drives;
   among equals, who drives goes on.
2. A stop from the driver's rank or above stops the robot; a lost token only stops it, and nobody
   takes over sooner.
3. Who commanded motion while an equal moved the robot, or while it was stopped, must let go (by a
   stop, or by silence) before it drives.
4. Once a higher rank drove, or another's stop took the robot, every autopilot, and the scripts and
   people concerned, wait for `resume`.
5. `stop` holds until `release`, and moves nothing by its end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from typing import NamedTuple

from msgspec import Struct, field
from msgspec.structs import replace

from holozen.command.command_time import ROUNDING, CommandTime
from holozen.command.motion import AppliedForce, AppliedForces, Motion, is_stop
from holozen.command.outcome import UNKNOWN_CALLER, Decision, Outcome, refusal
from holozen.limits import STOP
from holozen.transport.samples import PRIORITIES
from holozen.wire import COMMAND_SILENCE, release_command, resume_command

# no source ranks above a person: stronger priorities count as this one
PERSON = PRIORITIES.index("INTERACTIVE_HIGH")
# from here down, a source waits for `resume` once a higher one has driven
AUTOPILOT = PRIORITIES.index("DATA_LOW")
# s; so long the driver's last command keeps lower ranks off, and motions of equals
KEEPS_OFF = COMMAND_SILENCE
# s of silence that let go, unless a robot's velocities count for longer
LETS_GO = COMMAND_SILENCE
# s; so long a topic or joint that a source set moving counts as moved by it
PART_MOVES = COMMAND_SILENCE
MAX_NAMES = 100  # sources of a rank with a record of their own: names come over the wire
MAX_PARTS = 100  # sources whose moving topics or joints are known
LET_GO = (
    "it commanded while another drove or the robot was stopped; let go of the keys, or send zeros"
    "{or_wait}, then drive"
)
WAITS = "another source took over; `{resume}` lets it drive again"
BY_STOP = "by {by}; `{release}` lets it drive again"
VOID = "it was sent before the sim was played or reset, or the robot was spawned; send it again"


class Sent(NamedTuple):
    """What is known of when a command was sent, in s.

    Attributes:
        at: The earliest time at which it may have been sent.
        unheard: Since then its source may have sent commands that have not arrived. That is `at`;
            or if the numbers have a gap, the time at which the command before the gap was read.
            Without a stamp it is the time of reading: such a source is believed to have sent
            nothing else.
        silence: For how long, at least, its source had sent nothing before it.
    """

    at: float
    unheard: float
    silence: float = math.inf


class Source(NamedTuple):
    """Who commands: a name with a rank, since senders choose their names freely. Rank 0 is the
    highest.
    """

    name: str
    rank: int


class Commanded(NamedTuple):
    """The motion that is commanded, and until when.

    Attributes:
        value: The motion.
        until: The time (s) until which it stays the same, unless something happens; the time of the
            question where that is unknown.
    """

    value: Motion
    until: float


class Driver(Struct):
    """The source that drives.

    Attributes:
        source: Its name and rank.
        motion: What it commanded last.
        sent: The earliest time at which it may have sent that, in s on the clock of commands.
        gone: Whether its process has ended.
    """

    source: Source
    motion: Motion
    sent: float
    gone: bool = False


class Case(NamedTuple):
    """A command to be judged.

    Attributes:
        source: Who commands.
        motion: What it commands.
        now: When that is judged, in s.
        sent: When it was sent.
        driver: The source that drives at `now`; None if all are silent.
    """

    source: Source
    motion: Motion
    now: float
    sent: Sent
    driver: Driver | None

    @property
    def other(self) -> Driver | None:
        """The source that drives, if it is another one."""
        return _other(self.source, self.driver)


class Record(NamedTuple):
    """What a source has to do before it drives.

    Attributes:
        commanded: When it last commanded a motion that it has to let go of, in s on the clock of
            commands; None if there is none.
        waits: Whether it waits for `resume`.
    """

    commanded: float | None = None
    waits: bool = False


FREE = Record()


class Records:
    """The records of one rank. A flood of names frees none of them.

    Attributes:
        named: The records of the first MAX_NAMES names.
        shared: The record of all other names.
    """

    def __init__(self) -> None:
        self.named: dict[str, Record] = {}
        self.shared = FREE

    def put(self, name: str, record: Record) -> None:
        """Replace the record of a name."""
        if name not in self.named and len(self.named) >= MAX_NAMES:
            self._share(record)
        elif record == self.shared == FREE:
            self.named.pop(name, None)
        else:
            self.named[name] = record

    def _share(self, record: Record) -> None:
        times = [each.commanded for each in (self.shared, record) if each.commanded is not None]
        self.shared = Record(max(times, default=None), self.shared.waits or record.waits)

    def resume(self) -> None:
        """No source waits for `resume` any more."""
        self.shared = self.shared._replace(waits=False)
        records = {name: record._replace(waits=False) for name, record in self.named.items()}
        self.named = {
            name: record
            for name, record in records.items()
            if record != self.shared or record != FREE
        }

    def let_go_before(self, time: float) -> None:
        """Who has not commanded since `time` has let go."""
        for name, record in self.named.items():
            if record.commanded is not None and record.commanded < time:
                self.named[name] = record._replace(commanded=None)
        if self.shared.commanded is not None and self.shared.commanded < time:
            self.shared = self.shared._replace(commanded=None)

    def commanded_until(self, time: float) -> None:
        """Whoever has not let go may have commanded until `time`."""
        for name, record in self.named.items():
            if record.commanded is not None:
                self.named[name] = record._replace(commanded=time)
        if self.shared.commanded is not None:
            self.shared = self.shared._replace(commanded=time)


class State(Struct):
    """What decisions depend on.

    Attributes:
        driver: The source that was obeyed last; it may have fallen silent since.
        records: By rank.
        highest: The highest rank that has driven since the last resume.
        stopped_by: Who set the software stop; None while it is not set.
        released: When that was released last (s), if ever: commands sent before were sent to a
            stopped robot.
        began: The last play, reset or spawn (s): commands sent before move nothing.
    """

    driver: Driver | None = None
    records: dict[int, Records] = field(default_factory=dict)
    highest: int = AUTOPILOT + 1
    stopped_by: str | None = None
    released: float | None = None
    began: float = 0.0

    def was_released_after(self, time: float) -> bool:
        """Whether a software stop ended after `time` (s)."""
        return self.released is not None and time < self.released


class Arbiter:
    """Chooses which source drives one robot, by the five rules above.

    A source that drives joints, or by forces, stops driving after COMMAND_SILENCE. Silence is
    measured on the clock `time`; all methods take real times in s. Reasons name the `robot`.

    Attributes:
        velocity_timeout: The silence in s after which a source that drives by velocities stops
            driving; None: it drives until another one commands.
        state: What its decisions depend on.
        resumed: How often `resume` succeeded.
        stopped_at: The last time (s) at which the software stop was set, or set again; None before.
        taken_at: When a source last sent what makes others wait for `resume` (s); None before.
        changed: Called when an event may have changed the motion.
    """

    def __init__(
        self,
        velocity_timeout: float | None = COMMAND_SILENCE,
        time: CommandTime | None = None,
        robot: str = "",
    ) -> None:
        self._robot = robot
        self.time = time or CommandTime()
        self.velocity_timeout = velocity_timeout
        self.parts = Parts()
        self.state = State()
        self.resumed = 0
        self.stopped_at: float | None = None
        self.taken_at: float | None = None
        self.changed: Callable[[], None] = lambda: None

    # Questions

    @property
    def stopped_by(self) -> str | None:
        """Who set the software stop; None while it is not set."""
        return self.state.stopped_by

    def driver(self, now: float) -> Driver | None:
        """The source that drives at `now`; None if all are silent."""
        return self._driver_at(self.time.at(now))

    def is_driver(self, name: str, rank: int, now: float) -> bool:
        """Whether a source of that rank drives at `now`, with a stop or a motion."""
        driver = self.driver(now)
        return driver is not None and driver.source == _source(name, rank)

    def moves(self, name: str, now: float) -> bool:
        """Whether a source of that name moves the robot at `now`."""
        driver = self.driver(now)
        return driver is not None and driver.source.name == name and not is_stop(driver.motion)

    def motion(self, now: float) -> Commanded:
        """The commanded motion at `now`, and until when it is valid."""
        driver = self.driver(now)
        if driver is None:
            return Commanded(STOP, math.inf)
        patience = self._patience(driver)
        if patience is None:
            return Commanded(driver.motion, math.inf)
        end = self.time.real(driver.sent + patience)
        return Commanded(driver.motion, now if end is None else end)

    def pushes(self, now: float) -> list[AppliedForce] | None:
        """The forces that act at `now`, except those of silent topics. None if no source drives by
        forces.
        """
        driver = self.driver(now)
        if driver is None or not isinstance(driver.motion, AppliedForces):
            return None
        return list(driver.motion.since(self.time.at(now) - self.time.slack - COMMAND_SILENCE))

    def pushes_of(self, name: str, rank: int, now: float) -> AppliedForces:
        """The forces of a source at `now`; none unless it drives."""
        driver = self.driver(now)
        if driver is None or driver.source != _source(name, rank):
            return AppliedForces(())
        return driver.motion if isinstance(driver.motion, AppliedForces) else AppliedForces(())

    def must_wait(self, name: str, rank: int, now: float) -> bool:
        """Whether a source has to wait for `resume`, or has to let go, before it may drive."""
        source = _source(name, rank)
        record = self._record(source, self.driver(now))
        limit = self._silence_limit()
        has_commanded = record.commanded is not None and (
            limit is None or self.time.at(now) - record.commanded <= limit
        )
        return has_commanded or record.waits or self._yields(source.rank)

    @property
    def autopilots_wait(self) -> bool:
        """Whether every autopilot waits for `resume`, since a source above them has driven."""
        return self.state.highest < AUTOPILOT

    def judge(self, case: Case) -> Outcome:
        """What becomes of a command. Changes nothing."""
        if self.state.stopped_by:
            return Outcome.STOPPED
        if is_stop(case.motion):
            return Outcome.OVERRULED if self._is_overruled(case) else Outcome.STOPS
        if self._is_overruled(case):
            return Outcome.OVERRULED
        waits = self._record(case.source, case.driver).waits
        # who presses again is told what helps, not to let go of that press
        if waits and case.source.rank == PERSON:
            return Outcome.WAITS_FOR_RESUME
        if self._must_let_go(case):
            return Outcome.MUST_LET_GO
        if max(case.sent.at, case.sent.unheard) < self.state.began:
            return Outcome.VOID
        if waits or self._yields(case.source.rank):
            return Outcome.WAITS_FOR_RESUME
        return Outcome.DRIVES

    def resume_refusal(self, now: float) -> str:
        """Why `resume` is refused at `now`, or "". It is while the robot is stopped, or moved by a
        person or script.
        """
        if self.state.stopped_by:
            return self._decision(Outcome.STOPPED, None).reason
        driver = self.driver(now)
        if driver and driver.source.rank < AUTOPILOT and not is_stop(driver.motion):
            return f"{driver.source.name} drives; stop it first"
        return ""

    # Commands

    def offer(
        self,
        name: str,
        rank: int,
        motion: Motion,
        now: float,
        sent: Sent | None = None,
        lets_go: bool = True,
    ) -> Decision:
        """Take a command at `now`; without `sent`, it was sent now. `lets_go`: by a stop its source
        lets go.
        """
        source = _source(name, rank)
        case = Case(source, motion, now, sent or Sent(now, now), self.driver(now))
        outcome = self.judge(case)
        has_let_go = lets_go if is_stop(motion) else not self._must_let_go(case)
        if has_let_go:
            self._update(source, commanded=None)
        if not is_stop(motion) and not outcome.is_obeyed:
            self._note_motion(source, case.driver, now, has_commanded=not has_let_go)
        if outcome.is_obeyed:
            self._hand_over(case)
        return self._decision(outcome, case.driver)

    def note_refused(self, name: str, rank: int, now: float, sent: Sent | None = None) -> None:
        """Record a motion that was refused for another reason at `now`: its source has not let go.
        Without `sent`, it was sent now.
        """
        source, driver = _source(name, rank), self.driver(now)
        # Of a refused one the earliest time counts: it moves nothing, and its source may not have
        # let go.
        was_stopped = sent is not None and self.state.was_released_after(min(sent.at, sent.unheard))
        has_commanded = was_stopped or self._record(source, driver).commanded is not None
        self._note_motion(source, driver, now, has_commanded)

    def _hand_over(self, case: Case) -> None:
        """Let a source drive, or stop the robot, in place of who drove."""
        source, other, stops = case.source, case.other, is_stop(case.motion)
        other_moved = other is not None and not is_stop(other.motion)
        if other and (source.rank < other.source.rank or (stops and other_moved)):
            self._update(other.source, waits=True)
            if other_moved and source.rank == other.source.rank == PERSON:
                self._update(other.source, commanded=self.time.at(case.now))
        outranks = source.rank < AUTOPILOT and (not stops or source.rank < self.state.highest)
        if outranks or (stops and other_moved):
            self.taken_at = case.sent.at
        self.state.highest = min(self.state.highest, source.rank)
        self._drive(Driver(source, case.motion, self._on_clock(case.sent.at, case.now)))

    def _note_motion(
        self, source: Source, driver: Driver | None, now: float, has_commanded: bool
    ) -> None:
        """Record that a source commanded a motion in vain, so that it has to let go, or to wait for
        `resume`. `has_commanded`: it has not let go of an earlier motion yet.
        """
        other = _other(source, driver)
        other_moves = other is not None and not is_stop(other.motion)
        is_equal = other is not None and other_moves and source.rank == other.source.rank
        is_key_down = source.rank == PERSON and self._record(source, driver).waits
        if self.state.stopped_by or has_commanded or is_equal or is_key_down:
            self._update(source, commanded=self.time.at(now))
        if other and other_moves and source.rank > other.source.rank:
            self._update(source, waits=True)

    # Events

    def stop(self, by: str, now: float) -> None:
        """Set the software stop: no source drives until it is released, and no autopilot before
        `resume`. The first setter stays.
        """
        driver = self.driver(now)
        if driver and not is_stop(driver.motion):
            self._update(driver.source, commanded=self.time.at(now))
        self.state.stopped_by = self.state.stopped_by or by or UNKNOWN_CALLER
        self.stopped_at = self.taken_at = now
        self.state.highest = PERSON
        self._drive(None)

    def release(self, now: float) -> None:
        """End the software stop."""
        if self.state.stopped_by:
            self.state.released = now
        self.state.stopped_by = None

    def resume(self, now: float) -> str:
        """Let every source drive again that waits for it. Returns the `resume_refusal`, if there is
        any.
        """
        if reason := self.resume_refusal(now):
            return reason
        driver = self.driver(now)
        self._drive(driver if driver and driver.source.rank >= AUTOPILOT else None)
        for records in self.state.records.values():
            records.resume()
        self.state.highest = AUTOPILOT + 1
        self.resumed += 1
        return ""

    def forget(self, name: str, of_members: bool = False) -> None:
        """Stop the robot if this source drives: its process is gone. No other source takes over any
        sooner.

        `of_members`: the name of a source begins with that of a member, as in the secure set-up,
        and that is ignored.
        """
        driver = self.state.driver
        if driver and name == (
            driver.source.name.partition("/")[2] if of_members else driver.source.name
        ):
            self._drive(replace(driver, motion=STOP, gone=True))

    def begin(self, now: float, without_watchdog: bool = True) -> None:
        """The sim is played or reset at `now`, or the robot is spawned: only a new command moves
        it. A driver that no watchdog ends goes on, unless `without_watchdog`. Records and the
        software stop remain.
        """
        if self.state.driver and not without_watchdog and self._patience(self.state.driver) is None:
            self.changed()
            return
        self.state.began = now
        self._drive(None)

    def set_velocity_timeout(self, timeout: float | None, now: float) -> None:
        """Set the `velocity_timeout` in s from `now` on. A longer one does not revive a source that
        has fallen silent.
        """
        self._drive(self.driver(now))
        self.velocity_timeout = timeout

    def settle(self, now: float) -> None:
        """The robot is removed at `now`: who has been silent until then has let go. Another one may
        `inherit`.
        """
        time, limit = self.time.at(now), self._silence_limit()
        if limit is not None:
            for records in self.state.records.values():
                records.let_go_before(time - limit)
        self.parts.settle(time)

    def inherit(self, other: Arbiter, now: float) -> None:
        """Take over the records and the software stop of a robot that is replaced at `now`. Nothing
        listened until then, so whoever had not let go may have commanded.
        """
        self.state.records = deepcopy(other.state.records)
        for records in self.state.records.values():
            records.commanded_until(self.time.at(now))
        self.state.stopped_by = other.state.stopped_by
        self.stopped_at = other.stopped_at
        self.taken_at = other.taken_at
        self.state.highest = other.state.highest
        self.state.released = other.state.released
        self.parts.inherit(other.parts, self.time.at(now))

    # Parts of the above

    def _driver_at(self, time: float) -> Driver | None:
        driver = self.state.driver
        if driver is None or (patience := self._patience(driver)) is None:
            return driver
        return driver if time - driver.sent - self.time.slack <= patience else None

    def _patience(self, driver: Driver) -> float | None:
        """The silence in s after which a driver no longer drives; None: never."""
        is_velocity = isinstance(driver.motion, tuple)
        return self.velocity_timeout if is_velocity else COMMAND_SILENCE

    def _is_overruled(self, case: Case) -> bool:
        """Whether another source keeps this one off by a fresh command: one of a higher rank, or if
        this is a motion, one of the same rank.
        """
        other = case.other
        if other is None or self.time.at(case.now) - other.sent > KEEPS_OFF:
            return False
        if is_stop(case.motion):
            return case.source.rank > other.source.rank
        return case.source.rank >= other.source.rank

    def _yields(self, rank: int) -> bool:
        """Whether a source of that rank waits for `resume`, since one above it has driven."""
        return rank >= AUTOPILOT and rank > self.state.highest

    def _record(self, source: Source, driver: Driver | None) -> Record:
        """The record of a source. Who drives does not share that of a flood of names."""
        records = self.state.records.get(source.rank)
        if records is None:
            return FREE
        own = records.named.get(source.name)
        if own is not None:
            return own
        return FREE if driver and driver.source == source else records.shared

    def _update(self, source: Source, **changes: object) -> None:
        """Change the record of a source."""
        before = self._record(source, None)
        changed = before._replace(**changes)  # type: ignore[arg-type]
        if changed != before:
            self.state.records.setdefault(source.rank, Records()).put(source.name, changed)

    def _must_let_go(self, case: Case) -> bool:
        """Whether a source has not let go: it may have commanded while the robot was stopped, or
        not been silent since it commanded in vain.
        """
        sent = case.sent
        if self.state.was_released_after(sent.unheard):
            return True
        commanded = self._record(case.source, case.driver).commanded
        if commanded is None:
            return False
        limit = self._silence_limit()
        if limit is None:
            return True
        passed = self._on_clock(sent.at, case.now) - commanded
        silence = passed if self.time.is_paused else min(passed, sent.silence)
        return silence <= limit + ROUNDING

    def _silence_limit(self) -> float | None:
        """The silence in s that lets go; None if only a stop does."""
        return None if self.velocity_timeout is None else max(self.velocity_timeout, LETS_GO)

    def _on_clock(self, sent: float, now: float) -> float:
        """A real time on the clock of commands; while the sim is paused, commands do not age."""
        time = self.time.at(now)
        return time if self.time.is_paused else time - (now - sent)

    def _drive(self, driver: Driver | None) -> None:
        self.state.driver = driver
        self.changed()

    def _decision(self, outcome: Outcome, driver: Driver | None) -> Decision:
        """The decision with its reason, in words of the person who reads it."""
        if outcome is Outcome.STOPPED:
            return refusal(
                outcome,
                BY_STOP.format(by=self.state.stopped_by, release=release_command(self._robot)),
            )
        if outcome is Outcome.MUST_LET_GO:
            limit = self._silence_limit()
            return refusal(
                outcome,
                LET_GO.format(or_wait="" if limit is None else f" or nothing for {limit:g} s"),
            )
        if outcome is Outcome.OVERRULED and driver:
            return refusal(outcome, f"{driver.source.name} drives; it has to stop first")
        if outcome is Outcome.WAITS_FOR_RESUME:
            return refusal(outcome, WAITS.format(resume=resume_command(self._robot)))
        if outcome is Outcome.VOID:
            return refusal(outcome, VOID)
        return Decision(outcome)


class Parts:
    """The topics or joints that each source has set moving in the last PART_MOVES seconds, and not
    stopped since.

    A source may command them one by one: then a zero for one is no stop while it moves another.
    Names come over the wire, so of too many sources the one that has been silent for the longest
    time is forgotten.
    """

    def __init__(self) -> None:
        self._moving: dict[Source, dict[str, float]] = {}

    def record(self, source: Source, parts: list[tuple[str, bool]], time: float) -> bool:
        """Record which `parts` a command moves, and which it stops, at `time` (s). Returns whether
        its source still moves any.
        """
        mine = {
            name: at for name, at in self._moving.pop(source, {}).items() if time - at <= PART_MOVES
        }
        for name, moves in parts:
            mine.pop(name, None)
            if moves:
                mine[name] = time
        if mine:
            self._moving[source] = mine
            if len(self._moving) > MAX_PARTS:
                del self._moving[next(iter(self._moving))]
        return bool(mine)

    def settle(self, time: float) -> None:
        """Forget what no source has moved for PART_MOVES by `time` (s)."""
        for source, parts in self._moving.items():
            self._moving[source] = {
                name: at for name, at in parts.items() if time - at <= PART_MOVES
            }

    def inherit(self, other: Parts, time: float) -> None:
        """Take over those of a robot that is replaced at `time` (s): nothing listened until
        then.
        """
        self._moving = {
            source: dict.fromkeys(parts, time) for source, parts in other._moving.items()
        }


def _source(name: str, rank: int) -> Source:
    """The source of a command. No rank is above a person's."""
    return Source(name, max(rank, PERSON))


def _other(source: Source, driver: Driver | None) -> Driver | None:
    """The driver, if it is another source."""
    return driver if driver and driver.source != source else None
