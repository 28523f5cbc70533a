"""What ROS's own nodes, and Gazebo, are replaced with in a launch file, and which are skipped and why."""

import contextlib
import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

from msgspec import Struct

from holozen import data
from holozen.console import report
from holozen.robot.elements import read_text
from holozen.robot.errors import RobotError
from holozen.ros import packages
from holozen.ros.launch.launch_context import LaunchContext, LaunchError, Program, Text, text
from holozen.ros.launch.launch_description import Action, Entities, LaunchDescription
from holozen.suggest import listed, suggest

ROOT = "/"  # the namespace of a robot without one: its keys are cmd_vel and odom
SPAWN_TIMEOUT = "60"  # s for the sim to start
NOWHERE = Path("/holozen-stands-in-for")  # the folder of packages that exist by name only
SHOWN = "`holozen view` or `holozen map` in another terminal shows the robots"
NO_WINDOW = f"launch: Gazebo's window is left out; {SHOWN}"


class Instead(NamedTuple):
    """What there is here in place of one of ROS's own nodes. A launch file leaves it out if there is a `reason`."""

    command: str = ""  # to type in its place
    reason: str = ""  # why a launch leaves it out, and what to use
    arguments: int | None = 0  # how many of its arguments the command takes; None: all


NEEDS_A_TERMINAL = "it needs a terminal of its own: `holozen teleop` in another one"
ON_THE_KEYS = "the sim is on the keys itself"
INSTEAD = {
    "robot_state_publisher/*": Instead(reason="the sim itself publishes joint_states and tf"),
    "joint_state_publisher/*": Instead(reason="the sim itself publishes joint_states"),
    "joint_state_publisher_gui/*": Instead(
        reason="the sim publishes joint_states; `holozen topic pub joint_command` moves joints"
    ),
    "rviz2/*": Instead("holozen view` or `holozen map", SHOWN),
    "gazebo_ros/gzclient": Instead("holozen view` or `holozen map", SHOWN),
    "ros_gz_bridge/*": Instead(reason=ON_THE_KEYS),
    "ros_ign_bridge/*": Instead(reason=ON_THE_KEYS),
    "ros_gz_image/*": Instead(reason=ON_THE_KEYS),
    "controller_manager/*": Instead(reason="the sim moves joints itself, by the key joint_command"),
    "teleop_twist_keyboard/*": Instead("holozen teleop", NEEDS_A_TERMINAL),
    "teleop_twist_joy/*": Instead("holozen teleop --joystick", f"{NEEDS_A_TERMINAL}, with --joystick"),
    "joy/*": Instead("holozen teleop --joystick", f"{NEEDS_A_TERMINAL}, with --joystick"),
    "rqt*/*": Instead(reason="`holozen plot`, `holozen graph` and `holozen topic` show the same"),
    "plotjuggler/*": Instead(reason="`holozen plot` in another terminal plots numbers"),
    "tf2_ros/tf2_echo": Instead("holozen tf echo", arguments=2),
    "tf2_ros/tf2_monitor": Instead("holozen tf echo"),
    "tf2_tools/view_frames*": Instead("holozen view` or `holozen tf echo"),
    "demo_nodes_*/talker": Instead("holozen topic pub chatter std_msgs/msg/String '{data: Hello}'"),
    "demo_nodes_*/listener": Instead("holozen topic echo chatter"),
    "turtlesim/turtlesim_node": Instead("holozen up"),
    "turtlesim/turtle_teleop_key": Instead("holozen teleop"),
    "xacro/*": Instead("holozen xacro", arguments=None),
    "foxglove_bridge/*": Instead("holozen view --foxglove"),
    "gazebo_ros/spawn_*": Instead("holozen spawn", arguments=None),
    "ros_gz_sim/create": Instead("holozen spawn"),
    "ros_ign_gazebo/create": Instead("holozen spawn"),
    "gazebo_ros/gz*": Instead("holozen sim --empty"),
    "gazebo_ros/gazebo": Instead("holozen sim --empty"),
    "ros_gz_sim/gz*": Instead("holozen sim --empty"),
}
"""package/executable -> what there is in its place; the first that fits."""

ENDING = ("controller_manager/spawner", "controller_manager/spawner.py")
"""Skipped nodes that would end by themselves, and for whose end others wait."""

SCRIPTS = {
    "tf2_ros/static_transform_publisher": Path(__file__).parents[1] / "tf2_ros" / "static_transform_publisher.py"
}
"""package/executable -> a script of ours that does the same."""

_CLASSIC_ARGUMENTS = (
    "world", "gui", "server", "verbose", "pause", "headless", "server_required", "gui_required", "physics", "debug",
    "extra_gazebo_args", "init", "factory", "force_system", "recording", "use_sim_time", "params_file",
)  # fmt: skip
_GZ_ARGUMENTS = ("gz_args", "ign_args", "gz_version", "ign_version", "on_exit_shutdown", "debugger")
"""Arguments of Gazebo's launch files, of which only the world has an effect here."""

_SPAWN_FLAGS = {f"-{letter}": f"-{letter}" for letter in "xyzRPY"} | {
    "-entity": "--name", "-name": "--name", "-model": "--name", "-file": "-file", "-robot_namespace": "--namespace",
    "-timeout": "--timeout", "-spawn_service_timeout": "--timeout",
}  # fmt: skip
"""Flags of spawn_entity.py and of ros_gz_sim's create -> those of `holozen spawn`."""
_DESCRIPTION_FLAGS = ("-topic", "-string", "-param")  # other sources of the robot's description than a file
_IGNORED_FLAGS = {
    "-reference_frame": 1, "-gazebo_namespace": 1, "-world": 1, "-J": 2, "-wait": 1, "-unpause": 0,
    "-package_to_model": 0, "-b": 0, "-bond": 0, "-allow_renaming": 1, "-urdf": 0, "-sdf": 0,
}  # fmt: skip
"""Flags without effect here, and how many words follow each."""
_MENTIONED_PACKAGE = re.compile(r"package://([\w-]+)")


class Executable(Struct, frozen=True, eq=False):
    """A Node or program in the launch file; `texts` are its parameters that are texts."""

    action: Action
    package: str
    name: str
    words: Sequence[str]
    texts: dict[str, str] = {}
    namespace: str = ""


def stand_in(context: LaunchContext, node: Executable) -> Entities | None:
    """The replacement of one of ROS's own nodes; None for a node of the user's. Raises LaunchError."""
    name = f"{node.package}/{node.name}"
    if name in NODES:
        return NODES[name](context, node)
    reason = _instead(name).reason
    if not reason:
        _check_stand_in(node)
        return None
    if node.package == "robot_state_publisher":
        _remember_description(context, node)
    shown = node.name if node.name == node.package else f"{node.package} {node.name}"
    skip(context, node.action, shown, reason, name in ENDING)
    return ()


def advice(package: str, name: str, words: Sequence[str]) -> str:
    """What to do in place of running an executable of ROS with these arguments; empty for one that is not ROS's."""
    found = _instead(f"{package}/{name}")
    if not found.command:
        return found.reason
    ours = words[: words.index("--ros-args")] if "--ros-args" in words else words
    return f"use `{' '.join((found.command, *map(shlex.quote, ours[: found.arguments])))}`"


def _instead(name: str) -> Instead:
    return next((found for pattern, found in INSTEAD.items() if fnmatch(name, pattern)), Instead())


def _check_stand_in(node: Executable) -> None:
    """Raise LaunchError for an executable of a package of which there is no more than what is replaced."""
    if node.package not in packages.stand_ins or packages.find(node.package) != packages.stand_ins[node.package]:
        return
    start = f"{node.package}/"
    names = (*NODES, *(name for name, found in INSTEAD.items() if found.reason))
    known = sorted(name.removeprefix(start) for name in names if name.startswith(start))
    fault = f"package {node.package!r} has no executable {node.name!r}{suggest(node.name, known)}"
    raise LaunchError(f"{fault}; those that holozen replaces: {listed(known)}")


def skip(context: LaunchContext, action: Action, name: str, reason: str, ends: bool = False) -> None:
    """Report that a process is left out. Actions that wait for its start go on; if it `ends`, those for its end too."""
    report(f"launch: {name} is left out: {reason}")
    context.runner.skip(action, ends)


def holozen_command(context: LaunchContext, verb: str, *words: str) -> list[str]:
    """The command that runs a verb of ours in the system of this launch."""
    flags = context.flags
    before, after = (flags, []) if verb == "run" else ([], flags)  # what follows a script's name belongs to the script
    return [sys.executable, "-m", "holozen", verb, *before, *words, *after]


def package_flags(*names: str) -> list[str]:
    """The flags for the packages that were given, and for those with these names that are found."""
    found = dict(packages.given)
    for name in names:
        with contextlib.suppress(RobotError):
            found[name] = packages.find(name)
    return [word for name, folder in found.items() for word in ("--package", f"{name}={folder}")]


def replace_gazebo_packages() -> None:
    """Make the packages of Gazebo's launch files known, unless they are installed."""
    packages.stand_ins.update({name: NOWHERE / name for name in GAZEBO_LAUNCH_FILES})


def gazebo_launch_file(path: Path, place: str = "") -> LaunchDescription | None:
    """The replacement of one of Gazebo's launch files, which is included at `place`; None for any other file.

    Raises LaunchError.
    """
    if path.parts[: len(NOWHERE.parts)] != NOWHERE.parts:
        return None
    package = path.parts[len(NOWHERE.parts)]
    known = GAZEBO_LAUNCH_FILES[package]
    if path.name not in known or path.parent.name != "launch":
        instead = advice(package, path.name, ())
        hint = f"; {instead}" if instead else suggest(path.name, known) or f"; there are {', '.join(known)}"
        raise LaunchError(f"{package}, which holozen replaces, has no launch file {path.name!r}{hint}")
    action = known[path.name]()
    action.place = place
    return LaunchDescription([action])


class Simulation(Action):
    """Starts our sim, once, without a robot."""

    def __init__(self, world: Text = "", target: Action | None = None) -> None:
        super().__init__()
        self.world, self.target = world, target or self
        self.place = self.target.place

    def execute(self, context: LaunchContext) -> Entities | None:
        """Start it. The launch ends when it does."""
        if context.simulates:
            return None
        context.simulates = True
        if other := context.other_sim():  # what is spawned here would go there
            fix = "end it, or leave Gazebo out of the launch file to use it"
            raise LaunchError(f"{other} simulates here already; {fix}")
        world = text(context, self.world)
        ours = data.find("worlds", f"{Path(world).stem or 'empty'}.world")  # for the names of Gazebo's own
        if not Path(world).is_file() and ours.is_file():
            world = str(ours)
        words = holozen_command(context, "sim", "--empty", "--world", world, *package_flags())
        report(f"launch: `holozen sim` replaces Gazebo; {SHOWN}")
        context.runner.start(self.target, Program("sim", words, environment=context.environment, required=True))
        return None


def _gz_world(args: str) -> str:
    """The world in the arguments of `gz sim`, such as `-r -v 4 empty.sdf`. Raises LaunchError."""
    try:
        words = shlex.split(args)
    except ValueError as error:
        raise LaunchError(f"gz_args {args!r}: {error}") from None
    with_value = ("-v", "--verbose", "--seed", "-z", "--iterations", "--physics-engine", "--render-engine")
    files = [
        word
        for before, word in zip(["", *words], words, strict=False)
        if not word.startswith("-") and not (before in with_value and not word.endswith((".sdf", ".world")))
    ]
    if len(files) > 1:
        raise LaunchError(f"gz_args {args!r} name {len(files)} worlds: {', '.join(files)}")
    return files[0] if files else ""


class _ClassicLaunchFile(Action):
    """gazebo.launch.py and gzserver.launch.py."""

    def execute(self, context: LaunchContext) -> Entities:
        """Our sim, in the world of the launch argument."""
        context.used.update(_CLASSIC_ARGUMENTS)
        return [Simulation(context.launch_configurations.get("world", ""), self)]


class _WindowLaunchFile(Action):
    """gzclient.launch.py."""

    def execute(self, context: LaunchContext) -> None:
        """Report that there is no window."""
        context.used.update(_CLASSIC_ARGUMENTS)
        report(NO_WINDOW)


class _GzLaunchFile(Action):
    """gz_sim.launch.py."""

    def execute(self, context: LaunchContext) -> Entities:
        """Our sim, in the world of the launch arguments."""
        context.used.update(_GZ_ARGUMENTS)
        values = context.launch_configurations
        words = " ".join(values.get(name, "") for name in ("gz_args", "ign_args"))
        return [Simulation(_gz_world(words), self)] if "-g" not in words.split() else [_WindowLaunchFile()]


GAZEBO_LAUNCH_FILES: dict[str, dict[str, Callable[[], Action]]] = {
    "gazebo_ros": {
        "gazebo.launch.py": _ClassicLaunchFile,
        "gzserver.launch.py": _ClassicLaunchFile,
        "gzclient.launch.py": _WindowLaunchFile,
    },
    "ros_gz_sim": {"gz_sim.launch.py": _GzLaunchFile},
    "ros_ign_gazebo": {"ign_gazebo.launch.py": _GzLaunchFile},
}
"""The launch files that are replaced here, by package."""


class Spawn(Action):
    """Spawns a robot in the sim, as the arguments of spawn_entity.py or of ros_gz_sim's create specify."""

    def __init__(self, node: Executable) -> None:
        super().__init__()
        self.node, self.place = node, node.action.place

    def execute(self, context: LaunchContext) -> Entities | None:
        """Spawn it; at the end of the launch file if its robot_state_publisher has not been seen before."""
        flags, (source, name) = self._parse()
        if source == "-topic":
            topic = context.full_name(name, self.node.namespace)
            if topic not in context.descriptions and context.runner.postpone(self):
                return None
            robot = context.descriptions.get(topic)
        else:
            robot = name if source == "-string" else self.node.texts.get(name)
        if source and robot is None:
            raise LaunchError(_no_description(context, source, name))
        words = [*flags, *(_description_file(context, robot) if robot is not None else [])]
        words += package_flags(*_MENTIONED_PACKAGE.findall(robot or ""))
        words += [word for name in context.allow_env for word in ("--allow-env", name)]
        if "--namespace" not in words:
            words += ["--namespace", context.full_name("", self.node.namespace) or ROOT]
        if "--timeout" not in words:
            words += ["--timeout", SPAWN_TIMEOUT]
        program = Program("spawn", holozen_command(context, "spawn", *words), environment=context.environment)
        context.runner.start(self.node.action, program)
        return None

    def _parse(self) -> tuple[list[str], tuple[str, str]]:
        """Arguments for `holozen spawn`, and the flag and value of the robot's description. Raises LaunchError."""
        flags, description, words = [], ("", ""), list(self.node.words)
        if "--ros-args" in words:
            del words[words.index("--ros-args") :]
        while words:
            flag = words.pop(0)
            flag = flag[1:] if flag.startswith("--") else flag
            if flag in _IGNORED_FLAGS:
                values = [word for word in words[: _IGNORED_FLAGS[flag]] if not word.startswith("-")]
                del words[: len(values)]
            elif flag in (*_SPAWN_FLAGS, *_DESCRIPTION_FLAGS):
                if not words:
                    raise LaunchError(f"{flag} needs a value")
                value = words.pop(0)
                if flag in _DESCRIPTION_FLAGS:
                    description = flag, value
                elif flag[1:] in "xyzRPY":
                    flags.append(f"{_SPAWN_FLAGS[flag]}={value}")
                else:
                    flags += [_SPAWN_FLAGS[flag], value]
            else:
                known = [*_SPAWN_FLAGS, *_DESCRIPTION_FLAGS]
                hint = suggest(flag, known) or f"; known: {', '.join(known)}"
                raise LaunchError(f"unknown flag {flag!r} to spawn a robot{hint}")
        if not description[0] and "-file" not in flags:
            raise LaunchError("to spawn a robot, give -file FILE or -topic robot_description")
        return flags, description


def _description_file(context: LaunchContext, robot: str) -> list[str]:
    """The file, with name:=value words, from which a robot's description was generated, or a new one."""
    if origin := context.origins.get(robot.strip()):
        return origin
    with tempfile.NamedTemporaryFile("w", prefix="robot_description_", suffix=".urdf", delete=False) as file:
        file.write(robot)
    context.temporary_files.append(Path(file.name))
    return [file.name]


def _no_description(context: LaunchContext, flag: str, name: str) -> str:
    if flag == "-param":
        return f"-param {name}: this Node has no parameter {name!r} with a robot description"
    topics = ", ".join(context.descriptions) or "none"
    text = f"-topic {name}: nothing in this launch file publishes a robot description there (known topics: {topics})"
    return f"{text}; add a robot_state_publisher with the parameter robot_description, or write -file FILE"


def _remember_description(context: LaunchContext, node: Executable) -> None:
    """Remember the robot that robot_state_publisher would publish."""
    robot = node.texts.get("robot_description", "")
    files = [word for word in node.words if word.endswith((".urdf", ".xml"))]
    if not robot and files:
        robot = read_text(Path(files[0]))
        context.origins[robot.strip()] = [files[0]]
    if robot:
        context.descriptions[context.full_name("robot_description", node.namespace)] = robot


def _spawn(context: LaunchContext, node: Executable) -> Entities:
    return [Spawn(node)]


def _classic(context: LaunchContext, node: Executable) -> Entities:
    worlds = [word for word in node.words if word.endswith((".world", ".sdf"))]
    return [Simulation(worlds[0] if worlds else "", node.action)]


def _gz_server(context: LaunchContext, node: Executable) -> Entities:
    return [Simulation(_gz_world(" ".join(node.words)), node.action)]


def _gz(context: LaunchContext, node: Executable) -> Entities:
    verb = "".join(node.words[:1])
    if verb in ("sim", "gazebo"):
        return [Simulation(_gz_world(" ".join(node.words[1:])), node.action)]
    skip(context, node.action, f"`{node.name} {verb}`", "only its sim is replaced here", ends=True)
    return ()


def _window(context: LaunchContext, node: Executable) -> Entities:
    report(NO_WINDOW)
    context.runner.skip(node.action, ends=False)
    return ()


StandIn = Callable[[LaunchContext, Executable], Entities]

NODES: dict[str, StandIn] = {
    "gazebo_ros/spawn_entity.py": _spawn,
    "gazebo_ros/spawn_entity": _spawn,
    "ros_gz_sim/create": _spawn,
    "ros_ign_gazebo/create": _spawn,
    "gazebo_ros/gzserver": _classic,
    "gazebo_ros/gazebo": _classic,
    "ros_gz_sim/gzserver": _gz_server,
}
"""package/executable -> its replacement."""

PROGRAMS: dict[str, StandIn] = {"gazebo": _classic, "gzserver": _classic, "gz": _gz, "ign": _gz, "gzclient": _window}
"""The first word of an ExecuteProcess -> its replacement."""
