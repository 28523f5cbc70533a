"""The command line. A verb's module is imported when the verb is named, so that each starts as fast as it can."""

import errno
import importlib
import os
import sys
from types import ModuleType

VERBS = {
    "up": "start the sim, the controller, the pose service, and the teleop in this terminal",
    "stop": "stop robots, all of them or some, until they are released",
    "release": "let stopped robots drive again",
    "sim": "simulate robots",
    "teleop": "drive a robot from the keyboard",
    "controller": "drive a robot to the goals of next_goal",
    "pose-service": "answer next_goal and get_pose",
    "router": "run a Zenoh router",
    "run": "run a Python script that was written for ROS 2",
    "launch": "follow a Python launch file that was written for ROS 2",
    "spawn": "put a robot or object into the sim",
    "delete": "take it out again",
    "list": "the robots and objects in the sim, and where they are",
    "xacro": "expand a xacro file",
    "check": "say what is wrong with a robot file",
    "topic": "list, info, type, find, echo, hz, bw, delay, pub, plot",
    "service": "list, type, find, info, call",
    "node": "list, info",
    "param": "list, get, set, describe, dump, load",
    "doctor": "check this machine and what runs, and say how to mend it",
    "graph": "who writes, reads and serves what",
    "completion": "a script that completes words in bash, zsh or fish",
    "interface": "list, show, proto",
    "record": "write what comes on the keys into a bag (MCAP)",
    "replay": "publish what is in a bag again, in time",
    "bag": "info, plot, record, play",
    "plot": "draw numbers of live messages in the terminal",
    "map": "draw the robots, their ways and their goals in the terminal",
}
NOUNS = ("topic", "service", "node", "param", "interface", "bag")  # whose first word is a verb
EXTRAS = (
    "lz4",
    "matplotlib",
    "mcap",
    "numpy",
    "pybullet",
    "transforms3d",
    "xacro",
    "zstandard",
)  # what only some verbs need
SERVICES = {"sim": "sim", "teleop": "teleop", "controller": "controller", "pose-service": "pose_service"}


def main(argv: list[str] | None = None) -> int:
    """Run one verb; returns the exit code (0 good, 1 failed, 2 wrong usage). Without `argv` it ends the process."""
    if sys.stdin is None:  # closed by who started it
        sys.stdin = open(os.devnull)  # noqa: SIM115 - kept as long as the process
    words = sys.argv[1:] if argv is None else argv
    code = _guarded(words)
    if argv is None and "zenoh" in sys.modules:
        from holozen.process import leave

        leave(code)
    return code


def _guarded(words: list[str]) -> int:
    try:
        try:
            return _main(words)
        finally:
            _ = sys.stdout and sys.stdout.flush()  # a reader that is gone shows here, and not at the interpreter's end
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # The reader (such as head) has seen enough; nothing more may be written, not even at the interpreter's end.
        _drop_output()
        return 0
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename:
            raise
        from holozen.tell import say

        _drop_output()
        say(f"holozen: cannot write what was asked for: {error.strerror}")
        return 1


def _drop_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _main(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help"):
        print(_help())
        return 0 if words else 2
    if words[0] in ("-V", "--version"):
        from importlib.metadata import version

        print(version("holozen"))
        return 0
    if words[0] == "__complete":
        from holozen.cli.complete import main as complete

        return complete(words[1:])
    if words[0] not in VERBS:
        from holozen.flags import nearest

        known = f"{nearest(words[0], VERBS)}; there are {', '.join(VERBS)}"
        print(f"holozen: no verb {words[0]!r}{known}", file=sys.stderr)
        return 2
    return _run(words[0], words[1:])


def _run(verb: str, words: list[str]) -> int:
    from holozen.errors import BusError
    from holozen.tell import say

    try:
        return int(module(verb).main(words))
    except BusError as error:
        say(f"holozen {' '.join([verb, *words[: verb in NOUNS]])}: {error}")
        return 1
    except ModuleNotFoundError as error:  # some verbs import what they need late
        name = (error.name or "").partition(".")[0]
        if name not in EXTRAS:
            raise
        say(f"holozen {verb} needs {name}; run: pip install 'holozen[{verb}]'")
        return 1


def module(verb: str) -> ModuleType:
    """The verb's module. Services are `holozen.sim` when installed and `services.sim` in the bare source tree."""
    if verb not in SERVICES:
        return importlib.import_module(f"holozen.cli.{verb}")
    name = SERVICES[verb]
    try:
        return importlib.import_module(f"holozen.{name}.__main__")
    except ModuleNotFoundError as error:
        if error.name != f"holozen.{name}":
            raise
        return importlib.import_module(f"services.{name}.__main__")


def _help() -> str:
    rows = "\n".join(f"  {verb:<13} {text}" for verb, text in VERBS.items())
    return (
        f"usage: holozen VERB ...\n\nDrive and simulate holonomic robots over Zenoh.\n\n{rows}\n\nEach verb has --help."
    )
