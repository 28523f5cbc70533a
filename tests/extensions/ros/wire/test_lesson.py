"""Scripts as students of the lesson write them, for ROS 2, drive hb_bot here as they are."""

import contextlib
import importlib.metadata
import math
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from itertools import groupby
from pathlib import Path

import pytest

from holozen.messages import NextGoalReply, NextGoalRequest, Odometry
from holozen.ros.generated import find
from holozen.testing import Process, Terminal, Wire, wait_for
from holozen.testing.wire import command
from tests.integration.conftest import Verb
from tests.integration.robots import Robot, moves, place, planar, record, rests

LESSON = Path(__file__).parents[4] / "examples" / "lesson"
SCRIPTS = LESSON / "hb_control" / "scripts"
TURN = 1.0  # rad/s, the default of teleop_keys
ROS = {"rclpy", "geometry_msgs", "std_msgs", "nav_msgs", "tf2_ros", "tf_transformations", "launch"}


def words(wire: Wire, script: str, *rest: str) -> list[str]:
    return command("run", *wire.flags, str(SCRIPTS / script), *rest)


def goals(wire: Wire) -> list[NextGoalReply]:
    bus = wire.bus("asker")
    found: list[NextGoalReply] = []
    while not found or not found[-1].end_of_list:
        found.append(bus.call("next_goal", NextGoalRequest(len(found)), NextGoalReply))
    return found


def is_heard(teleop: Terminal, robot: Robot) -> bool:
    """Whether the sim knows it by a key that moves nothing."""
    teleop.type("k")
    return any("teleop_keys" in source.source for source in robot.status().sources)


def is_at(odom: Odometry, goal: NextGoalReply) -> bool:
    x, y, yaw = place(odom)
    off = math.remainder(yaw - goal.theta_goal, math.tau)
    return math.hypot(x - goal.x_goal, y - goal.y_goal) < 0.05 and abs(off) < 0.1


def test_the_controller_drives_round_the_shape_of_the_service_node(
    town: Wire, robot: Robot
) -> None:
    shapes = record(town.bus("reader"), "shape", find("std_msgs/msg/String"))
    with Process(words(town, "controller.py", "--ros-args", "-p", "kp_linear:=3.0")) as controller:
        controller.wait_for_line("waiting for next_goal")
        with Process(words(town, "service_node.py")) as service:
            shape = shapes.next().data
            assert f"[service_node]: the shape is a {shape}" in service.wait_for_line(
                "the shape is a"
            )
            odoms, corners = robot.odom.from_now(), goals(town)
            assert len(corners) == {"triangle": 3, "square": 4, "hexagon": 6}[shape]
            left, looked_at = [*corners, corners[0]], list[Odometry]()

            def has_been_round() -> bool:
                new = odoms.messages()[len(looked_at) :]
                looked_at.extend(new)
                for odom in new:
                    if left and is_at(odom, left[0]):
                        del left[0]
                return not left

            wait_for(has_been_round, 120, lambda: f"it to reach {left}")
            assert service.interrupt() == 0
        assert controller.interrupt() == 130
    assert "Traceback" not in controller.err + service.err
    robot.stands()


def test_the_lesson_s_own_command_asks_its_service_and_ours(wire: Wire, verb: Verb) -> None:
    asked = (
        "service",
        "call",
        "/next_goal",
        "hb_interfaces/srv/NextGoal",
        "{request_goal: 1}",
        "--package",
    )
    package = f"hb_interfaces={LESSON / 'hb_interfaces'}"
    with Process(words(wire, "service_node.py")) as service:
        service.wait_for_line("the shape is a")
        assert verb(wire, *asked, package).stdout.startswith("x_goal: ")
        reported = verb(wire, *asked, package, "--json").stdout
        assert (
            reported
            == verb(wire, "service", "call", "next_goal", "request_goal: 1", "--json").stdout
        )
    wire.start("pose-service").wait_for_line("4 goals from square")
    assert verb(wire, *asked, package).stdout.startswith("x_goal: ")
    assert (
        verb(wire, *asked, package).stdout
        == verb(wire, "service", "call", "next_goal", "request_goal: 1").stdout
    )


def test_a_bare_node_drives_a_square_by_time(town: Wire, robot: Robot) -> None:
    """A second for each side: a script, or a sim, that is held up as long misses some."""
    odoms, sent = robot.odom.from_now(), robot.commands.from_now()
    with Process(words(town, "square.py")) as square:
        assert square.wait() == 0
    assert "[square]: done" in square.err
    robot.stands()
    sides = [(0.3, 0.0), (0.0, 0.3), (-0.3, 0.0), (0.0, -0.3)]
    commanded = [side for side, _ in groupby(planar(one)[:2] for one in sent.messages())]
    found = [side for side in commanded if any(side)]
    assert len(found) > 1 and found == [side for side in sides if side in found]
    assert any(moves(odom, *side, 0) for odom in odoms.messages() for side in sides)


def press(teleop: Terminal, key: str, robot: Robot, wanted: Callable[[Odometry], object]) -> None:
    """Press a key until odometry is as wanted: each press is one command, too old where the machine
    was busy.
    """

    def pressed() -> bool:
        odoms = robot.odom.from_now()
        teleop.type(key)
        with contextlib.suppress(AssertionError):
            return odoms.next(wanted, within=1.0) is not None
        return False

    wait_for(pressed, 20, f"odometry after {key!r}")


@pytest.mark.parametrize("stamped", ["False", "True"])
def test_a_teleop_of_ros_drives_from_a_terminal_and_its_end_stops_the_robot(
    town: Wire, robot: Robot, stamped: str
) -> None:
    parameters = ["-p", f"stamped:={stamped}", "-p", "speed:=0.4"]
    commands = town.bus("reader").subscribe_raw("cmd_vel")
    with Terminal(words(town, "teleop_keys.py", "--ros-args", *parameters)) as teleop:
        teleop.wait_for_text("drive, k stops")
        wait_for(partial(is_heard, teleop, robot), what="the sim to hear it")
        for key, (x, y, turn) in (
            ("i", (0.4, 0, 0)),
            ("J", (0, 0.4, 0)),
            ("l", (0, 0, -TURN)),
            ("k", (0, 0, 0)),
        ):
            press(teleop, key, robot, partial(moves, x=x, y=y, turn=turn))
        assert commands.recv().priority == "DATA"
        press(teleop, "i", robot, partial(moves, x=0.4, y=0, turn=0))
        teleop.type("\x03")
        assert teleop.process.wait() == 0
    robot.stands()


def test_its_node_is_seen_and_its_parameters_set_like_those_of_any_other(
    town: Wire, robot: Robot, verb: Verb
) -> None:
    with Process(words(town, "controller.py")), town.start("pose-service"):
        robot.odom.next(lambda odom: not rests(odom))
        assert "hb_controller" in verb(town, "node", "list").stdout.split()
        assert "hb_controller" in verb(town, "topic", "info", "-v", "cmd_vel").stdout
        reported = verb(town, "param", "set", "hb_controller", "kp_linear", "0.75")
        assert reported.returncode == 0, reported.stderr
        assert "0.75" in verb(town, "param", "get", "hb_controller", "kp_linear").stdout


def test_names_are_remapped_as_in_ros(wire: Wire) -> None:
    rest = (
        "--ros-args",
        "-r",
        "cmd_vel:=Fred/cmd_vel",
        "-r",
        "__node:=quadrat",
        "-r",
        "__ns:=/class",
    )
    bus = wire.bus()
    graph = bus.graph()
    commands = record(bus, "class/Fred/cmd_vel", find("geometry_msgs/msg/Twist")).from_now()
    nodes = set[str]()

    def is_seen() -> bool:
        nodes.update(end.node for end in graph.endpoints())
        return "class/quadrat" in nodes

    with Process(words(wire, "square.py", *rest)):
        wait_for(is_seen, what=lambda: f"it among {nodes}")
        commands.next(lambda twist: any(planar(twist)))


def test_without_holozen_run_they_fail_as_ever(tmp_path: Path) -> None:
    alone = subprocess.run(
        [sys.executable, str(SCRIPTS / "square.py")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert alone.returncode == 1
    assert "ModuleNotFoundError: No module named 'rclpy'" in alone.stderr
    assert not ROS & set(importlib.metadata.packages_distributions())


def test_a_script_that_hangs_gets_what_everyone_gets(town: Wire, robot: Robot) -> None:
    odoms = robot.odom.from_now()
    with Process(words(town, "square.py")) as square:
        odoms.next(lambda odom: not rests(odom))
        square.signal(signal.SIGSTOP)
        robot.stands()
        square.signal(signal.SIGCONT)
