"""Client: asks a service."""

import threading
import time
import weakref
from typing import TYPE_CHECKING, Any

from holozen.codec import CodecError
from holozen.errors import BusError, NoReply, ServiceError
from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.exceptions import InvalidHandle
from holozen.ros.missing import Told
from holozen.ros.qos import QoSProfile
from holozen.ros.task import Future, Tasks

if TYPE_CHECKING:
    from holozen.ros.node import Node

__all__ = ["Client"]

LOOK = 0.01  # s between two looks whether the service is there
LONGEST = 86_400.0  # s for a service to answer


class Client(Told):
    """Made by `Node.create_client`. A call waits for the service, and for its reply, in a thread of its own.

    So `call` needs nobody who spins. A service that refuses makes its future raise ServiceError with the reason.
    """

    def __init__(
        self,
        node: "Node",
        srv_type: Any,
        srv_name: str,
        key: str,
        callback_group: CallbackGroup | None,
        qos_profile: QoSProfile,
    ) -> None:
        self.srv_type, self.srv_name, self.qos_profile = srv_type, srv_name, qos_profile
        self.callback_group = callback_group
        self.tasks = Tasks(callback_group)  # the done callbacks of its futures
        self._node, self._key, self._closed = node, key, threading.Event()
        self._is_served = node._holozen.bus.served(key)
        self._threads: weakref.WeakSet[threading.Thread] = weakref.WeakSet()
        self._asked: weakref.WeakSet[Future] = weakref.WeakSet()

    @property
    def service_name(self) -> str:
        """Its name, absolute and remapped."""
        return self.srv_name

    @property
    def logger_name(self) -> str:
        """The name of its node's logger."""
        return str(self._node.get_logger().name)

    def service_is_ready(self) -> bool:
        """Whether somebody serves it by now. Raises RCLError after `rclpy.shutdown()`, InvalidHandle if destroyed."""
        self._node.context.check_may_speak(f"look for {self.srv_name}")
        self._check_open()
        return self._is_served()

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until somebody serves it, at most so many seconds; whether somebody does.

        Raises as `service_is_ready`, and ExternalShutdownException when a signal ends rclpy meanwhile.
        """
        deadline = None if timeout_sec is None else time.monotonic() + timeout_sec
        while not self.service_is_ready():
            self._node.context.check_running(f"wait for {self.srv_name}")
            left = LOOK if deadline is None else min(LOOK, deadline - time.monotonic())
            if left <= 0:
                return False
            self._closed.wait(left)
        return True

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Ask, and wait for the reply.

        Raises TimeoutError, ServiceError with the service's reason, or InvalidHandle if it is destroyed meanwhile.
        """
        future, done = self.call_async(request), threading.Event()
        future.watch(done.set)
        deadline = None if timeout_sec is None or timeout_sec < 0 else time.monotonic() + timeout_sec
        while not done.is_set():
            left = 0.1 if deadline is None else min(0.1, deadline - time.monotonic())
            if left <= 0:
                future.cancel()
                raise TimeoutError(f"no reply from {self.srv_name} within {timeout_sec:g} s")
            self._node.context.check_may_speak(f"ask {self.srv_name}")
            done.wait(left)
        if future.cancelled():
            raise InvalidHandle(f"the client of {self.srv_name} was destroyed while it waited for the reply")
        return future.result()

    def call_async(self, request: Any) -> Future:
        """Ask. The future of the reply is given at once."""
        if not isinstance(request, self.srv_type.Request):
            given = request.__name__ if isinstance(request, type) else type(request).__name__
            raise TypeError(f"{self.srv_name}: expected a {self.srv_type.__name__}.Request, and got a {given}")
        self._node.context.check_may_speak(f"ask {self.srv_name}")
        self._check_open()
        future = Future(executor=self.tasks)
        self._asked.add(future)
        thread = threading.Thread(target=self._ask, args=(request, future), daemon=True)
        self._threads.add(thread)
        thread.start()
        return future

    def remove_pending_request(self, future: Future) -> None:
        """Wait no more for that reply."""
        future.cancel()

    def silence(self) -> None:
        """Ask no more."""
        self._closed.set()

    def destroy(self) -> None:
        """Ask no more; what was asked is cancelled."""
        self.silence()
        for future in list(self._asked):
            future.cancel()

    def threads(self) -> list[threading.Thread]:
        """Those that wait for replies, which end with the bus."""
        return list(self._threads)

    def _check_open(self) -> None:
        if self._closed.is_set():
            raise InvalidHandle(f"the client of {self.srv_name} was destroyed")

    def _ask(self, request: Any, future: Future) -> None:
        while not (future.done() or self._closed.is_set()):
            try:
                if not self._is_served():
                    self._closed.wait(LOOK)
                    continue
                reply = self._node._holozen.bus.call(self._key, request, self.srv_type.Response, LONGEST)
                return future.set_result(reply)
            except NoReply:
                continue
            except (ServiceError, CodecError) as error:
                return future.set_exception(error)
            except Exception as error:
                if not self._closed.is_set() and not isinstance(error, BusError):
                    return future.set_exception(error)
                break
        future.cancel()
