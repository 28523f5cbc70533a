"""The graph: the nodes and what they read, write and serve, announced by Zenoh liveliness tokens.

A token's key is `@holozen/<session>/<node>/<kind>/<package>/<msg, srv or action>/<Type>/<key>`; a
`node` token ends after its kind. A slash in a node's name is written as `%2F`. The `@` excludes
them from a plain `**`.
"""

import contextlib
import functools
import json
import os
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, Self

from holozen.transport.errors import BusError
from holozen.transport.samples import Answers, source

ALL = "@holozen/**"
ALL_NODE_INFO = "@holozen/*/about"
ALL_WITNESSES = "@holozen/*/witness"
ROBOTS = "@holozen/*/*/srv/std_srvs/srv/Trigger/**/stop"  # the tokens of what stops a robot
SIMS = "@holozen/*/*/srv/*/*/*/get_entities"
PARAMETERS = "@holozen/*/*/srv/*/*/*/**/list_parameters"  # of all nodes with parameters
WITNESSED = (ROBOTS, SIMS, PARAMETERS)
# of `Node.hidden`
UNREACHED = "{source} does not answer: it hangs or is stopped, or cannot be reached from here"
MAX_SETTLING = 5.0  # s that a snapshot waits for nodes, while some come or go
SILENT_FACTOR = 5  # how many times longer it waits for nodes without tokens
SORTING = 0.1  # of the time at most is spent on sorting the endpoints
QUICK = 0.002  # s; what takes no longer is sorted at each change
MAX_GONE = 1000  # tokens kept until `left` is called; the oldest are dropped
KINDS = ("node", "pub", "sub", "srv")
OF_SESSIONS = ("node", "beat", "goal_beat")  # the kinds of tokens without a key
LATCHED = ("tf_static", "robot_description", "map")
"""Last names of keys whose late readers get the last message too: in ROS 2 they are transient
local.
"""


class Endpoint(NamedTuple):
    """One node, or one of its publishers ("pub"), subscribers ("sub") or services ("srv")."""

    key: str
    kind: str
    type: str
    node: str
    session: str

    @property
    def source(self) -> str:
        """The source of its samples."""
        return source(self.node, self.session)


def quoted(key: str) -> str:
    """A key as written in a token, which may have no wildcards even where an endpoint's key
    does.
    """
    return key.replace("%", "%25").replace("*", "%2A").replace("$", "%24")


def token(endpoint: Endpoint) -> str:
    """The token's key for an endpoint."""
    node = quoted(endpoint.node).replace("/", "%2F")
    start = f"@holozen/{endpoint.session}/{node}/{endpoint.kind}"
    return (
        start if endpoint.kind in OF_SESSIONS else f"{start}/{endpoint.type}/{quoted(endpoint.key)}"
    )


@functools.lru_cache(maxsize=4096)  # displays of the graph parse the same tokens again and again
def parse(text: str) -> Endpoint | None:
    """The endpoint a token names; None if the key is no such token."""
    parts = text.split("/", 7)
    if len(parts) == 4 and parts[0] == "@holozen" and parts[3] == "node":
        return Endpoint("", "node", "", _unquoted(parts[2]), parts[1])
    if len(parts) == 8 and parts[0] == "@holozen" and parts[3] in KINDS:
        return Endpoint(
            _unquoted(parts[7]), parts[3], "/".join(parts[4:7]), _unquoted(parts[2]), parts[1]
        )
    return None


def _unquoted(text: str) -> str:
    return text.replace("%2F", "/").replace("%24", "$").replace("%2A", "*").replace("%25", "%")


def on_key(endpoints: Iterable[Endpoint], key: str, kind: str) -> list[Endpoint]:
    """The endpoints of a kind on a key, also those with a key expression such as `**/odom`."""
    return [
        endpoint for endpoint in endpoints if endpoint.kind == kind and includes(endpoint.key, key)
    ]


def latched(endpoints: Iterable[Endpoint], expression: str, every: bool = False) -> list[Endpoint]:
    """The publishers on a key expression whose last message late readers get too: of LATCHED keys,
    or `every` one.
    """
    return [
        one
        for one in endpoints
        if one.kind == "pub" and (every or is_latched(one.key)) and includes(expression, one.key)
    ]


def is_latched(key: str) -> bool:
    """Whether late readers of a key get its last message."""
    return key.rpartition("/")[2] in LATCHED


def subscribers(endpoints: Iterable[Endpoint], key: str, matched: bool) -> int:
    """How many subscribe to a key: at least one if Zenoh has a match (`matched`), since foreign
    nodes have no tokens.

    A sim subscribes to `*/cmd_vel`. So if a robot listens on `Fred/cmd_vel`, a match of
    `Ghost/cmd_vel` means nothing.
    """
    listed = [*endpoints]
    _, _, rest = key.partition("/")
    if on_key(listed, key, "sub") or not rest:
        return max(len(on_key(listed, key, "sub")), int(matched))
    return int(
        matched
        and not any(end.kind == "sub" and end.key.partition("/")[2] == rest for end in listed)
    )


def includes(expression: str, key: str) -> bool:
    """Whether a key expression with whole-chunk wildcards (`*`, `**`) includes a key."""
    if "*" not in expression:
        return expression == key
    chunks, ends = key.split("/"), {0}  # how many chunks the expression so far may match
    for part in expression.split("/"):
        if part == "**":
            ends = {*range(min(ends, default=len(chunks) + 1), len(chunks) + 1)}
        else:
            ends = {end + 1 for end in ends if end < len(chunks) and part in ("*", chunks[end])}
    return len(chunks) in ends


class Graph:
    """The endpoints of all nodes as their tokens come and go.

    `change` returns the key of the next token that changed and whether it exists, or None if there
    is none. `roll_call` waits until all connected nodes have sent their tokens, and returns False
    if that took too long; `met` returns their sessions. `expected` returns the sessions that are
    known to be alive, linked by now or not, and how many more there are, which do not answer; None
    if that is unknown. `busy` returns whether one of those runs: it may be slow. `undeclare` ends
    the subscription. `took`: the seconds that the first link took. Use it in `with`, or keep it
    until the bus is closed.
    """

    def __init__(
        self,
        change: Callable[[], tuple[str, bool] | None],
        roll_call: Callable[[], bool] = lambda: True,
        met: Callable[[], Iterable[str]] = tuple,
        expected: Callable[[], tuple[set[str], int | None]] = lambda: (set(), None),
        undeclare: Callable[[], object] = lambda: None,
        took: float = 0.0,
        busy: Callable[[], bool] = lambda: False,
    ) -> None:
        self._change, self._roll_call, self._met, self._expected = change, roll_call, met, expected
        self._undeclare, self._took, self._busy = undeclare, took, busy
        # the endpoint of each; None for a token of others
        self._tokens: dict[str, Endpoint | None] = {}
        self._sessions: dict[str, set[str]] = {}  # the tokens of each
        self._publishers: dict[str, Counter[str]] = {}  # key -> sessions with a publisher there
        self.changes = 0  # how often a token came or went
        # a count of changes, and the endpoints then
        self._sorted: tuple[int, list[Endpoint]] = (0, [])
        self._sort_due = 0.0  # s; until then the endpoints stay as they were
        self._gone: deque[Endpoint] = deque(maxlen=MAX_GONE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """Receive no more tokens. Later calls raise BusError."""
        self._undeclare()

    def endpoints(self) -> list[Endpoint]:
        """The known endpoints, sorted by key. Among very many they are as old as it takes to sort
        them ten times: one that announces and withdraws hundreds a second must not hold up a loop
        that drives.
        """
        self._update()
        if self._sorted[0] != self.changes and (began := time.monotonic()) >= self._sort_due:
            self._sorted = self.changes, sorted(filter(None, self._tokens.values()))
            took = time.monotonic() - began
            self._sort_due = began + took / SORTING if took > QUICK else 0.0
        return list(self._sorted[1])

    @property
    def seen(self) -> int:
        """The count of `changes` up to which `endpoints` returned them last."""
        return self._sorted[0]

    def has(self, session: str) -> bool:
        """Whether a session had any token at the last update."""
        return session in self._sessions

    def left(self) -> list[Endpoint]:
        """The nodes that left since the last call. Cheap when there are none."""
        self._update()
        return [self._gone.popleft() for _ in range(len(self._gone))]

    def publishers(self, key: str) -> Iterable[str]:
        """The sessions that have a publisher on a key."""
        self._update()
        return self._publishers.get(key, ())

    def settled(
        self, connected: Callable[[], bool], patience: float = 0.5, quiet: float = 0.015
    ) -> list[Endpoint]:
        """The endpoints once all nodes have sent theirs; at most `patience` seconds after the last
        change.

        That is when each session that is expected has sent its tokens; or, where there may be more,
        when nothing has changed for `quiet` seconds, or twice the time that the first link or the
        last change took, since peers introduce further peers. The wait is longer for one that does
        not answer, or has no tokens: it may hang, be foreign, or be about to; and longest for one
        that runs, but has not answered yet.
        """
        start = time.monotonic()
        self._sort_due = 0.0
        while not connected():
            if time.monotonic() - start > patience or self._expected() == (set(), 0):
                return self.endpoints()
            time.sleep(0.001)
        self._roll_call()  # on a new link nothing may answer yet
        self._update()
        seen, since = self.changes, time.monotonic()
        deadline = since + patience
        while (now := time.monotonic()) < deadline:
            passed, enough = now - since, max(quiet, 2 * self._took, 2 * (since - start))
            alive, silent = self._expected()
            if self._tokens and alive <= {*self._met(), *self._sessions}:
                if passed > SILENT_FACTOR * enough and not self._busy():
                    break
                is_complete = silent == 0 or (silent is None and passed > enough)
                # A session's first token may have come before its others.
                if is_complete and self._have_announced() and self._roll_call():
                    self._update()
                    if self._have_announced(self._expected()[0]) and (
                        silent == 0 or self.changes == seen
                    ):
                        break
            time.sleep(0.001)
            self._update()
            if self.changes != seen:
                seen, since = self.changes, time.monotonic()
                deadline = min(since + patience, start + MAX_SETTLING)
        self._sort_due = 0.0
        return self.endpoints()

    def _have_announced(self, alive: Iterable[str] = ()) -> bool:
        """Whether each peer, and each session `alive`, has sent a token."""
        return {*self._met(), *alive} <= self._sessions.keys()

    def _update(self) -> None:
        while (change := self._change()) is not None:
            key, there = change
            if key.count("/") < 3:  # foreign: any node can declare any token
                continue
            self.changes += 1
            if there and key not in self._tokens:
                self._add(key)
            elif not there:
                endpoint = parse(key)
                if endpoint and endpoint.kind == "node":
                    self._gone.append(endpoint)
                if key in self._tokens:
                    self._remove(key, endpoint)

    def _add(self, key: str) -> None:
        endpoint = self._tokens[key] = parse(key)
        self._sessions.setdefault(key.split("/", 2)[1], set()).add(key)
        if endpoint and endpoint.kind == "pub":
            self._publishers.setdefault(endpoint.key, Counter())[endpoint.session] += 1

    def _remove(self, key: str, endpoint: Endpoint | None) -> None:
        del self._tokens[key]
        session = key.split("/", 2)[1]
        self._sessions[session].remove(key)
        if endpoint and endpoint.kind == "pub":
            sessions = self._publishers[endpoint.key]
            sessions[session] -= 1
            if not sessions[session]:
                del sessions[session]
            if not sessions:
                del self._publishers[endpoint.key]
        if not self._sessions[session]:
            del self._sessions[session]


def node_info_key(session: str) -> str:
    """The key of a session's node info."""
    return ALL_NODE_INFO.replace("*", session)


def definition_key(session: str, type_name: str) -> str:
    """The key on which a session, or all of them (`*`), answer with the definition of a type."""
    return f"@holozen/{session}/definition/{type_name}"


def version(package: str) -> str:
    """The installed version of a package; empty if it is not installed."""
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def definition(session: Any, channel: Any, type_name: str, text: str) -> Answers:
    """Answers queries for the definition of a type."""
    key = definition_key(str(session.zid()), type_name)
    queryable = session.declare_queryable(key, channel)
    return Answers(queryable, lambda query: query.reply(key, text, encoding="text/plain"))


class Witness(Answers):
    """Answers queries for the tokens of robots, sims and parameters in sessions other than those
    that the query names: those to which the asker has a link. A process that hangs makes no new
    link, so one that comes later cannot see it; this session does, until its own link lapses.
    `graphs` hold the tokens, and `ends` are their subscriptions.
    """

    def __init__(self, session: Any, channel: Any, graphs: list[Graph], ends: list[Any]) -> None:
        self._graphs, self._key = graphs, ALL_WITNESSES.replace("*", str(session.zid()))
        super().__init__(session.declare_queryable(self._key, channel), self._reply)
        self.ends = [*ends, *self.ends]

    def _reply(self, query: Any) -> None:
        linked = {*bytes(query.payload or b"").decode(errors="replace").split()}
        with contextlib.suppress(BusError):  # this session is being closed
            known = [
                end
                for graph in self._graphs
                for end in graph.endpoints()
                if end.session not in linked
            ]
            query.reply(self._key, "\n".join(map(token, known)), encoding="text/plain")


class NodeInfo(Answers):
    """Answers queries about this node."""

    def __init__(self, session: Any, channel: Any, node: str, exposed: list[str]) -> None:
        self._key = node_info_key(str(session.zid()))
        self._fixed = {
            "node": node,
            "host": os.uname().nodename,
            "pid": os.getpid(),
            "exposed": exposed,
        }
        super().__init__(session.declare_queryable(self._key, channel), self._reply)

    def _reply(self, query: Any) -> None:
        # Looked up on the first query: it takes longer than the rest of the start.
        if "version" not in self._fixed:
            self._fixed |= {"version": version("holozen"), "zenoh": version("eclipse-zenoh")}
        info = self._fixed | {"time": time.time()}
        query.reply(self._key, json.dumps(info), encoding="application/json")
