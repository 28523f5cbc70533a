"""Actions as Structs: a goal, a result and a feedback, and from these the messages that travel.

An action class of `holozen run` (`holozen.ros.generated`) has the same names.
"""

from functools import cached_property
from types import SimpleNamespace
from typing import Any

import msgspec

from holozen.messages.message import Int8, Message


class ActionPart(Message):
    """A message of an action. Its class is named after the action and the part:
    NavigateToPoseGoal.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        package, _, name = cls.ROS.replace("/srv/", "/msg/").partition("/msg/")
        if not name.endswith(("_SendGoal", "_GetResult")):  # a service has its underscore already
            part = next(
                part
                for part in ("FeedbackMessage", "Goal", "Result", "Feedback")
                if name.endswith(part)
            )
            name = f"{name.removesuffix(part)}_{part}"
        cls.ROS = f"{package}/action/{name}"


class Action:
    """An action of Structs: `Goal`, `Result`, `Feedback`, and in `Impl` the messages that carry
    them.
    """

    def __init__(
        self, goal: type[ActionPart], result: type[ActionPart], feedback: type[ActionPart]
    ) -> None:
        self.Goal, self.Result, self.Feedback = goal, result, feedback
        self.ROS = goal.ROS.removesuffix("_Goal")

    @cached_property
    def Impl(self) -> SimpleNamespace:
        """The messages that are sent, which add a goal's id, made on first use."""
        from holozen.messages.builtin_interfaces import Time
        from holozen.messages.unique_identifier_msgs import UUID

        return SimpleNamespace(
            SendGoalService=SimpleNamespace(
                Request=self._made("_SendGoalRequest", goal_id=UUID, goal=self.Goal),
                Response=self._made("_SendGoalReply", accepted=bool, stamp=Time),
            ),
            GetResultService=SimpleNamespace(
                Request=self._made("_GetResultRequest", goal_id=UUID),
                Response=self._made("_GetResultReply", status=Int8, result=self.Result),
            ),
            FeedbackMessage=self._made("FeedbackMessage", goal_id=UUID, feedback=self.Feedback),
        )

    def _made(self, ending: str, **fields: Any) -> Any:
        described = [
            (name, kind, msgspec.field(default_factory=int if kind is Int8 else kind))
            for name, kind in fields.items()
        ]
        name = self.ROS.rpartition("/")[2] + ending
        return msgspec.defstruct(name, described, bases=(ActionPart,), module=self.Goal.__module__)
