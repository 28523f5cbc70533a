"""The messages that ROS has no type for."""

from typing import Annotated

from msgspec import Meta, field

from holozen.messages.geometry_msgs import Pose, Twist
from holozen.messages.message import Message, UInt8, UInt64
from holozen.messages.nav_msgs import Odometry
from holozen.messages.std_msgs import Header


class CommandSource(Message):
    """A source of commands: its Zenoh priority, its rate in Hz, and whether it is obeyed or held.

    `delay` is the greatest possible age of its last command when it was read, in seconds; 0 if
    unknown.
    """

    source: str = ""
    priority: str = ""
    rate: float = 0.0
    obeyed: bool = False
    held: bool = False
    delay: float = 0.0


class RefusalCount(Message):
    """How many commands were refused for a reason."""

    reason: str = ""
    count: UInt64 = 0


class CommandStatus(Message):
    """Which source drives a robot, and how many commands were accepted and refused.

    `obeyed` is the driving source (empty: none), `priority` its Zenoh priority. `held` is true
    after a source of higher priority took over: lower ones wait for a call of `resume`. `resumed`
    counts these calls; `accepted` and `refused` (by reason; pairs in ROS) count commands since the
    start of the sim, `clamped` those of the accepted that were over the limits. `stopped` names the
    node that set the software stop (empty: none); `sources` are those with recent commands. `name`
    is the robot's in the sim. Commands beyond `max_linear` (m/s) and `max_angular` (rad/s) are
    clamped (0: not known); `strafes` is whether its drive can move it sideways. `commanded` is the
    velocity that it obeys, clamped so and before the limits of its file; zero if none drives it.
    `time_before_collision` (s) is that of its collision monitor, 0 while that is off; `limited` is
    how it limits `commanded` now, and why (empty: it does not). `last_refusal` and `last_clamped`
    are the source and the reason of the last of each.
    """

    obeyed: str = ""
    priority: str = ""
    held: bool = False
    resumed: UInt64 = 0
    accepted: UInt64 = 0
    refused: Annotated[dict[str, UInt64], Meta(extra={"ros": "RefusalCount[]"})] = field(
        default_factory=dict
    )
    last_refusal: str = ""
    stopped: str = ""
    sources: list[CommandSource] = field(default_factory=list)
    name: str = ""
    max_linear: float = 0.0
    max_angular: float = 0.0
    strafes: bool = True
    commanded: Twist = field(default_factory=Twist)
    time_before_collision: float = 0.0
    limited: str = ""
    clamped: UInt64 = 0
    last_clamped: str = ""


class SimulationStatus(Message):
    """How the sim's time passes. `state` is one of simulation_interfaces/msg/SimulationState;
    `time` is that of `clock` in s, after `steps` steps of `step` seconds. Each reset begins a new
    `epoch`, in which the time may start again.

    `real_time_factor` is measured over the last second; `target` is the one to keep (0: as fast as
    possible). A sim that falls behind by more than 0.1 s does not catch up: this counts as one of
    `overruns`, and adds to `lost`, the seconds of real time lost since the start. `engine` is the
    physics engine, and why it was chosen.
    """

    state: UInt8 = 0
    time: float = 0.0
    steps: UInt64 = 0
    step: float = 0.0
    epoch: UInt64 = 0
    real_time_factor: float = 0.0
    target: float = 0.0
    overruns: UInt64 = 0
    lost: float = 0.0
    engine: str = ""


class NextGoalRequest(Message):
    request_goal: int = 0


class NextGoalReply(Message):
    """A goal in the odom frame, in metres and radians; `end_of_list` is 1 for the last one."""

    x_goal: float = 0.0
    y_goal: float = 0.0
    theta_goal: float = 0.0
    end_of_list: int = 0


class GetPoseRequest(Message):
    """Names a robot; an empty name is the robot at the root."""

    name: str = ""


class GetPoseReply(Message):
    """The last odom of a robot and its age in seconds, measured from its arrival."""

    odom: Odometry = field(default_factory=Odometry)
    age: float = 0.0


class SceneEntity(Message):
    """An entity of the sim and its pose in the world. `number` is different after every spawn, in
    any sim.

    `command` and `odometry` are the keys of its commands and its odometry; empty if it has none.
    `joints` are the positions of its joints, in rad or m, in the order of RobotDescriptionReply.
    """

    name: str = ""
    number: UInt64 = 0
    command: str = ""
    odometry: str = ""
    pose: Pose = field(default_factory=Pose)
    joints: list[float] = field(default_factory=list)


class GetSceneRequest(Message):
    """Asks for all entities. With `without_joints` their `joints` are empty, which takes a sim half
    the time.
    """

    without_joints: bool = False


class GetSceneReply(Message):
    """All entities of a sim, robots and others."""

    entities: list[SceneEntity] = field(default_factory=list)


class RobotDescriptionRequest(Message):
    """Names an entity: a robot or an object."""

    name: str = ""


class RobotDescriptionReply(Message):
    """Its URDF, with the visual meshes in it, and the `number` and the names of the `joints` of its
    SceneEntity.
    """

    description: str = ""
    number: UInt64 = 0
    joints: list[str] = field(default_factory=list)


class SeenEntity(Message):
    """Where the `links` of an entity are in the world. `number` is that of SceneEntity."""

    name: str = ""
    number: UInt64 = 0
    links: list[str] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)


class Exposure(Message):
    """An image to render: the scene at the time of `header`, and the camera, which is at `pose` in
    the world and looks along its x axis. A `width` of 0 is the end of the camera that has these
    keys.

    `image`, `info` and `depth` are the keys to publish on (empty: none), with the stamp and frame
    of `header`. `width` and `height` in pixels; `field_of_view` across the width in rad; `near` and
    `far` in m; `encoding` is "rgb8" or "mono8"; the noise is added to pixel values from 0 to 1.
    `ground`: whether there is a level plane at z = 0.
    """

    header: Header = field(default_factory=Header)
    image: str = ""
    info: str = ""
    depth: str = ""
    width: UInt64 = 0
    height: UInt64 = 0
    field_of_view: float = 0.0
    near: float = 0.0
    far: float = 0.0
    encoding: str = ""
    noise_mean: float = 0.0
    noise_stddev: float = 0.0
    seed: UInt64 = 0
    pose: Pose = field(default_factory=Pose)
    ground: bool = False
    entities: list[SeenEntity] = field(default_factory=list)
