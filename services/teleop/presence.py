"""Who is before the terminal: what kind it is, whether it answers, whether anybody is attached to it."""

import math
import time

from . import multiplexer
from .heartbeat import Heartbeat
from .keys import Answer, Event, Key, Keyboard
from .terminal import ASK_ALIVE, ASK_KEYBOARD, ASK_TERMINAL, Terminal

GREETING = 0.2  # s for the terminal to say whether it tells releases; what is typed until then was held before
LENT = 2.0  # s that Docker gets the plain keyboard for
UNANSWERED = "the terminal does not answer: stopped"
DETACHED = "nobody is attached: stopped"


class Presence:
    """Asks the terminal, and hears its answers. Times in seconds."""

    def __init__(self, terminal: Terminal, keyboard: Keyboard) -> None:
        self._terminal, self._keyboard, self._heartbeat = terminal, keyboard, Heartbeat()
        self._attached = multiplexer.attached()
        self._speaks = False  # of the Kitty protocol, since it was asked last what it is
        self._known = False  # whether it tells releases
        self._greeted = time.monotonic()
        self._lent_until = math.inf

    def is_new(self, now: float) -> bool:
        """Whether the terminal has yet to say what it can; a key that repeats now was held before we came."""
        return not self._known and now - self._greeted < GREETING

    def believes(self, event: Event) -> bool:
        """Whether a key was typed by somebody who sees the robot. Ctrl-C always counts."""
        return not (self._heartbeat.lost and isinstance(event, Key)) or event.name == "ctrl+c"

    def hear(self, answer: Answer) -> None:
        """The terminal answered."""
        self._terminal.answered()
        self._heartbeat.answered()
        if answer.to == "keyboard":
            first = not self._terminal.releases
            self._terminal.tell_releases(answer.flags)
            if first:
                self._terminal.ask(ASK_KEYBOARD)  # once it has answered that too, all its keys tell releases
            self._known = not first
            self._keyboard.releases = self._speaks = True
        elif answer.to == "terminal":
            # It answers in the order in which it was asked: one that tells releases has said so before.
            if not self._speaks:
                self._terminal.tell_no_releases()
                self._known, self._keyboard.releases = True, False
            self._speaks = False

    def check(self, now: float, engaged: bool, lasting: bool) -> str:
        """Ask what is due. Returns why the robot must stop, or "". `lasting`: keys drive that need not repeat."""
        if self._heartbeat.due(now, engaged and (lasting or self._terminal.releases)):
            self._ask()
        if now > self._lent_until:
            self._lent_until = math.inf
            self._terminal.ask(ASK_KEYBOARD + ASK_TERMINAL)
        if self._heartbeat.miss(now):
            return UNANSWERED
        return DETACHED if engaged and not self._attached() else ""

    def lend(self, now: float) -> None:
        """Docker knows its own keys, Ctrl-P Ctrl-Q, only as a plain keyboard sends them."""
        self._terminal.tell_no_releases()
        self._keyboard.releases, self._lent_until = False, now + LENT

    def meet_again(self) -> None:
        """After a pause: nothing is known of the terminal."""
        self._terminal.enter()
        self._keyboard.forget()
        self._keyboard.releases = self._known = False
        self._greeted = time.monotonic()
        self._heartbeat.restart()

    def look_again(self) -> None:
        """Another size may be that of another terminal: somebody attached to a container."""
        self._speaks = False
        self._terminal.greet()
        self._heartbeat.hurry()

    def _ask(self) -> None:
        if self._heartbeat.lost:
            self._speaks = False  # somebody may have attached with another terminal
            self._terminal.ask(ASK_KEYBOARD + ASK_TERMINAL)
        else:
            self._terminal.ask(ASK_KEYBOARD if self._terminal.releases else ASK_ALIVE)
