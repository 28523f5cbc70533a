"""The `zenoh` command of PyPI's zenoh-cli, which knows nothing of us, reads and drives the
robot.
"""

import json
import os
import sys
from pathlib import Path

import pytest

from holozen.messages import Header, Odometry, Time, Twist
from holozen.testing import Process, Wire, wait_for

from .robots import Robot, moves, time_of

ZENOH = str(Path(sys.executable).with_name("zenoh"))


def zenoh(wire: Wire, *words: str) -> Process:
    """The command as docs/wire.md has it, without its shout into the network while it looks for a
    router.
    """
    quiet = ("--cfg", "scouting/multicast/enabled:false")
    return Process(
        [ZENOH, "--mode", "client", "--connect", wire.endpoint, *quiet, *words],
        env={"PYTHONUNBUFFERED": "1"},
    )


@pytest.fixture(autouse=True)
def installed() -> None:
    if not os.path.exists(ZENOH):
        pytest.skip("needs zenoh-cli; run: scripts/venv requirements-dev.lock")


def test_it_puts_commands(town: Wire, robot: Robot) -> None:
    odoms = robot.odom.from_now()

    def moved() -> bool:
        """False where a busy machine held the one command up."""
        with zenoh(town, "put", "-k", "cmd_vel", "-v", '{"linear":{"x":0.3}}') as process:
            assert process.wait() == 0
        robot.pass_time(0.1)
        return any(moves(odom, 0.3, 0, 0) for odom in odoms.messages())

    wait_for(moved)
    robot.stands()


def test_it_gets_the_last_odom(town: Wire, robot: Robot) -> None:
    before = time_of(robot.newest())
    with zenoh(town, "get", "-s", "odom", "--decoder", "json") as process:
        assert process.wait() == 0
    shown = process.out[process.out.index("{") : process.out.rindex("}") + 1]
    stamp = json.loads(shown)["header"]["stamp"]
    assert stamp["sec"] + stamp["nanosec"] * 1e-9 >= before


def test_its_plugin_shows_any_wire_on_one_readable_line(wire: Wire) -> None:
    publishers = [
        wire.bus("sim", wire=form).publisher(f"{form}/odom", Odometry) for form in ("json", "cdr")
    ]
    message = Odometry(Header(Time(12, 500_000_000), "odom"), "base")
    message.pose.pose.position.x, message.twist.twist = 1.25, Twist.planar(x=0.3)
    with zenoh(
        wire, "subscribe", "-k", "*/odom", "--decoder", "holozen", "--line", "{key} {value}"
    ) as process:

        def shown() -> bool:
            for publisher in publishers:
                publisher.put(message)
            return all(f"{publisher.key} " in process.out for publisher in publishers)

        wait_for(shown)
        lines = [process.wait_for_line(f"{publisher.key} ") for publisher in publishers]
    for part in (
        "header.stamp=12.500000000",
        "pose.pose.position=(1.25, 0, 0)",
        "twist.twist.linear=(0.3, 0, 0)",
    ):
        assert all(part in line for line in lines), lines
    assert process.err == ""


def test_its_plugin_shows_replies(wire: Wire) -> None:
    wire.start("pose-service", "--wire", "cdr").wait_for_line("goals")

    def asked() -> str:
        with zenoh(
            wire, "get", "-s", "next_goal?request_goal=1", "--decoder", "holozen"
        ) as process:
            process.wait()
        return process.out

    assert wait_for(asked).startswith("x_goal=1 y_goal=1 theta_goal=3.14159 end_of_list=0")
