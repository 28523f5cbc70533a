"""The application: reads keys, publishes commands when due, draws the screen. It runs in
prompt_toolkit's loop.

Drawing never delays a command: nothing is drawn until the terminal has accepted the last picture,
and writing to it never blocks.
"""

import asyncio
import contextlib
import math
import os
import select
import signal
import time
from types import FrameType
from typing import Any

from prompt_toolkit.application import Application
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.key_binding.key_processor import KeyPress
from prompt_toolkit.keys import Keys
from prompt_toolkit.layout import Layout
from prompt_toolkit.output import DummyOutput

from holozen.process import SIGNALS
from holozen.system import UPTIME

from .control.key_state import LATCH
from .control.twist_mapper import STILL
from .input.gamepad import Joystick, JoystickError
from .input.kitty import Answer, Event, Key, Keyboard
from .input.terminal import Terminal
from .input.terminal_liveness import ANSWERS, LASTS, UNANSWERED, TerminalLiveness
from .screen import STYLE, EventPress, Picture, TerminalInput, TerminalOutput
from .session import Session
from .telemetry import Telemetry
from .view import plain_line, render

MIN_WAIT, MAX_WAIT = 0.001, 0.05  # s between two passes
REDRAW, LINE_EVERY, RETRY = 0.1, 1.0, 0.01  # s between pictures, lines and attempts
STALL = 0.4  # s without a pass; keys typed during that time are outdated
ENDS = (*SIGNALS, signal.SIGQUIT)  # the signals that end it
HELD_KEYS_NEEDED = (
    "--deadman needs a terminal that reports key releases, such as kitty or foot; this one does not"
)


class TeleopError(Exception):
    """The reason in one line why the teleop cannot continue."""


class TeleopApp:
    """Runs until quit, a signal or an error. `plain`: a line a second, for screen readers and logs;
    `ascii`: for fonts without braille.
    """

    def __init__(
        self,
        session: Session,
        terminal: Terminal,
        telemetry: Telemetry,
        joystick: Joystick | None,
        plain: bool,
        ascii: bool,
        colour: bool,
    ) -> None:
        self._session, self._terminal, self._telemetry, self._joystick = (
            session,
            terminal,
            telemetry,
            joystick,
        )
        self._plain, self._ascii = plain, ascii
        self._keyboard = Keyboard()
        self._liveness = TerminalLiveness(terminal, self._keyboard)
        self._ended = self._suspended = self._is_continued = self._has_input = False
        self._stick = session.mapper.stick
        self._passed_at = _uptime()
        self._draw_at = 0.0
        self._error: BaseException | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._picture = Picture()
        self._app: Application[None] = Application(
            layout=Layout(self._picture),
            key_bindings=self._bindings(),
            style=STYLE,
            full_screen=True,
            erase_when_done=True,
            max_render_postpone_time=None,
            terminal_size_polling_interval=None,  # SIGWINCH reports it
            input=TerminalInput(terminal.fileno(), self._read, self._flush, self._pass),
            output=DummyOutput()
            if plain
            else TerminalOutput(terminal.write, terminal.size, colour),
        )

        self._app.timeoutlen = None  # type: ignore[assignment]  # no key is the prefix of another

    def run(self) -> None:
        """Drive. The caller has to stop the robot at the end, even if this raises."""
        for number in (*ENDS, signal.SIGTSTP, signal.SIGCONT):
            signal.signal(number, self._take_signal)
        asyncio.run(self._run())
        if self._error is not None:
            raise self._error

    async def _run(self) -> None:
        loop = self._loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._fail)

        def begin() -> None:
            loop.call_soon(self._attach)  # once prompt_toolkit has begun to read

        try:
            await self._app.run_async(
                pre_run=begin, set_exception_handler=False, handle_sigint=False
            )
        finally:
            self._loop = None
            if self._timer:
                self._timer.cancel()

    def _attach(self) -> None:
        assert self._loop is not None
        self._loop.add_signal_handler(signal.SIGWINCH, self._resize)
        self._liveness.begin()
        if self._joystick:
            self._loop.add_reader(self._joystick.fileno(), self._pass)
        self._pass()

    def _bindings(self) -> KeyBindings:
        bindings = KeyBindings()

        @bindings.add(Keys.Any, eager=True, save_before=lambda _: False)
        def take(event: KeyPressEvent) -> object:
            press = event.key_sequence[0]
            if isinstance(press, EventPress):
                self._take(press.event, press.counts)
            return NotImplemented  # prevents drawing, which has its own schedule

        return bindings

    def _read(self) -> list[KeyPress]:
        """The typed keys; none if they were typed during a pause, and are outdated."""
        self._check_for_pause()
        if not self._readable():
            return []
        self._has_input = True
        # keys read together with the answer may have been typed before it
        counts = not self._liveness.lost
        return [
            EventPress(event, counts)
            for event in self._keyboard.feed(self._terminal.read(), time.monotonic())
        ]

    def _readable(self) -> bool:
        return bool(select.select([self._terminal.fileno()], [], [], 0)[0])

    def _flush(self) -> list[KeyPress]:
        return [
            EventPress(event, not self._liveness.lost)
            for event in self._keyboard.wait(time.monotonic())
        ]

    def _take(self, event: Event, counts: bool) -> None:
        now = time.monotonic()
        if isinstance(event, Answer):
            return self._take_reply(event, now)
        if (
            isinstance(event, Key)
            and not self._quits(event)
            and (not counts or self._is_old(event, now))
        ):
            return self._session.disregard(event, now)
        if isinstance(event, Key):
            self._liveness.press(now)
        self._do(self._session.take(event, now))
        if (
            isinstance(event, Key)
            and "ctrl+p" in (event.name, event.base)
            and event.kind == "press"
        ):
            self._liveness.send_plain_keys_for_docker(now)
            self._session.let_go("to detach from a container: Ctrl-P Ctrl-Q within 2 s")

    def _quits(self, event: Event) -> bool:
        """Whether it is Ctrl-C, on a keyboard for any script. It always counts."""
        return isinstance(event, Key) and self._session.mapper.key(event) == "ctrl+c"

    def _is_old(self, event: Key, now: float) -> bool:
        """Whether a key may have been held since before the terminal was identified, which only
        typed keys can.
        """
        return self._liveness.is_new(now) and event.kind == "typed"

    def _take_reply(self, answer: Answer, now: float) -> None:
        lost = self._liveness.lost
        self._liveness.take_reply(answer, now)
        if lost and not self._liveness.lost and self._session.warning in ("", UNANSWERED):
            self._session.warning = ANSWERS
        if (
            answer.to == "terminal"
            and not self._terminal.releases
            and self._session.mapper.settings.deadman
        ):
            raise TeleopError(HELD_KEYS_NEEDED)

    def _pass(self) -> None:
        """Do everything that is due. Called on input, and when the next task is due."""
        if self._loop is None or self._app.is_done:
            return
        if self._timer:
            self._timer.cancel()
        self._check_for_pause()
        now = time.monotonic()
        if waited := self._flush():
            self._app.key_processor.feed_multiple(waited)
            self._app.key_processor.process_keys()
        if self._has_input:
            self._has_input = False
            self._liveness.note_input(now)
        if self._joystick:
            self._steer(self._joystick, now)
        self._session.tick(now)
        self._check(now)
        if self._suspended:
            self._suspend_process()
        if self._ended:
            return self._finish()
        self.draw(now)
        self._timer = self._loop.call_later(self._patience(), self._pass)

    def _patience(self) -> float:
        """The time (s) until the next pass."""
        mapper = self._session.mapper
        due = min(
            self._draw_at,
            mapper.key_state.expires,
            self._session.due if mapper.engaged else math.inf,
        )
        return min(max(due - time.monotonic(), MIN_WAIT), MAX_WAIT)

    def _steer(self, joystick: Joystick, now: float) -> None:
        if self._session.mapper.stick != self._stick:
            joystick.let_go()  # the robot was stopped: the dead-man must be pressed again
        try:
            for action in joystick.read():
                self._do(self._session.act(action, now))
        except JoystickError as error:
            assert self._loop is not None
            self._loop.remove_reader(joystick.fileno())
            self._joystick = None
            self._session.let_go(str(error))
        self._stick = joystick.direction
        self._session.steer(self._stick, now)

    def _check(self, now: float) -> None:
        """Stop the robot if the operator cannot be reached."""
        mapper = self._session.mapper
        engaged = bool(mapper.key_state.keys) or mapper.motion != STILL
        lasting = mapper.key_state.mode == LATCH or mapper.key_state.timeout is not None
        why = self._liveness.check(now, engaged, lasting)
        if mapper.key_state.keys and lasting:
            why = why or self._liveness.lapse(now)
        if why:
            self._session.let_go(why if engaged else "")

    def draw(self, now: float) -> None:
        """Draw, if it is due and the terminal accepts output."""
        if now < self._draw_at:
            return
        if self._liveness.is_new(now) or not self._terminal.ready():
            self._draw_at = now + RETRY
            return
        self._draw_at = now + (LINE_EVERY if self._plain else REDRAW)
        state = self._telemetry.state(self._mode_reason(), now, self._ascii)
        state.detached = not self._liveness.is_attached()
        if self._plain:
            self._terminal.write(f"{plain_line(state)}\r\n")
        else:
            self._picture.lines = render(state, *self._terminal.size())
            self._app.invalidate()

    def _mode_reason(self) -> str:
        """The reason for the mode."""
        key_state, blind_in = self._session.mapper.key_state, self._liveness.blind_in
        limit = f"for {LASTS:g} s in {blind_in}" if blind_in else ""
        if key_state.mode == LATCH:
            return f"a key sets the motion until another{limit and f', {limit}'}"
        if self._terminal.releases:
            return "this terminal reports key releases"
        if key_state.timeout is not None and key_state.timeout > LASTS and limit:
            return f"a key counts {limit}"
        if key_state.timeout is not None:
            return f"a key counts for {key_state.timeout:g} s"
        first, every = key_state.repeat.first, key_state.repeat.every
        if first is None or every is None:
            return "by key repeat: this terminal reports no releases"
        return f"by key repeat: {first * 1000:.0f} ms, then every {every * 1000:.0f} ms"

    def _do(self, action: str) -> None:
        self._ended = self._ended or action == "quit"
        self._suspended = self._suspended or action == "suspend"

    def _check_for_pause(self) -> None:
        """Release all keys after a pause of this process or of the computer."""
        before, self._passed_at = self._passed_at, _uptime()
        if self._passed_at - before > STALL or self._is_continued:
            self._resume("paused: keys typed in the meantime are ignored")

    def _resume(self, why: str) -> None:
        if self._joystick:
            self._joystick.let_go()
        self._session.let_go(why if self._session.mapper.engaged else "")
        if self._readable():  # outdated, but for Ctrl-C
            typed = self._keyboard.feed(self._terminal.read(), time.monotonic())
            self._ended = self._ended or any(map(self._quits, typed))
        self._liveness.set_up_again()
        self._redraw_in_full()
        self._is_continued = False

    def _suspend_process(self) -> None:
        """Ctrl-Z: stop the robot, and return the terminal to the shell until this process is
        continued.
        """
        self._session.halt()
        self._terminal.leave()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        # the whole group, since the shell waits for our parent too
        os.killpg(os.getpgrp(), signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, self._take_signal)
        self._suspended, self._is_continued = False, True

    def _resize(self) -> None:
        """Another size may mean another terminal, attached to a container."""
        self._liveness.identify_again()
        self._redraw_in_full()
        self._pass()

    def _redraw_in_full(self) -> None:
        """Draw the next picture in full, since the contents of the terminal are unknown."""
        self._app.renderer.reset(leave_alternate_screen=False)
        self._draw_at = 0.0

    def _finish(self, error: BaseException | None = None) -> None:
        """Send a stop at once, and end. The caller's `halt` then makes sure of the stop."""
        self._error = self._error or error
        # The reason for the end matters more than a failed stop, which `halt` repeats.
        with contextlib.suppress(Exception):
            self._session.let_go()
        if self._app.is_running and not self._app.is_done:
            self._app.exit()

    def _fail(self, _loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """End with an exception that was raised in the loop."""
        self._finish(context.get("exception") or RuntimeError(context.get("message")))

    def _take_signal(self, number: int, _frame: FrameType | None) -> None:
        """Note a signal, and wake the loop."""
        if number == signal.SIGTSTP:
            self._suspended = True
        elif number == signal.SIGCONT:
            self._is_continued = True
        else:
            self._ended = True
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._pass)


def _uptime() -> float:
    """Seconds on a clock that, unlike the monotonic one, advances while the computer sleeps."""
    return time.clock_gettime(UPTIME)
