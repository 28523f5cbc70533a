"""How old a command is, by its echo, and whether its sender is still alive. No clock, no socket.

The time of arrival does not show the age: TCP delivers buffered data seconds later, even of a
process that has died. So the receiver publishes its own time, its beat, and a command carries the
newest beat that its sender had heard, its echo: the command was sent after that beat.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import Generic, NamedTuple, Protocol, TypeVar

from holozen.command.arbiter import Arbiter, Sent
from holozen.command.outcome import Decision, Outcome, refusal
from holozen.messages import Message
from holozen.transport.pubsub import Received
from holozen.transport.samples import Echo, Stamp
from holozen.wire import MAX_COMMAND_AGE

M = TypeVar("M", bound=Message)
K = TypeVar("K", bound=Hashable)
T = TypeVar("T")

# s; three beats: what is older may have been held up, and its sender may have died since
BEGIN_AGE = 0.15
# streams or speakers; beyond, the one that has not commanded for the longest time is forgotten
MAX_KNOWN = 256
AGES = (0.05, MAX_COMMAND_AGE)  # s; the range of `max_age`
PAUSE = 0.5  # s between two late commands, which begins a new series of them

OLD = (
    "it may be {age:.2f} s old, and the limit is {limit:g} s; send it again, over a faster network "
    "if that goes on"
)
WAITED = (
    "it may have waited {age:.1f} s for this busy process, and the limit is {limit:g} s; send it "
    "again"
)
GONE = "its sender has ended, or has only just started; send it again"
OUT_OF_ORDER = "a newer command of its sender came before it, and counts instead"
HELD_UP = (
    "a robot starts by a command of the last {limit:g} s, and this one may be {age:.2f} s old; "
    "send another"
)
NO_ECHO = "its sender has not heard from this robot yet; send another in a moment"
UNSTAMPED = (
    "it has no stamp, but other commands under this name have one; give this program another name"
)


class Senders(Protocol):
    """What the receiver knows about the senders' sessions."""

    def has(self, session: str) -> bool:
        """Whether the session holds a liveliness token."""
        ...

    def echo(self, echoes: tuple[Echo, ...]) -> int | None:
        """This receiver's beat that is among the echoes, in ns of its own time; None if none of its
        beats is.
        """
        ...

    def age(self, beat: int, now: float) -> float:
        """The time in s from a beat of this receiver to `now` (s)."""
        ...

    def beat_now(self) -> None:
        """Send a beat after an event, so that commands can tell that they were sent after it."""
        ...


class Stream(NamedTuple):
    """The stamped commands of a session on one key and priority: each echoes a newer beat, or has a
    higher number.
    """

    session: str
    priority: str
    key: str


class Speaker(NamedTuple):
    """A source on a key, whatever its priorities and with or without stamps: its numbers are one
    sequence.
    """

    source: str
    key: str


class LastCommand(NamedTuple):
    """The last command of a source on a key: its number, None without a stamp, and when it was read
    (s).
    """

    number: int | None
    at: float


class Position(NamedTuple):
    """The position of a command in its stream: the `beat` that it echoes (ns), then its `number`.
    The beat is compared first: a forged number counts only until the next beat.
    """

    beat: int
    number: int


class Late(NamedTuple):
    """A series of commands of a stream that came too late to begin with: when its first and its
    last one arrived (s). A PAUSE ends the series.
    """

    first: float
    last: float


class Judged(NamedTuple, Generic[M]):
    """A command with what is known of its sending.

    Attributes:
        received: The command.
        sent: When it was sent.
        age: Its greatest possible age in s; None for a sender that echoes nothing.
        refused: Why it is refused; None if it is not.
    """

    received: Received[M]
    sent: Sent
    age: float | None = None
    refused: Decision | None = None


class Freshness(Generic[M]):
    """Judges the age of the commands of one robot before anything else reads them.

    A motion is refused if its echo is older than `max_age`, if its number goes back, or if its
    sender has left. A source that does not move the robot begins by an echo younger than BEGIN_AGE;
    or, over a slow link, by the echo of a beat that was sent after the first such command had
    arrived, which no dead process sends.

    The age of a command without a stamp is unknown. Of those that arrive together only the newest
    counts.

    A stop passes at any age; whether its sender may stop the robot is decided elsewhere. `stops`
    tells whether a message is a stop. The `arbiters` know which source moves the robot, and since
    when its commands count.

    Attributes:
        max_age: The limit in s.
    """

    def __init__(
        self,
        keys: tuple[str, ...],
        senders: Senders,
        stops: Callable[[M], bool],
        arbiters: Iterable[Arbiter],
    ) -> None:
        self._keys = keys
        self._senders = senders
        self._arbiters = tuple(arbiters)
        self.stops = stops
        self.max_age = MAX_COMMAND_AGE
        self._newest: OrderedDict[Stream, Position] = OrderedDict()
        self._last: OrderedDict[Speaker, LastCommand] = OrderedDict()
        self._held_up: OrderedDict[Stream, Late] = OrderedDict()

    def sift(self, arrived: Iterable[Received[M]], now: float, since: float) -> Iterator[Judged[M]]:
        """Judge in order the commands that `arrived` between `since` and `now` (s)."""
        arrived = list(arrived)
        last_unstamped = {
            _unstamped_key(each): index for index, each in enumerate(arrived) if not each.stamp
        }
        for index, received in enumerate(arrived):
            if received.message is None or received.key not in self._keys:
                # refused later, by CommandStats.validated
                yield Judged(received, Sent(at=since, unheard=now))
                continue
            stops = self.stops(received.message)
            if received.stamp:
                yield self._stamped(received, received.stamp, stops, now)
            elif stops or last_unstamped[_unstamped_key(received)] == index:
                yield self._unstamped(received, stops, now, since)

    def is_session(self, source: str, session: str) -> bool:
        """Whether a source may be this session: it is, or no session of that name has stamped a
        command.
        """
        known = self._sessions(source)
        return not known or session in known

    def _sessions(self, source: str) -> set[str]:
        """The sessions that have stamped commands under a source's name."""
        start = source.rpartition("@")[2]
        return {stream.session for stream in self._newest if stream.session[:6] == start}

    def _unstamped(self, received: Received[M], stops: bool, now: float, since: float) -> Judged[M]:
        """Judge a command whose age is unknown: it was sent as it arrived."""
        speaker = Speaker(received.source, received.key)
        before = self._last.get(speaker)
        _put(self._last, speaker, LastCommand(None, now))
        silence = math.inf if before is None else max(0.0, since - before.at)
        sent = Sent(at=since, unheard=now, silence=silence)
        if stops:
            return Judged(received, sent)
        if any(map(self._senders.has, self._sessions(received.source))):
            return Judged(received, sent, refused=refusal(Outcome.UNSTAMPED, UNSTAMPED))
        if now - since > self.max_age:
            waited = WAITED.format(age=now - since, limit=self.max_age)
            return Judged(received, sent, refused=refusal(Outcome.OLD, waited))
        return Judged(received, sent)

    def _stamped(self, received: Received[M], stamp: Stamp, stops: bool, now: float) -> Judged[M]:
        """Judge a command by its echo."""
        speaker = Speaker(received.source, received.key)
        is_there = self._senders.has(stamp.session)
        beat = self._senders.echo(stamp.echoes) if is_there else None
        if beat is None:
            # Its number counts: what follows it is no first command, and nothing between the two
            # was unheard.
            self._note_number(speaker, stamp.number, now, now)
            if stops:
                return Judged(received, Sent(now, now, 0.0))
            unknown = refusal(Outcome.NO_ECHO, NO_ECHO) if is_there else refusal(Outcome.GONE, GONE)
            return Judged(received, Sent(now, now, 0.0), refused=unknown)
        age = self._senders.age(beat, now)
        sent = self._note_number(speaker, stamp.number, now - age, now)
        stream = Stream(stamp.session, received.priority, received.key)
        before, position = self._newest.get(stream), Position(beat, stamp.number)
        _put(self._newest, stream, max(position, before) if before else position)
        if stops:
            self._held_up.pop(stream, None)
            return Judged(received, sent, age)
        if before and position <= before:
            return Judged(received, sent, age, refusal(Outcome.OUT_OF_ORDER, OUT_OF_ORDER))
        return Judged(received, sent, age, self._refuse_late(stream, age, source_of(received), now))

    def _refuse_late(self, stream: Stream, age: float, source: str, now: float) -> Decision | None:
        """The refusal of a motion that is too old, which is noted; None for one that is fresh
        enough.
        """
        if age > self.max_age:
            self._note_late(stream, now)
            return refusal(Outcome.OLD, OLD.format(age=age, limit=self.max_age))
        begins = age > BEGIN_AGE and not any(
            arbiter.moves(source, now) for arbiter in self._arbiters
        )
        if begins and now - age <= self._note_late(stream, now):
            return refusal(Outcome.HELD_UP, HELD_UP.format(age=age, limit=BEGIN_AGE))
        self._held_up.pop(stream, None)
        return None

    def _note_late(self, stream: Stream, now: float) -> float:
        """Note that a command came late. Returns when the first one of its series arrived (s)."""
        before = self._held_up.get(stream)
        first = before.first if before and now - before.last <= PAUSE else now
        _put(self._held_up, stream, Late(first, now))
        return first

    def _note_number(self, speaker: Speaker, number: int, at: float, now: float) -> Sent:
        """Note the number of a command that was sent at `at` (s) at the earliest. Returns what is
        known of its sending: a gap before its number is a time in which its source may have
        commanded unheard.
        """
        before = self._last.get(speaker)
        is_first = number == 0
        # it was overtaken
        if not is_first and before and before.number is not None and number <= before.number:
            return Sent(at, at, 0.0)
        _put(self._last, speaker, LastCommand(number, now))
        if is_first:
            return Sent(at, at)
        if before is None:
            began = max((arbiter.state.began for arbiter in self._arbiters), default=0.0)
            return Sent(at, min(at, began), 0.0)
        if before.number is None or number == before.number + 1:
            return Sent(at, at, max(0.0, at - before.at))
        return Sent(at, min(at, before.at), 0.0)


def _put(table: OrderedDict[K, T], key: K, value: T) -> None:
    """Write to a table of at most MAX_KNOWN keys, which forgets the one that was written longest
    ago.
    """
    table[key] = value
    table.move_to_end(key)
    if len(table) > MAX_KNOWN:
        table.popitem(last=False)


def _unstamped_key(received: Received[M]) -> tuple[str, str, str]:
    """Of commands without stamps that have the same key here and arrive together, only the newest
    counts.
    """
    return received.source, received.priority, received.key


def source_of(received: Received[M]) -> str:
    """The name of a sample's sender."""
    return received.source or f"anonymous ({received.priority})"
