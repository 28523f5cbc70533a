"""Foreign sessions and members try to move, stop, blind, fill or crash a secure fleet with Zenoh's
own tools.

All the while a member drives one robot, and another one stands. After each attempt both have gone
on as before.
"""

import contextlib
import json
import os
import socket
import ssl
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import zenoh
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from holozen import data
from holozen.messages import CommandStatus, Odometry, Twist
from holozen.messages import simulation_interfaces as si
from holozen.messages.rcl_interfaces import GetParametersReply, GetParametersRequest
from holozen.secure import authority
from holozen.secure.members import Member, load
from holozen.testing import Process, wait_for
from holozen.testing.wire import free_port
from holozen.transport.pubsub import Subscription
from holozen.transport.samples import Numbers, Sample, stamps
from tests.fleet import Fleet

FORWARD, EVIL = b'{"linear": {"x": 2.0}}', b'{"header": {"frame_id": "evil"}}'
STANDS = "Fred"
LAST = zenoh.Priority.BACKGROUND  # what is sent with it arrives after all that was sent before
SLOW = {"old", "late", "unknown clock"}  # refusals of commands that a busy machine held up
BIG = 40_000_000  # bytes


class Watch:
    """The whole history of both robots, as an operator sees it. `driver` drives the first."""

    def __init__(self, fleet: Fleet) -> None:
        self.bus = fleet.bus("Ann")
        keys = ("", f"{STANDS}/")
        self.odoms = [self.bus.subscribe(f"{key}odom", Odometry, depth=10_000) for key in keys]
        self.statuses = [
            self.bus.subscribe(f"{key}cmd_vel_status", CommandStatus, depth=10_000) for key in keys
        ]
        self.everything = self.bus.subscribe_raw("**", depth=100_000)
        self.driver = ""
        self.process: Process | None = None
        self._clock = 0.0
        self._place: tuple[float, float] | None = None

    def driven(self) -> bool:
        """Whether the first robot goes at its speed, and the other one rests."""
        self.driver = self._newest(self.statuses[0]).obeyed
        going, resting = (self._newest(odom).twist.twist.linear for odom in self.odoms)
        return bool(self.driver) and abs(going.x - 0.3) < 0.02 and abs(resting.x) < 1e-3

    def _newest(self, subscription: "Subscription[Any]") -> Any:
        return _new(subscription, 1)[-1]

    def breaches(self, what: str, counts: bool = True) -> Counter[str]:
        """Check that nothing went wrong since the last call (AssertionError). Returns how many
        commands of each kind were refused so far, or nothing if it need not wait for what `counts`.
        """
        # The sim answers this question after all that was sent before it; a message that comes then
        # is later still.
        names = list(self.bus.session.get("get_entities", payload="{}", priority=LAST, timeout=10))
        assert [STANDS.encode() in bytes(reply.ok.payload) for reply in names if reply.ok] == [
            True
        ], what
        going, resting = (_new(odom, 1) for odom in self.odoms)
        driven, standing = (_new(status, 2 * counts) for status in self.statuses)
        speeds = [each.twist.twist.linear.x for each in going]
        assert min(speeds) > 0.25 and max(speeds) < 0.35, what
        times = [self._clock, *(each.header.stamp.seconds() for each in going)]
        assert times == sorted(times), what
        self._clock = times[-1]
        for each in resting:
            position = each.pose.pose.position
            x, y = self._place = self._place or (position.x, position.y)
            assert abs(position.x - x) + abs(position.y - y) < 0.005, what
        assert {each.obeyed for each in driven} <= {self.driver}, what
        assert {(each.obeyed, each.accepted) for each in standing} <= {("", 0)}, what
        assert {each.stopped for each in driven + standing} <= {""}, what
        for sample in iter(self.everything.try_recv, None):
            assert b"evil" not in sample.payload, (what, sample.key)
        refused = (
            Counter(driven[-1].refused) + Counter(standing[-1].refused)
            if counts
            else Counter[str]()
        )
        return Counter({kind: count for kind, count in refused.items() if kind not in SLOW})


def _new(subscription: "Subscription[Any]", wait: int) -> list[Any]:
    """The messages since the last call, and this many more that are still to come."""
    received = [
        *iter(subscription.try_recv, None),
        *(wait_for(subscription.try_recv) for _ in range(wait)),
    ]
    return [each.message for each in received if each]


class Raid(NamedTuple):
    """What an attacker has: the fleet, a session of its own, and a command of the driver's as
    anyone reads it.
    """

    fleet: Fleet
    watch: Watch
    session: Any
    name: str
    sent: Sample

    @property
    def key(self) -> Member:
        return load(str(self.fleet.root / self.name))

    @property
    def victim(self) -> str:
        """The driver's session."""
        assert self.sent.stamp
        return self.sent.stamp.session

    def signed(
        self, key: str, priority: str, *, name: str = "", member: Member | None = None
    ) -> dict[str, Any]:
        """A command with this member's proof, in another member's name."""
        stamp = stamps(f"{name or self.name}/test", str(self.session.zid()), Numbers())()
        proof = (member or self.key).attachment(key, priority, stamp, "application/json", FORWARD)
        rank = getattr(zenoh.Priority, priority)
        return {
            "payload": FORWARD,
            "encoding": "application/json",
            "attachment": proof,
            "priority": rank,
        }

    def replayed(self, **changes: Any) -> dict[str, Any]:
        sent = self.sent
        return {
            "payload": sent.payload,
            "encoding": sent.encoding,
            "attachment": sent.attachment,
            "priority": getattr(zenoh.Priority, sent.priority),
            **changes,
        }


Act = Callable[[Raid], object]


def put(key: str, payload: bytes = FORWARD, priority: str = "DATA") -> Act:
    rank = getattr(zenoh.Priority, priority)
    return lambda raid: raid.session.put(key, payload, encoding="application/json", priority=rank)


def ask(key: str, payload: bytes = b"{}", everyone: bool = False) -> Act:
    target = zenoh.QueryTarget.ALL if everyone else zenoh.QueryTarget.BEST_MATCHING
    return lambda raid: raid.session.get(
        key, payload=payload, encoding="application/json", target=target, timeout=0.5
    )


def serve(key: str) -> Act:
    """Answer in place of the sim, as a closer and complete queryable."""

    def act(raid: Raid) -> None:
        def lie(query: zenoh.Query) -> None:
            with query, contextlib.suppress(zenoh.ZError):
                query.reply(query.key_expr, EVIL)

        raid.session.declare_queryable(key, lie, complete=True)
        settle(raid)
        bus, fetched = raid.watch.bus, []
        for asked in (
            "get_entities",
            "robot_description",
            "stop" if "stop" in key else "get_scene",
        ):
            if asked != "stop":
                fetched += [
                    bytes(reply.ok.payload)
                    for reply in bus.session.get(asked, payload="{}", timeout=5)
                    if reply.ok
                ]
        got = bus.call(
            "sim/get_parameters", GetParametersRequest(["max_linear"]), GetParametersReply
        )
        assert fetched and not [one for one in fetched if b"evil" in one], key
        assert got.values[0].double_value == 5.0, key

    return act


def settle(raid: Raid) -> None:
    """Return once the router has read everything that this session has sent."""
    assert [reply for reply in raid.session.get("odom", priority=LAST, timeout=10) if reply.ok], (
        "it is connected"
    )


def forged(*tokens: str, lost: bool = False) -> Act:
    """Announce something that does not exist, or withdraw it at once."""

    def act(raid: Raid) -> None:
        held = [raid.session.liveliness().declare_token(one.format(raid.victim)) for one in tokens]
        settle(raid)
        for token in held if lost else ():
            token.undeclare()

    return act


def signed(key: str, priority: str, *, name: str = "", foreign: bool = False) -> Act:
    def act(raid: Raid) -> None:
        other = Member(name or raid.name, Ed25519PrivateKey.generate()) if foreign else None
        raid.session.put(key, **raid.signed(key, priority, name=name, member=other))

    return act


def stamped(key: str, proof: bytes = b"") -> Act:
    def act(raid: Raid) -> None:
        stamp = stamps(f"{raid.name}/test", str(raid.session.zid()), Numbers())()
        raid.session.put(key, FORWARD, encoding="application/json", attachment=stamp + proof)

    return act


def replayed(key: str, **changes: Any) -> Act:
    return lambda raid: raid.session.put(key, **raid.replayed(**changes))


def tampered(raid: Raid) -> None:
    stamp, *rest = raid.sent.attachment.split(b";")
    raid.session.put(
        "cmd_vel", **raid.replayed(attachment=b";".join([stamp, b"999999", *rest[1:]]))
    )


def beat(raid: Raid) -> None:
    """Let the driver echo what is still to come, and what is long past."""
    ends = raid.watch.bus.endpoints()
    sim = next(end.session for end in ends if end.kind == "sub" and end.key == f"{STANDS}/cmd_vel")
    serve(f"@holozen/{sim}/beat")(raid)
    for ns in (b"1", b"9" * 18):
        raid.session.put(f"@holozen/{sim}/beat", ns)


def named_spawn(raid: Raid) -> None:
    """The robot whose keys were claimed can still be added."""
    forged(
        "@holozen/{}/sim/pub/nav_msgs/msg/Odometry/Bob/odom",
        "@holozen/x/sim/srv/a/srv/B/spawn_entity",
    )(raid)
    bus, text = raid.watch.bus, BOB
    bus.call(
        "spawn_entity", si.SpawnEntityRequest("Bob", resource_string=text), si.SpawnEntityReply
    )
    assert not [end for end in bus.endpoints() if end.key == "Bob/odom"]
    bus.call("delete_entity", si.DeleteEntityRequest("Bob"), si.DeleteEntityReply)


def reconfigure(raid: Raid) -> None:
    """Change the configuration through the admin space, of the router and of everyone."""
    routers = raid.session.info.routers_zid()
    for zid in (*map(str, routers), "*"):
        for change in ("access_control/enabled", "access_control"):
            with contextlib.suppress(zenoh.ZError):  # a wildcard is none
                raid.session.put(f"@/{zid}/router/config/{change}", b"false")
    raid.session.put(f"{STANDS}/cmd_vel_status", EVIL)
    theirs = [str(reply.ok.key_expr) for reply in raid.session.get("@/**", timeout=0.3) if reply.ok]
    assert not [key for key in theirs if "/router/" in key]


def flood(raid: Raid) -> None:
    for number in range(1000):
        raid.session.declare_subscriber(f"flood/{number}", zenoh.handlers.RingChannel(1))
        raid.session.liveliness().declare_token(
            f"@holozen/{number:x}/evil/sub/a/msg/B/flood/{number}"
        )


def ask_much(raid: Raid) -> None:
    for _ in range(500):
        raid.session.get(
            "get_scene", payload="{}", timeout=1, handler=zenoh.handlers.RingChannel(1)
        )


def fill(raid: Raid) -> None:
    """Zenoh assembles a message before it checks its sender's permissions."""
    before = peak(raid.fleet.router.pid)
    raid.session.put(
        f"{STANDS}/cmd_vel", bytes(BIG), congestion_control=zenoh.CongestionControl.BLOCK
    )
    with contextlib.suppress(AssertionError, zenoh.ZError):  # the router may have closed the link
        settle(raid)
    assert peak(raid.fleet.router.pid) - before < 0.8 * BIG


def peak(pid: int) -> int:
    """The most memory that a process has used, in bytes."""
    line = next(
        line
        for line in Path(f"/proc/{pid}/status").read_text().splitlines()
        if line.startswith("VmHWM")
    )
    return int(line.split()[1]) * 1024


def crowd(raid: Raid) -> None:
    with contextlib.ExitStack() as ends:
        for _ in range(20):
            ends.enter_context(raid.fleet.tool(raid.name)).put("odom", EVIL)


def pose_as(which: str) -> Act:
    """Open a session under another session's id."""

    def act(raid: Raid) -> None:
        ids = {
            "driver": raid.victim,
            "sim": sim_session(raid),
            "router": str(raid.session.info.routers_zid()[0]),
        }
        twin = {"id": ids[which], "connect__timeout_ms": 500}
        with contextlib.suppress(zenoh.ZError), raid.fleet.tool(raid.name, **twin) as session:
            for key, payload in ((f"{STANDS}/cmd_vel", FORWARD), ("odom", EVIL), ("clock", EVIL)):
                session.put(key, payload)

    return act


def sim_session(raid: Raid) -> str:
    return next(end.session for end in raid.watch.bus.endpoints() if end.key == "spawn_entity")


def behind(mode: str) -> Act:
    """Connect as a peer or a router, which links to others past the router and routes for them."""

    def act(raid: Raid) -> None:
        with raid.fleet.tool(raid.name, mode=mode) as session:
            more = raid._replace(session=session)
            for key, payload in (
                (f"{STANDS}/cmd_vel", FORWARD),
                ("odom", EVIL),
                ("clock", EVIL),
                ("tf", EVIL),
            ):
                put(key, payload)(more)
            ask("stop")(more)
            settle(more)

    return act


PERSON, ALL = "INTERACTIVE_HIGH", f"**/{STANDS}/cmd_vel"
BOB = """<robot name="Bob"><link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
SPAWN = json.dumps({"name": "Bob", "resource_string": BOB}).encode()
PAUSE, RESET = b'{"state": {"state": 2}}', b'{"scope": 0}'
MOVE = b'{"entity": "Fred", "state": {"pose": {"position": {"x": 3}, "orientation": {"w": 1}}}}'
LIMIT = b'{"parameters": [{"name": "max_linear", "value": {"type": 3, "double_value": 0.01}}]}'

ATTACKS: list[tuple[str, str, str, Act]] = [
    # Attacker, act, how the sim counts it (empty: the router keeps it out), and how it is done.
    ("viewer", "drive", "", put(f"{STANDS}/cmd_vel")),
    ("viewer", "drive, as a person", "", put(f"{STANDS}/cmd_vel", priority=PERSON)),
    ("viewer", "drive, before all others", "", put("cmd_vel", priority="REAL_TIME")),
    ("viewer", "stop the driver", "", put("cmd_vel", b"{}", "REAL_TIME")),
    ("viewer", "drive all by a wildcard", "", put("**/cmd_vel")),
    ("viewer", "drive and blind all by **", "", put("**", EVIL)),
    (
        "viewer",
        "turn a joint",
        "",
        put(f"{STANDS}/joint_command", b'{"name": ["x"], "velocity": [9]}'),
    ),
    ("viewer", "sign a command", "", signed(f"{STANDS}/cmd_vel", "DATA")),
    ("viewer", "replay a command", "", replayed("cmd_vel")),
    ("viewer", "publish odom", "", put("odom", EVIL)),
    ("viewer", "publish odom before all others", "", put("odom", EVIL, "REAL_TIME")),
    ("viewer", "publish tf", "", put("tf", EVIL)),
    ("viewer", "set a goal", "", put("goal_pose", EVIL)),
    ("viewer", "publish the clock", "", put("clock", EVIL)),
    ("viewer", "publish a status", "", put("cmd_vel_status", EVIL)),
    ("viewer", "publish the simulation's status", "", put("simulation_status", EVIL)),
    ("viewer", "publish on the keys of the graph", "", put("@holozen/x/about", EVIL)),
    ("viewer", "delete odom", "", lambda raid: raid.session.delete("odom")),
    ("viewer", "call stop", "", ask("stop")),
    ("viewer", "call stop by a wildcard", "", ask("**", everyone=True)),
    ("viewer", "call stop by half a wildcard", "", ask("*/stop", everyone=True)),
    ("viewer", "spawn", "", ask("spawn_entity", SPAWN)),
    ("viewer", "delete a robot", "", ask("delete_entity", b'{"entity": "Fred"}')),
    ("viewer", "move a robot by hand", "", ask("set_entity_state", MOVE)),
    ("viewer", "pause", "", ask("set_simulation_state", PAUSE)),
    ("viewer", "reset", "", ask("reset_simulation", RESET)),
    ("viewer", "set a parameter", "", ask("sim/set_parameters", LIMIT)),
    ("viewer", "serve spawn_entity", "", serve("spawn_entity")),
    ("viewer", "serve robot_description", "", serve("robot_description")),
    ("viewer", "serve everything", "", serve("**")),
    ("viewer", "beat as the sim", "", beat),
    ("viewer", "withdraw the driver's node", "", forged("@holozen/{}/driver/node", lost=True)),
    (
        "viewer",
        "withdraw another node of the driver's",
        "",
        forged("@holozen/{}/Ann%2Fdriver/node", lost=True),
    ),
    ("viewer", "claim a robot's keys", "", named_spawn),
    ("viewer", "change the router's rules", "", reconfigure),
    ("viewer", "join as a peer", "", behind("peer")),
    ("viewer", "join as a router", "", behind("router")),
    ("viewer", "pose as the driver's session", "", pose_as("driver")),
    ("viewer", "pose as the sim's session", "", pose_as("sim")),
    ("viewer", "pose as the router", "", pose_as("router")),
    ("viewer", "declare thousands of things", "", flood),
    ("viewer", "ask for much", "", ask_much),
    ("viewer", "open twenty sessions", "", crowd),
    ("viewer", "send 40 MB", "", fill),
    ("Eve", "drive unsigned", "unproven", put(f"{STANDS}/cmd_vel", priority="DATA_LOW")),
    ("Eve", "drive unsigned, with a stamp", "unproven", stamped(f"{STANDS}/cmd_vel")),
    (
        "Eve",
        "sign with what is no number",
        "unproven",
        stamped(f"{STANDS}/cmd_vel", b";" + b"x" * 128),
    ),
    ("Eve", "drive as a person", "unproven", signed(f"{STANDS}/cmd_vel", PERSON)),
    (
        "Eve",
        "drive in the name of none",
        "unproven",
        signed(f"{STANDS}/cmd_vel", "DATA_LOW", name="Nobody"),
    ),
    ("Eve", "drive in Ann's name", "unproven", signed(f"{STANDS}/cmd_vel", PERSON, name="Ann")),
    (
        "Eve",
        "drive in Ann's name, by a key of her own",
        "unproven",
        signed(f"{STANDS}/cmd_vel", PERSON, name="Ann", foreign=True),
    ),
    (
        "Eve",
        "drive in a revoked name",
        "unproven",
        signed(f"{STANDS}/cmd_vel", "DATA_LOW", name="Old"),
    ),
    ("Eve", "drive all by a wildcard", "wildcard", signed(ALL, "DATA_LOW")),
    ("Eve", "replay a command", "out of order", replayed("cmd_vel")),
    ("Eve", "replay a command to another robot", "unproven", replayed(f"{STANDS}/cmd_vel")),
    (
        "Eve",
        "replay a command at a higher priority",
        "unproven",
        replayed("cmd_vel", priority=zenoh.Priority.REAL_TIME),
    ),
    ("Eve", "replay a command as another one", "unproven", replayed("cmd_vel", payload=FORWARD)),
    (
        "Eve",
        "replay a command in another encoding",
        "unproven",
        replayed("cmd_vel", encoding="zenoh/bytes"),
    ),
    ("Eve", "replay a command with a later number", "unproven", tampered),
    ("Eve", "turn a joint unsigned", "unproven", put(f"{STANDS}/joint_command")),
    (
        "Eve",
        "delete a command's key",
        "unproven",
        lambda raid: raid.session.delete(f"{STANDS}/cmd_vel"),
    ),
    ("Eve", "publish odom", "", put("odom", EVIL)),
    ("Eve", "serve the sim's parameters", "", serve("sim/get_parameters")),
    ("Eve", "beat as the sim", "", beat),
    ("Eve", "call release", "", ask("release")),
    ("Eve", "spawn", "", ask("spawn_entity", SPAWN)),
    ("Eve", "send 40 MB", "", fill),
    ("script", "drive as a person", "unproven", signed(f"{STANDS}/cmd_vel", PERSON)),
    ("script", "publish the clock", "", put("clock", EVIL)),
    ("script", "call resume", "", ask("resume")),
    ("script", "reset", "", ask("reset_simulation", RESET)),
    ("script", "serve get_entities", "", serve("get_entities")),
    ("operator", "publish odom", "", put("odom", EVIL)),
    ("operator", "serve get_entities", "", serve("get_entities")),
    ("operator", "change the router's rules", "", reconfigure),
    (
        "operator",
        "join as a router",
        "",
        lambda raid: behind("router")(raid._replace(name="viewer")),
    ),
]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    folder, rover = tmp_path_factory.mktemp("fleet"), data.find("urdf", "rover.urdf.xacro")
    # Its driver may be held up on a busy machine; what no attacker brings about is its stop, after
    # that time or before.
    patient = folder / "hb_bot.urdf.xacro"
    text = data.find("urdf", patient.name).read_text()
    patient.write_text(text.replace("</plugin>", "<cmdTimeout>60</cmdTimeout></plugin>"))
    packages = ("--package", f"holo={rover.parents[1]}")
    fleet = Fleet(
        folder / "secure", "--robot", str(patient), "--robot", f"{rover}={STANDS}", *packages
    )
    yield fleet
    fleet.close()


@pytest.fixture(scope="module")
def watch(fleet: Fleet) -> Watch:
    """Ann drives the first robot, from a process of her own, until the fleet ends."""
    watch = Watch(fleet)
    script, ann = Path(__file__).parents[3] / "faults" / "driver.py", fleet.root / "Ann"
    watch.process = fleet.run(
        sys.executable, str(script), fleet.endpoint, str(ann), stdout=subprocess.DEVNULL
    )
    wait_for(watch.driven, 30)
    return watch


@pytest.fixture(scope="module")
def sent(fleet: Fleet, watch: Watch) -> Sample:
    with fleet.bus("viewer") as viewer:
        return viewer.subscribe_raw("cmd_vel").recv()


def test_no_member_does_what_its_role_may_not(fleet: Fleet, watch: Watch, sent: Sample) -> None:
    before = watch.breaches("before all")
    for attacker, rows in groupby(ATTACKS, itemgetter(0)):
        attacks = [*rows]
        with fleet.tool(attacker) as session:
            raid = Raid(fleet, watch, session, attacker, sent)
            # To wait for a status takes 0.2 s, so ten attacks share one.
            for first in range(0, len(attacks), 10):
                ten = attacks[first : first + 10]
                for _, what, _, act in ten:
                    act(raid)
                    if act is not fill:
                        settle(raid)
                    watch.breaches(f"{attacker}: {what}", counts=False)
                names = f"{attacker}: {', '.join(what for _, what, *_ in ten)}"
                after = watch.breaches(names)
                expected = Counter(counted for *_, counted, _ in ten if counted)
                assert after - before == expected, f"{names}: {after - before}"
                before = after


def test_a_revoked_member_reads_and_does_nothing(fleet: Fleet, watch: Watch, sent: Sample) -> None:
    before = watch.breaches("before all")
    with fleet.tool("Old") as session:
        raid = Raid(fleet, watch, session, "Old", sent)
        others = zenoh.Locality.REMOTE
        heard = session.declare_subscriber(
            "**", zenoh.handlers.RingChannel(10), allowed_origin=others
        )
        for act in (
            put("cmd_vel", b"{}", "REAL_TIME"),
            put("odom", EVIL),
            ask("stop"),
            replayed("cmd_vel"),
        ):
            act(raid)
        assert not [reply for reply in session.get("odom", timeout=0.5) if reply.ok]
        assert watch.breaches("revoked") == before
        assert heard.try_recv() is None
        assert not list(session.liveliness().get("@holozen/**", timeout=0.5))


def test_a_member_is_no_router_for_others(fleet: Fleet, tmp_path: Path) -> None:
    """An attacker who can change where others connect to, without the router's key."""
    tls = "transport__link__tls__"
    folder, endpoint = fleet.root / "Eve", f"tls/127.0.0.1:{free_port()}"
    listening = {
        f"{tls}listen_certificate": str(folder / "cert.pem"),
        f"{tls}listen_private_key": str(folder / "key.pem"),
    }
    posing = fleet.tool("Eve", mode="router", listen__endpoints=[endpoint], **listening)
    with posing, pytest.raises(zenoh.ZError, match="Unable to connect"):
        fleet.tool("viewer", connect__endpoints=[endpoint], connect__timeout_ms=500)


def half_open(port: int) -> contextlib.ExitStack:
    """Open connections that never continue their handshake."""
    ends = contextlib.ExitStack()
    for _ in range(10):
        ends.enter_context(socket.create_connection(("127.0.0.1", port)))
    return ends


def test_a_foreign_session_gets_nowhere(fleet: Fleet, watch: Watch, tmp_path: Path) -> None:
    tls, port = "transport__link__tls__", int(fleet.endpoint.rpartition(":")[2])
    authority.initialize(tmp_path / "foreign", [], 1)
    authority.add(tmp_path / "foreign", "operator", "Ann", 1)
    ours = {f"{tls}root_ca_certificate": str(fleet.root / "ca.pem")}

    def member(folder: Path) -> dict[str, object]:
        certificate, key = str(folder / "cert.pem"), str(folder / "key.pem")
        return {**ours, f"{tls}connect_certificate": certificate, f"{tls}connect_private_key": key}

    for more in (
        {"connect__endpoints": [fleet.endpoint.replace("tls/", "tcp/")]},
        {
            **ours,
            f"{tls}enable_mtls": False,
            f"{tls}connect_certificate": None,
            f"{tls}connect_private_key": None,
        },
        member(tmp_path / "foreign" / "Ann"),
        member(fleet.root / "router"),  # it serves, and connects to no router
    ):
        with pytest.raises(zenoh.ZError, match="Unable to connect"):
            fleet.tool("viewer", connect__timeout_ms=500, **more)
    before = watch.breaches("foreign certificates")
    with socket.create_connection(("127.0.0.1", port)) as raw:
        raw.sendall(os.urandom(20_000))
    context = ssl.create_default_context(cafile=str(fleet.root / "ca.pem"))
    with (
        socket.create_connection(("127.0.0.1", port)) as raw,
        context.wrap_socket(raw, server_hostname="localhost") as end,
        contextlib.suppress(OSError),
    ):
        end.sendall(os.urandom(20_000))
    with half_open(port):
        with fleet.tool("viewer"):
            pass
        assert watch.breaches("half-open connections") == before
    assert watch.breaches("garbage, and broken connections") == before
    # each broken one keeps newcomers waiting for 0.1 s
    with fleet.tool("viewer", connect__timeout_ms=30_000):
        pass


def test_a_member_that_is_killed_leaves_no_robot_driving(watch: Watch) -> None:
    """The robot's own watchdog would take a minute."""
    assert watch.process
    assert watch.driven()
    watch.process.kill()
    wait_for(lambda: abs(_new(watch.odoms[0], 1)[-1].twist.twist.linear.x) < 1e-3)


def test_a_recording_moves_no_robot_of_a_new_sim_even_under_the_session_of_its_sender(
    fleet: Fleet,
) -> None:
    """A session's id is its owner's choice, and a sim that was started again has seen no number
    yet.
    """
    key = f"{STANDS}/cmd_vel"
    with fleet.bus("viewer") as viewer, fleet.bus("operator") as driver:
        samples, commands = viewer.subscribe_raw(key), driver.publisher(key, Twist, PERSON)
        recorded: list[Sample] = []

        def record() -> bool:
            commands.put(Twist.planar(x=0.3))
            recorded.extend(iter(samples.try_recv, None))
            return len(recorded) > 5

        wait_for(record, 20)
        node, session = driver.node, driver.id
    fleet.sim.terminate()
    fleet.sim = fleet.start_sim()
    watch = fleet.bus("Ann")
    status, odom = (
        watch.latest(f"{STANDS}/cmd_vel_status", CommandStatus),
        watch.latest(f"{STANDS}/odom", Odometry),
    )
    with fleet.tool("Eve", id=session) as eve:
        assert str(eve.zid()) == session
        held = [
            eve.liveliness().declare_token(f"@holozen/{session}/{node}/{kind}")
            for kind in ("node", f"pub/geometry_msgs/msg/Twist/{key}")
        ]
        before = wait_for(lambda: status.read()[0])

        def refused() -> bool:
            for sample in recorded:
                eve.put(
                    key,
                    sample.payload,
                    encoding=sample.encoding,
                    attachment=sample.attachment,
                    priority=getattr(zenoh.Priority, sample.priority),
                )
            now = status.read()[0]
            assert now and now.accepted == 0, now
            return now.refused.get("no echo", 0) > 3

        wait_for(refused, 20, what=lambda: str(status.read()))
        assert before and held
        message = odom.read()[0]
        assert message and abs(message.twist.twist.linear.x) < 0.01
