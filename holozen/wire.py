"""The one table of the wire: key, type, writers, readers, rate, silence rule.

The docs, tests, the command line and the services read it from here.
"""

import re
from collections.abc import Iterable
from typing import NamedTuple

from holozen import messages as m
from holozen.messages import rcl_interfaces as r
from holozen.messages import simulation_interfaces as s

COMMAND_SILENCE = 0.5  # s; a robot without a fresh command for this long stops
MAX_COMMAND_BYTES = 65_536  # a Twist takes about 100; a larger command is not decoded
MAX_STAMP_AGE = 0.5  # s; an older (or as far future) stamp on a TwistStamped is refused
MAX_SPEED, MAX_TURN = 100.0, 1000.0  # m/s, rad/s; a command beyond is a mistake: it is refused, not clamped
MAX_FORCE = 1e4  # N, N m; also of a mistake
MAX_OF_JOINT = {"position": 1e4, "velocity": 1e3, "effort": 1e6}  # rad or m; rad/s or m/s; N m or N; also of a mistake

LATCHED = ("tf_static", "robot_description", "map")  # in ROS 2, late subscribers receive their last message too

PRIORITY_OF = {"teleop": "INTERACTIVE_HIGH", "view": "INTERACTIVE_HIGH", "controller": "DATA_LOW"}
"""Zenoh priority of each command source. Others have DATA, as a plain `zenoh put`."""


class Topic(NamedTuple):
    """A key with a stream of messages. `rate` in Hz, 0: on demand. After `silence` seconds readers call it stale."""

    key: str
    types: tuple[type[m.Message], ...]
    writers: tuple[str, ...]
    readers: tuple[str, ...]
    rate: float
    silence: float
    rule: str

    @property
    def type(self) -> type[m.Message]:
        """The default type; the others are accepted too."""
        return self.types[0]

    @property
    def is_command(self) -> bool:
        """Whether it moves a robot: all else comes from the sim and its cameras."""
        return not {"sim", "camera"} & set(self.writers)


class Service(NamedTuple):
    """A key that answers a request with one reply, or with an error and its reason."""

    key: str
    request: type[m.Message]
    reply: type[m.Message]
    server: str
    does: str


class Action(NamedTuple):
    """A key below which goals are sent, see holozen.transport.actions."""

    key: str
    type: str
    server: str
    does: str


TOPICS = (
    Topic("cmd_vel", (m.Twist, m.TwistStamped), ("teleop", "view", "controller"), ("sim",), 20.0, COMMAND_SILENCE,
          "0.5 s without a fresh one: the robot stands"),
    Topic("odom", (m.Odometry,), ("sim",), ("teleop", "view", "controller", "pose_service"), 50.0, 0.2,
          "0.2 s: shown as stale, the controller stops"),
    Topic("cmd_vel_status", (m.CommandStatus,), ("sim",), ("teleop", "view", "controller"), 10.0, 1.0, ""),
    Topic("joint_states", (m.JointState,), ("sim",), (), 50.0, 0.2, ""),
    Topic("tf", (m.TFMessage,), ("sim",), (), 50.0, 0.2, ""),
    Topic("clock", (m.Clock,), ("sim",), (), 50.0, 0.2, ""),
    Topic("simulation_status", (m.SimulationStatus,), ("sim",), (), 10.0, 1.0, ""),
    Topic("scan", (m.LaserScan,), ("sim",), (), 10.0, 1.0, ""),
    Topic("imu", (m.Imu,), ("sim",), (), 100.0, 0.2, ""),
    Topic("exposures", (m.Exposure,), ("sim",), ("camera",), 10.0, 1.0, ""),
    Topic("image_raw", (m.Image,), ("camera",), (), 10.0, 1.0, ""),
    Topic("camera_info", (m.CameraInfo,), ("camera",), (), 10.0, 1.0, ""),
    Topic("joint_command", (m.JointState,), (), ("sim",), 20.0, COMMAND_SILENCE,
          "0.5 s without a fresh one: joints hold still"),
    Topic("gazebo_ros_force", (m.Wrench,), (), ("sim",), 20.0, COMMAND_SILENCE,
          "0.5 s without a fresh one: the force ends"),
    Topic("goal_pose", (m.PoseStamped,), ("view",), ("controller",), 0.0, 0.0,
          "once for each goal; the controller stops without fresh odom"),
)  # fmt: skip

SERVICES = (
    Service("next_goal", m.NextGoalRequest, m.NextGoalReply, "pose_service", "the goal with a number, in odom"),
    Service("get_pose", m.GetPoseRequest, m.GetPoseReply, "pose_service", "a robot's last odom and its age"),
    Service(
        "stop", m.TriggerRequest, m.TriggerReply, "sim", "the robot stands, whatever is commanded, until `release`"
    ),
    Service("release", m.TriggerRequest, m.TriggerReply, "sim", "ends a `stop`; by itself it moves nothing"),
    Service("resume", m.TriggerRequest, m.TriggerReply, "sim", "lets overruled sources drive again"),
    Service("spawn_entity", s.SpawnEntityRequest, s.SpawnEntityReply, "sim", "adds a robot or object to the world"),
    Service("delete_entity", s.DeleteEntityRequest, s.DeleteEntityReply, "sim", "removes an entity"),
    Service("get_entities", s.GetEntitiesRequest, s.GetEntitiesReply, "sim", "the names of all entities"),
    Service("get_entity_state", s.GetEntityStateRequest, s.GetEntityStateReply, "sim", "an entity's pose and velocity"),
    Service("set_entity_state", s.SetEntityStateRequest, s.SetEntityStateReply, "sim", "moves an entity"),
    Service(
        "get_simulation_state",
        s.GetSimulationStateRequest,
        s.GetSimulationStateReply,
        "sim",
        "whether it plays, is paused or stopped",
    ),
    Service(
        "set_simulation_state",
        s.SetSimulationStateRequest,
        s.SetSimulationStateReply,
        "sim",
        "plays, pauses, stops or ends it",
    ),
    Service(
        "step_simulation",
        s.StepSimulationRequest,
        s.StepSimulationReply,
        "sim",
        "makes steps while it is paused; the reply follows all their messages",
    ),
    Service(
        "reset_simulation",
        s.ResetSimulationRequest,
        s.ResetSimulationReply,
        "sim",
        "sets time, poses or entities back to the start",
    ),
    Service("get_scene", m.GetSceneRequest, m.GetSceneReply, "sim", "all entities, their keys and poses"),
    Service(
        "robot_description",
        m.RobotDescriptionRequest,
        m.RobotDescriptionReply,
        "sim",
        "an entity's URDF, with its visual meshes in it",
    ),
)

ACTIONS = (
    Action("navigate_to_pose", "nav2_msgs/action/NavigateToPose", "controller", "drives to a pose in odom"),
    Action(
        "follow_waypoints", "nav2_msgs/action/FollowWaypoints", "controller", "drives to several, one after another"
    ),
    Action(
        "simulate_steps", "simulation_interfaces/action/SimulateSteps", "sim", "as `step_simulation`, with progress"
    ),
)

OF_NODES = (
    Service("list_parameters", r.ListParametersRequest, r.ListParametersReply, "", "names of a node's parameters"),
    Service("get_parameters", r.GetParametersRequest, r.GetParametersReply, "", "their values"),
    Service("set_parameters", r.SetParametersRequest, r.SetParametersReply, "", "sets all of them, or none"),
    Service(
        "describe_parameters", r.DescribeParametersRequest, r.DescribeParametersReply, "", "their types and ranges"
    ),
)
"""The services of every node with parameters, below its name: `sim/get_parameters`."""


def table() -> str:
    """The table as Markdown, for docs/wire.md (`scripts/tables` puts it there)."""
    topics = [_topic_row(row) for row in TOPICS]
    services = [f"| `{row.key}` | {row.reply.ROS} | {row.server} | {row.does} |" for row in SERVICES]
    actions = [f"| `{row.key}` | {row.type} | {row.server} | {row.does} |" for row in ACTIONS]
    heads = [f"| {kind} | type | server | what it does |\n|---|---|---|---|" for kind in ("service", "action")]
    first = ("| key | type | writers -> readers | rate | silence rule |", "|---|---|---|---|---|")
    return "\n".join([*first, *topics, "", heads[0], *services, "", heads[1], *actions])


def _topic_row(row: Topic) -> str:
    types = row.type.ROS + "".join(f" ({other.__name__} accepted)" for other in row.types[1:])
    # Any plain Zenoh tool may write commands and read everything.
    writers = [*row.writers, "anyone"] if row.is_command else row.writers
    ends = f"{', '.join(writers)} -> {', '.join(row.readers) or 'anyone'}"
    rate = f"{row.rate:g} Hz" if row.rate else "on demand"
    return f"| `{row.key}` | {types} | {ends} | {rate} | {row.rule} |"


_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


def robot_name(text: str) -> str:
    """`text` if it may name a robot, else ValueError. Zenoh would accept `*`, which drives every robot."""
    if not _NAME.fullmatch(text):
        raise ValueError(
            f"robot name {text[:80]!r}: use a letter, then up to 63 letters, digits, '_' or '-' (such as Fred)"
        )
    return text


def key_for(key: str, robot: str = "") -> str:
    """The key of a robot's topic or service: `cmd_vel` for the robot at the root, else `Fred/cmd_vel`. A file may hold
    the robot's name already.
    """
    return f"{robot}/{key}" if robot and not key.startswith(f"{robot}/") else key


def topic(key: str) -> Topic | None:
    """The table's row for a key, with or without a robot's name before it."""
    last = key.rpartition("/")[2]
    return next((row for row in TOPICS if row.key == last), None)


def is_command(key: str, types: Iterable[type[m.Message]]) -> bool:
    """Whether messages of `types` on `key` move a robot. On a key that is not in the table the type decides.

    Commands are sent at once, and refused if they have an unknown field: a typo would leave the robot standing.
    Telemetry is batched, and unknown fields are ignored: a newer sim may send more than an older reader knows.
    """
    row = topic(key)
    return row.is_command if row else any(kind.ROS in _COMMAND_TYPES for kind in types)


def implausible(command: m.Message) -> str:
    """Which component of a command is a mistake, whatever the robot's limits, and the bound; empty if none is."""
    if isinstance(command, m.Wrench):
        for part, unit in (("force", "N"), ("torque", "N m")):
            for axis in "xyz":
                if abs(value := getattr(getattr(command, part), axis)) > MAX_FORCE:
                    return f"{part}.{axis} is {value:g} {unit}; at most {MAX_FORCE:g}"
    if isinstance(command, m.JointState):
        for kind, most in MAX_OF_JOINT.items():
            for index, value in enumerate(getattr(command, kind)):
                if abs(value) > most:
                    name = f" of joint {command.name[index][:80]!r}" if index < len(command.name) else ""
                    return f"{kind}[{index}]{name} is {value:g}; at most {most:g}"
    twist = command.twist if isinstance(command, m.TwistStamped) else command
    if isinstance(twist, m.Twist):
        for part, most, unit in (("linear", MAX_SPEED, "m/s"), ("angular", MAX_TURN, "rad/s")):
            for axis in "xyz":
                if abs(value := getattr(getattr(twist, part), axis)) > most:
                    return f"{part}.{axis} is {value:g} {unit}; at most {most:g}"
    return ""


_COMMAND_TYPES = {kind.ROS for row in TOPICS if "sim" in row.readers for kind in row.types} - {
    kind.ROS for row in TOPICS if not row.is_command for kind in row.types
}


def service(key: str) -> Service | None:
    """The table's row for a service key, with or without a robot's name before it."""
    last = key.rpartition("/")[2]
    return next((row for row in (*SERVICES, *OF_NODES) if row.key == last), None)
