"""What ROS's own nodes, and Gazebo, are replaced with in a launch file, and which are skipped and
why.
"""

import contextlib
import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from msgspec import Struct

from holozen import cli, data, parameter_yaml
from holozen.console import report
from holozen.robot.errors import RobotError
from holozen.ros import cmake, descriptions, executables, packages
from holozen.ros.launch.launch_context import LaunchContext, LaunchError, Program, Text, text
from holozen.ros.launch.launch_description import Action, Entities, LaunchDescription
from holozen.suggest import listed, suggest

ROOT = "/"  # the namespace of a robot without one: its keys are cmd_vel and odom
SPAWN_TIMEOUT = "60"  # s for the sim to start
SHOWN = "`holozen view` or `holozen map` in another terminal shows the robots"
MAX_SOURCE = 1_000_000  # characters
NO_WINDOW = f"launch: Gazebo's window is left out; {SHOWN}"


class Instead(NamedTuple):
    """What there is here in place of one of ROS's own nodes. A launch file leaves it out if there
    is a `reason`.
    """

    command: str = ""  # to type in its place
    reason: str = ""  # why a launch leaves it out, and what to use
    arguments: int | None = 0  # how many of its arguments the command takes; None: all
    lacks: str = ""  # what then lacks; empty if nothing does
    forwards: tuple[str, ...] = ()  # its inputs and, last, its output: nobody forwards those


UNDONE = "nobody does its work"
NEEDS_A_TERMINAL = "it needs a terminal of its own: `holozen teleop` in another one"
ON_THE_KEYS = "the sim is on the keys itself"
CHOOSES = "it chooses among commands, as the sim itself does by the priority of their senders"
LIMITS = "it smooths commands; `holozen sim --max-linear` and `--max-angular` limit them"
NO_MAP = "nobody publishes map, nor map -> odom in tf"
HARDWARE = "it drives hardware; the sim publishes what the sensors of its robots see"
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
    "teleop_twist_joy/*": Instead(
        "holozen teleop --joystick", f"{NEEDS_A_TERMINAL}, with --joystick"
    ),
    "joy/*": Instead("holozen teleop --joystick", f"{NEEDS_A_TERMINAL}, with --joystick"),
    "joy_linux/*": Instead("holozen teleop --joystick", f"{NEEDS_A_TERMINAL}, with --joystick"),
    "joy_teleop/*": Instead("holozen teleop --joystick", f"{NEEDS_A_TERMINAL}, with --joystick"),
    "rqt*/*": Instead(reason="`holozen plot`, `holozen graph` and `holozen topic` show the same"),
    "plotjuggler/*": Instead(reason="`holozen plot` in another terminal plots numbers"),
    "foxglove_bridge/*": Instead(
        "holozen view --foxglove", "`holozen view --foxglove` in another terminal serves Foxglove"
    ),
    "rosbridge_server/*": Instead(
        reason="it serves browsers; `holozen view` shows robots in one",
        lacks="pages that use roslib find nobody",
    ),
    "twist_mux/*": Instead(reason=CHOOSES, lacks=UNDONE),
    "topic_tools/*": Instead(reason="it forwards topics; remap them", lacks=UNDONE),
    "twist_stamper/*": Instead(
        reason="cmd_vel takes Twist and TwistStamped",
        forwards=("cmd_vel_in", "cmd_vel_out"),
        lacks=UNDONE,
    ),
    "nav2_velocity_smoother/*": Instead(reason=LIMITS, forwards=("cmd_vel", "cmd_vel_smoothed")),
    "nav2_collision_monitor/*": Instead(
        reason="it stops a robot before obstacles",
        lacks="this guard is gone",
        forwards=("cmd_vel_smoothed", "cmd_vel"),
    ),
    "robot_localization/*": Instead(
        reason="it fuses odometry; the sim publishes exact odom and its tf",
        lacks="nobody publishes odometry/filtered",
    ),
    "slam_toolbox/*": Instead(reason="it maps; there is no SLAM here", lacks=NO_MAP),
    "cartographer_ros/*": Instead(reason="it maps; there is no SLAM here", lacks=NO_MAP),
    "nav2_amcl/*": Instead(
        reason="it locates a robot on a map; the sim publishes exact odom", lacks=NO_MAP
    ),
    "nav2_map_server/*": Instead(reason="it publishes a map", lacks="nobody publishes map"),
    "nav2_*/*": Instead(
        reason="there is no Nav2 here; `holozen controller` serves navigate_to_pose and "
        "follow_waypoints",
        lacks="nobody plans a way around obstacles",
    ),
    "depthimage_to_laserscan/*": Instead(
        reason="a <sensor> of type ray is a scan", lacks="nobody publishes scan"
    ),
    "pointcloud_to_laserscan/*": Instead(
        reason="a <sensor> of type ray is a scan", lacks="nobody publishes scan"
    ),
    "moveit_*/*": Instead(reason="there is no MoveIt here", lacks="nobody plans for arms"),
    "micro_ros_agent/*": Instead(reason=HARDWARE),
    "*lidar*_ros*/*": Instead(reason=HARDWARE),
    "realsense2_camera/*": Instead(reason=HARDWARE),
    "usb_cam/*": Instead(reason=HARDWARE),
    "v4l2_camera/*": Instead(reason=HARDWARE),
    "tf2_ros/tf2_echo": Instead("holozen tf echo", arguments=2),
    "tf2_ros/tf2_monitor": Instead("holozen tf echo"),
    "tf2_tools/view_frames*": Instead("holozen view` or `holozen tf echo"),
    "demo_nodes_*/talker": Instead("holozen topic pub chatter std_msgs/msg/String '{data: Hello}'"),
    "demo_nodes_*/listener": Instead("holozen topic echo chatter"),
    "turtlesim/turtle_teleop_key": Instead("holozen teleop", NEEDS_A_TERMINAL),
    "turtlesim/*": Instead(
        "holozen up",
        "turtlesim is not here; `holozen up` starts a robot",
        lacks="nobody reads turtle1/cmd_vel",
    ),
    "xacro/*": Instead("holozen xacro", arguments=None),
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
    "tf2_ros/static_transform_publisher": Path(__file__).parents[1]
    / "tf2_ros"
    / "static_transform_publisher.py"
}
"""package/executable -> a script of ours that does the same."""

_CLASSIC_ARGUMENTS = (
    "world",
    "gui",
    "server",
    "verbose",
    "pause",
    "headless",
    "server_required",
    "gui_required",
    "physics",
    "debug",
    "extra_gazebo_args",
    "init",
    "factory",
    "force_system",
    "recording",
    "use_sim_time",
    "params_file",
)
_GZ_ARGUMENTS = ("gz_args", "ign_args", "gz_version", "ign_version", "on_exit_shutdown", "debugger")
"""Arguments of Gazebo's launch files, of which only the world has an effect here."""

_SPAWN_FLAGS = {f"-{letter}": f"-{letter}" for letter in "xyzRPY"} | {
    "-entity": "--name",
    "-name": "--name",
    "-model": "--name",
    "-file": "-file",
    "-robot_namespace": "--namespace",
    "-timeout": "--timeout",
    "-spawn_service_timeout": "--timeout",
}
"""Flags of spawn_entity.py and of ros_gz_sim's create -> those of `holozen spawn`."""
# other sources of the robot's description than a file
_DESCRIPTION_FLAGS = ("-topic", "-string", "-param")
_IGNORED_FLAGS = {
    "-reference_frame": 1,
    "-gazebo_namespace": 1,
    "-world": 1,
    "-J": 2,
    "-wait": 1,
    "-unpause": 0,
    "-package_to_model": 0,
    "-b": 0,
    "-bond": 0,
    "-allow_renaming": 1,
    "-urdf": 0,
    "-sdf": 0,
}
"""Flags without effect here, and how many words follow each."""
_MENTIONED_PACKAGE = re.compile(r"package://([\w-]+)")


class Executable(Struct, frozen=True, eq=False):
    """A Node or program in the launch file.

    `texts` are its parameters that are texts, `files` those of its parameters, and `remaps` its old
    names -> new ones.
    """

    action: Action
    package: str
    name: str
    words: Sequence[str]
    texts: dict[str, str] = {}
    namespace: str = ""
    files: Sequence[str] = ()
    remaps: dict[str, str] = {}

    @property
    def shown(self) -> str:
        """What it is called in messages."""
        return self.name if self.name == self.package else f"{self.package} {self.name}".strip()

    def topic(self, name: str) -> str:
        """Its topic of that name, by its remaps."""
        return next(
            (new for old, new in self.remaps.items() if old.strip("/") == name.strip("/")), name
        ).strip("/")


def stand_in(context: LaunchContext, node: Executable) -> Entities | None:
    """The replacement of one of ROS's own nodes; None for a node of the user's. Raises
    LaunchError.
    """
    name = f"{node.package}/{node.name}"
    if name in NODES:
        return NODES[name](context, node)
    found = _instead(name)
    if not found.reason or _is_users(node):
        _check_stand_in(node)
        return None
    if node.package == "robot_state_publisher":
        _remember_description(context, node)
    skip(context, node.action, node.shown, found.reason, name in ENDING, _lacks(found, node))
    return ()


def _is_users(node: Executable) -> bool:
    """Whether it is a script of a package around, and not named in the table but by a wildcard."""
    if any(name.partition("/")[0] == node.package for name in INSTEAD):
        return False
    with contextlib.suppress(executables.NotFound):
        return bool(executables.find(node.package, node.name))
    return False


def _lacks(found: Instead, node: Executable) -> str:
    """What lacks without one of ROS's nodes; empty if nothing does."""
    topics, locks = [node.topic(name) for name in found.forwards], []
    if node.package == "twist_mux":
        topics, locks = (
            [*_mux_topics(node, "topics"), node.topic("cmd_vel_out")],
            _mux_topics(node, "locks"),
        )
    elif node.package == "topic_tools":
        topics = [word for word in node.words[:2] if not word.startswith("-")]
    parts = []
    if len(topics) > 1:
        parts.append(f"nobody forwards {listed(topics[:-1])} to {topics[-1]}")
    if locks:
        parts.append(f"its locks {listed(locks)} stop nothing")
    if found.lacks and not (parts and found.lacks == UNDONE):
        parts.insert(0, found.lacks)
    return " and ".join(parts)


def _mux_topics(node: Executable, kind: str) -> list[str]:
    """The `topics` or `locks` in the parameters of a twist_mux."""
    values: dict[str, Any] = dict(node.texts)
    for file in node.files:
        with contextlib.suppress(ValueError):  # nobody else will read it
            for section in parameter_yaml.read(file):
                values |= section.values
    return [
        str(each)
        for name, each in values.items()
        if name.startswith(f"{kind}.") and name.endswith(".topic")
    ]


def cannot_run(node: Executable) -> tuple[str, str] | None:
    """Why an executable of a user's package cannot run here, and what then lacks; None for a script
    that runs.

    Raises NotFound for an executable that is not in its package, and for a package that is not
    clear.
    """
    try:
        if node.package:
            executables.find(node.package, node.name, nameless=True)
        elif Path(node.name).is_file():
            executables.from_file(Path(node.name))
        return None
    except executables.NotPython:
        return "it is not a Python script, and others do not run here", undone(node)
    except executables.PackageNotFound:
        if not packages.is_missing(node.package):
            raise
        return _missing_package(node), undone(node)
    except executables.NotFound:
        built = cmake.binaries(packages.find(node.package))
        if node.name in built or (built and not executables.names(node.package)):
            return "it is C++, which does not run here", undone(node, built.get(node.name, ()))
        raise


def _missing_package(node: Executable) -> str:
    if instead := advice(node.package, node.name, node.words):
        return instead
    near = suggest(node.package, packages.around())
    return (
        f"there is no package {node.package!r} here{near}; --package {node.package}=DIR gives "
        "its folder"
    )


_ENDS = {
    "publishes": "create_publisher|advertise",
    "reads": "create_subscription|subscribe",
    "serves": "create_service",
}
"""What a C++ node does -> the functions by which it does it."""


def undone(node: Executable, sources: Sequence[Path] = ()) -> str:
    """What nobody does without a node, as far as its C++ sources and its remaps say."""
    text = "".join(source.read_text(errors="replace")[:MAX_SOURCE] for source in sources)
    found = []
    for what, functions in _ENDS.items():
        names = re.findall(rf"\b(?:{functions})\s*<[^;()]*>\s*\(\s*\"([^\"]+)\"", text)
        if names:
            found.append(f"{what} {listed({node.topic(name) for name in names})}")
    if found:
        return f"nobody {' or '.join(found)} for it"
    remaps = listed(f"{old} to {new}" for old, new in node.remaps.items())
    return f"{UNDONE}, with {remaps}" if node.remaps else UNDONE


def advice(package: str, name: str, words: Sequence[str]) -> str:
    """What to do in place of running an executable of ROS with these arguments; empty for one that
    is not ROS's.
    """
    found = _instead(f"{package}/{name}")
    if not found.command:
        return found.reason
    ours = words[: words.index("--ros-args")] if "--ros-args" in words else words
    return f"use `{' '.join((found.command, *map(shlex.quote, ours[: found.arguments])))}`"


def _instead(name: str) -> Instead:
    return next((found for pattern, found in INSTEAD.items() if fnmatch(name, pattern)), Instead())


def _check_stand_in(node: Executable) -> None:
    """Raise LaunchError for an executable of a package of which there is no more than what is
    replaced.
    """
    if (
        node.package not in packages.stand_ins
        or packages.find(node.package) != packages.stand_ins[node.package]
    ):
        return
    start = f"{node.package}/"
    names = (*NODES, *(name for name, found in INSTEAD.items() if found.reason))
    known = sorted(name.removeprefix(start) for name in names if name.startswith(start))
    fault = f"package {node.package!r} has no executable {node.name!r}{suggest(node.name, known)}"
    raise LaunchError(f"{fault}; those that holozen replaces: {listed(known)}")


def skip(
    context: LaunchContext,
    action: Action,
    name: str,
    reason: str,
    ends: bool = False,
    lacks: str = "",
) -> None:
    """Report that a process is left out, and what then `lacks`. Actions that wait for its start go
    on; if it `ends`, those for its end too. Raises LaunchError if something lacks in a strict
    launch, or in one without a sim.
    """
    if not lacks:
        report(f"launch: {name} is left out: {reason}")
    elif context.strict:
        raise LaunchError(f"{name} cannot run here: {reason}; {lacks}")
    else:
        context.runner.lack(action, name, f"{reason}; {lacks}")
    context.runner.skip(action, ends)


def holozen_command(context: LaunchContext, verb: str, *words: str) -> list[str]:
    """The command that runs a verb of ours in the system of this launch. Raises LaunchError for
    words that it refuses: a launch with a wrong value starts nothing.
    """
    flags = context.flags
    if verb != "run":
        _check(verb, words)
    # what follows a script's name belongs to the script
    before, after = (flags, []) if verb == "run" else ([], flags)
    return [sys.executable, "-m", "holozen", verb, *before, *words, *after]


def _check(verb: str, words: Sequence[str]) -> None:
    def refuse(message: str) -> NoReturn:
        raise LaunchError(f"`holozen {verb}`, which stands in here, does not take this: {message}")

    parser = cli.command(verb).parser()
    parser.error = refuse
    parser.parse_args(words)


def package_flags(*names: str) -> list[str]:
    """The flags for the packages that were given, and for those with these names that are found."""
    found = dict(packages.given)
    for name in names:
        with contextlib.suppress(RobotError):
            found[name] = packages.find(name)
    return [word for name, folder in found.items() for word in ("--package", f"{name}={folder}")]


def replace_gazebo_packages() -> None:
    """Make the packages of Gazebo's launch files known, and those of ROS's nodes that are left out,
    unless they are installed.
    """
    packages.stand_ins.update({name: packages.NOWHERE / name for name in GAZEBO_LAUNCH_FILES})
    packages.absent[:] = [name.partition("/")[0] for name, found in INSTEAD.items() if found.reason]


def launch_file_of_ros(path: Path, place: str = "") -> LaunchDescription | None:
    """What takes the place of a launch file of a package that is not here, which is included at
    `place`: our sim for Gazebo's, nothing for others. None for any other file. Raises LaunchError.
    """
    if path.parts[: len(packages.NOWHERE.parts)] != packages.NOWHERE.parts:
        return None
    package = path.parts[len(packages.NOWHERE.parts)]
    if package not in GAZEBO_LAUNCH_FILES:
        action: Action = _LeftOut(package, path.name)
    else:
        known = GAZEBO_LAUNCH_FILES[package]
        if path.name not in known or path.parent.name != "launch":
            instead = advice(package, path.name, ())
            hint = (
                f"; {instead}"
                if instead
                else suggest(path.name, known) or f"; there are {', '.join(known)}"
            )
            raise LaunchError(
                f"{package}, which holozen replaces, has no launch file {path.name!r}{hint}"
            )
        action = known[path.name]()
    action.place = place
    return LaunchDescription([action])


class _LeftOut(Action):
    """A launch file of a package whose nodes do not run here."""

    def __init__(self, package: str, name: str) -> None:
        super().__init__()
        self.package, self.name = package, name

    def execute(self, context: LaunchContext) -> None:
        """Report it."""
        context.used.update(context.launch_configurations)
        found = _instead(f"{self.package}/{self.name}")
        skip(context, self, f"{self.package} {self.name}", found.reason, lacks=found.lacks)


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
        # for the names of Gazebo's own
        ours = data.find("worlds", f"{Path(world).stem or 'empty'}.world")
        if not Path(world).is_file() and ours.is_file():
            world = str(ours)
        if not Path(world).is_file():  # before anything starts
            known = sorted(file.name for file in ours.parent.glob("*.world"))
            raise LaunchError(
                f"world {world!r}: there is no such file{suggest(world, known)}; holozen's own "
                f"worlds are {listed(known)}"
            )
        words = holozen_command(context, "sim", "--empty", "--world", world, *package_flags())
        report(f"launch: `holozen sim` replaces Gazebo; {SHOWN}")
        context.runner.start(
            self.target, Program("sim", words, environment=context.environment, required=True)
        )
        return None


def _gz_world(args: str) -> str:
    """The world in the arguments of `gz sim`, such as `-r -v 4 empty.sdf`. Raises LaunchError."""
    try:
        words = shlex.split(args)
    except ValueError as error:
        raise LaunchError(f"gz_args {args!r}: {error}") from None
    with_value = (
        "-v",
        "--verbose",
        "--seed",
        "-z",
        "--iterations",
        "--physics-engine",
        "--render-engine",
    )
    files = [
        word
        for before, word in zip(["", *words], words, strict=False)
        if not word.startswith("-")
        and not (before in with_value and not word.endswith((".sdf", ".world")))
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
        return (
            [Simulation(_gz_world(words), self)]
            if "-g" not in words.split()
            else [_WindowLaunchFile()]
        )


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
    """Spawns a robot in the sim, as the arguments of spawn_entity.py or of ros_gz_sim's create
    specify.
    """

    def __init__(self, node: Executable) -> None:
        super().__init__()
        self.node, self.place = node, node.action.place

    def execute(self, context: LaunchContext) -> Entities | None:
        """Spawn it; at the end of the launch file if its robot_state_publisher has not been seen
        before.
        """
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
        words += [word for name in packages.allow_env for word in ("--allow-env", name)]
        if "--namespace" not in words:
            words += ["--namespace", context.full_name("", self.node.namespace) or ROOT]
        if "--timeout" not in words:
            words += ["--timeout", SPAWN_TIMEOUT]
        program = Program(
            "spawn", holozen_command(context, "spawn", *words), environment=context.environment
        )
        context.runner.start(self.node.action, program)
        return None

    def _parse(self) -> tuple[list[str], tuple[str, str]]:
        """Arguments for `holozen spawn`, and the flag and value of the robot's description. Raises
        LaunchError.
        """
        flags, description, words = [], ("", ""), list(self.node.words)
        if "--ros-args" in words:
            del words[words.index("--ros-args") :]
        while words:
            flag = words.pop(0)
            flag = flag[1:] if flag.startswith("--") else flag
            if flag in _IGNORED_FLAGS:
                values = [
                    word for word in words[: _IGNORED_FLAGS[flag]] if not word.startswith("-")
                ]
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
    """The file, with name:=value words, from which a robot's description was generated, or a new
    one.
    """
    if origin := descriptions.origin(robot):
        return origin
    with tempfile.NamedTemporaryFile(
        "w", prefix="robot_description_", suffix=".urdf", delete=False
    ) as file:
        file.write(robot)
    context.temporary_files.append(Path(file.name))
    return [file.name]


def _no_description(context: LaunchContext, flag: str, name: str) -> str:
    if flag == "-param":
        return f"-param {name}: this Node has no parameter {name!r} with a robot description"
    topics = ", ".join(context.descriptions) or "none"
    text = (
        f"-topic {name}: nothing in this launch file publishes a robot description there "
        f"(known topics: {topics})"
    )
    return (
        f"{text}; add a robot_state_publisher with the parameter robot_description, or write "
        "-file FILE"
    )


def _remember_description(context: LaunchContext, node: Executable) -> None:
    """Remember the robot that robot_state_publisher would publish."""
    robot = node.texts.get("robot_description", "")
    files = [word for word in node.words if word.endswith((".urdf", ".xml"))]
    if not robot and files:
        robot = descriptions.read(Path(files[0]))
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

PROGRAMS: dict[str, StandIn] = {
    "gazebo": _classic,
    "gzserver": _classic,
    "gz": _gz,
    "ign": _gz,
    "gzclient": _window,
}
"""The first word of an ExecuteProcess -> its replacement."""
