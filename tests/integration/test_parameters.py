"""Parameters of real services take effect at once, and never make a robot jump."""

import itertools
import math
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import NextGoalReply, NextGoalRequest, Odometry, Twist
from holozen.messages import rcl_interfaces as r
from holozen.testing import LockStep, Process, Wire, wait_for
from holozen.transport.pubsub import Received, Subscription

from .conftest import SPAWN, Verb
from .robots import Robot, moves, rests, sent_at, time_of

DEFAULTS = {
    "max_linear": 5.0,
    "max_angular": 10.0,
    "real_time_factor": 1.0,
    "command_timeout": 0.5,
    "odometry_rate": 50.0,
}


def put(bus: Bus, node: str, **values: r.Value) -> list[str]:
    """Set parameters; the reasons why not."""
    request = r.SetParametersRequest(
        [r.Parameter(name, r.ParameterValue.of(value)) for name, value in values.items()]
    )
    results = bus.call(f"{node}/set_parameters", request, r.SetParametersReply).results
    return [result.reason for result in results if not result.successful]


@pytest.fixture(autouse=True)
def as_it_was(robot: Robot) -> Iterator[None]:
    """The sim's parameters are the defaults before and after a test."""
    yield
    assert put(robot.bus, "sim", **DEFAULTS) == []


HELD = """
import signal, sys
from holozen import console

def report(text, said=console.report):
    said(text)
    if "listens on" in text:
        signal.pause()  # it goes no further until it is to end

console.report = report
from services.sim.__main__ import main
main(sys.argv[1:])
"""


def test_a_sim_says_that_it_listens_once_its_parameters_can_be_found(wire: Wire) -> None:
    with Process([sys.executable, "-c", HELD, *wire.flags]) as sim:
        sim.wait_for_line("listens on cmd_vel")
        bus = wire.bus()
        wait_for(lambda: "sim/set_parameters" in {end.key for end in bus.endpoints()})


def test_a_lower_limit_applies_at_the_next_command(robot: Robot) -> None:
    robot.drive(x=0.5)
    assert put(robot.bus, "sim", max_linear=0.2) == []
    reason = "over the limits of 0.2 m/s"
    robot.drive(
        x=0.5,
        until=lambda odom: moves(odom, 0.2, 0, 0) and reason in robot.last_status().last_clamped,
    )


def test_a_robot_that_is_not_commanded_stands_whatever_is_set(robot: Robot) -> None:
    robot.drive(x=0.5)
    robot.stop()
    assert (
        put(
            robot.bus,
            "sim",
            command_timeout=2.0,
            max_linear=50.0,
            real_time_factor=2.0,
            odometry_rate=200.0,
        )
        == []
    )
    assert still(robot, 0.5)


def test_a_longer_watchdog_does_not_wake_a_command_that_was_over(robot: Robot) -> None:
    robot.drive(x=0.3)
    robot.stands()  # by silence, after 0.5 s
    assert put(robot.bus, "sim", command_timeout=2.0) == []
    assert still(robot, 0.3)


def still(robot: Robot, seconds: float) -> bool:
    """Whether it rests in all odoms of the next time."""
    odoms = robot.odom.from_now()
    robot.pass_time(seconds)
    return all(map(rests, odoms.messages()))


def test_the_watchdog_can_be_shortened_but_not_switched_off(
    lock_step: Callable[..., LockStep],
) -> None:
    sim = lock_step()
    for value in (0.0, -1.0, 0.04, 3.0):
        reason = f"command_timeout: {value:g}: use a number from 0.05 to 2 s"
        assert put(sim.bus, "sim", command_timeout=value) == [reason]
    assert put(sim.bus, "sim", command_timeout=0.1) == []
    sim.drive(x=0.3)
    assert moves(sim.step(20), 0.3, 0, 0)
    assert rests(sim.step(8)), "0.1 s are 24 steps"


def test_odometry_comes_at_the_rate_that_is_set(robot: Robot) -> None:
    assert put(robot.bus, "sim", odometry_rate=10.0) == []

    def gap() -> float:
        robot.newest()
        first, second = robot.odom.messages()[-2:]
        return time_of(second) - time_of(first)

    wait_for(lambda: gap() == pytest.approx(0.1, abs=0.005))
    assert put(robot.bus, "sim", odometry_rate=100.0) == []
    wait_for(lambda: gap() == pytest.approx(0.01, abs=0.005))


def test_simulated_time_goes_at_the_pace_that_is_set(robot: Robot) -> None:
    assert put(robot.bus, "sim", real_time_factor=0.1) == []
    odoms = robot.odom.from_now()
    wait_for(lambda: len(odoms.all()) > 3)
    _, *slow = odoms.all()  # 50 Hz of a tenth of the pace: 0.2 s between two
    assert pace(slow) < 0.5
    assert put(robot.bus, "sim", real_time_factor=0.0) == []
    odoms = robot.odom.from_now()
    wait_for(lambda: len(odoms.all()) > 100 and pace(odoms.all()) > 2)


def pace(odoms: list[Received[Odometry]]) -> float:
    """How fast sim time went while these were sent."""
    first, last = odoms[0], odoms[-1]
    assert first.message and last.message
    return (time_of(last.message) - time_of(first.message)) / (sent_at(last) - sent_at(first))


def test_a_robot_with_a_name_has_its_own(verb: Verb, town: Wire, robot: Robot) -> None:
    assert verb(town, *SPAWN, "urdf/hb_bot.urdf.xacro", "--name", "Fred", "-x", "3").returncode == 0
    try:
        assert put(robot.bus, "sim", **{"Fred.command_timeout": 1.0}) == []
        names = robot.bus.call(
            "sim/list_parameters", r.ListParametersRequest(), r.ListParametersReply
        ).result.names
        assert {"Fred.command_timeout", "Fred.odometry_rate", "command_timeout"} <= set(names)
    finally:
        assert verb(town, "delete", "Fred").returncode == 0
    assert put(robot.bus, "sim", **{"Fred.command_timeout": 1.0}) == [
        "sim has no parameter 'Fred.command_timeout' (did you mean 'command_timeout'?)"
    ]


def messages(commands: Subscription[Twist]) -> list[Twist]:
    """All that wait."""
    return [received.message for received in iter(commands.try_recv, None) if received.message]


def speed(twist: Twist) -> float:
    return math.hypot(twist.linear.x, twist.linear.y)


def test_the_controller_slows_down_at_once_and_by_its_own_acceleration(
    wire: Wire, lock_step: Callable[..., LockStep]
) -> None:
    sim, speeds = lock_step(), [0.0]
    commands = sim.bus.subscribe("cmd_vel", Twist, depth=1000)
    wire.start("pose-service", "--size", "100").wait_for_line("goals")
    controller = wire.start("controller", "--max-speed", "0.6")

    def drive_until(wanted: Callable[[float], bool]) -> None:
        while not wanted(speeds[-1]):
            speeds.extend(map(speed, messages(commands)))  # so that the next one comes of this step
            sim.step(12)  # as long as between two commands
            speeds.extend(map(speed, wait_for(lambda: messages(commands), 30)))

    def slows_down() -> bool:
        """False where it stopped meanwhile, because a busy machine had held its odometry up."""
        waits = controller.err.count("waiting for odom")
        assert put(sim.bus, "controller", max_speed=0.6) == []
        speeds[:] = [0.0]
        drive_until(lambda speed: speed > 0.55)
        assert put(sim.bus, "controller", max_speed=0.2) == []
        drive_until(lambda speed: speed < 0.201)
        if 0.0 not in speeds[1:]:
            return True
        wait_for(lambda: controller.err.count("waiting for odom") > waits, what="why it stopped")
        return False

    wait_for(slows_down, what="a drive in one go")
    # 1 m/s^2, for at most two periods of 0.05 s between two commands
    assert all(before - after <= 0.101 for before, after in itertools.pairwise(speeds))
    assert put(sim.bus, "controller", gain=99) == ["gain: 99: use a number from 0.1 to 10 1/s"]


def test_the_pose_service_hands_out_another_shape_at_once(wire: Wire) -> None:
    wire.start("pose-service").wait_for_line("goals")
    bus = wire.bus()
    assert bus.call("next_goal", NextGoalRequest(0), NextGoalReply).x_goal == 1.0
    assert put(bus, "pose_service", shape="hexagon", size=3.0) == []
    assert bus.call("next_goal", NextGoalRequest(0), NextGoalReply).x_goal == 3.0
    assert bus.call("next_goal", NextGoalRequest(5), NextGoalReply).end_of_list == 1


def test_the_second_of_a_kind_names_the_first_and_a_hung_one_is_named(
    verb: Verb, wire: Wire
) -> None:
    service, node = "pose-service", "pose_service"
    wire.start("sim", "--empty").wait_for_line("no robot yet")  # it knows of a node that hangs
    first = wire.start(service)
    wait_for(lambda: node in verb(wire, "param", "list").stdout)
    second = wire.start(service)
    second.wait_for_line(f"{node}: {node}@")
    assert "does the same already; end one of the two\n" in second.err
    second.terminate()
    second.wait()
    first.signal(signal.SIGSTOP)
    done = verb(wire, "param", "list", node)
    first.signal(signal.SIGCONT)
    assert done.returncode == 1
    assert f"{node}@" in done.stderr
    assert "does not answer: it hangs" in done.stderr


def test_goals_of_a_file_can_only_be_read(wire: Wire, tmp_path: Path) -> None:
    file = tmp_path / "goals.txt"
    file.write_text("1 2 3\n")
    wire.start("pose-service", "--goals", str(file)).wait_for_line("goals")
    assert put(wire.bus(), "pose_service", goals="other.txt") == ["goals: it is read-only"]
