"""A slow consumer cannot delay control."""

import json
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Process, Wire, wait_for

from .conftest import deaf, start_sim
from .robots import Part, Robot, moves, sent_at, time_of

pytestmark = pytest.mark.alone

AT_ONCE = 2.0  # s; a publisher that waits for a slow reader waits 5


@pytest.fixture
def fast_robot(wire: Wire) -> Robot:
    """A robot whose sim goes as fast as it can, and so publishes as much as it can."""
    start_sim(wire, "--rtf", "0")
    return Robot(wire.bus())


def held_back(wire: Wire) -> int:
    """Bytes that wait in that socket of the sim in which the most do."""
    rows = [row.split() for row in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    here = f"0100007F:{wire.port:04X}"
    return max(
        int(waiting.partition(":")[0], 16) for _, local, _, _, waiting, *_ in rows if local == here
    )


@pytest.fixture
def slow(wire: Wire, fast_robot: Robot) -> Iterator[Process]:
    """A subscriber of odom, tf and joint_states that was sent more than it and the system's buffers
    can hold.
    """
    with deaf(wire, "**") as process:

        def full() -> bool:
            before, end = held_back(wire), time_of(fast_robot.newest()) + 2
            while time_of(fast_robot.odom.next(within=AT_ONCE)) < end:
                pass
            return 100_000 < before == held_back(wire)

        wait_for(full, 120, lambda: f"full buffers; {held_back(wire)} bytes wait")
        yield process


def test_commands_and_odom_go_through(fast_robot: Robot, slow: Process) -> None:
    for speed in (0.5, -0.5, 0.3):
        fast_robot.drive(speed)
    assert slow.returncode is None


TEN = """
import json, sys, time, zenoh
config = zenoh.Config()
for path, value in (("mode", '"client"'), ("connect/endpoints", sys.argv[1]), ("scouting/multicast/enabled", "false")):
    config.insert_json5(path, value)
sessions = [zenoh.open(config) for _ in range(10)]
subscribers = [session.declare_subscriber("**") for session in sessions]  # queues that block when they are full
print("ten", flush=True)
time.sleep(3600)
"""  # noqa: E501
COMMANDS = 200


def test_ten_frozen_readers_do_not_make_commands_older(wire: Wire) -> None:
    """The age of a command: from its sending to the sending of the first odom that shows it."""
    start_sim(wire)
    assert wire.run("param", "set", "sim", "odometry_rate", "240").returncode == 0
    robot = Robot(wire.bus())
    alone = ages(robot)
    with Process([sys.executable, "-c", TEN, json.dumps([wire.endpoint])]) as ten:
        ten.wait_for_line("ten")
        ten.signal(signal.SIGSTOP)
        wait_for(
            lambda: held_back(wire) > 100_000,
            120,
            lambda: f"full windows; {held_back(wire)} bytes wait",
        )
        beside = ages(robot)
        assert ten.returncode is None
    print(
        f"age of a command, 99th percentile: {1000 * alone:.1f} ms alone, {1000 * beside:.1f} ms "
        "beside ten readers"
    )
    assert beside < max(0.05, 3 * alone)


def ages(robot: Robot) -> float:
    """The 99th percentile of the ages of commands, in s."""
    found = []
    for number in range(COMMANDS):
        speed = 0.2 + 0.1 * (number % 2)
        part, sent = robot.odom.from_now(), time.monotonic()
        robot.put(speed)

        def seen(part: Part = part, speed: float = speed) -> float:
            return next(
                (
                    sent_at(each)
                    for each in part.all()
                    if each.message and moves(each.message, speed, 0, 0)
                ),
                0.0,
            )

        found.append(wait_for(seen, 20, "a command to be obeyed") - sent)
    return sorted(found)[round(0.99 * COMMANDS) - 1]
