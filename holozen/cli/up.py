"""`holozen up`: the main job in one command, every part a process of its own."""

import argparse
import contextlib
import signal
import subprocess
import sys
import tempfile
import termios
import threading
import time
from typing import IO, Any

from holozen import connection, flags
from holozen.process import dies_with_parent, stop_event
from holozen.tell import say

GRACE = 1.2  # s for the commanding processes to stop the robot; the sim comes after them
SIM_GRACE = 0.5  # s
LOOK = 0.05  # s
LAST_LINES = 20
# Plain keys, no update under way, lines wrap, no reports of focus and pastes, a cursor, the main screen.
SCREEN_LEFT = "\x1b[<u\x1b[?2026l\x1b[?7h\x1b[?1004l\x1b[?2004l\x1b[?25h\x1b[?1049l"


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen up",
        description="Start the sim, the controller, the pose service, and the teleop if there is a terminal.",
        epilog="example: holozen up --robot my_bot.urdf.xacro",
    )
    parser.add_argument("--robot", type=flags.robot_file, metavar="FILE[=NAME]", help="as for `holozen sim --robot`")
    for flag in ("--world", "--rtf", "--drive"):
        parser.add_argument(flag, help=f"as for `holozen sim {flag}`")
    parser.add_argument("--package", action="append", default=[], metavar="NAME=DIR", help="as for `holozen sim`")
    for flag in ("--shape", "--size", "--goals"):
        parser.add_argument(flag, help=f"as for `holozen pose-service {flag}`")
    parser.add_argument("--laps", default="0", help="as for `holozen controller --laps` (default: 0, for ever)")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    has_terminal = sys.stdin.isatty() and sys.stdout.isatty()
    if not has_terminal:
        say("up: no terminal here, so no teleop; the rest runs until Ctrl-C or SIGTERM")
    terminal = termios.tcgetattr(sys.stdin) if has_terminal else []
    with tempfile.TemporaryFile("w+", errors="replace") as log:
        team = Team(connection.from_arguments(args).arguments(), log if has_terminal else None)
        try:
            robot = ["--robot", "=".join(filter(None, map(str, args.robot)))] if args.robot else []
            packages = [word for package in args.package for word in ("--package", package)]
            team.start("sim", [*robot, *packages, *_flags(args, "world", "rtf", "drive")])
            team.start("pose-service", _flags(args, "shape", "size", "goals"))
            name = [args.robot[1]] if args.robot and args.robot[1] else []
            team.start("controller", [*name, "--laps", args.laps])
            if has_terminal:
                team.start("teleop", name)
            failed = team.watch(stop)
        finally:
            team.end()
            if has_terminal:
                _restore(terminal)
            _tell_last(log)
    return 1 if failed else 0


class Team:
    """The processes of one `up`. Their words go to `log`, or where ours go if that is None."""

    def __init__(self, where: list[str], log: IO[str] | None) -> None:
        self._where, self._log = where, log
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, verb: str, words: list[str]) -> None:
        """Start a verb. The teleop keeps the terminal; the others get no signals from it."""
        in_terminal = verb == "teleop"
        self._running[verb] = subprocess.Popen(
            [sys.executable, "-m", "holozen", verb, *words, *self._where],
            stdin=None if in_terminal else subprocess.DEVNULL,
            stdout=None if in_terminal else self._log,
            stderr=None if in_terminal else self._log,
            start_new_session=not in_terminal,
            preexec_fn=dies_with_parent(),
        )

    def watch(self, stop: threading.Event) -> bool:
        """Wait until told to stop, the teleop was quit, one failed, or all are done. Whether one failed."""
        while self._running and not stop.wait(LOOK):
            for verb, process in list(self._running.items()):
                code = process.poll()
                if code is None:
                    continue
                del self._running[verb]
                if code > 0:
                    self._say(f"up: {verb} failed with exit code {code}; ending the others")
                if code < 0:
                    self._say(f"up: {verb} was ended by signal {-code}; `holozen {verb}` starts it again")
                if code > 0 or verb == "teleop":
                    return code > 0
        return False

    def _say(self, text: str) -> None:
        """Tell a person, later if the terminal belongs to the teleop now."""
        if self._log:
            self._log.write(f"{text}\n")
        else:
            say(text)

    def end(self) -> None:
        """End what runs: first who commands the robot, then the sim."""
        sim = self._running.pop("sim", None)
        _end(self._running, GRACE)
        _end({"sim": sim} if sim else {}, SIM_GRACE)


def _end(running: dict[str, subprocess.Popen[bytes]], grace: float) -> None:
    for process in running.values():
        process.send_signal(signal.SIGTERM)
    deadline = time.monotonic() + grace
    for verb, process in running.items():
        try:
            process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            say(f"up: {verb} did not end within {grace} s and was killed")
            process.kill()
            process.wait()


def _flags(args: argparse.Namespace, *names: str) -> list[str]:
    return [word for name in names if getattr(args, name) for word in (f"--{name}", getattr(args, name))]


def _restore(terminal: list[Any]) -> None:
    """Leave the terminal as it was, also after a teleop that was killed."""
    with contextlib.suppress(OSError, termios.error):
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, terminal)
        print(SCREEN_LEFT, end="", flush=True)


def _tell_last(log: IO[str]) -> None:
    log.seek(0)
    for line in log.readlines()[-LAST_LINES:]:
        say(line.rstrip())
