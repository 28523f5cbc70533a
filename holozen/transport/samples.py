"""Samples and replies as bytes: what they carry besides their payload, and what waits for them."""

import contextlib
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar

from holozen.console import report
from holozen.transport.errors import BusError

T = TypeVar("T")

_ECHOES = re.compile(rb"[0-9a-f]{1,32}:[0-9]{1,19}(?:,[0-9a-f]{1,32}:[0-9]{1,19}){0,15}")

MAX_ATTACHMENT_BYTES = 1000  # longer ones are not read
LARGE = 1_000_000  # bytes; memory of larger payloads is returned to the system
MAX_DEALT = 4096  # samples at a time
TRIM_AFTER = (1.0, 2.0, 4.0, 8.0)  # s
M_TRIM_THRESHOLD = -1  # mallopt(3)
MAX_DIGITS = 19  # of a number in an attachment, or a time in ns
MAX_ECHOES = 8  # receivers of one command: more do not fit into its attachment
PRIORITIES = (
    "REAL_TIME",
    "INTERACTIVE_HIGH",
    "INTERACTIVE_LOW",
    "DATA_HIGH",
    "DATA",
    "DATA_LOW",
    "BACKGROUND",
)
"""Zenoh's priorities, the strongest first; Zenoh counts them from 1."""


def source(node: str, session: str) -> str:
    """The name of a sender, for messages and status."""
    return f"{node}@{session[:6]}"


Echo = tuple[str, int]
"""The session of a receiver, and its own time in ns that a sender has heard of it, see beat.py."""


class Stamp(NamedTuple):
    """How a sample was sent.

    Attributes:
        session: The sender's session.
        number: Its number among those of the session on this key, see Numbers.
        echoes: The beats of receivers that it returns.
        member: Whose certificate the sender claims, in the secure set-up.
    """

    session: str
    number: int
    echoes: tuple[Echo, ...]
    member: str = ""


class Numbers:
    """Numbers the samples of a session on one key, from 0.

    It begins anew at the first command that echoes a beat: nobody was there to hear those before
    it, so a robot that misses them has missed nothing.
    """

    def __init__(self) -> None:
        self._next = 0
        self._has_echoed = False

    def take(self, echoes: bool) -> int:
        """The number of the next sample. `echoes`: whether it echoes a beat."""
        if echoes and not self._has_echoed:
            self._has_echoed = True
            self._next = 0
        number = self._next
        self._next += 1
        return number


def stamps(node: str, session: str, numbers: Numbers) -> Callable[..., bytes]:
    """A function that makes attachments with sender and stamp: `node@session;number;ECHOES`. It is
    given the echoes of a command; what commands nothing has none.
    """
    start = f"{node}@{session};".encode()
    return lambda echoes=b"": b"%b%d;%b" % (start, numbers.take(bool(echoes)), echoes)


def source_in(attachment: Any) -> str:
    """The sender in the attachment of a sample or a request; empty if there is none."""
    if not attachment or len(attachment) > MAX_ATTACHMENT_BYTES:
        return ""
    name, _, session = bytes(attachment).decode(errors="replace").partition(";")[0].rpartition("@")
    return source(name, session)[:80] if name else session[:80]


def _stamp_parts(attachment: Any) -> list[bytes]:
    """The parts of an attachment with a sender, its sample's number and echoes; empty if those are
    missing or malformed. A signature may follow, see authenticator.py.
    """
    parts = (
        bytes(attachment).split(b";")
        if attachment and len(attachment) <= MAX_ATTACHMENT_BYTES
        else []
    )
    well_formed = len(parts) in (3, 4) and parts[1].isdigit() and len(parts[1]) <= MAX_DIGITS
    return parts if well_formed and (not parts[2] or _ECHOES.fullmatch(parts[2])) else []


def echoes_in(text: bytes) -> tuple[Echo, ...]:
    """The echoes in the text `SESSION:NS,...` of an attachment; none if it is malformed."""
    if not _ECHOES.fullmatch(text):
        return ()
    pairs = (each.split(":") for each in text.decode().split(","))
    return tuple((session, int(ns)) for session, ns in pairs)


def stamp_in(attachment: Any) -> Stamp | None:
    """The stamp in an attachment; None if it is missing or malformed."""
    if not (parts := _stamp_parts(attachment)):
        return None
    name, _, session = parts[0].rpartition(b"@")
    if not 0 < len(session) <= 32 or not session.isalnum():
        return None
    member = name.partition(b"/")[0].decode(errors="replace")
    return Stamp(session.decode(), int(parts[1]), echoes_in(parts[2]), member)


def release_memory() -> None:
    """Return the memory of a refused payload to the system, now and in the next seconds: the C
    library would keep it.

    It came in fragments, some of which lie between memory in use. Call it before the payload is
    freed.
    """
    global _trimmer
    _keep_little()
    _refused.set()
    # none, or a forked process, which has no threads
    if _trimmer is None or not _trimmer.is_alive():
        _trimmer = threading.Thread(target=_trim, name="trim", daemon=True)
        _trimmer.start()


_refused = threading.Event()
_trimmer: threading.Thread | None = None


@cache
def _c_library() -> Any:
    """The C library, if it is glibc, whose functions these are; else None."""
    import ctypes

    library = ctypes.CDLL(None)
    return library if hasattr(library, "malloc_trim") and hasattr(library, "mallopt") else None


@cache
def _keep_little() -> None:
    """Let each heap return what is free at its end.

    There glibc keeps up to twice the largest block ever freed, at most 64 MB.
    `malloc_trim` shortens only the first heap.
    """
    if library := _c_library():
        library.mallopt(M_TRIM_THRESHOLD, LARGE)


def _trim() -> None:
    """Trim after each refusal, those during a trim included; again later, since parts of it may
    have been in use.
    """
    while library := _c_library():
        _refused.wait()
        _refused.clear()
        for pause in TRIM_AFTER:
            time.sleep(pause)
            library.malloc_trim(0)


class Sample:
    """A received sample. If its `size` in bytes is over the reader's limit, or its attachment is
    too long, that is its `oversize`, else 0, and it has no payload. A limit of 0 means no limit.

    Most readers need only the payload, so the rest is read from Zenoh's sample on demand. The
    decoder puts its result into `message`, or the reason why it has none into `error`.
    """

    __slots__ = ("_sample", "_stamp", "error", "message", "oversize", "payload")

    def __init__(self, sample: Any, limit: int = 0) -> None:
        self._stamp: tuple[Stamp | None] | None = None  # once it was read
        self._sample, self.oversize, self.error = sample, 0, ""
        self.message: Any = None
        payload = sample.payload
        if limit:
            size = len(payload)
            if (named := len(sample.attachment or b"")) > MAX_ATTACHMENT_BYTES:
                size += max(named, limit)
            if size > limit:
                self.payload, self.oversize = b"", size
                if size > LARGE:
                    release_memory()
                return
        self.payload = payload.to_bytes()

    @property
    def encoding(self) -> str:
        """Its Zenoh Encoding."""
        return str(self._sample.encoding)

    @property
    def size(self) -> int:
        """Bytes of its payload, and of an attachment that is too long."""
        return self.oversize or len(self.payload)

    @property
    def is_deletion(self) -> bool:
        """Whether it says that what has its key is gone."""
        return str(self._sample.kind).endswith("DELETE")

    @property
    def key(self) -> str:
        """Its key."""
        return str(self._sample.key_expr)

    @property
    def priority(self) -> str:
        """The name of its Zenoh priority."""
        return PRIORITIES[int(self._sample.priority) - 1]

    @property
    def attachment(self) -> bytes:
        """Its attachment; empty without one, or if it is too long."""
        attachment = self._sample.attachment
        return bytes(attachment) if attachment and len(attachment) <= MAX_ATTACHMENT_BYTES else b""

    @property
    def source(self) -> str:
        """Its sender; empty if it names none."""
        return source_in(self._sample.attachment)

    @property
    def stamp(self) -> Stamp | None:
        """Its stamp as claimed by the sender; None without one."""
        if self._stamp is None:
            self._stamp = (stamp_in(self._sample.attachment),)
        return self._stamp[0]

    @property
    def timestamp(self) -> tuple[int, str] | None:
        """Zenoh's own timestamp: ns since 1970, and the session that made it, a router's if its
        sender made none.
        """
        stamp = self._sample.timestamp
        return stamp and (stamp.get_time_as_ntp64().as_nanos(), str(stamp.get_id()))

    @property
    def number(self) -> tuple[str, int] | None:
        """Its sender, and its number among those of the sender on this key; None without a
        stamp.
        """
        parts = _stamp_parts(self._sample.attachment)
        return (parts[0].decode(errors="replace"), int(parts[1])) if parts else None

    @property
    def delivery(self) -> tuple[str, bool]:
        """Congestion control ("DROP" or "BLOCK"), and whether it is express (not batched)."""
        return str(self._sample.congestion_control).rpartition(".")[2], bool(self._sample.express)


class Declared:
    """What a bus has declared to all others, in `ends`, until `close`."""

    def __init__(self, *ends: Any) -> None:
        self.ends = list(ends)
        self.thread: threading.Thread | None = None  # the one that waits for Zenoh here
        self.kept: set[Declared] = set()  # by the bus, with all that is declared

    def close(self) -> None:
        """Remove the declarations: nothing more arrives, and others see it leave. Does nothing the
        second time.
        """
        self.kept.discard(self)
        ends, self.ends = self.ends, []
        for end in reversed(ends):
            end.undeclare()

    def leave_to_parent(self, refuse: Callable[..., Any]) -> None:
        """Let each use call `refuse`, in a process that was forked from the one that has declared
        this.
        """

    @contextlib.contextmanager
    def unless_closed(self) -> Iterator[None]:
        """Convert any error to a BusError once this is closed."""
        try:
            yield
        except Exception:  # a ZError. Zenoh is imported later than this module
            if self.ends:
                raise
            raise BusError("closed") from None


class Answers(Declared):
    """Answers the queries of a queryable by `answer`, one after the other in a thread of its own,
    until `close`.
    """

    def __init__(self, queryable: Any, answer: Callable[[Any], None]) -> None:
        super().__init__(queryable)
        self._queries, self._answer = queryable.handler, answer
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        while True:
            try:
                query = self._queries.recv()
            except Exception:  # as in RawSubscriber.recv
                return
            self._handle(query)

    def _handle(self, query: Any) -> None:
        with query:
            try:
                self._answer(query)
            except Exception as error:  # of any kind: else later queries would get no answer
                if self.ends:  # not closed meanwhile
                    report(f"{query.key_expr}: {type(error).__name__}: {error}")


class Ring:
    """The newest `depth` samples or requests of each priority on one key of a Dealer. It has the
    interface of Zenoh's ring channel, and of the declaration that fills it.

    A flood pushes nothing out that came on another key, or with a higher priority.
    """

    def __init__(self, dealer: "Dealer", key: str, depth: int) -> None:
        self.dealer, self.key, self.handler, self._depth = dealer, key, self, depth
        self._waiting: dict[int, deque[Any]] = {}  # by priority, the strongest first

    def append(self, one: Any, priority: int) -> None:
        """Add what came with a priority of Zenoh."""
        if priority not in self._waiting:
            self._waiting = dict(
                sorted({**self._waiting, priority: deque(maxlen=self._depth)}.items())
            )
        self._waiting[priority].append(one)

    def try_recv(self) -> Any:
        """The next that waits, of the highest priority; or None."""
        return next((waiting.popleft() for waiting in self._waiting.values() if waiting), None)

    def undeclare(self) -> None:
        """Get nothing more."""
        self.dealer.remove(self)


class Dealer(Declared):
    """Deals what comes on a key expression, such as `*/cmd_vel`, to the rings of its keys, so that
    the reader need not poll every robot's queue.

    ready: The rings that got something, in order; the reader takes them out.

    `declared` is Zenoh's subscriber, or its queryable; a request for several keys at once is dealt
    to none.
    """

    def __init__(self, declared: Any, is_queryable: bool) -> None:
        super().__init__(declared)
        self._recv, self._is_queryable = declared.handler.try_recv, is_queryable
        self._rings: dict[str, Ring] = {}
        self.ready: dict[Ring, None] = {}

    def ring(self, key: str, depth: int) -> Ring:
        """A ring for a key, which takes the place of an earlier one."""
        self._rings[key] = ring = Ring(self, key, depth)
        return ring

    def remove(self, ring: Ring) -> None:
        """Deal to a ring no longer. The last one ends the declaration."""
        if self._rings.get(ring.key) is ring:
            del self._rings[ring.key]
        self.ready.pop(ring, None)
        if not self._rings:
            self.close()

    def deal(self) -> None:
        """Deal what waits, but no more than MAX_DEALT."""
        for _ in range(MAX_DEALT):
            if (one := self._recv()) is None:
                return
            priority = 0 if self._is_queryable else int(one.priority)
            for ring in self._rings_of(one.key_expr):
                ring.append(one, priority)
                self.ready[ring] = None

    def _rings_of(self, key_expr: Any) -> Iterable[Ring]:
        ring = self._rings.get(key := str(key_expr))
        if ring or self._is_queryable or "*" not in key:
            return (ring,) if ring else ()
        return [ring for key, ring in self._rings.items() if key_expr.intersects(key)]


def until_closed(recv: Callable[[], T]) -> Iterator[T]:
    """What `recv` returns, again and again until it raises BusError."""
    with contextlib.suppress(BusError):
        while True:
            yield recv()


class RawSubscriber(Declared):
    """Raw samples; if too many wait, the oldest are dropped."""

    def __init__(self, subscriber: Any, limit: int = 0) -> None:
        super().__init__(subscriber)
        # Reading from the handler leaves the subscriber free to be undeclared at the same time.
        self.channel, self.limit = subscriber.handler, limit
        self._reads = 0  # the number of `thread`, which is found in half the time

    def leave_to_parent(self, refuse: Callable[..., Any]) -> None:
        """Receive no more."""
        self.channel = SimpleNamespace(recv=refuse, try_recv=refuse)

    def try_recv(self) -> Sample | None:
        """The next waiting sample, or None."""
        sample = self.channel.try_recv()
        return sample and Sample(sample, self.limit)

    def recv(self) -> Sample:
        """The next sample; waits for it. Raises BusError once the bus or this subscriber is
        closed.
        """
        return Sample(self.wait(), self.limit)

    def wait(self) -> Any:
        """Zenoh's next sample, as `recv`."""
        if (thread := threading.get_ident()) != self._reads:
            self._reads, self.thread = thread, threading.current_thread()
        try:
            return self.channel.recv()
        except BusError:
            raise
        # a ZError: the session is closed. Zenoh is imported later than this module
        except Exception:
            raise BusError("closed") from None


class Replies:
    """The replies to `Bus.ask` and `ask_all`, each a sample or the bytes of an error. With a
    `replier`, those of any other session are skipped, by Zenoh's own id of the replier.
    """

    def __init__(self, replies: Any, replier: str = "") -> None:
        self._replies, self._replier = replies, replier

    def try_recv(self) -> Sample | bytes | None:
        """The next reply, or None. Raises BusError when there will be no more."""
        try:
            while (reply := self._replies.try_recv()) is not None:
                if self._is_meant(reply):
                    return _read(reply)
        except Exception:  # a ZError: all have replied, or it timed out
            raise BusError("no more replies") from None
        return None

    def __iter__(self) -> Iterator[Sample | bytes]:
        """All replies; waits for each."""
        return map(_read, filter(self._is_meant, self._replies))

    def _is_meant(self, reply: Any) -> bool:
        return not self._replier or bool(
            reply.replier_id and str(reply.replier_id.zid) == self._replier
        )


def _read(reply: Any) -> Sample | bytes:
    return Sample(reply.ok) if reply.ok else bytes(reply.err.payload)
