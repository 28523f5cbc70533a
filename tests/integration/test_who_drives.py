"""A person beats a script beats the autopilot, and no overruled source takes the robot back by
itself.
"""

from collections.abc import Callable

import pytest

from holozen.messages import CommandStatus, Twist
from holozen.testing import Process, Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.wire import PRIORITY_OF

from .conftest import Verb
from .robots import Robot, moves, rests

PERSON, SCRIPT, AUTOPILOT = "INTERACTIVE_HIGH", "DATA", "DATA_LOW"

Hand = Callable[[float], None]


def hand(wire: Wire, node: str, priority: str) -> Hand:
    """A source that commands forward speeds."""
    publisher = wire.bus(node).publisher("cmd_vel", Twist, priority)
    return lambda x: publisher.put(Twist.planar(x))


@pytest.fixture(scope="module")
def person(town: Wire, sim: Process) -> Hand:
    return hand(town, "person", PERSON)


@pytest.fixture(scope="module")
def script(town: Wire, sim: Process) -> Hand:
    return hand(town, "script", SCRIPT)


@pytest.fixture(scope="module")
def autopilot(town: Wire, sim: Process) -> Hand:
    return hand(town, "autopilot", AUTOPILOT)


def drive(
    robot: Robot, hand: Hand, x: float, *others: tuple[Hand, float], obeyed: str = ""
) -> CommandStatus:
    """Command until the robot goes at `x` and its status names the source `obeyed`, while the
    others want something else all the time. The status.
    """

    def going() -> CommandStatus | None:
        for other, speed in others:
            other(speed)
        hand(x)
        goes, status = moves(robot.newest(), x, 0, 0), robot.last_status()
        return status if goes and status.obeyed.startswith(obeyed) else None

    status = wait_for(going, what=lambda: f"the robot to go at {x}: {robot.status()}")
    assert status
    return status


def refused(robot: Robot, hand: Hand, reason: str) -> CommandStatus:
    """Command until the sim reports a command refused for this reason."""
    before = robot.status().refused.get(reason, 0)

    def counted() -> CommandStatus | None:
        hand(0.9)
        return status if (status := robot.status()).refused.get(reason, 0) > before else None

    status = wait_for(counted, what=lambda: f"{reason} in {robot.status().refused}")
    assert status
    return status


def test_teleop_controller_and_plain_put_have_these_priorities() -> None:
    assert PRIORITY_OF == {"teleop": PERSON, "view": PERSON, "controller": AUTOPILOT}


def test_a_person_overrules_a_script_and_a_script_the_autopilot(
    robot: Robot, person: Hand, script: Hand, autopilot: Hand
) -> None:
    drive(robot, autopilot, 0.1, obeyed="autopilot@")
    drive(robot, script, 0.2, (autopilot, 0.1), obeyed="script@")
    status = drive(robot, person, 0.3, (autopilot, 0.1), (script, 0.2), obeyed="person@")
    assert (status.priority, status.held) == (PERSON, True)


def test_when_the_person_falls_silent_the_robot_stands_until_resume(
    robot: Robot, person: Hand, script: Hand
) -> None:
    drive(robot, script, 0.1)
    drive(robot, person, 0.3, (script, 0.1))

    def stands() -> bool:
        script(0.1)
        return rests(robot.newest())

    wait_for(stands)
    status = refused(robot, script, "held")
    assert status.obeyed == ""
    assert rests(robot.newest())
    assert robot.resume() == "every source may drive"
    drive(robot, script, 0.1)


@pytest.mark.usefixtures("patient")
def test_resume_is_refused_while_a_person_drives_and_granted_at_once_after_a_stop(
    robot: Robot, person: Hand, autopilot: Hand
) -> None:
    drive(robot, person, 0.3)
    with pytest.raises(ServiceError, match=r"person@.* drives; stop it first"):
        robot.resume()
    drive(robot, person, 0.3)
    drive(robot, person, 0.0)
    assert robot.resume()
    drive(robot, autopilot, 0.1)


def test_controller_resume_reports_the_sims_reply(
    verb: Verb, town: Wire, robot: Robot, person: Hand
) -> None:
    drive(robot, person, 0.3)
    robot.stands()
    done = verb(town, "controller", "--resume")
    assert (done.returncode, done.stderr) == (0, "every source may drive\n")
    assert not robot.status().held
