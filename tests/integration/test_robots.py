"""Every robot of urdf/: checked, spawned, driven 2 m and turned through the wire, and compared with the closed form.

What docs/robots.md states is what stands here. Wheels are turned by motors and the ground does the rest, so they have
bounds of their own.
"""

import math
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import pytest

from holozen import entities
from holozen.messages import JointState, Odometry, Twist
from holozen.robot.loading import load
from holozen.robot.model import RobotModel
from holozen.robot.rigid import joint_axes, lowest
from holozen.testing import Wire, wait_for
from holozen.testing.wire import command
from holozen.wire import key_for

from .robots import URDF, Planar, Robot, ahead, place, record, speeds, time_of

NO_ROBOTS = {"materials.xacro"}
FILES = sorted(path.name for path in URDF.glob("*.xacro") if path.name not in NO_ROBOTS)


@dataclass(frozen=True)
class Stated:
    """What is stated of a robot. Metres, radians, seconds of sim time.

    `way` and `yaw` are how far it is from the closed form after 2 m, and `turn` the part of a commanded turn that it
    makes, at least and at most. `spot` is how far it strays while it turns on the spot. `settling` is the time that it
    takes to come to a speed, `stopping` the way that it takes to stop from 0.5 m/s. `odom` is how far odometry is from
    the truth after all that, in metres and in radians, and `speed` how far its velocity is from the commanded one.
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
    "mecanum.urdf.xacro": Stated(sideways=True),
    "differential.urdf.xacro": Stated(
        way=5e-3, yaw=0.015, turn=(0.99, 1.01), spot=0.04, settling=0.5, stopping=0.06, odom=(0.1, 0.05), speed=5e-3
    ),
    "rover.urdf.xacro": Stated(
        way=5e-3, yaw=0.015, turn=(0.85, 1.01), spot=0.03, settling=0.5, stopping=0.03, speed=5e-3
    ),
    "wheely_boi.xacro": Stated(
        way=0.02, yaw=0.06, turn=(0.98, 1.02), spot=0.02, settling=3.0, stopping=0.25, speed=0.05
    ),
}


class Driven:
    """A robot of a file, spawned, and a hand on its keys. `bus` belongs to the whole file of tests."""

    def __init__(self, wire: Wire, file: str, y: float) -> None:
        self.file, self.model, self.stated = URDF / file, load(URDF / file), STATED[file]
        self.name = file.partition(".")[0]
        self.bus = wire.bus()
        spawned = wire.run("spawn", str(self.file), "--name", self.name, "-y", str(y))
        assert (spawned.returncode, spawned.stderr) == (0, ""), spawned
        self.robot = Robot(self.bus, self.name).wait_longer()
        self.joints = record(self.bus, key_for("joint_states", self.name), JointState)

    def steady(self, velocity: Planar, seconds: float) -> list[Odometry]:
        """Odoms over that much sim time at a velocity, after the time that the robot takes to come to it."""
        start = time_of(self.robot.newest())
        # A second is enough to see that it does not move: some cannot move sideways.
        begun = self.robot.drive(*velocity, until=lambda odom: not self.rests(odom) or time_of(odom) > start + 1)
        begin = time_of(begun[-1]) + self.stated.settling
        odoms = self.robot.drive(*velocity, until=lambda odom: time_of(odom) >= begin + seconds)
        return [odom for odom in odoms if time_of(odom) >= begin]

    def stop(self) -> Odometry:
        """Tell it to stop; the odom that shows that it did."""
        self.robot.put()
        return self.stands()

    def stands(self) -> Odometry:
        """Wait until it stands, and has stood for a while."""
        begin = time_of(self.robot.newest()) + self.stated.settling
        odom: Odometry = self.robot.odom.next(lambda odom: time_of(odom) > begin and self.rests(odom), within=20)
        return odom

    def rests(self, odom: Odometry) -> bool:
        return max(map(abs, speeds(odom))) < max(1e-3, self.stated.speed)

    def truth(self) -> Planar:
        """Where it is in the world."""
        pose = entities.pose(self.bus, self.name)
        return pose.position.x, pose.position.y, pose.orientation.yaw()


@pytest.fixture(scope="module")
def field(town: Wire) -> Wire:
    """An empty world, four times as fast as real time."""
    sim = town.start("sim", "--empty", "--rtf", "4")
    sim.wait_for_line("no robot yet")
    return town


@pytest.fixture(scope="module", params=FILES)
def driven(field: Wire, request: pytest.FixtureRequest) -> Iterator[Driven]:
    driven = Driven(field, request.param, y=20.0 * FILES.index(request.param))
    yield driven
    entities.delete(driven.bus, driven.name)


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


@pytest.mark.parametrize("file", FILES)
def test_a_file_is_read_without_a_warning_and_checked_without_a_finding(file: str) -> None:
    assert load(URDF / file).warnings == ()
    checked = subprocess.run(command("check", str(URDF / file)), capture_output=True, text=True)
    assert (checked.returncode, checked.stdout[:4], checked.stdout.count("\n"), checked.stderr) == (0, "ok: ", 1, "")


def test_it_stands_where_its_lowest_point_puts_it(driven: Driven) -> None:
    driven.robot.pass_time(0.5)
    pose = entities.pose(driven.bus, driven.name)
    assert pose.position.z == pytest.approx(-lowest(driven.model), abs=1e-3)
    up = 1 - 2 * (pose.orientation.x**2 + pose.orientation.y**2)
    assert up == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("velocity", [(0.5, 0.0, 0.0), (0.0, 0.5, 0.0)], ids=["forward", "left"])
def test_it_drives_two_metres(driven: Driven, velocity: Planar) -> None:
    if velocity[1] and not driven.stated.sideways:
        velocity, done = (0.0, 0.5, 0.0), (0.0, 0.0, 0.0)  # what it cannot do, it does not
    else:
        done = velocity
    odoms = driven.steady(velocity, 4.0)
    start, end = odoms[0], odoms[-1]
    x, y, yaw = ahead(place(start), done, time_of(end) - time_of(start))
    there = place(end)
    assert math.hypot(there[0] - x, there[1] - y) < driven.stated.way
    assert abs(math.remainder(there[2] - yaw, math.tau)) < driven.stated.yaw
    assert speeds(end) == pytest.approx(done, abs=driven.stated.speed)
    driven.stop()


@pytest.mark.parametrize("turn", [-1.0, 2.0])
def test_it_turns_round_on_the_spot(driven: Driven, turn: float) -> None:
    odoms = driven.steady((0, 0, turn), math.tau / abs(turn))
    least, most = driven.stated.turn
    assert least <= turned(odoms) / turn / (time_of(odoms[-1]) - time_of(odoms[0])) <= most
    middle = place(odoms[0])
    assert max(math.dist(place(odom)[:2], middle[:2]) for odom in odoms) < driven.stated.spot
    driven.stop()


def test_it_stops_when_it_is_told(driven: Driven) -> None:
    begin = len(driven.robot.odom.messages())
    driven.steady((0.5, 0, 0), 0.2)
    stood = driven.stop()
    full = 0.5 - 2 * max(5e-3, driven.stated.speed)
    last = [odom for odom in driven.robot.odom.messages()[begin:] if speeds(odom)[0] > full][-1]
    way = math.dist(place(last)[:2], place(stood)[:2])
    assert way < driven.stated.stopping + 0.5 * 0.02 + 2e-3, "and what it goes until the next odom, at 50 Hz"


def test_it_stops_when_nobody_tells_it_anything(driven: Driven) -> None:
    driven.steady((0.5, 0, 0.5), 0.2)
    driven.stands()
    driven.robot.status_when(lambda status: not status.obeyed)
    assert driven.rests(driven.robot.pass_time(0.5))


def test_its_wheels_turn_forward_when_it_drives_forward(driven: Driven) -> None:
    end = time_of(driven.steady((0.5, 0, 0), 1.0)[-1])
    driven.stop()
    states = [states for states in driven.joints.messages() if states.header.stamp.seconds() <= end][-1]
    expected = forward_rates(driven.model, 0.5)
    rates = dict(zip(states.name, states.velocity, strict=True))
    assert expected
    for name, rate in expected.items():
        assert rates[name] == pytest.approx(rate, rel=0.02, abs=0.02)


def forward_rates(model: RobotModel, speed: float) -> dict[str, float]:
    """Of the wheels across the way: an axle to the left turns by +v/r, one to the right by -v/r."""
    rates = {}
    for name, axis in joint_axes(model).items():
        radius = next(s.size[0] for s in model.links[model.joints[name].child].collisions if s.kind == "cylinder")
        if abs(axis.direction[1]) > 0.99:
            rates[name] = math.copysign(speed / radius, axis.direction[1])
    return rates


def test_its_odometry_is_where_it_is(driven: Driven) -> None:
    driven.stop()
    odom, truth = place(driven.robot.newest()), driven.truth()
    for velocity in ((0.5, 0, 0), (0.4, 0, 0.6), (0, 0, -1.0), (-0.3, 0, 0.2)):
        driven.steady(velocity, 1.5)
    driven.stop()
    metres, radians = driven.stated.odom

    def is_at(there: Planar, true: Planar) -> bool:
        told = relative(odom, there)
        same = abs(math.remainder(told[2] - true[2], math.tau)) < radians
        return same and math.dist(told[:2], true[:2]) < metres

    def agree() -> bool:
        """What balances sways, so one of the odoms that came around the answer has to be as the truth."""
        begin = len(driven.robot.odom.messages())
        driven.robot.newest()
        true = relative(truth, driven.truth())
        driven.robot.newest()
        return any(is_at(place(told), true) for told in driven.robot.odom.messages()[begin:])

    wait_for(agree, what="odometry that agrees with the world")
    assert driven.truth() != truth


def test_wheely_boi_listens_where_its_lesson_speaks(field: Wire) -> None:
    bus = field.bus()
    spawned = field.run("spawn", str(URDF / "wheely_boi.xacro"), "--name", "Fred", "-y", "-20")
    assert spawned.returncode == 0, spawned.stderr
    fred = Robot(bus, "Fred").wait_longer()
    lesson = bus.publisher("Fred/Fred/cmd", Twist)

    def drives() -> bool:
        lesson.put(Twist.planar(0.3, 0.0, 0.0))
        return speeds(fred.newest())[0] > 0.2

    wait_for(drives, 20, "Fred to drive")
    entities.delete(bus, "Fred")
