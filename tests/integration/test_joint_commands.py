"""The homework: every joint of the rover moves on joint_command, a person comes first, and silence
holds still.
"""

import time
from collections.abc import Callable
from functools import partial

import pytest

from holozen import entities
from holozen.messages import Header, JointState, Time, TriggerReply, TriggerRequest
from holozen.testing import Wire, wait_for
from holozen.transport.pubsub import Publisher

from .conftest import SPAWN, Verb, comes_to
from .robots import URDF, Record, Robot, place, record, speeds

JOINTS = ["jFL", "jFR", "jBL", "jBR"]
RADIUS = 0.05
HELD = 1e-2  # rad; what turns by less than 1e-3 rad/s is still


class Rover:
    """The rover and all that is heard of its joints."""

    def __init__(self, wire: Wire) -> None:
        bus = wire.bus("script")
        self.robot = Robot(bus)
        self.states: Record = record(bus, "joint_states", JointState)
        self.commands: Publisher[JointState] = bus.publisher("joint_command", JointState, "DATA")
        self.person = Robot(wire.bus("person"), priority="INTERACTIVE_HIGH")

    def newest(self) -> tuple[dict[str, float], dict[str, float]]:
        """Positions and rates published after this call."""
        state = self.states.next()
        return dict(zip(state.name, state.position, strict=True)), dict(
            zip(state.name, state.velocity, strict=True)
        )

    def rates(self) -> dict[str, float]:
        return self.newest()[1]

    def is_at(self, joint: str, position: float) -> bool:
        return self.newest()[0][joint] == pytest.approx(position, abs=0.02)

    def command(self, until: Callable[[], object], **values: dict[str, float]) -> None:
        """Send it again and again until something is true: command(..., velocity={"jFL": 1.0})."""
        (joints,) = values.values()
        message = JointState(name=list(joints))
        for kind, reported in values.items():
            setattr(message, kind, list(reported.values()))

        def look() -> bool:
            self.commands.put(message)
            return bool(until())

        wait_for(look, 20, lambda: f"{values} to be done; {self.robot.last_status()}")

    def still(self) -> dict[str, float]:
        """Wait until all joints are; their positions."""
        wait_for(lambda: max(map(abs, self.rates().values())) < 1e-3, what="the joints to be still")
        return self.newest()[0]


@pytest.fixture(scope="module")
def made(town: Wire) -> Rover:
    town.start("sim", "--robot", str(URDF / "rover.urdf.xacro"), "--rtf", "4").wait_for_line(
        "listens on"
    )
    return Rover(town)


@pytest.fixture
def rover(made: Rover) -> Rover:
    """It stands, and its former drivers are forgotten."""
    made.still()
    made.robot.status_when(lambda status: not status.obeyed)
    made.robot.resume()
    return made


def test_each_joint_goes_to_its_commanded_position(rover: Rover) -> None:
    for joint in JOINTS:
        goal = rover.newest()[0][joint] + 1.0
        rover.command(partial(rover.is_at, joint, goal), position={joint: goal})


def test_all_wheels_alike_drive_the_robot(rover: Rover) -> None:
    rover.command(
        lambda: speeds(rover.robot.newest())[0] == pytest.approx(0.2, abs=0.01),
        velocity=dict.fromkeys(JOINTS, 4.0),
    )


def test_after_a_silence_the_joints_hold_still(rover: Rover) -> None:
    begin = rover.newest()[0]["jFL"]
    rover.command(
        lambda: abs(rover.newest()[0]["jFL"] - begin) > 1, velocity=dict.fromkeys(JOINTS, 2.0)
    )
    rover.robot.status_when(lambda status: not status.obeyed)
    held = rover.still()
    rover.robot.pass_time(1.0)
    assert rover.newest()[0] == pytest.approx(held, abs=HELD)


def test_a_command_with_an_old_stamp_moves_no_joint(rover: Rover) -> None:
    held, refused = rover.still(), rover.robot.last_status().refused.get("stale", 0)
    old = JointState(Header(Time.of(time.time() - 1.0)), ["jFL"], velocity=[2.0])

    def is_refused() -> bool:
        rover.commands.put(old)
        return rover.robot.last_status().refused.get("stale", 0) > refused + 3

    wait_for(is_refused, what="the commands to be refused as stale")
    assert rover.newest()[0] == pytest.approx(held, abs=HELD)


def test_a_person_takes_the_wheels_from_a_script(rover: Rover) -> None:
    back = {"velocity": dict.fromkeys(JOINTS, -4.0)}
    rover.command(lambda: speeds(rover.robot.newest())[0] < -0.15, **back)

    def person_drives() -> bool:
        rover.person.put(0.5)
        status = rover.robot.last_status()
        return (
            speeds(rover.robot.newest())[0] == pytest.approx(0.5, abs=0.02)
            and rover.rates() == pytest.approx(dict.fromkeys(JOINTS, 0.5 / RADIUS), abs=0.5)
            and status.obeyed.startswith("person")
            and any(reason.startswith("overruled") for reason in status.refused)
        )

    rover.command(person_drives, **back)


def test_a_twist_drives_again_after_joint_commands(rover: Rover) -> None:
    rover.command(lambda: rover.rates()["jFL"] > 1, effort={"jFL": 1.0})
    rover.robot.status_when(lambda status: not status.obeyed)
    start = place(rover.robot.newest())
    rover.robot.drive(0.5, until=lambda odom: speeds(odom)[0] > 0.48)
    assert place(rover.robot.newest()) != start


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (JointState(name=["jXX"], velocity=[1.0]), "no joint 'jXX'"),
        (
            JointState(name=["jFL"], velocity=[1.0, 2.0]),
            "name has length 1, velocity has 2; give each joint one value",
        ),
        (
            JointState(name=["jFL"], velocity=[1.0], effort=[1.0]),
            "give one of position, velocity and effort",
        ),
    ],
    ids=["unknown", "uneven", "both"],
)
def test_a_wrong_command_moves_nothing_and_is_reported(
    rover: Rover, message: JointState, expected: str
) -> None:
    held = rover.still()

    def refused() -> bool:
        rover.commands.put(message)
        return expected in rover.robot.status().last_refusal

    wait_for(refused, what=f"a refusal with {expected!r}")
    assert rover.newest()[0] == pytest.approx(held, abs=HELD)


def test_pub_reports_why_a_joint_command_moves_nothing(
    verb: Verb, rover: Rover, town: Wire
) -> None:
    expected = "not obeyed: there is no joint 'jXX'; the joints are jBL, jBR, jFL, jFR"
    wrong = ("joint_command", "{name: [jXX], velocity: [1]}")
    for often in (("-t", "10", "-r", "20"), ("--once",)):

        def reported(often: tuple[str, ...] = often) -> tuple[int, list[str]]:
            """Something else where a busy machine made a command too late."""
            done = verb(town, "topic", "pub", *wrong, *often)
            return done.returncode, done.stderr.splitlines()[1:]

        comes_to((1, [expected]), reported)


def test_pub_reports_nothing_of_a_joint_command_that_is_obeyed(
    verb: Verb, rover: Rover, town: Wire
) -> None:
    def reported() -> tuple[int, list[str]]:
        """Something where a busy machine made a command too late."""
        command = ("joint_command", "{name: [jFL], velocity: [1]}")
        done = verb(town, "topic", "pub", *command, "-t", "10", "-r", "100")
        return done.returncode, [line for line in done.stderr.splitlines() if "obeyed" in line]

    comes_to((0, []), reported)


def test_pub_reports_that_a_stopped_robot_does_not_move_its_joints(
    verb: Verb, rover: Rover, town: Wire
) -> None:
    bus = rover.robot.bus
    bus.call("stop", TriggerRequest(), TriggerReply)
    try:
        done = verb(town, "topic", "pub", "joint_command", "{name: [jFL], velocity: [1]}", "--once")
    finally:
        bus.call("release", TriggerRequest(), TriggerReply)
    assert (done.returncode, "not obeyed: the robot is stopped by" in done.stderr) == (1, True)


def test_the_wheels_of_what_balances_take_no_commands(verb: Verb, rover: Rover, town: Wire) -> None:
    bus = town.bus()
    assert (
        verb(town, *SPAWN, str(URDF / "wheely_boi.xacro"), "--name", "Fred", "-y", "5").returncode
        == 0
    )
    fred, commands = Robot(bus, "Fred"), bus.publisher("Fred/joint_command", JointState)

    def refused() -> bool:
        commands.put(JointState(name=["jointL"], effort=[1.0]))
        return "follows the drive" in fred.status().last_refusal

    wait_for(refused, what="a refusal")
    entities.delete(bus, "Fred")
