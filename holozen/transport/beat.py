"""How old a command is: who obeys it numbers its own time, the sender returns the newest number
that it has heard, and the receiver subtracts. The command was sent after that beat, so it is at
most that old.

No clock has to agree with another: both ends of the subtraction are the receiver's own. That holds
under delay, jitter, drift and suspension of either side. A virtual machine that is paused as a
whole is the exception: its clock stands too.

A receiver sends its `Beat` from the loop that obeys commands, so a loop that hangs does not beat. A
sender has `Echoes` for each key on which it commands. It hears those receivers alone that hold
tokens for that key, and for their beat.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from holozen.console import report
from holozen.suggest import listed
from holozen.system import UPTIME
from holozen.transport.samples import MAX_DIGITS, MAX_ECHOES, Declared, Echo, echoes_in

PERIOD_NS = 50_000_000  # between two beats
# receivers of one key; beyond, one that was never heard makes room for a newer one
MAX_WATCHED = 64
SETTLE = 0.3  # s; the longest wait for the first beat before the first command
LOOK = 0.001  # s between two looks in that wait
BEAT, GOAL_BEAT = "beat", "goal_beat"
"""The names of the beats of robots, and of those that drive robots to goals: with --secure, these
may not beat as robots do.
"""
WAITING = "{key}: waiting for the robot: nothing was heard from it yet, so only stops are sent"
NOTICE = 0.5  # s of waiting after which a publisher says so


def boot_ns() -> int:
    """Nanoseconds since this computer was started, its suspensions included."""
    return time.clock_gettime_ns(UPTIME)


def beat_key(session: str, name: str) -> str:
    """The key of a session's beat of that name."""
    return f"@holozen/{session}/{name}"


def name_for(key: str) -> str:
    """The name of the beat of those who obey commands on a key."""
    return GOAL_BEAT if key.rpartition("/")[2] == "goal_pose" else BEAT


def tokens_of(name: str) -> str:
    """The tokens of all those who have a beat of that name."""
    return f"@holozen/*/*/{name}"


class OwnTime:
    """The time of a `session`, which alone may judge the echoes of it. `clock` returns ns."""

    def __init__(self, session: str, clock: Callable[[], int] = boot_ns) -> None:
        self.session, self.clock = session, clock
        self.began = clock()

    def text(self) -> str:
        """What to echo of this moment, as in an attachment."""
        return f"{self.session}:{self.clock()}"

    def echoed(self, echoes: Iterable[Echo], now_ns: int | None = None) -> int | None:
        """The newest echo of this session in ns, at the time `now_ns` of its clock. None if there
        is none, or if it is from the future or from before this session began: then another made it
        up.
        """
        mine = [ns for session, ns in echoes if session == self.session]
        now = self.clock() if now_ns is None else now_ns
        return max(mine) if mine and self.began <= max(mine) <= now else None

    def since(self, ns: int) -> float:
        """Seconds since a time of this session."""
        return (self.clock() - ns) * 1e-9

    def age(self, echoes: Iterable[Echo], now_ns: int | None = None) -> float | None:
        """Seconds since the newest echo of this session, at the time `now_ns` of its clock; None as
        in `echoed`.
        """
        now = self.clock() if now_ns is None else now_ns
        newest = self.echoed(echoes, now)
        return None if newest is None else (now - newest) * 1e-9


class Beat(Declared):
    """The beat of a receiver: `poll` it in the loop that obeys commands. Made by `Bus.beat`.

    own: The receiver's time, which the beat sends: it tells the age of what echoes the beat.

    `publisher`, `queryable` and `token` are Zenoh's, on the beat's `key`.
    """

    def __init__(self, own: OwnTime, key: str, publisher: Any, queryable: Any, token: Any) -> None:
        super().__init__(publisher, queryable, token)
        self.own = own
        self._put, self._queries = publisher.put, queryable.handler
        self._key, self._due = key, own.began

    def poll(self, now_ns: int | None = None) -> None:
        """Send a beat if one is due, and one to each who asks. `now_ns` is the time by `boot_ns`;
        by default now.
        """
        now = self.own.clock() if now_ns is None else now_ns
        try:
            while (query := self._queries.try_recv()) is not None:
                with query:
                    query.reply(self._key, b"%d" % now, express=True)
            if now >= self._due:
                self._due = max(self._due + PERIOD_NS, now)
                self.send(now)
        except Exception:
            with self.unless_closed():
                raise

    def send(self, now_ns: int | None = None) -> None:
        """Send a beat at once, such as after an event that commands have to know of."""
        now = self.own.clock() if now_ns is None else now_ns
        with self.unless_closed():
            self._put(b"%d" % now)


class Receiver:
    """Who obeys commands, by what was heard of it: `newest`, its last beat in its own ns, and
    `text`, what to echo of that; 0 and empty before the first. `users`: the Echoes that watch it.
    """

    __slots__ = ("_answers", "_beats", "_name", "_subscriber", "newest", "text", "users")

    def __init__(self, receiver: str, subscriber: Any, answers: Any) -> None:
        self.newest, self.text, self.users, self._name = 0, b"", 0, receiver.encode()
        self._subscriber, self._beats = subscriber, subscriber.handler.try_recv
        # the next beat comes in 50 ms at the latest, but a verb is faster by asking
        self._answers = answers

    def take(self) -> None:
        """Read what has come."""
        if (sample := self._beats()) is not None:
            self._answers = None
            self._read(sample)
        elif self._answers is not None:
            try:
                if (reply := self._answers.try_recv()) is not None and reply.ok:
                    self._answers = None
                    self._read(reply.ok)
            except Exception:  # a ZError: nobody answers
                self._answers = None

    def _read(self, sample: Any) -> None:
        payload = sample.payload
        text = payload.to_bytes() if len(payload) <= MAX_DIGITS else b""
        if text.isdigit():
            self.newest, self.text = int(text), b"%b:%d" % (self._name, int(text))

    def close(self) -> None:
        """Hear no more."""
        with contextlib.suppress(Exception):  # the session is closed
            self._subscriber.undeclare()


class Hearing(Declared):
    """The receivers that the Echoes of a bus hear. `name` is that of their beats, and `tokens` a
    subscription to the tokens of all that have one. `hear` returns a subscription to the beats on a
    key, and the replies to a query for one; `call` waits until all connected nodes have sent their
    tokens. `lock` guards it and its Echoes.
    """

    def __init__(
        self,
        name: str,
        tokens: Any,
        hear: Callable[[str], tuple[Any, Any]],
        call: Callable[[float], None],
    ) -> None:
        super().__init__(tokens)
        self._name, self._tokens, self._hear, self._call = name, tokens.handler.try_recv, hear, call
        self._receivers: dict[str, Receiver] = {}
        # the sessions that announce a beat -> how many tokens they hold for that
        self.beating: dict[str, int] = {}
        self.turn = 0  # how often these have changed
        self.lock = threading.Lock()

    def look(self) -> None:
        """Read the tokens that have come or gone."""
        for session, _, there in changes(self._tokens):
            self.turn += 1
            count = self.beating.pop(session, 0) + (1 if there else -1)
            if count > 0:
                self.beating[session] = count

    def roll_call(self, timeout: float) -> None:
        """Wait until all connected nodes have sent the tokens of their beats, at most `timeout`
        seconds.
        """
        with self.unless_closed():
            self._call(timeout)

    def watch(self, receiver: str) -> Receiver:
        """Hear a receiver until `unwatch`."""
        if receiver not in self._receivers:
            self._receivers[receiver] = Receiver(
                receiver, *self._hear(beat_key(receiver, self._name))
            )
        heard = self._receivers[receiver]
        heard.users += 1
        return heard

    def unwatch(self, receiver: str) -> None:
        """Hear a receiver no longer, if nobody else watches it."""
        if not (heard := self._receivers.get(receiver)):  # the bus is closed
            return
        heard.users -= 1
        if not heard.users:
            del self._receivers[receiver]
            heard.close()

    def close(self) -> None:
        """Hear nobody."""
        super().close()
        with self.lock:
            heard, self._receivers = self._receivers, {}
        for each in heard.values():
            each.close()


def changes(tokens: Callable[[], Any]) -> Iterator[tuple[str, str, bool]]:
    """The tokens that came or went: session, the whole key, and whether it is there. Ends when none
    waits.
    """
    try:
        while (sample := tokens()) is not None:
            key = str(sample.key_expr)
            yield key.split("/", 2)[1], key, str(sample.kind).endswith("PUT")
    except Exception:  # a ZError: the bus is closed, which the caller's next use tells
        return


class Echoes(Declared):
    """What the commands on one `key` return: the newest beat of each receiver there that was heard,
    at most MAX_ECHOES.

    `tokens` is a subscription to the tokens of the receivers of the key, and `matched` returns
    whether anyone subscribes to it. It may be used from any thread.
    """

    def __init__(
        self, key: str, hearing: Hearing, tokens: Any, matched: Callable[[], bool] = lambda: False
    ) -> None:
        super().__init__(tokens)
        self.key, self._hearing, self._tokens = key, hearing, tokens.handler.try_recv
        self._matched = matched
        self._holders: dict[str, set[str]] = {}  # the tokens of each session
        self._watched: dict[str, Receiver] = {}
        self._vouched: dict[str, int] = {}  # what was echoed last by `vouched`
        self.was_heard = False  # whether any was heard when the last command was sent
        self._turn = 0  # of `hearing`, when it was last looked at
        self._is_settled = False
        self._has_waited = False  # as long as it may, for who subscribes and is not known to beat
        self._waits_since: float | None = None  # s, monotonic; None: it does not wait
        self._has_reported = False

    def attached(self, waited: float = 0.0) -> bytes:
        """As `newest`, in the form of an attachment: `SESSION:NS`, joined by commas. For a command
        that was made `waited` seconds ago, less this time: the receiver's own time then was at
        least that.
        """
        with self._hearing.lock:
            self._look()
            if len(self._watched) == 1 and not waited:
                text = next(iter(self._watched.values())).text
                self.was_heard = bool(text)
                return text
            heard = [
                (session, heard.newest - int(waited * 1e9)) for session, heard in self._beating()
            ]
            self.was_heard = bool(heard)
        return b",".join(b"%b:%d" % (session.encode(), max(ns, 0)) for session, ns in heard)

    def vouched(self, waited: float) -> bytes:
        """As `attached`, for one of several commands that were made one after the other: it is no
        older than those before it.
        """
        made = dict(echoes_in(self.attached(waited)))
        self._vouched = {
            session: max(ns, self._vouched.get(session, 0)) for session, ns in made.items()
        }
        return b",".join(b"%b:%d" % (session.encode(), ns) for session, ns in self._vouched.items())

    def newest(self) -> tuple[Echo, ...]:
        """The newest beat of each receiver, taken now: its session, and its own time in ns."""
        with self._hearing.lock:
            self._look()
            return tuple((session, heard.newest) for session, heard in self._beating())

    @property
    def has_receiver(self) -> bool:
        """Whether anyone who beats holds a token for this key."""
        with self._hearing.lock:
            self._look()
            return bool(self._watched)

    @property
    def heard(self) -> bool:
        """Whether a beat of such a receiver was heard."""
        return bool(self.attached())

    @property
    def awaited(self) -> str:
        """The sessions of the receivers that are there, while no beat of any was heard; else
        empty.
        """
        with self._hearing.lock:
            self._look()
            is_waiting = self._watched and not self._beating()
            return listed(session[:6] for session in self._watched) if is_waiting else ""

    def settle(self, timeout: float = SETTLE) -> None:
        """Until a beat was heard: wait for the receivers that are there to be known, and for a beat
        of one of them, at most `timeout` seconds. The first command does so, unless this was called
        before it: with 0 where nothing may wait.

        Where somebody subscribes, and none who beats is known, one may be about to be: so it waits
        too, once. That takes all this time beside those alone who never beat, such as foreign
        programs and recorders.
        """
        self._is_settled = True
        deadline = time.monotonic() + timeout
        if not self.heard and timeout:
            self._hearing.roll_call(timeout)
        if timeout and not self._has_waited:
            while not self.has_receiver and self._matched():
                if time.monotonic() >= deadline:
                    self._has_waited = True
                    break
                time.sleep(LOOK)
        while self.awaited and time.monotonic() < deadline:
            time.sleep(LOOK)

    def may_command(self) -> bool:
        """Whether a motion may be sent now: an echo goes with it, or nobody who beats is there. A
        long wait for a beat is reported once.
        """
        if not self._is_settled:
            self.settle()
        if not self.awaited:
            self._waits_since, self._has_reported = None, False
            return True
        now = time.monotonic()
        if self._waits_since is None:
            self._waits_since = now
        if not self._has_reported and now - self._waits_since > NOTICE:
            self._has_reported = True
            report(WAITING.format(key=self.key))
        return False

    def close(self) -> None:
        """Hear nobody."""
        super().close()
        with self._hearing.lock:
            for session in [*self._watched]:
                self._drop(session)

    def _beating(self) -> list[tuple[str, Receiver]]:
        return [(session, heard) for session, heard in self._watched.items() if heard.text][
            :MAX_ECHOES
        ]

    def _look(self) -> None:
        """Read the tokens and the beats that have come."""
        self._hearing.look()
        is_same = self._turn == self._hearing.turn
        for session, token, there in changes(self._tokens):
            is_same = False
            held = self._holders.setdefault(session, set())
            (held.add if there else held.discard)(token)
            if not held:
                del self._holders[session]
        if not is_same:
            self._turn = self._hearing.turn
            self._watch()
        for heard in self._watched.values():
            heard.take()

    def _watch(self) -> None:
        """Watch those who hold a token for the key and beat. Where there are too many, a newer one
        takes the place of one that was never heard.
        """
        wanted = [session for session in self._holders if session in self._hearing.beating]
        for session in self._watched.keys() - wanted:
            self._drop(session)
        for session in wanted:
            if session in self._watched:
                continue
            if len(self._watched) >= MAX_WATCHED:
                silent = next((one for one, heard in self._watched.items() if not heard.text), None)
                if silent is None:
                    return
                self._drop(silent)
            self._watched[session] = self._hearing.watch(session)

    def _drop(self, session: str) -> None:
        del self._watched[session]
        self._hearing.unwatch(session)
