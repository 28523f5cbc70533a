"""A robot without commands stands: the sim needs no final stop for it."""

import signal

import pytest

from holozen.messages import Odometry
from holozen.testing import Process, Terminal, Wire, wait_for

from .conftest import start_sim
from .processes import state_of
from .robots import Robot, distance, moves, place, planar, rests, speeds, time_of

SILENCE = 0.5  # s; the promise
STEP = 1 / 240  # s
ODOM = 0.02  # s between two odoms
CATCH_UP = 0.1  # s; the sim may be behind the clock by this much, and then makes up for it
LONGEST = SILENCE + CATCH_UP + ODOM + 2 * STEP


@pytest.mark.alone
def test_one_command_moves_the_robot_for_half_a_second(robot: Robot) -> None:

    def times() -> list[float]:
        """When it moved; never, where a busy machine made the command too old."""
        odoms = robot.odom.from_now()
        robot.put(0.4)
        robot.pass_time(0.2)
        robot.stands()
        return [time_of(odom) for odom in odoms.messages() if speeds(odom)[0] > 0.3]

    moving = wait_for(times)
    run = moving[-1] - next(t for t in moving if all(moved(robot, t, moving[-1])))
    assert SILENCE - 3 * ODOM < run < LONGEST


def moved(robot: Robot, begin: float, end: float) -> list[bool]:
    """Whether the robot moved at each odom of a span of time."""
    return [not rests(odom) for odom in robot.odom.messages() if begin <= time_of(odom) <= end]


def test_a_teleop_that_hangs_while_driving_leaves_a_robot_that_stands(
    town: Wire, robot: Robot
) -> None:
    """One that is killed: tests/terminals/test_ways_to_die.py."""
    with drives_fast(town, robot, "--mode", "latch") as terminal:
        terminal.process.signal(signal.SIGSTOP)
        wait_for(lambda: state_of(terminal.process.pid) == "T")
        last = robot.newest()  # no command has left the teleop since before this one
        stood = robot.stands()
        assert distance(last, stood) <= 2.0 * LONGEST
        assert any(planar(robot.commands.messages()[-1])), "no stop was commanded"


def test_a_teleop_that_wakes_up_after_its_key_timeout_does_not_drive_on(
    town: Wire, robot: Robot
) -> None:
    with drives_fast(town, robot, "--key-timeout", "0.4") as terminal:
        terminal.process.signal(signal.SIGSTOP)
        stood = robot.stands()
        terminal.process.signal(signal.SIGCONT)
        terminal.wait_for_text("silent")
        assert distance(stood, robot.pass_time(0.2)) < 1e-3


def drives_fast(town: Wire, robot: Robot, *flags: str) -> Terminal:
    terminal = town.terminal("teleop", "--speed", "2", *flags)
    terminal.wait_for_text("listening")
    robot.knows("teleop")
    terminal.hold_until("i", lambda: moves(robot.newest(), 2, 0, 0))
    return terminal


def test_a_robot_in_silence_stays_where_it_is(robot: Robot) -> None:
    robot.drive(0.3, 0.2, 0.5)
    stood = robot.stands()
    later: Odometry = robot.pass_time(1.0)
    assert place(later) == pytest.approx(place(stood), abs=1e-6)


def test_a_sim_that_hung_drops_the_commands_that_waited(sim: Process, robot: Robot) -> None:
    """They are of unknown age: the sender may have let go since."""
    before = robot.status().refused.get("old", 0)

    def dropped() -> bool:
        """False where a busy machine made more of it than a link's lease: then nothing
        waits any more.
        """
        sim.signal(signal.SIGSTOP)
        wait_for(lambda: state_of(sim.pid) == "T")
        stood = robot.odom.messages()[-1]
        put_for(robot, SILENCE + 0.2)
        sim.signal(signal.SIGCONT)
        assert distance(stood, robot.pass_time(0.3)) < 1e-3
        status = robot.status()
        if status.refused.get("old", 0) == before:
            return False
        assert status.last_refusal.partition(": ")[2].startswith("old: ")
        return True

    wait_for(dropped, 60)
    robot.drive(0.3)


def test_a_sim_that_hung_longer_than_a_lease_comes_back(wire: Wire) -> None:
    """The other side gives the link up; it is made again. On one machine a lease has ten seconds,
    here one.
    """
    sim = start_sim(wire, "--cfg", "transport/link/tx/lease:1000")
    robot = Robot(wire.bus())
    stood = robot.stands()
    sim.signal(signal.SIGSTOP)

    def is_given_up() -> bool:
        robot.put(1.0)
        return not robot.bus.connected()

    wait_for(is_given_up, what="the link to be given up")
    sim.signal(signal.SIGCONT)
    wait_for(robot.bus.connected, what="the link")
    assert distance(stood, robot.pass_time(0.3)) < 1e-3
    robot.drive(0.3)


def put_for(robot: Robot, seconds: float) -> None:
    """Command the robot at 20 Hz for a while."""
    import threading

    pause = threading.Event()
    for _ in range(round(seconds / 0.05)):
        robot.put(1.0)
        pause.wait(0.05)
