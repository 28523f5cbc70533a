"""Ctrl-Z suspends a launch and `holozen up` with all that they have started, so that no robot is
driven on.
"""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Terminal, Wire, wait_for
from holozen.testing.wire import command

from .conftest import start_sim
from .processes import parts_at, state_of
from .robots import Robot, moves, rests

CTRL_Z = "\x1a"
LAUNCH = """
from launch import LaunchDescription
from launch.actions import ExecuteProcess

def generate_launch_description():
    return LaunchDescription([ExecuteProcess(cmd={words})])
"""
DRIVER = """
import os, pathlib, sys, time
from holozen.bus import Bus
from holozen.transport.connection import Connection
from holozen.messages import Twist
with Bus("driver", Connection(connect=(sys.argv[1],), listen=())) as bus:
    pathlib.Path(sys.argv[2]).write_text(str(os.getpid()))
    commands = bus.publisher("cmd_vel", Twist)
    while True:
        commands.put(Twist.planar(0.4))
        time.sleep(0.02)
"""


@pytest.fixture
def shell() -> Iterator[Terminal]:
    with Terminal(["bash", "--norc", "-i"], env={"PS1": "$ "}) as shell:
        shell.wait_for_text("$")
        yield shell
        shell.hang_up()


def test_a_suspended_launch_drives_no_robot_and_goes_on_with_its_job(
    wire: Wire, shell: Terminal, tmp_path: Path
) -> None:
    start_sim(wire)
    robot = Robot(wire.bus())
    driver, file, pid = tmp_path / "driver.py", tmp_path / "drive.launch.py", tmp_path / "pid"
    driver.write_text(DRIVER)
    file.write_text(LAUNCH.format(words=[sys.executable, str(driver), wire.endpoint, str(pid)]))
    shell.type(" ".join(command("launch", str(file), *wire.flags)) + "\r")
    robot.odom.next(lambda odom: moves(odom, 0.4, 0, 0))
    driving = int(pid.read_text())

    def suspend() -> None:
        # a driver that a busy machine holds up lets its robot stand too
        shell.type(CTRL_Z)
        wait_for(lambda: state_of(driving) == "T", what="the driver to be suspended")
        robot.pass_time(0.5)  # its last command may still be on its way, and counts for so long
        robot.odom.next(rests)

    suspend()
    odoms = robot.odom.from_now()
    robot.pass_time(1.0)
    assert all(map(rests, odoms.messages()))
    shell.type("fg\r")
    robot.odom.next(lambda odom: moves(odom, 0.4, 0, 0))
    suspend()
    shell.type("kill -9 %1\r")
    wait_for(lambda: state_of(driving) == "Z", what="the end of what a killed launch had started")
    assert rests(robot.newest())


def test_ctrl_z_and_a_signal_to_up_alone_suspend_all_of_it_and_killed_then_it_leaves_none(
    wire: Wire, shell: Terminal
) -> None:
    shell.type(" ".join(command("up", *wire.flags)) + "\r")
    robot = Robot(wire.bus())
    robot.odom.next(lambda odom: not rests(odom))
    shell.wait_for_text("controller@")
    parts = parts_at(wire)
    assert {"up", "sim", "pose-service", "controller", "teleop"} <= set(parts)
    shell.type(CTRL_Z)
    wait_for(
        lambda: {state_of(pid) for pid in parts.values()} == {"T"}, what="all parts to be suspended"
    )
    shell.type("fg\r")
    wait_for(
        lambda: "T" not in {state_of(pid) for pid in parts.values()}, what="all parts to go on"
    )
    shell.wait_for_text("controller@")
    os.kill(parts["up"], signal.SIGTSTP)
    wait_for(
        lambda: {state_of(pid) for pid in parts.values()} == {"T"}, what="all parts to be suspended"
    )
    os.kill(parts["up"], signal.SIGKILL)
    wait_for(lambda: parts_at(wire) == {}, what="the end of what a killed `up` had started")
