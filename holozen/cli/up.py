"""`holozen up`: starts sim, pose service, controller and teleop, each as a process of its own."""

import argparse
import contextlib
import io
import os
import signal
import subprocess
import sys
import termios
import threading
import time
from typing import IO, TYPE_CHECKING, Any

from holozen import engines, flags
from holozen.cli import command
from holozen.cli.table import ROUTER
from holozen.cli.verb import Verb, by_name
from holozen.console import Failure, report
from holozen.process import dies_with_parent, stop_event
from holozen.suspension import suspend_children_too
from holozen.system import memory_file
from holozen.transport import connection
from holozen.transport.loopback import is_taken
from holozen.wire import resume_command

if TYPE_CHECKING:
    from pathlib import Path

GRACE = 1.2  # s for the commanding processes to stop the robot; the sim ends after them
SIM_GRACE = 0.5  # s
LOOK = 0.05  # s
SETTLED = 10.0  # s; a part that fails sooner at its first start has a wrong flag or file
# s before a part is started again: the first, doubled until it settles, and the longest
PAUSES = (0.5, 30.0)
LAST_LINES = 20
# Plain keys, no synchronized update, line wrapping, no reports of focus and pastes, a visible
# cursor, the main screen.
SCREEN_LEFT = "\x1b[<u\x1b[?2026l\x1b[?7h\x1b[?1004l\x1b[?2004l\x1b[?25h\x1b[?1049l"


def run(args: argparse.Namespace) -> int:
    """Start the parts and watch them until Ctrl-C, or until one fails for good."""
    if args.shards > 1 and not all(name for _, name in args.robot):
        args.error("--shards gives each robot to the shard of its name: use --robot FILE=NAME")
    has_terminal = sys.stdin.isatty() and sys.stdout.isatty()
    parts = _parts(args, has_terminal)
    engine = engines.choose(args.engine)
    _read_files(args)
    where, router = _meeting(connection.from_arguments(args))
    stop = stop_event()
    suspend_children_too()
    if "teleop" in parts and args.view is not None and (where.private or where.secure):
        # The teleop's screen would hide it, and other users can see the arguments of a process.
        args.error(
            "--view cannot show the token of its page beside the teleop: run `holozen view` in "
            "another terminal"
        )
    if not has_terminal:
        report("up: no terminal here, so no teleop; the rest runs until Ctrl-C or SIGTERM")
    elif args.engine == flags.AUTO:  # the sim says it too, where the teleop's screen hides it
        report(f"up: the engine is {engine}")
    terminal = termios.tcgetattr(sys.stdin) if has_terminal else []
    with _log() if has_terminal else contextlib.nullcontext() as log:
        team = Team(where.arguments(), log, not args.no_restart, _name(args))
        try:
            for part, words in (({ROUTER: router} if router else {}) | parts).items():
                team.start(part, words)
            failed = team.watch(stop)
        finally:
            team.end()
            if log:
                _restore(terminal)
                _report_last(log)
    return 1 if failed else 0


def _parts(args: argparse.Namespace, has_terminal: bool) -> dict[str, list[str]]:
    """The parts to start and their arguments. Exits with code 2 if a part would refuse one."""
    robots = [
        word
        for robot in args.robot
        for word in ("--robot", "=".join(filter(None, map(str, robot))))
    ]
    name = list(filter(None, [_name(args)]))
    sources = [
        word for package, folder in args.package for word in ("--package", f"{package}={folder}")
    ]
    sources += [word for variable in args.allow_env for word in ("--allow-env", variable)]
    pace, goals = _flags(args, "rtf"), _flags(args, "shape", "size", "goals")
    for verb, words in (("sim", pace), ("pose-service", goals)):
        if words:
            parser = command(verb).parser()
            parser.prog = f"holozen {args.verb}"
            parser.parse_args(words)
    sim = [*robots, *sources, *pace, *_flags(args, "world", "drive", "engine"), *_state(args.state)]
    shards = [f"{shard}/{args.shards}" for shard in range(1, args.shards + 1)]
    parts = (
        {f"sim {shard}": [*sim, "--shard", shard] for shard in shards}
        if args.shards > 1
        else {"sim": sim}
    )
    driven = args.shards == 1 or args.robot  # else there is no robot yet
    if driven:
        parts |= {"pose-service": goals, "controller": [*name, "--laps", str(args.laps)]}
    if args.view is not None:
        parts["view"] = ["--port", str(args.view)]
    if driven and has_terminal:
        parts["teleop"] = name
    return parts


def _read_files(args: argparse.Namespace) -> None:
    """Read the files that parts are given, and check what they hold, so that no part starts beside
    one that cannot. Raises Failure.
    """
    if args.goals:
        try:
            command("pose-service").read_goals(args.goals)
        except ValueError as error:
            raise Failure(str(error)) from None
    if not (args.world or args.robot):
        return
    from holozen.robot.errors import RobotError
    from holozen.robot.files import loading, reader
    from holozen.robot.files.sdf_world import load_world
    from holozen.robot.requirements import drivable, require_names

    reader.start(loading)
    try:
        if args.world:
            load_world(args.world, dict(args.package))
        models = []
        for path, name in args.robot:
            model = loading.load(path, packages=dict(args.package), allow_env=args.allow_env)
            models.append((drivable(model, path, args.drive), name))
        require_names(models)
    except RobotError as error:
        raise Failure(str(error)) from None
    finally:
        reader.server.close()


def _name(args: argparse.Namespace) -> str:
    """The name of the robot that the controller drives; empty for the one at the root."""
    return (args.robot and args.robot[0][1]) or ""


def _meeting(where: connection.Connection) -> tuple[connection.Connection, list[str]]:
    """The connection of the parts, and the flags of a router for them; empty if they need none, or
    one runs.
    """
    if (
        not where.secure
        or where.connect is not None
        or not os.path.isdir(os.path.join(where.secure, ROUTER))
    ):
        return where, []
    listen = where.listen or (where.address,)
    clients = where._replace(listen=None, connect=(connection.from_here(listen[0]),))
    if is_taken(listen[0]):
        report(f"up: something listens at {listen[0]} already; assuming that it is the router")
        return clients, []
    return clients, where._replace(mode="router", listen=listen).arguments()


class Team:
    """The processes of one `up`. Their output goes to `log`, or to that of this process if it is
    None.

    If it `restarts`, a part that dies is started again in a way that moves no robot: the robots of
    a new sim are stopped until `holozen release`, and a new controller drives only after a resume.
    A new pose service would let a waiting controller drive on, so the controller is replaced too.
    """

    def __init__(
        self, where: list[str], log: IO[str] | None, restarts: bool, robot: str = ""
    ) -> None:
        self._where, self._log, self._restarts, self._robot = where, log, restarts, robot
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._words: dict[str, list[str]] = {}
        # s; in the future for a part that is to be started again
        self._started: dict[str, float] = {}
        # s before the last restart of each part that was restarted
        self._pause: dict[str, float] = {}

    def start(self, verb: str, words: list[str]) -> None:
        """Start a part, called by its verb, or `sim K/N`. The teleop keeps the terminal, and the
        others get no signals from it.
        """
        in_terminal = verb == "teleop"
        self._words.setdefault(verb, words)
        self._started[verb] = time.monotonic()
        self._running[verb] = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "holozen",
                _verb(verb),
                *words,
                *([] if verb == ROUTER else self._where),
            ],
            stdin=None if in_terminal else subprocess.DEVNULL,
            stdout=None if in_terminal else self._log,
            stderr=None if in_terminal else self._log,
            start_new_session=not in_terminal,
            preexec_fn=dies_with_parent(),
        )

    def watch(self, stop: threading.Event) -> bool:
        """Wait until `stop` is set, the teleop was quit, a part failed for good, or all ended.
        Returns whether one failed.
        """
        while self._started and not stop.wait(LOOK):
            for verb in list(self._started):
                process = self._running.get(verb)
                if process is None:
                    if time.monotonic() >= self._started[verb]:
                        self.start(verb, [*self._words[verb], *RESTART_FLAGS.get(_verb(verb), ())])
                elif (code := process.poll()) is not None and not self._ended(verb, code):
                    return code > 0
        return False

    def _ended(self, verb: str, code: int) -> bool:
        """Report the end of a part, and schedule its restart if it died. Returns whether the others
        go on.
        """
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
            self._report(f"up: {verb} {_how(code)}; `holozen {_again(verb)}` starts it again")
            return True
        pause = self._pause.get(verb, 0.0) if lived < SETTLED else 0.0
        self._pause[verb] = pause = min(max(PAUSES[0], 2 * pause), PAUSES[1])
        self._report(
            f"up: {verb} {_how(code)}; starting it again in {pause:g} s{_after(verb, self._robot)}"
        )
        again = [verb]
        if verb == "pose-service" and "controller" in self._running:
            _end({"controller": self._running.pop("controller")}, GRACE)
            again.append("controller")
        self._started |= dict.fromkeys(again, time.monotonic() + pause)
        return True

    def _report(self, text: str) -> None:
        """Report a line: at the end of `up` if the teleop owns the terminal."""
        if self._log:
            self._log.write(f"{text}\n")
        else:
            report(text)

    def end(self) -> None:
        """End the processes: first those that command the robot, then the sims, then the router
        between them.
        """
        sims = {
            verb: self._running.pop(verb) for verb in list(self._running) if _verb(verb) == "sim"
        }
        router = {verb: self._running.pop(verb) for verb in (ROUTER,) if verb in self._running}
        for parts, grace in ((self._running, GRACE), (sims, SIM_GRACE), (router, SIM_GRACE)):
            _end(parts, grace)


RESTART_FLAGS = {"sim": ["--stopped"], "controller": ["--held"]}
AFTER_RESTART = {
    "sim": ", its robots stopped until `holozen release`",
    "view": "",
    "router": "; robots stand still until then",
    "controller": "; it drives after `{resume}` or the teleop's r",
    "pose-service": "; the controller drives after `{resume}` or the teleop's r",
}


def _verb(part: str) -> str:
    return part.partition(" ")[0]


def _again(part: str) -> str:
    return part if part == _verb(part) else part.replace(" ", " --shard ")


def _after(part: str, robot: str) -> str:
    if part == _verb(part):
        return AFTER_RESTART[part].format(resume=resume_command(robot))
    return "; the robots that were spawned in this shard are gone, those of the others go on"


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
    return [
        word
        for name in names
        if getattr(args, name)
        for word in (f"--{name}", str(getattr(args, name)))
    ]


def _state(given: str | None) -> list[str]:
    """The sim's flags for the folder of its software stops; none without a home."""
    from holozen.command.stop_files import default_folder  # once it is about to start parts

    folder = given or default_folder()
    return ["--state", str(folder)] if folder else []


def _restore(terminal: list[Any]) -> None:
    """Restore the terminal: a teleop that was killed has not done so."""
    with contextlib.suppress(OSError, termios.error):
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, terminal)
        print(SCREEN_LEFT, end="", flush=True)


def _log() -> IO[str]:
    """A file for what parts report while the teleop has the screen: in memory, since a root that is
    read-only has no place for it.
    """
    return io.TextIOWrapper(memory_file("up"), errors="replace")


def _report_last(log: IO[str]) -> None:
    log.seek(0)
    for line in log.readlines()[-LAST_LINES:]:
        report(line.rstrip())


def _robot(text: str) -> "tuple[Path, str]":
    path, name = flags.robot_file(text)
    return flags.file(str(path)), name


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "--robot",
        type=_robot,
        action="append",
        default=[],
        metavar="FILE[=NAME]",
        help="a xacro or URDF file, and the robot's name (default: hb_bot, with its keys at the "
        "root);"
        " of several the controller drives the first",
    )
    add("--name", "-model", "-entity", action=flags.Instead, advice=flags.NAMED)
    add("--world", type=flags.file, metavar="FILE", help="an SDF file (default: gazebo.world)")
    add(
        "--rtf",
        metavar="FACTOR",
        help="real-time factor; 0: as fast as possible (default: the world's)",
    )
    add("--drive", choices=flags.DRIVES, help=flags.DRIVE)
    add("--engine", choices=(flags.AUTO, *flags.ENGINES), default=flags.AUTO, help=flags.ENGINE)
    flags.add_robot_sources(parser)
    add(
        "--shape",
        metavar="SHAPE",
        help="shape of the goals: square, triangle, rectangle, infinity or hexagon (default: "
        "square)",
    )
    add(
        "--size",
        metavar="M",
        help="side length of the shape in metres (for infinity: half its length)",
    )
    add(
        "--goals",
        type=flags.file,
        metavar="FILE",
        help="goals from a file instead: x y theta per line",
    )
    add(
        "--laps",
        type=flags.count(),
        metavar="N",
        default=0,
        help="number of laps around the goals; 0: for ever (default: 0)",
    )
    add(
        "--view",
        nargs="?",
        type=flags.port,
        const=8080,
        metavar="PORT",
        help="show the robots in a browser too, at http://127.0.0.1:8080/ or another port (0: a "
        "free one)",
    )
    add(
        "--shards",
        type=flags.count(1),
        default=1,
        metavar="N",
        help="run N sims and divide the robots among them by name (default: 1)",
    )
    add(
        "--state",
        metavar="DIR",
        help="folder where software stops are kept (default: HOLOZEN_STATE, else "
        "~/.local/state/holozen)",
    )
    add("--no-restart", action="store_true", help="do not restart parts that die")


ABOUT = (
    "start the sim, the controller, the pose service, and the teleop if there is a terminal; with "
    "--secure a router"
    " too, unless --connect names one"
)
VERBS = by_name(Verb("up", ABOUT, "--robot my_bot.urdf.xacro", _arguments, run, json=None))
