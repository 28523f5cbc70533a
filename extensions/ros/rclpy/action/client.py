"""ActionClient: sends goals."""

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from holozen.messages import codec
from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.generated import find
from holozen.ros.rclpy.action.server import check_action
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.client import Client, wait_for_reply
from holozen.ros.rclpy.handle import wrong_type
from holozen.ros.rclpy.names import key
from holozen.ros.rclpy.qos import (
    QoSProfile,
    qos_profile_action_status_default,
    qos_profile_services_default,
)
from holozen.ros.rclpy.task import Future
from holozen.transport.actions import (
    CANCEL,
    FEEDBACK,
    MAX_GOALS,
    RESULT,
    SEND,
    STATUS,
    State,
    new_id,
    wait_for_result,
)

__all__ = ["ActionClient", "ClientGoalHandle"]


class ClientGoalHandle(HelpfulAttributes):
    """The answer to a goal that was sent."""

    def __init__(self, client: "ActionClient", goal_id: Any, response: Any) -> None:
        self._client, self.goal_id = client, goal_id
        self.accepted, self.stamp = response.accepted, response.stamp
        self.status = int(State.UNKNOWN)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ClientGoalHandle) and other.goal_id == self.goal_id

    def __hash__(self) -> int:
        return hash(bytes(self.goal_id.uuid))

    def __repr__(self) -> str:
        identity = bytes(self.goal_id.uuid).hex()
        return f"ClientGoalHandle <id={identity}, accepted={self.accepted}, status={self.status}>"

    def cancel_goal(self) -> Any:
        """Ask to cancel it, and wait for the CancelGoal.Response."""
        return self._client._result(self.cancel_goal_async())

    def cancel_goal_async(self) -> Future:
        """Ask to cancel it. Returns the future of the CancelGoal.Response."""
        request = self._client._type.Impl.CancelGoalService.Request()
        request.goal_info.goal_id = self.goal_id
        future: Future = self._client._canceler.call_async(request)
        return future

    def get_result(self) -> Any:
        """Wait for its end: a message with `status` and `result`. Raises as the future of
        `get_result_async`.
        """
        return self._client._result(self.get_result_async())

    def get_result_async(self) -> Future:
        """The future of a message with `status` and `result`. It raises ServiceError if the server
        leaves before.
        """
        request = self._client._type.Impl.GetResultService.Request(goal_id=self.goal_id)
        future: Future = self._client._results.call_async(request)
        return future


class _ResultClient(Client):
    """Waits for results: one request lasts until the goal has ended."""

    def __init__(self, handle: Any, action_name: str, *words: Any) -> None:
        super().__init__(handle, *words)
        self._action = key(action_name)

    def _reply(self, request: Any, future: Future) -> Any:
        bus, kind = self._handle.bus, self.srv_type.Response
        payload, wire = codec.written(request, bus.wire)
        encoding = codec.encoding(wire, type(request))
        reply = wait_for_result(bus, self._action, payload, encoding, lambda: self._is_closed)
        return (
            codec.decode(reply.payload, reply.encoding, (kind,), tolerant=True) if reply else None
        )


class ActionClient(HelpfulAttributes):
    """Sends goals to the server of an action. Callbacks of feedback, and of futures, run while the
    node is spun.
    """

    def __init__(
        self,
        node: Any,
        action_type: Any,
        action_name: str,
        *,
        callback_group: CallbackGroup | None = None,
        goal_service_qos_profile: QoSProfile = qos_profile_services_default,
        result_service_qos_profile: QoSProfile = qos_profile_services_default,
        cancel_service_qos_profile: QoSProfile = qos_profile_services_default,
        feedback_sub_qos_profile: QoSProfile | int = 10,
        status_sub_qos_profile: QoSProfile = qos_profile_action_status_default,
    ) -> None:
        check_action(action_type)
        self._node, self._type, self._name = (
            node,
            action_type,
            node.resolve_service_name(action_name),
        )
        below, travels = f"{self._name}/_action", action_type.Impl
        self._sender, self._canceler = (
            node.create_client(
                kind, f"{below}/{part}", callback_group=callback_group, qos_profile=profile
            )
            for part, kind, profile in (
                (SEND, travels.SendGoalService, goal_service_qos_profile),
                (CANCEL, travels.CancelGoalService, cancel_service_qos_profile),
            )
        )
        name, group = (
            node.resolve_service_name(f"{below}/{RESULT}"),
            callback_group or node.default_callback_group,
        )
        self._results = node._holozen.own(
            _ResultClient(
                node._holozen,
                self._name,
                travels.GetResultService,
                name,
                group,
                result_service_qos_profile,
            )
        )
        self._subscriptions = [
            node.create_subscription(
                kind, f"{below}/{part}", callback, profile, callback_group=callback_group
            )
            for part, kind, callback, profile in (
                (FEEDBACK, travels.FeedbackMessage, self._on_feedback, feedback_sub_qos_profile),
                (STATUS, travels.GoalStatusMessage, self._on_status, status_sub_qos_profile),
            )
        ]
        self._feedback_callbacks: dict[bytes, Callable[[Any], Any]] = {}
        self._handles: dict[bytes, ClientGoalHandle] = {}
        # feedback of goals whose answer the script has not seen yet
        self._early: dict[bytes, list[Any]] = {}

    def server_is_ready(self) -> bool:
        """Whether the action has a server. Raises as `Client.service_is_ready`."""
        return all(
            client.service_is_ready() for client in (self._sender, self._canceler, self._results)
        )

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        """Wait until the action has a server, at most `timeout_sec` seconds. Returns whether it
        has.
        """
        end = time.monotonic() + (math.inf if timeout_sec is None else timeout_sec)
        clients = (self._sender, self._canceler, self._results)
        return all(client.wait_for_service(max(0.0, end - time.monotonic())) for client in clients)

    def send_goal(
        self,
        goal: Any,
        feedback_callback: Callable[[Any], Any] | None = None,
        goal_uuid: Any = None,
    ) -> Any:
        """Send a goal and wait for its end: a message with `status` and `result`; None if it was
        rejected.
        """
        handle = self._result(self.send_goal_async(goal, feedback_callback, goal_uuid))
        return handle.get_result() if handle.accepted else None

    def send_goal_async(
        self,
        goal: Any,
        feedback_callback: Callable[[Any], Any] | None = None,
        goal_uuid: Any = None,
    ) -> Future:
        """Send a goal. Returns the future of a ClientGoalHandle. Progress goes to
        `feedback_callback(message)`.
        """
        if not isinstance(goal, self._type.Goal):
            raise wrong_type(self._name, f"{self._type.__name__}.Goal", goal)
        request = self._type.Impl.SendGoalService.Request()
        request.goal_id = goal_uuid or find("unique_identifier_msgs/msg/UUID")(uuid=list(new_id()))
        request.goal = goal
        self._early[bytes(request.goal_id.uuid)] = []
        if feedback_callback:
            _keep(self._feedback_callbacks, bytes(request.goal_id.uuid), feedback_callback)
        answered = Future(executor=self._sender.tasks)
        sent = self._sender.call_async(request)
        sent.watch(partial(self._answered, sent, request.goal_id, answered))
        return answered

    def destroy(self) -> None:
        """Leave the action. What still waits is cancelled."""
        for client in (self._sender, self._canceler, self._results):
            self._node.destroy_client(client)
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _answered(self, sent: Future, goal_id: Any, answered: Future) -> None:
        identity = bytes(goal_id.uuid)
        if sent.cancelled():
            return answered.cancel()
        if error := sent.exception():
            for table in (self._feedback_callbacks, self._early):
                table.pop(identity, None)
            return answered.set_exception(error)
        handle = ClientGoalHandle(self, goal_id, sent.result())
        if handle.accepted:
            _keep(self._handles, identity, handle)
        else:
            self._feedback_callbacks.pop(identity, None)
        answered.set_result(handle)
        # after the callbacks of `answered`
        self._sender.tasks.create_task(self._report_early, identity)
        return None

    def _result(self, future: Future) -> Any:
        return wait_for_reply(future, self._node.context, self._name)

    def _on_feedback(self, message: Any) -> None:
        identity = bytes(message.goal_id.uuid)
        if identity in self._early:
            self._early[identity].append(message)
        elif callback := self._feedback_callbacks.get(identity):
            callback(message)

    def _report_early(self, identity: bytes, again: bool = False) -> None:
        # a script adds its callback to the future after the goal was sent, which may be after its
        # answer
        if not again:
            self._sender.tasks.create_task(self._report_early, identity, True)
            return
        for message in self._early.pop(identity, ()):
            self._on_feedback(message)

    def _on_status(self, message: Any) -> None:
        for one in message.status_list:
            identity = bytes(one.goal_info.goal_id.uuid)
            if handle := self._handles.get(identity):
                handle.status = one.status


def _keep(table: dict[bytes, Any], identity: bytes, value: Any) -> None:
    """Add to a table that forgets the oldest of more than MAX_GOALS: progress may arrive after the
    result.
    """
    table[identity] = value
    if len(table) > MAX_GOALS:
        del table[next(iter(table))]
