"""When the process that drives a robot dies, the robot stands at once, long before the silence rule
would stop it.

The robots here have a watchdog of a minute, or none at all: what stops them within some seconds is
nothing else.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from holozen import entities
from holozen.messages import Pose
from holozen.robot.files.xacro import expand_xacro
from holozen.testing import Process, Wire, wait_for

from .conftest import Verb, in_time, start_sim
from .robots import URDF, Robot, moves, speeds

TAG = "<commandTopic>"
WATCHDOGS = {"Slow": "60", "Never": "-1"}  # s

DRIVER = """
import time
from holozen.bus import Bus
from holozen.transport.connection import Connection
from holozen.messages import Twist
with Bus("driver", Connection(connect=({endpoint!r},), listen=())) as bus:
    commands = bus.publisher({key!r}, Twist)
    print(bus.source, flush=True)
    while True:
        commands.put(Twist.planar(0.4))
        time.sleep(0.02)
"""


@pytest.fixture(scope="module")
def robots(town: Wire) -> dict[str, Robot]:
    start_sim(town, "--robot", f"{URDF / 'hb_bot.urdf.xacro'}=Fred")
    text = expand_xacro(URDF / "hb_bot.urdf.xacro")
    assert TAG in text
    bus, at = town.bus(), Pose()
    for name, watchdog in WATCHDOGS.items():
        at.position.y -= 3.0
        entities.spawn(
            bus, name, text.replace(TAG, f"<cmdTimeout>{watchdog}</cmdTimeout>{TAG}"), at
        )
    return {name: Robot(bus, name) for name in WATCHDOGS}


@pytest.fixture(params=sorted(WATCHDOGS))
def robot(robots: dict[str, Robot], request: pytest.FixtureRequest) -> Iterator[Robot]:
    """It stands at the end too."""
    robot = robots[request.param]
    robot.resume()
    yield robot
    robot.stop()


@pytest.fixture
def drive(town: Wire, tmp_path: Path) -> Callable[[Robot], Process]:
    """Starts a program that drives a robot, and does so by then."""

    def drive(robot: Robot) -> Process:
        script = tmp_path / "driver.py"
        script.write_text(DRIVER.format(endpoint=town.endpoint, key=f"{robot.name}/cmd_vel"))
        process = town.start("run", str(script))
        robot.odom.next(lambda odom: moves(odom, 0.4, 0, 0))
        assert robot.status().obeyed == process.wait_for_line("driver@")
        return process

    return drive


def test_a_driver_that_is_killed_leaves_a_robot_that_stands_and_obeys_the_next_one(
    robot: Robot, drive: Callable[[Robot], Process]
) -> None:
    for _ in range(2):
        drive(robot).kill()
        robot.stands()


def test_what_is_no_node_keeps_the_robots_own_watchdog(
    verb: Verb, town: Wire, robot: Robot
) -> None:
    """`topic pub --once` and a plain `zenoh put` are gone as soon as they have spoken."""
    forward = ("topic", "pub", f"{robot.name}/cmd_vel", "linear: {x: 0.4}", "--once")
    done = in_time(lambda: verb(town, *forward))
    assert done.returncode == 0, done.stderr
    robot.odom.next(lambda odom: moves(odom, 0.4, 0, 0))
    robot.pass_time(1.0)
    assert moves(robot.newest(), 0.4, 0, 0)


def test_a_foreign_node_that_is_killed_stops_no_robot(
    robots: dict[str, Robot], drive: Callable[[Robot], Process]
) -> None:
    other, robot = robots.values()
    other.resume()
    robot.resume()
    graph = robot.bus.graph()
    process = drive(other)
    with drive(robot):
        odoms, source = robot.odom.from_now(), other.status().obeyed
        process.kill()
        wait_for(
            lambda: source in [node.source for node in graph.left()],
            what="the foreign node to leave",
        )
        other.stands()
        robot.pass_time(0.3)
        assert all(moves(odom, 0.4, 0, 0) for odom in odoms.messages())


def test_so_does_the_controller_stop_when_it_is_killed(
    town: Wire, robots: dict[str, Robot]
) -> None:
    slow = robots["Slow"]
    slow.resume()
    town.start("pose-service").wait_for_line("goals")
    controller = town.start("controller", "Slow", "--laps", "0")
    slow.odom.next(lambda odom: max(map(abs, speeds(odom))) > 0.2)
    controller.kill()
    slow.stands()
