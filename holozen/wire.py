"""The one table of the wire: key, type, writers, readers, rate, silence rule.

The docs, tests, the command line and the services read it from here.
"""

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from holozen.messages import named

if TYPE_CHECKING:
    from holozen.messages import Message

# s; without a command for so long a robot stops, unless its file sets another time for velocities
COMMAND_SILENCE = 0.5
# s; a motion that may have been sent longer ago is refused. An older one was over by silence.
MAX_COMMAND_AGE = COMMAND_SILENCE
ODOM_SILENCE = 0.2  # s; older odometry is stale, unless it comes at a slower rate
SIM_SILENCE = 1.0  # s; an older status of a sim is stale
MAX_ENTITIES = 1000  # of one sim; each takes time at every step
MAX_COMMAND_BYTES = 65_536  # a Twist takes about 100; a larger command is not decoded
MAX_STAMP_AGE = 0.5  # s; an older (or as far future) stamp on a command is refused
# A command beyond these is a mistake: it is refused, not clamped.
MAX_OF = {
    "Twist": (("linear", 100.0, "m/s"), ("angular", 1000.0, "rad/s")),
    "Wrench": (("force", 1e4, "N"), ("torque", 1e4, "N m")),
}
MAX_OF_JOINT = {"position": 1e4, "velocity": 1e3, "effort": 1e6}  # rad or m; rad/s or m/s; N m or N

# Services that can set a robot moving: requests that may predate the stop they would end are
# rejected.
FREEING = ("release", "resume", "send_goal")
FORCE = "geometry_msgs/msg/Wrench"
VELOCITIES = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
"""The types of commands of a velocity."""

PRIORITY_OF = {"teleop": "INTERACTIVE_HIGH", "view": "INTERACTIVE_HIGH", "controller": "DATA_LOW"}
"""Zenoh priority of each command source. Others have DATA, as a plain `zenoh put`."""

SENDERS = {"INTERACTIVE_HIGH": "person", "DATA": "script", "DATA_LOW": "controller"}
"""Zenoh priority -> who sends commands with it, as people are told."""


class Topic(NamedTuple):
    """A key with a stream of messages, each of one of its types. `rate` in Hz, 0: on demand. After
    `silence` seconds readers call it stale.
    """

    key: str
    type_names: tuple[str, ...]
    writers: tuple[str, ...]
    readers: tuple[str, ...]
    rate: float
    silence: float
    rule: str

    @property
    def type_name(self) -> str:
        """The default type; the others are accepted too."""
        return self.type_names[0]

    @property
    def types(self) -> "tuple[type[Message], ...]":
        """The Structs of all its types."""
        return tuple(map(named, self.type_names))

    @property
    def is_command(self) -> bool:
        """Whether it moves a robot: all else comes from the sim and its cameras."""
        return not {"sim", "camera"} & set(self.writers)


class Service(NamedTuple):
    """A key that answers a request with one reply, or with an error and its reason."""

    key: str
    type_name: str
    server: str
    does: str

    @property
    def request(self) -> "type[Message]":
        """The Struct of a request."""
        return named(f"{self.type_name}_Request")

    @property
    def reply(self) -> "type[Message]":
        """The Struct of a reply."""
        return named(f"{self.type_name}_Response")


class Action(NamedTuple):
    """A key below which goals are sent, see holozen.transport.actions."""

    key: str
    type_name: str
    server: str
    does: str


# fmt: off
TOPICS = (
    Topic("cmd_vel", VELOCITIES, ("teleop", "view", "controller"),
          ("sim",), 20.0, COMMAND_SILENCE, "0.5 s without a fresh one: the robot stops"),
    Topic("odom", ("nav_msgs/msg/Odometry",),
          ("sim",), ("teleop", "view", "controller", "pose_service"), 50.0, ODOM_SILENCE,
          "0.2 s: shown as stale, the controller stops"),
    Topic("cmd_vel_status", ("holozen/msg/CommandStatus",),
          ("sim",), ("teleop", "view", "controller"), 10.0, 1.0, ""),
    Topic("joint_states", ("sensor_msgs/msg/JointState",), ("sim",), (), 50.0, 0.2, ""),
    Topic("tf", ("tf2_msgs/msg/TFMessage",), ("sim",), (), 50.0, 0.2, ""),
    Topic("clock", ("rosgraph_msgs/msg/Clock",), ("sim",), (), 50.0, 0.2, ""),
    Topic("simulation_status", ("holozen/msg/SimulationStatus",),
          ("sim",), ("teleop", "controller"), 10.0, SIM_SILENCE, ""),
    Topic("model_states", ("gazebo_msgs/msg/ModelStates",), ("sim",), (), 50.0, 0.2, ""),
    Topic("link_states", ("gazebo_msgs/msg/LinkStates",), ("sim",), (), 50.0, 0.2, ""),
    Topic("scan", ("sensor_msgs/msg/LaserScan",), ("sim",), (), 10.0, 1.0, ""),
    Topic("imu", ("sensor_msgs/msg/Imu",), ("sim",), (), 100.0, 0.2, ""),
    Topic("exposures", ("holozen/msg/Exposure",), ("sim",), ("camera",), 10.0, 1.0, ""),
    Topic("image_raw", ("sensor_msgs/msg/Image",), ("camera",), (), 10.0, 1.0, ""),
    Topic("camera_info", ("sensor_msgs/msg/CameraInfo",), ("camera",), (), 10.0, 1.0, ""),
    Topic("joint_command", ("sensor_msgs/msg/JointState",), (), ("sim",), 20.0, COMMAND_SILENCE,
          "0.5 s without a fresh one: joints hold still"),
    Topic("gazebo_ros_force", (FORCE,), (), ("sim",), 20.0, COMMAND_SILENCE,
          "0.5 s without a fresh one: the force ends"),
    Topic("goal_pose", ("geometry_msgs/msg/PoseStamped",), ("view",), ("controller",), 0.0, 0.0,
          "once for each goal; the controller stops without fresh odom"),
)

SERVICES = (
    Service("next_goal", "holozen/srv/NextGoal", "pose_service", "the goal with a number, in odom"),
    Service("get_pose", "holozen/srv/GetPose", "pose_service", "a robot's last odom and its age"),
    Service("stop", "std_srvs/srv/Trigger", "sim",
            "keeps the robot stopped, whatever is commanded, until `release`"),
    Service("release", "std_srvs/srv/Trigger", "sim", "ends a `stop`; by itself it moves nothing"),
    Service("resume", "std_srvs/srv/Trigger", "sim", "lets overruled sources drive again"),
    Service("spawn_entity", "simulation_interfaces/srv/SpawnEntity", "sim",
            "adds a robot or object to the world"),
    Service("delete_entity", "simulation_interfaces/srv/DeleteEntity", "sim", "removes an entity"),
    Service("get_entities", "simulation_interfaces/srv/GetEntities", "sim",
            "the names of all entities"),
    Service("get_entity_state", "simulation_interfaces/srv/GetEntityState", "sim",
            "an entity's pose and velocity"),
    Service("set_entity_state", "simulation_interfaces/srv/SetEntityState", "sim",
            "moves an entity"),
    Service("get_simulation_state", "simulation_interfaces/srv/GetSimulationState", "sim",
            "whether it plays, is paused or stopped"),
    Service("set_simulation_state", "simulation_interfaces/srv/SetSimulationState", "sim",
            "plays, pauses, stops or ends it"),
    Service("step_simulation", "simulation_interfaces/srv/StepSimulation", "sim",
            "makes steps while it is paused; the reply follows all their messages"),
    Service("reset_simulation", "simulation_interfaces/srv/ResetSimulation", "sim",
            "sets time, poses or entities back to the start"),
    Service("get_scene", "holozen/srv/GetScene", "sim", "all entities, their keys and poses"),
    Service("robot_description", "holozen/srv/RobotDescription", "sim",
            "an entity's URDF, with its visual meshes in it"),
)

ACTIONS = (
    Action("navigate_to_pose", "nav2_msgs/action/NavigateToPose", "controller",
           "drives to a pose in odom"),
    Action("follow_waypoints", "nav2_msgs/action/FollowWaypoints", "controller",
           "drives to several, one after another"),
    Action("simulate_steps", "simulation_interfaces/action/SimulateSteps", "sim",
           "as `step_simulation`, with progress"),
)
# fmt: on

OF_NODES = (
    Service(
        "list_parameters", "rcl_interfaces/srv/ListParameters", "", "names of a node's parameters"
    ),
    Service("get_parameters", "rcl_interfaces/srv/GetParameters", "", "their values"),
    Service("set_parameters", "rcl_interfaces/srv/SetParameters", "", "sets all of them, or none"),
    Service(
        "describe_parameters", "rcl_interfaces/srv/DescribeParameters", "", "their types and ranges"
    ),
)
"""The services of every node with parameters, below its name: `sim/get_parameters`."""


_TELEMETRY = {name for row in TOPICS if not row.is_command for name in row.type_names}
COMMAND_TYPES = {
    name for row in TOPICS if "sim" in row.readers for name in row.type_names
} - _TELEMETRY
"""The types of messages that move a robot whatever their key. A JointState does so on
`joint_command` alone.
"""


def table() -> str:
    """The table as Markdown, for docs/wire.md (`scripts/tables` puts it there)."""
    topics = [_topic_row(row) for row in TOPICS]
    services = [
        f"| `{row.key}` | {row.type_name} | {row.server} | {row.does} |" for row in SERVICES
    ]
    actions = [f"| `{row.key}` | {row.type_name} | {row.server} | {row.does} |" for row in ACTIONS]
    heads = [
        f"| {kind} | type | server | what it does |\n|---|---|---|---|"
        for kind in ("service", "action")
    ]
    first = ("| key | type | writers -> readers | rate | silence rule |", "|---|---|---|---|---|")
    return "\n".join([*first, *topics, "", heads[0], *services, "", heads[1], *actions])


def _topic_row(row: Topic) -> str:
    types = row.type_name + "".join(
        f" ({other.rpartition('/')[2]} accepted)" for other in row.type_names[1:]
    )
    # Any plain Zenoh tool may write commands and read everything.
    writers = [*row.writers, "anyone"] if row.is_command else row.writers
    ends = f"{', '.join(writers)} -> {', '.join(row.readers) or 'anyone'}"
    rate = f"{row.rate:g} Hz" if row.rate else "on demand"
    return f"| `{row.key}` | {types} | {ends} | {rate} | {row.rule} |"


_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")
ROS_TOPIC = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
"""A valid name of a topic or a service of ROS 2, without the leading slash."""


def is_robot_name(text: str) -> bool:
    """Whether `text` may name a robot."""
    return _NAME.fullmatch(text) is not None


def robot_name(text: str) -> str:
    """`text` if it may name a robot, else ValueError. Zenoh would accept `*`, which drives every
    robot.
    """
    if not is_robot_name(text):
        raise ValueError(
            f"robot name {text[:80]!r}: use a letter, then up to 63 letters, digits, '_' or '-' "
            "(such as Fred)"
        )
    return text


def key_for(key: str, robot: str = "") -> str:
    """The key of a robot's topic or service: `cmd_vel` for the robot at the root, else
    `Fred/cmd_vel`. A key that begins with the robot's name, as one from its file may, is returned
    unchanged; one that begins with a slash is at the root whatever the robot.
    """
    if key.startswith("/"):
        return key[1:]
    return f"{robot}/{key}" if robot and not key.startswith(f"{robot}/") else key


def resume_command(robot: str) -> str:
    """The command that lets every source drive a robot again."""
    return f"holozen controller {robot and f'{robot} '}--resume"


def release_command(robot: str) -> str:
    """The command that ends the software stop of a robot."""
    return f"holozen release {robot}".strip()


def topic(key: str) -> Topic | None:
    """The table's row for a key, with or without a robot's name before it."""
    last = key.rpartition("/")[2]
    return next((row for row in TOPICS if row.key == last), None)


def is_command(key: str, type_names: Iterable[str]) -> bool:
    """Whether messages of any of these types on `key` move a robot, by the key's row in the table
    or by a type.

    Commands are sent at once, and refused if they have an unknown field: a typo would leave the
    robot standing. Telemetry is batched, and unknown fields are ignored: a newer sim may send more
    than an older reader knows.
    """
    row = topic(key)
    return bool(row and row.is_command) or not COMMAND_TYPES.isdisjoint(type_names)


def implausible(command: Any, type_name: str) -> str:
    """Which component of a command is a mistake, whatever the robot's limits, and the bound; empty
    if none is.

    `command` is a message of that type, or any object with its fields.
    """
    name = type_name.rpartition("/")[2]
    if name == "TwistStamped":
        name, command = "Twist", command.twist
    for part, most, unit in MAX_OF.get(name, ()):
        for axis in "xyz":
            if abs(value := getattr(getattr(command, part), axis)) > most:
                return f"{part}.{axis} is {value:g} {unit}; at most {most:g}"
    for kind, most in MAX_OF_JOINT.items() if name == "JointState" else ():
        for index, value in enumerate(getattr(command, kind)):
            if abs(value) > most:
                joint = (
                    f" of joint {command.name[index][:80]!r}" if index < len(command.name) else ""
                )
                return f"{kind}[{index}]{joint} is {value:g}; at most {most:g}"
    return ""


def stop(command: Any, type_name: str) -> dict[str, Any] | None:
    """The fields of the message that stops what a command moves; None for one that ends by itself,
    as a goal does.

    `command` is as in `implausible`. Joints hold still after a rate or an effort; what goes to a
    position stops there.
    """
    if type_name.endswith("/JointState") and (command.velocity or command.effort):
        # an effort of zero would let them coast
        return {"name": command.name, "velocity": [0.0] * len(command.name)}
    return {} if type_name in COMMAND_TYPES else None


def stops(command: Any, type_name: str) -> bool:
    """Whether a command moves nothing, such as a Twist of zeros; `command` is as in
    `implausible`.
    """
    name = type_name.rpartition("/")[2]
    if name in ("Twist", "TwistStamped"):
        twist = command.twist if name == "TwistStamped" else command
        return not (twist.linear.x or twist.linear.y or twist.angular.z)
    if name == "Wrench":
        return not any(
            getattr(part, axis) for part in (command.force, command.torque) for axis in "xyz"
        )
    return name == "JointState" and not (
        command.position or any(command.velocity) or any(command.effort)
    )


def service(key: str) -> Service | None:
    """The table's row for a service key, with or without a robot's name before it."""
    last = key.rpartition("/")[2]
    return next((row for row in (*SERVICES, *OF_NODES) if row.key == last), None)
