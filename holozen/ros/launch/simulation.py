"""Our sim in the place of Gazebo, and robots that are put into it."""

import contextlib
import re
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from holozen import data
from holozen.flags import nearest
from holozen.robot.errors import RobotError
from holozen.ros import packages
from holozen.ros.launch.context import LaunchContext, Program
from holozen.ros.launch.entity import Action, Entities
from holozen.ros.launch.text import LaunchError, Text, text
from holozen.tell import say

ROOT = "/"  # the namespace of a robot that has none: its keys are cmd_vel and odom
PATIENCE = "60"  # s for the sim to start
KEPT = {f"-{letter}": f"-{letter}" for letter in "xyzRPY"} | {
    "-entity": "--name", "-name": "--name", "-model": "--name", "-file": "-file", "-robot_namespace": "--namespace",
    "-timeout": "--timeout", "-spawn_service_timeout": "--timeout",
}  # fmt: skip
"""Flags of spawn_entity.py and of ros_gz_sim's create -> those of `holozen spawn`."""
TEXTS = ("-topic", "-string", "-param")  # where else the robot's text may be
DROPPED = {
    "-reference_frame": 1, "-gazebo_namespace": 1, "-world": 1, "-J": 2, "-wait": 1, "-unpause": 0,
    "-package_to_model": 0, "-b": 0, "-bond": 0, "-allow_renaming": 1, "-urdf": 0, "-sdf": 0,
}  # fmt: skip
"""Flags that change nothing here, and how many words follow each."""
_MENTIONED = re.compile(r"package://([\w-]+)")


def ours(context: LaunchContext, verb: str, *words: str) -> list[str]:
    """The words that start a verb of ours where this launch meets."""
    flags = context.flags
    before, after = (flags, []) if verb == "run" else ([], flags)  # what follows a script's name is the script's
    return [sys.executable, "-m", "holozen", verb, *before, *words, *after]


def given(*names: str) -> list[str]:
    """The flags that name the packages given, and those with these names if they are found."""
    found = dict(packages.given)
    for name in names:
        with contextlib.suppress(RobotError):
            found[name] = packages.find(name)
    return [word for name, folder in found.items() for word in ("--package", f"{name}={folder}")]


class Simulation(Action):
    """Starts our sim, once, without a robot."""

    def __init__(self, world: Text = "", target: Action | None = None) -> None:
        super().__init__()
        self.world, self.target = world, target or self

    def execute(self, context: LaunchContext) -> Entities | None:
        """Start it. The launch ends when it does."""
        if context.simulates:
            return None
        context.simulates = True
        words = ours(context, "sim", "--empty", "--world", _world(text(context, self.world)), *given())
        say("launch: `holozen sim` stands in for Gazebo; `holozen map` in another terminal shows what is in it")
        context.stage.start(self.target, Program("sim", words, environment=context.environment, required=True))
        return None


def _world(given: str) -> str:
    """The world file of that name; ours for the names of Gazebo's own."""
    stem = Path(given).stem or "empty"
    ours = data.find("worlds", f"{stem}.world")
    return str(ours) if not Path(given).is_file() and ours.is_file() else given


def gz_world(args: str) -> str:
    """The world among the words of `gz sim`, such as `-r -v 4 empty.sdf`. Raises LaunchError."""
    try:
        words = shlex.split(args)
    except ValueError as error:
        raise LaunchError(f"gz_args {args!r}: {error}") from None
    valued = ("-v", "--verbose", "--seed", "-z", "--iterations", "--physics-engine", "--render-engine")
    files = [
        word
        for before, word in zip(["", *words], words, strict=False)
        if not word.startswith("-") and not (before in valued and not word.endswith((".sdf", ".world")))
    ]
    if len(files) > 1:
        raise LaunchError(f"gz_args {args!r} name {len(files)} worlds: {', '.join(files)}")
    return files[0] if files else ""


class Spawning(Action):
    """Puts a robot into the sim, as the words of spawn_entity.py or of ros_gz_sim's create say."""

    def __init__(self, words: Sequence[str], texts: dict[str, str], target: Action) -> None:
        super().__init__()
        self.words, self.texts, self.target, self.place = list(words), texts, target, target.place

    def execute(self, context: LaunchContext) -> Entities | None:
        """Spawn it; once a robot_state_publisher has said what it is, if that comes later."""
        spawned, robot = self._read()
        if robot[0] == "-topic":
            topic = context.full_name(robot[1])
            if topic not in context.descriptions and context.stage.last(self):
                return None
            text = context.descriptions.get(topic)
        else:
            text = robot[1] if robot[0] == "-string" else self.texts.get(robot[1])
        if robot[0] and text is None:
            raise LaunchError(_unknown(context, *robot), self.place)
        words = [*spawned, *(_file(context, text) if text is not None else []), *given(*_MENTIONED.findall(text or ""))]
        if "--namespace" not in words:
            words += ["--namespace", ROOT]
        if "--timeout" not in words:
            words += ["--timeout", PATIENCE]
        words = ours(context, "spawn", *words)
        context.stage.start(self.target, Program("spawn", words, environment=context.environment))
        return None

    def _read(self) -> tuple[list[str], tuple[str, str]]:
        """Words for `holozen spawn`, and where the robot's text is, if not in a file. Raises LaunchError."""
        spawned, robot, words = [], ("", ""), list(self.words)
        if "--ros-args" in words:
            del words[words.index("--ros-args") :]
        while words:
            flag = words.pop(0)
            flag = flag[1:] if flag.startswith("--") else flag
            if flag in DROPPED:
                follows = [word for word in words[: DROPPED[flag]] if not word.startswith("-")]
                del words[: len(follows)]
            elif flag in (*KEPT, *TEXTS):
                if not words:
                    raise LaunchError(f"{flag} needs a word after it", self.place)
                value = words.pop(0)
                if flag in TEXTS:
                    robot = flag, value
                else:
                    spawned.append(f"{KEPT[flag]}={value}" if flag[1:] in "xyzRPY" else KEPT[flag])
                    spawned += [] if flag[1:] in "xyzRPY" else [value]
            else:
                known = [*KEPT, *TEXTS]
                hint = nearest(flag, known) or f"; known: {', '.join(known)}"
                raise LaunchError(f"to spawn a robot, {flag!r} means nothing here{hint}", self.place)
        if not robot[0] and "-file" not in spawned:
            raise LaunchError("to spawn a robot, give -file FILE or -topic robot_description", self.place)
        return spawned, robot


def _file(context: LaunchContext, robot: str) -> list[str]:
    """Words that name the file of a robot's text: the one that it was made from, or a new one."""
    if origin := context.origins.get(robot.strip()):
        return origin
    with tempfile.NamedTemporaryFile("w", prefix="robot_description_", suffix=".urdf", delete=False) as file:
        file.write(robot)
    context.made.append(Path(file.name))
    return [file.name]


def _unknown(context: LaunchContext, flag: str, name: str) -> str:
    if flag == "-param":
        return f"-param {name}: this Node has no parameter {name!r} with the robot in it"
    there = ", ".join(context.descriptions) or "none"
    told = f"-topic {name}: nothing in this launch file tells a robot there (those told: {there})"
    return f"{told}; a robot_state_publisher with the parameter robot_description does, or write -file FILE"
