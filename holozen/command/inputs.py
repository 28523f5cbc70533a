"""Commands on one robot's cmd_vel, joint_command and forces: checked, limited, counted, and passed
to the arbiters.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar

from holozen.command.arbiter import Arbiter, Sent, Source
from holozen.command.freshness import Freshness, Judged, Senders, source_of
from holozen.command.motion import (
    AppliedForce,
    AppliedForces,
    JointMotion,
    Motion,
    is_stop,
    motion_of,
)
from holozen.command.outcome import OVER_LIMITS, Decision
from holozen.command.wait_set import Moment, Reader
from holozen.console import report
from holozen.limits import STOP, Planar, clamp_speed
from holozen.messages import (
    CommandSource,
    CommandStatus,
    Header,
    JointState,
    Message,
    Twist,
    TwistStamped,
    Wrench,
)
from holozen.messages.message import not_finite
from holozen.suggest import listed
from holozen.transport.pubsub import Received, Subscription
from holozen.transport.samples import PRIORITIES
from holozen.wire import MAX_STAMP_AGE, implausible

MAX_LINEAR = 5.0  # m/s
MAX_ANGULAR = 10.0  # rad/s
LINEAR, ANGULAR = (0.01, 50.0), (0.01, 100.0)  # the ranges in which these two may be set
# sources, whose names come over the wire; beyond, the oldest of the lowest rank is forgotten
MAX_RATES = 16
RECENT = 3.0  # s for which a source is listed
SPAN = 1.0  # s over which the rate is measured
MARK = 0.1  # s between two samples of a count
REPORT_EVERY = 1.0  # s
# a second by all robots: if a fleet's driver fails, each of them has something to report
MAX_LINES = 10
MAX_REASON = 300  # characters: a sender's name may be long
M = TypeVar("M", bound=Message)

PARTIAL_STOP = (
    "part: its sender still moves another joint or topic, so this zero stops nothing; send zeros "
    "there too"
)
# one part, whichever of the robot's keys a velocity comes on: a zero on any of them ends it
TWIST = "cmd_vel"
UNPROVEN = "unproven"  # the kind of refusal of a command without proof of its sender's name


class Command(NamedTuple, Generic[M]):
    """A valid message on `key` from `source`, with its `rank`, read at a `moment`, and `sent` then.
    `age` in s is that by the stamp in its header; 0 without one.
    """

    message: M
    key: str
    source: str
    rank: int
    moment: Moment
    sent: Sent
    age: float


class Input(Generic[M]):
    """Checks the commands on some keys, and passes those that are valid and fresh to the
    arbiters.
    """

    def __init__(
        self,
        keys: tuple[str, ...],
        freshness: Freshness[M],
        stats: CommandStats,
        arbiters: Iterable[Arbiter],
    ) -> None:
        self.keys, self.freshness, self.stats, self._arbiters = (
            keys,
            freshness,
            stats,
            tuple(arbiters),
        )

    def reader(self, commands: Subscription[M]) -> Reader:
        """A reader of the commands that wait at a subscription."""
        return Reader(commands.raw.channel, partial(self._read, commands))

    def _read(self, commands: Subscription[M], first: Any, moment: Moment) -> bool:
        self.take(commands.waiting(first), moment)
        return False

    def take(self, arrived: Iterable[Received[M]], moment: Moment) -> None:
        """Process the samples that `arrived` by that moment."""
        for judged in self.freshness.sift(arrived, moment.now, moment.since):
            self._take(judged, moment)

    def _take(self, judged: Judged[M], moment: Moment) -> None:
        received = judged.received
        source, rank = source_of(received), PRIORITIES.index(received.priority)
        self._note(judged, source, rank, moment.now)
        message = self.stats.validated(received, self.keys, moment.now)
        if message is None:
            if received.message is not None and not self.freshness.stops(received.message):
                # an impossible motion is one too
                self._note_refused(source, rank, moment.now, judged.sent)
            return
        age = self._stamp_age(message, moment)
        sent = judged.sent._replace(at=min(judged.sent.at, moment.now - age))
        command = Command(message, received.key, source, rank, moment, sent, age)
        why = judged.refused.reason if judged.refused else self._refusal(command)
        if why:
            self._note_refused(source, rank, moment.now, sent)
            self._refuse(command, why)
        else:
            self._obey(command)

    def _note_refused(self, source: str, rank: int, now: float, sent: Sent) -> None:
        """A source that commands has not let go, whatever becomes of its command."""
        for arbiter in self._arbiters:
            arbiter.note_refused(source, rank, now, sent)

    def _note(self, judged: Judged[M], source: str, rank: int, now: float) -> None:
        """Called for each sample, whether it is valid or not. Does nothing; override it."""

    def _stamp_age(self, message: M, moment: Moment) -> float:
        """The age in s of a message by the stamp in its header, by the nearest clock; 0 without
        one. A stop may have any stamp.
        """
        header: Header | None = getattr(message, "header", None)
        if not header or not (stamp := header.stamp.seconds()) or self.freshness.stops(message):
            return 0.0
        return min((now - stamp for now in moment.clocks), key=abs)

    def _refusal(self, command: Command[M]) -> str:
        """Why a command is refused, beginning with the kind of reason and a colon; empty if it is
        not.
        """
        if abs(command.age) > MAX_STAMP_AGE:
            when = "old" if command.age > 0 else "in the future"
            return (
                f"stale: its header.stamp is {abs(command.age):.1f} s {when}, and the limit is "
                f"{MAX_STAMP_AGE} s; set the clocks by NTP, or leave the stamp at 0"
            )
        return ""

    def _obey(self, command: Command[M]) -> None:
        """Pass a command to the arbiters."""
        raise NotImplementedError

    def _offer(
        self,
        arbiter: Arbiter,
        command: Command[M],
        motion: Motion,
        parts: list[tuple[str, bool]],
        is_whole: bool = False,
    ) -> bool:
        """Pass a command's motion to an arbiter, and count it. Returns whether it is obeyed.

        `parts` are the topics or joints that it commands, each with whether it moves that. With
        `is_whole` it commands the whole robot instead. By a zero for one part a source has not let
        go while it moves another one; unless it drives the robot, it does not stop it by that.
        """
        source, rank, now = command.source, command.rank, command.moment.now
        moves = arbiter.parts.record(Source(source, rank), parts, arbiter.time.at(now))
        if moves and is_stop(motion) and not (is_whole or arbiter.is_driver(source, rank, now)):
            arbiter.note_refused(source, rank, now, command.sent)
            self._refuse(command, PARTIAL_STOP)
            return False
        decision: Decision = arbiter.offer(
            source, rank, motion, now, command.sent, lets_go=not moves
        )
        if decision.outcome.is_obeyed:
            self.stats.accepted += 1
        else:
            self._refuse(command, decision.reason)
        return decision.outcome.is_obeyed

    def _refuse(self, command: Command[M], reason: str, kind: str = "") -> None:
        """Count a refusal, by default under the `kind` that the reason begins with."""
        kind = kind or reason.partition(":")[0]
        self.stats.refuse(self._reported(command), kind, reason, command.source, command.moment.now)

    def _reported(self, command: Command[M]) -> str:
        """The key that reports of a refusal name."""
        return command.key


class TwistInput(Input[Twist | TwistStamped]):
    """The velocity commands of one robot, clamped to `linear` (m/s) and `angular` (rad/s).

    Reports name the robot by `key`, its cmd_vel; `others` are additional command keys. With a
    `refusal`, all commands but stops are refused for that reason. `limit` bounds the reports of all
    robots that share it.

    Attributes:
        on_news: Called at a time (s) when a status has something new to tell: another source; or,
            while the sim is paused, any command, since a process that steps the sim waits until its
            command has been read.
    """

    def __init__(
        self,
        key: str,
        arbiter: Arbiter,
        senders: Senders,
        linear: float,
        angular: float,
        report: Callable[[str], None] = report,
        others: tuple[str, ...] = (),
        refusal: str = "",
        limit: ReportLimit | None = None,
    ) -> None:
        freshness: Freshness[Twist | TwistStamped] = Freshness(
            (key, *others), senders, _stops, (arbiter,)
        )
        super().__init__((key, *others), freshness, CommandStats(report, limit), (arbiter,))
        self.arbiter, self.linear, self.angular, self._always_refused = (
            arbiter,
            linear,
            angular,
            refusal,
        )
        self._rates = SourceRates()
        self._has_news = False
        self.on_news: Callable[[float], None] = lambda now: None

    def take(self, arrived: Iterable[Received[Twist | TwistStamped]], moment: Moment) -> None:
        """Process samples as every input does, then call `on_news` if there is news."""
        super().take(arrived, moment)
        has_news, self._has_news = self._has_news, False
        if has_news:
            self.on_news(moment.now)

    def _note(
        self, judged: Judged[Twist | TwistStamped], source: str, rank: int, now: float
    ) -> None:
        if not judged.received.error.startswith(UNPROVEN):  # its source is a claim
            self._has_news |= (
                self._rates.record(source, rank, now, judged.age or 0.0)
                or self.arbiter.time.is_paused
            )

    def status(self, now: float) -> CommandStatus:
        """The source that drives, the sources of recent commands, and the counts so far."""
        driver = self.arbiter.driver(now)
        driver = None if driver and driver.gone else driver
        obeyed = driver.source.name if driver else ""
        # that of joints is no velocity
        motion = driver.motion if driver and isinstance(driver.motion, tuple) else STOP
        return CommandStatus(
            commanded=Twist.planar(*motion),
            obeyed=obeyed,
            priority=PRIORITIES[driver.source.rank] if driver else "",
            held=self.arbiter.autopilots_wait,
            resumed=self.arbiter.resumed,
            accepted=self.stats.accepted,
            refused=dict(self.stats.refused),
            last_refusal=self.stats.last_refusal,
            clamped=self.stats.clamped,
            last_clamped=self.stats.last_clamped,
            stopped=self.arbiter.stopped_by or "",
            sources=[
                CommandSource(
                    source,
                    PRIORITIES[rank],
                    rate,
                    obeyed=source == obeyed,
                    held=self.arbiter.must_wait(source, rank, now),
                    delay=delay,
                )
                for source, rank, rate, delay in self._rates.recent(now)
            ],
        )

    def _refusal(self, command: Command[Twist | TwistStamped]) -> str:
        if self._always_refused and not _stops(command.message):
            return self._always_refused
        return super()._refusal(command)

    def _obey(self, command: Command[Twist | TwistStamped]) -> None:
        velocity = _velocity(command.message)
        limited = clamp_speed(velocity, self.linear, self.angular)
        parts = [(TWIST, not is_stop(limited))]
        if (
            self._offer(self.arbiter, command, limited, parts, is_whole=True)
            and limited != velocity
        ):
            text = (
                f"{OVER_LIMITS} of {self.linear:g} m/s and {self.angular:g} rad/s, clamped: "
                f"{velocity}"
            )
            self.stats.note_clamped(self.keys[0], text, command.source, command.moment.now)

    def _reported(self, command: Command[Twist | TwistStamped]) -> str:
        return self.keys[0]


def _velocity(message: Twist | TwistStamped) -> Planar:
    twist = message.twist if isinstance(message, TwistStamped) else message
    return twist.linear.x, twist.linear.y, twist.angular.z


def _stops(message: Twist | TwistStamped) -> bool:
    return is_stop(_velocity(message))


class JointInput(Input[JointState]):
    """The joint commands of one robot. Each of the `groups` of joints has an arbiter; `known` are
    all joints. The wheels share the arbiter of cmd_vel, so that a person at the teleop has
    priority.
    """

    def __init__(
        self,
        key: str,
        senders: Senders,
        stats: CommandStats,
        groups: list[tuple[frozenset[str], Arbiter]],
        known: list[str],
    ) -> None:
        arbiters = [arbiter for _, arbiter in groups]
        freshness: Freshness[JointState] = Freshness((key,), senders, _joints_stop, arbiters)
        super().__init__((key,), freshness, stats, arbiters)
        self._groups, self._known = groups, known

    def _obey(self, command: Command[JointState]) -> None:
        try:
            motion = self._checked(motion_of(command.message))
        except ValueError as error:
            return self._refuse(command, str(error), "malformed")
        accepted = self.stats.accepted
        for names, arbiter in self._groups:
            if part := motion.only(names):
                each = [
                    (name, part.kind == "position" or value != 0) for name, value in part.values
                ]
                self._offer(arbiter, command, part, each)
        # one command, though for several arbiters
        self.stats.accepted = min(self.stats.accepted, accepted + 1)

    def _checked(self, motion: JointMotion) -> JointMotion:
        moved = frozenset[str]().union(*(names for names, _ in self._groups))
        for name, _ in motion.values:
            if name not in self._known:
                raise ValueError(
                    f"there is no joint {name!r}; the joints are {listed(self._known)}"
                )
            if name not in moved:
                raise ValueError(
                    f"joint {name!r} follows the drive; only {listed(moved)} take commands"
                )
        return motion


def _joints_stop(message: JointState) -> bool:
    try:
        return motion_of(message).stops
    except ValueError:
        return True  # it moves nothing, and is refused later


class ForceInput(Input[Wrench]):
    """The wrenches on a robot's `keys`. One source drives at a time: all that act are its own."""

    def __init__(
        self, keys: tuple[str, ...], arbiter: Arbiter, senders: Senders, stats: CommandStats
    ) -> None:
        super().__init__(
            keys, Freshness(keys, senders, _pushes_nothing, (arbiter,)), stats, (arbiter,)
        )

    def _obey(self, command: Command[Wrench]) -> None:
        (arbiter,), now = self._arbiters, command.moment.now
        age = 0.0 if arbiter.time.is_paused else now - command.sent.at
        push = AppliedForce(command.key, _wrench(command.message), arbiter.time.at(now) - age)
        others = arbiter.pushes_of(command.source, command.rank, now).without(command.key)
        parts = [(command.key, any(push.wrench))]
        self._offer(arbiter, command, AppliedForces(tuple(sorted((*others, push)))), parts)


def _wrench(message: Wrench) -> tuple[float, float, float, float, float, float]:
    force, torque = message.force, message.torque
    return force.x, force.y, force.z, torque.x, torque.y, torque.z


def _pushes_nothing(message: Wrench) -> bool:
    return not any(_wrench(message))


class SourceRate:
    """One source: the time and the `delay` of its last command (s), and the number of its
    commands.
    """

    __slots__ = ("_marks", "count", "delay", "last")

    def __init__(self, now: float) -> None:
        self.last, self.count, self.delay = now, 0, 0.0
        # past counts, the oldest about SPAN ago
        self._marks: deque[tuple[float, int]] = deque([(now, 0)])

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
    """The rates of recent sources. Recording a command takes one look-up and an addition."""

    def __init__(self) -> None:
        self._all: dict[tuple[str, int], SourceRate] = {}

    def record(self, source: str, rank: int, now: float, delay: float = 0.0) -> bool:
        """Record a command from `source` at `now` (s), at most `delay` seconds old (0: unknown).
        Returns whether the source is new.
        """
        each = self._all.get((source, rank))
        if is_new := each is None:
            if len(self._all) >= MAX_RATES:
                del self._all[max(self._all, key=lambda name: (name[1], -self._all[name].last))]
            each = self._all[source, rank] = SourceRate(now)
        each.last, each.delay = now, delay
        each.count += 1
        return is_new

    def recent(self, now: float) -> list[tuple[str, int, float, float]]:
        """(source, rank, rate in Hz, delay in s) of recent sources, the highest rank first."""
        self._all = {name: each for name, each in self._all.items() if now - each.last <= RECENT}
        rows = (
            (name, rank, each.rate(now), each.delay) for (name, rank), each in self._all.items()
        )
        return sorted(rows, key=lambda row: (row[1], row[0]))


class ReportLimit:
    """Lets MAX_LINES reports of refused commands through in a second, by all robots that share
    it.
    """

    def __init__(self) -> None:
        self._since: float | None = None  # s; when the second began; None before the first report
        self._written = 0

    def take(self, now: float) -> bool:
        """Whether another report may be written at `now` (s)."""
        if self._since is None or not 0 <= now - self._since < REPORT_EVERY:
            self._since, self._written = now, 0
        self._written += 1
        return self._written <= MAX_LINES


class CommandStats:
    """Counts the commands of one robot, and reports what it does not do as commanded.

    Attributes:
        accepted: The number of those that were accepted.
        clamped: The number of those of them that were over the limits.
        refused: The numbers of refused ones by kind.
        last_clamped: The source of the last that was clamped, and why; empty if there was none.
        last_refusal: The same of the last that was refused.
    """

    def __init__(
        self, report: Callable[[str], None] = report, limit: ReportLimit | None = None
    ) -> None:
        self._limit = limit or ReportLimit()
        self.accepted = self.clamped = 0
        self.refused: Counter[str] = Counter()
        self.last_clamped = self.last_refusal = ""
        self._report = report
        self._reported_at: float | None = None  # s; None: nothing was
        self._unreported = 0

    def validated(self, received: Received[M], keys: tuple[str, ...], now: float) -> M | None:
        """The message of a sample on one of `keys`; None if it is not valid, which is counted and
        reported.
        """
        kind, reason = _fault(received, keys)
        if kind:
            self.refuse(keys[0], kind, reason, source_of(received), now)
        return None if kind else received.message

    def refuse(self, key: str, kind: str, reason: str, source: str, now: float) -> None:
        """Count and report a refused command of `source` on `key`."""
        self.refused[kind] += 1
        self.last_refusal = f"{source}: {reason}"[:MAX_REASON]
        self._report_some(key, self.last_refusal, now)

    def note_clamped(self, key: str, reason: str, source: str, now: float) -> None:
        """Count and report a command of `source` on `key` that was obeyed within the limits."""
        self.clamped += 1
        self.last_clamped = f"{source}: {reason}"[:MAX_REASON]
        self._report_some(key, self.last_clamped, now)

    def _report_some(self, key: str, what: str, now: float) -> None:
        self._unreported += 1
        is_soon = self._reported_at is not None and now - self._reported_at < REPORT_EVERY
        if is_soon or not self._limit.take(now):
            return
        more = f" (and {self._unreported - 1} more)" if self._unreported > 1 else ""
        self._report(f"{key}: from {what}{more}")
        self._reported_at, self._unreported = now, 0


def _fault(received: Received[M], keys: tuple[str, ...]) -> tuple[str, str]:
    """The kind of fault of a sample, and its description; both empty for a valid one."""
    if received.key not in keys:
        return "wildcard", f"a command for {received.key!r}; name one robot"
    if (message := received.message) is None:
        kind = received.error.partition(":")[0]
        return kind if kind in ("oversized", UNPROVEN) else "malformed", received.error
    if bad := not_finite(message):
        return "not finite", f"{bad} is not a finite number"
    if bad := implausible(message, message.ROS):
        return "implausible", bad
    return "", ""
