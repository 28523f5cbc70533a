"""Service: runs a callback for each request."""

import inspect
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from holozen.codec import CodecError
from holozen.errors import ServiceError
from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.inbox import Inbox, Waker
from holozen.ros.missing import Told
from holozen.ros.qos import QoSProfile
from holozen.server import refuse

if TYPE_CHECKING:
    from holozen.ros.node import Node

__all__ = ["Service"]

DEPTH = 64  # requests that wait, as in Bus.serve


class Refusal(ServiceError):
    """What a callback of our own raises to refuse a request. It does not end the spin."""


class Service(Told):
    """Made by `Node.create_service`. Requests wait until its node is spun.

    An exception in the callback ends the spin, and the caller is told.
    """

    def __init__(
        self,
        node: "Node",
        srv_type: Any,
        srv_name: str,
        key: str,
        callback: Callable[[Any, Any], Any],
        callback_group: CallbackGroup | None,
        qos_profile: QoSProfile,
    ) -> None:
        self.srv_type, self.srv_name, self.qos_profile = srv_type, srv_name, qos_profile
        self.callback, self.callback_group = callback, callback_group
        self._node, self._closed = node, False
        self._server = node._holozen.bus.serve(key, srv_type.Request, srv_type.Response, _nobody)
        self._inbox: Inbox[Any] = Inbox(self._server.recv, self._server.try_recv, DEPTH)

    @property
    def service_name(self) -> str:
        """Its name, absolute and remapped."""
        return self.srv_name

    @property
    def logger_name(self) -> str:
        """The name of its node's logger."""
        return str(self._node.get_logger().name)

    def send_response(self, response: Any, header: Any) -> None:
        """Not needed: what the callback returns is sent."""
        raise NotImplementedError("return the response from the service's callback; there is nothing else to send")

    def take(self) -> Callable[[], Any] | None:
        """The work for the next request, or None. What cannot be read is refused here."""
        while (query := self._inbox.take()) is not None:
            if not self._server.is_meant(query):
                query.drop()
                continue
            try:
                request = self._server.read(query)
            except (CodecError, ServiceError) as error:
                with query:
                    refuse(query, str(error))
                continue
            return partial(self._answer, query, request)
        return None

    def arm(self, waker: Waker) -> None:
        """Wake `waker` for the next request."""
        self._inbox.arm(waker)

    def silence(self) -> None:
        """Let its thread end with the bus."""
        self._inbox.close()

    def destroy(self) -> None:
        """Serve no more."""
        if not self._closed:
            self._closed = True
            self._node._holozen.bus.drop(self._server)
            self._inbox.close()

    def _answer(self, query: Any, request: Any) -> Any:
        try:
            response = self.callback(request, self.srv_type.Response())
        except Refusal as error:
            with query:
                return refuse(query, str(error), error.fields)
        except BaseException as error:
            self._fail(query, error)
            raise
        if inspect.iscoroutine(response):
            return self._answer_later(query, response)
        return self._reply(query, response)

    async def _answer_later(self, query: Any, coroutine: Any) -> None:
        try:
            response = await coroutine
        except BaseException as error:
            self._fail(query, error)
            raise
        self._reply(query, response)

    def _reply(self, query: Any, response: Any) -> None:
        with query:
            try:
                if not isinstance(response, self.srv_type.Response):
                    name = f"{self.srv_type.__name__}.Response"
                    hint = "; write `return response` at its end" if response is None else ""
                    given = type(response).__name__
                    raise TypeError(f"the callback of {self.srv_name} must return a {name}, and gave a {given}{hint}")
                self._server.reply(query, response)
            except (TypeError, CodecError) as error:
                refuse(query, str(error))
                raise

    def _fail(self, query: Any, error: BaseException) -> None:
        with query:
            refuse(query, f"{self.srv_name}: its callback failed: {type(error).__name__}: {error}")


def _nobody(request: Any) -> Any:
    """Stands where `Bus.serve` wants a function; the requests are taken out one by one."""
    raise AssertionError("nobody asks the server itself to answer")
