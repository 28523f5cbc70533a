"""No process is held up by output that is not read."""

import fcntl
import os
import pty
import select
import termios
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import Odometry, Point
from holozen.messages import rcl_interfaces as r
from holozen.testing import Wire, wait_for

from .conftest import start_sim
from .robots import Robot, rests

SMALL = 4096  # bytes that a pipe takes; the kernel's least
SOON = 10.0  # s; a process that waits for its reader waits for ever


@pytest.fixture
def unread() -> Iterator[int]:
    """A pipe that is never read, as small as it can be."""
    ends = os.pipe()
    fcntl.fcntl(ends[1], fcntl.F_SETPIPE_SZ, SMALL)
    yield ends[1]
    for end in ends:
        os.close(end)


@pytest.fixture
def held() -> Iterator[int]:
    """A terminal after Ctrl-S."""
    keyboard, screen = pty.openpty()
    termios.tcflow(screen, termios.TCOOFF)
    yield screen
    os.close(screen)
    os.close(keyboard)


def is_full(output: int) -> bool:
    return not select.select([], [output], [], 0)[1]


def chatter(bus: Bus, node: str, name: str, low: float) -> Callable[[], None]:
    """Each call sets a parameter to another value, of which `node` writes a line."""
    values = count()

    def speak() -> None:
        value = r.Parameter(name, r.ParameterValue.of(low + next(values) % 2))
        assert bus.call(
            f"{node}/set_parameters", r.SetParametersRequest([value]), r.SetParametersReply
        )

    return speak


def fill(speak: Callable[[], None], output: int) -> None:
    """Have a process write until there is no room, and many lines more."""

    def full() -> bool:
        speak()
        return is_full(output)

    wait_for(full, 60, "the output to be full")
    for _ in range(120):
        speak()


def test_a_sim_goes_on_and_ends_where_ctrl_s_holds_its_terminal(wire: Wire, held: int) -> None:
    sim = wire.start("sim", stderr=held, stdout=held)
    robot = Robot(wire.bus())
    speak = chatter(robot.bus, "sim", "max_linear", 3.0)
    for _ in range(10):
        speak()
    robot.newest()
    assert sim.terminate(SOON) == 0


def looks(yaw: float, odom: Odometry) -> bool:
    return abs(odom.pose.pose.orientation.yaw() - yaw) < 0.1


def test_a_controller_drives_lap_after_lap_with_its_output_unread(
    wire: Wire, unread: int, tmp_path: Path
) -> None:
    os.write(unread, bytes(SMALL))
    start_sim(wire, "--rtf", "8")
    (tmp_path / "goals.txt").write_text("0 0 0.5\n0 0 0\n")
    wire.start("pose-service", "--goals", str(tmp_path / "goals.txt"))
    controller = wire.start("controller", "--laps", "0", stdout=unread)
    robot = Robot(wire.bus())
    for goal in (0.5, 0.0, 0.5):
        robot.odom.next(partial(looks, goal))
    assert controller.terminate(SOON) == 0


def test_all_of_up_goes_on_and_ends_with_its_output_unread(wire: Wire, unread: int) -> None:
    """Its services write to it themselves."""
    up = wire.start("up", stdout=unread, stderr=unread)
    robot = Robot(wire.bus())
    robot.commands.next()
    fill(chatter(robot.bus, "sim", "max_linear", 3.0), unread)
    fill(chatter(robot.bus, "pose_service", "size", 1.0), unread)
    fill(chatter(robot.bus, "controller", "max_speed", 0.4), unread)
    robot.odom.next(lambda odom: not rests(odom))
    robot.commands.next()
    assert up.terminate(SOON) == 0


def test_a_line_that_waits_for_its_reader_ends_with_a_signal(wire: Wire, unread: int) -> None:
    wire.start("sim")
    os.write(unread, bytes(SMALL))
    hz = wire.start("topic", "hz", "odom", "--json", stdout=unread)
    wait_for(lambda: "pipe" in Path(f"/proc/{hz.pid}/wchan").read_text(), 30)
    assert hz.terminate(SOON) == 0


LOGS = """
import rclpy
from geometry_msgs.msg import Point
from rclpy.executors import ExternalShutdownException

rclpy.init()
node = rclpy.create_node("talker")
lines = node.create_publisher(Point, "lines", 1)
count = 0

def speak():
    global count
    node.get_logger().info(200 * "x")
    count += 1
    lines.publish(Point(x=float(count)))

node.create_timer(0.001, speak)
try:
    rclpy.spin(node)
except ExternalShutdownException:
    pass
"""


def test_a_script_whose_log_is_unread_goes_on_and_ends_with_a_signal(
    wire: Wire, unread: int, tmp_path: Path
) -> None:
    script = tmp_path / "talker.py"
    script.write_text(LOGS)
    lines = wire.bus().subscribe("lines", Point)
    run = wire.start("run", str(script), stderr=unread)

    def has_logged_more_than_anything_holds() -> bool:
        received = lines.try_recv()
        return received is not None and received.message is not None and received.message.x > 600

    wait_for(has_logged_more_than_anything_holds, 60)
    assert is_full(unread)
    assert run.terminate(2 * SOON) == 0
