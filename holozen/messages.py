"""Messages of the wire: the ROS names and fields, as msgspec Structs.

Units and frames are those of ROS (REP 103, REP 105): metres, radians, seconds; x forward, y left, z up.
A field left out is zero; a field that does not exist is refused by name.
"""

import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar

from msgspec import Meta, Struct, field

Covariance = Annotated[list[float], Meta(min_length=36, max_length=36)]
"""A 6 x 6 matrix, row by row, over x, y, z and the rotations about x, y, z."""


class Message(Struct, forbid_unknown_fields=True):
    """What every message is: a Struct that knows its ROS name and refuses fields it does not have."""

    ROS: ClassVar[str] = ""
    SETTLE: ClassVar[Callable[[Any], None] | None] = None  # checks what has to be before it is written
    ANY_NUMBER: ClassVar[bool] = False  # whether one with a NaN or an infinity is sent, as CDR, or else refused


class Time(Message):
    """Seconds and nanoseconds since the clock's start. A zero time means "no stamp"."""

    ROS: ClassVar[str] = "builtin_interfaces/msg/Time"
    sec: Annotated[int, Meta(ge=-(2**31), lt=2**31)] = 0
    nanosec: Annotated[int, Meta(ge=0, lt=1_000_000_000)] = 0

    @classmethod
    def of(cls, seconds: float) -> "Time":
        """The Time nearest to `seconds`."""
        return cls(*divmod(round(seconds * 1e9), 1_000_000_000))

    def seconds(self) -> float:
        """This time as one number, in seconds."""
        return self.sec + self.nanosec * 1e-9


class Header(Message):
    ROS: ClassVar[str] = "std_msgs/msg/Header"
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


class Vector3(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/Vector3"
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Point(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/Point"
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Quaternion(Message):
    """A rotation. As in ROS 2, the default is no rotation."""

    ROS: ClassVar[str] = "geometry_msgs/msg/Quaternion"
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0

    def yaw(self) -> float:
        """The rotation about z, in radians within (-pi, pi]."""
        sine = 2.0 * (self.w * self.z + self.x * self.y)
        cosine = 1.0 - 2.0 * (self.y * self.y + self.z * self.z)
        return math.atan2(sine, cosine)


class Twist(Message):
    """A velocity: linear in m/s, angular in rad/s."""

    ROS: ClassVar[str] = "geometry_msgs/msg/Twist"
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)

    @classmethod
    def planar(cls, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> "Twist":
        """Forward and left in m/s, counter-clockwise in rad/s."""
        return cls(Vector3(x, y, 0.0), Vector3(0.0, 0.0, turn))

    def is_slow(self, limit: float = 0.0) -> bool:
        """Whether no component is above `limit` in m/s or rad/s; by default, whether this is a stop. NaN is none."""
        sizes = (abs(size) for v in (self.linear, self.angular) for size in (v.x, v.y, v.z))
        return all(size <= limit for size in sizes)


class TwistStamped(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/TwistStamped"
    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


class Pose(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/Pose"
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


class PoseWithCovariance(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/PoseWithCovariance"
    pose: Pose = field(default_factory=Pose)
    covariance: Covariance = field(default_factory=lambda: [0.0] * 36)


class TwistWithCovariance(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/TwistWithCovariance"
    twist: Twist = field(default_factory=Twist)
    covariance: Covariance = field(default_factory=lambda: [0.0] * 36)


class Odometry(Message):
    """Where a robot is and how it moves: the pose in `header.frame_id`, the twist in `child_frame_id`."""

    ROS: ClassVar[str] = "nav_msgs/msg/Odometry"
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


class Transform(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/Transform"
    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


class TransformStamped(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/TransformStamped"
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)


class TFMessage(Message):
    ROS: ClassVar[str] = "tf2_msgs/msg/TFMessage"
    transforms: list[TransformStamped] = field(default_factory=list)


class JointState(Message):
    """Joint angles in rad (or metres) and rates in rad/s (or m/s), in the order of `name`."""

    ROS: ClassVar[str] = "sensor_msgs/msg/JointState"
    header: Header = field(default_factory=Header)
    name: list[str] = field(default_factory=list)
    position: list[float] = field(default_factory=list)
    velocity: list[float] = field(default_factory=list)
    effort: list[float] = field(default_factory=list)


class Clock(Message):
    ROS: ClassVar[str] = "rosgraph_msgs/msg/Clock"
    clock: Time = field(default_factory=Time)


class CommandSource(Message):
    """One who commands a robot: its Zenoh priority, commands a second (Hz), and whether it is obeyed or held."""

    ROS: ClassVar[str] = "holozen/msg/CommandSource"
    source: str = ""
    priority: str = ""
    rate: float = 0.0
    obeyed: bool = False
    held: bool = False


class CommandStatus(Message):
    """Who drives a robot, and what became of the commands it got.

    `obeyed` is the driving source (empty: nobody), `priority` its Zenoh priority. `held` is true after a
    higher source took over: lower ones wait for a call of `resume`. `resumed` counts those calls, `accepted` and
    `refused` (by reason; pairs in ROS) the commands, since the sim's start. `stopped` names who set the software stop
    (empty: nobody did); `sources` are those that spoke lately.
    """

    ROS: ClassVar[str] = "holozen/msg/CommandStatus"
    obeyed: str = ""
    priority: str = ""
    held: bool = False
    resumed: int = 0
    accepted: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    last_refusal: str = ""
    stopped: str = ""
    sources: list[CommandSource] = field(default_factory=list)


class NextGoalRequest(Message):
    ROS: ClassVar[str] = "holozen/srv/NextGoal"
    request_goal: int = 0


class NextGoalReply(Message):
    """A goal in the odom frame, metres and radians; `end_of_list` is 1 with the last one."""

    ROS: ClassVar[str] = "holozen/srv/NextGoal"
    x_goal: float = 0.0
    y_goal: float = 0.0
    theta_goal: float = 0.0
    end_of_list: int = 0


class GetPoseRequest(Message):
    """Which robot; an empty name is the one at the root."""

    ROS: ClassVar[str] = "holozen/srv/GetPose"
    name: str = ""


class GetPoseReply(Message):
    """The last odom of a robot and its age in seconds, measured from its arrival."""

    ROS: ClassVar[str] = "holozen/srv/GetPose"
    odom: Odometry = field(default_factory=Odometry)
    age: float = 0.0


class TriggerRequest(Message):
    ROS: ClassVar[str] = "std_srvs/srv/Trigger"


class TriggerReply(Message):
    ROS: ClassVar[str] = "std_srvs/srv/Trigger"
    success: bool = True
    message: str = ""
