"""`holozen up`: start sim, pose service, controller and teleop, each as a process of its own."""

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

from holozen import flags
from holozen.console import report
from holozen.process import dies_with_parent, stop_event
from holozen.transport import connection

GRACE = 1.2  # s for the commanding processes to stop the robot; the sim ends after them
SIM_GRACE = 0.5  # s
LOOK = 0.05  # s
SETTLED = 10.0  # s; a part that fails sooner at its first start has a wrong flag or file
PAUSES = (
    0.5,
    30.0,
)  # s before a part is started again: the first, doubled with each that does not settle, and the longest
LAST_LINES = 20
# Plain keys, no update under way, lines wrap, no reports of focus and pastes, a cursor, the main screen.
SCREEN_LEFT = "\x1b[<u\x1b[?2026l\x1b[?7h\x1b[?1004l\x1b[?2004l\x1b[?25h\x1b[?1049l"


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen up",
        description="Start the sim, the controller, the pose service, and the teleop if there is a terminal.",
        epilog="example: holozen up --robot my_bot.urdf.xacro",
    )
    add = parser.add_argument
    add("--robot", type=flags.robot_file, metavar="FILE[=NAME]",
        help="a xacro or URDF file, and the robot's name (default: hb_bot, with its keys at the root)")  # fmt: skip
    add("--world", metavar="FILE", help="an SDF file (default: gazebo.world)")
    add("--rtf", metavar="FACTOR", help="real-time factor; 0: as fast as possible (default: the world's)")
    add("--drive", metavar="planar_move", help="the drive of a robot whose file has none")
    add(
        "--package",
        action="append",
        default=[],
        metavar="NAME=DIR",
        help="the folder of package NAME, for $(find NAME)",
    )
    add("--allow-env", action="append", default=[], metavar="NAME",
        help="let the robot's file read this environment variable, as $(env NAME)")  # fmt: skip
    add("--shape", metavar="SHAPE",
        help="of the goals: square, triangle, rectangle, infinity or hexagon (default: square)")  # fmt: skip
    add("--size", metavar="M", help="the side of that shape (infinity: half its length) in m")
    add("--goals", metavar="FILE", help="goals from a file instead: x y theta a line")
    add("--laps", metavar="N", default="0", help="times round the goals; 0: for ever (default: 0)")
    add("--no-restart", action="store_true", help="do not start a part again that died (its robots would stand)")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    where = connection.from_arguments(args).arguments()
    stop = stop_event()
    has_terminal = sys.stdin.isatty() and sys.stdout.isatty()
    if not has_terminal:
        report("up: no terminal here, so no teleop; the rest runs until Ctrl-C or SIGTERM")
    terminal = termios.tcgetattr(sys.stdin) if has_terminal else []
    with tempfile.TemporaryFile("w+", errors="replace") as log:
        team = Team(where, log if has_terminal else None, not args.no_restart)
        try:
            robot = ["--robot", "=".join(filter(None, map(str, args.robot)))] if args.robot else []
            packages = [word for package in args.package for word in ("--package", package)]
            packages += [word for name in args.allow_env for word in ("--allow-env", name)]
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
            _report_last(log)
    return 1 if failed else 0


class Team:
    """The processes of one `up`. Their output goes to `log`, or to ours if that is None.

    If it `restarts`, a part that dies is started again, and moves no robot by that: a new sim has its robots stopped
    until `holozen release`, a new controller drives only after a resume. A new pose service would let a controller
    that waits for it go on, so that one is replaced too.
    """

    def __init__(self, where: list[str], log: IO[str] | None, restarts: bool) -> None:
        self._where, self._log, self._restarts = where, log, restarts
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._words: dict[str, list[str]] = {}
        self._started: dict[str, float] = {}  # s; of those that are to be started again: when
        self._pause: dict[str, float] = {}  # s; of those that were started again

    def start(self, verb: str, words: list[str]) -> None:
        """Start a verb. The teleop keeps the terminal; the others get no signals from it."""
        in_terminal = verb == "teleop"
        self._words.setdefault(verb, words)
        self._started[verb] = time.monotonic()
        self._running[verb] = subprocess.Popen(
            [sys.executable, "-m", "holozen", verb, *words, *self._where],
            stdin=None if in_terminal else subprocess.DEVNULL,
            stdout=None if in_terminal else self._log,
            stderr=None if in_terminal else self._log,
            start_new_session=not in_terminal,
            preexec_fn=dies_with_parent(),
        )

    def watch(self, stop: threading.Event) -> bool:
        """Wait until `stop` is set, the teleop was quit, a part failed for good, or all ended. Returns whether one
        failed.
        """
        while self._started and not stop.wait(LOOK):
            for verb in list(self._started):
                process = self._running.get(verb)
                if process is None:
                    if time.monotonic() >= self._started[verb]:
                        self.start(verb, [*self._words[verb], *STANDING.get(verb, ())])
                elif (code := process.poll()) is not None and not self._ended(verb, code):
                    return code > 0
        return False

    def _ended(self, verb: str, code: int) -> bool:
        """Report the end of a part, and have it started again if it died. Returns whether the others go on."""
        del self._running[verb]
        lived = time.monotonic() - self._started.pop(verb)
        if verb == "teleop":
            if code:
                self._report(f"up: teleop {_how(code)}; ending the others")
            return False
        if not code:
            return True
        if code > 0 and (not self._restarts or (lived < SETTLED and verb not in self._pause)):
            self._report(f"up: {verb} {_how(code)}; ending the others")
            return False
        if not self._restarts:
            self._report(f"up: {verb} {_how(code)}; `holozen {verb}` starts it again")
            return True
        pause = self._pause.get(verb, 0.0) if lived < SETTLED else 0.0
        self._pause[verb] = pause = min(max(PAUSES[0], 2 * pause), PAUSES[1])
        self._report(f"up: {verb} {_how(code)}; starting it again in {pause:g} s{AFTER[verb]}")
        again = [verb]
        if verb == "pose-service" and "controller" in self._running:
            _end({"controller": self._running.pop("controller")}, GRACE)
            again.append("controller")
        self._started |= dict.fromkeys(again, time.monotonic() + pause)
        return True

    def _report(self, text: str) -> None:
        """Report a line; after the end if the teleop owns the terminal."""
        if self._log:
            self._log.write(f"{text}\n")
        else:
            report(text)

    def end(self) -> None:
        """End the processes: first those that command the robot, then the sim."""
        sim = self._running.pop("sim", None)
        _end(self._running, GRACE)
        _end({"sim": sim} if sim else {}, SIM_GRACE)


STANDING = {"sim": ["--stopped"], "controller": ["--held"]}
AFTER = {
    "sim": ", its robots stopped until `holozen release`",
    "controller": "; it drives after `holozen controller --resume` or the teleop's r",
    "pose-service": "; the controller drives after `holozen controller --resume` or the teleop's r",
}


def _how(code: int) -> str:
    return f"failed with exit code {code}" if code > 0 else f"was ended by signal {-code}"


def _end(running: dict[str, subprocess.Popen[bytes]], grace: float) -> None:
    for process in running.values():
        process.send_signal(signal.SIGTERM)
    deadline = time.monotonic() + grace
    for verb, process in running.items():
        try:
            process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            report(f"up: {verb} did not end within {grace} s and was killed")
            process.kill()
            process.wait()


def _flags(args: argparse.Namespace, *names: str) -> list[str]:
    return [word for name in names if getattr(args, name) for word in (f"--{name}", getattr(args, name))]


def _restore(terminal: list[Any]) -> None:
    """Restore the terminal, also after the teleop was killed."""
    with contextlib.suppress(OSError, termios.error):
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, terminal)
        print(SCREEN_LEFT, end="", flush=True)


def _report_last(log: IO[str]) -> None:
    log.seek(0)
    for line in log.readlines()[-LAST_LINES:]:
        report(line.rstrip())
