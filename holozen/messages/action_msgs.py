"""The states of an action's goals, and the request to cancel some."""

from typing import ClassVar

from msgspec import field

from holozen.messages.builtin_interfaces import Time
from holozen.messages.message import Int8, Message
from holozen.messages.unique_identifier_msgs import UUID


class GoalInfo(Message):
    """A goal and when it was accepted."""

    goal_id: UUID = field(default_factory=UUID)
    stamp: Time = field(default_factory=Time)


class GoalStatus(Message):
    STATUS_UNKNOWN: ClassVar[Int8] = 0
    STATUS_ACCEPTED: ClassVar[Int8] = 1
    STATUS_EXECUTING: ClassVar[Int8] = 2
    STATUS_CANCELING: ClassVar[Int8] = 3
    STATUS_SUCCEEDED: ClassVar[Int8] = 4
    STATUS_CANCELED: ClassVar[Int8] = 5
    STATUS_ABORTED: ClassVar[Int8] = 6

    goal_info: GoalInfo = field(default_factory=GoalInfo)
    status: Int8 = 0


class GoalStatusArray(Message):
    status_list: list[GoalStatus] = field(default_factory=list)


class CancelGoalRequest(Message):
    """Without an id and a stamp: all goals; with a stamp: also those accepted until then."""

    goal_info: GoalInfo = field(default_factory=GoalInfo)


class CancelGoalReply(Message):
    ERROR_NONE: ClassVar[Int8] = 0
    ERROR_REJECTED: ClassVar[Int8] = 1
    ERROR_UNKNOWN_GOAL_ID: ClassVar[Int8] = 2
    ERROR_GOAL_TERMINATED: ClassVar[Int8] = 3

    return_code: Int8 = 0
    goals_canceling: list[GoalInfo] = field(default_factory=list)
