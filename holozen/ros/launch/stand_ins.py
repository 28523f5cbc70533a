"""ROS's own nodes in a launch file: which we do otherwise, and which are left out and why."""

from collections.abc import Callable, Sequence
from fnmatch import fnmatch
from pathlib import Path

from holozen.robot.xacro import read_text
from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Action, Entities
from holozen.ros.launch.gazebo import NO_WINDOW
from holozen.ros.launch.simulation import Simulation, Spawning, gz_world
from holozen.tell import say

NEEDS_A_TERMINAL = "it needs a terminal of its own: `holozen teleop` in another one"
LEFT_OUT = {
    "robot_state_publisher/*": "the sim itself tells joint_states and tf",
    "joint_state_publisher/*": "the sim itself tells joint_states",
    "joint_state_publisher_gui/*": "the sim itself tells joint_states; `holozen topic pub joint_command` moves joints",
    "rviz2/*": "`holozen map` in another terminal shows the robots, `holozen topic echo` what is told",
    "gazebo_ros/gzclient": "`holozen map` in another terminal shows the robots",
    "ros_gz_bridge/*": "the sim is on the keys itself",
    "ros_ign_bridge/*": "the sim is on the keys itself",
    "ros_gz_image/*": "the sim is on the keys itself",
    "controller_manager/*": "the sim moves joints itself, by the key joint_command",
    "teleop_twist_keyboard/*": NEEDS_A_TERMINAL,
    "teleop_twist_joy/*": f"{NEEDS_A_TERMINAL}, with --joystick",
    "joy/*": f"{NEEDS_A_TERMINAL}, with --joystick",
    "rqt*/*": "`holozen plot`, `holozen graph` and `holozen topic` show what it would",
    "plotjuggler/*": "`holozen plot` in another terminal draws numbers",
}
"""package/executable -> why it is left out, and what to use."""

ENDING = ("controller_manager/spawner", "controller_manager/spawner.py")
"""Those that would end by themselves, for whose end others wait."""

Words = Sequence[str]


class Wanted:
    """A Node or program of the launch file: its package, executable and words, and the texts among its parameters."""

    def __init__(
        self, action: Action, package: str, executable: str, words: Words, texts: dict[str, str] = {},
        namespace: str = "",
    ) -> None:  # fmt: skip
        self.action, self.package, self.executable, self.words = action, package, executable, words
        self.texts, self.namespace = texts, namespace


def stand_in(context: LaunchContext, node: Wanted) -> Entities | None:
    """What is done for a Node of ROS's own; None for one that is the user's. Raises LaunchError."""
    name = f"{node.package}/{node.executable}"
    if name in DONE:
        return DONE[name](context, node)
    reason = next((reason for pattern, reason in LEFT_OUT.items() if fnmatch(name, pattern)), None)
    if reason is None:
        return None
    if node.package == "robot_state_publisher":
        _describe(context, node)
    leave_out(context, node.action, f"{node.package} {node.executable}", reason, name in ENDING)
    return ()


def leave_out(context: LaunchContext, action: Action, name: str, reason: str, ends: bool = False) -> None:
    """Say that something is left out. What waits for its start goes on, and if it `ends` what waits for its end."""
    say(f"launch: {name} is left out: {reason}")
    context.stage.left_out(action, ends)


def _describe(context: LaunchContext, node: Wanted) -> None:
    """Remember the robot that robot_state_publisher would tell."""
    robot = node.texts.get("robot_description", "")
    files = [word for word in node.words if word.endswith((".urdf", ".xml"))]
    if not robot and files:
        robot = read_text(Path(files[0]))
        context.origins[robot.strip()] = [files[0]]
    if robot:
        context.descriptions[context.full_name("robot_description", node.namespace)] = robot


def _spawn(context: LaunchContext, node: Wanted) -> Entities:
    return [Spawning(node.words, node.texts, node.action)]


def _classic(context: LaunchContext, node: Wanted) -> Entities:
    worlds = [word for word in node.words if word.endswith((".world", ".sdf"))]
    return [Simulation(worlds[0] if worlds else "", node.action)]


def _new(context: LaunchContext, node: Wanted) -> Entities:
    return [Simulation(gz_world(" ".join(node.words)), node.action)]


def _gz(context: LaunchContext, node: Wanted) -> Entities:
    verb = "".join(node.words[:1])
    if verb in ("sim", "gazebo"):
        return [Simulation(gz_world(" ".join(node.words[1:])), node.action)]
    leave_out(context, node.action, f"`{node.executable} {verb}`", "only its sim is stood in for", ends=True)
    return ()


def _window(context: LaunchContext, node: Wanted) -> Entities:
    say(NO_WINDOW)
    context.stage.left_out(node.action, ends=False)
    return ()


DONE: dict[str, Callable[[LaunchContext, Wanted], Entities]] = {
    "gazebo_ros/spawn_entity.py": _spawn,
    "gazebo_ros/spawn_entity": _spawn,
    "ros_gz_sim/create": _spawn,
    "ros_ign_gazebo/create": _spawn,
    "gazebo_ros/gzserver": _classic,
    "gazebo_ros/gazebo": _classic,
    "ros_gz_sim/gzserver": _new,
}
"""package/executable -> what is done instead."""

SCRIPTS = {"tf2_ros/static_transform_publisher": Path(__file__).parents[1] / "static_transform_publisher.py"}
"""package/executable -> a script of ours that does the same."""

PROGRAMS: dict[str, Callable[[LaunchContext, Wanted], Entities]] = {
    "gazebo": _classic,
    "gzserver": _classic,
    "gz": _gz,
    "ign": _gz,
    "gzclient": _window,
}
"""The first word of an ExecuteProcess -> what is done instead."""
