"""The command line. A verb's module is imported when the verb is named, so that each starts as fast
as it can.
"""

import errno
import importlib
import os
import resource
import signal
import sys
import time
from types import ModuleType
from typing import Any

from holozen.cli import table
from holozen.process import Ending, interrupt_again

VERBS = table.VERBS
NOUNS = tuple(name for name, row in VERBS.items() if row.is_noun)  # a verb follows
_DRAWS = (
    "`holozen view` shows robots in a browser, `holozen map` and `holozen plot` draw in the "
    "terminal"
)
_TYPES = "`holozen interface` shows messages, services and actions"
ELSEWHERE = {
    "rviz": _DRAWS,
    "rviz2": _DRAWS,
    "rqt": _DRAWS,
    "foxglove": _DRAWS,
    "rqt_plot": _DRAWS,
    "pkg": "`holozen new package` writes one; `--package NAME=DIR` gives the folder of a package",
    "control": "the sim moves joints itself, by the key joint_command",
    "multicast": "write `holozen doctor`",
    **dict.fromkeys(("tf2_echo", "tf_echo"), "write `holozen tf echo SOURCE TARGET`"),
    "tf2": "write `holozen tf`",
    "spawn_model": "write `holozen spawn`",
    "spawn_entity": "write `holozen spawn`",
    "spawn_entity.py": "write `holozen spawn`",
    "gzserver": "write `holozen sim`",
    "check_urdf": "write `holozen check`",
    "build": "nothing is built here: packages are read as they are",
    "colcon": "nothing is built here",
    "catkin_make": "nothing is built here",
    "view_frames": "`holozen view` draws the frames",
    "rqt_graph": "write `holozen graph`",
    "wtf": "write `holozen doctor`",
    "msg": _TYPES,
    "srv": _TYPES,
    "gazebo": "write `holozen sim`",
    "gz": "write `holozen sim`",
    "teleop_twist_keyboard": "write `holozen teleop`",
    "start": "write `holozen up`",
    "down": "Ctrl-C ends `holozen up`; `holozen stop` stops robots",
    "daemon": "there is no daemon here, and none is needed",
    "lifecycle": "there are no lifecycle nodes here",
    "component": "there are no components here",
    "rostopic": "write `holozen topic`",
    "rosservice": "write `holozen service`",
    "rosnode": "write `holozen node`",
    "rosparam": "write `holozen param`",
    "rosbag": "write `holozen bag`",
    "rosrun": "write `holozen run`",
    "roslaunch": "write `holozen launch`",
    "roscore": "none is needed; `holozen up` starts a robot",
    "call": "write `holozen service call`",
    **{verb: f"write `holozen sim {verb}`" for verb in ("pause", "play", "step", "reset")},
    **{verb: f"write `holozen topic {verb}`" for verb in ("echo", "pub", "hz", "bw", "delay")},
}
"""Verbs of ROS's tools and other likely guesses, with what to use instead."""
LEAST = {
    resource.RLIMIT_NOFILE: (64, "few open files", "ulimit -n 64"),
    resource.RLIMIT_AS: (4_000_000 << 10, "little memory", "ulimit -v 4000000"),
}
"""By limit: what a verb needs, what it lacks below that, and the command of the shell that raises
it.
"""
SHORTAGES = ("can't start new thread", "failed to map segment", "cannot allocate memory")
EXTRAS = (
    "PIL",
    "cryptography",
    "lz4",
    "matplotlib",
    "mcap",
    "mujoco",
    "numpy",
    "pybullet",
    "transforms3d",
    "viser",
    "websockets",
    "xacro",
    "zstandard",
)
"""Libraries that only some verbs need."""
FOR_SCRIPTS = ("run", "launch")
"""Verbs that run code of users, whose arrays may be large."""

began = 0.0  # s, monotonic: when the verb was called, before it was loaded, which may take long


def main(argv: list[str] | None = None) -> int:
    """Run one verb; returns the exit code (0 good, 1 failed, 2 wrong usage). Without `argv` it ends
    the process.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # closed by the parent process
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115 - kept as long as the process
    if argv is not None:
        return _guarded(argv)
    if sys.stdout.errors == "strict":  # names may have letters that the terminal's encoding lacks
        sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    ending = Ending(of_verb=True)
    sys.unraisablehook = interrupt_again
    code: int | str | None
    try:
        code = _guarded(sys.argv[1:])
    except SystemExit as end:  # of argparse, or of a script
        code = end.code
    try:
        ending.leave(code)
    except KeyboardInterrupt:  # just before it ignores signals
        ending.leave(code)


def _guarded(words: list[str]) -> int:
    try:
        try:
            if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:  # see __main__
                signal.signal(signal.SIGINT, signal.default_int_handler)
            return _main(words)
        finally:
            # so that a closed pipe raises here, not at the interpreter's end
            _ = sys.stdout and sys.stdout.flush()
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # The reader, such as head, has closed the pipe: nothing more may be written, not even at
        # the interpreter's end.
        _discard_output()
        return 0
    except (OSError, MemoryError, RuntimeError, ImportError) as error:
        # Python 3.11 wraps one while it creates a class
        if isinstance(error.__cause__, KeyboardInterrupt):
            return 130
        if isinstance(error, OSError) and error.errno == errno.ENOSPC and not error.filename:
            _discard_output()
            print(f"holozen: cannot write the output: {error.strerror}", file=sys.stderr)
        elif _is_shortage(error):
            lacked = next(iter(str(error).splitlines()), "memory")
            print(
                f"holozen: the machine is at its limit: {lacked}; see `ulimit -a`", file=sys.stderr
            )
        else:
            raise
        return 1


def _is_shortage(error: BaseException) -> bool:
    """Whether the machine, or a limit of the shell, is the cause."""
    if isinstance(error, OSError):
        return error.errno in (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN)
    return isinstance(error, MemoryError) or any(text in str(error) for text in SHORTAGES)


def _lack() -> str:
    """Which limit of the shell is too low, with the command that raises it, or "". Where this
    process may raise it, it
    does: Zenoh aborts where it gets no thread or no memory.
    """
    for limit, (need, lacks, command) in LEAST.items():
        least, most = resource.getrlimit(limit)
        if least == resource.RLIM_INFINITY or least >= need:
            continue
        if most != resource.RLIM_INFINITY and most < need:
            return f"this shell allows too {lacks}; `{command}` allows enough"
        resource.setrlimit(limit, (need, most))
    return ""


def _discard_output() -> None:
    from holozen.console import discard

    discard(sys.stdout.fileno())


def _main(words: list[str]) -> int:
    global began
    began = time.monotonic()
    if not words or words[0] in ("-h", "--help"):
        print(_help())
        return 0 if words else 2
    if words[0] in ("-V", "--version"):
        from importlib.metadata import version

        print(version("holozen"))
        return 0
    if words[0] == "help":
        return _explain(words[1:])
    if words[0] == "__complete":
        from holozen.cli.completion import complete

        return complete(words[1:], VERBS, command)
    after_ros2 = words[1] if words[0] == "ros2" and words[1:] else ""
    if after_ros2 in ELSEWHERE:
        words = words[1:]
    if words[0] not in VERBS or after_ros2 in VERBS:
        from holozen.console import report
        from holozen.suggest import suggest

        if after_ros2 in VERBS:
            report(
                f"holozen ros2: this joins ROS 2 nodes; write `holozen {after_ros2}`; see "
                "`holozen ros2 --help`"
            )
            return 2
        instead = ELSEWHERE.get(words[0])
        hint = f"; {instead}" if instead else suggest(words[0], VERBS)
        report(f"holozen: no verb {words[0]!r}{hint}; `holozen --help` lists the verbs")
        return 2
    return _run(words[0], words[1:])


def _explain(words: list[str]) -> int:
    """`holozen help`, `holozen help VERB` and `holozen help network`."""
    if words == ["network"]:
        from holozen.flags import Parser
        from holozen.transport import connection

        parser = Parser(usage="holozen VERB ... [connection flags]", add_help=False)
        connection.add_arguments(parser)
        print(parser.format_whole_help(), end="")
        return 0
    return _main([*words, "--help"])


def _run(verb: str, words: list[str]) -> int:
    from holozen.console import Failure, report

    if verb != "stop" and (lack := _lack()):  # a stop is tried with whatever there is
        report(f"holozen {verb}: {lack}")
        return 1
    if verb not in FOR_SCRIPTS:
        # numpy's threads spin for 0.05 s of processor time as it is loaded, and save none: the
        # arrays here are small.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        return int(command(verb).main(words))
    except Failure as error:
        report(f"holozen {' '.join([verb, *words[: verb in NOUNS]])}: {error}")
        return 1
    except ModuleNotFoundError as error:  # optional libraries are imported where they are used
        if lost := _lost(error):
            report(f"holozen {verb}: {_missing(lost)}")
            return 1
        name = (error.name or "").partition(".")[0]
        if name not in EXTRAS:
            raise
        extra = table.EXTRA_OF.get(name, VERBS[verb].extra or verb)
        from holozen.install import advice

        report(f"holozen {verb} needs {name}; {advice(extra)}")
        return 1


def command(verb: str) -> Any:
    """The implementation of a verb, with `main(argv)` and `parser()`: a Verb, a Noun, or the module
    of a service. Raises Failure if its extension is not there.
    """
    row = VERBS[verb]
    module = _module(row)
    if row.verbs:
        from holozen.cli.verb import Service

        return Service(verb, module, row.verbs)
    return getattr(module, "VERBS", {}).get(verb, module)


def _module(row: table.Row) -> ModuleType:
    """The module of a verb: that of a service is `holozen.sim` when installed, `services.sim` in
    the source tree.

    Raises Failure if an extension is not there.
    """
    try:
        return importlib.import_module(row.module)
    except ModuleNotFoundError as error:
        lost = _lost(error)
        if not lost:
            raise
        if error.name == row.package and (found := _in_the_tree(row)):
            return found
    from holozen.console import Failure

    raise Failure(_missing(lost))


def _in_the_tree(row: table.Row) -> ModuleType | None:
    """The module of a service in the source tree; None if there is none."""
    name = row.module.replace("holozen.", "services.", 1)
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if not f"{name}.".startswith(f"{error.name}."):
            raise
        return None


def _lost(error: ModuleNotFoundError) -> str:
    """The name of the package of verbs that is not there; empty if something else is missing."""
    top, _, within = (error.name or "").partition(".")
    name = within.partition(".")[0]
    if top != "holozen" or all(row.package != f"holozen.{name}" for row in VERBS.values()):
        return ""
    # without a file, it is a folder that holds byte code alone
    there = sys.modules.get(f"holozen.{name}")
    return "" if there and there.__file__ else name


def _missing(extension: str) -> str:
    return (
        f"it needs the extension {extension}, the folder extensions/{extension}, which is not here"
    )


def _help() -> str:
    rows = "\n".join(f"  {verb:<13} {row.about}" for verb, row in VERBS.items())
    return (
        "usage: holozen VERB ...\n\nDrive and simulate holonomic robots over "
        f"Zenoh.\n\n{rows}\n\nEach verb has --help; `holozen help "
        "network` has the flags of the connection."
    )
