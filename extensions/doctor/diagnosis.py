"""Finds common mistakes: on this machine, where processes meet, and among the running nodes.

Each check yields findings; `diagnose` runs them all, in order.
"""

import contextlib
import itertools
import json
import math
import os
import re
import sys
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from importlib import metadata
from typing import TYPE_CHECKING, NamedTuple

from holozen import engines
from holozen.console import Failure
from holozen.install import advice, interpreter, is_tool
from holozen.suggest import listed
from holozen.transport import graph
from holozen.transport.connection import ROS_DOMAIN, VARIABLES, Connection, address, covers
from holozen.transport.errors import BusError
from holozen.transport.graph import Endpoint, version
from holozen.transport.listeners import Holder, exposure, holders, reached
from holozen.transport.samples import PRIORITIES
from holozen.wire import SENDERS, resume_command

if TYPE_CHECKING:
    from holozen.bus import Bus
    from holozen.messages import CommandSource, CommandStatus
    from holozen.transport.pubsub import Latest

OK, WARNING, ERROR = "ok", "warning", "error"
# s to reach a router, to find other nodes, and to listen to robots
OPEN, FIND, LISTEN = (0.8, 0.6, 1.0)
ANSWER = 1.0  # s for nodes to answer; a busy machine takes long
PAUSE = 0.02  # s until nodes that have not answered are asked again
ROUNDS = 3  # queries to each node; the fastest answer measures its clock best
# s of offset; from 0.5 s on, stamps are refused (wire.MAX_STAMP_AGE)
CLOCK_WARNING, CLOCK_ERROR = (0.05, 0.5)
# one publisher per key
EXCLUSIVE = ("nav_msgs/msg/Odometry", "rosgraph_msgs/msg/Clock", "holozen/msg/CommandStatus")
MAX_KEYS, MAX_ROBOTS = 3, 50  # keys named in a finding; robots listened to
OPTIONAL = ("matplotlib", "mujoco-core")  # not in requirements.lock
USERS = {"foxglove": "view --foxglove", "mujoco": "sim --engine mujoco", "bag": "bag plot"}
"""The commands that need an extra, where its name is not a verb."""
SHARED = (
    "delete_entity",
    "get_entities",
    "get_entity_state",
    "set_entity_state",
    "get_simulation_state",
    "set_simulation_state",
    "step_simulation",
    "reset_simulation",
    "get_scene",
    "robot_description",
    *(f"simulate_steps/_action/{part}" for part in ("send_goal", "get_result", "cancel_goal")),
)
"""Services that several sims of one world have."""
SHARD = re.compile(r"sim_\d+_of_\d+")  # the node of a sim that simulates its share of the entities
DRIVES = 2.0  # Hz; a slower source does not count as driving


class Finding(NamedTuple):
    """One line: what was checked, the result, and how to fix it (empty if nothing is wrong)."""

    check: str
    level: str
    text: str
    fix: str = ""

    def __str__(self) -> str:
        return f"{self.level:<8} {self.check}: {self.text}" + (
            f" -> {self.fix}" if self.fix else ""
        )


def diagnose(connection: Connection, given: Mapping[str, object]) -> Iterator[Finding]:
    """All findings about this machine and the nodes at `connection`. Changes nothing. `given`: the
    values of the flags, None where one was not given.
    """
    yield from packages()
    yield from terminal()
    yield from environment(given)
    try:
        yield from nodes(connection)
    except BusError as error:
        points = [*addresses(connection, connected=False)]
        yield from points
        # What is wrong at an endpoint is not told again, without what to do there.
        if not any(
            one.level == ERROR and one.text.partition(" ")[0] in str(error) for one in points
        ):
            text, _, fix = str(error).partition("; ")
            yield Finding(
                "zenoh", ERROR, text, fix or "check --mode, --connect, --config and --cfg"
            )
    except ModuleNotFoundError as error:
        yield from addresses(connection, connected=False)
        yield Finding(
            "zenoh", ERROR, f"nodes cannot be checked without {error.name}", "run scripts/venv"
        )


def packages() -> Iterator[Finding]:
    """Whether the Python packages of every command are installed, and which engine the sim runs on
    here.
    """
    here = engines.this_machine()
    yield Finding("python", OK, f"Python {sys.version.split()[0]} on {here.place}")
    try:
        yield Finding("engine", OK, f"the sim runs on {engines.choose()}")
    except Failure as error:
        text, _, fix = str(error).partition("; ")
        yield Finding("engine", WARNING, f"{text}, which `holozen sim` needs", fix)
    try:
        declared = metadata.requires("holozen") or ()
        requirements = [
            one
            for one in declared
            if 'extra == "test"' not in one and not one.startswith("holozen[")
        ]
    except metadata.PackageNotFoundError:
        yield Finding(
            "packages",
            WARNING,
            "holozen is not installed; it runs from its source folder",
            "run scripts/venv",
        )
        return
    missing: dict[str, list[str]] = {}
    for text in requirements:
        name = text.replace("<", ">").partition(">")[0].partition(";")[0].strip()
        if name not in engines.PACKAGES.values() and not version(name):
            missing.setdefault(name, []).extend(text.partition('extra == "')[2].strip('"').split())
    other = engines.PACKAGES[engines.MUJOCO]
    if engines.MUJOCO in here.engines and not version(other):
        missing[other] = [engines.MUJOCO]
    users = {
        name: ", ".join(f"`holozen {USERS.get(extra, extra)}`" for extra in extras)
        or "every command"
        for name, extras in missing.items()
    }
    install = f"{interpreter()} -m pip install"
    for name in sorted(users.keys() - {*OPTIONAL}):
        level = WARNING if missing[name] else ERROR
        fix = advice("all") if is_tool() else f"run scripts/venv, or: {install} {name}"
        yield Finding("packages", level, f"{name} is missing, which {users[name]} needs", fix)
    if optional := sorted(users.keys() & {*OPTIONAL}):
        text = ", ".join(f"{name} for {users[name]}" for name in optional)
        yield Finding("packages", OK, f"optional: {text}", f"{install} {' '.join(optional)}")
    if not users:
        yield Finding("packages", OK, f"all packages of holozen {version('holozen')} are installed")


def terminal(environ: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    """Whether the terminal suits the teleop and the pictures."""
    from holozen.terminal import reports_releases

    if (getattr(sys.stdout, "encoding", None) or "ascii").lower().replace("-", "") != "utf8":
        text = f"the encoding is {sys.stdout.encoding}, so pictures are drawn in ASCII"
        yield Finding("terminal", WARNING, text, "export LANG=C.UTF-8 (or PYTHONUTF8=1)")
    inside = "tmux" if environ.get("TMUX") else "screen" if environ.get("STY") else "this terminal"
    try:
        releases = (
            reports_releases(sys.stdin.fileno(), sys.stdout.fileno())
            if sys.stdout.isatty()
            else None
        )
    except (OSError, ValueError, AttributeError):
        return
    if releases:
        yield Finding("terminal", OK, f"{inside} reports key releases (Kitty protocol)")
    elif releases is False:
        text = f"{inside} does not report key releases; the teleop relies on key repeat"
        yield Finding("terminal", OK, text)
    elif sys.stdout.isatty():
        yield Finding(
            "terminal",
            WARNING,
            f"{inside} does not answer; the teleop cannot see a lost connection to it",
            "use a terminal such as kitty, foot, WezTerm or Ghostty",
        )


def environment(
    given: Mapping[str, object], environ: Mapping[str, str] = os.environ
) -> Iterator[Finding]:
    """The environment variables that choose the network, and which of them a flag overrides."""
    for name, variable in VARIABLES.items():
        if value := environ.get(variable, "").strip():
            text = (
                "applies to every verb without" if given[name] is None else "is overridden here by"
            )
            yield Finding("environment", OK, f"{variable}={value} {text} --{name}")
    if value := environ.get(ROS_DOMAIN, "").strip():
        ours = (
            f"{VARIABLES['domain']}={environ[VARIABLES['domain']]}"
            if environ.get(VARIABLES["domain"])
            else ""
        )
        stronger = "--domain" if given["domain"] is not None else ours
        text = (
            f"is overridden here by {stronger}"
            if stronger
            else "applies to every verb without --domain"
        )
        yield Finding("environment", OK, f"{ROS_DOMAIN}={value} {text}")


def nodes(connection: Connection) -> Iterator[Finding]:
    """The findings about where nodes meet and all nodes there. Raises BusError."""
    from holozen.bus import Bus

    if connection.secure:  # first, since without its own no router answers
        from holozen.transport.authenticator import authenticator

        for warning in authenticator().warnings(connection.secure):
            text, _, fix = warning.partition("; ")
            yield Finding("network", WARNING, text, fix)
    with Bus("doctor", connection, patience=OPEN) as bus:
        endpoints = bus.graph().settled(bus.connected, patience=FIND)
        began = time.monotonic()
        robots = Robots(bus, endpoints)
        yield from addresses(connection, bus.connected(), bus.others_listen())
        yield from silent(bus.silent())
        sessions = {end.session for end in endpoints if end.kind == "node"}
        peers = ask_peers(bus, sessions) if bus.connected() else {}
        yield from versions(endpoints, peers, version("holozen"))
        yield from hidden(bus.hidden() if bus.connected() else ())
        yield from clocks(peers.values())
        yield from open_ports(peers.values())
        yield from duplicates(endpoints, peers)
        yield from paused(bus, endpoints)
        if robots.count:
            time.sleep(max(0.0, began + LISTEN - time.monotonic()))
        yield from robots.findings(time.monotonic() - began)


def health(connection: Connection, node: str) -> Finding:
    """Whether a node of this machine answers, and so does the loop behind its parameters, if it has
    any. Shards answer to the name `sim` too. For the health check of a container. Raises BusError.
    """
    from holozen.bus import Bus
    from holozen.messages.rcl_interfaces import ListParametersReply, ListParametersRequest
    from holozen.transport.errors import ServiceError

    with Bus("doctor", connection, patience=OPEN) as bus:
        loops = [
            end
            for end in bus.graph().settled(bus.connected, FIND)
            if end.key.endswith("/list_parameters")
        ]
        peers = [peer for peer in ask_peers(bus).values() if peer.host == os.uname().nodename]
        here = [peer for peer in peers if node in (peer.node, SHARD.sub("sim", peer.node))]
        try:
            for key in {end.key for end in loops if end.session in {peer.session for peer in here}}:
                bus.call(key, ListParametersRequest(), ListParametersReply, LISTEN)
        except ServiceError as error:
            return Finding("health", ERROR, str(error), f"look at the log of {node}")
    if not here:
        return Finding(
            "health",
            ERROR,
            f"no {node} of this machine answers",
            "start it, or check --mode and --connect",
        )
    return Finding("health", OK, f"{listed(map(str, here))} answers")


# Where nodes meet.


def addresses(
    connection: Connection, connected: bool, heard: Collection[str] = ()
) -> Iterator[Finding]:
    """Which processes hold the endpoints to connect to. `connected`: whether any node was reached.
    `heard`: where those listen who answered in the group.
    """
    listed = json.loads(connection.settings().get("connect/endpoints", "[]"))
    endpoints = [one for one in listed if isinstance(one, str)] if isinstance(listed, list) else []
    in_group = bool(connection.group)
    for endpoint, reason in reached(
        [*endpoints, *([connection.address] if in_group else [])]
    ).items():
        needed = endpoint in endpoints
        answers = connected if needed else any(covers(one, endpoint) for one in heard)
        yield _address(endpoint, reason, holders(endpoint), answers, needed)


def _address(
    endpoint: str, reason: str, here: list[Holder], answers: bool, needed: bool
) -> Finding:
    """What is at an endpoint. If it is not `needed`, nodes meet in a group, and tools alone connect
    there.
    """
    port = (address(endpoint) or ("", 0))[1]
    if reason and not here:
        if not needed:
            return Finding("port", OK, f"{endpoint} is free: no sim runs here yet")
        fix = f"start a node there, such as: holozen router --listen tcp/0.0.0.0:{port}"
        return Finding("port", ERROR, f"{endpoint} cannot be reached: {reason}", fix)
    held = " and ".join(map(str, here)) or "a process on another machine or in a container"
    level = ERROR if needed else WARNING
    if any(one.stopped for one in here):
        return Finding(
            "port", ERROR, f"{endpoint} is held by {held}, which does not answer", here[0].fix
        )
    if answers and not reason:
        return Finding("port", OK, f"{endpoint} is held by {held}, and speaks Zenoh")
    other = "choose another endpoint with --connect" if needed else "choose another --domain"
    fix = here[0].fix if here else f"find out what runs there, or {other}"
    return Finding("port", level, f"{endpoint} is held by {held}, which does not speak Zenoh", fix)


def silent(text: str) -> Iterator[Finding]:
    """Processes that are there on this machine, and do not answer."""
    if text:
        what, _, fix = text.partition("; ")
        yield Finding(
            "meeting",
            ERROR,
            what,
            fix or "look at its terminal; fg or kill -CONT continues it after Ctrl-Z",
        )


# The nodes.


class Peer(NamedTuple):
    """What a node reports about itself. Its clock is `offset` seconds ahead of ours, give or take
    `error`.
    """

    session: str
    node: str
    version: str
    host: str
    pid: int
    offset: float
    error: float
    exposed: tuple[str, ...] = ()  # endpoints that other machines can reach

    def __str__(self) -> str:
        return f"{self.node} (pid {self.pid} on {self.host})"


def ask_peers(bus: "Bus", known: Collection[str] = ()) -> dict[str, Peer]:
    """Session -> its node, for all nodes that answer. Clock offsets are taken at half the round
    trip, as NTP does. The nodes of the sessions that are `known` are asked again for a while: on a
    new link a node's tokens may come before what answers, and a busy machine answers late.
    """
    found: dict[str, Peer] = {}
    deadline = time.monotonic() + 2 * ANSWER
    for asked in itertools.count(1):
        before, began = time.time(), time.monotonic()
        for reply in bus.ask_all(graph.ALL_NODE_INFO, ANSWER):
            now = time.time()
            if not isinstance(reply, bytes) and (
                peer := read_peer(reply.key, reply.payload, before, now)
            ):
                best = found.get(peer.session)
                found[peer.session] = peer if best is None or peer.error < best.error else best
        now = time.monotonic()
        if found.keys() >= set(known):
            # a slow round: some node did not answer, and would not next time
            if asked >= ROUNDS or now - began > ANSWER / 2:
                break
        elif now > deadline:
            break
        else:
            time.sleep(PAUSE)
    return found


def read_peer(key: str, payload: bytes, before: float, now: float) -> Peer | None:
    """The node in a reply that arrived at `now` to a query sent at `before` (s since 1970); None if
    it is malformed.
    """
    with contextlib.suppress(ValueError, TypeError, KeyError, RecursionError, OverflowError):
        row = json.loads(payload)
        node, number, host = (str(row[name])[:80] for name in ("node", "version", "host"))
        error = (now - before) / 2
        session = key.removeprefix("@holozen/").removesuffix("/about")
        offset = float(row["time"]) - before - error
        if not math.isfinite(offset):
            return None
        exposed = tuple(str(endpoint)[:80] for endpoint in row.get("exposed", ())[:MAX_KEYS])
        return Peer(session, node, number, host, int(row["pid"]), offset, error, exposed)
    return None


def versions(
    endpoints: Iterable[Endpoint], peers: Mapping[str, Peer], ours: str
) -> Iterator[Finding]:
    """Nodes of another version, and nodes that do not answer."""
    same = []
    for end in (end for end in endpoints if end.kind == "node"):
        peer = peers.get(end.session)
        if peer is None:
            text = (
                f"{end.node} ({end.session[:6]}) does not answer: it hangs, is stopped, or is "
                "an older version"
            )
            yield Finding(
                "nodes",
                WARNING,
                text,
                "look at its terminal; fg or kill -CONT continues it after Ctrl-Z",
            )
        elif peer.version != ours:
            text = (
                f"{peer} has holozen {peer.version or 'of unknown version'}, this is "
                f"{ours or 'of unknown version'}"
            )
            yield Finding("nodes", WARNING, text, "install the same version on both")
        else:
            same.append(str(peer))
    if same:
        yield Finding("nodes", OK, f"{len(same)} of this version: {', '.join(sorted(same))}")


def hidden(endpoints: Iterable[Endpoint]) -> Iterator[Finding]:
    """Nodes with robots or sims that others know of, but that do not answer here."""
    keys: dict[str, list[str]] = {}
    for end in endpoints:
        keys.setdefault(end.source, []).append(end.key)
    for source, served in keys.items():
        text = (
            f"{source} with {listed(served)} does not answer: it hangs, is stopped, or cannot "
            "be reached from here"
        )
        yield Finding(
            "nodes", ERROR, text, "look at its terminal; fg or kill -CONT continues it after Ctrl-Z"
        )


def clocks(peers: Iterable[Peer], here: str = os.uname().nodename) -> Iterator[Finding]:
    """The offsets of the clocks of other machines."""
    best: dict[str, Peer] = {}
    for peer in peers:
        if peer.host != here and (peer.host not in best or peer.error < best[peer.host].error):
            best[peer.host] = peer
    for host, peer in sorted(best.items()):
        text = (
            f"the clock of {host} is {peer.offset:+.3f} s from ours (give or take "
            f"{peer.error:.3f} s)"
        )
        offset = abs(peer.offset) - peer.error
        level = ERROR if offset > CLOCK_ERROR else WARNING if offset > CLOCK_WARNING else OK
        fix = "" if level == OK else "set both by NTP: sudo timedatectl set-ntp true"
        yield Finding(
            "clock", level, text + ("; stamped commands are refused" if level == ERROR else ""), fix
        )


def open_ports(peers: Iterable[Peer]) -> Iterator[Finding]:
    """Nodes that other machines can reach without a password, a certificate or a permission."""
    for peer in peers:
        if peer.exposed:
            text = f"{peer} {exposure(peer.exposed)}"
            fix = (
                "listen on loopback, or let Zenoh ask for passwords or certificates (--config FILE)"
            )
            yield Finding("network", WARNING, text, fix)


def duplicates(endpoints: Iterable[Endpoint], peers: Mapping[str, Peer]) -> Iterator[Finding]:
    """Nodes that share a service or a key that only one should publish, such as two sims with the
    same robot.
    """
    holders: dict[tuple[str, str], dict[str, str]] = {}
    for end in endpoints:
        if end.key == "spawn_entity" and SHARD.fullmatch(end.node):
            continue
        if (end.kind == "srv" and end.key not in SHARED) or (
            end.kind == "pub" and end.type in EXCLUSIVE
        ):
            holders.setdefault((end.kind, end.key), {})[end.session] = end.node
    groups: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for (_, key), sessions in sorted(holders.items()):
        if len(sessions) > 1:
            groups.setdefault(tuple(sorted(sessions.items())), []).append(key)
    for group, keys in groups.items():
        names = [str(peers[s]) if s in peers else f"{node} ({s[:6]})" for s, node in group]
        more = f" and {len(keys) - MAX_KEYS} more keys" if len(keys) > MAX_KEYS else ""
        text = (
            f"{' and '.join(names)} share {', '.join(keys[:MAX_KEYS])}{more}; only one node "
            "should have each"
        )
        yield Finding(
            "duplicates", ERROR, text, "end one, or give its robot another name: --robot FILE=NAME"
        )


def paused(bus: "Bus", endpoints: Iterable[Endpoint]) -> Iterator[Finding]:
    """Whether a sim is paused."""
    from holozen import entities

    if entities.is_paused(bus, endpoints):
        yield Finding(
            "sim", WARNING, "the sim is paused: its robots stand still", "holozen sim play"
        )


# The robots.


class Robots:
    """Listens to the robots among `endpoints` from its creation on."""

    def __init__(self, bus: "Bus", endpoints: Iterable[Endpoint]) -> None:
        published = [end for end in endpoints if end.kind == "pub"]
        self._nodes = {end.key: end.node for end in published if end.type == EXCLUSIVE[0]}
        self.count = len(self._nodes)
        self._writers: dict[str, list[str]] = {}
        for end in published:
            self._writers.setdefault(end.key, []).append(end.node)
        # Samples are not decoded: it is enough that they arrive.
        self._odoms = {
            key: bus.subscribe_raw(key, depth=1) for key in sorted(self._nodes)[:MAX_ROBOTS]
        }
        self._statuses: dict[str, Latest[CommandStatus]] = {}
        if statuses := sorted({end.key for end in published if end.type == EXCLUSIVE[2]})[
            :MAX_ROBOTS
        ]:
            from holozen import messages

            self._statuses = {key: bus.latest(key, messages.CommandStatus) for key in statuses}

    def findings(self, seconds: float) -> Iterator[Finding]:
        """The findings after listening for `seconds`."""
        if not self.count:
            yield Finding("odom", OK, "there is no robot; `holozen up` starts one")
            return
        stale = [key for key, samples in self._odoms.items() if samples.try_recv() is None]
        for key in stale:
            text = f"{key} is stale: nothing from {self._nodes[key]} for {seconds:.1f} s"
            yield Finding(
                "odom",
                ERROR,
                text,
                "continue or restart that node (fg, kill -CONT), or raise its --rtf",
            )
        if not stale:
            robots = f"{self.count} robot{'s' * (self.count != 1)}"
            yield Finding(
                "odom", OK, f"fresh on {', '.join(list(self._odoms)[:MAX_KEYS])} ({robots})"
            )
        # the robots of a fleet have much the same findings
        alike: dict[tuple[str, str], list[Finding]] = {}
        for key, latest in self._statuses.items():
            if status := latest.read()[0]:
                command = key.removesuffix("_status")
                for found in commands(command, status, self._writers.get(command, ())):
                    alike.setdefault(
                        (found.level, found.text.replace(status.name, "", 1)), []
                    ).append(found)
        for group in alike.values():
            first = group[0]
            if len(group) <= MAX_KEYS:
                yield from group
            else:
                others = listed([one.check for one in group[1:]], MAX_KEYS)
                yield first._replace(text=f"{first.text}; the same holds for {others}")


def commands(key: str, status: "CommandStatus", writers: Iterable[str] = ()) -> Iterator[Finding]:
    """The findings about the sources that command the robot at `key`; `writers` are the nodes that
    could.
    """
    robot, name, writers = status.name or "the robot", key.rpartition("/")[0], {*writers}
    if status.stopped:
        text = f"{robot} is stopped by {status.stopped}, and ignores all commands"
        yield Finding(key, WARNING, text, f"holozen release {name}".strip())
    driving = sorted((source for source in status.sources if source.rate >= DRIVES), key=_rank)
    resume = f"{resume_command(name)}, or r in the teleop"
    waits = "controller" in writers or any(source.held for source in status.sources)
    if not driving and status.held and waits:
        text = (
            f"{robot} stands still: somebody drove or stopped it, so the controller, and scripts "
            "that were overruled, wait"
        )
        yield Finding(key, WARNING, text, resume)
    elif not driving and status.held:
        text = (
            f"nothing commands {robot} since somebody drove or stopped it; `holozen teleop` does, "
            f"and a controller after {resume}"
        )
        yield Finding(key, OK, text)
    elif not driving and (silent := listed(writers)) != "none":
        more = f"; if the controller is held: {resume}" if "controller" in writers else ""
        yield Finding(key, OK, f"nothing commands {robot} now; {silent} could{more}")
    elif not driving:
        yield Finding(
            key, OK, f"nothing commands {robot}; `holozen teleop` or `holozen controller` does"
        )
    if len(driving) > 1:
        # which of two equals drives is chance
        level = ERROR if _rank(driving[0]) == _rank(driving[1]) else WARNING
        names = [
            f"{one.source} ({SENDERS.get(one.priority, one.priority)}, {one.rate:.0f} Hz, "
            f"{'' if one.obeyed else 'not '}obeyed)"
            for one in driving
        ]
        fix = (
            "end all but one; the teleop takes precedence over scripts, and those over the "
            "controller"
        )
        yield Finding(
            key, level, f"{len(driving)} sources command {robot} at once: {', '.join(names)}", fix
        )


def _rank(source: "CommandSource") -> int:
    return PRIORITIES.index(source.priority) if source.priority in PRIORITIES else len(PRIORITIES)
