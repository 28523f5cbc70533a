"""Service: runs a callback for each request."""

import inspect
from collections.abc import Callable
from functools import partial
from typing import Any

from holozen.messages.codec import CodecError
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.handle import NodeHandle, Owned
from holozen.ros.rclpy.names import key
from holozen.ros.rclpy.qos import QoSProfile
from holozen.ros.rclpy.waitable import Inbox, Waitable, Waker, check_callback
from holozen.suggest import article
from holozen.transport.errors import ServiceError
from holozen.transport.services import refuse

__all__ = ["Service"]

DEPTH = 64  # requests that wait, as in Bus.serve


class Refusal(ServiceError):
    """Raised by our own callbacks to refuse a request without ending the spin."""


class Service(Owned, Waitable):
    """Created by `Node.create_service`. Requests wait until its node is spun.

    An exception in the callback ends the spin, and the client receives it as an error.
    """

    def __init__(
        self,
        handle: NodeHandle,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        callback_group: CallbackGroup | None,
        qos_profile: QoSProfile,
    ) -> None:
        check_callback(callback)
        self.srv_type, self.srv_name, self.qos_profile = srv_type, srv_name, qos_profile
        self.callback, self.callback_group = callback, callback_group
        self._handle, self._closed = handle, False
        self._server = handle.bus.serve(key(srv_name), srv_type.Request, srv_type.Response, _unused)
        self._inbox: Inbox[Any] = Inbox(self._server.recv, self._server.try_recv, DEPTH)

    @property
    def service_name(self) -> str:
        """Its name, absolute and remapped."""
        return self.srv_name

    def send_response(self, response: Any, header: Any) -> None:
        """Raises NotImplementedError: the value that the callback returns is sent."""
        raise NotImplementedError(
            "return the response from the callback of the service; nothing else has to be sent"
        )

    def take(self) -> Callable[[], Any] | None:
        """The work for the next request, or None. A request that cannot be decoded is refused
        here.
        """
        while (query := self._inbox.take()) is not None:
            if not self._server.is_addressed(query):
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

    def detach(self) -> None:
        """Let its thread end with the bus, which is about to close."""
        self._inbox.close()

    def destroy(self) -> None:
        """Stop serving."""
        if not self._closed:
            self._closed = True
            self._server.close()
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
                    wanted, given = (
                        article(f"{self.srv_type.__name__}.Response"),
                        article(type(response).__name__),
                    )
                    hint = "; write `return response` at its end" if response is None else ""
                    raise TypeError(
                        f"the callback of {self.srv_name} must return {wanted}, and gave "
                        f"{given}{hint}"
                    )
                self._server.reply(query, response)
            except (TypeError, CodecError) as error:
                refuse(query, str(error))
                raise

    def _fail(self, query: Any, error: BaseException) -> None:
        with query:
            refuse(query, f"{self.srv_name}: its callback failed: {type(error).__name__}: {error}")


def _unused(request: Any) -> Any:
    """`Bus.serve` requires a function; the requests are taken from its queue instead."""
    raise AssertionError("the server must not answer by itself")
