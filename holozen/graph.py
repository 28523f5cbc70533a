"""The graph: who is there and what they read, write and serve, told by Zenoh liveliness tokens.

A token's key is `@holozen/<session>/<node>/<kind>/<package>/<msg or srv>/<Type>/<key>`; a `node` token ends after its
kind. The `@` keeps them out of reach of a plain `**`.
"""

import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

ALL = "@holozen/**"
KINDS = ("node", "pub", "sub", "srv")


class Endpoint(NamedTuple):
    """One node, or one of its publishers ("pub"), subscribers ("sub") or services ("srv")."""

    key: str
    kind: str
    type: str
    node: str
    session: str


def token(endpoint: Endpoint) -> str:
    """The token's key for an endpoint."""
    start = f"@holozen/{endpoint.session}/{endpoint.node}/{endpoint.kind}"
    # A token's key must name one thing, also where the endpoint reads many keys.
    key = endpoint.key.replace("%", "%25").replace("*", "%2A").replace("$", "%24")
    return start if endpoint.kind == "node" else f"{start}/{endpoint.type}/{key}"


def parse(text: str) -> Endpoint | None:
    """The endpoint a token names; None if the key is no such token."""
    parts = text.split("/", 7)
    if len(parts) == 4 and parts[0] == "@holozen" and parts[3] == "node":
        return Endpoint("", "node", "", parts[2], parts[1])
    if len(parts) == 8 and parts[0] == "@holozen" and parts[3] in KINDS:
        key = parts[7].replace("%24", "$").replace("%2A", "*").replace("%25", "%")
        return Endpoint(key, parts[3], "/".join(parts[4:7]), parts[2], parts[1])
    return None


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

    `change` gives the next token's key and whether it is there now, or None when there is nothing new.
    """

    def __init__(self, change: Callable[[], tuple[str, bool] | None]) -> None:
        self._change = change
        self._tokens: set[str] = set()

    def endpoints(self) -> list[Endpoint]:
        """Those known by now, sorted by key."""
        while (change := self._change()) is not None:
            key, there = change
            (self._tokens.add if there else self._tokens.discard)(key)
        found = (parse(key) for key in self._tokens)
        return sorted(endpoint for endpoint in found if endpoint)

    def settled(self, connected: Callable[[], bool], patience: float = 0.5, quiet: float = 0.04) -> list[Endpoint]:
        """Those known once someone is connected and nothing changed for `quiet` seconds; at most `patience` seconds."""
        deadline = time.monotonic() + patience
        while not connected() and time.monotonic() < deadline:
            time.sleep(0.002)
        known, since = self.endpoints(), time.monotonic()
        while time.monotonic() - since < quiet and time.monotonic() < deadline:
            time.sleep(0.002)
            if (now := self.endpoints()) != known:
                known, since = now, time.monotonic()
        return known
