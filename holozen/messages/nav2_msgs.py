"""The actions by which Nav2 is sent to goals, as of ROS 2 Jazzy."""

from typing import ClassVar

from msgspec import field

from holozen.messages.action import Action, ActionPart
from holozen.messages.builtin_interfaces import Duration
from holozen.messages.geometry_msgs import PoseStamped
from holozen.messages.message import Float32, Int16, Message, UInt16, UInt32


class NavigateToPoseGoal(ActionPart):
    pose: PoseStamped = field(default_factory=PoseStamped)
    behavior_tree: str = ""


class NavigateToPoseResult(ActionPart):
    NONE: ClassVar[UInt16] = 0
    UNKNOWN: ClassVar[UInt16] = 9000
    FAILED_TO_LOAD_BEHAVIOR_TREE: ClassVar[UInt16] = 9001
    TF_ERROR: ClassVar[UInt16] = 9002
    TIMEOUT: ClassVar[UInt16] = 9003

    error_code: UInt16 = 0
    error_msg: str = ""


class NavigateToPoseFeedback(ActionPart):
    current_pose: PoseStamped = field(default_factory=PoseStamped)
    navigation_time: Duration = field(default_factory=Duration)
    estimated_time_remaining: Duration = field(default_factory=Duration)
    number_of_recoveries: Int16 = 0
    distance_remaining: Float32 = 0.0


class MissedWaypoint(Message):
    index: UInt32 = 0
    goal: PoseStamped = field(default_factory=PoseStamped)
    error_code: UInt16 = 0


class FollowWaypointsGoal(ActionPart):
    number_of_loops: UInt32 = 0
    goal_index: UInt32 = 0
    poses: list[PoseStamped] = field(default_factory=list)


class FollowWaypointsResult(ActionPart):
    NONE: ClassVar[UInt16] = 0
    UNKNOWN: ClassVar[UInt16] = 600
    TASK_EXECUTOR_FAILED: ClassVar[UInt16] = 601

    missed_waypoints: list[MissedWaypoint] = field(default_factory=list)
    error_code: UInt16 = 0
    error_msg: str = ""


class FollowWaypointsFeedback(ActionPart):
    current_waypoint: UInt32 = 0


NavigateToPose = Action(NavigateToPoseGoal, NavigateToPoseResult, NavigateToPoseFeedback)
FollowWaypoints = Action(FollowWaypointsGoal, FollowWaypointsResult, FollowWaypointsFeedback)
