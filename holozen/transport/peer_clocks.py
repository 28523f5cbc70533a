"""The age of a command by its sender's clock: a round trip bounds the offset between two monotonic clocks.

The offset is the sender's clock minus ours. A round trip that began at t0, that the sender answered at s, and whose
answer we read at t1 gives: s - t1 <= offset <= s - t0. A sample with stamp s that was read at a gives: s - a <= offset,
since it cannot arrive before it is sent. The tightest bounds are kept, and loosened by DRIFT as they age.

A first round trip that took longer than PROMPT may have been delayed together with the commands that wait for it, which
would then count as prompt. So a second one, begun after the first has ended, has to confirm it.

In the secure set-up an answer is signed together with its question's nonce. A session's id proves nothing: anyone may
open a session under an id that was used before, and so make old commands look new.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from typing import Any

from holozen.transport.errors import BusError
from holozen.transport.samples import Sample

DRIFT = 1e-3  # s a second; a quartz is good to 1e-4, and NTP slews a clock by up to 5e-4
PROMPT = 0.05  # s; what took longer may have been held up
CONTRADICTION = 0.002  # s; bounds that contradict each other by more: a clock jumped, or a computer was suspended
AGAIN = 1.0  # s between two round trips with one peer
FIRST = 5  # round trips back to back, for a tight bound from the start
GIVE_UP = 10.0  # s without an answer
MAX_PEERS = 256  # since any node can announce tokens
SLOW = 1.0  # s without an answer, after which a round trip does not count towards MAX_ASKED
MAX_ASKED = 32  # round trips at the same time


def clock_key(session: str) -> str:
    """The key where a session answers with its monotonic clock, in nanoseconds."""
    return f"@holozen/{session}/clock"


class _Peer:
    """The bounds of one session's clock. `confirmed` is when its last completed round trip began, `member` who signed
    its answer, `nonce` what the next answer has to sign. `is_bounded`: whether the bounds may be used.
    """

    __slots__ = (
        "asked", "commands", "confirmed", "due", "highest", "is_bounded", "left", "lowest", "member", "nonce",
        "replies",
    )  # fmt: skip

    def __init__(self, now: float) -> None:
        self.lowest: tuple[float, float] | None = None  # a bound of the offset, and when it was found
        self.highest: tuple[float, float] | None = None
        self.confirmed = -1.0
        self.is_bounded = False
        self.commands = False  # whether a command of it has been seen
        self.replies: Any = None
        self.member, self.nonce = "", b""
        self.asked, self.due, self.left = 0.0, now, FIRST

    def at_least(self, now: float) -> float:
        """The lower bound of the offset at `now`."""
        return self.lowest[0] - DRIFT * (now - self.lowest[1]) if self.lowest else float("-inf")

    def at_most(self, now: float) -> float:
        """The upper bound of the offset at `now`."""
        return self.highest[0] + DRIFT * (now - self.highest[1]) if self.highest else float("inf")

    def narrow(self, low: float, high: float, now: float) -> None:
        """Apply the bounds of a round trip, and start over if they contradict the known ones."""
        if low > self.at_most(now) + CONTRADICTION or high < self.at_least(now) - CONTRADICTION:
            self.lowest = self.highest = None
        self.is_bounded = self.highest is not None or high - low <= PROMPT
        if low >= self.at_least(now):
            self.lowest = (low, now)
        if high <= self.at_most(now):
            self.highest = (high, now)


class PeerClocks:
    """The clocks of the sessions that command. `ask` requests a session's clock, with a nonce, and returns its replies,
    `has` returns whether a session is alive. `signer`, in the secure set-up, returns the member that signed an answer
    of a session to a nonce; "": none that may command.

    No thread: `poll` is called in a loop, and never waits. All times are in seconds of this process's monotonic clock.
    """

    def __init__(
        self,
        ask: Callable[[str, bytes, float], Any],
        has: Callable[[str], bool],
        clock: Callable[[], float] = time.monotonic,
        signer: Callable[[str, bytes, bytes], str] | None = None,
    ) -> None:
        self._ask, self.has, self._clock, self._signer = ask, has, clock, signer
        self._peers: dict[str, _Peer] = {}

    def track(self, sessions: Iterable[str], now: float) -> None:
        """Measure the clocks of these sessions from now on; forget sessions that left."""
        for session in [session for session in self._peers if not self.has(session)]:
            del self._peers[session]
        for session in sessions:
            if session not in self._peers and len(self._peers) < MAX_PEERS:
                self._peers[session] = _Peer(now)

    def track_first(self, session: str, now: float) -> None:
        """Measure the clock of a session that commands, ahead of those that only might.

        Where there are MAX_PEERS, one that has never answered is forgotten for it.
        """
        if session not in self._peers and len(self._peers) >= MAX_PEERS:
            silent = (other for other, peer in self._peers.items() if peer.confirmed < 0 and not peer.commands)
            if (other := next(silent, None)) is None:
                return
            del self._peers[other]
        self._peers.setdefault(session, _Peer(now)).commands = True

    def ages(self, session: str, sent: float, now: float, member: str = "") -> tuple[float, float] | None:
        """Bounds of the age in seconds of a sample that a session sent at `sent` by its own clock. `now` may be some
        milliseconds in the past: a fleet takes time to read.

        None while that clock has no bounds, or in the secure set-up if its answer was not signed by `member`, the
        sample's. The sample itself refines the lower bound, within those of round trips.
        """
        peer = self._peers.get(session)
        if peer is None or not peer.is_bounded or (self._signer and member != peer.member):
            return None
        if sent - now > peer.at_least(now):  # it may have come after `now`
            now = max(now, self._clock())
        if sent - now > peer.at_most(now) + CONTRADICTION:  # from the future: measure again
            peer.due = min(peer.due, now)
            return None
        if sent - now > peer.at_least(now):
            peer.lowest = (sent - now, now)
        elapsed = now - sent
        return max(0.0, elapsed + peer.at_least(now)), max(0.0, elapsed + peer.at_most(now))

    def answered(self, session: str) -> float:
        """When the last round trip that this session answered began; below zero before the first."""
        peer = self._peers.get(session)
        return peer.confirmed if peer else -1.0

    def ask_now(self, session: str, now: float) -> None:
        """Start another round trip with this session now, or when the current one has ended."""
        if peer := self._peers.get(session):
            peer.due = min(peer.due, now)

    def poll(self, now: float) -> None:
        """Read replies, and send the requests that are due."""
        due: list[tuple[bool, float, str]] = []
        room = MAX_ASKED
        for session, peer in self._peers.items():
            if peer.replies is not None:
                self._read(session, peer, now)
            if peer.replies is not None:
                room -= now - peer.asked < SLOW  # a peer that never answers takes no place
            elif now >= peer.due:
                due.append((not peer.commands, peer.due, session))
        for _, _, session in sorted(due)[: max(room, 0)]:
            peer = self._peers[session]
            peer.nonce = os.urandom(16) if self._signer else b""
            peer.asked = self._clock()
            peer.replies = self._ask(session, peer.nonce, GIVE_UP)
            peer.left = max(0, peer.left - 1)
            peer.due = now if peer.left else now + AGAIN

    def _read(self, session: str, peer: _Peer, now: float) -> None:
        try:
            reply = peer.replies.try_recv()
        except BusError:  # it timed out, or the session is gone
            peer.replies = None
            return
        if reply is None:
            return
        answered = _seconds(reply)
        if self._signer and isinstance(reply, Sample):
            if not (member := self._signer(session, peer.nonce, reply.payload)):
                return  # a signed one may follow
            if member != peer.member:
                peer.member, peer.lowest, peer.highest, peer.is_bounded = member, None, None, False
        peer.replies = None
        if answered is not None:
            peer.confirmed = peer.asked
            read = self._clock()
            peer.narrow(answered - read, answered - peer.asked, max(now, read))
            if not peer.is_bounded:
                peer.due = now


def _seconds(reply: Sample | bytes) -> float | None:
    """The clock in a reply, in seconds; None for an error or a malformed one. A signature may follow."""
    clock = reply.payload.partition(b";")[0] if isinstance(reply, Sample) else b""
    return int(clock) * 1e-9 if clock.isdigit() and len(clock) <= 20 else None
