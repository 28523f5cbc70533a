"""Services: typed requests and replies, errors with a reason, and the wait for a service that is not there yet."""

from __future__ import annotations

import json
import math
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from holozen.console import report
from holozen.transport.errors import TIMEOUT, BusError, Elsewhere, NoReply, ServiceError
from holozen.transport.samples import (
    MAX_ATTACHMENT_BYTES,
    Declared,
    Ring,
    Sample,
    release_memory,
    source_in,
    until_closed,
)
from holozen.wire import FREEING

if TYPE_CHECKING:
    from holozen.messages import Message
    from holozen.transport.node import Node

R = TypeVar("R", bound="Message")

FIRST_PAUSE, LONGEST_PAUSE = 0.001, 0.02  # s before a retry
RING = 2048  # requests in Zenoh's ring, of some 770 bytes each; beyond, the oldest get no reply
ROOM = 1000  # waiting requests of one service, by default
BATCH = 200  # requests read at once; to refuse as many takes 5 ms
BUDGET = 0.002  # s for replies per poll of a thread with other work
KEPT = 256  # replies that are kept, for requests that are sent again
KEPT_BYTES = 4096  # the largest of them; requests with larger replies only read, and may be answered again
SIMULTANEOUS = 0.05  # s; a request that was sent so shortly before an event counts as sent after it
PROOFS = 5  # times that a caller may tell how long its request has waited: a busy computer reads a reply late
ANSWERED = 40  # servers whose question a request answers, so that its attachment is not too long
FAILED = "{key}: internal error, see the server's log"
MAX_REQUEST_BYTES = 5_000_000  # a robot's URDF has at most 4 MB; larger ones are refused unread


def refusal(payload: bytes) -> ServiceError:
    """The error of an error reply: ours are `{"error": text}` with more fields, others are shown as they are."""
    text = payload.decode(errors="replace")
    try:
        fields = json.loads(text)
        return ServiceError(str(fields.pop("error")), **fields)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return ServiceError(text or "the service answered with an error and no reason")


def frees(key: str, payload: bytes, encoding: str) -> bool:
    """Whether a request lets a robot move, so that it must not be late. One that pauses the sim counts at any age."""
    name = key.rpartition("/")[2]
    if name != "set_simulation_state":
        return name in FREEING
    from holozen.messages import codec
    from holozen.messages.simulation_interfaces import SetSimulationStateRequest, SimulationState

    try:
        state = codec.decode(payload, encoding, (SetSimulationStateRequest,)).state.state
    except codec.CodecError:  # it is refused later
        return False
    return state == SimulationState.STATE_PLAYING


class Doubt(NamedTuple):
    """What is known of a request that may have waited in a link, by this process's clock in s: its caller was `asked`
    then, with a random `tag`, and sent it at `sent` at the earliest. `proofs`: how often the caller has answered.
    """

    tag: str
    asked: float
    sent: float
    proofs: int


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
    reply, or the pair (reply, note). `stops`: it only stops something, so it is done whatever the request holds, each
    time that this is sent; if that cannot be read, it counts as an empty one, and `problem` has the reason.
    """

    def __init__(
        self, queryable: Any, key: str, request: type[Message], reply: type[Message], answer: Callable[[Any], Any],
        wire: str, room: int, stops: bool = False,
    ) -> None:  # fmt: skip
        from holozen.messages import codec

        super().__init__(queryable)
        # Reading from the handler leaves the queryable free to be undeclared at the same time.
        self.channel = queryable.handler  # of Zenoh's requests, for `keep`
        self._waiting, self._room = Waiting(room), room
        self.caller = ""  # the claimed sender of the request that is being answered
        self.problem = ""  # why that request could not be read, where it is answered all the same
        self._stops = stops
        self._asked = b"", b""  # the number of that request, and what its caller has answered to questions
        self._doubts: dict[bytes, Doubt] = {}  # by the number of the request, in order
        self._kept: dict[bytes, tuple[bytes, str, str]] = {}  # number of a request -> its reply, in order
        self._key, self._request, self._answer, self._wire, self._codec = key, request, answer, wire, codec
        self._replies = reply

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
            return self.channel.try_recv()
        except Exception:  # a ZError: this service is closed
            return None

    def recv(self) -> Any:
        """The next request; waits for it. Raises BusError once the bus or this service is closed."""
        self.thread = threading.current_thread()
        try:
            return self.channel.recv()
        except Exception:  # a ZError: the session is closed
            raise BusError("closed") from None

    def start(self) -> None:
        """Answer from a separate thread, until the bus is closed. `sys.exit` in an answer does not end that."""
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self) -> None:
        for query in until_closed(self.recv):
            self.keep(query)
            try:
                while self.answer_pending(most=1):
                    pass
            except SystemExit as end:
                report(f"{self._key}: sys.exit({end.code!r}) in its thread ends nothing; the service goes on")

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
            self.caller, self._asked = source_in(query.attachment), _asked(query)
            # Its reply was lost, so its caller asks again.
            if (earlier := self._kept.get(self._asked[0])) and not self._stops:
                self._send(query, *earlier)
                return
            try:
                answer = self._answer(self._any(query) if self._stops else self.read(query))
                self.reply(query, *(answer if isinstance(answer, tuple) else (answer,)))
            except ServiceError as error:
                refuse(query, str(error), error.fields)
            except Elsewhere:
                pass
            except self._codec.CodecError as error:
                refuse(query, str(error))
            except Exception as error:
                report(f"{self._key}: {type(error).__name__}: {error}")
                refuse(query, FAILED.format(key=self._key))
            except BaseException:  # sys.exit, or Ctrl-C
                refuse(query, FAILED.format(key=self._key))
                raise

    def _any(self, query: Any) -> Any:
        """The request, or an empty one if it cannot be read."""
        self.problem = ""
        try:
            return self.read(query)
        except Exception as error:  # of any kind: nothing that a request holds may keep it from stopping
            self.problem = str(error)
            return self._request()

    def require_sent_after(self, event: float, now: float, refusal: str) -> None:
        """Raise ServiceError with `refusal` unless the request that is being answered was sent after `event`; both are
        times in s of this process's monotonic clock, and at `now` the request was read. An `event` of -inf never was.

        A request may have waited in a link for as long as its caller waits for the reply, and only the caller knows how
        long that is. So the caller is asked, by an error with a tag, and sends the request again with the time for
        which it had waited when it read that. This gives the earliest time at which it was sent. Nobody sends it again
        whose process is gone, or who waits no longer. A foreign caller, whose request has no number, is believed.
        """
        number, answers = self._asked
        if event == -math.inf or not re.search(rb";[0-9a-f]{16}$", number):
            return
        doubt = self._doubts.pop(number, Doubt("", -math.inf, -math.inf, 0))
        if (waited := _waited(answers, doubt.tag)) is not None:
            sent = max(doubt.sent, doubt.asked - waited)
            if event < min(doubt.asked, sent + SIMULTANEOUS):
                return
            doubt = doubt._replace(sent=sent, proofs=doubt.proofs + 1)
        if doubt.proofs == PROOFS:
            raise ServiceError(refusal, outdated=True)
        if len(self._doubts) == KEPT:
            self._doubts.pop(next(iter(self._doubts)))
        tag = os.urandom(4).hex()
        self._doubts[number] = doubt._replace(tag=tag, asked=now)
        raise ServiceError(refusal, waited=tag)

    def is_addressed(self, query: Any) -> bool:
        """Whether a request names this service's key; wildcards are only used for discovery."""
        return str(query.key_expr) == self._key

    def reply(self, query: Any, answer: Message, note: str = "") -> None:
        """Answer a request. The reply's type has no place for `note`, so it is the attachment. Raises TypeError
        for one of another type.
        """
        if not isinstance(answer, self._replies):
            from holozen.suggest import article

            raise TypeError(f"its answer is {article(type(answer).__name__)}, not {article(self._replies.__name__)}")
        reply, wire = self._codec.written(answer, self._wire)
        encoding = self._codec.encoding(wire, type(answer))
        if len(reply) <= KEPT_BYTES and (number := _asked(query)[0]):
            if len(self._kept) == KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[number] = reply, encoding, note
        self._send(query, reply, encoding, note)

    def _send(self, query: Any, reply: bytes, encoding: str, note: str) -> None:
        query.reply(self._key, reply, encoding=encoding, attachment=note or None)

    def read(self, query: Any) -> Any:
        """The request: from the payload, else from the selector's parameters (`next_goal?request_goal=2`). A bare query
        is how people look at a key: it does nothing, unless the type has no fields.
        """
        if query.payload is None:
            values = dict(query.parameters)
            if not values and (fields := self._request.__struct_fields__):
                from holozen.suggest import listed

                raise ServiceError(f"the request is empty; send {listed(fields)}, or {{}} for the defaults")
            return self._codec.convert(values, (self._request,))
        if len(query.payload) > MAX_REQUEST_BYTES:
            release_memory()
            raise ServiceError(f"request of {len(query.payload)} bytes; at most {MAX_REQUEST_BYTES} are read")
        return self._codec.decode(bytes(query.payload), str(query.encoding), (self._request,))


def _asked(query: Any) -> tuple[bytes, bytes]:
    """The sender and number of a request that may be sent again, empty if it has none; and the times for which it has
    waited, `TAG:NANOSECONDS,...`.
    """
    attachment = query.attachment
    found = bytes(attachment) if attachment and len(attachment) <= MAX_ATTACHMENT_BYTES else b""
    source, *parts = found.split(b";", 2)
    return (source + b";" + parts[0], b"".join(parts[1:])) if parts else (b"", b"")


def _waited(answers: bytes, tag: str) -> float | None:
    """The time in s for which a request had waited when its caller was asked with `tag`; None if it does not tell."""
    found = re.search(rb"(?:^|,)%b:([0-9]{1,18})(?:,|$)" % tag.encode(), answers) if tag else None
    return int(found[1]) * 1e-9 if found else None


def answer_in_turn(servers: list[Server], seconds: float = BUDGET) -> bool:
    """Answer waiting requests of several services: one request of each in turn, for `seconds`, but at least one.
    Returns whether it answered any; then more may wait.
    """
    for server in servers:
        server.take_in()
    deadline, idle, answered = time.monotonic() + seconds, 0, False
    while idle < len(servers) and not (answered and time.monotonic() >= deadline):
        idle = 0 if servers[0].answer_pending(most=1) else idle + 1
        answered |= not idle
        servers.append(servers.pop(0))
    return answered


def refuse(query: Any, text: str, fields: Mapping[str, object] = {}) -> None:
    """Answer a request with an error."""
    query.reply_err(json.dumps({"error": text, **fields}), encoding="application/json")


class Attempts:
    """One request, which may have to be sent several times. Its caller has wanted it since `began` (s, monotonic)."""

    def __init__(self, began: float) -> None:
        self._number, self._began = os.urandom(8).hex(), began
        self._waited: dict[str, int] = {}  # tag -> ns

    @property
    def number(self) -> str:
        """What identifies the request, for `Node.ask`, with how long it had waited when a server asked that."""
        waited = ",".join(f"{tag}:{waited}" for tag, waited in self._waited.items())
        return f"{self._number};{waited}" if waited else self._number

    def were_asked(self, refused: ServiceError) -> bool:
        """Note how long the request has waited if a server asks that in place of a reply, see
        `Server.require_sent_after`. Returns whether to send it again.
        """
        tag = refused.fields.get("waited")
        if not isinstance(tag, str) or not re.fullmatch("[0-9a-f]{8}", tag):
            return False
        self._waited[tag] = int((time.monotonic() - self._began) * 1e9)
        if len(self._waited) > ANSWERED:
            self._waited.pop(next(iter(self._waited)))
        return True


def call(node: Node, key: str, request: Message, reply: type[R], timeout: float, everyone: bool = False) -> list[R]:
    """See Bus.call, and Bus.call_all for `everyone`."""
    from holozen.messages import codec

    payload, wire = codec.written(request, node.wire)
    answers = call_bytes(node, key, payload, codec.encoding(wire, type(request)), timeout, everyone)
    try:
        return [codec.decode(answer.payload, answer.encoding, (reply,), tolerant=True) for answer in answers]
    except codec.CodecError as error:
        raise ServiceError(f"the reply of {key!r} is {error}") from None


def call_bytes(
    node: Node, key: str, payload: bytes, encoding: str, timeout: float, everyone: bool = False
) -> list[Sample]:
    """As `call`, without types: the samples of the replies. All attempts have one number, so a service applies the
    request once.
    """
    attempts, deadline = Attempts(time.monotonic()), time.monotonic() + timeout
    pause, refused = FIRST_PAUSE, None
    while (left := deadline - time.monotonic()) > 0:
        found, again = [], False
        ask = node.ask_all if everyone else node.ask
        for answer in ask(key, left, number=attempts.number, payload=payload, encoding=encoding):
            if isinstance(answer, Sample):
                found.append(answer)
                if not everyone:
                    return found
            elif answer != TIMEOUT:
                refused = refusal(answer)
                again |= attempts.were_asked(refused)
        if again:
            continue
        if found:
            return found
        if refused and not refused.fields.keys() & {"busy", "waited"}:
            raise refused
        time.sleep(min(pause, max(left, 0)))
        pause = min(2 * pause, LONGEST_PAUSE)
    if refused:
        raise refused
    raise NoReply(
        f"no reply from {key!r} within {timeout:g} s at {node.where}; `holozen service list` lists the servers"
    )
