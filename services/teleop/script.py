"""Scripted driving, without a terminal, for demonstrations and tests: `0.5s i` holds a key for half
a second, `1s i J` holds two keys for one, `q` presses a key once, `1s` waits, and `stop` stops.
"""

import re
import sys
import threading
import time

from msgspec import Struct

from holozen.messages import CommandStatus
from holozen.suggest import listed, suggest
from holozen.wire import VELOCITIES, release_command, resume_command

from .control.layouts import Layout
from .input.kitty import Key
from .session import Session
from .toml_file import InputError

MAX_SECONDS = 3600.0  # s
LARGEST = 1_000_000  # characters
TICK = 0.005  # s
PATIENCE = 3.0  # s to wait for a subscriber
DOUBT = 0.5  # s without being obeyed after which it gives up; the sim reports its status at 10 Hz
# s of commands after which it gives up if the sim has obeyed none; it first measures our clock
UNHEARD = 1.5
DURATION = re.compile(r"(\d+(?:\.\d*)?|\.\d+)(ms|s)")


class Step(Struct, frozen=True):
    """Keys that are held together for some seconds; without keys, none is held."""

    seconds: float
    keys: tuple[str, ...]


def load(path: str, layout: Layout) -> list[Step]:
    """The steps of a file, or of standard input for "-", all of them checked. Raises InputError."""
    try:
        if path == "-":
            return parse(sys.stdin.read(LARGEST + 1), "standard input", layout)
        with open(path, encoding="utf-8") as file:
            return parse(file.read(LARGEST + 1), path, layout)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text in UTF-8") from None


def parse(text: str, name: str, layout: Layout) -> list[Step]:
    """The steps of a script, in which `#` starts a comment. Raises InputError with the `name` and
    the line.
    """
    if len(text) > LARGEST:
        raise InputError(f"{name}: longer than {LARGEST} characters")
    steps = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition(" #")[0].split()
        if words and not words[0].startswith("#"):
            steps.append(_step(words, f"{name}, line {number}", layout))
    return steps


def _step(words: list[str], where: str, layout: Layout) -> Step:
    if words == ["stop"]:
        return Step(0.0, ())
    match = DURATION.fullmatch(words[0])
    seconds = float(match[1]) / (1000 if match[2] == "ms" else 1) if match else 0.0
    if seconds > MAX_SECONDS:
        raise InputError(f"{where}: {words[0]!r} is longer than {MAX_SECONDS:g}s")
    keys = tuple(words[1:] if match else words)
    for key in keys:
        if key not in layout.moves and key not in layout.speeds:
            raise InputError(
                f"{where}: {key!r} is not a key of {layout.name}; write `0.5s i`, `q` or `stop`"
            )
        if key in layout.moves and not seconds:
            raise InputError(f"{where}: how long is {key!r} held? write `0.5s {key}`")
    return Step(seconds, keys)


def run(steps: list[Step], session: Session, stop: threading.Event) -> str:
    """Drive the steps in order. Returns why they were aborted, or ""."""
    patience = time.monotonic() + PATIENCE
    session.tick(time.monotonic())  # it finds a robot at the root by its name
    while session.waiting or not session.listeners():
        if stop.wait(TICK):
            return "ended by a signal"
        now = time.monotonic()
        if now > patience:
            return session.waiting or _nobody(session)
        session.tick(now)
    drive = _Drive(session, stop)
    for step in steps:
        if not step.keys:
            session.let_go()
        for key in step.keys:
            session.take(Key(key, key, "press", key), drive.now)
        if why := drive.hold(step.seconds):
            return why
        for key in step.keys:
            session.take(Key(key, key, "release", key), drive.now)
    return ""


def _nobody(session: Session) -> str:
    """That the robot is not there, and which ones are."""
    missing = session.client.key
    ends = session.graph.endpoints()
    there = {end.key for end in ends if end.kind == "sub" and end.type in VELOCITIES}
    meant = suggest(missing, there, lambda key: key.rpartition("/")[0])
    flag = "" if all(key.endswith("cmd_vel") for key in there) else ", which --cmd-vel chooses"
    others = f"{meant}; there are some on {listed(there)}{flag}"
    return (
        "no subscriber on "
        f"{missing}{others if there else '; start a sim in another terminal: holozen sim'}"
    )


class _Drive:
    """All steps of a script, and what was seen meanwhile; times in s, monotonic.

    Attributes:
        now: The last look at the clock; a pause since then counts, also between two steps.
    """

    def __init__(self, session: Session, stop: threading.Event) -> None:
        self._session, self._stop = session, stop
        self.now = self._obeyed = time.monotonic()
        self._heard = False  # whether the sim has obeyed a command
        self._unheard = 0.0  # s of commands until then

    def hold(self, seconds: float) -> str:
        """Drive for some seconds. Returns why that was aborted, or ""."""
        session, until = self._session, self.now + seconds
        while self.now < until:
            session.tick(self.now)
            if self._stop.wait(min(TICK, until - self.now)):
                return "ended by a signal"
            before, self.now = self.now, time.monotonic()
            if self.now - before > DOUBT:
                return "it was paused, and the robot with it"
            status = session.client.status()
            why = _not_obeyed(session, status)
            if not why:
                self._obeyed = self.now
            if session.warning or self.now - self._obeyed > DOUBT:
                return session.warning or why
            self._heard |= status.obeyed == session.bus.source
            if any(session.mapper.motion) and not self._heard:
                self._unheard += self.now - before
            if status.name and self._unheard > UNHEARD and not self._heard:
                return "the sim has received no command; does it hang? `holozen doctor` looks why"
        return ""


def _not_obeyed(session: Session, status: CommandStatus) -> str:
    robot = session.client.key.rpartition("/")[0]
    if status.stopped:
        release = release_command(robot)
        return f"stopped by {status.stopped}; `{release}` lets the robot drive again"
    if not any(session.mapper.motion):
        return ""
    if session.client.odom.is_paused:
        return "the sim is paused; `holozen sim play` continues it"
    if any(source.held for source in status.sources if source.source == session.bus.source):
        command = resume_command(robot)
        return f"the robot was stopped or taken over; `{command}` gives it back"
    if status.obeyed not in ("", session.bus.source):
        return f"{status.obeyed} drives the robot, not this script"
    return ""
