"""ActionServer: runs a callback for each accepted goal."""

import traceback
from collections.abc import Callable
from enum import Enum
from functools import partial
from inspect import isawaitable
from typing import Any

from holozen.ros import tracebacks
from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.handle import wrong_type
from holozen.ros.rclpy.names import key
from holozen.ros.rclpy.qos import (
    QoSProfile,
    qos_profile_action_status_default,
    qos_profile_services_default,
)
from holozen.ros.rclpy.service import Service
from holozen.ros.rclpy.task import Future
from holozen.suggest import article
from holozen.transport.actions import CANCEL, KEPT, RESULT, SEND, Goal, Goals, State, key_of

__all__ = [
    "ActionServer",
    "CancelResponse",
    "GoalEvent",
    "GoalResponse",
    "ServerGoalHandle",
    "default_cancel_callback",
    "default_goal_callback",
    "default_handle_accepted_callback",
]


class GoalResponse(Enum):
    """The answer to a new goal."""

    REJECT = 1
    ACCEPT = 2


class CancelResponse(Enum):
    """The answer to a request to cancel a goal."""

    REJECT = 1
    ACCEPT = 2


class GoalEvent(Enum):
    """What changes the state of a goal."""

    EXECUTE = 1
    CANCEL_GOAL = 2
    SUCCEED = 3
    ABORT = 4
    CANCELED = 5


class ServerGoalHandle(HelpfulAttributes):
    """An accepted goal, as the callbacks of its server have it."""

    def __init__(self, server: "ActionServer", goal: Goal, goal_id: Any) -> None:
        self._server, self._goal = server, goal
        self.goal_id, self.request = goal_id, goal.request
        self.outcome = Future()  # of the reply to requests for the result

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ServerGoalHandle) and other._goal is self._goal

    def __hash__(self) -> int:
        return hash(self._goal.id)

    @property
    def is_active(self) -> bool:
        """Whether it has not ended."""
        return self._goal.is_active

    @property
    def is_cancel_requested(self) -> bool:
        """Whether it should be canceled: the callback that executes it checks this."""
        return self._goal.state is State.CANCELING

    @property
    def status(self) -> int:
        """One of the STATUS constants of action_msgs.msg.GoalStatus."""
        return int(self._goal.state)

    def execute(self, execute_callback: Callable[["ServerGoalHandle"], Any] | None = None) -> None:
        """Run a callback for it, by default its server's, in the executor."""
        if not self.is_cancel_requested:
            self._move(State.EXECUTING)
        self._server.notify_execute(self, execute_callback)

    def publish_feedback(self, feedback: Any) -> None:
        """Publish its progress. Raises TypeError for anything but a Feedback of the action."""
        kind = self._server.action_type
        if not isinstance(feedback, kind.Feedback):
            raise wrong_type(self._server.action_name, f"{kind.__name__}.Feedback", feedback)
        self._server.goals.feedback(self._goal, feedback)

    def succeed(self, response: Any = None) -> None:
        """End it: it succeeded, with a Result if the callback returns none."""
        self._move(State.SUCCEEDED, response)

    def abort(self, response: Any = None) -> None:
        """End it: it was given up."""
        self._move(State.ABORTED, response)

    def canceled(self, response: Any = None) -> None:
        """End it: it was canceled, as was requested."""
        self._move(State.CANCELED, response)

    def destroy(self) -> None:
        """Does nothing: a goal that has ended is forgotten after the result timeout."""

    def _move(self, state: State, response: Any = None) -> None:
        try:
            self._server.goals.move(self._goal, state)
        except ValueError as error:
            raise RuntimeError(f"{self._server.action_name}: {error}") from None
        if response is not None:
            self._finish(response)

    def _finish(self, result: Any) -> None:
        reply = self._server.action_type.Impl.GetResultService.Response()
        reply.status, reply.result = self.status, result
        self.outcome.set_result(reply)


def default_handle_accepted_callback(goal_handle: ServerGoalHandle) -> None:
    """Execute the goal."""
    goal_handle.execute()


def default_goal_callback(goal_request: Any) -> GoalResponse:
    """Accept every goal."""
    return GoalResponse.ACCEPT


def default_cancel_callback(cancel_request: Any) -> CancelResponse:
    """Cancel no goal."""
    return CancelResponse.REJECT


class _GoalService(Service):
    """Answers new goals. Work on an accepted one begins after the answer, so that its client knows
    the goal before its progress.
    """

    def __init__(self, *words: Any) -> None:
        super().__init__(*words)
        self.then: dict[int, Callable[[], object]] = {}  # by the id of a response

    def _reply(self, query: Any, response: Any) -> None:
        super()._reply(query, response)
        self.then.pop(id(response), lambda: None)()


class ActionServer(HelpfulAttributes):
    """Serves an action while its node is spun. A callback that executes a goal for long needs an
    executor with several threads, and a reentrant callback group, so that requests to cancel it are
    answered meanwhile.
    """

    def __init__(
        self,
        node: Any,
        action_type: Any,
        action_name: str,
        execute_callback: Callable[[ServerGoalHandle], Any],
        *,
        callback_group: CallbackGroup | None = None,
        goal_callback: Callable[[Any], Any] = default_goal_callback,
        handle_accepted_callback: Callable[
            [ServerGoalHandle], Any
        ] = default_handle_accepted_callback,
        cancel_callback: Callable[[Any], Any] = default_cancel_callback,
        goal_service_qos_profile: QoSProfile = qos_profile_services_default,
        result_service_qos_profile: QoSProfile = qos_profile_services_default,
        cancel_service_qos_profile: QoSProfile = qos_profile_services_default,
        feedback_pub_qos_profile: QoSProfile | int = 10,
        status_pub_qos_profile: QoSProfile = qos_profile_action_status_default,
        result_timeout: float = KEPT,
    ) -> None:
        check_action(action_type)
        self.action_type, self.action_name = action_type, node.resolve_service_name(action_name)
        self.register_goal_callback(goal_callback)
        self.register_cancel_callback(cancel_callback)
        self.register_handle_accepted_callback(handle_accepted_callback)
        self.register_execute_callback(execute_callback)
        self._node, self._handles = node, dict[bytes, ServerGoalHandle]()
        self.goals = Goals(node._holozen.bus, key(self.action_name), action_type, result_timeout)
        travels, group = action_type.Impl, callback_group or node.default_callback_group
        sender = key_of(self.action_name, SEND)
        self._goal_service = node._holozen.own(
            _GoalService(
                node._holozen,
                travels.SendGoalService,
                node.resolve_service_name(sender),
                self._send_goal,
                group,
                goal_service_qos_profile,
            )
        )
        self._services = [self._goal_service] + [
            node.create_service(
                kind,
                key_of(self.action_name, part),
                answer,
                callback_group=callback_group,
                qos_profile=profile,
            )
            for part, kind, answer, profile in (
                (CANCEL, travels.CancelGoalService, self._cancel_goal, cancel_service_qos_profile),
                (RESULT, travels.GetResultService, self._get_result, result_service_qos_profile),
            )
        ]

    def register_handle_accepted_callback(
        self, handle_accepted_callback: Callable[[Any], Any] | None
    ) -> None:
        """Set what is called with each accepted goal; by default it is executed."""
        self._accepted_callback = _callable(
            handle_accepted_callback or default_handle_accepted_callback
        )

    def register_goal_callback(self, goal_callback: Callable[[Any], Any] | None) -> None:
        """Set what is called with each new goal, and returns a GoalResponse; by default each is
        accepted.
        """
        self._goal_callback = _callable(goal_callback or default_goal_callback)

    def register_cancel_callback(self, cancel_callback: Callable[[Any], Any] | None) -> None:
        """Set what is called to cancel a goal, and returns a CancelResponse; by default none is
        canceled.
        """
        self._cancel_callback = _callable(cancel_callback or default_cancel_callback)

    def register_execute_callback(
        self, execute_callback: Callable[[ServerGoalHandle], Any]
    ) -> None:
        """Set what executes a goal, and returns the Result."""
        self._execute_callback = _callable(execute_callback)

    def notify_execute(
        self,
        goal_handle: ServerGoalHandle,
        execute_callback: Callable[[ServerGoalHandle], Any] | None,
    ) -> None:
        """Execute a goal in the executor of the node."""
        executor = self._node.executor
        if executor is None:
            raise RuntimeError(
                f"{self.action_name}: a goal is executed while its node is spun, and it is not"
            )
        executor.create_task(self._execute, goal_handle, execute_callback or self._execute_callback)

    def destroy(self) -> None:
        """Stop serving."""
        for service in self._services:
            self._node.destroy_service(service)
        self.goals.close()

    async def _send_goal(self, request: Any, response: Any) -> Any:
        identity = bytes(request.goal_id.uuid)
        if self.goals.refusal(identity):
            return response
        answer = await _awaited(self._goal_callback(request.goal))
        if not isinstance(answer, GoalResponse):
            text = (
                f"the goal callback returned no GoalResponse but {answer!r}; the goal is rejected"
            )
            self._node.get_logger().warning(f"{self.action_name}: {text}")
        if answer is not GoalResponse.ACCEPT or self.goals.refusal(identity):
            return response
        now = self._node.get_clock().now()
        goal = self.goals.accept(identity, now.nanoseconds, request.goal)
        handle = self._handles[identity] = ServerGoalHandle(self, goal, request.goal_id)
        self._handles = {
            each: one
            for each, one in self._handles.items()
            if one is handle or self.goals.get(each)
        }
        response.accepted, response.stamp = True, now.to_msg()
        self._goal_service.then[id(response)] = partial(
            self._node.executor.create_task, self._accepted_callback, handle
        )
        return response

    def _cancel_goal(self, request: Any, response: Any) -> Any:
        def allows(goal: Goal) -> bool:
            handle = self._handles.get(goal.id)
            return handle is not None and self._cancel_callback(handle) is CancelResponse.ACCEPT

        return self.goals.cancel(request, response, allows)

    async def _get_result(self, request: Any, response: Any) -> Any:
        handle = self._handles.get(bytes(request.goal_id.uuid))
        return await handle.outcome if handle else response

    async def _execute(
        self, handle: ServerGoalHandle, callback: Callable[[ServerGoalHandle], Any]
    ) -> None:
        try:
            result = await _awaited(callback(handle))
            if result is None and handle.outcome.done():
                return
            if not isinstance(result, self.action_type.Result):
                hint = "; write `return result` at its end" if result is None else ""
                wanted, given = (
                    article(f"{self.action_type.__name__}.Result"),
                    article(type(result).__name__),
                )
                raise TypeError(f"the callback must return {wanted}, and gave {given}{hint}")
        except Exception as error:
            end = "is aborted" if handle.is_active else "has failed"
            self._node.get_logger().error(
                f"{self.action_name}: a goal {end}: {type(error).__name__}: {error}"
            )
            tracebacks.clean(error)
            traceback.print_exception(error)
            result = self.action_type.Result()
            if handle.is_active:
                handle.abort()
        if handle.is_active:
            text = "its callback has neither called succeed(), abort() nor canceled()"
            self._node.get_logger().warning(f"{self.action_name}: a goal is aborted: {text}")
            handle.abort()
        handle._finish(result)


async def _awaited(value: Any) -> Any:
    return await value if isawaitable(value) else value


def _callable(value: Any) -> Callable[..., Any]:
    if not callable(value):
        raise TypeError(f"{value!r} is not a function; a callback has to be one")
    return value  # type: ignore[no-any-return]


def check_action(kind: Any) -> None:
    """Raises AttributeError for anything but an action type."""
    if not all(hasattr(kind, part) for part in ("Goal", "Result", "Feedback", "Impl")):
        text = "is not an action type; import one: from example_interfaces.action import Fibonacci"
        raise AttributeError(f"{kind!r} {text}")
