"""Actions, as ROS 2 has them: goals that take time, on three services and two topics below the
action's key.

The client makes the goal's id and sends it with the goal (`send_goal`); the server accepts or
rejects it, publishes progress (`feedback`) and the states of all its goals (`status`), and answers
a request for the result (`get_result`) when the goal has ended. Until then anyone may ask it to
cancel (`cancel_goal`).
Source: ROS 2's design, "Actions"; codes and transitions are those of action_msgs and rcl_action.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from holozen.transport.errors import TIMEOUT, ServiceError
from holozen.transport.samples import Sample, until_closed
from holozen.transport.services import answer_in_turn, refusal, refuse

if TYPE_CHECKING:
    from holozen.transport.bus import Bus
    from holozen.transport.graph import Endpoint
    from holozen.transport.node import Node

BELOW = "/_action/"  # between an action's key and a part of it
SEND, CANCEL, RESULT, FEEDBACK, STATUS = (
    "send_goal",
    "cancel_goal",
    "get_result",
    "feedback",
    "status",
)

KEPT = 10.0  # s that the result of a goal is kept after its end, as in ROS 2
MAX_GOALS = 256  # goals of a server, ended ones included
MAX_WAITING = 100  # requests for the result of one goal
MAX_RESULT_WAIT = 86_400.0  # s of one request for a result
GONE = 1.0  # s without a server after which the goal is lost
POLL = 0.02  # s between two checks for it
NO_ID = bytes(16)
OLD = "it may have been sent more than {limit:g} s ago; send it again"


class State(IntEnum):
    """The states of a goal, as of action_msgs/msg/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def is_end(self) -> bool:
        """Whether a goal in this state has ended."""
        return self >= State.SUCCEEDED


_NEXT = {
    State.ACCEPTED: (State.EXECUTING, State.CANCELING),
    State.EXECUTING: (State.CANCELING, State.SUCCEEDED, State.ABORTED),
    State.CANCELING: (State.SUCCEEDED, State.CANCELED, State.ABORTED),
}


class Cancel(IntEnum):
    """The answers to a request to cancel, as of action_msgs/srv/CancelGoal."""

    NONE = 0
    REJECTED = 1
    UNKNOWN_GOAL_ID = 2
    GOAL_TERMINATED = 3


def key_of(action: str, part: str) -> str:
    """The key of a service or a topic of an action: `navigate_to_pose/_action/send_goal`."""
    return f"{action}{BELOW}{part}"


def new_id() -> bytes:
    """A new goal's id."""
    return os.urandom(16)


class Goal:
    """A goal of a server. `stamp` is when it was accepted, in ns; `result` the reply to requests
    for its result.
    """

    def __init__(self, identity: bytes, stamp: int, request: Any) -> None:
        self.id, self.stamp, self.request = identity, stamp, request
        self.state = State.ACCEPTED
        self.result: Any = None
        self.ended = 0.0  # s, monotonic
        self.waiting: list[Any] = []  # requests for its result

    @property
    def is_active(self) -> bool:
        """Whether it has not ended."""
        return not self.state.is_end


class Goals:
    """The goals of one action server with their states, and the two topics. `action` names its
    messages, as holozen.messages.action.Action does. All methods may be called from any thread.
    """

    def __init__(self, bus: Bus, key: str, action: Any, kept: float = KEPT) -> None:
        from holozen.messages import action_msgs

        self._messages, self._action, self._kept = action_msgs, action, kept
        self.lock = threading.RLock()
        self._all: dict[bytes, Goal] = {}
        for kind in (
            action.Goal,
            action.Impl.SendGoalService.Response,
            action.Impl.GetResultService.Response,
        ):
            bus.define(kind)  # the publisher does so for the feedback
        self._feedback = bus.publisher(key_of(key, FEEDBACK), action.Impl.FeedbackMessage)
        self._status = bus.publisher(key_of(key, STATUS), action_msgs.GoalStatusArray)

    def get(self, identity: bytes) -> Goal | None:
        """A goal that has not been forgotten."""
        with self.lock:
            self._forget()
            return self._all.get(identity)

    def refusal(self, identity: bytes) -> str:
        """Why no goal with this id can be accepted; empty if one can."""
        if not any(identity):  # a request to cancel that one would cancel all
            return "its goal_id is missing, or zero"
        if self.get(identity):
            return "there is a goal with this id already"
        return f"there are {MAX_GOALS} goals already" if len(self._all) >= MAX_GOALS else ""

    def accept(self, identity: bytes, stamp: int, request: Any) -> Goal:
        """Add a goal. Raises ValueError with the `refusal`."""
        with self.lock:
            if reason := self.refusal(identity):
                raise ValueError(reason)
            goal = self._all[identity] = Goal(identity, stamp, request)
            self._publish()
        return goal

    def move(self, goal: Goal, state: State) -> None:
        """Change the state of a goal. Raises ValueError if that does not follow from its present
        one.
        """
        with self.lock:
            if state not in _NEXT.get(goal.state, ()):
                raise ValueError(f"a goal that is {goal.state.name} cannot become {state.name}")
            goal.state = state
            if state.is_end:
                goal.ended = time.monotonic()
            self._publish()

    def feedback(self, goal: Goal, feedback: Any) -> None:
        """Publish the progress of a goal, unless it has ended."""
        with self.lock:
            if goal.is_active:
                message = self._action.Impl.FeedbackMessage()
                message.goal_id.uuid, message.feedback = list(goal.id), feedback
                self._feedback.put(message)

    def to_cancel(self, identity: bytes, stamp: int) -> tuple[Cancel, list[Goal]]:
        """The goals that a request to cancel selects, and the answer if there are none. An id
        selects that goal, a stamp those accepted until then, neither selects all.
        """
        with self.lock:
            one = self.get(identity)
            if identity != NO_ID and not stamp and (one is None or not one.is_active):
                return (Cancel.GOAL_TERMINATED if one else Cancel.UNKNOWN_GOAL_ID), []
            every = identity == NO_ID and not stamp
            found = [
                goal
                for goal in self._all.values()
                if every or goal is one or 0 < goal.stamp <= stamp
            ]
            return Cancel.NONE, [
                goal for goal in found if goal.state in (State.ACCEPTED, State.EXECUTING)
            ]

    def cancel(self, request: Any, reply: Any, allows: Callable[[Goal], bool]) -> Any:
        """Fill in the reply to a request to cancel, and begin to cancel those goals for which
        `allows` is true.
        """
        info = request.goal_info
        code, goals = self.to_cancel(bytes(info.goal_id.uuid), nanoseconds(info.stamp))
        canceled = [goal for goal in goals if self._canceled(goal, allows)]
        reply.return_code = int(Cancel.REJECTED if goals and not canceled else code)
        reply.goals_canceling = [self._info(goal, type(info)) for goal in canceled]
        return reply

    def _canceled(self, goal: Goal, allows: Callable[[Goal], bool]) -> bool:
        if not allows(goal):
            return False
        with self.lock:
            if goal.state not in (State.ACCEPTED, State.EXECUTING):  # it has ended meanwhile
                return False
            self.move(goal, State.CANCELING)
        return True

    def active(self) -> list[Goal]:
        """The goals that have not ended."""
        with self.lock:
            return [goal for goal in self._all.values() if goal.is_active]

    def close(self) -> None:
        """Withdraw the topics."""
        self._feedback.close()
        self._status.close()

    def _forget(self) -> None:
        now = time.monotonic()
        for goal in [
            one for one in self._all.values() if not one.is_active and now - one.ended > self._kept
        ]:
            del self._all[goal.id]

    def _info(self, goal: Goal, kind: Any) -> Any:
        info = kind()
        info.goal_id.uuid = list(goal.id)
        info.stamp.sec, info.stamp.nanosec = divmod(goal.stamp, 1_000_000_000)
        return info

    def _publish(self) -> None:
        self._forget()
        m = self._messages
        states = [
            m.GoalStatus(self._info(goal, m.GoalInfo), int(goal.state))
            for goal in self._all.values()
        ]
        self._status.put(m.GoalStatusArray(states))


def nanoseconds(stamp: Any) -> int:
    """A Time as one number."""
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)


class ActionServer(Goals):
    """Serves an action of Structs: from its own threads after `start`, or else whenever `answer` is
    called.

    `refuses` returns why a goal is rejected, or "". Our clients receive the reason, those of ROS
    only the rejection. `begin` is called with this server and each accepted goal, and has to end
    the goal by `finish`. A goal that is to be cancelled is CANCELING until then. A goal that was
    sent more than `max_age` seconds ago is rejected, and so is one whose client no longer waits for
    the answer.
    """

    def __init__(
        self,
        bus: Bus,
        key: str,
        action: Any,
        refuses: Callable[[Any], str],
        begin: Callable[[ActionServer, Goal], None],
        max_age: float = math.inf,
    ) -> None:
        super().__init__(bus, key, action)
        from holozen.messages.action_msgs import CancelGoalReply, CancelGoalRequest

        self._refuses, self._begin, self._max_age = refuses, begin, max_age
        send, result = action.Impl.SendGoalService, action.Impl.GetResultService
        self._result_type = result.Response
        self._goals = bus.serve(key_of(key, SEND), send.Request, send.Response, self._accept)
        cancels = bus.serve(
            key_of(key, CANCEL),
            CancelGoalRequest,
            CancelGoalReply,
            lambda request: self.cancel(request, CancelGoalReply(), lambda _: True),
        )
        self._servers = [self._goals, cancels]
        self._results = bus.serve(
            key_of(key, RESULT), result.Request, result.Response, _answered_later
        )
        self._accepted = send.Response

    @property
    def caller(self) -> str:
        """The claimed sender of the goal that `refuses` or `begin` is called with."""
        return self._goals.caller

    def start(self) -> None:
        """Answer from threads, until the bus is closed."""
        for server in self._servers:
            server.start()
        threading.Thread(target=self._wait_for_results, daemon=True).start()

    def answer(self) -> bool:
        """Answer waiting requests, for a short time. Returns whether it read any."""
        read = False
        while (query := self._results.try_recv()) is not None:
            self._result(query)
            read = True
        return answer_in_turn(self._servers) or read

    def finish(self, goal: Goal, state: State, result: Any) -> None:
        """End a goal, and answer the requests that wait for its result."""
        with self.lock:
            if goal.state is State.ACCEPTED:
                self.move(goal, State.EXECUTING)
            self.move(goal, state)
            goal.result = self._result_type(status=int(state), result=result)
            waiting, goal.waiting = goal.waiting, []
        for query in waiting:
            self._reply(query, goal.result)

    def _accept(self, request: Any) -> tuple[Any, str]:
        identity = bytes(request.goal_id.uuid)
        reply = self._accepted()
        if reason := self.refusal(identity) or self._refuses(request.goal):
            return reply, reason
        if (age := self._goals.age()) is not None and age > self._max_age:
            return reply, OLD.format(limit=self._max_age)
        now = time.time_ns()
        goal = self.accept(identity, now, request.goal)
        reply.accepted = True
        reply.stamp.sec, reply.stamp.nanosec = divmod(now, 1_000_000_000)
        self._begin(self, goal)
        return reply, ""

    def _wait_for_results(self) -> None:
        for query in until_closed(self._results.recv):
            self._result(query)

    def _result(self, query: Any) -> None:
        """Answer a request for a result, or keep it until the goal ends."""
        from holozen.messages.codec import CodecError

        if not self._results.is_addressed(query):
            query.drop()
            return None
        try:
            identity = bytes(self._results.read(query).goal_id.uuid)
        except (ServiceError, CodecError) as error:
            with query:
                return refuse(query, str(error))
        with self.lock:
            goal = self.get(identity)
            if goal and goal.is_active:
                if len(goal.waiting) < MAX_WAITING:
                    return goal.waiting.append(query)
                with query:
                    return refuse(
                        query, f"{MAX_WAITING} requests wait for the result of this goal already"
                    )
        return self._reply(query, goal.result if goal else self._result_type())

    def _reply(self, query: Any, reply: Any) -> None:
        with query:
            self._results.reply(query, reply)


def _answered_later(_request: Any) -> Any:
    raise AssertionError("a request for a result is answered at the goal's end")


def wait_for_result(
    node: Node, action: str, payload: bytes, encoding: str, closed: Callable[[], bool]
) -> Sample | None:
    """Ask for the result of a goal, and wait until the goal has ended; None if `closed` became true
    before.

    Raises ServiceError with the server's reason, or once there has been no server for a second.
    """
    key = key_of(action, RESULT)
    is_served, seen = node.served(key), time.monotonic()
    while not closed():
        began = time.monotonic()
        for answer in node.ask(key, MAX_RESULT_WAIT, payload=payload, encoding=encoding):
            if isinstance(answer, Sample):
                return answer
            if answer != TIMEOUT:
                raise refusal(answer)
        now = time.monotonic()
        seen = now if is_served() or now - began > POLL else seen  # it was there when it was asked
        if now - seen > GONE:
            raise ServiceError(f"the server of {action!r} has left before the end of the goal")
        time.sleep(POLL)
    return None


class Found(NamedTuple):
    """An action that a node serves, or has a client of."""

    key: str
    type: str
    node: str
    session: str
    is_server: bool


def found_in(ends: Iterable[Endpoint]) -> list[Found]:
    """The actions among the endpoints of nodes: a server by its service send_goal, a client by its
    subscription to the feedback.
    """
    marks = {("srv", SEND): "_SendGoal", ("sub", FEEDBACK): "_FeedbackMessage"}
    found = []
    for end in ends:
        action, below, part = end.key.rpartition(BELOW)
        mark = marks.get((end.kind, part))
        if below and mark and end.type.endswith(mark):
            found.append(
                Found(action, end.type.removesuffix(mark), end.node, end.session, end.kind == "srv")
            )
    return found
