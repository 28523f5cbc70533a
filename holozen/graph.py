"""The graph: who is there and what they read, write and serve, told by Zenoh liveliness tokens.

A token's key is `@holozen/<session>/<node>/<kind>/<package>/<msg or srv>/<Type>/<key>`; a `node` token ends after its
kind. A slash in a node's name stands as `%2F`. The `@` keeps them out of reach of a plain `**`.
"""

from __future__ import annotations

import functools
import time
from collections import deque, namedtuple
from collections.abc import Callable, Iterable

from holozen.tap import source

ALL = "@holozen/**"
STRANGERS = 5  # times as long as for others is waited for those who have told nothing
MOST_GONE = 1000  # tokens that are remembered for who asks which nodes left; the oldest are dropped
KINDS = ("node", "pub", "sub", "srv")


class Endpoint(namedtuple("Endpoint", "key kind type node session")):  # of texts; `typing` would take 3 ms to load
    """One node, or one of its publishers ("pub"), subscribers ("sub") or services ("srv")."""

    key: str
    kind: str
    type: str
    node: str
    session: str

    @property
    def source(self) -> str:
        """What its samples say they come from."""
        return source(self.node, self.session)


def quoted(key: str) -> str:
    """A key as it stands in a token, which must name one thing also where an endpoint reads many keys."""
    return key.replace("%", "%25").replace("*", "%2A").replace("$", "%24")


def token(endpoint: Endpoint) -> str:
    """The token's key for an endpoint."""
    node = quoted(endpoint.node).replace("/", "%2F")
    start = f"@holozen/{endpoint.session}/{node}/{endpoint.kind}"
    return start if endpoint.kind == "node" else f"{start}/{endpoint.type}/{quoted(endpoint.key)}"


@functools.lru_cache(maxsize=4096)  # who shows the graph looks at the same tokens again and again
def parse(text: str) -> Endpoint | None:
    """The endpoint a token names; None if the key is no such token."""
    parts = text.split("/", 7)
    if len(parts) == 4 and parts[0] == "@holozen" and parts[3] == "node":
        return Endpoint("", "node", "", _unquoted(parts[2]), parts[1])
    if len(parts) == 8 and parts[0] == "@holozen" and parts[3] in KINDS:
        return Endpoint(_unquoted(parts[7]), parts[3], "/".join(parts[4:7]), _unquoted(parts[2]), parts[1])
    return None


def _unquoted(text: str) -> str:
    return text.replace("%2F", "/").replace("%24", "$").replace("%2A", "*").replace("%25", "%")


def on_key(endpoints: Iterable[Endpoint], key: str, kind: str) -> list[Endpoint]:
    """Those of a kind that stand on a key, also by a key expression such as `**/odom`."""
    return [endpoint for endpoint in endpoints if endpoint.kind == kind and includes(endpoint.key, key)]


def includes(expression: str, key: str) -> bool:
    """Whether a key expression with whole-chunk wildcards (`*`, `**`) includes a key."""
    return _includes(expression.split("/"), key.split("/"))


def _includes(pattern: list[str], chunks: list[str]) -> bool:
    if not pattern:
        return not chunks
    first, *rest = pattern
    if first == "**":
        return any(_includes(rest, chunks[i:]) for i in range(len(chunks) + 1))
    return bool(chunks) and first in ("*", chunks[0]) and _includes(rest, chunks[1:])


class Graph:
    """The endpoints of all nodes as their tokens come and go.

    `change` gives the next token's key and whether it is there now, or None when there is nothing new. `roll_call`
    returns when everyone who is connected by now has told theirs; `met` gives the sessions of those.
    """

    def __init__(
        self,
        change: Callable[[], tuple[str, bool] | None],
        roll_call: Callable[[], object] = lambda: None,
        met: Callable[[], Iterable[str]] = tuple,
    ) -> None:
        self._change, self._roll_call, self._met = change, roll_call, met
        self._tokens: set[str] = set()
        self._gone: deque[str] = deque(maxlen=MOST_GONE)

    def endpoints(self) -> list[Endpoint]:
        """Those known by now, sorted by key."""
        self._look()
        found = (parse(key) for key in self._tokens)
        return sorted(endpoint for endpoint in found if endpoint)

    def left(self) -> list[str]:
        """The sources of the nodes that left since the last call. Cheap when there are none."""
        self._look()
        if not self._gone:
            return []
        gone = [parse(self._gone.popleft()) for _ in range(len(self._gone))]
        return [endpoint.source for endpoint in gone if endpoint and endpoint.kind == "node"]

    def settled(self, connected: Callable[[], bool], patience: float = 0.5, quiet: float = 0.015) -> list[Endpoint]:
        """Those known once someone is connected and nothing changed for a while; at most twice `patience` seconds.

        Who is met tells of others, whom it takes a moment to meet: `quiet` seconds, or twice the time that the news
        took so far, since a slow network or machine needs longer. Who is met and has told nothing may be a stranger,
        or one of us who is about to.
        """
        start = time.monotonic()
        while not connected():
            if time.monotonic() - start > patience:
                return self.endpoints()
            time.sleep(0.001)
        deadline = time.monotonic() + patience
        self._roll_call()  # a link that is this young may have nobody behind it yet who answers
        known, since = self.endpoints(), time.monotonic()
        while (now := time.monotonic()) < deadline:
            passed, enough = now - since, max(quiet, 2 * (since - start))
            if known and (passed > STRANGERS * enough or (passed > enough and self._all_told())):
                break
            time.sleep(0.001)
            if (newer := self.endpoints()) != known:
                known, since = newer, time.monotonic()
        return known

    def _all_told(self) -> bool:
        return set(self._met()) <= {key.split("/", 2)[1] for key in self._tokens}

    def _look(self) -> None:
        while (change := self._change()) is not None:
            key, there = change
            if there:
                self._tokens.add(key)
            else:
                self._tokens.discard(key)
                self._gone.append(key)
