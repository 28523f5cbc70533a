"""`holozen replay`: the same bytes on the same keys; robots are moved only if asked, and stopped at
the end.
"""

import json
import re
import signal
import threading
import time
from pathlib import Path

import pytest

from holozen.bags.formats import format_of
from holozen.bags.player import SETTLE
from holozen.bags.writer import BagWriter
from holozen.messages import (
    Header,
    JointState,
    Message,
    Odometry,
    PoseStamped,
    Time,
    Twist,
    TwistStamped,
    Vector3,
    Wrench,
    codec,
)
from holozen.testing import Wire, wait_for
from holozen.testing.lock_step import HELD_UP
from holozen.transport.graph import on_key
from holozen.transport.samples import RawSubscriber, Sample
from tests.extensions.bags.bags import played
from tests.integration.conftest import Verb
from tests.integration.foreign_samples import PAYLOADS
from tests.integration.processes import read
from tests.integration.robots import Robot, moves, speeds
from tests.terminals.operators import BOX

MS = 1_000_000  # ns
FORWARD = codec.encode(Twist.planar(x=0.2))


def bag(
    path: Path, *rows: tuple[str, bytes, str, float], types: tuple[type[Message], ...] = ()
) -> str:
    """A bag with rows of key, payload, Zenoh Encoding and time in ms."""
    writer = BagWriter(str(path))
    for key, payload, encoding, at in rows:
        writer.write(key, format_of(payload, encoding, types)[0], payload, round(at * MS))
    writer.close()
    return str(path)


STOPS = [codec.encode(Twist())] * 5


def heard(tap: RawSubscriber, *, count: int = 0, last: list[bytes] = []) -> list[Sample]:
    """All that came, once there are `count` of them and the `last` payloads are these."""
    found: list[Sample] = []

    def complete() -> bool:
        found.extend(iter(tap.try_recv, None))
        return len(found) >= count and (
            not last or [sample.payload for sample in found[-len(last) :]] == last
        )

    wait_for(complete, what=lambda: f"{count} samples that end with {last}; there are {found}")
    return found


def assert_obeyed(code: int, errors: str) -> None:
    """It ended well; on a busy machine its last command may have been held up."""
    lines = played(errors)
    assert code == 0 or lines[-1].startswith(tuple(f"not obeyed: {why}" for why in HELD_UP)), errors


def commands(count: int, every: float = 50.0) -> list[tuple[str, bytes, str, float]]:
    """Forward, again and again, for `count` times `every` ms."""
    return [("cmd_vel", FORWARD, "application/json", i * every) for i in range(count)]


def test_payloads_and_encodings_are_those_of_the_bag(
    verb: Verb, wire: Wire, tmp_path: Path
) -> None:
    rows = [
        (f"any/{i}", payload, encoding, i * 5)
        for i, (encoding, payload) in enumerate(PAYLOADS.items())
    ]
    tap = wire.bus().subscribe_raw("any/**")
    done = verb(wire, "replay", bag(tmp_path / "a.mcap", *rows))
    assert (done.returncode, played(done.stderr)) == (0, [])
    assert done.stdout.startswith(f"played {len(rows)} messages in ")
    assert [(s.key, s.payload, s.encoding) for s in heard(tap, count=len(rows))] == [
        (key, p, e) for key, p, e, _ in rows
    ]


def test_a_recording_is_played_to_a_second_recorder(verb: Verb, wire: Wire, tmp_path: Path) -> None:
    rows = [("a", b"%d" % i, "text/plain", i) for i in range(300)]
    first = bag(tmp_path / "first.mcap", *rows)
    recorder = wire.start("record", "b", "-o", str(tmp_path / "again"))
    recorder.wait_for_line("recording b")
    done = verb(
        wire,
        "replay",
        first,
        "--remap",
        "a:=b",
        "--json",
        "--start-offset",
        "0.1",
        "--until",
        "0.199",
    )
    assert json.loads(done.stdout)["messages"] == 100, done.stderr
    assert recorder.interrupt() == 0, recorder.err
    found = [int(m.payload) for m in read(tmp_path / "again.mcap")]
    assert found == sorted(found)
    assert set(found) <= set(range(100, 200))  # Zenoh drops some on a machine that is too busy
    assert found


def test_a_reader_that_is_in_the_graph_is_waited_for(
    verb: Verb, wire: Wire, tmp_path: Path
) -> None:
    bus, graph = wire.bus(), wire.bus("witness").graph()
    token = bus.announce("sub", "any/msg/Any", "a")
    taps: list[RawSubscriber] = []

    def read_late() -> None:
        wait_for(lambda: on_key(graph.endpoints(), "a", "pub"), what="the player")
        threading.Event().wait(2 * SETTLE)  # longer than any other subscriber is waited for
        taps.append(bus.subscribe_raw("a"))

    late = threading.Thread(target=read_late)
    late.start()
    done = verb(wire, "replay", bag(tmp_path / "a.mcap", ("a", b"hello", "text/plain", 0.0)))
    late.join()
    assert done.returncode == 0, done.stderr
    assert [s.payload for s in heard(taps[0], count=1)] == [b"hello"]
    token.undeclare()


def test_beside_a_live_robot_nothing_is_played_that_could_disturb_it(
    verb: Verb, town: Wire, robot: Robot, tmp_path: Path
) -> None:
    odom = ("odom", codec.encode(Odometry()), "application/json", 0.0)
    path = bag(tmp_path / "a.mcap", odom, *commands(3), ("note", b"hello", "text/plain", 1.0))
    tap = robot.bus.subscribe_raw("note")
    done = verb(town, "replay", path)
    assert done.returncode == 0
    assert played(done.stderr) == [
        "cmd_vel is left out: it moves robots; --commands plays it too",
        "odom is left out: sim publishes it now; --remap odom:=NEW plays it elsewhere",
    ]
    assert [s.payload for s in heard(tap, count=1)] == [b"hello"]
    done = verb(town, "replay", path, "--topics", "cmd_vel")
    assert done.returncode == 1
    assert done.stderr == "holozen replay: cmd_vel: it moves robots; --commands plays it too\n"


def test_a_recording_of_a_running_sim_explains_how_to_play_it(
    verb: Verb, town: Wire, robot: Robot, tmp_path: Path
) -> None:
    path = bag(tmp_path / "a.mcap", ("odom", codec.encode(Odometry()), "application/json", 0.0))
    done = verb(town, "replay", path)
    advice = (
        "nothing was played; end sim first, or play under other keys, such as --remap "
        "odom:=old/odom"
    )
    assert (done.returncode, done.stderr.splitlines()[-1]) == (1, f"holozen replay: {advice}")
    assert verb(town, "replay", path, "--remap", "odom:=old/odom").returncode == 0


def test_commands_drive_the_robot_and_a_stop_ends_them(
    verb: Verb, town: Wire, robot: Robot, tmp_path: Path
) -> None:
    path = bag(tmp_path / "a.mcap", *commands(8), types=(Twist,))
    tap = robot.bus.subscribe_raw("cmd_vel")
    done = verb(town, "replay", path, "--commands")
    assert_obeyed(done.returncode, done.stderr)
    sent = heard(tap, count=8, last=STOPS)
    assert [s.payload for s in sent[:8]] == [FORWARD] * 8
    assert {s.priority for s in sent} == {"DATA"}
    assert all(s.source.startswith("replay@") for s in sent)
    assert [s.payload for s in sent[8:]] == STOPS


def test_commands_that_a_robot_does_not_obey_are_reported(
    verb: Verb, town: Wire, robot: Robot, tmp_path: Path
) -> None:
    path = bag(tmp_path / "a.mcap", *commands(20), types=(Twist,))
    assert verb(town, "stop").returncode == 0
    done = verb(town, "replay", path, "--commands")
    assert verb(town, "release").returncode == 0
    assert done.returncode == 1
    assert re.search(
        r"^not obeyed: the robot is stopped by stop@\w+; `holozen release` lets it drive again$",
        done.stderr,
        re.M,
    )


def test_a_robot_that_comes_while_it_plays_is_not_moved(
    verb: Verb, wire: Wire, tmp_path: Path
) -> None:
    """The bag does not know the type of what moves it: nobody listened when it was recorded."""
    rows = [("Ann/drive", FORWARD, "", i * 20.0) for i in range(20)]
    path = bag(tmp_path / "a.mcap", *rows, ("note", b"hello", "text/plain", 1.0))
    box = tmp_path / "box.urdf"
    box.write_text(BOX.replace("<commandTopic>cmd_vel", "<commandTopic>drive"))
    notes = wire.bus().subscribe_raw("note", depth=1)
    wire.start("sim", "--empty").wait_for_line("no robot yet")
    player = wire.start("replay", path, "--loop")
    notes.recv()
    assert verb(wire, "spawn", str(box), "--name", "Ann").returncode == 0
    robot = Robot(wire.bus(), "Ann")
    notes.try_recv()
    for _ in range(3):  # the bag has begun again
        notes.recv()
    assert max(abs(speed) for odom in robot.odom.messages() for speed in speeds(odom)) < 0.01
    assert player.interrupt() == 0
    assert played(player.err) == [
        "Ann/drive is left out from here on: it moves robots; --commands plays it too"
    ]


def test_what_robots_would_read_as_a_command_is_one_whatever_its_key(
    verb: Verb, wire: Wire, tmp_path: Path
) -> None:
    commands: dict[str, tuple[Message, str]] = {
        f"{type(command).__name__}_{form}": (command, form)
        for command in (
            Twist.planar(0.1),
            TwistStamped(twist=Twist.planar(0.1)),
            Wrench(Vector3(1.0)),
        )
        for form in ("json", "cdr")
    }
    rows = [
        (key, codec.encode(command, form), codec.encoding(form, type(command)), 0.0)
        for key, (command, form) in commands.items()
    ]
    tap = wire.bus().subscribe_raw("*")
    path = bag(tmp_path / "a.mcap", *rows)
    assert verb(wire, "replay", path).returncode == 1, "nothing is played"
    assert verb(wire, "replay", path, "--commands").returncode == 0
    sent = heard(tap, count=6 * len(commands))
    for key, (command, _) in commands.items():
        kind = type(command)
        found = [codec.decode(s.payload, s.encoding, (kind,)) for s in sent if s.key == key]
        assert found == [command, *[kind()] * 5], key


def test_what_moves_nothing_is_played_on_any_key(verb: Verb, wire: Wire, tmp_path: Path) -> None:
    payloads = [
        b"{}",
        b'{"linear": {"x": 0}}',
        codec.encode(Odometry()),
        b"0.1",
        FORWARD.ljust(70_000),
    ]
    tap = wire.bus().subscribe_raw("any")
    done = verb(
        wire,
        "replay",
        bag(tmp_path / "a.mcap", *[("any", p, "text/plain", i) for i, p in enumerate(payloads)]),
    )
    assert (done.returncode, played(done.stderr)) == (0, [])
    assert [s.payload for s in heard(tap, count=len(payloads))] == payloads


@pytest.mark.parametrize("form", ["json", "cdr"])
def test_stamped_commands_drive_with_a_stamp_of_now(
    town: Wire, robot: Robot, tmp_path: Path, form: str
) -> None:
    """Their own stamps are old, and those would be refused."""
    old = TwistStamped(Header(Time(1_700_000_000), "base_link"), Twist.planar(x=0.2))
    payload, encoding = codec.encode(old, form), codec.encoding(form, TwistStamped)
    rows = [("cmd_vel", payload, encoding, i * 50.0) for i in range(20)]
    path = bag(tmp_path / "a.mcap", *rows, types=(Twist, TwistStamped))
    tap, begun = robot.bus.subscribe_raw("cmd_vel"), time.time()
    player = town.start("replay", path, "--commands", "--loop")
    wait_for(lambda: moves(robot.newest(), 0.2, 0, 0, tolerance=0.02), what="the robot to move")
    assert_obeyed(player.interrupt(), player.err)
    first = heard(tap, count=1)[0]
    command = codec.decode(first.payload, first.encoding, (TwistStamped,))
    assert (first.encoding, command.header.frame_id, command.twist) == (
        encoding,
        "base_link",
        old.twist,
    )
    assert begun - 1 < command.header.stamp.seconds() < time.time() + 1


def test_stamped_joint_commands_get_a_stamp_of_now(verb: Verb, wire: Wire, tmp_path: Path) -> None:
    old = codec.encode(JointState(Header(Time(1_700_000_000)), ["arm"], velocity=[1.0]))
    tap, begun = wire.bus().subscribe_raw("joint_command"), time.time()
    done = verb(
        wire,
        "replay",
        bag(tmp_path / "a.mcap", ("joint_command", old, "application/json", 0.0)),
        "--commands",
    )
    assert done.returncode == 0, done.stderr
    command = codec.decode(heard(tap, count=1)[0].payload, "application/json", (JointState,))
    assert (
        command.velocity == [1.0] and begun - 1 < command.header.stamp.seconds() < time.time() + 1
    )


def test_at_the_end_it_names_the_goals_that_still_drive(
    verb: Verb, wire: Wire, tmp_path: Path
) -> None:
    goal = codec.encode(PoseStamped())
    done = verb(
        wire,
        "replay",
        bag(tmp_path / "a.mcap", ("goal_pose", goal, "application/json", 0.0)),
        "--commands",
    )
    assert done.returncode == 0, done.stderr
    assert played(done.stderr) == [
        "goal_pose: the robot may drive on to the last goal, since its controller drives it"
    ]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_signal_stops_the_robot(town: Wire, robot: Robot, tmp_path: Path, number: int) -> None:
    path = bag(tmp_path / "a.mcap", *commands(600), types=(Twist,))
    tap = robot.bus.subscribe_raw("cmd_vel")
    player = town.start("replay", path, "--commands", "--loop")
    wait_for(lambda: moves(robot.newest(), 0.2, 0, 0, tolerance=0.02), what="the robot to move")
    player.signal(number)
    assert_obeyed(player.wait(), player.err)
    heard(tap, last=STOPS)
    robot.stands()


def test_in_a_terminal_space_pauses_and_the_arrow_steps(wire: Wire, tmp_path: Path) -> None:
    rows = [("a", b"%d" % i, "text/plain", i * 20_000.0) for i in range(5)]
    tap = wire.bus().subscribe_raw("a")
    terminal = wire.terminal("replay", bag(tmp_path / "a.mcap", *rows))
    terminal.wait_for_text("1 messages; space pauses")
    terminal.type(" ")
    terminal.wait_for_text("paused: space resumes")
    terminal.type("\x1b[C")
    terminal.wait_for_text("2 messages")
    terminal.type("s")
    terminal.wait_for_text("3 messages")
    terminal.type("\x03")
    terminal.wait_for_text("played 3 messages")
    assert terminal.process.wait() == 0
    assert terminal.modes() == terminal.modes_before
    assert [s.payload for s in heard(tap, count=3)] == [b"0", b"1", b"2"]


def test_it_may_begin_with_a_pause(wire: Wire, tmp_path: Path) -> None:
    rows = [("a", b"%d" % i, "", i * 50.0) for i in range(3)]
    terminal = wire.terminal("bag", "play", "-p", bag(tmp_path / "a.mcap", *rows))
    terminal.wait_for_text(", 0 messages; paused: space resumes")
    terminal.type(" ")
    terminal.wait_for_text("played 3 messages")
    assert terminal.process.wait() == 0


def test_it_may_wait_before_it_begins(verb: Verb, wire: Wire, tmp_path: Path) -> None:
    bus = wire.bus()
    player = wire.start(
        "bag", "play", "--delay", "1000", bag(tmp_path / "a.mcap", ("a", b"x", "", 0.0))
    )
    graph = bus.graph()
    wait_for(lambda: on_key(graph.endpoints(), "a", "pub"))
    assert player.interrupt() == 0
    assert player.out.startswith("played 0 messages")
    quick = verb(wire, "bag", "play", "-d", "0.1", str(tmp_path / "a.mcap"))
    assert quick.stdout.startswith("played 1 message in ")


def test_a_pause_stops_the_robot(wire: Wire, tmp_path: Path) -> None:
    tap = wire.bus().subscribe_raw("cmd_vel")
    terminal = wire.terminal(
        "replay", bag(tmp_path / "a.mcap", *commands(600), types=(Twist,)), "--commands"
    )
    heard(tap, count=1)
    terminal.type(" ")
    terminal.wait_for_text("paused: space resumes")
    heard(tap, last=STOPS)
    terminal.type("\x03")
    assert terminal.process.wait() == 0


def test_a_pause_stops_joints_but_those_that_go_to_a_position(wire: Wire, tmp_path: Path) -> None:
    turns = {
        f"{kind}/joint_command": json.dumps({"name": ["a", "b"], kind: [1.0, 2.0]}).encode()
        for kind in ("position", "velocity", "effort")
    }
    rows = [
        (key, turn, "application/json", i * 50.0) for i in range(600) for key, turn in turns.items()
    ]
    tap = wire.bus().subscribe_raw("*/joint_command")
    terminal = wire.terminal(
        "replay", bag(tmp_path / "a.mcap", *rows, types=(JointState,)), "--commands"
    )
    found = {key: list[bytes]() for key in turns}

    def came() -> dict[str, list[bytes]]:
        for sample in iter(tap.try_recv, None):
            found[sample.key].append(sample.payload)
        return found

    wait_for(lambda: all(came().values()), what="all joints to be moved")
    terminal.type(" ")
    terminal.wait_for_text("paused: space resumes")
    stop = codec.encode(JointState(name=["a", "b"], velocity=[0.0, 0.0]))
    position, *others = turns
    wait_for(lambda: all(came()[key][-5:] == [stop] * 5 for key in others), what="their stops")
    assert set(came()[position]) == {turns[position]}
    terminal.type("\x03")
    assert terminal.process.wait() == 0


def test_a_loop_plays_until_it_is_ended(wire: Wire, tmp_path: Path) -> None:
    tap = wire.bus().subscribe_raw("a")
    player = wire.start(
        "replay", bag(tmp_path / "a.mcap", *[("a", b"x", "", i) for i in range(10)]), "--loop"
    )
    for _ in range(31):
        assert tap.recv().payload == b"x"
    assert player.interrupt() == 0


def test_an_error_is_reported_in_one_line(
    verb: Verb, wire: Wire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag(tmp_path / "a.mcap", ("a", b"x", "", 0.0))
    for words, code, part in [
        (("none.mcap",), 1, "cannot read none.mcap: No such file or directory"),
        (("a.mcap", "--topics", "odom"), 1, "there is no 'odom' in the bag; it has a"),
        (("a.mcap", "--remap", "a"), 2, "write OLD:=NEW, such as odom:=old/odom"),
        (("a.mcap", "--start-offset", "9"), 1, "no message is between --start-offset and --until"),
    ]:
        monkeypatch.chdir(tmp_path)
        done = verb(wire, "replay", *words)
        assert done.returncode == code, done.stderr
        assert part in done.stderr.splitlines()[-1]
        assert "Traceback" not in done.stderr
