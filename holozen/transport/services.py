"""Services: typed requests and replies, errors with a reason, and the wait for a service that is
not there yet.
"""

from __future__ import annotations

import json
import os
import re
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from holozen.console import report
from holozen.transport.beat import OwnTime, boot_ns
from holozen.transport.errors import TIMEOUT, BusError, Elsewhere, NoReply, ServiceError
from holozen.transport.samples import (
    MAX_ATTACHMENT_BYTES,
    Declared,
    Ring,
    Sample,
    echoes_in,
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
# the largest of them; requests with larger replies only read, and may be answered again
KEPT_BYTES = 4096
# times that a caller may prove when it wanted a request: a busy computer reads a reply late
PROOFS = 5
ANSWERED = 16  # servers whose time a request echoes, so that its attachment is not too long
FAILED = "{key}: internal error, see the server's log"
MAX_REQUEST_BYTES = 5_000_000  # a robot's URDF has at most 4 MB; larger ones are refused unread


def refusal(payload: bytes) -> ServiceError:
    """The error of an error reply: ours are `{"error": text}` with more fields, others are shown as
    they are.
    """
    text = payload.decode(errors="replace")
    try:
        fields = json.loads(text)
        return ServiceError(str(fields.pop("error")), **fields)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return ServiceError(text or "the service answered with an error and no reason")


def frees(key: str, payload: bytes, encoding: str) -> bool:
    """Whether a request lets a robot move, so that it must not be late. One that pauses the sim
    counts at any age.
    """
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


class Waiting:
    """The queue of requests. Callers take turns; when it is full, the caller with the most requests
    is refused.
    """

    def __init__(self, room: int) -> None:
        self._room, self._count = room, 0
        # caller -> its requests, in the order of their turns
        self._queues: dict[str, deque[Any]] = {}

    def __len__(self) -> int:
        return self._count

    def add(self, query: Any) -> Any:
        """Add a request. Returns a request to refuse if the queue is full, or None."""
        self._queues.setdefault(source_in(query.attachment), deque()).append(query)
        self._count += 1
        if self._count <= self._room:
            return None
        return self._take(
            max(self._queues, key=lambda caller: len(self._queues[caller])), newest=True
        )

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
    """A service. Requests wait until `answer_pending` is called, or until the thread of `start`
    takes them.

    At most `room` of them wait; the others are refused as busy, and `Bus.call` retries those.
    `answer` returns the reply, or the pair (reply, note).

    `stops` is for a service that only stops something: it runs even if the request cannot be
    decoded, as if that were empty, with the reason in `problem`, and again on each retransmission.
    """

    def __init__(
        self,
        queryable: Any,
        key: str,
        request: type[Message],
        reply: type[Message],
        answer: Callable[[Any], Any],
        wire: str,
        own_time: OwnTime,
        room: int,
        stops: bool = False,
    ) -> None:
        from holozen.messages import codec

        super().__init__(queryable)
        # Reading from the handler leaves the queryable free to be undeclared at the same time.
        self.channel = queryable.handler  # of Zenoh's requests, for `keep`
        self._waiting, self._room = Waiting(room), room
        self.caller = ""  # the claimed sender of the request that is being answered
        self.problem = ""  # why that request could not be read, where it is answered all the same
        self._stops = stops
        self._asked = b"", b""  # the number of that request, and its echoes
        self._own = own_time
        # number of a request -> its reply, in order
        self._kept: dict[bytes, tuple[bytes, str, str]] = {}
        self._key, self._request, self._answer, self._wire, self._codec = (
            key,
            request,
            answer,
            wire,
            codec,
        )
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
        """The next request in Zenoh's ring, or None, to be answered with `read`, `reply` or
        `refuse`.
        """
        try:
            return self.channel.try_recv()
        except Exception:  # a ZError: this service is closed
            return None

    def recv(self) -> Any:
        """The next request; waits for it. Raises BusError once the bus or this service is
        closed.
        """
        self.thread = threading.current_thread()
        try:
            return self.channel.recv()
        except Exception:  # a ZError: the session is closed
            raise BusError("closed") from None

    def start(self) -> None:
        """Answer from a separate thread, until the bus is closed. `sys.exit` in an answer does not
        end that.
        """
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self) -> None:
        for query in until_closed(self.recv):
            self.keep(query)
            try:
                while self.answer_pending(most=1):
                    pass
            except SystemExit as end:
                report(
                    f"{self._key}: sys.exit({end.code!r}) in its thread ends nothing; the service "
                    "goes on"
                )

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
                refuse(
                    surplus,
                    f"{self._key} is busy: {self._room} requests wait already; ask again",
                    {"busy": True},
                )

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
        except (
            Exception
        ) as error:  # of any kind: nothing that a request holds may keep it from stopping
            self.problem = str(error)
            return self._request()

    def age(self) -> float | None:
        """For how many seconds its caller has wanted the request that is being answered, at the
        most. None for a foreign caller, whose request has no number: it is believed.

        A request may have waited in a link for as long as its caller waits for the reply. So one of
        ours tells what it has heard of this process's time, less how long it had waited by then.
        One that has heard none is refused by a ServiceError that holds this time, and its caller
        sends it again: nobody does whose process is gone, or who waits no longer.
        """
        number, echoes = self._asked
        if not re.search(rb";[0-9a-f]{16}$", number):
            return None
        now = self._own.clock()
        called = [
            ns for session, ns in echoes_in(echoes) if session == self._own.session and ns <= now
        ]
        if not called:
            raise self._asks_again(f"{self._key} asks when this was sent; send it again with that")
        return (now - max(called)) * 1e-9

    def require_sent_after(self, event: float | None, refusal: str) -> None:
        """Raise ServiceError with `refusal` unless the request that is being answered is wanted
        since after `event`, s of this process's monotonic clock; None never was. The caller may
        prove it better by what the error holds, as in `age`.
        """
        now = time.monotonic()  # first: a process that hangs before the age is taken is stricter
        if event is not None and (age := self.age()) is not None and now - age <= event:
            raise self._asks_again(refusal)

    def _asks_again(self, reason: str) -> ServiceError:
        return ServiceError(reason, beat=self._own.text())

    def is_addressed(self, query: Any) -> bool:
        """Whether a request names this service's key; wildcards are only used for discovery."""
        return str(query.key_expr) == self._key

    def reply(self, query: Any, answer: Message, note: str = "") -> None:
        """Answer a request. The reply's type has no place for `note`, so it is in the attachment.
        Raises TypeError for one of another type.
        """
        if not isinstance(answer, self._replies):
            from holozen.suggest import article

            raise TypeError(
                f"its answer is {article(type(answer).__name__)}, not "
                f"{article(self._replies.__name__)}"
            )
        reply, wire = self._codec.written(answer, self._wire)
        encoding = self._codec.encoding(wire, type(answer))
        if len(reply) <= KEPT_BYTES and (number := _asked(query)[0]):
            if len(self._kept) == KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[number] = reply, encoding, note
        self._send(query, reply, encoding, note)

    def _send(self, query: Any, reply: bytes, encoding: str, note: str) -> None:
        # one of ours: what its caller asks next is wanted since after this reply
        if _asked(query)[0]:
            note = f"{self._own.text()};{note}"
        query.reply(self._key, reply, encoding=encoding, attachment=note or None)

    def read(self, query: Any) -> Any:
        """The request: from the payload, else from the selector's parameters
        (`next_goal?request_goal=2`). A bare query is how people look at a key: it does nothing,
        unless the type has no fields.
        """
        if query.payload is None:
            values = dict(query.parameters)
            if not values and (fields := self._request.__struct_fields__):
                from holozen.suggest import listed

                raise ServiceError(
                    f"the request is empty; send {listed(fields)}, or {{}} for the defaults"
                )
            return self._codec.convert(values, (self._request,))
        if len(query.payload) > MAX_REQUEST_BYTES:
            release_memory()
            raise ServiceError(
                f"request of {len(query.payload)} bytes; at most {MAX_REQUEST_BYTES} are read"
            )
        return self._codec.decode(bytes(query.payload), str(query.encoding), (self._request,))


def _asked(query: Any) -> tuple[bytes, bytes]:
    """The sender and number of a request that may be sent again, empty if it has none; and its
    echoes.
    """
    attachment = query.attachment
    found = bytes(attachment) if attachment and len(attachment) <= MAX_ATTACHMENT_BYTES else b""
    source, *parts = found.split(b";", 2)
    return (source + b";" + parts[0], b"".join(parts[1:])) if parts else (b"", b"")


def answer_in_turn(servers: list[Server], seconds: float = BUDGET) -> bool:
    """Answer waiting requests of several services: one request of each in turn, for `seconds`, but
    at least one. Returns whether it answered any; then more may wait.
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


class RepeatedRequest:
    """One request, which may have to be sent several times. Its caller has wanted it since `began`
    (s, monotonic), and had `heard` these times of servers by then. It tells none before it is
    asked: who waits no longer is not believed.
    """

    def __init__(self, began: float, heard: Mapping[str, int] = {}) -> None:
        self._number = os.urandom(8).hex()
        self._began = boot_ns() - int((time.monotonic() - began) * 1e9)
        self._heard = dict(heard)
        # server's session -> its time in ns at which the request was wanted already
        self._called: dict[str, int] = {}
        self._proofs: Counter[str] = Counter()

    @property
    def number(self) -> str:
        """What identifies the request, for `Node.ask`, with its echoes."""
        return (
            f"{self._number};{','.join(f'{session}:{ns}' for session, ns in self._called.items())}"
        )

    def were_asked(self, refused: ServiceError) -> bool:
        """If a server refuses the request for want of a newer echo, see `Server.age`, note its
        time, less how long the request has waited. Returns whether to send the request again.
        """
        beat = refused.fields.get("beat")
        echoes = echoes_in(beat.encode()) if isinstance(beat, str) else ()
        if len(echoes) != 1:
            return False
        (session, ns), waited = echoes[0], boot_ns() - self._began
        self._proofs[session] += 1
        known = max(self._called.pop(session, 0), self._heard.get(session, 0))
        self._called[session] = max(known, ns - waited)
        if len(self._called) > ANSWERED:
            self._called.pop(next(iter(self._called)))
        return self._proofs[session] <= PROOFS


def _hear(heard: dict[str, int], reply: Sample) -> None:
    """Note the time of the server that a reply holds."""
    for session, ns in echoes_in(reply.attachment.partition(b";")[0]):
        heard[session] = max(ns, heard.pop(session, 0))
    while len(heard) > ANSWERED:
        heard.pop(next(iter(heard)))


def note_in(reply: Sample) -> str:
    """The note of a reply to one of our requests; empty if it has none."""
    first, _, rest = reply.attachment.partition(b";")
    return (rest if echoes_in(first) else reply.attachment).decode(errors="replace")


def call(
    node: Node, key: str, request: Message, reply: type[R], timeout: float, everyone: bool = False
) -> list[R]:
    """See Bus.call, and Bus.call_all for `everyone`."""
    from holozen.messages import codec

    payload, wire = codec.written(request, node.wire)
    answers = call_bytes(node, key, payload, codec.encoding(wire, type(request)), timeout, everyone)
    try:
        return [
            codec.decode(answer.payload, answer.encoding, (reply,), tolerant=True)
            for answer in answers
        ]
    except codec.CodecError as error:
        raise ServiceError(f"the reply of {key!r} is {error}") from None


def call_bytes(
    node: Node, key: str, payload: bytes, encoding: str, timeout: float, everyone: bool = False
) -> list[Sample]:
    """As `call`, without types: the samples of the replies. All attempts have one number, so a
    service applies the request once.
    """
    now = time.monotonic()
    attempts, deadline = RepeatedRequest(now, node.server_times), now + timeout
    pause, refused = FIRST_PAUSE, None
    while (left := deadline - time.monotonic()) > 0:
        found, again = [], False
        ask = node.ask_all if everyone else node.ask
        for answer in ask(key, left, number=attempts.number, payload=payload, encoding=encoding):
            if isinstance(answer, Sample):
                found.append(answer)
                _hear(node.server_times, answer)
                if not everyone:
                    return found
            elif answer != TIMEOUT:
                refused = refusal(answer)
                again |= attempts.were_asked(refused)
        if again:
            continue
        if found:
            return found
        if refused and "busy" not in refused.fields:
            raise refused
        time.sleep(min(pause, max(left, 0)))
        pause = min(2 * pause, LONGEST_PAUSE)
    if refused:
        raise refused
    raise NoReply(
        f"no reply from {key!r} within {timeout:g} s at {node.where}; `holozen service list` "
        "lists the servers"
    )
