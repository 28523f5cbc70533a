"""The answering side of a request: typed requests, typed replies, errors with a reason."""

import json
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from holozen.errors import BusError, ServiceError
from holozen.tap import source_in
from holozen.tell import say

if TYPE_CHECKING:
    from holozen.messages import Message

MAX_REQUEST_BYTES = 5_000_000  # a robot's URDF has at most 4 MB; more is refused unread, to stall nobody


def refusal(payload: bytes) -> ServiceError:
    """The error of an error reply: ours are `{"error": text}` with more fields, a stranger's are shown as they are."""
    text = payload.decode(errors="replace")
    try:
        fields = json.loads(text)
        return ServiceError(str(fields.pop("error")), **fields)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return ServiceError(text or "the service answered with an error and no reason")


class Server:
    """A service. Requests wait until `answer_pending` is called, or until the thread of `start` takes them."""

    def __init__(
        self, queryable: Any, key: str, request: "type[Message]", answer: Callable[[Any], Any], wire: str
    ) -> None:
        from holozen import codec

        self.ends = [queryable]  # what stands on the wire for this service
        # Reading from the handler leaves the queryable free to be undeclared meanwhile.
        self._queries = queryable.handler
        self.thread: threading.Thread | None = None  # the one of `start`
        self.caller = ""  # who says to have sent the request that is being answered
        self._key, self._request, self._answer, self._wire, self._codec = key, request, answer, wire, codec

    def answer_pending(self, most: int = 1000) -> None:
        """Answer the requests that wait, at most so many; returns at once when there are none."""
        while most > 0 and (query := self._queries.try_recv()) is not None:
            self._reply(query)
            most -= 1

    def try_recv(self) -> Any:
        """The next request that waits, or None, for who answers it later with `read`, `reply` or `refuse`."""
        return self._queries.try_recv()

    def recv(self) -> Any:
        """The next request; waits for it. Raises BusError once the bus or this service is closed."""
        self.thread = threading.current_thread()
        try:
            return self._queries.recv()
        except Exception:  # zenoh's own error type, which only bus.py may name: the session is closed
            raise BusError("closed") from None

    def start(self) -> None:
        """Answer from a thread of its own, until the bus is closed."""
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def close(self) -> None:
        """Stop answering."""
        for end in self.ends:
            end.undeclare()

    def _serve(self) -> None:
        while True:
            try:
                query = self.recv()
            except BusError:
                return
            self._reply(query)

    def _reply(self, query: Any) -> None:
        with query:
            if not self.is_meant(query):
                return
            self.caller = source_in(query.attachment)
            try:
                self.reply(query, self._answer(self.read(query)))
            except ServiceError as error:
                refuse(query, str(error), error.fields)
            except self._codec.CodecError as error:
                refuse(query, str(error))
            except Exception as error:
                say(f"{self._key}: {type(error).__name__}: {error}")
                refuse(query, f"{self._key}: internal error, see the server's log")

    def is_meant(self, query: Any) -> bool:
        """Whether it is asked to do something: a wildcard only looks around."""
        return str(query.key_expr) == self._key

    def reply(self, query: Any, answer: "Message") -> None:
        """Answer a request."""
        reply, wire = self._codec.written(answer, self._wire)
        query.reply(self._key, reply, encoding=self._codec.encoding(wire, type(answer)))

    def read(self, query: Any) -> Any:
        """The request: from the payload, else from the selector's parameters (`next_goal?request_goal=2`)."""
        if query.payload is None:
            values = dict(query.parameters)
            return self._codec.convert(values, (self._request,))
        if len(query.payload) > MAX_REQUEST_BYTES:
            raise ServiceError(f"request of {len(query.payload)} bytes; at most {MAX_REQUEST_BYTES} are read")
        return self._codec.decode(bytes(query.payload), str(query.encoding), (self._request,))


def refuse(query: Any, text: str, fields: Mapping[str, object] = {}) -> None:
    """Answer a request with an error."""
    query.reply_err(json.dumps({"error": text, **fields}), encoding="application/json")
