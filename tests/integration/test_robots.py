"""Every robot of urdf/: checked, driven 2 m and turned in lock-step, and compared with the closed
form.

The evidence in docs/ states what stands here. Wheels are turned by motors and the ground does the
rest, so they have bounds of their own.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import pytest

from holozen import entities
from holozen.cli import main
from holozen.messages import JointState, Odometry, Twist
from holozen.robot.files.loading import load
from holozen.robot.model import RobotModel
from holozen.robot.rigid import joint_axes, lowest
from holozen.testing import LockStep, Wire, wait_for
from holozen.wire import COMMAND_SILENCE, key_for

from .robots import URDF, Planar, ahead, place, speeds, time_of

NO_ROBOTS = {"materials.xacro", "wheels.xacro"}
FILES = sorted(path.name for path in URDF.glob("*.xacro") if path.name not in NO_ROBOTS)


@dataclass(frozen=True)
class Stated:
    """What is stated of a robot. Metres, radians, seconds of sim time.

    `way` and `yaw` are how far it is from the closed form after 2 m, and `turn` the part of a
    commanded turn that it makes, at least and at most. `spot` is how far it strays while it turns
    on the spot. `settling` is the time that it takes to come to a speed, `stopping` the way that it
    takes to stop from 0.5 m/s. `odom` is how far odometry is from the truth after all that, in
    metres and in radians, and `speed` how far its velocity is from the commanded one.
    """

    way: float = 1e-3
    yaw: float = 1e-3
    turn: tuple[float, float] = (0.9999, 1.0001)
    spot: float = 1e-3
    settling: float = 0.1
    stopping: float = 1e-3
    odom: tuple[float, float] = (1e-3, 1e-3)
    speed: float = 1e-3
    sideways: bool = False


STATED = {
    "hb_bot.urdf.xacro": Stated(sideways=True),
    "explorer.urdf.xacro": Stated(sideways=True),
    "mecanum.urdf.xacro": Stated(sideways=True),
    "omni.urdf.xacro": Stated(
        way=0.01,
        yaw=0.01,
        turn=(0.99, 1.01),
        spot=5e-3,
        settling=0.5,
        stopping=0.03,
        speed=0.02,
        sideways=True,
    ),
    "mecanum_rollers.urdf.xacro": Stated(
        way=0.02,
        yaw=0.02,
        turn=(0.97, 1.03),
        spot=0.01,
        settling=0.5,
        stopping=0.03,
        odom=(0.1, 0.1),
        speed=0.02,
        sideways=True,
    ),
    "differential.urdf.xacro": Stated(
        way=5e-3,
        yaw=0.015,
        turn=(0.99, 1.01),
        spot=0.04,
        settling=0.5,
        stopping=0.06,
        odom=(0.1, 0.05),
        speed=5e-3,
    ),
    "rover.urdf.xacro": Stated(
        way=5e-3, yaw=0.015, turn=(0.85, 1.01), spot=0.03, settling=0.5, stopping=0.03, speed=5e-3
    ),
    "wheely_boi.xacro": Stated(
        way=0.02, yaw=0.06, turn=(0.98, 1.02), spot=0.02, settling=3.0, stopping=0.25, speed=0.05
    ),
}


SPAN = 48  # steps between two commands: 0.2 s


def spans(seconds: float) -> int:
    return math.ceil(seconds * 240 / SPAN - 1e-9)


@dataclass(frozen=True)
class Forward:
    """Two metres forward at a steady velocity, and a stop."""

    odoms: list[Odometry]
    wheels: dict[str, float]
    """Their rates at the end of the two metres, rad/s."""
    stopped: Odometry


@dataclass(frozen=True)
class Round:
    """A turn by 1 rad/s to the right, some drives and silence, from where it stood to where it
    stands: by odometry, and in the world.
    """

    turn: list[Odometry]
    odom: tuple[Planar, Planar]
    truth: tuple[Planar, Planar]
    stands: Odometry
    later: Odometry


class Driven:
    """A robot of a file in lock-step, which stands on its wheels."""

    def __init__(self, wire: Wire, file: str) -> None:
        self.file, self.model, self.stated = URDF / file, load(URDF / file), STATED[file]
        self.name = file.partition(".")[0]
        self.sim = LockStep(wire, "--robot", f"{self.file}={self.name}", robot=self.name)
        self.joints = self.sim.bus.subscribe(key_for("joint_states", self.name), JointState)
        self.sim.step(240)

    def drive(self, velocity: Planar, seconds: float) -> list[Odometry]:
        """Command for so long at least; the odom after each span."""
        odoms: list[Odometry] = []
        for _ in range(spans(seconds)):
            self.sim.drive(*velocity)
            odoms.append(self.sim.step(SPAN))
        return odoms

    def steady(self, velocity: Planar, seconds: float) -> list[Odometry]:
        """Odoms over so much time at a velocity, after the time that the robot takes to come to
        it.
        """
        start = self.drive(velocity, self.stated.settling)[-1]
        return [start, *self.drive(velocity, seconds)]

    def stop(self) -> Odometry:
        """Command it to stop; the odom that shows that it did."""
        self.sim.drive()
        return self.stands()

    def stands(self) -> Odometry:
        """Let it come to rest; the odom after the time that it takes."""
        odom = self.sim.step(spans(self.stated.settling) * SPAN)
        for _ in range(spans(self.stated.settling)):
            if self.rests(odom):
                return odom
            odom = self.sim.step(SPAN)
        assert self.rests(odom), speeds(odom)
        return odom

    def rests(self, odom: Odometry) -> bool:
        return max(map(abs, speeds(odom))) < max(1e-3, self.stated.speed)

    @cached_property
    def forward(self) -> Forward:
        """One drive, for all tests that look at it."""
        odoms = self.steady((0.5, 0, 0), 4.0)
        states = [state.message for state in iter(self.joints.try_recv, None) if state.message]
        state = [state for state in states if state.header.stamp == odoms[-1].header.stamp][-1]
        return Forward(odoms, dict(zip(state.name, state.velocity, strict=True)), self.stop())

    @cached_property
    def round(self) -> Round:
        """One for all tests that look at it."""
        odom, truth = place(self.sim.odom), self.truth()
        turn = self.steady((0, 0, -1.0), math.pi)
        for velocity in ((-0.3, 0, 0.2), (0.5, 0, 0.5)):
            self.drive(velocity, 1.0)
        self.sim.step(round(COMMAND_SILENCE * 240))
        stands = self.stands()
        return Round(turn, (odom, place(stands)), (truth, self.truth()), stands, self.sim.step(120))

    def truth(self) -> Planar:
        """Where it is in the world."""
        return entities.pose(self.sim.bus, self.name).planar()


@pytest.fixture(scope="module", params=FILES)
def driven(request: pytest.FixtureRequest) -> Iterator[Driven]:
    with Wire() as wire:
        yield Driven(wire, request.param)


def relative(start: Planar, end: Planar) -> Planar:
    """`end` as seen from `start`."""
    x, y, yaw = end[0] - start[0], end[1] - start[1], start[2]
    angle = math.remainder(end[2] - yaw, math.tau)
    return x * math.cos(yaw) + y * math.sin(yaw), y * math.cos(yaw) - x * math.sin(yaw), angle


def turned(odoms: list[Odometry]) -> float:
    """The angle by which a robot turned over odoms, more than once round maybe."""
    yaws = [place(odom)[2] for odom in odoms]
    return sum(math.remainder(after - before, math.tau) for before, after in pairwise(yaws))


def test_every_robot_has_its_bounds_stated() -> None:
    assert set(FILES) == set(STATED)


def test_a_file_is_read_without_a_warning_and_checked_without_a_finding(
    driven: Driven, capsys: pytest.CaptureFixture[str]
) -> None:
    assert driven.model.warnings == ()
    assert main(["check", str(driven.file)]) == 0
    out, err = capsys.readouterr()
    assert (out[:4], out.count("\n"), err) == ("ok: ", 1, "")


def test_it_stands_where_its_lowest_point_puts_it(driven: Driven) -> None:
    pose = entities.pose(driven.sim.bus, driven.name)
    assert pose.position.z == pytest.approx(-lowest(driven.model), abs=1e-3)
    up = 1 - 2 * (pose.orientation.x**2 + pose.orientation.y**2)
    assert up == pytest.approx(1, abs=1e-4)


def test_it_drives_two_metres_forward(driven: Driven) -> None:
    assert_goes(driven, (0.5, 0.0, 0.0), driven.forward.odoms)


def test_it_drives_two_metres_to_the_left_or_not_at_all(driven: Driven) -> None:
    velocity = (0.0, 0.5, 0.0)
    done = velocity if driven.stated.sideways else (0.0, 0.0, 0.0)  # it does not what it cannot do
    assert_goes(driven, done, driven.steady(velocity, 4.0 if any(done) else 1.0))
    driven.stop()


def assert_goes(driven: Driven, done: Planar, odoms: list[Odometry]) -> None:
    """It went as by that velocity."""
    start, end = odoms[0], odoms[-1]
    x, y, yaw = ahead(place(start), done, time_of(end) - time_of(start))
    there = place(end)
    assert math.hypot(there[0] - x, there[1] - y) < driven.stated.way
    assert abs(math.remainder(there[2] - yaw, math.tau)) < driven.stated.yaw
    assert speeds(end) == pytest.approx(done, abs=driven.stated.speed)


def test_it_turns_on_the_spot(driven: Driven) -> None:
    assert_turns(driven, -1.0, driven.round.turn)
    assert_turns(driven, 2.0, driven.steady((0, 0, 2.0), math.pi))  # once round
    driven.stop()


def assert_turns(driven: Driven, turn: float, odoms: list[Odometry]) -> None:
    """It turned at that rate."""
    least, most = driven.stated.turn
    assert least <= turned(odoms) / turn / (time_of(odoms[-1]) - time_of(odoms[0])) <= most
    middle = place(odoms[0])
    assert max(math.dist(place(odom)[:2], middle[:2]) for odom in odoms) < driven.stated.spot


def test_it_stops_when_commanded(driven: Driven) -> None:
    last = driven.forward.odoms[-1]
    assert speeds(last)[0] > 0.5 - 2 * max(5e-3, driven.stated.speed)
    way = math.dist(place(last)[:2], place(driven.forward.stopped)[:2])
    assert way < driven.stated.stopping + 2e-3


def test_it_stops_in_silence(driven: Driven) -> None:
    assert driven.rests(driven.round.stands)
    assert driven.rests(driven.round.later)


def test_its_wheels_turn_forward_when_it_drives_forward(driven: Driven) -> None:
    expected = forward_rates(driven.model, 0.5)
    assert expected
    for name, rate in expected.items():
        assert driven.forward.wheels[name] == pytest.approx(rate, rel=0.02, abs=0.02)


def forward_rates(model: RobotModel, speed: float) -> dict[str, float]:
    """Of the wheels, not of what rolls on them: an axle to the left turns by +v/r, one to the right
    by -v/r.
    """
    wheels = {name: axis for name, axis in joint_axes(model).items() if "roller" not in name}
    return {
        name: speed * axis.direction[1] / (axis.xyz[2] - lowest(model))
        for name, axis in wheels.items()
    }


def test_its_odometry_is_where_it_is(driven: Driven) -> None:
    reported, true = relative(*driven.round.odom), relative(*driven.round.truth)
    metres, radians = driven.stated.odom
    assert math.dist(reported[:2], true[:2]) < metres
    assert abs(math.remainder(reported[2] - true[2], math.tau)) < radians
    assert math.hypot(*true[:2]) > 0.1


@pytest.mark.parametrize("driven", ["wheely_boi.xacro"], indirect=True)
def test_wheely_boi_listens_where_its_lesson_speaks(driven: Driven) -> None:
    lesson = driven.sim.bus.publisher("wheely_boi/wheely_boi/cmd", Twist)

    def drives() -> bool:
        lesson.put(Twist.planar(0.3, 0.0, 0.0))
        return speeds(driven.sim.step(SPAN))[0] > 0.2

    wait_for(drives, 20, "wheely_boi to drive")
    driven.stop()
