"""Wheels are only drawn turning, as if they rolled without slipping."""

import math
from pathlib import Path

import pytest
from msgspec.structs import replace

from holozen.robot.files.loading import load
from holozen.robot.model import Joint, Pose, RobotModel, Shape
from services.sim.physics.wheels import Wheels

REPO = Path(__file__).parents[3]
HB_BOT = load(REPO / "urdf" / "hb_bot.urdf.xacro")
NAMES = ["front_wheel_joint", "left_wheel_joint", "right_wheel_joint"]
RADIUS = 0.14


def with_joint(joint: Joint) -> RobotModel:
    return replace(HB_BOT, joints={**HB_BOT.joints, joint.name: joint})


def rates(model: RobotModel, velocity: tuple[float, float, float]) -> list[float]:
    wheels = Wheels(model)
    wheels.roll(velocity, 0.1)
    return wheels.rates


def test_the_joints_are_those_of_the_wheels_and_start_at_zero() -> None:
    wheels = Wheels(HB_BOT)
    assert wheels.names == NAMES
    assert wheels.angles == wheels.rates == [0, 0, 0]


def test_turning_on_the_spot_turns_all_wheels_alike() -> None:
    # Each stands on its radius with its axle along it: the rim runs at turn times distance.
    front, left, right = rates(HB_BOT, (0, 0, 1))
    assert front == pytest.approx(-0.68 / RADIUS)
    assert left == right == pytest.approx(-math.hypot(0.58, 0.36) / RADIUS)


def test_forward_rolls_the_wheel_whose_axle_is_across() -> None:
    front, left, right = rates(HB_BOT, (0.5, 0, 0))
    assert front == pytest.approx(0.5 / RADIUS)
    assert left == pytest.approx(right)
    assert left == pytest.approx(-0.5 * 0.36 / math.hypot(0.58, 0.36) / RADIUS)


def test_strafing_leaves_the_front_wheel_to_its_rollers() -> None:
    front, left, right = rates(HB_BOT, (0, 0.5, 0))
    assert front == pytest.approx(0)
    assert left == pytest.approx(-right)


def test_angles_add_up_what_was_rolled() -> None:
    wheels = Wheels(HB_BOT)
    for dt in (0.1, 0.3):
        wheels.roll((0.14, 0, 0), dt)
    wheels.roll((0, 0, 0), 5)
    assert wheels.angles[0] == pytest.approx(0.4)
    assert wheels.rates == [0, 0, 0]


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "revolute"},
        {"axis": (0.0, 0.0, 1.0)},
        {"axis": (0.0, math.cos(0.2), math.sin(0.2))},
    ],
    ids=str,
)
def test_what_is_no_wheel_stays_where_it_is(change: dict[str, object]) -> None:
    odd = replace(HB_BOT.joints["front_wheel_joint"], **change)
    front, left, _ = rates(with_joint(odd), (1, 1, 1))
    assert front == 0
    assert left != 0


def test_a_slightly_tilted_axle_is_a_wheels_still() -> None:
    tilted = replace(HB_BOT.joints["front_wheel_joint"], axis=(0.0, math.cos(0.05), math.sin(0.05)))
    assert rates(with_joint(tilted), (0.14, 0, 0))[0] == pytest.approx(1)


def test_a_wheel_without_a_round_shape_does_not_roll() -> None:
    square = (Shape("box", (1, 1, 1), Pose()),)
    links = {
        **HB_BOT.links,
        "front_wheel_link": replace(HB_BOT.links["front_wheel_link"], collisions=square),
    }
    assert rates(replace(HB_BOT, links=links), (1, 0, 0))[0] == 0
