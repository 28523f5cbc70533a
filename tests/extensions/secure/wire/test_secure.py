"""In the secure set-up a certificate is needed, each role has its keys, and commands prove their
senders.
"""

import contextlib
import os
import socket
import ssl
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import zenoh
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePublicKey
from cryptography.hazmat.primitives.hashes import SHA256

from holozen import cli, entities
from holozen.bags.formats import format_of
from holozen.bags.writer import BagWriter
from holozen.bus import Bus, Publisher
from holozen.command.feedback import LATE
from holozen.doctor import diagnosis as doctor
from holozen.messages import (
    CommandStatus,
    CompressedImage,
    Odometry,
    Pose,
    PoseStamped,
    TriggerReply,
    TriggerRequest,
    Twist,
    Vector3,
    Wrench,
    codec,
)
from holozen.messages.geometry_msgs import Point
from holozen.secure import authority
from holozen.secure.authority import AuthorityError
from holozen.secure.members import Member, load
from holozen.secure.roles import BEATS, COMMANDS, NODES, ROLES
from holozen.testing import Process, wait_for
from holozen.testing.wire import command, free_port
from holozen.transport.beat import BEAT, GOAL_BEAT, beat_key
from holozen.transport.connection import Connection, from_environment
from holozen.transport.errors import BusError, NoReply, ServiceError
from holozen.transport.samples import RawSubscriber
from holozen.wire import TOPICS
from tests.fleet import Fleet


def unproven(status: CommandStatus) -> dict[str, int]:
    """The refused commands, without those that a busy machine held up."""
    return {kind: count for kind, count in status.refused.items() if kind not in LATE}


class Robot:
    """The fleet's robot, as its operator Ann sees it."""

    def __init__(self, fleet: Fleet) -> None:
        self.bus = fleet.bus("Ann")
        self.odom = self.bus.latest("odom", Odometry)
        self.statuses = self.bus.latest("cmd_vel_status", CommandStatus)
        self.commands = self.bus.publisher("cmd_vel", Twist, "INTERACTIVE_HIGH")
        wait_for(lambda: self.odom.count and self.statuses.count)

    @property
    def speed(self) -> float:
        message, _ = self.odom.read()
        assert message
        return message.twist.twist.linear.x

    def status(self) -> CommandStatus:
        """A status of after this call."""
        before = self.statuses.count
        wait_for(lambda: self.statuses.count > before + 1)
        message, _ = self.statuses.read()
        assert message
        return message

    def moves(self, bus: Bus, priority: str = "INTERACTIVE_HIGH") -> None:
        """Command until the robot moves and its status shows the name of this bus."""
        commands = bus.publisher("cmd_vel", Twist, priority)

        def forward() -> bool:
            commands.put(Twist.planar(x=0.3))
            status, _ = self.statuses.read()
            return self.speed > 0.2 and status is not None and status.obeyed == bus.source

        wait_for(forward, what=lambda: str(self.status()))
        commands.close()

    def stands(self) -> None:
        def stopped() -> bool:
            self.commands.put(Twist())
            return abs(self.speed) < 0.01

        def handed_over() -> bool:  # not by a call that a stop of before may have overtaken
            with contextlib.suppress(ServiceError):
                return bool(self.bus.call("resume", TriggerRequest(), TriggerReply))
            return False

        wait_for(stopped)
        wait_for(handed_over)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    fleet = Fleet(tmp_path_factory.mktemp("fleet") / "secure")
    yield fleet
    fleet.close()


@pytest.fixture(scope="module")
def only_robot(fleet: Fleet) -> Robot:
    return Robot(fleet)


@pytest.fixture
def robot(only_robot: Robot) -> Robot:
    only_robot.stands()
    return only_robot


@pytest.mark.parametrize("wire", ["json", "cdr"])
def test_an_operator_drives_and_the_status_shows_the_proven_name(
    fleet: Fleet, robot: Robot, wire: str
) -> None:
    driver = fleet.bus("operator", wire=wire)
    robot.moves(driver)
    assert driver.source.startswith("operator/test@")
    driver.close()


SEEING = """<robot name="seeing"><link name="body"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<gazebo reference="body"><sensor type="camera" name="eye"><camera><image><width>32</width><height>24</height></image>
</camera></sensor></gazebo>
<gazebo><plugin name="push" filename="libgazebo_ros_force.so"><ros><remapping>gazebo_ros_force:=hand_force</remapping>
</ros><link_name>body</link_name></plugin></gazebo></robot>"""  # noqa: E501


def test_cameras_are_seen_by_all_and_forces_push_by_role(fleet: Fleet, robot: Robot) -> None:
    entities.spawn(robot.bus, "seeing", SEEING, Pose(Point(5.0, 5.0, 0.1)))
    with fleet.bus("viewer") as viewer, fleet.bus("script") as script:
        pictures = viewer.subscribe("seeing/eye/image_raw/compressed", CompressedImage)
        odom = viewer.latest("seeing/odom", Odometry)
        picture = wait_for(pictures.try_recv, 60.0, "a picture")
        assert picture and picture.message and bytes(picture.message.data[:2]) == b"\xff\xd8", (
            "a JPEG"
        )
        push = Wrench(Vector3(x=1.0))
        refused, obeyed = (
            bus.publisher("seeing/hand_force", Wrench, "DATA") for bus in (viewer, script)
        )

        def moves(publisher: Publisher[Wrench]) -> bool:
            publisher.put(push)
            message, _ = odom.read()
            return message is not None and message.twist.twist.linear.x > 0.05

        before = odom.count
        wait_for(lambda: moves(refused) or odom.count > before + 25)
        assert not moves(refused), "a viewer sends no commands"
        wait_for(lambda: moves(obeyed))
    entities.delete(robot.bus, "seeing")


def test_an_autopilot_checks_who_sets_its_goals_and_how_old_they_are(
    fleet: Fleet, robot: Robot
) -> None:
    with (
        fleet.bus("autopilot") as pilot,
        fleet.bus("operator") as operator,
        fleet.tool("script") as script,
    ):
        beat = pilot.beat(GOAL_BEAT)
        goals, setter = (
            pilot.subscribe("goal_pose", PoseStamped),
            operator.publisher("goal_pose", PoseStamped),
        )

        def dated() -> bool:
            beat.poll()
            setter.put(PoseStamped())
            received = goals.try_recv()
            stamp = received and received.message and received.stamp
            return bool(stamp and beat.own.age(stamp.echoes) is not None)

        def unproven() -> bool:
            script.put("goal_pose", b"{}", encoding="application/json")
            return bool((received := goals.try_recv()) and received.error.startswith("unproven"))

        wait_for(dated)
        wait_for(unproven)


def test_only_a_robot_beats_as_one(fleet: Fleet, robot: Robot) -> None:
    """Who echoes a beat that another member made up could be made to send what is obeyed later."""
    sim = next(
        end.session for end in robot.bus.endpoints() if end.key == "cmd_vel" and end.kind == "sub"
    )
    heard = robot.bus.subscribe_raw(beat_key(sim, BEAT))
    wait_for(heard.try_recv, what="the sim's own beat")
    for name in ("Ann", "Eve", "script", "viewer"):
        with fleet.tool(name) as tool:
            queryable: Any = tool.declare_queryable(
                beat_key(sim, BEAT), lambda query: query.reply(query.key_expr, b"1")
            )
            tool.put(beat_key(sim, BEAT), b"1")
            # What a question brings back comes after the sample.
            assert list(tool.get("odom", timeout=5.0))
            replies = [
                reply
                for reply in robot.bus.ask_all(beat_key(sim, BEAT), 5.0)
                if not isinstance(reply, bytes)
            ]
            assert not [
                one for one in (*replies, *iter(heard.try_recv, None)) if one.payload == b"1"
            ], name
            queryable.undeclare()


def test_an_autopilot_drives_at_its_priority(fleet: Fleet, robot: Robot) -> None:
    pilot = fleet.bus("autopilot")
    robot.moves(pilot, "DATA_LOW")
    assert pilot.source.startswith("autopilot/test@")
    pilot.close()


class Captured(NamedTuple):
    """A command of Ann's, as anyone reads it off the wire."""

    payload: bytes
    attachment: bytes
    encoding: str


def driving(samples: RawSubscriber) -> Captured:
    """The next command that moves the robot."""
    while b"0.3" not in (sample := samples.recv()).payload:
        pass
    return Captured(sample.payload, sample.attachment, sample.encoding)


def own(bus: Bus) -> Member:
    assert isinstance(bus.member, Member)
    return bus.member


def test_a_replayed_command_of_a_driver_that_is_gone_moves_nothing(
    fleet: Fleet, robot: Robot
) -> None:
    with fleet.bus("viewer") as viewer, fleet.bus("operator") as driver:
        samples = viewer.subscribe_raw("cmd_vel")
        robot.moves(driver)
        sample = driving(samples)
    robot.stands()
    with fleet.bus("Eve") as eve:
        before = robot.status()

        def refused() -> bool:  # it is known to be gone once its tokens are
            eve.session.put(
                "cmd_vel",
                sample.payload,
                encoding=sample.encoding,
                attachment=sample.attachment,
                priority=zenoh.Priority.INTERACTIVE_HIGH,
            )
            return robot.status().refused.get("gone", 0) > before.refused.get("gone", 0)

        wait_for(refused, what=lambda: str(robot.status()))
        status = robot.status()
    assert status.accepted == before.accepted
    assert abs(robot.speed) < 0.01


def test_the_router_drops_what_a_role_may_not_put(fleet: Fleet, robot: Robot) -> None:
    before = robot.status()
    for name, key in [
        ("viewer", "cmd_vel"),
        ("viewer", "odom"),
        ("Eve", "odom"),
        ("script", "cmd_vel_status"),
        ("Ann", "odom"),
        ("Ann", "clock"),
        ("autopilot", "Fred/odom"),
    ]:
        heard = robot.bus.subscribe_raw(key)
        with fleet.bus(name) as bus:
            mine = own(bus).attachment(key, "DATA", bus.stamps(key)(), "application/json", b"{}")
            bus.session.put(key, b"{}", encoding="application/json", attachment=mine)
            # What a later question brings back comes after the sample.
            assert list(bus.ask_all("odom", 5.0)), name
        assert not [sample for sample in iter(heard.try_recv, None) if sample.payload == b"{}"], (
            name,
            key,
        )
        heard.close()
    assert robot.status().refused == before.refused


def test_a_bag_drives_as_its_player_may_and_what_the_router_drops_is_reported(
    fleet: Fleet, robot: Robot, tmp_path: Path
) -> None:
    writer = BagWriter(str(tmp_path / "a.mcap"))
    for i in range(40):
        for key, message in (("cmd_vel", Twist.planar(x=0.3)), ("old/odom", Odometry())):
            writer.write(
                key,
                format_of(codec.encode(message), codec.encoding("json", type(message)), ())[0],
                codec.encode(message),
                i * 50_000_000,
            )
    writer.close()
    before, play = robot.status(), ("replay", str(tmp_path / "a.mcap"), "--connect", fleet.endpoint)
    player = fleet.start(*play, "--commands", "--loop", folder="operator")
    wait_for(lambda: robot.speed > 0.2, what=lambda: str(robot.status()))
    assert player.interrupt() == 1, "a part of it was not heard"
    assert "old/odom: the router drops what operator publishes there" in player.err
    assert player.out.startswith("played ")
    wait_for(lambda: abs(robot.speed) < 0.01)
    assert unproven(robot.status()) == unproven(before)
    for words in (
        (*play, "--topics", "old/odom"),
        ("topic", "pub", "-1", "old/odom", "{}", "--connect", fleet.endpoint),
    ):
        verb = fleet.start(*words, folder="script")
        assert (verb.wait(60), verb.out) == (1, "")
        assert "old/odom: the router drops what script publishes there" in verb.err


def test_who_may_publish_on_a_key_may_announce_that_and_nobody_else() -> None:
    """By which `replay` and `topic pub` know what the router drops. A beat has a token of another
    kind.
    """
    for name, role in ROLES.items():
        announced = {one.partition("/pub/*/*/*/")[2] for one in role.announce if "/pub/" in one}
        assert announced == ({*role.put} - {*BEATS} if NODES not in role.announce else set()), name


def test_the_router_drops_requests_that_a_role_may_not_make(fleet: Fleet, robot: Robot) -> None:
    for name, key in [
        ("viewer", "stop"),
        ("viewer", "release"),
        ("Eve", "release"),
        ("Eve", "spawn_entity"),
        ("script", "resume"),
        ("script", "delete_entity"),
        ("script", "set_entity_state"),
        ("Eve", "sim/set_parameters"),
    ]:
        with fleet.bus(name) as bus, pytest.raises(NoReply):
            bus.call(key, TriggerRequest(), TriggerReply, timeout=0.2)
    assert robot.status().stopped == ""


def test_an_autopilot_may_stop_and_an_operator_release(fleet: Fleet, robot: Robot) -> None:
    with fleet.bus("Eve") as eve:
        eve.call("stop", TriggerRequest(), TriggerReply)
    assert robot.status().stopped.startswith("Eve/test@")
    robot.bus.call("release", TriggerRequest(), TriggerReply)


def test_an_operator_holds_and_steps_the_time_of_the_sim(fleet: Fleet, robot: Robot) -> None:
    for verb in ("pause", "step", "play"):
        assert fleet.start("sim", verb, "--connect", fleet.endpoint).wait() == 0


def test_a_service_cannot_be_taken_over(fleet: Fleet, robot: Robot) -> None:
    with fleet.bus("script") as bus:
        bus.session.declare_queryable(
            "stop", lambda query: query.reply("stop", b'{"success": true, "message": "fake"}')
        )
        for _ in range(5):
            assert robot.bus.call("stop", TriggerRequest(), TriggerReply).message != "fake"
        robot.bus.call("release", TriggerRequest(), TriggerReply)


def test_without_a_valid_certificate_no_node_gets_in_and_no_router_goes_on(
    fleet: Fleet, tmp_path: Path
) -> None:
    authority.initialize(tmp_path / "brief", [], 1)
    authority.renew(tmp_path / "brief", ["sim", "operator", "autopilot", "script"], 0)
    listen = ("--listen", f"tls/127.0.0.1:{free_port()}")
    router = fleet.run(*command("router", *listen, "--secure", str(tmp_path / "brief")))

    def has_begun(times: int) -> bool:
        return router.err.count("router: listens at") == times

    wait_for(partial(has_begun, 1))
    authority.renew(tmp_path / "brief", ["router"], 1)
    wait_for(partial(has_begun, 2))
    for kind, tls in (("tls", {"root_ca_certificate": str(fleet.root / "ca.pem")}), ("tcp", {})):
        config = zenoh.Config()
        endpoint = fleet.endpoint.replace("tls/", f"{kind}/")
        for path, value in (
            ("mode", '"client"'),
            ("connect/endpoints", f'["{endpoint}"]'),
            ("connect/timeout_ms", "500"),
            ("scouting/multicast/enabled", "false"),
            *((f"transport/link/tls/{name}", f'"{one}"') for name, one in tls.items()),
        ):
            config.insert_json5(path, value)
        with pytest.raises(zenoh.ZError, match="Unable to connect"):
            zenoh.open(config)

    def is_out(name: str) -> bool:
        try:
            with Bus(
                "test",
                Connection("client", connect=listen[1:], secure=str(tmp_path / "brief" / name)),
            ) as bus:
                return not bus.id
        except BusError as error:
            return "certificate expired" in str(error)

    wait_for(lambda: is_out("operator"))
    assert not is_out("viewer")
    authority.renew(tmp_path / "brief", ["router"], 6 / 86_400)
    assert router.wait() == 2, router.err
    *starts, last = router.err.splitlines()
    assert starts[1::2] == 3 * [f"router: listens at {listen[1]}"], router.err
    assert all(
        line.startswith("router: the certificate of router expires on ") for line in starts[::2]
    ), router.err
    assert "the certificate of router expired on" in last
    found = doctor.nodes(
        Connection("client", connect=listen[1:], secure=str(tmp_path / "brief" / "viewer"))
    )
    ends = [next(found).text.partition(" on ")[0] for _ in range(6)]
    others = ("router", "sim", "operator", "autopilot", "script")
    assert {*ends} == {
        "the certificate of viewer expires",
        *(f"the certificate of {name} expired" for name in others),
    }


def test_a_certificate_of_another_authority_is_refused_in_one_line(
    fleet: Fleet, tmp_path: Path
) -> None:
    authority.initialize(tmp_path / "foreign", [], 1)
    listing = Process(
        command("node", "list", "--secure", str(tmp_path / "foreign"), "--connect", fleet.endpoint)
    )
    with listing:
        assert listing.wait() == 1
        where = f"holozen node list: {fleet.endpoint} is not a router of this authority: "
        assert listing.err.startswith(where) and listing.err.count("\n") == 1, listing.err
    # Ours as the root, and a certificate that it did not issue.
    mixed = tmp_path / "foreign" / "viewer"
    (mixed / "ca.pem").write_bytes((fleet.root / "ca.pem").read_bytes())
    with pytest.raises(BusError, match="was not issued by the authority"):
        load(str(mixed))


def expired(folder: Path) -> str:
    authority.add(folder.parent, "operator", "Old", 0)
    return str(folder.parent / "Old")


def readable(folder: Path) -> str:
    (folder / "key.pem").chmod(0o640)
    return str(folder)


def swapped(folder: Path) -> str:
    (folder / "key.pem").write_bytes((folder.parent / "viewer" / "key.pem").read_bytes())
    return str(folder)


def keyless(folder: Path) -> str:
    (folder / "key.pem").unlink()
    return str(folder)


def garbled(folder: Path) -> str:
    (folder / "cert.pem").write_text("no certificate")
    return str(folder)


def absent(folder: Path) -> str:
    return f"{folder}/none"


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (expired, "the certificate of Old expired on"),
        (readable, "other users may read it"),
        (swapped, "it is not the key of cert.pem"),
        (keyless, "No such file or directory; `holozen secure init`"),
        (garbled, "is not a PEM file"),
        (absent, "there is no such folder; `holozen secure init` makes certificates"),
    ],
)
def test_a_wrong_certificate_is_reported(
    tmp_path: Path, spoil: Callable[[Path], str], reason: str
) -> None:
    authority.initialize(tmp_path / "root", [], 1)
    with pytest.raises(BusError) as error:
        from_environment(secure=spoil(tmp_path / "root" / "operator"))
    assert reason in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        (
            {"listen": ["tcp/0.0.0.0:7447"]},
            "needs endpoints such as tls/HOST:7447, not --listen tcp/0.0.0.0:7447",
        ),
        (
            {"connect": ["tls/h:1#enable_mtls=false"]},
            "needs endpoints such as tls/HOST:7447, not --connect tls/h:1#",
        ),
        ({"config": os.devnull}, "excludes --config"),
        ({"mode": "peer"}, "excludes --mode peer: all are clients"),
        ({"private": True}, "excludes --private"),
        (
            {"cfg": (("transport/link/tls/enable_mtls", "false"),)},
            "excludes --cfg transport/link/tls/enable_mtls",
        ),
    ],
)
def test_what_would_open_it_is_refused(fleet: Fleet, more: dict[str, Any], reason: str) -> None:
    with pytest.raises(BusError) as error:
        from_environment(secure=str(fleet.root), **more)
    assert reason in str(error.value)


def test_the_rules_name_every_command() -> None:
    named = {
        row.key: [
            one for one in COMMANDS if zenoh.KeyExpr(one).includes(zenoh.KeyExpr(f"a/{row.key}"))
        ]
        for row in TOPICS
    }
    assert {key for key, found in named.items() if found} == {
        row.key for row in TOPICS if row.is_command
    }
    assert [one for found in named.values() for one in found] == [*COMMANDS]
    assert any(
        zenoh.KeyExpr(one).includes(zenoh.KeyExpr("hb_bot_1/left_wheel_force")) for one in COMMANDS
    )


def test_files_are_for_their_owner_alone(fleet: Fleet) -> None:
    for path in [fleet.root, *fleet.root.rglob("*")]:
        assert path.stat().st_mode & 0o777 == (0o700 if path.is_dir() else 0o600), path


def test_a_revoked_name_is_out_at_once_and_does_not_come_back(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path / "secure")
    with contextlib.closing(fleet):
        robot, other = Robot(fleet), fleet.bus("operator")
        robot.moves(robot.bus)
        authority.revoke(fleet.root, "Ann")
        wait_for(lambda: fleet.router.err.count("listens at") == 2)
        odom = other.latest("odom", Odometry)
        seen = 0

        def stands() -> bool:
            nonlocal seen
            robot.commands.put(Twist.planar(x=0.3))
            message, _ = odom.read()
            seen = (
                odom.count if message is None or abs(message.twist.twist.linear.x) > 0.01 else seen
            )
            return odom.count > seen + 50  # a second of odometry at rest

        wait_for(stands)
        with pytest.raises(NoReply):
            robot.bus.call("stop", TriggerRequest(), TriggerReply, timeout=0.5)
        other.call("stop", TriggerRequest(), TriggerReply)
        with pytest.raises(AuthorityError, match="Ann was revoked; choose another name"):
            authority.add(fleet.root, "operator", "Ann", 1)


def test_two_commands_make_a_network_for_members_alone(tmp_path: Path) -> None:
    root, endpoint = tmp_path / "secure", f"tls/127.0.0.1:{free_port()}"
    with Process(command("secure", "init", "--secure", str(root))) as init:
        assert init.wait(30) == 0, init.err
    words = command("up", "--secure", str(root), "--listen", endpoint)
    with Process(words) as up:
        up.wait_for_line(f"router: listens at {endpoint}")
        viewer = Connection("client", connect=(endpoint,), secure=str(root / "viewer"))
        with Bus("test", viewer, patience=30) as bus:
            status = bus.latest("cmd_vel_status", CommandStatus)
            wait_for(
                lambda: (
                    (now := status.read()[0]) and now.obeyed.startswith("autopilot/controller@")
                ),
                60,
            )
            with pytest.raises(NoReply):
                bus.call("stop", TriggerRequest(), TriggerReply, timeout=0.2)
        with pytest.raises(BusError):
            plain = Connection("client", connect=(endpoint.replace("tls/", "tcp/"),))
            Bus("test", plain, patience=0.5).id  # noqa: B018
        with Process(words) as second:
            second.wait_for_line(
                f"up: something listens at {endpoint} already; assuming that it is the router"
            )
        assert up.terminate(20) == 0
    with (
        pytest.raises(ConnectionRefusedError),
        socket.create_connection(("127.0.0.1", int(endpoint[-5:]))),
    ):
        pass
    assert "Traceback" not in up.err and "was killed" not in up.err, up.err


def test_an_operators_page_is_encrypted_by_a_certificate_that_a_browser_can_trust(
    fleet: Fleet,
) -> None:
    fingerprint = authority.certify_page(fleet.root, "Ann", ["robot.local"], 1)
    trusted = ssl.create_default_context(cafile=str(fleet.root / "Ann" / "page.pem"))
    certificate = x509.load_pem_x509_certificate((fleet.root / "Ann" / "page.pem").read_bytes())
    assert fingerprint.replace(":", "").lower() == certificate.fingerprint(SHA256()).hex()
    assert isinstance(certificate.public_key(), EllipticCurvePublicKey)  # browsers know no Ed25519
    view = fleet.start("view", "--port", "0", "--connect", fleet.endpoint, folder="Ann")
    address = view.wait_for_line("https://", 60).split()[-1]
    with urllib.request.urlopen(address, context=trusted) as page:
        assert b"STOP" in page.read()
    with pytest.raises(urllib.error.URLError, match="CERTIFICATE_VERIFY_FAILED"):
        urllib.request.urlopen(address)


def test_the_verb_makes_shows_renews_and_revokes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = str(tmp_path / "root")

    def run(*words: str) -> tuple[int, str, str]:
        return cli.main(["secure", *words, "--secure", root]), *capsys.readouterr()

    assert run("show") == (
        1,
        "",
        f"holozen secure show: {root}/members.json: No such file or "
        "directory; "
        "`holozen secure init` makes an authority\n",
    )
    assert run("init", "--host", "robot.local")[0] == run("add", "viewer", "Bob")[0] == 0
    assert "Bob              viewer     until " in run("show")[1]
    certificates = [Path(root, name, "cert.pem") for name in ("router", "Bob")]
    before = [x509.load_pem_x509_certificate(file.read_bytes()) for file in certificates]
    assert run("renew", "--days", "500")[0] == 0
    for old, file in zip(before, certificates, strict=True):
        new = x509.load_pem_x509_certificate(file.read_bytes())
        assert new.not_valid_after_utc > old.not_valid_after_utc
        assert new.public_key() == old.public_key()
        assert list(new.extensions) == list(old.extensions)
    assert f"Bob              viewer     until {new.not_valid_after_utc:%Y-%m-%d}" in run("show")[1]
    assert run("renew", "router", "Ann")[2].startswith(
        "holozen secure renew: there is no member 'Ann'; there are: "
    )
    assert run("add", "viewer", "../Bob")[2].startswith(
        "holozen secure add: '../Bob': use a letter"
    )
    assert run("revoke", "Bob")[0] == 0
    with pytest.raises(AuthorityError, match="there is no member 'Bob'; there are: router, sim"):
        authority.revoke(Path(root), "Bob")
    with pytest.raises(AuthorityError, match="has an authority already"):
        authority.initialize(Path(root), [], 1)
