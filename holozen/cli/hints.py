"""Messages about keys and nodes that were not found, with the nearest ones that were."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from holozen.suggest import closest, listed, suggest
from holozen.transport.graph import Endpoint
from holozen.transport.node import Node


def no_nodes(where: str) -> str:
    """The message that no node was found, and how to start some."""
    return f"no nodes found at {where}; `holozen up` starts a robot"


def none_found(what: str, ends: list[Endpoint], where: str) -> str:
    """The message that the nodes at `where`, whose endpoints are `ends`, have no `what`; or that
    there are no nodes.
    """
    return f"no {what}: {f'the nodes at {where} have none' if ends else no_nodes(where)}"


def unknown(word: str, known: list[str], where: str) -> str:
    """The message that no node has a key; `known` are the keys at `where`."""
    if not known:
        return f"unknown key {word!r}: {no_nodes(where)}"
    return f"unknown key {word!r}{_suggest(word, known)}; known: {listed(known)}"


def suggest_key(bus: Node, keys: Iterable[str], kinds: tuple[str, ...] = ("pub", "sub")) -> str:
    """` (did you mean 'odom'?)`, with the key nearest to the first of `keys` that no node has; or
    `; no nodes found at ...`; or an empty string.
    """
    ends = [end for end in bus.endpoints() if end.session != bus.id]
    if not ends and not bus.connected():
        return f"; {no_nodes(bus.where)}"
    live = {end.key for end in ends if end.kind in kinds and not is_any(end) and "*" not in end.key}
    lost = [key for key in keys if key not in live and "*" not in key]
    return _suggest(lost[0], sorted(_near(lost[0], live))) if lost else ""


def _suggest(lost: str, known: Collection[str]) -> str:
    """As `suggest`; a robot's key comes before any other that is alike: Rosie/tf for tf."""
    named = [key for key in known if key.endswith(f"/{lost}")]
    return suggest(min(named, default=lost), named or known)


def _near(lost: str, live: Collection[str]) -> list[str]:
    """The keys that may be meant by one that no node has: none of another robot than the one that
    it names.
    """
    robot = lost.rpartition("/")[0]
    own = [key for key in live if robot and key.startswith(f"{robot}/")]
    return own or [
        key
        for key in live
        if not robot or "/" not in key or closest(robot, [key.rpartition("/")[0]])
    ]


def is_any(end: Endpoint) -> bool:
    """Whether an endpoint accepts any type, such as one of `topic echo`."""
    return end.type.startswith("any/")
