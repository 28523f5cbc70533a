"""The command line. A verb's module is imported when the verb is named, so that each starts as fast as it can."""

import errno
import importlib
import os
import signal
import sys
import time
from types import ModuleType
from typing import Any

from holozen.process import Ending, interrupt_again

VERBS = {
    "up": "start the sim, the controller, the pose service, and the teleop in this terminal",
    "stop": "stop robots, all of them or some, until they are released",
    "release": "let stopped robots drive again",
    "sim": "simulate robots; pause, play, step, reset",
    "teleop": "drive a robot from the keyboard",
    "controller": "drive a robot to the goals of next_goal",
    "camera": "render what the cameras of robots see; the sim starts it",
    "view": "show the robots in a browser, and drive them from there",
    "pose-service": "answer next_goal and get_pose",
    "router": "run a Zenoh router",
    "ros2": "join ROS 2 nodes, by rmw_zenoh or a bridge to DDS",
    "secure": "init, add, renew, revoke, show",
    "run": "run a Python script that was written for ROS 2",
    "launch": "run a Python launch file that was written for ROS 2",
    "spawn": "put a robot or object into the running sim",
    "delete": "remove robots or objects from the sim",
    "list": "list the robots and objects in the sim, and where they are",
    "xacro": "expand a xacro file",
    "new": "robot, controller, package",
    "check": "report what is wrong with a robot file",
    "topic": "list, info, type, find, echo, pub, hz, bw, delay, plot",
    "service": "list, type, find, info, call",
    "action": "list, type, info, send_goal",
    "node": "list, info",
    "param": "list, get, set, describe, dump, load",
    "tf": "echo",
    "doctor": "diagnose problems on this machine and among the nodes, and suggest fixes",
    "graph": "show which nodes write, read and serve which keys",
    "completion": "print a completion script for bash, zsh or fish",
    "interface": "list, show, proto",
    "record": "record keys into a bag (MCAP)",
    "replay": "publish the messages of a bag again, at their times",
    "bag": "info, plot, record, play",
    "plot": "draw fields of live messages in the terminal",
    "map": "draw the robots, their paths and their goals in the terminal",
}
MODULES = {"graph": "node", "list": "robot", "delete": "robot", "map": "plot", "release": "stop"}
"""Verbs whose module has another name."""
NOUNS = ("secure", "new", "topic", "service", "action", "node", "param", "tf", "interface", "bag")  # a verb follows
_DRAWS = "`holozen view` shows robots in a browser, `holozen map` and `holozen plot` draw in the terminal"
_TYPES = "`holozen interface` shows messages, services and actions"
ELSEWHERE = {
    "rviz": _DRAWS, "rviz2": _DRAWS, "rqt": _DRAWS, "foxglove": _DRAWS, "rqt_plot": _DRAWS,
    "pkg": "`holozen new package` writes one; `--package NAME=DIR` gives the folder of a package",
    "control": "the sim moves joints itself, by the key joint_command", "multicast": "write `holozen doctor`",
    **dict.fromkeys(("tf2_echo", "tf_echo"), "write `holozen tf echo SOURCE TARGET`"), "tf2": "write `holozen tf`",
    "spawn_model": "write `holozen spawn`", "spawn_entity": "write `holozen spawn`",
    "spawn_entity.py": "write `holozen spawn`", "gzserver": "write `holozen sim`",
    "check_urdf": "write `holozen check`",
    "build": "nothing is built here: packages are read as they are", "colcon": "nothing is built here",
    "catkin_make": "nothing is built here", "view_frames": "`holozen view` draws the frames",
    "rqt_graph": "write `holozen graph`", "wtf": "write `holozen doctor`", "msg": _TYPES, "srv": _TYPES,
    "gazebo": "write `holozen sim`", "gz": "write `holozen sim`", "teleop_twist_keyboard": "write `holozen teleop`",
    "start": "write `holozen up`", "down": "Ctrl-C ends `holozen up`; `holozen stop` stops robots",
    "daemon": "there is no daemon here, and none is needed",
    "lifecycle": "there are no lifecycle nodes here", "component": "there are no components here",
    "rostopic": "write `holozen topic`", "rosservice": "write `holozen service`", "rosnode": "write `holozen node`",
    "rosparam": "write `holozen param`", "rosbag": "write `holozen bag`", "rosrun": "write `holozen run`",
    "roslaunch": "write `holozen launch`", "roscore": "none is needed; `holozen up` starts a robot",
    "call": "write `holozen service call`",
    **{verb: f"write `holozen sim {verb}`" for verb in ("pause", "play", "step", "reset")},
    **{verb: f"write `holozen topic {verb}`" for verb in ("echo", "pub", "hz", "bw", "delay")},
}  # fmt: skip
"""Verbs of ROS's tools and other likely guesses, with what to use instead."""
EXTRAS = (
    "PIL", "cryptography", "foxglove", "lz4", "matplotlib", "mcap", "mujoco", "numpy", "pybullet", "transforms3d",
    "viser", "websockets", "xacro", "zstandard",
)  # fmt: skip
"""Libraries that only some verbs need."""
EXTRA_OF = {"cryptography": "secure", "foxglove": "foxglove", "mujoco": "mujoco"}
"""Library that a flag of several verbs needs -> the extra that installs it; others are in the extra of their verb."""
FOR_SCRIPTS = ("run", "launch")
"""Verbs that run code of users, whose arrays may be large."""
SERVICES = ("sim", "teleop", "controller", "camera", "view", "pose-service")
SERVICE_VERBS = {"sim": dict.fromkeys(("pause", "play", "step", "reset"), "simulation")}
"""Service -> verbs that may follow its name -> their modules."""


began = 0.0  # s, monotonic: when the verb was called, before it was loaded, which may take long


def main(argv: list[str] | None = None) -> int:
    """Run one verb; returns the exit code (0 good, 1 failed, 2 wrong usage). Without `argv` it ends the process."""
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
            _ = sys.stdout and sys.stdout.flush()  # so that a closed pipe raises here, not at the interpreter's end
    except KeyboardInterrupt:
        return 130
    except RuntimeError as error:  # Python 3.11 wraps an interrupt while it creates a class, as in an import
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        return 130
    except BrokenPipeError:
        # The reader, such as head, has closed the pipe: nothing more may be written, not even at the interpreter's end.
        _drop_output()
        return 0
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename:
            raise
        from holozen.console import report

        _drop_output()
        report(f"holozen: cannot write the output: {error.strerror}")
        return 1


def _drop_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


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
            report(f"holozen ros2: this joins ROS 2 nodes; write `holozen {after_ros2}`; see `holozen ros2 --help`")
            return 2
        instead = ELSEWHERE.get(words[0])
        hint = f"; {instead}" if instead else suggest(words[0], VERBS)
        report(f"holozen: no verb {words[0]!r}{hint}; `holozen --help` lists the verbs")
        return 2
    return _run(words[0], words[1:])


def _run(verb: str, words: list[str]) -> int:
    from holozen.console import Failure, report

    if verb not in FOR_SCRIPTS:
        # numpy's threads spin for 0.05 s of processor time as it is loaded, and save none: the arrays here are small.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        return int(command(verb).main(words))
    except Failure as error:
        report(f"holozen {' '.join([verb, *words[: verb in NOUNS]])}: {error}")
        return 1
    except ModuleNotFoundError as error:  # optional libraries are imported where they are used
        name = (error.name or "").partition(".")[0]
        if name not in EXTRAS:
            raise
        extra = EXTRA_OF.get(name, verb)
        report(f"holozen {verb} needs {name}; in the checkout of holozen, run: pip install -e '.[{extra}]'")
        return 1


def command(verb: str) -> Any:
    """The implementation of a verb, with `main(argv)` and `parser()`: a Verb, a Noun, or the module of a service."""
    if verb in SERVICE_VERBS:
        from holozen.cli.verb import Service

        return Service(verb, _service(verb), SERVICE_VERBS[verb])
    if verb in SERVICES:
        return _service(verb)
    module = importlib.import_module(f"holozen.cli.{MODULES.get(verb, verb)}")
    return getattr(module, "VERBS", {}).get(verb, module)


def _service(verb: str) -> ModuleType:
    """The module of a service: `holozen.sim` when installed, `services.sim` in the bare source tree."""
    name = verb.replace("-", "_")
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
