"""Robots with names have keys of their own."""

import json
from pathlib import Path

import pytest

from holozen import data
from holozen.messages import JointState, TFMessage
from holozen.testing import Process, Wire, wait_for
from holozen.testing.process import run
from holozen.testing.wire import command
from tests.faults.proxy import Proxy

from .conftest import SPAWN, Verb, comes_to, start_sim
from .processes import assert_one_line
from .robots import Robot, distance, moves, place, record

BOT = data.find("urdf", "hb_bot.urdf.xacro")


@pytest.fixture(scope="module")
def robots(town: Wire) -> tuple[Robot, Robot]:
    """Fred and Ann in one world."""
    start_sim(town, "--robot", f"{BOT}=Fred", "--robot", f"{BOT}=Ann")
    return Robot(town.bus(), "Fred"), Robot(town.bus(), "Ann")


@pytest.fixture
def fred(robots: tuple[Robot, Robot]) -> Robot:
    robots[0].stands()
    robots[0].resume()
    return robots[0]


@pytest.fixture
def ann(robots: tuple[Robot, Robot]) -> Robot:
    robots[1].stands()
    robots[1].resume()
    return robots[1]


def test_a_command_to_fred_moves_only_fred(fred: Robot, ann: Robot) -> None:
    stood = ann.newest()
    fred.drive(0.4)
    fred.stop()
    assert distance(ann.newest(), stood) < 1e-6


def test_both_drive_at_once_each_its_own_way(fred: Robot, ann: Robot) -> None:
    def both() -> bool:
        fred.put(0, 0.3)
        ann.put(0, 0, 0.5)
        return moves(fred.newest(), 0, 0.3, 0) and moves(ann.newest(), 0, 0, 0.5)

    wait_for(both)


def test_they_start_side_by_side_and_apart(fred: Robot, ann: Robot) -> None:
    assert place(fred.odom.messages()[0])[:2] == pytest.approx((0, 0), abs=1e-3)
    x, y, yaw = place(ann.odom.messages()[0])
    assert (x, yaw) == pytest.approx((0, 0), abs=1e-3)
    assert y > 1.5


def test_their_frames_carry_their_names(fred: Robot, ann: Robot) -> None:
    odom = ann.newest()
    assert (odom.header.frame_id, odom.child_frame_id) == ("Ann/odom", "Ann/footprint_link")
    frames = [
        t for message in [record(fred.bus, "Fred/tf", TFMessage).next()] for t in message.transforms
    ]
    assert all(
        t.header.frame_id.startswith("Fred/") and t.child_frame_id.startswith("Fred/")
        for t in frames
    )
    assert record(fred.bus, "Fred/joint_states", JointState).next().name


def test_there_is_no_robot_at_the_root(verb: Verb, town: Wire, fred: Robot) -> None:
    def is_shown() -> bool:
        info = verb(town, "topic", "info", "Fred/cmd_vel").stdout
        return "Type: geometry_msgs/msg/Twist\n" in info and "  sim (" in info

    wait_for(is_shown)
    assert verb(town, "topic", "info", "cmd_vel").returncode == 1


def test_the_driver_of_fred_has_no_say_over_ann(town: Wire, fred: Robot, ann: Robot) -> None:
    person = Robot(town.bus("person"), "Fred", "INTERACTIVE_HIGH")
    person.drive(0.3, until=lambda _: fred.last_status().obeyed.startswith("person@"))
    assert ann.status().obeyed == ""
    ann.drive(0.2)


def test_a_teleop_with_a_name_drives_that_robot(town: Wire, fred: Robot, ann: Robot) -> None:
    with town.terminal("teleop", "Ann") as terminal:
        terminal.wait_for_text("listening")
        wait_for(
            lambda: "holozen teleop   Ann   Tab: Fred" in terminal.screen(), what=terminal.screen
        )
        commands = fred.commands.from_now()
        terminal.hold_until("i", lambda: moves(ann.newest(), 0.5, 0, 0))
        terminal.type("k")
        ann.stands()
        ann.wait_for_stop_command()
        assert commands.messages() == []


def test_a_wildcard_is_no_robots_name(verb: Verb, town: Wire) -> None:
    """Zenoh would take it, and it would drive them all."""
    for service in ("teleop", "controller"):
        done = verb(town, service, "*")
        assert done.returncode == 2
        assert "robot name '*': use a letter, then" in done.stderr


BROKEN_XML = "<robot name='r'><link name='a'>"
NO_DRIVE = "<robot name='r'><link name='a'/></robot>"
WRONG = {
    "a robot that is broken XML": (["--robot", "{tmp}/broken.urdf"], 1, "broken.urdf"),
    "a robot with nothing to drive it": (["--robot", "{tmp}/still.urdf"], 1, "no plugin drives it"),
    "a picture for a robot": (["--robot", "{picture}"], 1, "logo.png"),
    "an illegal name": (["--robot", "{bot}=a/b"], 2, "robot name 'a/b'"),
    "two robots of one name": (
        ["--robot", "{bot}=A", "--robot", "{bot}=A"],
        1,
        "2 robots are called 'A'",
    ),
    "no such world": (["--world", "nowhere.world"], 1, "nowhere.world"),
    "a robot for a world": (["--world", "{tmp}/still.urdf"], 1, "is a robot (URDF), not a world"),
    "a factor of nan": (["--rtf", "nan"], 2, "'nan': use a number from 0 to 1000"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_sim_that_cannot_start_gives_the_reason_in_one_line(
    verb: Verb, wire: Wire, tmp_path: Path, name: str
) -> None:
    words, code, reason = WRONG[name]
    (tmp_path / "broken.urdf").write_text(BROKEN_XML)
    (tmp_path / "still.urdf").write_text(NO_DRIVE)
    names = {"tmp": tmp_path, "bot": BOT, "picture": data.find("meshes", "logo.png")}
    done = verb(wire, "sim", *(word.format(**names) for word in words))
    assert_one_line(done, code, reason.format(**names))


def test_a_second_sim_only_joins_with_named_robots_and_then_both_are_one_world_to_callers(
    verb: Verb, wire: Wire
) -> None:
    wire.start("router").wait_for_line("listens at")
    first = start_sim(wire, "--robot", f"{BOT}=Fred")
    join = "holozen sim --join --robot FILE=NAME"
    for words, why in [
        ([], f"end it, choose another --domain, or join it with named robots: {join}"),
        (["--join", "--robot", f"{BOT}=Ann", "--robot", str(BOT)], f"name the robots: {join}"),
    ]:
        # A new Python: without --join a sim learns of others while its engine loads, and a forked
        # one has loaded it.
        done = run(command("sim", *words, *wire.flags), is_new=not words)
        assert_one_line(done, 1, "sim: sim@", f" simulates here already; {why}")
    with Proxy(wire.port) as link:  # a slow one: what it joins is discovered late
        link.set(delay=0.2)
        where = ("--mode", "client", "--connect", link.endpoint)
        with Process(command("sim", "--join", "--robot", f"{BOT}=Ann", *where)) as second:
            second.wait_for_line("Ann listens on")
            link.set(delay=0.0)
            assert_both_are_one_world(verb, wire)
    assert "Traceback" not in first.err + second.err


def assert_both_are_one_world(verb: Verb, wire: Wire) -> None:
    comes_to(
        ["Ann", "Fred"],
        lambda: [line.split()[0] for line in verb(wire, "list").stdout.splitlines()],
    )

    def clocks() -> int:
        shown = verb(wire, "topic", "info", "clock", "--json").stdout
        return len(json.loads(shown)["publishers"]) if shown else 0

    comes_to(1, clocks)
    assert "duplicates" not in verb(wire, "doctor").stdout
    Robot(wire.bus(), "Ann").drive(0.3)
    assert verb(wire, "param", "set", "Ann/sim", "max_linear", "0.2").returncode == 0
    assert verb(wire, "delete", "Ann", "Fred").returncode == 0
    assert verb(wire, "list").stdout == ""
    assert verb(wire, *SPAWN, str(BOT), "--name", "Joe").returncode == 0, "one of them spawns"
