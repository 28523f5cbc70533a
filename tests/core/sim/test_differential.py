"""Wheels on two sides in the real engine: forward is forward whichever way an axis points, and
encoders add up.
"""

import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs
from msgspec.structs import replace

from holozen.limits import STOP, Planar
from holozen.robot.files.loading import load, parse
from holozen.robot.files.xacro import expand_xacro
from holozen.robot.model import Differential, Pose, RobotModel, Surface
from holozen.robot.rigid import lowest
from holozen.rotation import yaw as yaw_of
from services.sim.physics.movers import mover_for
from services.sim.physics.rolling import DifferentialMover, Odometer
from services.sim.physics.world import World

URDF = Path(__file__).parents[3] / "urdf"
TWO = load(URDF / "differential.urdf.xacro")
FOUR = load(URDF / "rover.urdf.xacro")
DT = 1 / 240


def rolled(left: float, right: float, separation: float) -> Planar:
    return (left + right) / 2, 0.0, (right - left) / separation


def with_wheels(model: RobotModel, **changes: Any) -> RobotModel:
    assert model.drive is not None
    return replace(
        model, drive=replace(model.drive, mechanism=structs.replace(mechanism(model), **changes))
    )


def mechanism(model: RobotModel) -> Differential:
    assert model.drive is not None
    assert isinstance(model.drive.mechanism, Differential)
    return model.drive.mechanism


def turned_over(model: RobotModel, name: str) -> RobotModel:
    """The robot with one joint's axis pointing the other way."""
    joint = model.joints[name]
    x, y, z = joint.axis
    return replace(model, joints={**model.joints, name: replace(joint, axis=(-x, -y, -z))})


class Driven:
    """A robot on the ground, and how far it has turned."""

    def __init__(self, world: World, model: RobotModel) -> None:
        mover = mover_for(world, model, (0, 0, -lowest(model)))
        assert isinstance(mover, DifferentialMover)
        self.world, self.mover, self.turned = world, mover, 0.0
        self.drive(0.3)

    def drive(self, seconds: float, velocity: Planar = STOP) -> Planar:
        """Drive, and return where the robot is then."""
        for _ in range(round(seconds / DT)):
            before = self.place[2]
            self.mover.move(velocity, DT)
            self.world.step()
            self.turned += math.remainder(self.place[2] - before, math.tau)
        return self.place

    @property
    def place(self) -> Planar:
        (x, y, _), rotation = self.mover.body.pose()
        return x, y, yaw_of(rotation)


@pytest.mark.parametrize("model", [TWO, FOUR], ids=["two wheels", "four wheels"])
def test_straight_on_it_goes_as_far_as_commanded(ground: World, model: RobotModel) -> None:
    for speed in (-0.5, 1.0):
        ground.clear()
        robot = Driven(ground, model)
        start = robot.drive(1, (speed, 0, 0))
        end = robot.drive(2, (speed, 0, 0))
        assert end[0] - start[0] == pytest.approx(2 * speed, rel=1e-3)
        assert end[1:] == pytest.approx(start[1:], abs=2e-3)


@pytest.mark.parametrize("name", ["left_wheel_joint", "right_wheel_joint"])
def test_forward_is_forward_whichever_way_an_axis_points(ground: World, name: str) -> None:
    robot = Driven(ground, turned_over(TWO, name))
    assert robot.drive(2, (0.5, 0, 0))[0] == pytest.approx(0.95, abs=0.1)
    assert robot.turned == pytest.approx(0, abs=1e-2)


@pytest.mark.engines
def test_two_wheels_turn_as_fast_as_commanded(ground: World) -> None:
    robot = Driven(ground, TWO)
    for turn in (0.5, -3.0):
        robot.drive(1, (0, 0, turn))
        begin = robot.turned
        robot.drive(2, (0, 0, turn))
        assert robot.turned - begin == pytest.approx(2 * turn, rel=0.01)


@pytest.mark.engines
def test_four_wheels_turn_at_nearly_the_commanded_rate(ground: World) -> None:
    for velocity in ((0, 0, 0.2), (0, 0, -4), (0.4, 0, 1)):
        ground.clear()
        robot = Driven(ground, FOUR)
        start = robot.drive(1, velocity)
        begin = robot.turned
        end = robot.drive(2, velocity)
        assert 0.85 < (robot.turned - begin) / (2 * velocity[2]) < 1.01, velocity
        if velocity[0] == 0:
            assert math.dist(start[:2], end[:2]) < 0.02


def test_four_wheels_turn_alike_wherever_they_look(ground: World) -> None:
    robot = Driven(ground, FOUR)
    robot.drive(1, (0, 0, 1))
    rates = []
    for _ in range(40):
        begin = robot.turned
        robot.drive(0.2, (0, 0, 1))
        rates.append((robot.turned - begin) / 0.2)
    assert 0.8 < min(rates) <= max(rates) < 1.05


def test_sideways_it_does_not_go(ground: World) -> None:
    assert Driven(ground, TWO).drive(1, (0, 1, 0)) == pytest.approx((0, 0, 0), abs=1e-3)


@pytest.mark.parametrize("acceleration", [0.5, 2.0])
def test_its_wheels_keep_to_their_acceleration_but_a_stop_is_at_once(
    ground: World, acceleration: float
) -> None:
    robot = Driven(ground, with_wheels(TWO, acceleration=acceleration))
    robot.drive(0.25, (2, 0, 0))
    assert robot.mover.body.planar()[0] == pytest.approx(acceleration * 0.25, rel=0.05)
    robot.drive(0.125)
    assert robot.mover.body.planar()[0] == pytest.approx(0, abs=1e-3)


def test_wheels_that_others_turned_slow_down_from_where_they_are(ground: World) -> None:
    robot = Driven(ground, with_wheels(TWO, acceleration=1.0))
    for _ in range(240):
        for name in robot.mover.wheels:
            robot.mover.body.turn(name, 1.0 / 0.06)
        ground.step()
    robot.drive(0.25, (0.1, 0, 0))
    assert robot.mover.body.planar()[0] == pytest.approx(0.75, abs=0.12)


def test_its_motors_give_no_more_than_their_torque(ground: World) -> None:
    robot = Driven(ground, with_wheels(TWO, torque=0.03, acceleration=math.inf))
    robot.drive(0.5, (2, 0, 0))
    # Two motors move 5.9 kg and spin two wheels of 7.2e-4 kg m^2; the ball carries 20.6 N and rubs
    # with 0.01 of it.
    expected = (2 * 0.03 / 0.06 - 0.206) / (5.9 + 2 * 7.2e-4 / 0.06**2) * 0.5
    assert robot.mover.body.planar()[0] == pytest.approx(expected, rel=0.1)


def test_what_the_file_does_not_measure_is_measured(ground: World) -> None:
    file = URDF / "differential.urdf.xacro"
    text, count = re.subn(
        r"<(wheel_?(?:separation|diameter|radius))>.*?</\1>",
        "",
        expand_xacro(file),
        flags=re.IGNORECASE,
    )
    model = parse(text, file)
    assert count == 2
    assert (mechanism(model).separation, mechanism(model).radius) == pytest.approx((0.31, 0.06))
    robot = Driven(ground, model)
    robot.drive(1, (0.5, 0, 0.5))
    assert robot.mover.body.planar()[0::2] == pytest.approx((0.5, 0.5), abs=0.01)


@pytest.mark.engines
def test_casters_as_low_as_the_wheels_leave_the_load_to_them(ground: World) -> None:
    """On rigid ground such a robot rests on four points, and its wheels slip."""
    ball = next(
        link
        for link in TWO.links.values()
        if any(shape.kind == "sphere" for shape in link.collisions)
    )
    joint = next(joint for joint in TWO.joints.values() if joint.child == ball.name)
    x, y, z = joint.pose.xyz
    rough = replace(ball, surface=Surface(1.0, 1.0))
    casters = {
        name: (
            replace(rough, name=name),
            replace(joint, name=f"{name}_j", child=name, pose=Pose((way, y, z))),
        )
        for name, way in (("front", abs(x)), ("back", -abs(x)))
    }
    links = {name: link for name, link in TWO.links.items() if name != ball.name}
    joints = {name: each for name, each in TWO.joints.items() if each.child != ball.name}
    model = replace(
        TWO,
        links=links | {name: link for name, (link, _) in casters.items()},
        joints=joints | {each.name: each for _, each in casters.values()},
    )
    robot = Driven(ground, model)
    robot.drive(2, (0.4, 0, 0))
    assert robot.place[0] > 0.35  # of 0.8 m, since a rough caster brakes


@pytest.mark.engines
def test_encoders_measure_what_wheels_roll_and_the_world_what_is(ground: World) -> None:
    robot = Driven(ground, TWO)
    for velocity in ((0.5, 0, 0), (0.5, 0, 0.8), (0, 0, -1), (-0.3, 0, 0.2)):
        robot.drive(1.5, velocity)
        position, rotation, speeds = robot.mover.moved(0, DT)
        x, y, yaw = robot.place
        assert math.dist(position[:2], (x, y)) < 0.06
        assert math.remainder(yaw_of(rotation) - yaw, math.tau) == pytest.approx(0, abs=0.03)
        assert speeds == pytest.approx(robot.mover.body.planar(), abs=0.06)


def test_against_a_wall_encoders_go_on_and_the_world_does_not(ground: World, engine: str) -> None:
    wall = load(URDF / "rover.urdf.xacro")
    ground.add_jointed(replace(wall, static=True, drive=None), (0.5, 0, 0.05))
    robot, other = Driven(ground, TWO), with_wheels(TWO, encoder=False)
    robot.drive(3, (0.5, 0, 0))
    slips = 1.0 if engine == "pybullet" else 0.5  # m; a wheel that is held slips less in mujoco
    assert robot.mover.moved(0, DT)[0][0] > slips
    assert robot.place[0] < 0.4
    robot.mover.body.remove()
    true = Driven(ground, other)
    true.drive(3, (0.5, 0, 0))
    assert true.mover.moved(0, DT)[0] == true.mover.body.pose()[0]


@given(st.floats(-2, 2), st.floats(-2, 2), st.integers(1, 50))
def test_an_arc_ends_at_the_same_place_in_one_look_or_in_many(
    left: float, right: float, looks: int
) -> None:
    once, often = Odometer(), Odometer()
    one = once.update(rolled(left, right, 0.3))
    for look in range(1, looks + 1):
        many = often.update(rolled(left * look / looks, right * look / looks, 0.3))
    assert many[0] == pytest.approx(one[0], abs=1e-9)
    assert abs(sum(a * b for a, b in zip(many[1], one[1], strict=True))) == pytest.approx(1)


def test_an_arc_is_a_circle_about_a_point_beside() -> None:
    # A quarter to the left on a radius of 1 m, the wheels 0.2 m apart.
    (x, y, _), rotation = Odometer().update(rolled(0.9 * math.pi / 2, 1.1 * math.pi / 2, 0.2))
    assert (x, y, yaw_of(rotation)) == pytest.approx((1, 1, math.pi / 2))
