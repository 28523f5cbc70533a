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
MAX_KNOWN = 256  # senders; of more, the one that commanded the longest ago is forgotten
AGES = (0.05, COMMAND_SILENCE)  # s; the range of `max_age`

OLD = "old: it was sent up to {age:.2f} s ago; at most {limit:g} s"
GONE = "gone: its sender has left"
OUT_OF_ORDER = "out of order: number {number} came after {last}"
UNANSWERED = "late: it was under way for {age:.2f} s or more, and its sender has not answered since"
UNKNOWN = "unknown clock: its sender has not answered with its time"
UNSTAMPED = "unstamped: this sender stamps its commands"


class Senders(Protocol):
    """What is known about the senders' sessions. Times in seconds of the receiver's monotonic clock."""

    def has(self, session: str) -> bool:
        """Whether the session holds a liveliness token."""
        ...

    def ages(self, session: str, sent: float, now: float, member: str) -> tuple[float, float] | None:
        """Bounds of the age of a sample that it sent at `sent`, by its own clock; None while they are unknown, or in
        the secure set-up if the session is not of that member.
        """
        ...

    def track_first(self, session: str, now: float) -> None:
        """Measure its clock ahead of others."""
        ...

    def answered(self, session: str) -> float:
        """When the last request that it answered was sent; below zero before the first."""
        ...

    def ask_now(self, session: str, now: float) -> None:
        """Ask for its clock again at once."""
        ...


class Sender(NamedTuple):
    """What orders commands: a session, or the name of a sender without a stamp."""

    session: str
    priority: str
    key: str


class Judged(NamedTuple, Generic[M]):
    """A command with the earliest time it may have been sent, its greatest possible age (0: unknown), and why
    it is refused, or "".
    """

    received: Received[M]
    sent: float
    age: float
    refusal: str


class Freshness(Generic[M]):
    """Filters the commands of one robot before anything else reads them.

    A stamped command (see holozen.transport.pubsub.Stamp) is measured by its sender's clock; it waits until that is
    known, for at most 0.5 s. The greatest possible age counts. A command is refused if it is older than `max_age`, out
    of order, or its sender has left. A slow command that would set the robot moving suggests that a link was held up:
    its sender has to answer a request first, which no dead process does, and only commands that arrive after the answer
    move the robot.

    The age of a command without a stamp is unknown. Of those that arrive together only the newest counts.

    A stop passes at any age; whether its sender may stop the robot is decided elsewhere.
    """

    def __init__(
        self,
        keys: tuple[str, ...],
        senders: Senders,
        stops: Callable[[M], bool],
        drives: Callable[[str, float], bool],
    ) -> None:
        self._keys, self._senders, self._stops, self._drives = keys, senders, stops, drives
        self.max_age = COMMAND_SILENCE
        self._newest: OrderedDict[Sender, tuple[float, int]] = OrderedDict()  # when it was sent, and its number
        self._doubted: OrderedDict[Sender, float] = OrderedDict()  # since when an answer is awaited
        self._waiting: dict[Sender, tuple[Received[M], float]] = {}  # and when the first of its sender came

    @property
    def is_waiting(self) -> bool:
        """Whether any command waits for its sender's clock."""
        return bool(self._waiting)

    def sift(self, arrived: Iterable[Received[M]], now: float, since: float) -> Iterator[Judged[M]]:
        """The judged commands in order: those that waited, then those that `arrived` by `now`, not before `since`."""
        arrived = list(arrived)
        if self._waiting:
            yield from self._waited(now)
        senders = [*map(_sender, arrived)]
        newest = {sender: index for index, sender in enumerate(senders)}
        for index, (received, sender) in enumerate(zip(arrived, senders, strict=True)):
            stamp = received.sample.stamp
            if received.message is None or sender.key not in self._keys:
                yield Judged(received, since, 0.0, "")  # the next look refuses it
            elif self._stops(received.message):
                self._waiting.pop(sender, None)  # earlier commands are void
                if stamp and self._ages(stamp, now):
                    self._note(stamp, sender)
                yield Judged(received, now if stamp else since, 0.0, "")
            elif stamp:
                if judged := self._judge(received, stamp, sender, now, now):
                    yield judged
            elif any(map(self._senders.has, self._sessions(received.sample.source))):
                yield Judged(received, since, 0.0, UNSTAMPED)
            elif newest[sender] == index:
                yield Judged(received, since, 0.0, "")

    def is_session(self, source: str, session: str) -> bool:
        """Whether a source can be this session: it is, or no session of that name has stamped a command."""
        known = self._sessions(source)
        return not known or session in known

    def _sessions(self, source: str) -> set[str]:
        """The sessions that have stamped commands under the name of a source."""
        start = source.rpartition("@")[2]
        return {sender.session for sender in self._newest if sender.session[:6] == start}

    def _ages(self, stamp: Stamp, now: float) -> tuple[float, float] | None:
        there = self._senders.has(stamp.session)
        return self._senders.ages(stamp.session, stamp.sent, now, stamp.member) if there else None

    def _waited(self, now: float) -> Iterator[Judged[M]]:
        waiting, self._waiting = self._waiting, {}
        for sender, (received, came) in waiting.items():
            stamp = received.sample.stamp
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
        sent = now - oldest
        # The time counts first: a forged number lasts for the session's life, a forged time only until it has come.
        if (stamp.sent, stamp.number) <= before:
            return Judged(received, sent, oldest, OUT_OF_ORDER.format(number=stamp.number, last=before[1]))
        if sender not in self._doubted and youngest > PROMPT and not self._drives(source_of(received), now):
            _put(self._doubted, sender, now)
            self._senders.ask_now(session, now)
        if sender in self._doubted:
            if self._senders.answered(session) < self._doubted[sender]:
                return Judged(received, sent, oldest, UNANSWERED.format(age=youngest))
            del self._doubted[sender]
        if oldest > self.max_age:
            return Judged(received, sent, oldest, OLD.format(age=oldest, limit=self.max_age))
        return Judged(received, sent, oldest, "")

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
    """Write to a table of MAX_KNOWN senders, of which the one that was written the longest ago is forgotten."""
    table[sender] = value
    table.move_to_end(sender)
    if len(table) > MAX_KNOWN:
        table.popitem(last=False)


def _sender(received: Received[M]) -> Sender:
    stamp, sample = received.sample.stamp, received.sample
    return Sender(stamp.session if stamp else sample.source, sample.priority, sample.key)


def source_of(received: Received[M]) -> str:
    """The name of a sample's sender."""
    return received.sample.source or f"anonymous ({received.sample.priority})"
