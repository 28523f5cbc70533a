"""The messages that ROS has no type for."""

from typing import Annotated

from msgspec import Meta, field

from holozen.messages.message import Message, UInt64
from holozen.messages.nav_msgs import Odometry


class CommandSource(Message):
    """A source of commands: its Zenoh priority, its rate in Hz, and whether it is obeyed or held.

    `delay` is the greatest possible age of its last command when it was read, in seconds; 0 if unknown.
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

    `obeyed` is the driving source (empty: none), `priority` its Zenoh priority. `held` is true after a source of higher
    priority took over: lower ones wait for a call of `resume`. `resumed` counts these calls; `accepted` and `refused`
    (by reason; pairs in ROS) count commands since the start of the sim. `stopped` names the node that set the software
    stop (empty: none); `sources` are those with recent commands. `name` is the robot's in the sim. Commands beyond
    `max_linear` (m/s) and `max_angular` (rad/s) are clamped (0: not known); `strafes` is whether its drive can move it
    sideways.
    """

    obeyed: str = ""
    priority: str = ""
    held: bool = False
    resumed: UInt64 = 0
    accepted: UInt64 = 0
    refused: Annotated[dict[str, UInt64], Meta(extra={"ros": "RefusalCount[]"})] = field(default_factory=dict)
    last_refusal: str = ""
    stopped: str = ""
    sources: list[CommandSource] = field(default_factory=list)
    name: str = ""
    max_linear: float = 0.0
    max_angular: float = 0.0
    strafes: bool = True


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
