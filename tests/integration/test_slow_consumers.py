"""A slow consumer cannot delay control."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Process, Wire, wait_for

from .conftest import deaf, start_sim
from .robots import Robot, time_of

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
    return max(int(waiting.partition(":")[0], 16) for _, local, _, _, waiting, *_ in rows if local == here)


@pytest.fixture
def slow(wire: Wire, fast_robot: Robot) -> Iterator[Process]:
    """A subscriber of odom, tf and joint_states that was sent more than it and the system's buffers can hold."""
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


def test_a_slow_reader_gets_the_newest(wire: Wire, fast_robot: Robot) -> None:
    """Its queue is a ring: what it missed is gone, and what it reads is now."""
    slow = fast_robot.bus.subscribe("odom", type(fast_robot.newest()), depth=1)
    begin = time_of(fast_robot.newest())
    fast_robot.odom.next(lambda odom: time_of(odom) > begin + 20)
    before = time_of(fast_robot.odom.messages()[-1])
    received = slow.try_recv()
    assert received is not None and received.message is not None
    assert time_of(received.message) >= before - 1
