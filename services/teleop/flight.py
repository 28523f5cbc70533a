"""The loop between terminal and cockpit: what comes in, what is due, what is shown."""

import math
import os
import select
import signal
import time
from types import FrameType

from holozen.process import SIGNALS

from .cockpit import Cockpit
from .grip import LATCH
from .joystick import Joystick, JoystickError
from .keys import Answer, Event, Key, Keyboard
from .pilot import STILL
from .presence import Presence
from .screen import Screen
from .terminal import Terminal

SHORTEST, LONGEST = 0.001, 0.05  # s between two looks at what is due
STALL = 0.4  # s without a look; what was typed meanwhile is old
ENDS = (*SIGNALS, signal.SIGQUIT)
HELD_KEYS_NEEDED = "this terminal does not tell when a key is released, which --deadman needs"


class TeleopError(Exception):
    """Why the teleop cannot go on, in one line."""


class Flight:
    """Runs until it is quit, a signal comes or something breaks."""

    def __init__(self, cockpit: Cockpit, terminal: Terminal, screen: Screen, joystick: Joystick | None) -> None:
        self._cockpit, self._terminal, self._screen, self._joystick = cockpit, terminal, screen, joystick
        self._keyboard = Keyboard()
        self._presence = Presence(terminal, self._keyboard)
        self._ended = self._suspended = self._back = self._resized = self._typed = False
        self._stick = cockpit.pilot.stick
        self._looked = _uptime()
        self._wake, self._waker = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)

    def run(self) -> None:
        """Fly. The robot is not stopped at the end: that is the caller's, also when this raises."""
        signal.set_wakeup_fd(self._waker, warn_on_full_buffer=False)
        for number in ENDS:
            signal.signal(number, self._end)
        signal.signal(signal.SIGTSTP, self._suspend)
        signal.signal(signal.SIGCONT, self._continue)
        signal.signal(signal.SIGWINCH, self._resize)
        while self._wait():
            now, before, self._looked = time.monotonic(), self._looked, _uptime()
            stalled = self._looked - before > STALL
            if stalled or self._back:
                self._come_back("paused: what was typed meanwhile does not count")
            self._read(now)
            self._cockpit.tick(now)
            self._check(now)
            if self._suspended:
                self._sleep()
            if self._resized:
                self._resized = False
                self._presence.look_again()
                self._screen.forget()
            if not self._presence.is_new(now):
                self._screen.show(now, self._why())

    def _wait(self) -> bool:
        """Wait for what comes in or is due. Whether to go on."""
        sources = [self._terminal.fileno(), self._wake]
        if self._joystick:
            sources.append(self._joystick.fileno())
        ready = select.select(sources, [], [], self._patience())[0]
        self._typed = self._terminal.fileno() in ready
        if self._wake in ready:
            os.read(self._wake, 4096)
        return not self._ended

    def _patience(self) -> float:
        """How long nothing is due."""
        pilot = self._cockpit.pilot
        due = min(self._screen.due, pilot.grip.expires, self._cockpit.due if pilot.engaged else math.inf)
        return min(max(due - time.monotonic(), SHORTEST), LONGEST)

    def _read(self, now: float) -> None:
        events: list[Event] = self._keyboard.wait(now)
        if self._typed:
            events = [*events, *self._keyboard.feed(self._terminal.read(), now)]
        for event in events:
            if isinstance(event, Answer):
                self._hear(event)
            elif (
                self._presence.is_new(now)
                and isinstance(event, Key)
                and event.kind == "typed"
                and event.name != "ctrl+c"
            ):
                self._cockpit.pilot.grip.ignore(event.name, now)
            elif self._presence.believes(event):
                self._take(event, now)
        if self._joystick:
            self._steer(self._joystick, now)

    def _take(self, event: Event, now: float) -> None:
        self._do(self._cockpit.take(event, now))
        if isinstance(event, Key) and (event.name, event.kind) == ("ctrl+p", "press"):
            self._presence.lend(now)
            self._cockpit.let_go("to detach from a container: Ctrl-P Ctrl-Q within 2 s")

    def _steer(self, joystick: Joystick, now: float) -> None:
        if self._cockpit.pilot.stick != self._stick:
            joystick.let_go()  # something stopped the robot: the dead-man is to be pressed anew
        try:
            for action in joystick.read():
                self._do(self._cockpit.act(action, now))
        except JoystickError as error:
            self._joystick = None
            self._cockpit.let_go(str(error))
        self._stick = joystick.direction
        self._cockpit.steer(self._stick, now)

    def _hear(self, answer: Answer) -> None:
        self._presence.hear(answer)
        if answer.to == "terminal" and not self._terminal.releases and self._cockpit.pilot.settings.deadman:
            raise TeleopError(HELD_KEYS_NEEDED)

    def _check(self, now: float) -> None:
        """See that somebody is there who drives."""
        pilot = self._cockpit.pilot
        engaged = bool(pilot.grip.keys) or pilot.motion != STILL
        lasting = pilot.grip.mode == LATCH or pilot.grip.timeout is not None
        if why := self._presence.check(now, engaged, lasting):
            self._cockpit.let_go(why if engaged else "")

    def _why(self) -> str:
        """Why the mode is what it is."""
        grip = self._cockpit.pilot.grip
        if grip.mode == LATCH:
            return "a key sets the motion until another"
        if self._terminal.releases:
            return "this terminal tells when a key is released"
        if grip.timeout is not None:
            return f"a key counts for {grip.timeout:g} s"
        if grip.repeat.first is None or grip.repeat.every is None:
            return "by key repeat: this terminal tells no releases"
        return f"by key repeat: {grip.repeat.first * 1000:.0f} ms, then every {grip.repeat.every * 1000:.0f} ms"

    def _do(self, action: str) -> None:
        self._ended = self._ended or action == "quit"
        self._suspended = self._suspended or action == "suspend"

    def _sleep(self) -> None:
        """Ctrl-Z: the robot stands and the terminal is the shell's, until it brings us back."""
        self._cockpit.halt()
        self._terminal.leave()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.killpg(os.getpgrp(), signal.SIGTSTP)  # with whoever started us: the shell waits for that
        signal.signal(signal.SIGTSTP, self._suspend)
        self._suspended, self._back = False, True

    def _come_back(self, why: str) -> None:
        """After a pause nothing is held, whatever was typed."""
        if self._joystick:
            self._joystick.let_go()
        self._cockpit.let_go(why if self._cockpit.pilot.engaged else "")
        self._presence.meet_again()
        self._screen.forget()
        self._back = self._typed = False

    def _end(self, _number: int, _frame: FrameType | None) -> None:
        self._ended = True

    def _suspend(self, _number: int, _frame: FrameType | None) -> None:
        self._suspended = True

    def _continue(self, _number: int, _frame: FrameType | None) -> None:
        self._back = True

    def _resize(self, _number: int, _frame: FrameType | None) -> None:
        self._resized = True


def _uptime() -> float:
    """Seconds on a clock that goes on while the computer sleeps, as the monotonic one does not."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)
