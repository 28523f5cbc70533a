"""The goals of an action server: their states, requests to cancel them, and how long their results
are kept.
"""

from typing import Any

import pytest

from holozen.bus import Bus
from holozen.messages.action_msgs import (
    CancelGoalReply,
    CancelGoalRequest,
    GoalInfo,
    GoalStatusArray,
)
from holozen.messages.builtin_interfaces import Time
from holozen.messages.simulation_interfaces import (
    SimulateSteps,
    SimulateStepsGoal,
    SimulateStepsResult,
)
from holozen.messages.unique_identifier_msgs import UUID
from holozen.testing import Wire, wait_for
from holozen.transport.actions import ActionServer, Cancel, Goal, State, key_of
from holozen.transport.errors import ServiceError

SEND, RESULT = SimulateSteps.Impl.SendGoalService, SimulateSteps.Impl.GetResultService
DONE = SimulateStepsResult()


class Case:
    """A server that refuses goals of no steps and ends none by itself, and its client."""

    def __init__(self, wire: Wire) -> None:
        self.begun: list[Goal] = []
        self.client: Bus = wire.bus("client")
        self.server = ActionServer(
            wire.bus("server"),
            "act",
            SimulateSteps,
            lambda goal: "" if goal.steps else "no steps",
            lambda _server, goal: self.begun.append(goal),
        )
        self.server.start()
        for part in ("send_goal", "cancel_goal", "get_result"):
            wait_for(self.client.served(key_of("act", part)))

    def send(self, number: int, steps: int = 1) -> bool:
        request = SEND.Request(identity(number), SimulateStepsGoal(steps))
        return bool(self.client.call(key_of("act", "send_goal"), request, SEND.Response).accepted)

    def cancel(self, number: int = 0, stamp: int = 0) -> tuple[int, list[int]]:
        """The code, and the numbers of the goals that are being cancelled."""
        info = GoalInfo(identity(number), Time(*divmod(stamp, 1_000_000_000)))
        reply = self.client.call(
            key_of("act", "cancel_goal"), CancelGoalRequest(info), CancelGoalReply
        )
        return reply.return_code, [one.goal_id.uuid[15] for one in reply.goals_canceling]

    def result(self, number: int, timeout: float = 30.0) -> int:
        request = RESULT.Request(identity(number))
        return int(
            self.client.call(key_of("act", "get_result"), request, RESULT.Response, timeout).status
        )


def identity(number: int) -> UUID:
    return UUID([0] * 15 + [number])


@pytest.fixture
def case(wire: Wire) -> Case:
    return Case(wire)


def test_a_goal_is_accepted_once_and_its_states_are_published(case: Case) -> None:
    states = case.client.latest(key_of("act", "status"), GoalStatusArray)
    assert not case.send(1, steps=0)
    assert not case.send(0), "a request to cancel goal 0 would cancel all"
    assert case.send(1)
    assert not case.send(1)
    (goal,) = case.begun
    case.server.move(goal, State.EXECUTING)
    for wrong in (State.CANCELED, State.ACCEPTED, State.EXECUTING):
        with pytest.raises(ValueError, match="a goal that is EXECUTING cannot become"):
            case.server.move(goal, wrong)
    case.server.finish(goal, State.SUCCEEDED, DONE)
    assert case.result(1) == State.SUCCEEDED
    assert case.result(2) == State.UNKNOWN
    wait_for(
        lambda: (
            (new := states.read()[0])
            and [one.status for one in new.status_list] == [State.SUCCEEDED]
        )
    )


def test_goals_are_cancelled_by_id_by_time_or_all(case: Case) -> None:
    assert all(map(case.send, (1, 2, 3, 4)))
    first, second, third, fourth = case.begun
    assert case.cancel(9) == (Cancel.UNKNOWN_GOAL_ID, [])
    assert case.cancel(2) == (Cancel.NONE, [2])
    # the second is being cancelled already
    assert case.cancel(stamp=second.stamp) == (Cancel.NONE, [1])
    assert case.cancel(4, stamp=first.stamp) == (Cancel.NONE, [4])
    assert case.cancel() == (Cancel.NONE, [3])
    assert {goal.state for goal in case.begun} == {State.CANCELING}
    case.server.finish(third, State.CANCELED, DONE)
    assert case.cancel(3) == (Cancel.GOAL_TERMINATED, [])
    assert case.result(3) == State.CANCELED
    assert fourth in case.server.active()


def test_a_result_is_given_to_all_who_wait_and_then_forgotten(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert case.send(1)
    (goal,) = case.begun
    with pytest.raises(ServiceError, match="no reply"):
        case.result(1, timeout=0.2)
    wait_for(lambda: goal.waiting)
    case.server.finish(goal, State.ABORTED, DONE)
    assert case.result(1) == State.ABORTED
    monkeypatch.setattr(case.server, "_kept", -1.0)
    assert case.result(1) == State.UNKNOWN
    assert case.send(1)


def test_a_reason_for_a_rejection_is_attached_to_the_reply(case: Case) -> None:
    found: list[Any] = [
        *case.client.ask(key_of("act", "send_goal"), 30, payload=b"{}", encoding="application/json")
    ]
    assert [one.attachment for one in found] == [b"its goal_id is missing, or zero"]
