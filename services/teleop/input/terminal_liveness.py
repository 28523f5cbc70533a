"""Whether the terminal, and the operator at it, can still be reached.

A held key sends nothing, and a latched one is never repeated: if the connection to the terminal broke,
the robot would keep driving. So the terminal is polled, and a missing reply is a stop. tmux and screen reply even
while they are detached, but their socket is executable only while a client is attached.

A terminal that hung delivers buffered keys and replies to earlier queries, in any order. That only shows
that it is back. Keys count again once it has replied in time to a query sent after that: it replies in the
order of the queries, so the replies to earlier ones are discounted first.
"""

import math
import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path

from holozen.terminal import ASK_KEYBOARD, ASK_TERMINAL

from .kitty import Answer, Keyboard
from .terminal import ASK_ALIVE, Terminal

FOLDERS = ("/run/screen", "/var/run/screen")


def attached(environ: Mapping[str, str] = os.environ) -> Callable[[], bool]:
    """A function that returns whether an operator may be watching; always true outside of tmux and screen."""
    socket = _socket(environ)
    if socket is None or not socket.exists():
        return lambda: True

    def look() -> bool:
        try:
            return bool(socket.stat().st_mode & 0o100)
        except OSError:
            return False

    return look


def _socket(environ: Mapping[str, str]) -> Path | None:
    if path := environ.get("TMUX", "").partition(",")[0]:
        return Path(path)
    if name := environ.get("STY"):
        folders = [environ["SCREENDIR"]] if environ.get("SCREENDIR") else [f"{at}/S-{_user(environ)}" for at in FOLDERS]
        return next((Path(at) / name for at in folders if (Path(at) / name).exists()), None)
    return None


def _user(environ: Mapping[str, str]) -> str:
    return environ.get("USER") or environ.get("LOGNAME") or ("root" if os.getuid() == 0 else "")


EVERY, IDLE = 0.05, 0.5  # s between two queries, while driving and while not
LIMIT = 0.4  # s for a reply; with EVERY less than the half second in which a robot must stop
RETRY = 2.0  # s from a missed reply to the next query, doubled each time after that
ROUNDS = 2  # consecutive replies after it is back; by then it has delivered its buffered keys


class Heartbeat:
    """Queries and replies. A terminal that never replied is not polled."""

    def __init__(self) -> None:
        self.answers = False  # whether this terminal is known to reply
        self.lost = False  # a reply was overdue, and no fresh one arrived since
        self._asked: deque[float] = deque()  # times of the queries without a reply
        self._last = 0.0  # time of the last query
        self._lost_at = 0.0
        self._sent = self._heard = 0  # identity queries, and replies to those
        self._old = 0  # replies that may belong to queries from before it was back
        self._probed: float | None = None  # time of the query after it was back; None until there was input
        self._rounds = 0  # such queries with a reply in time

    def due(self, now: float, drives: bool) -> bool:
        """Whether to send a query now."""
        wait = max(RETRY, self._last - self._lost_at) if self.lost else EVERY if drives else IDLE
        if not self.answers or now - self._last < wait:
            return False
        if not self.lost:
            self._asked.append(now)
        self._last = now
        return True

    def asked_terminal(self, times: int = 1) -> None:
        """Count identity queries."""
        self._sent += times

    def answered(self, now: float, terminal: bool) -> None:
        """Take a reply. `terminal`: to an identity query."""
        self.answers = True
        if self._asked:
            self._asked.popleft()
        if terminal:
            self._heard = min(self._heard + 1, self._sent)
        if not self.lost or self._probed is None or self._heard <= self._old:
            return
        in_time, self._probed = now - self._probed <= LIMIT, None
        self._rounds = self._rounds + 1 if in_time else 0
        if self._rounds == ROUNDS:
            self.lost = False
            self._asked.clear()

    def came(self, now: float) -> int:
        """Take note of input from a lost terminal; returns the number of identity queries to send now."""
        if not self.lost or (self._probed is not None and now - self._probed <= LIMIT):
            return 0
        if self._probed is not None:
            self._rounds = 0  # it hung again
        self._old, self._probed = self._sent, now
        return self._sent - self._heard + 1

    def miss(self, now: float) -> bool:
        """Whether a reply has just become overdue."""
        if self.lost or not self._asked or now - self._asked[0] <= LIMIT:
            return False
        self._lose(now)
        return True

    def restart(self, now: float) -> None:
        """Expect no replies to earlier queries; keys do not count until it replies again."""
        self._asked.clear()
        if self.answers:
            self._lose(now)

    def _lose(self, now: float) -> None:
        self.lost, self._lost_at, self._last = True, now, -math.inf
        self._probed, self._rounds = None, 0


GREETING = 0.2  # s for the terminal to report whether it has releases; keys typed until then were held before
LENT = 2.0  # s of plain keys for Docker
UNANSWERED = "the terminal does not answer: stopped"
ANSWERS = "the terminal answers again: press a key to drive"
DETACHED = "no client is attached: stopped"


class TerminalLiveness:
    """Polls the terminal, and takes its replies. Times in seconds."""

    def __init__(self, terminal: Terminal, keyboard: Keyboard) -> None:
        self._terminal, self._keyboard, self._heartbeat = terminal, keyboard, Heartbeat()
        self.is_attached = attached()
        self._heartbeat.asked_terminal()  # by `Terminal.enter`
        self._speaks = False  # the Kitty protocol, since the last identity query
        self._known = False  # whether it reports releases
        self._greeted = time.monotonic()
        self._lent_until = math.inf

    def begin(self) -> None:
        """Start: from now on its replies are read."""
        self._greeted = time.monotonic()

    def is_new(self, now: float) -> bool:
        """Whether the terminal has yet to report its features; a key that repeats now was held before the start."""
        return not self._known and now - self._greeted < GREETING

    @property
    def lost(self) -> bool:
        """Whether the terminal is lost, or has yet to reply since it came back; no key counts until then."""
        return self._heartbeat.lost

    def came(self, now: float) -> None:
        """Input of the terminal was read and processed."""
        if times := self._heartbeat.came(now):
            self._ask_terminal(times)

    def hear(self, answer: Answer, now: float) -> None:
        """Take a reply of the terminal."""
        self._terminal.answered()
        self._heartbeat.answered(now, answer.to == "terminal")
        if answer.to == "keyboard":
            first = not self._terminal.releases
            self._terminal.report_releases(answer.flags)
            if first:
                self._terminal.ask(ASK_KEYBOARD)  # after the reply to this, all its keys report releases
            self._known = not first
            self._keyboard.releases = self._speaks = True
        elif answer.to == "terminal":
            # Replies arrive in the order of the queries: one that reports releases has replied to that before.
            if not self._speaks:
                self._terminal.send_plain_keys()
                self._known, self._keyboard.releases = True, False
            self._speaks = False

    def check(self, now: float, engaged: bool, lasting: bool) -> str:
        """Send due queries. Returns why the robot must stop, or "". `lasting`: keys drive without repeats."""
        if self._heartbeat.due(now, engaged and (lasting or self._terminal.releases)):
            self._ask()
        if now > self._lent_until:
            self._lent_until = math.inf
            self._ask_terminal()
        if self._heartbeat.miss(now):
            return UNANSWERED
        return DETACHED if engaged and not self.is_attached() else ""

    def lend(self, now: float) -> None:
        """Send plain keys for a while: Docker recognizes its detach keys, Ctrl-P Ctrl-Q, only in that form."""
        self._terminal.send_plain_keys()
        self._keyboard.releases, self._lent_until = False, now + LENT

    def meet_again(self) -> None:
        """After a pause: set up and identify the terminal again."""
        self._terminal.enter()
        self._keyboard.forget()
        self._keyboard.releases = self._known = False
        self._greeted = time.monotonic()
        self._heartbeat.restart(self._greeted)
        self._heartbeat.asked_terminal()

    def look_again(self) -> None:
        """Another size may mean another terminal, attached to a container."""
        self._speaks = False
        self._terminal.greet()
        self._heartbeat.asked_terminal()

    def _ask(self) -> None:
        if self._heartbeat.lost:
            self._ask_terminal()
        else:
            self._terminal.ask(ASK_KEYBOARD if self._terminal.releases else ASK_ALIVE)

    def _ask_terminal(self, times: int = 1) -> None:
        """Query its identity: a different one may have been attached."""
        self._speaks = False
        for _ in range(times):
            self._terminal.ask(ASK_KEYBOARD + ASK_TERMINAL)
        self._heartbeat.asked_terminal(times)
