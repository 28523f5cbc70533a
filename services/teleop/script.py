"""Scripted driving: `0.5s i` holds a key for half a second, `1s i J` two, `q` presses one, `1s` waits, and `stop`
stops. It needs no terminal: for demonstrations and tests.
"""

import re
import sys
import threading
import time
from dataclasses import dataclass

from .control.layouts import Layout
from .input.kitty import Key
from .session import Session

LONGEST = 3600.0  # s
LARGEST = 1_000_000  # characters
TICK = 0.005  # s
PATIENCE = 3.0  # s to wait for a subscriber
DOUBT = 0.5  # s without being obeyed until it gives up; the sim reports its status at 10 Hz
DURATION = re.compile(r"(\d+(?:\.\d*)?|\.\d+)(ms|s)")


class ScriptError(ValueError):
    """An invalid script; the text is one line."""


@dataclass(frozen=True)
class Step:
    """Keys held together for some seconds; none: no key is held."""

    seconds: float
    keys: tuple[str, ...]


def load(path: str, layout: Layout) -> list[Step]:
    """The steps of a file, or of standard input for "-", all read and checked before the first. Raises ScriptError."""
    try:
        if path == "-":
            return parse(sys.stdin.read(LARGEST + 1), "standard input", layout)
        with open(path, encoding="utf-8") as file:
            return parse(file.read(LARGEST + 1), path, layout)
    except OSError as error:
        raise ScriptError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ScriptError(f"{path}: not a text in UTF-8") from None


def parse(text: str, name: str, layout: Layout) -> list[Step]:
    """The steps of a script; `#` starts a comment. Raises ScriptError with name and line."""
    if len(text) > LARGEST:
        raise ScriptError(f"{name}: longer than {LARGEST} characters")
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
    if seconds > LONGEST:
        raise ScriptError(f"{where}: {words[0]!r} is longer than {LONGEST:g}s")
    keys = tuple(words[1:] if match else words)
    for key in keys:
        if key not in layout.moves and key not in layout.speeds:
            raise ScriptError(f"{where}: {key!r} is not a key of {layout.name}; write `0.5s i`, `q` or `stop`")
        if key in layout.moves and not seconds:
            raise ScriptError(f"{where}: how long is {key!r} held? write `0.5s {key}`")
    return Step(seconds, keys)


def run(steps: list[Step], session: Session, stop: threading.Event) -> str:
    """Drive the steps in order; keys held at the end are released. Returns why it was aborted, or ""."""
    patience = time.monotonic() + PATIENCE
    while not session.listeners() and not stop.wait(TICK):
        if time.monotonic() > patience:
            return f"no subscriber on {session.client.key}; start a sim in another terminal: holozen sim"
    for step in steps:
        now = time.monotonic()
        if not step.keys:
            session.let_go()
        for key in step.keys:
            session.take(Key(key, key, "press", key), now)
        if why := _hold(session, now + step.seconds, stop):
            return why
        for key in step.keys:
            session.take(Key(key, key, "release", key), time.monotonic())
    return ""


def _hold(session: Session, until: float, stop: threading.Event) -> str:
    """Drive until `until`. Returns why it was aborted, or ""."""
    obeyed = now = time.monotonic()
    while now < until:
        session.tick(now)
        if stop.wait(min(TICK, until - now)):
            return "ended by a signal"
        before, now = now, time.monotonic()
        if now - before > DOUBT:
            return "it was paused, and the robot with it"
        why = _not_obeyed(session)
        obeyed = obeyed if why else now
        if session.warning or now - obeyed > DOUBT:
            return session.warning or why
    return ""


def _not_obeyed(session: Session) -> str:
    status = session.client.status()
    if status.stopped:
        return f"stopped by {status.stopped}; `holozen release` lets the robot drive again"
    if not any(session.mapper.motion):
        return ""
    if any(source.held for source in status.sources if source.source == session.bus.source):
        return "the robot was stopped or taken over; `holozen controller --resume` gives it back"
    if status.obeyed not in ("", session.bus.source):
        return f"{status.obeyed} drives the robot, not this script"
    return ""
