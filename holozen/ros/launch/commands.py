"""The few programs whose output a launch file may use: xacro, which is ours, and cat."""

import shlex
from pathlib import Path

from holozen.robot.xacro import expand_xacro, read_text
from holozen.ros import packages
from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.text import LaunchError

OURS = ("xacro", "ros2", "gazebo", "gzserver", "gzclient", "gz", "ign", "rviz2")
"""Programs that ROS's launch files name, and that are never run."""
_IGNORED = ("--inorder", "-i")  # what xacro takes, and does anyway


def output(context: LaunchContext, command: str) -> str:
    """What a command writes. Raises LaunchError, and RobotError for the file."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise LaunchError(f"Command {command!r}: {error}") from None
    for start in (["ros2", "run", "xacro"], ["python3", "-m"]):
        if words[: len(start)] == start:
            del words[: len(start)]
    name = Path(words[0]).name if words else ""
    if name == "cat" and len(words) == 2:
        return _kept(context, read_text(Path(words[1])), words[1:])
    if name not in ("xacro", "xacro.py"):
        raise LaunchError(f"Command {command!r:.200}: only `xacro FILE name:=value ...` and `cat FILE` are run here")
    words = [word for word in words[1:] if word not in _IGNORED]
    files = [word for word in words if ":=" not in word]
    if len(files) != 1 or files[0].startswith("-"):
        raise LaunchError(f"Command {command!r:.200}: write `xacro FILE name:=value ...`")
    values = [word for word in words if ":=" in word]
    pairs = dict(word.split(":=", 1) for word in values)
    return _kept(context, expand_xacro(Path(files[0]), pairs, packages.given), [files[0], *values])


def _kept(context: LaunchContext, text: str, origin: list[str]) -> str:
    """The text; where it comes from is remembered, for errors that name lines and for meshes beside it."""
    context.origins[text.strip()] = origin
    return text
