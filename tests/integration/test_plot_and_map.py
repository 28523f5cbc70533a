"""`holozen plot` and `holozen map` beside a live robot, in a terminal and in a pipe."""

import json
import os
import re
from functools import partial

import pytest

from holozen.messages import Pose, Quaternion, Twist, codec
from holozen.messages.geometry_msgs import Point
from holozen.messages.simulation_interfaces import (
    EntityState,
    SetEntityStateReply,
    SetEntityStateRequest,
)
from holozen.rotation import from_rpy
from holozen.testing import Process, Terminal, Wire, wait_for

from .conftest import Done, Verb, comes_to, start_sim
from .robots import URDF, Robot

FIELD = "odom.pose.pose.position.x"


@pytest.fixture(scope="module")
def sim(town: Wire) -> Process:
    """Its time is slow, as nothing here waits for it."""
    return start_sim(town, "--rtf", "0.2")


def plotted(verb: Verb, wire: Wire, *words: str) -> Done:
    """A plot; again where a busy machine let nothing come in its window."""
    done = wait_for(
        lambda: None if "no messages" in (done := verb(wire, "plot", *words)).stderr else done
    )
    assert done and done.returncode == 0, done
    return done


def test_one_picture_of_live_numbers_fits_the_smallest_terminal(
    verb: Verb, town: Wire, robot: Robot
) -> None:
    done = plotted(verb, town, FIELD, "odom.twist.twist.linear.x", "--once", "-w", "0.5")
    lines = done.stdout.splitlines()
    assert len(lines) == 24
    assert all(len(line) <= 80 for line in lines)
    assert lines[0].startswith(f"{FIELD}: ")
    assert lines[-1].split()[-1] == "now"
    assert plotted(verb, town, FIELD, "--once", "-w", "0.5", "--ascii").stdout.isascii()


def test_numbers_of_one_window_come_as_json_and_end(verb: Verb, town: Wire, robot: Robot) -> None:
    done = plotted(verb, town, FIELD, "--json", "--once", "-w", "0.5")
    assert {FIELD, "time"} == set(json.loads(done.stdout.splitlines()[-1]))
    done = verb(town, "plot", "nobody.x", "--json", "--once", "-w", "0.2")
    assert (done.returncode, done.stdout) == (1, "")
    assert "no messages" in done.stderr


def first_lines(wire: Wire, count: int, *words: str) -> list[bytes]:
    """What a verb writes to a reader that has seen enough then; the verb ends quietly."""
    reading, writing = os.pipe()
    with open(reading, "rb") as reader:
        with open(writing, "wb") as output:
            process = wire.start(*words, stdout=output)
        lines = [reader.readline() for _ in range(count)]
    assert (process.wait(), process.err) == (0, "")
    return lines


def test_a_reader_that_has_seen_enough_ends_it_quietly(town: Wire, robot: Robot) -> None:
    for words in (("map",), ("plot", FIELD)):
        assert all(line.endswith(b"\n") for line in first_lines(town, 3, *words))
    numbers = first_lines(town, 2, "plot", FIELD, "--json")
    assert [list(json.loads(line)) for line in numbers] == [["time", FIELD]] * 2


def test_every_wire_is_drawn_and_what_is_no_message_is_counted(wire: Wire) -> None:
    session = wire.bus().session
    publisher = session.declare_publisher("cmd_vel")
    plot = wire.start("plot", "cmd_vel.linear.x", "--json")
    wait_for(lambda: publisher.matching_status.matching)
    publisher.put(b"\xff\x00", encoding="zenoh/bytes")
    publisher.put(b"\0\1\0\0", encoding="application/cdr")
    for name, x in (("json", 1.0), ("cdr", 2.0)):
        publisher.put(codec.encode(Twist.planar(x=x), name), encoding=codec.encoding(name, Twist))
    wait_for(lambda: plot.out.count("\n") == 2)
    assert plot.interrupt() == 0
    assert "2 messages could not be read" in plot.err
    assert [json.loads(line)["cmd_vel.linear.x"] for line in plot.out.splitlines()] == [1.0, 2.0]


def shows(terminal: Terminal, pattern: str) -> bool:
    return bool(re.search(pattern, terminal.screen()))


def test_a_terminal_is_left_as_it_was(town: Wire, robot: Robot) -> None:
    for verb, words, shown in (("plot", (FIELD,), f"{FIELD}: [-0-9]"), ("map", (), "hb_bot x")):
        terminal = town.terminal(verb, *words)
        wait_for(partial(shows, terminal, shown), what=shown)
        terminal.type("\x03")
        assert terminal.process.wait() == 0
        assert terminal.modes() == terminal.modes_before
        assert terminal.raw.endswith("\x1b[?25h\x1b[?1049l")


@pytest.mark.parametrize(
    ("words", "code", "part"),
    [
        (
            ("odom.pose.pose.positon.x", "--once"),
            1,
            "odom.pose.pose.positon.x: no field 'positon'",
        ),
        (
            ("odom.pose.pose", "--once"),
            1,
            "odom.pose.pose: it is not a number; it has position, orientation",
        ),
        (
            ("nobody.x", "--once", "-w", "0.2"),
            1,
            "no messages on nobody; `holozen topic list` shows the topics",
        ),
    ],
)
def test_an_error_is_reported_in_one_line(
    verb: Verb, town: Wire, robot: Robot, words: tuple[str, ...], code: int, part: str
) -> None:
    done = verb(town, "plot", *words)
    assert done.returncode == code, done.stderr
    assert part in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


def test_the_map_shows_the_robot_and_the_goals(verb: Verb, town: Wire, robot: Robot) -> None:
    service = town.start("pose-service")
    service.wait_for_line("4 goals")

    def once() -> str:
        text = verb(town, "map", "--once").stdout
        return text if "hb_bot x" in text else ""

    lines = wait_for(once).splitlines()
    assert len(lines) == 24
    assert all(len(line) <= 80 for line in lines)

    def drawn() -> tuple[list[str], dict[str, object], int]:
        output = json.loads(verb(town, "map", "--json").stdout)
        return [one["name"] for one in output["robots"]], output["objects"], len(output["goals"])

    comes_to((["hb_bot"], {}, 4), drawn)  # with the four corners of the square


def test_the_map_shows_what_a_lidar_sees_where_it_is(verb: Verb, wire: Wire) -> None:
    """The arena's walls are 5 m from its middle, whichever way the robot looks."""
    sim = wire.start(
        "sim",
        "--robot",
        str(URDF / "explorer.urdf.xacro"),
        "--world",
        str(URDF.parent / "worlds/arena.world"),
    )
    sim.wait_for_line("listens on cmd_vel", 60)
    turned = Pose(Point(0.5, -0.5, 0.2), Quaternion(*from_rpy(0.0, 0.0, 0.8)))
    request = SetEntityStateRequest("explorer", state=EntityState(pose=turned))
    wire.bus().call("set_entity_state", request, SetEntityStateReply)

    def walls() -> bool:
        output = json.loads(verb(wire, "map", "--json").stdout)
        yaws = [robot["yaw"] for robot in output["robots"]]
        at = [max(abs(x), abs(y)) for x, y in output["seen"]]
        return (
            yaws == pytest.approx([0.8], abs=0.05)
            and len(at) > 100
            and max(at) < 5.1
            and sum(far > 4.9 for far in at) > 100
        )

    wait_for(walls, 30, what="the walls")
