"""Whether the terminal, and the operator at it, can still be reached.

Where the terminal reports releases a held key sends nothing, and a latched key is never repeated:
if the connection to the terminal broke, the robot would keep driving. So the terminal is polled,
and a missing reply stops the robot. tmux and screen reply even while they are detached, but their
socket is executable only while a client is attached. They also reply while the line to an attached
client hangs, which nothing shows: there a latched key has to be pressed again and again.

A terminal that hung delivers, once it is back, buffered keys and replies to earlier queries, in any
order. Keys count again once it has replied in time to queries sent after that. It replies in the
order of the queries, so the replies to earlier ones are discounted first.
"""

import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path

from holozen.terminal import ASK_KEYBOARD, ASK_TERMINAL

from .kitty import Answer, Keyboard
from .terminal import ASK_ALIVE, Terminal

FOLDERS = ("/run/screen", "/var/run/screen")
LASTS = 5.0  # s for which a key without repeats counts where a lost operator would not be noticed
MUTE = "a terminal that does not answer"


def attached(environ: Mapping[str, str] = os.environ) -> Callable[[], bool]:
    """A function that tells whether an operator may be attached; it always does outside of tmux and
    screen.
    """
    socket = _socket(environ)
    if socket is None or not socket.exists():
        return lambda: True

    def look() -> bool:
        try:
            return bool(socket.stat().st_mode & 0o100)
        except OSError:
            return False

    return look


def multiplexer(environ: Mapping[str, str] = os.environ) -> str:
    """The multiplexer between this program and the operator's terminal: "tmux", "screen", or "" if
    none is known.

    Over ssh only TERM shows it, and many a tmux has screen's.
    """
    if environ.get("TMUX") or environ.get("TERM", "").startswith("tmux"):
        return "tmux"
    return "screen" if environ.get("STY") or environ.get("TERM", "").startswith("screen") else ""


def _socket(environ: Mapping[str, str]) -> Path | None:
    if path := environ.get("TMUX", "").partition(",")[0]:
        return Path(path)
    if name := environ.get("STY"):
        folders = (
            [environ["SCREENDIR"]]
            if environ.get("SCREENDIR")
            else [f"{at}/S-{_user(environ)}" for at in FOLDERS]
        )
        return next((Path(at) / name for at in folders if (Path(at) / name).exists()), None)
    return None


def _user(environ: Mapping[str, str]) -> str:
    return environ.get("USER") or environ.get("LOGNAME") or ("root" if os.getuid() == 0 else "")


EVERY, IDLE = 0.05, 0.5  # s between two queries, while driving and while not
# s for a reply; LIMIT and EVERY together are less than the half second in which a robot must stop
LIMIT = 0.4
RETRY = 2.0  # s from a missed reply to the next query, doubled each time after that
# consecutive replies in time after which it is back; by then it has delivered its buffered keys
ROUNDS = 2


class Heartbeat:
    """Keeps account of queries and replies. A terminal that has never replied is not polled."""

    def __init__(self) -> None:
        self.answers = False  # whether this terminal is known to reply
        self._asked: deque[float] = deque()  # times of the queries without a reply
        self._last: float | None = None  # time of the last query; None: the next one is due now
        # since when a reply is overdue and the terminal not yet back; None while it is there
        self._lost_since: float | None = None
        self._sent = self._heard = 0  # identity queries, and replies to them
        self._old = 0  # replies that may belong to queries from before there was input again
        # time of the query after there was input again; None before
        self._probed: float | None = None
        self._rounds = 0  # such queries in a row with a reply in time

    @property
    def lost(self) -> bool:
        """Whether a reply was overdue, and the terminal is not yet back."""
        return self._lost_since is not None

    def due(self, now: float, drives: bool) -> bool:
        """Whether to send a query now."""
        if not self.answers or (self._last is not None and now - self._last < self._wait(drives)):
            return False
        if not self.lost:
            self._asked.append(now)
        self._last = now
        return True

    def _wait(self, drives: bool) -> float:
        """The time from the last query to the next one."""
        if self._lost_since is not None and self._last is not None:
            return max(RETRY, self._last - self._lost_since)
        return EVERY if drives else IDLE

    def asked_terminal(self, times: int = 1) -> None:
        """Count identity queries that were sent."""
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
            self._lost_since = None
            self._asked.clear()

    def note_input(self, now: float) -> int:
        """Note that there was input. Returns the number of identity queries to send now, if the
        terminal is lost.
        """
        if not self.lost or (self._probed is not None and now - self._probed <= LIMIT):
            return 0
        if self._probed is not None:
            self._rounds = 0  # it hung again
        self._old, self._probed = self._sent, now
        return self._sent - self._heard + 1

    def has_missed(self, now: float) -> bool:
        """Whether a reply has just become overdue."""
        if self.lost or not self._asked or now - self._asked[0] <= LIMIT:
            return False
        self._lose(now)
        return True

    def restart(self, now: float) -> None:
        """Expect no replies to earlier queries; the terminal is lost until it replies again."""
        self._asked.clear()
        if self.answers:
            self._lose(now)

    def _lose(self, now: float) -> None:
        self._lost_since, self._last = now, None
        self._probed, self._rounds = None, 0


# s for the terminal to report whether it has releases; keys typed before may have been held earlier
GREETING = 0.2
PLAIN_FOR = 2.0  # s of plain keys for Docker
UNANSWERED = "the terminal does not answer: stopped"
ANSWERS = "the terminal answers again: press a key to drive"
DETACHED = "no client is attached: stopped"


class TerminalLiveness:
    """Polls the terminal, and evaluates its replies. Times in seconds."""

    def __init__(self, terminal: Terminal, keyboard: Keyboard) -> None:
        self._terminal, self._keyboard, self._heartbeat = terminal, keyboard, Heartbeat()
        self.is_attached, self._multiplexer = attached(), multiplexer()
        self._pressed_at: float | None = None
        self._heartbeat.asked_terminal()  # by `Terminal.enter`
        # whether it has replied in the Kitty protocol since the last identity query
        self._speaks_kitty = False
        self._known = False  # whether it is known if it reports releases
        self._greeted = time.monotonic()
        self._plain_until: float | None = None

    def begin(self) -> None:
        """Begin: its replies are read from now on."""
        self._greeted = time.monotonic()

    def is_new(self, now: float) -> bool:
        """Whether the terminal has yet to report its features; a key that repeats now may have been
        held before.
        """
        return not self._known and now - self._greeted < GREETING

    @property
    def lost(self) -> bool:
        """Whether the terminal is lost, or has yet to reply since it came back. No key counts
        meanwhile.
        """
        return self._heartbeat.lost

    def note_input(self, now: float) -> None:
        """Note that input of the terminal was read and processed."""
        if times := self._heartbeat.note_input(now):
            self._ask_terminal(times)

    def take_reply(self, answer: Answer, now: float) -> None:
        """Take a reply of the terminal."""
        self._terminal.answered()
        self._heartbeat.answered(now, answer.to == "terminal")
        if answer.to == "keyboard":
            first = not self._terminal.releases
            self._terminal.report_releases(answer.flags)
            if first:
                # once it has replied to this, all its keys report releases
                self._terminal.ask(ASK_KEYBOARD)
            self._known = not first
            self._keyboard.releases = self._speaks_kitty = True
        elif answer.to == "terminal":
            # Replies arrive in the order of the queries: one with releases has already replied to
            # the other query.
            if not self._speaks_kitty:
                self._terminal.send_plain_keys()
                self._known, self._keyboard.releases = True, False
            self._speaks_kitty = False

    def press(self, now: float) -> None:
        """Note that a key was pressed: there is an operator."""
        self._pressed_at = now

    @property
    def blind_in(self) -> str:
        """What hides a lost operator, so that a key without repeats counts for LASTS alone: tmux,
        screen, or a terminal that has never replied; else "".
        """
        return self._multiplexer or ("" if self._heartbeat.answers else MUTE)

    def lapse(self, now: float) -> str:
        """Why a key without repeats no longer counts; "" while it does."""
        is_fresh = self._pressed_at is not None and now - self._pressed_at <= LASTS
        if not self.blind_in or is_fresh:
            return ""
        return f"in {self.blind_in} a key counts for {LASTS:g} s: press it again"

    def check(self, now: float, engaged: bool, lasting: bool) -> str:
        """Send due queries. Returns why the robot must stop, or "". `lasting`: keys drive without
        repeats.
        """
        if self._heartbeat.due(now, engaged and (lasting or self._terminal.releases)):
            self._ask()
        if self._plain_until is not None and now > self._plain_until:
            self._plain_until = None
            self._ask_terminal()
        if self._heartbeat.has_missed(now):
            return UNANSWERED
        return DETACHED if engaged and not self.is_attached() else ""

    def send_plain_keys_for_docker(self, now: float) -> None:
        """Let the terminal send plain keys for a while, since Docker knows its detach keys only in
        that form.
        """
        self._terminal.send_plain_keys()
        self._keyboard.releases, self._plain_until = False, now + PLAIN_FOR

    def set_up_again(self) -> None:
        """Set up and identify the terminal again, after a pause."""
        self._terminal.enter()
        self._keyboard.forget()
        self._keyboard.releases = self._known = False
        self._greeted = time.monotonic()
        self._heartbeat.restart(self._greeted)
        self._heartbeat.asked_terminal()

    def identify_again(self) -> None:
        """Identify the terminal again: it may be another one, attached to a container."""
        self._speaks_kitty = False
        self._terminal.greet()
        self._heartbeat.asked_terminal()

    def _ask(self) -> None:
        if self._heartbeat.lost:
            self._ask_terminal()
        else:
            self._terminal.ask(ASK_KEYBOARD if self._terminal.releases else ASK_ALIVE)

    def _ask_terminal(self, times: int = 1) -> None:
        """Query its identity: another one may have been attached."""
        self._speaks_kitty = False
        for _ in range(times):
            self._terminal.ask(ASK_KEYBOARD + ASK_TERMINAL)
        self._heartbeat.asked_terminal(times)
