"""How old a command is, and whether its sender is still alive. No clock, no socket.

The time of arrival does not show the age: TCP delivers buffered data seconds later, even for a process that has died.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from typing import Generic, NamedTuple, Protocol, TypeVar

from holozen.messages import Message
from holozen.transport.peer_clocks import PROMPT
from holozen.transport.pubsub import Received
from holozen.transport.samples import Stamp
from holozen.wire import COMMAND_SILENCE

M = TypeVar("M", bound=Message)
T = TypeVar("T")

MAX_WAITING = 32  # commands from senders whose clock is not known yet
MAX_KNOWN = 256  # senders; beyond, the one that has not commanded for the longest time is forgotten
AGES = (0.05, COMMAND_SILENCE)  # s; the range of `max_age`

OLD = "old: it was sent up to {age:.2f} s ago; at most {limit:g} s"
GONE = "gone: its sender has left"
OUT_OF_ORDER = "out of order: number {number} came after {last}"
UNANSWERED = "late: it was under way for {age:.2f} s or more, and its sender has not answered since"
UNKNOWN = "unknown clock: its sender has not answered with its time"
VOID = "void: it came before the sim was played or reset"
UNSTAMPED = "unstamped: this sender stamps its commands"


class Senders(Protocol):
    """What the receiver knows about the senders' sessions. Times in s of its own monotonic clock."""

    def has(self, session: str) -> bool:
        """Whether the session holds a liveliness token."""
        ...

    def ages(self, session: str, sent: float, now: float, member: str) -> tuple[float, float] | None:
        """The least and the greatest age (s) of a sample that the session sent at `sent`, by the sender's clock. None
        while they are unknown, and in the secure set-up if the session is not that of `member`.
        """
        ...

    def track_first(self, session: str, now: float) -> None:
        """Measure the clock of this session before those of others."""
        ...

    def answered(self, session: str) -> float:
        """When the last clock request that the session answered was sent; below zero before the first answer."""
        ...

    def ask_now(self, session: str, now: float) -> None:
        """Measure the clock of this session again at once."""
        ...


class Sender(NamedTuple):
    """One sequence of commands: those of a `session`, or of a named sender without stamps, on one key and priority."""

    session: str
    priority: str
    key: str


class Judged(NamedTuple, Generic[M]):
    """A command, the earliest time (s) at which it may have been sent, its greatest possible age (s; 0: unknown), and
    why it is refused, or "". `latest` and `silence` are those of `Sent`, as far as they are known.
    """

    received: Received[M]
    sent: float
    age: float
    refusal: str
    latest: float = math.inf
    silence: float = math.inf


class Freshness(Generic[M]):
    """Judges the age of the commands of one robot before anything else reads them.

    The age of a stamped command (see holozen.transport.samples.Stamp) is measured by its sender's clock; the command
    waits until that is known, for at most 0.5 s. The greatest possible age counts. A command is refused if it is older
    than `max_age` or out of order, or if its sender has left. A slow command that would set the robot moving suggests
    that a link was held up. So its sender first has to answer a request, which no dead process does, and only commands
    that arrive after the answer move the robot.

    The age of a command without a stamp is unknown. Of those that arrive together only the newest counts.

    A stop passes at any age; whether its sender may stop the robot is decided elsewhere. `stops` tells whether a
    message is a stop, `drives` whether a source moves the robot at a time.
    """

    def __init__(
        self, keys: tuple[str, ...], senders: Senders, stops: Callable[[M], bool], drives: Callable[[str, float], bool]
    ) -> None:
        self._keys, self._senders, self._drives = keys, senders, drives
        self.stops = stops  # whether a message is a stop
        self.max_age = COMMAND_SILENCE
        self._newest: OrderedDict[Sender, tuple[float, int]] = OrderedDict()  # the newest command: sent when, number
        self._heard: OrderedDict[Sender, tuple[float, int]] = OrderedDict()  # likewise, for each name of a session
        self._doubted: OrderedDict[Sender, float] = OrderedDict()  # since when an answer is awaited
        self._waiting: dict[Sender, tuple[Received[M], float]] = {}  # with the arrival of its sender's first one
        self._void: list[Received[M]] = []  # of those that waited, to be refused

    @property
    def is_waiting(self) -> bool:
        """Whether any command waits for its sender's clock."""
        return bool(self._waiting or self._void)

    @property
    def waiting(self) -> list[Received[M]]:
        """The commands that wait for their sender's clock, the newest of each."""
        return [received for received, _ in self._waiting.values()]

    def drop_waiting(self) -> None:
        """Refuse the commands that wait now, whatever their age will prove to be."""
        self._void += self.waiting
        self._waiting.clear()

    def sift(self, arrived: Iterable[Received[M]], now: float, since: float) -> Iterator[Judged[M]]:
        """Judge the commands in order: those that waited, then those that `arrived` between `since` and `now` (s)."""
        arrived = list(arrived)
        void, self._void = self._void, []
        for received in void:
            yield Judged(received, -math.inf, 0.0, VOID)
        if self._waiting:
            yield from self._waited(now)
        senders = [*map(_sender, arrived)]
        newest = {sender: index for index, sender in enumerate(senders)}
        for index, (received, sender) in enumerate(zip(arrived, senders, strict=True)):
            stamp = received.stamp
            if received.message is None or sender.key not in self._keys:
                yield Judged(received, since, 0.0, "")  # refused later, by CommandStats.validated
            elif self.stops(received.message):
                self._waiting.pop(sender, None)  # earlier commands are void
                if stamp and self._ages(stamp, now):
                    self._gap(received, stamp)
                    self._note(stamp, sender)
                yield Judged(received, now if stamp else since, 0.0, "")
            elif stamp:
                if judged := self._judge(received, stamp, sender, now, now):
                    yield judged
            elif any(map(self._senders.has, self._sessions(received.source))):
                yield Judged(received, since, 0.0, UNSTAMPED)
            elif newest[sender] == index:
                yield Judged(received, since, 0.0, "")

    def is_session(self, source: str, session: str) -> bool:
        """Whether a source may be this session: it is, or no session of that name has stamped a command."""
        known = self._sessions(source)
        return not known or session in known

    def _sessions(self, source: str) -> set[str]:
        """The sessions that have stamped commands under a source's name."""
        start = source.rpartition("@")[2]
        return {sender.session for sender in self._newest if sender.session[:6] == start}

    def _ages(self, stamp: Stamp, now: float) -> tuple[float, float] | None:
        there = self._senders.has(stamp.session)
        return self._senders.ages(stamp.session, stamp.sent, now, stamp.member) if there else None

    def _waited(self, now: float) -> Iterator[Judged[M]]:
        waiting, self._waiting = self._waiting, {}
        for sender, (received, came) in waiting.items():
            stamp = received.stamp
            if stamp and (judged := self._judge(received, stamp, sender, came, now)):
                yield judged

    def _judge(self, received: Received[M], stamp: Stamp, sender: Sender, came: float, now: float) -> Judged[M] | None:
        """Judge a command that moves the robot; None while it waits for its sender's clock."""
        session, ages = stamp.session, self._ages(stamp, now)
        if ages is None:
            return self._wait(received, stamp, sender, came, now)
        before = self._newest.get(sender, (-math.inf, -1))
        self._note(stamp, sender)
        youngest, oldest = ages
        silence, missing = self._gap(received, stamp)
        judged = Judged(received, now - oldest, oldest, "", now - youngest - missing, silence)
        # The time is compared first: a forged number would count for as long as the session lives, a forged time only
        # until that time has come.
        if (stamp.sent, stamp.number) <= before:
            return judged._replace(refusal=OUT_OF_ORDER.format(number=stamp.number, last=before[1]))
        if sender not in self._doubted and youngest > PROMPT and not self._drives(source_of(received), now):
            _put(self._doubted, sender, now)
            self._senders.ask_now(session, now)
        if sender in self._doubted:
            if self._senders.answered(session) < self._doubted[sender]:
                return judged._replace(refusal=UNANSWERED.format(age=youngest))
            del self._doubted[sender]
        return judged._replace(refusal=OLD.format(age=oldest, limit=self.max_age)) if oldest > self.max_age else judged

    def _gap(self, received: Received[M], stamp: Stamp) -> tuple[float, float]:
        """The time (s) since the sample that its source sent before this one, on the source's clock: as a silence if
        that one arrived (infinite if none did), and as a time in which samples were sent that are missing.
        """
        source = Sender(received.source, "", received.key)  # numbers of all priorities are one sequence
        before = self._heard.get(source)
        if before and stamp.number <= before[1]:  # it was overtaken
            return math.inf, 0.0
        _put(self._heard, source, (stamp.sent, stamp.number))
        if not before:
            return math.inf, 0.0
        passed = max(0.0, stamp.sent - before[0])
        return (passed, 0.0) if stamp.number == before[1] + 1 else (0.0, passed)

    def _wait(self, received: Received[M], stamp: Stamp, sender: Sender, came: float, now: float) -> Judged[M] | None:
        there = self._senders.has(stamp.session)
        if sender in self._waiting:
            came = min(came, self._waiting[sender][1])
        if now - came > COMMAND_SILENCE or (sender not in self._waiting and len(self._waiting) >= MAX_WAITING):
            self._waiting.pop(sender, None)
            return Judged(received, -math.inf, 0.0, UNKNOWN if there else GONE)
        if there:
            self._senders.track_first(stamp.session, now)
        self._waiting[sender] = (received, came)
        return None

    def _note(self, stamp: Stamp, sender: Sender) -> None:
        _put(self._newest, sender, max((stamp.sent, stamp.number), self._newest.get(sender, (-math.inf, -1))))


def _put(table: OrderedDict[Sender, T], sender: Sender, value: T) -> None:
    """Write to a table of at most MAX_KNOWN senders, which forgets the one that was written longest ago."""
    table[sender] = value
    table.move_to_end(sender)
    if len(table) > MAX_KNOWN:
        table.popitem(last=False)


def _sender(received: Received[M]) -> Sender:
    stamp = received.stamp
    return Sender(stamp.session if stamp else received.source, received.priority, received.key)


def source_of(received: Received[M]) -> str:
    """The name of a sample's sender."""
    return received.source or f"anonymous ({received.priority})"
