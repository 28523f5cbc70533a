"""A drive written down: `0.5s i` holds a key for half a second, `1s i J` two, `q` presses one, `1s` waits, and `stop`
stops. It needs no terminal: for demonstrations and tests.
"""

import re
import sys
import threading
import time
from dataclasses import dataclass

from .cockpit import Cockpit
from .keynames import Key
from .layouts import Layout

LONGEST = 3600.0  # s
LARGEST = 1_000_000  # characters
TICK = 0.005  # s
PATIENCE = 3.0  # s until somebody has to listen
DOUBT = 0.5  # s; the sim says ten times a second who drives
DURATION = re.compile(r"(\d+(?:\.\d*)?|\.\d+)(ms|s)")


class ScriptError(ValueError):
    """What is wrong with a script, in one line."""


@dataclass(frozen=True)
class Step:
    """Keys held together for some seconds; none: nothing is held."""

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
            raise ScriptError(f"{where}: {key!r} is no key of {layout.name}; write `0.5s i`, `q` or `stop`")
        if key in layout.moves and not seconds:
            raise ScriptError(f"{where}: how long is {key!r} held? write `0.5s {key}`")
    return Step(seconds, keys)


def run(steps: list[Step], cockpit: Cockpit, stop: threading.Event) -> str:
    """Drive the steps, one after the other; what is held at the end is let go. Returns why it broke off, or ""."""
    patience = time.monotonic() + PATIENCE
    while not cockpit.listeners() and not stop.wait(TICK):
        if time.monotonic() > patience:
            return f"nobody listens on {cockpit.helm.key}; start a sim in another terminal: holozen sim"
    for step in steps:
        now = time.monotonic()
        if not step.keys:
            cockpit.let_go()
        for key in step.keys:
            cockpit.take(Key(key, key, "press", key), now)
        if why := _hold(cockpit, now + step.seconds, stop):
            return why
        for key in step.keys:
            cockpit.take(Key(key, key, "release", key), time.monotonic())
    return ""


def _hold(cockpit: Cockpit, until: float, stop: threading.Event) -> str:
    """Drive until then. Returns why it broke off, or ""."""
    obeyed = now = time.monotonic()
    while now < until:
        cockpit.tick(now)
        if stop.wait(min(TICK, until - now)):
            return "ended by a signal"
        before, now = now, time.monotonic()
        if now - before > DOUBT:
            return "it was paused, and the robot with it"
        why = _not_obeyed(cockpit)
        obeyed = obeyed if why else now
        if cockpit.warning or now - obeyed > DOUBT:
            return cockpit.warning or why
    return ""


def _not_obeyed(cockpit: Cockpit) -> str:
    status = cockpit.helm.status()
    if status.stopped:
        return f"stopped by {status.stopped}; `holozen release` lets the robot drive again"
    if not any(cockpit.pilot.motion):
        return ""
    if any(source.held for source in status.sources if source.source == cockpit.bus.source):
        return "somebody stopped the robot or took it over; `holozen controller --resume` gives it back"
    if status.obeyed not in ("", cockpit.bus.source):
        return f"{status.obeyed} drives the robot, not this script"
    return ""
