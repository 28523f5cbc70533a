"""The nodes that run: their versions, their clocks, and whether two of them are in each other's way."""

import contextlib
import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from holozen import about
from holozen.bus import Bus
from holozen.doctor.finding import ERROR, OK, WARNING, Finding
from holozen.graph import Endpoint
from holozen.tap import Sample

PATIENCE = 0.4  # s for all to answer
ROUNDS = 3  # the answer that came the fastest says the most about a clock
APART, FAR = 0.05, 0.5  # s; from here on a clock is worth a word, and stamps are refused (wire.MAX_STAMP_AGE)
MOST_KEYS = 3  # that are named
ALONE = ("nav_msgs/msg/Odometry", "rosgraph_msgs/msg/Clock", "holozen/msg/CommandStatus")  # what one writes on a key


class Peer(NamedTuple):
    """What a node tells of itself. Its clock is `offset` seconds ahead of ours, give or take `error`."""

    session: str
    node: str
    version: str
    host: str
    pid: int
    offset: float
    error: float

    def __str__(self) -> str:
        return f"{self.node} (pid {self.pid} on {self.host})"


def ask(bus: Bus) -> dict[str, Peer]:
    """Session -> its node, of all that answer; a clock is measured by half of the round trip, as NTP does."""
    found: dict[str, Peer] = {}
    for _ in range(ROUNDS):
        before = time.time()
        waited = time.monotonic()
        for reply in bus.ask_all(about.EVERYBODY, PATIENCE):
            now = time.time()
            if isinstance(reply, Sample) and (peer := read(reply.key, reply.payload, before, now)):
                known = found.get(peer.session)
                found[peer.session] = peer if known is None or peer.error < known.error else known
        if time.monotonic() - waited > PATIENCE / 2:
            break  # somebody does not answer, and would not the next time
    return found


def read(key: str, payload: bytes, before: float, now: float) -> Peer | None:
    """The peer in a reply to a question asked at `before` that came at `now` (s); None if it is none."""
    with contextlib.suppress(ValueError, TypeError, KeyError, RecursionError):
        told = json.loads(payload)
        node, version, host = (str(told[name])[:80] for name in ("node", "version", "host"))
        error = (now - before) / 2
        session = key.removeprefix("@holozen/").removesuffix("/about")
        return Peer(session, node, version, host, int(told["pid"]), float(told["time"]) - before - error, error)
    return None


def versions(endpoints: Iterable[Endpoint], peers: Mapping[str, Peer], ours: str) -> Iterator[Finding]:
    """Who is of another version, and who does not answer."""
    nodes = [end for end in endpoints if end.kind == "node"]
    for end in nodes:
        peer = peers.get(end.session)
        if peer is None:
            text = f"{end.node} ({end.session[:6]}) does not answer: it hangs, sleeps, or is older than this"
            yield Finding(
                "peers", WARNING, text, "look at its terminal; fg or kill -CONT wakes what Ctrl-Z has stopped"
            )
        elif peer.version != ours:
            text = f"{peer} is holozen {peer.version or 'of no version'}, this is {ours or 'of none'}"
            yield Finding("peers", WARNING, text, "install the same on both")
    same = [str(peers[end.session]) for end in nodes if end.session in peers and peers[end.session].version == ours]
    if same:
        yield Finding("peers", OK, f"{len(same)} of this version: {', '.join(sorted(same))}")


def clocks(peers: Iterable[Peer], here: str = os.uname().nodename) -> Iterator[Finding]:
    """How far the clocks of other machines are from ours."""
    best: dict[str, Peer] = {}
    for peer in peers:
        if peer.host != here and peer.error < best.get(peer.host, peer._replace(error=1e9)).error:
            best[peer.host] = peer
    for host, peer in sorted(best.items()):
        text = f"that of {host} is {peer.offset:+.3f} s from ours (give or take {peer.error:.3f} s)"
        off = abs(peer.offset) - peer.error
        level = ERROR if off > FAR else WARNING if off > APART else OK
        why = f"; stamps that are {FAR:g} s off are refused" if level == ERROR else ""
        mend = "" if level == OK else "set both by NTP: sudo timedatectl set-ntp true"
        yield Finding("clock", level, text + why, mend)


def twins(endpoints: Iterable[Endpoint], peers: Mapping[str, Peer]) -> Iterator[Finding]:
    """Nodes that publish on the same key where one should, or serve the same one."""
    holders: dict[tuple[str, str], set[str]] = {}
    nodes: dict[str, str] = {}
    for end in endpoints:
        if end.kind == "srv" or (end.kind == "pub" and end.type in ALONE):
            holders.setdefault((end.kind, end.key), set()).add(end.session)
            nodes[end.session] = end.node
    groups: dict[frozenset[str], list[str]] = {}
    for (_, key), sessions in sorted(holders.items()):
        if len(sessions) > 1:
            groups.setdefault(frozenset(sessions), []).append(key)
    for group, keys in groups.items():
        who = [str(peers[s]) if s in peers else f"{nodes[s]} ({s[:6]})" for s in sorted(group)]
        more = f" and {len(keys) - MOST_KEYS} more keys" if len(keys) > MOST_KEYS else ""
        text = f"{' and '.join(who)} share {', '.join(keys[:MOST_KEYS])}{more}, which one alone should have"
        yield Finding("twins", ERROR, text, "end one, or give its robot another name: --robot FILE=NAME")
