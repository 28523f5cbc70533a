"""Commands on one robot's cmd_vel, joint_command and forces: checked, limited, counted, and passed to the arbiters."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable
from typing import TypeVar

from holozen.command.arbiter import Arbiter
from holozen.command.freshness import Freshness, Judged, Senders, source_of
from holozen.command.motion import AppliedForce, AppliedForces, JointMotion, is_stop, motion_of
from holozen.console import report
from holozen.limits import STOP, Planar, clamp_speed
from holozen.messages import CommandSource, CommandStatus, JointState, Message, Twist, TwistStamped, Wrench
from holozen.messages.message import not_finite
from holozen.suggest import listed
from holozen.transport.pubsub import Received
from holozen.transport.samples import PRIORITIES
from holozen.wire import MAX_STAMP_AGE, implausible

MAX_LINEAR = 5.0  # m/s
MAX_ANGULAR = 10.0  # rad/s
LINEAR, ANGULAR = (0.01, 50.0), (0.01, 100.0)  # their ranges
MAX_RATES = 16  # names come over the wire; beyond, the least recent of the lowest rank is forgotten
RECENT = 3.0  # s
SPAN = 1.0  # s over which commands are counted
MARK = 0.1  # s between two samples of a count
REPORT_EVERY = 1.0  # s
M = TypeVar("M", bound=Message)

UNPROVEN = "unproven"  # the kind of a refused command whose sender's name is not proved


class TwistInput:
    """Checks commands and passes the valid ones to the arbiter.

    Reports name the robot by `key`, its cmd_vel; `others` are additional command keys. `refusal` says why none but a
    stop can move the robot, if that is so.
    """

    def __init__(
        self, key: str, arbiter: Arbiter, senders: Senders, linear: float, angular: float,
        report: Callable[[str], None] = report, others: tuple[str, ...] = (), refusal: str = "",
    ) -> None:  # fmt: skip
        self.arbiter, self.stats, self._rates = arbiter, CommandStats(report), SourceRates()
        self.freshness: Freshness[Twist | TwistStamped] = Freshness((key, *others), senders, _stops, arbiter.moves)
        self.keys, self.linear, self.angular, self._refusal = (key, *others), linear, angular, refusal
        # Whether a source came that no status has named yet, or any command in a sim that is held: its stepper waits
        # for its command to be read.
        self.has_news = False

    def take(
        self, arrived: Iterable[Received[Twist | TwistStamped]], now: float, clocks: tuple[float, ...], since: float
    ) -> None:
        """Process the samples that arrived by `now` (s, monotonic), not before `since`, and those that waited.

        `clocks`: the times in seconds that a header's stamp may be measured by.
        """
        for judged in self.freshness.sift(arrived, now, since):
            self._take(judged, now, clocks)

    def _take(self, judged: Judged[Twist | TwistStamped], now: float, clocks: tuple[float, ...]) -> None:
        received, sent, delay, refusal = judged
        rank, source = PRIORITIES.index(received.sample.priority), source_of(received)
        if not received.error.startswith(UNPROVEN):  # its source is a claim
            self.has_news |= self._rates.record(source, rank, now, delay) or self.arbiter.time.is_held
        message = self.stats.validated(received, self.keys, now)
        if message is None:
            return None
        velocity = _velocity(message)
        if not is_stop(velocity):
            refusal = refusal or self._refusal
        if refusal:
            self.arbiter.note_refused(source, rank, now)
            return self._refuse(refusal.partition(":")[0], refusal, source, now)
        if isinstance(message, TwistStamped) and not is_stop(velocity):  # a stop is obeyed whatever its sender's clock
            age = _age(message, clocks)
            if abs(age) > MAX_STAMP_AGE:
                self.arbiter.note_refused(source, rank, now)
                return self._refuse("stale", f"stamp is {age:.1f} s old; at most {MAX_STAMP_AGE} s", source, now)
            sent = min(sent, now - age)
        return self._obey(velocity, source, rank, now, sent)

    def status(self, now: float) -> CommandStatus:
        """The source that drives, the sources of recent commands, and the counts so far."""
        self.has_news = False
        driver, held = self.arbiter.driver(now), self.arbiter.holds
        obeyed = driver.source if driver else ""
        motion = (
            driver.motion if driver and isinstance(driver.motion, tuple) else STOP
        )  # that of joints has no velocity
        return CommandStatus(
            commanded=Twist.planar(*motion),
            obeyed=obeyed,
            priority=PRIORITIES[driver.rank] if driver else "",
            held=self.arbiter.held,
            resumed=self.arbiter.resumed,
            accepted=self.stats.accepted,
            refused=dict(self.stats.refused),
            last_refusal=self.stats.last,
            stopped=self.arbiter.software_stop.setter,
            sources=[
                CommandSource(source, PRIORITIES[rank], rate, source == obeyed, held(source, rank, now), delay)
                for source, rank, rate, delay in self._rates.recent(now)
            ],
        )

    def _obey(self, velocity: Planar, source: str, rank: int, now: float, sent: float) -> None:
        limited = clamp_speed(velocity, self.linear, self.angular)
        if reason := self.arbiter.offer(source, rank, limited, now, sent):
            return self._refuse(reason.partition(":")[0], reason, source, now)
        self.stats.accepted += 1
        if limited != velocity:
            text = f"over the limits of {self.linear:g} m/s and {self.angular:g} rad/s, clamped: {velocity}"
            self._refuse("clamped", text, source, now)
        return None

    def _refuse(self, kind: str, reason: str, source: str, now: float) -> None:
        self.stats.refuse(self.keys[0], kind, reason, source, now)


def _velocity(message: Twist | TwistStamped) -> Planar:
    twist = message.twist if isinstance(message, TwistStamped) else message
    return twist.linear.x, twist.linear.y, twist.angular.z


def _stops(message: Twist | TwistStamped) -> bool:
    return is_stop(_velocity(message))


def _age(message: TwistStamped, clocks: tuple[float, ...]) -> float:
    """The age of a stamp in seconds, by the nearest clock; 0 without a stamp."""
    stamp = message.header.stamp.seconds()
    return min((now - stamp for now in clocks), key=abs) if stamp else 0.0


class JointInput:
    """Checks joint commands. The wheels share the arbiter of cmd_vel, so that a person at the teleop has priority."""

    def __init__(
        self,
        key: str,
        senders: Senders,
        stats: CommandStats,
        groups: list[tuple[frozenset[str], Arbiter]],
        known: list[str],
    ) -> None:
        self.key = key
        self.freshness: Freshness[JointState] = Freshness((key,), senders, _joints_stop, self._moves)
        self._stats, self._groups, self._known = stats, groups, known

    def take(self, arrived: Iterable[Received[JointState]], now: float, since: float) -> None:
        """Process the samples that arrived by `now` (s, monotonic), not before `since`, and those that waited."""
        for judged in self.freshness.sift(arrived, now, since):
            self._take(judged, now)

    def _take(self, judged: Judged[JointState], now: float) -> None:
        received, sent, _, refusal = judged
        message, source = self._stats.validated(received, (self.key,), now), source_of(received)
        if message is None:
            return
        rank = PRIORITIES.index(received.sample.priority)
        if refusal:
            for _, arbiter in self._groups:
                arbiter.note_refused(source, rank, now)
            return self._stats.refuse(self.key, refusal.partition(":")[0], refusal, source, now)
        try:
            motion = self._checked(motion_of(message))
        except ValueError as error:
            return self._stats.refuse(self.key, "malformed", str(error), source, now)
        for names, arbiter in self._groups:
            if part := motion.only(names):
                self._offer(arbiter, source, rank, part, now, sent)

    def _moves(self, source: str, now: float) -> bool:
        return any(arbiter.moves(source, now) for _, arbiter in self._groups)

    def _checked(self, motion: JointMotion) -> JointMotion:
        moved = frozenset[str]().union(*(names for names, _ in self._groups))
        for name, _ in motion.values:
            if name not in self._known:
                raise ValueError(f"there is no joint {name!r}; the joints are {listed(self._known)}")
            if name not in moved:
                raise ValueError(f"joint {name!r} follows the drive; only {listed(list(moved))} take commands")
        return motion

    def _offer(self, arbiter: Arbiter, source: str, rank: int, motion: JointMotion, now: float, sent: float) -> None:
        if reason := arbiter.offer(source, rank, motion, now, sent):
            self._stats.refuse(self.key, reason.partition(":")[0], reason, source, now)
        else:
            self._stats.accepted += 1


def _joints_stop(message: JointState) -> bool:
    try:
        return motion_of(message).stops
    except ValueError:
        return True  # it moves nothing, and is refused later


class ForceInput:
    """Checks the wrenches on a robot's `keys` and passes them to the arbiter, where one source gives all of them."""

    def __init__(self, keys: tuple[str, ...], arbiter: Arbiter, senders: Senders, stats: CommandStats) -> None:
        self.keys, self._arbiter, self._stats = keys, arbiter, stats
        self.freshness: Freshness[Wrench] = Freshness(keys, senders, _pushes_nothing, arbiter.moves)

    def take(self, arrived: Iterable[Received[Wrench]], now: float, since: float) -> None:
        """Process the samples that arrived by `now` (s, monotonic), not before `since`, and those that waited."""
        for judged in self.freshness.sift(arrived, now, since):
            self._take(judged, now)

    def _take(self, judged: Judged[Wrench], now: float) -> None:
        received, sent, _, refusal = judged
        message, source = self._stats.validated(received, self.keys, now), source_of(received)
        if message is None:
            return
        key, rank, arbiter = received.sample.key, PRIORITIES.index(received.sample.priority), self._arbiter
        if refusal:
            arbiter.note_refused(source, rank, now)
        else:
            others = arbiter.pushes_of(source, rank, now).but(key)
            push = AppliedForce(
                key, _wrench(message), arbiter.time.at(now) - (0.0 if arbiter.time.is_held else now - sent)
            )
            refusal = arbiter.offer(source, rank, AppliedForces(tuple(sorted((*others, push)))), now, sent)
        if refusal:
            self._stats.refuse(key, refusal.partition(":")[0], refusal, source, now)
        else:
            self._stats.accepted += 1


def _wrench(message: Wrench) -> tuple[float, float, float, float, float, float]:
    force, torque = message.force, message.torque
    return force.x, force.y, force.z, torque.x, torque.y, torque.z


def _pushes_nothing(message: Wrench) -> bool:
    return not any(_wrench(message))


class SourceRate:
    """One source: its rank, the time of its last command, and their number."""

    __slots__ = ("_marks", "count", "delay", "last", "rank")

    def __init__(self, now: float) -> None:
        self.rank, self.last, self.count, self.delay = 0, now, 0, 0.0
        self._marks: deque[tuple[float, int]] = deque([(now, 0)])  # past counts, the oldest about SPAN ago

    def rate(self, now: float) -> float:
        """Command rate (Hz) over about the last second."""
        marks = self._marks
        if now - marks[-1][0] >= MARK:
            marks.append((now, self.count))
        while len(marks) > 1 and now - marks[1][0] >= SPAN:
            marks.popleft()
        since, before = marks[0]
        return (self.count - before) / max(now - since, SPAN)


class SourceRates:
    """The sources of the last seconds. A command costs one look-up and an addition."""

    def __init__(self) -> None:
        self._all: dict[tuple[str, int], SourceRate] = {}

    def record(self, source: str, rank: int, now: float, delay: float = 0.0) -> bool:
        """Record a command from `source` at `now` (s), at most `delay` seconds old (0: unknown). Returns whether the
        source is new.
        """
        each = self._all.get((source, rank))
        if is_new := each is None:
            if len(self._all) >= MAX_RATES:
                del self._all[max(self._all, key=lambda name: (name[1], -self._all[name].last))]
            each = self._all[source, rank] = SourceRate(now)
        each.rank, each.last, each.delay = rank, now, delay
        each.count += 1
        return is_new

    def recent(self, now: float) -> list[tuple[str, int, float, float]]:
        """(source, rank, rate in Hz, delay in s) of recent sources, the highest rank first."""
        self._all = {name: each for name, each in self._all.items() if now - each.last <= RECENT}
        rows = ((name, rank, each.rate(now), each.delay) for (name, rank), each in self._all.items())
        return sorted(rows, key=lambda row: (row[1], row[0]))


class CommandStats:
    """Counts accepted commands, and refused ones by reason."""

    def __init__(self, report: Callable[[str], None] = report) -> None:
        self.accepted = 0
        self.refused: Counter[str] = Counter()
        self.last = ""
        self._report = report
        self._reported = -math.inf
        self._unreported = 0

    def validated(self, received: Received[M], keys: tuple[str, ...], now: float) -> M | None:
        """The message of a sample on one of `keys`; None if it is not valid, which is counted."""
        kind, reason = _fault(received, keys)
        if kind:
            self.refuse(keys[0], kind, reason, source_of(received), now)
        return None if kind else received.message

    def refuse(self, key: str, kind: str, reason: str, source: str, now: float) -> None:
        """Count and report a refused command of `source` on `key`."""
        self.refused[kind] += 1
        self.last = f"{source}: {reason}"[:300]
        self._unreported += 1
        if now - self._reported < REPORT_EVERY:
            return
        more = f" (and {self._unreported - 1} more)" if self._unreported > 1 else ""
        self._report(f"{key}: from {self.last}{more}")
        self._reported, self._unreported = now, 0


def _fault(received: Received[M], keys: tuple[str, ...]) -> tuple[str, str]:
    """The kind of fault of a sample, and its description; both empty for a valid one."""
    sample, message = received.sample, received.message
    if sample.key not in keys:
        return "wildcard", f"a command for {sample.key!r}; name one robot"
    if message is None:
        kind = received.error.partition(":")[0]
        return kind if kind in ("oversized", UNPROVEN) else "malformed", received.error
    if bad := not_finite(message):
        return "not finite", f"{bad} is not a finite number"
    if bad := implausible(message):
        return "implausible", bad
    return "", ""
