"""Client: calls a service."""

import contextlib
import math
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any

from holozen.messages.codec import CodecError
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.exceptions import InvalidHandle
from holozen.ros.rclpy.handle import NodeHandle, Owned, wrong_type
from holozen.ros.rclpy.names import key
from holozen.ros.rclpy.qos import QoSProfile
from holozen.ros.rclpy.task import Future, TaskQueue
from holozen.ros.rclpy.waitable import LATE, Waker, deadline
from holozen.transport.errors import BusError, NoReply, ServiceError
from holozen.transport.graph import on_key

__all__ = ["Client"]

POLL = 0.01  # s between two checks for the service
LOOK = 0.1  # s between two checks whether rclpy was shut down
MAX_WAIT = 86_400.0  # s for a service to answer


class Client(Owned):
    """Created by `Node.create_client`. Each call waits for the service, and for its reply, in its
    own thread.

    So `call` works without a spinning executor. If the service refuses, the future raises
    ServiceError with the reason.
    """

    def __init__(
        self,
        handle: NodeHandle,
        srv_type: Any,
        srv_name: str,
        callback_group: CallbackGroup | None,
        qos_profile: QoSProfile,
    ) -> None:
        self.srv_type, self.srv_name, self.qos_profile = srv_type, srv_name, qos_profile
        self.callback_group = callback_group
        self.tasks = TaskQueue(callback_group)  # the done callbacks of its futures
        self._handle, self._is_closed = handle, False
        self._is_served = handle.bus.served(key(srv_name))
        self._threads: weakref.WeakSet[threading.Thread] = weakref.WeakSet()
        self._pending: weakref.WeakSet[Future] = weakref.WeakSet()

    @property
    def service_name(self) -> str:
        """Its name, absolute and remapped."""
        return self.srv_name

    def service_is_ready(self) -> bool:
        """Whether the service is available. Raises RCLError after `rclpy.shutdown()`, InvalidHandle
        if destroyed.
        """
        self._handle.context.check_can_publish(f"look for {self.srv_name}")
        self._check_open()
        return self._is_served()

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until the service is available, at most `timeout_sec` seconds. Returns whether it
        is.

        Raises as `service_is_ready`, and ExternalShutdownException when a signal shuts down rclpy
        while it waits.
        """
        deadline = time.monotonic() + (math.inf if timeout_sec is None else timeout_sec)
        while not self.service_is_ready():
            self._handle.context.check_running(f"wait for {self.srv_name}")
            left = min(POLL, deadline - time.monotonic())
            if left <= 0:
                return False
            time.sleep(left)
        return True

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Call the service and wait for the reply.

        Raises TimeoutError, ServiceError with the service's reason, or InvalidHandle if it is
        destroyed while it waits.
        """
        future = self.call_async(request)
        return wait_for_reply(
            future, self._handle.context, self.srv_name, timeout_sec, self._warn_of_own_service
        )

    def call_async(self, request: Any) -> Future:
        """Call the service. Returns the future of the reply, at once."""
        if not isinstance(request, self.srv_type.Request):
            raise wrong_type(self.srv_name, f"{self.srv_type.__name__}.Request", request)
        self._handle.context.check_can_publish(f"call {self.srv_name}")
        self._check_open()
        future = Future(executor=self.tasks)
        self._pending.add(future)
        thread = threading.Thread(target=self._call, args=(request, future), daemon=True)
        self._threads.add(thread)
        thread.start()
        return future

    def remove_pending_request(self, future: Future) -> None:
        """Stop waiting for that reply."""
        future.cancel()

    def detach(self) -> None:
        """Stop calling; the bus is about to close."""
        self._is_closed = True

    def destroy(self) -> None:
        """Stop calling, and cancel all pending requests."""
        self.detach()
        for future in list(self._pending):
            future.cancel()

    def threads(self) -> list[threading.Thread]:
        """Those that wait for replies, which end with the bus."""
        return list(self._threads)

    def _warn_of_own_service(self) -> None:
        """For a call that takes long: a node that waits in its only thread does not answer."""
        ends = on_key(self._handle.bus.endpoints(), key(self.srv_name), "srv")
        if any(end.session == self._handle.bus.id for end in ends):
            self._handle.logger.warning(
                f"no reply yet from {self.srv_name}, which this node serves itself: does it spin, "
                "in a"
                " MultiThreadedExecutor, with a ReentrantCallbackGroup? call_async and "
                "add_done_callback need neither"
            )

    def _check_open(self) -> None:
        if self._is_closed:
            raise InvalidHandle(f"the client of {self.srv_name} was destroyed")

    def _call(self, request: Any, future: Future) -> None:
        try:
            if (reply := self._reply(request, future)) is not None:
                return future.set_result(reply)
        except (ServiceError, CodecError) as error:
            return future.set_exception(error)
        except Exception as error:
            if not self._is_closed and not isinstance(error, BusError):
                return future.set_exception(error)
        future.cancel()

    def _reply(self, request: Any, future: Future) -> Any:
        """The reply to a request; None once its future is done or the client is closed."""
        while not (future.done() or self._is_closed):
            if not self._is_served():
                time.sleep(POLL)
                continue
            with contextlib.suppress(NoReply):
                return self._handle.bus.call(
                    key(self.srv_name), request, self.srv_type.Response, MAX_WAIT
                )
        return None


def wait_for_reply(
    future: Future,
    context: Context,
    name: str,
    timeout_sec: float | None = None,
    when_late: Callable[[], None] = lambda: None,
) -> Any:
    """The result of a future of the service or action `name`, once it is there. `when_late` is
    called after LATE.

    Raises its exception, TimeoutError, InvalidHandle if it is cancelled, and what
    `Publisher.publish` raises after a shutdown.
    """
    waker, end, late = Waker(), deadline(timeout_sec), deadline(LATE)
    future.watch(waker.wake)
    while not future.done():
        left = min(LOOK, end - time.monotonic())
        if left <= 0:
            future.cancel()
            raise TimeoutError(f"no reply from {name} within {timeout_sec:g} s")
        context.check_can_publish(f"call {name}")
        waker.wait(left)
        if time.monotonic() > late and not future.done():
            late = math.inf
            when_late()
    if future.cancelled():
        raise InvalidHandle(f"the client of {name} was destroyed while it waited for the reply")
    return future.result()
