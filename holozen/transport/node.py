"""A node on the wire: one Zenoh session, with samples as bytes, and the graph. This suffices to
observe.

No work is done in Zenoh's threads: samples wait in ring channels, so a slow reader delays only
itself.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import re
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NoReturn, Self, TypeVar

import zenoh

from holozen.console import report
from holozen.process import quiet
from holozen.suggest import cut
from holozen.transport import graph as graphs
from holozen.transport.connection import UNIX, Connection, from_environment
from holozen.transport.errors import LONGEST_KEY, BusError
from holozen.transport.graph import Graph, NodeInfo
from holozen.transport.samples import Declared, RawSubscriber, Replies, Sample, source
from holozen.transport.session import (
    CLOSE_LIMIT,
    FORKED,
    MAX_TOKENS,
    Opening,
    join_at_end,
    linked,
    one_line,
    token_change,
    tokens,
    wait_for_threads,
    witness,
)

if TYPE_CHECKING:
    from holozen.transport.authenticator import Member

D = TypeVar("D", bound=Declared)

ROLL_CALL = 2.0  # s for all nodes to send their tokens; a sim with hundreds of robots has thousands
WITNESS_TIMEOUTS = (1.0, 5.0)  # s for all others to tell of what hangs; if none does, for any
DEFINITION_WAIT = 0.5  # s for a node to be found that answers
DEFINITION_TIMEOUT = 2.0  # s for its answer
LAST_WAIT = 0.5  # s for a publisher to be found that answers with its last message
LAST_TIMEOUT = 2.0  # s for its answer; a busy machine takes long
# samples; Zenoh takes the memory for all of them at once, and without it aborts the process
MAX_DEPTH = 1 << 24
LONGEST_NAME = 255  # characters of a node's name, as in ROS
_NAME = re.compile(r"[\w.-]+(?:[ /][\w.-]+)*")

_open: weakref.WeakSet[Node] = weakref.WeakSet()
# Zenoh's objects that were inherited across a fork, kept alive because freeing them would join
# threads that exist only in the parent.
_inherited: list[Any] = []


def _leave_to_parent() -> None:
    """Refuse to use the nodes in a process that was forked from theirs. Zenoh's threads are not in
    it, so it would send nothing, and wait for ever.
    """
    for node in list(_open):
        node.leave_to_parent()
    _open.clear()


os.register_at_fork(after_in_child=_leave_to_parent)


@atexit.register
def _close_all() -> None:
    """Close what a program has left open, before the interpreter is finalized: Zenoh's threads that
    enter or return to Python in that hang or abort the process. All at once, so that those that
    hang do not add up.
    """
    closing = [(node, node.begin_close()) for node in list(_open)]
    join_at_end(thread for _, threads in closing for thread in threads)
    hung = [(node, others) for node, (closer, *others) in closing if closer and closer.is_alive()]
    for node, _ in hung:
        node.close_session()
    join_at_end(thread for _, others in hung for thread in others)


class Node:
    """A node on the wire, open until `close`, the end of its `with`, or that of the process.

    `wire` is "json" or "cdr", by default that of the connection. `lasting` is for
    long-running nodes, which are listed in the graph at once; see Opening for it, `patience`,
    `stop` and `at_address`. With an early Opening, the first use waits for it, and raises its
    error. Raises BusError for a name or a wire that cannot be.
    """

    def __init__(
        self,
        node: str,
        connection: Connection | Opening | None = None,
        *,
        wire: str = "",
        patience: float | None = None,
        lasting: bool = False,
        stop: threading.Event | None = None,
        at_address: bool = False,
    ) -> None:
        _check_name(node)
        if wire:
            checked_wire(wire)
        if not isinstance(connection, Opening):
            where = connection or from_environment()
            connection = Opening(
                where, lasting=lasting, patience=patience, stop=stop, at_address=at_address
            )
        self.node, self.wire, self.where = node, wire or connection.wire, connection.where
        self.networks, self._group = connection.networks, connection.group
        self._closing, self._opened, self._secure = (
            connection.closing,
            connection.opened,
            connection.secure,
        )
        self._is_of_verb = connection.is_of_verb
        self._declared: set[Declared] = set()
        self._info: NodeInfo | None = None  # what lists this node in the graph
        if lasting:
            self._opened()
        _open.add(self)
        if lasting:
            if self._group and (self._opened().others.count() or 0):
                from holozen.transport.listeners import shared

                if warning := shared(self._group):
                    report(f"{node}: {warning}")
            if self.exposed:
                from holozen.transport.listeners import exposure

                report(f"{node}: {exposure(self.exposed)}")
            if self.member and (warning := self.member.warning()):
                report(f"{node}: {warning}")
            self._keep(witness(self.session))
            self.announce_node()

    def announce_node(self) -> NodeInfo:
        """List this node in the graph until it is closed, unless it is listed already. When it
        vanishes from there, the robots that it drives stop.
        """
        if self._info is None:
            self._info = self._keep(
                NodeInfo(self.session, zenoh.handlers.RingChannel(16), self.node, self.exposed)
            )
            self._info.ends.append(self.announce("node"))
        return self._info

    @property
    def session(self) -> Any:
        """Zenoh's session. Raises BusError if it could not be opened."""
        return self._opened().session

    @property
    def took(self) -> float:
        """Seconds until the session was open and had a link: about three round trips over a slow
        network.
        """
        return self._opened().took

    @property
    def id(self) -> str:
        """The session's id."""
        return str(self.session.zid())

    @property
    def source(self) -> str:
        """The name of this node in the samples that it sends."""
        return source(self._signer, self.id)

    @cached_property
    def server_times(self) -> dict[str, int]:
        """Server's session -> its own time (ns) in its last reply, the newest reply last."""
        return {}

    @property
    def _signer(self) -> str:
        """The name before the session in its stamps: in the secure set-up `member/node`."""
        return f"{self.member.name}/{self.node}" if self.member else self.node

    @cached_property
    def member(self) -> Member | None:
        """The member whose certificate it uses; None outside the secure set-up."""
        if not self._secure:
            return None
        from holozen.transport.authenticator import authenticator

        return authenticator().load(self._secure)

    def __enter__(self) -> Self:
        if self._closing.is_set():
            raise BusError("closed; make another")
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    @property
    def listens(self) -> list[str]:
        """The endpoints where this session listens, also those of a configuration file. Raises
        BusError.
        """
        return self._opened().listens

    @cached_property
    def exposed(self) -> list[str]:
        """The endpoints that other machines can reach without a password, a certificate or a
        permission.
        """
        if self._opened().is_guarded or all(
            one.startswith(("tcp/127.0.0.1:", UNIX)) for one in self.listens
        ):
            return []
        from holozen.transport.listeners import is_open  # loads socket

        return [*filter(is_open, self.listens)]

    def close(self) -> None:
        """Close the session. Returns within 0.2 s, whatever the other side does.

        One of Zenoh's threads that handles a declaration while its session is closed panics, and
        prints that: verbs would end with it now and then (as eclipse-zenoh/zenoh#2624). Their own
        work is done by then.
        """
        with quiet() if self._is_of_verb else contextlib.nullcontext():
            wait_for_threads(self.begin_close(), CLOSE_LIMIT)

    def begin_close(self) -> list[threading.Thread | None]:
        """As `close`, without waiting; returns the threads that end when it is closed."""
        _open.discard(self)
        self._closing.set()
        declared = list(self._declared)
        closer = threading.Thread(target=self._leave, args=(declared,), daemon=True)
        closer.start()
        return [closer, *(one.thread for one in declared)]

    def _leave(self, declared: list[Declared]) -> None:
        # A link that another session opens at this moment may outlive this session, and Zenoh would
        # keep showing there what was declared. So that is withdrawn first.
        for one in declared:
            with contextlib.suppress(Exception):  # closed, or in use, by another thread
                one.close()
        self.close_session()

    def leave_to_parent(self) -> None:
        """Raise BusError at each use from now on, in a process that was forked from this node's."""

        def refuse(*_words: Any, **_flags: Any) -> NoReturn:
            raise BusError(FORKED)

        for one in self._declared:
            one.leave_to_parent(refuse)
        _inherited.append((self._opened, self._declared))
        self._opened, self._declared = refuse, set()

    def close_session(self) -> None:
        """Close the session alone; what is declared is not withdrawn first."""
        with contextlib.suppress(BusError, SystemExit):  # an error of opening was reported already
            self._opened().close()

    def _keep(self, declared: D) -> D:
        """Keep something until it, or the bus, is closed."""
        declared.kept = self._declared
        self._declared.add(declared)
        return declared

    def keep(self, declared: D) -> D:
        """Close something together with this node."""
        return self._keep(declared)

    @property
    def has_router(self) -> bool:
        """Whether this session has a link to a router. Raises BusError."""
        return bool(self.session.info.routers_zid())

    def roll_call(self, timeout: float) -> bool:
        """Ask who is alive in this session; where there is a router, it is the one to answer.
        Returns whether it did so within `timeout` seconds. While Zenoh's tables are locked it waits
        for ever. Raises BusError.
        """
        began, key = time.monotonic(), f"@holozen/{self.id}/*/node"
        with one_line(f"key {key!r}"):
            for _ in self.session.liveliness().get(
                key, zenoh.handlers.FifoChannel(16), timeout=timeout
            ):
                pass
        return time.monotonic() - began < timeout

    def announce(self, kind: str, type_name: str = "", key: str = "") -> Any:
        """List a node or an endpoint in the graph for as long as the token is kept. Raises
        BusError.
        """
        _check_length(key)
        endpoint = graphs.Endpoint(key, kind, type_name, self.node, self.id)
        with one_line(f"key {key!r}"):
            if kind not in graphs.OF_SESSIONS:
                zenoh.KeyExpr(key)  # raises ZError; that of the token would name the token
            return self.session.liveliness().declare_token(graphs.token(endpoint))

    def subscribe_raw(self, key: str, depth: int = 1024, limit: int = 0) -> RawSubscriber:
        """A reader of bytes on any key expression that keeps the newest `depth`. Raises BusError if
        either is wrong.
        """
        if not (isinstance(depth, int) and 0 < depth <= MAX_DEPTH):
            raise BusError(f"key {key!r}: depth {depth!r}: use 1 to {MAX_DEPTH}")
        _check_length(key)
        with one_line(f"key {key!r}"):
            subscriber = self.session.declare_subscriber(key, zenoh.handlers.RingChannel(depth))
        return self._keep(RawSubscriber(subscriber, limit))

    def ask(
        self, key: str, timeout: float, replier: str = "", number: str = "", **request: Any
    ) -> Replies:
        """Send one request, without waiting for the service. `replier`: the session whose replies
        alone are read. `number` identifies the request, so that a server recognizes it when it is
        sent again, see RepeatedRequest.
        """
        _check_length(key)
        attachment = f"{self.source};{number}" if number else self.source
        # Deliver each reply as it comes: by default the first one is held back until all servers
        # have answered.
        at_once = zenoh.ConsolidationMode.NONE
        with one_line(f"key {key!r}"):
            replies = self.session.get(
                key, timeout=timeout, attachment=attachment, consolidation=at_once, **request
            )
        return Replies(replies, replier)

    def served(self, key: str) -> Callable[[], bool]:
        """A function that returns whether any node, also a foreign one, answers on `key` now."""
        with one_line(f"key {key!r}"):
            querier = self.session.declare_querier(key)
        return lambda: bool(querier.matching_status.matching)

    def writers(self, key: str) -> RawSubscriber:
        """Reads a sample for each holozen publisher on `key` that exists, appears or disappears.
        Raises BusError.
        """
        return self._keep(
            RawSubscriber(tokens(self.session, f"@holozen/*/*/pub/*/*/*/{graphs.quoted(key)}", 64))
        )

    def ask_all(self, key: str, timeout: float, **request: Any) -> Replies:
        """Query all servers of `key`, ahead of other traffic."""
        return self.ask(
            key,
            timeout,
            target=zenoh.QueryTarget.ALL,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
            congestion_control=zenoh.CongestionControl.BLOCK,
            **request,
        )

    def last_messages(self, publishers: Iterable[graphs.Endpoint]) -> Iterator[Sample]:
        """The last message of each of these publishers, if it has sent one."""
        deadline = time.monotonic() + LAST_WAIT
        for one in publishers:
            found = False
            while not found:  # on a new link a node's tokens may be known before its queryables
                for reply in self.ask_all(one.key, LAST_TIMEOUT, replier=one.session):
                    if not isinstance(reply, bytes):
                        found = True
                        yield reply
                if time.monotonic() > deadline:
                    break
                time.sleep(0.01)

    def definition(self, type_name: str) -> str:
        """The definition of a type and of those nested in it, from a node that publishes it; empty
        if none does.
        """
        if not re.fullmatch(r"\w+/(?:msg|srv|action)/\w+", type_name):
            return ""
        deadline = time.monotonic() + DEFINITION_WAIT
        while True:  # on a new link a node's tokens may be known before its queryables
            for reply in self.ask_all(graphs.definition_key("*", type_name), DEFINITION_TIMEOUT):
                if not isinstance(reply, bytes):
                    return reply.payload.decode(errors="replace")
            if time.monotonic() > deadline:
                return ""
            time.sleep(0.01)

    def graph(self, keys: str = graphs.ALL) -> Graph:
        """The endpoints of all nodes, or those with tokens that match `keys`, kept up to date.
        Raises BusError.
        """
        live, known = self.session.liveliness(), tokens(self.session, keys)
        if keys == graphs.ALL:
            self._opened().others.refresh()

        def roll_call() -> bool:
            # A full channel would block Zenoh's thread, and the rest, for ever: the default one is
            # for 256 replies.
            replies: Any = zenoh.handlers.FifoChannel(MAX_TOKENS)
            timeout, began = max(ROLL_CALL, self.took), time.monotonic()
            with one_line(f"key {keys!r}"):  # such as of a session that another thread has closed
                for _ in live.get(keys, replies, timeout=timeout):
                    pass
            return time.monotonic() - began < timeout

        return Graph(
            partial(token_change, known),
            roll_call,
            lambda: map(str, self.session.info.peers_zid() if keys == graphs.ALL else ()),
            self._expected if keys == graphs.ALL else lambda: (set(), None),
            partial(_undeclare, known),
            self.took,
            self._opened().others.are_busy if keys == graphs.ALL else lambda: False,
        )

    def _expected(self) -> tuple[set[str], int | None]:
        """The sessions of this machine that answer, and how many do not. See Graph."""
        others = self._opened().others
        answered, count = others.answered(), others.count()
        return answered, None if count is None else max(0, count - len(answered))

    def endpoints(self, keys: str = graphs.ALL, patience: float = 0.5) -> list[graphs.Endpoint]:
        """A snapshot of the graph, as `Graph.settled` returns it, without a lasting subscription.

        It waits as long as the session took to connect, if that is more than `patience`: the
        network is slow. One of `keys` alone is complete only after a whole one, since it does not
        wait for links that are still being made.
        """
        with self.graph(keys) as graph:
            return graph.settled(self.connected, max(patience, self.took))

    def hidden(self) -> list[graphs.Endpoint]:
        """The services of robots, sims and parameters that others know of, but to which this
        session has no link: they hang, or cannot be reached from here. Ask once the graph has
        settled, when there is a link to all that answer.
        """
        if self.session.info.routers_zid():  # it sees everything through the router
            return []
        keys = [key for answer in self._witnesses() for key in answer.splitlines()]
        found = {end for key in keys if (end := graphs.parse(key)) and end.kind == "srv"}
        if not found:
            return []
        # A client of a peer sees others through it, without a link.
        seen = {end.session for keys in graphs.WITNESSED for end in self.endpoints(keys)}
        return sorted(end for end in found if end.session not in seen)

    def _witnesses(self) -> list[str]:
        """What other sessions know of those to which this one has no link: tokens, one a line."""
        linked = " ".join([self.id, *map(str, self.session.info.peers_zid())])
        for timeout in WITNESS_TIMEOUTS:
            replies = self.ask_all(graphs.ALL_WITNESSES, max(timeout, self.took), payload=linked)
            answers = [
                reply.payload.decode(errors="replace")
                for reply in replies
                if not isinstance(reply, bytes)
            ]
            if answers:
                return answers
        return []

    def silent(self) -> str:
        """Which processes are there on this machine and do not answer, and what to do; empty if
        there are none. Ask once the graph has settled.
        """
        return self._opened().others.silent() if self._expected()[1] else ""

    def others_listen(self) -> set[str]:
        """Where those listen who have answered in the group on this machine."""
        return self._opened().others.listening

    def connected(self) -> bool:
        """Whether this session has a link to any other. Raises BusError once the bus is closed."""
        if self._closing.is_set():
            raise BusError("closed")
        return linked(self.session)


def _check_name(node: object) -> None:
    # It goes into keys, and into attachments before `@` and `;`.
    if not isinstance(node, str) or len(node) > LONGEST_NAME or not _NAME.fullmatch(node):
        raise BusError(
            f"name of a node {cut(str(node))}: use up to {LONGEST_NAME} letters, digits, '_', '-' "
            "and '.', with single"
            " spaces or '/' in between (such as my_node)"
        )


def _check_length(key: str) -> None:
    if len(key) > LONGEST_KEY:
        raise BusError(f"key {cut(key)}: {len(key)} characters; a key has at most {LONGEST_KEY}")


def checked_wire(wire: str) -> str:
    """`wire`; raises BusError if there is none of that name."""
    from holozen.messages import WIRES  # not loaded by an echo

    if wire not in WIRES:
        raise BusError(f"no wire {wire!r}; there are {', '.join(WIRES)}")
    return wire


def _undeclare(tokens: Any) -> None:
    with contextlib.suppress(zenoh.ZError):  # the session is closed
        tokens.undeclare()
