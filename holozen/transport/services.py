"""Services: typed requests and replies, errors with a reason, and the wait for a service that is not there yet."""

from __future__ import annotations

import json
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from holozen.console import report
from holozen.transport.errors import TIMEOUT, BusError, Elsewhere, NoReply, ServiceError
from holozen.transport.samples import (
    MAX_ATTACHMENT_BYTES,
    Declared,
    Replies,
    Ring,
    Sample,
    release_memory,
    source_in,
)

if TYPE_CHECKING:
    from holozen.messages import Message

R = TypeVar("R", bound="Message")

FIRST_PAUSE, LONGEST_PAUSE = 0.001, 0.02  # s before a retry
RING = 2048  # requests in Zenoh's ring, of some 770 bytes each; beyond, the oldest get no reply
ROOM = 1000  # waiting requests of one service, by default
BATCH = 200  # requests read at once; to refuse as many takes 5 ms
BUDGET = 0.002  # s for replies per poll of a thread with other work
KEPT = 256  # replies that are kept
KEPT_BYTES = 4096  # the largest of them; those that are larger are of requests that only read
MAX_REQUEST_BYTES = 5_000_000  # a robot's URDF has at most 4 MB; larger ones are refused unread


def refusal(payload: bytes) -> ServiceError:
    """The error of an error reply: ours are `{"error": text}` with more fields, others are shown as they are."""
    text = payload.decode(errors="replace")
    try:
        fields = json.loads(text)
        return ServiceError(str(fields.pop("error")), **fields)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return ServiceError(text or "the service answered with an error and no reason")


class Waiting:
    """The queue of requests. Callers take turns; when it is full, the caller with the most requests is refused."""

    def __init__(self, room: int) -> None:
        self._room, self._count = room, 0
        self._queues: dict[str, deque[Any]] = {}  # caller -> its requests, in the order of their turns

    def __len__(self) -> int:
        return self._count

    def add(self, query: Any) -> Any:
        """Add a request. Returns a request to refuse if the queue is full, or None."""
        self._queues.setdefault(source_in(query.attachment), deque()).append(query)
        self._count += 1
        if self._count <= self._room:
            return None
        return self._take(max(self._queues, key=lambda caller: len(self._queues[caller])), newest=True)

    def pop(self) -> Any:
        """The next request, or None."""
        return self._take(next(iter(self._queues))) if self._count else None

    def _take(self, caller: str, newest: bool = False) -> Any:
        queue = self._queues[caller] if newest else self._queues.pop(caller)
        query = queue.pop() if newest else queue.popleft()
        self._count -= 1
        if queue:
            self._queues[caller] = queue
        else:
            self._queues.pop(caller, None)
        return query


class Server(Declared):
    """A service. Requests wait until `answer_pending` is called, or until the thread of `start` takes them.

    At most `room` of them wait; the others are refused as busy, and `Bus.call` retries those. `answer` returns the
    reply, or a pair of it and a note.
    """

    def __init__(
        self, queryable: Any, key: str, request: type[Message], answer: Callable[[Any], Any], wire: str, room: int
    ) -> None:
        from holozen.messages import codec

        super().__init__(queryable)
        # Reading from the handler leaves the queryable free to be undeclared at the same time.
        self._queries = queryable.handler
        self.channel = queryable.handler  # of Zenoh's requests, for `keep`
        self._waiting, self._room = Waiting(room), room
        self.caller = ""  # the claimed sender of the request that is being answered
        self._kept: dict[bytes, tuple[bytes, str, str]] = {}  # number of a request -> its reply, in order
        self._key, self._request, self._answer, self._wire, self._codec = key, request, answer, wire, codec

    def take_in(self, most: int = BATCH) -> int:
        """Read at most `most` requests from Zenoh's ring; returns how many wait."""
        if isinstance(self.channel, Ring):
            self.channel.dealer.deal()
        while most > 0 and (query := self.try_recv()) is not None:
            self.keep(query)
            most -= 1
        return len(self._waiting)

    def answer_pending(self, most: int = ROOM) -> int:
        """Answer at most `most` waiting requests; returns how many were answered."""
        self.take_in()
        answered = 0
        while answered < most and (query := self._waiting.pop()) is not None:
            self._reply(query)
            answered += 1
        return answered

    def refuse_waiting(self, reason: str) -> None:
        """Refuse all requests that were taken in and wait."""
        while (query := self._waiting.pop()) is not None:
            with query:
                refuse(query, reason)

    def try_recv(self) -> Any:
        """The next request in Zenoh's ring, or None, to be answered with `read`, `reply` or `refuse`."""
        try:
            return self._queries.try_recv()
        except Exception:  # a ZError: this service is closed
            return None

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

    def _serve(self) -> None:
        while True:
            try:
                self.keep(self.recv())
            except BusError:
                return
            while self.answer_pending(most=1):
                pass

    @property
    def is_waiting(self) -> bool:
        """Whether any request that was taken in waits."""
        return bool(self._waiting)

    def keep(self, query: Any) -> None:
        """Take in a request."""
        if not self.is_addressed(query):
            query.drop()
        elif (surplus := self._waiting.add(query)) is not None:
            with surplus:
                refuse(surplus, f"{self._key} is busy: {self._room} requests wait already; ask again", {"busy": True})

    def _reply(self, query: Any) -> None:
        with query:
            self.caller = source_in(query.attachment)
            if earlier := self._kept.get(_number(query)):  # its caller asks again, since this reply was lost
                self._send(query, *earlier)
                return
            try:
                answer = self._answer(self.read(query))
                self.reply(query, *(answer if isinstance(answer, tuple) else (answer,)))
            except ServiceError as error:
                refuse(query, str(error), error.fields)
            except Elsewhere:
                pass
            except self._codec.CodecError as error:
                refuse(query, str(error))
            except Exception as error:
                report(f"{self._key}: {type(error).__name__}: {error}")
                refuse(query, f"{self._key}: internal error, see the server's log")

    def is_addressed(self, query: Any) -> bool:
        """Whether a request names this service's key; wildcards are only used for discovery."""
        return str(query.key_expr) == self._key

    def reply(self, query: Any, answer: Message, note: str = "") -> None:
        """Answer a request. The reply's type has no place for `note`, so it is the attachment."""
        reply, wire = self._codec.written(answer, self._wire)
        encoding = self._codec.encoding(wire, type(answer))
        if len(reply) <= KEPT_BYTES and (number := _number(query)):
            if len(self._kept) == KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[number] = reply, encoding, note
        self._send(query, reply, encoding, note)

    def _send(self, query: Any, reply: bytes, encoding: str, note: str) -> None:
        query.reply(self._key, reply, encoding=encoding, attachment=note or None)

    def read(self, query: Any) -> Any:
        """The request: from the payload, else from the selector's parameters (`next_goal?request_goal=2`)."""
        if query.payload is None:
            values = dict(query.parameters)
            return self._codec.convert(values, (self._request,))
        if len(query.payload) > MAX_REQUEST_BYTES:
            release_memory()
            raise ServiceError(f"request of {len(query.payload)} bytes; at most {MAX_REQUEST_BYTES} are read")
        return self._codec.decode(bytes(query.payload), str(query.encoding), (self._request,))


def _number(query: Any) -> bytes:
    """The sender and number of a request that may be sent again; empty if it has none."""
    attachment = query.attachment
    found = bytes(attachment) if attachment and len(attachment) <= MAX_ATTACHMENT_BYTES else b""
    return found if b";" in found else b""


def answer_in_turn(servers: list[Server], seconds: float = BUDGET) -> bool:
    """Answer waiting requests of several services: one request of each in turn, for `seconds`, but at least one.
    Returns whether more may wait.
    """
    for server in servers:
        server.take_in()
    deadline, idle = time.monotonic() + seconds, 0
    while idle < len(servers):
        idle = 0 if servers[0].answer_pending(most=1) else idle + 1
        servers.append(servers.pop(0))
        if not idle and time.monotonic() >= deadline:
            return True
    return False


def refuse(query: Any, text: str, fields: Mapping[str, object] = {}) -> None:
    """Answer a request with an error."""
    query.reply_err(json.dumps({"error": text, **fields}), encoding="application/json")


class Asks(Protocol):
    """What can ask on the wire: a Bus."""

    wire: str
    where: str

    def ask(self, key: str, timeout: float, **request: Any) -> Replies:
        """Ask once, without waiting for the service."""
        ...

    def ask_all(self, key: str, timeout: float, **request: Any) -> Replies:
        """Ask all services of a key once."""
        ...


def call(bus: Asks, key: str, request: Message, reply: type[R], timeout: float, everyone: bool = False) -> list[R]:
    """See Bus.call, and Bus.call_all for `everyone`."""
    from holozen.messages import codec

    payload, wire = codec.written(request, bus.wire)
    answers = call_bytes(bus, key, payload, codec.encoding(wire, type(request)), timeout, everyone)
    try:
        return [codec.decode(answer.payload, answer.encoding, (reply,), tolerant=True) for answer in answers]
    except codec.CodecError as error:
        raise ServiceError(f"the reply of {key!r} is {error}") from None


def call_bytes(
    bus: Asks, key: str, payload: bytes, encoding: str, timeout: float, everyone: bool = False
) -> list[Sample]:
    """As `call`, without types: the samples of the replies. All attempts have one number, so a service applies the
    request once.
    """
    number = os.urandom(8).hex()
    deadline, pause, busy = time.monotonic() + timeout, FIRST_PAUSE, None
    while (left := deadline - time.monotonic()) > 0:
        found = []
        ask = bus.ask_all if everyone else bus.ask
        for answer in ask(key, left, number=number, payload=payload, encoding=encoding):
            if isinstance(answer, Sample):
                found.append(answer)
                if not everyone:
                    return found
            elif answer != TIMEOUT:
                busy = refusal(answer)
        if found:
            return found
        if busy and not busy.fields.get("busy"):
            raise busy
        time.sleep(min(pause, max(left, 0)))
        pause = min(2 * pause, LONGEST_PAUSE)
    if busy:
        raise busy
    text = f"no reply from {key!r} within {timeout:g} s at {bus.where}; `holozen service list` lists the servers"
    raise NoReply(text)
