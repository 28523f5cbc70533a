"""The wheels of a mecanum base are only drawn turning: forward when it drives forward."""

import re
from pathlib import Path

import pytest
from msgspec.structs import replace

from holozen.robot.files.loading import load, parse
from holozen.robot.files.xacro import expand_xacro
from holozen.robot.model import Mecanum, RobotModel
from services.sim.physics.wheels import MecanumWheels

FILE = Path(__file__).parents[3] / "urdf" / "mecanum.urdf.xacro"
MODEL = load(FILE)
NAMES = ["front_left_joint", "front_right_joint", "back_left_joint", "back_right_joint"]
RADIUS, ARM = 0.076, 0.17 + 0.18


def wheels(model: RobotModel = MODEL) -> MecanumWheels:
    assert model.drive is not None
    assert isinstance(model.drive.mechanism, Mecanum)
    return MecanumWheels(model, model.drive.mechanism)


def rates(rolling: MecanumWheels, velocity: tuple[float, float, float]) -> dict[str, float]:
    rolling.roll(velocity, 0.1)
    return dict(zip(rolling.names, rolling.rates, strict=True))


@pytest.mark.parametrize(
    ("velocity", "rims"),
    [
        ((1, 0, 0), (1, 1, 1, 1)),
        ((0, 1, 0), (-1, 1, 1, -1)),
        ((0, 0, 1), (-ARM, ARM, -ARM, ARM)),
        ((0.5, -0.2, 2), (0.7 - 2 * ARM, 0.3 + 2 * ARM, 0.3 - 2 * ARM, 0.7 + 2 * ARM)),
    ],
    ids=["forward", "left", "round", "all"],
)
def test_each_wheel_turns_as_its_corner_wants(
    velocity: tuple[float, float, float], rims: tuple[float, float, float, float]
) -> None:
    found = rates(wheels(), velocity)
    assert [found[name] * RADIUS for name in NAMES] == pytest.approx(rims)


def test_a_wheel_with_its_axis_the_other_way_turns_the_other_way() -> None:
    joint = MODEL.joints["front_left_joint"]
    model = replace(
        MODEL, joints={**MODEL.joints, joint.name: replace(joint, axis=(0.0, -1.0, 0.0))}
    )
    found = rates(wheels(model), (1, 0, 0))
    assert found["front_left_joint"] == pytest.approx(-1 / RADIUS)
    assert found["front_right_joint"] == pytest.approx(1 / RADIUS)


def test_what_the_file_does_not_measure_is_measured() -> None:
    text, count = re.subn(
        r"<(wheel_separation|wheelbase|wheel_radius)>.*?</\1>", "", expand_xacro(FILE)
    )
    assert count == 3
    reported, measured = wheels(), wheels(parse(text, FILE))
    assert rates(reported, (0.5, -0.2, 2)) == pytest.approx(rates(measured, (0.5, -0.2, 2)))


def test_angles_add_up_what_was_rolled() -> None:
    rolling = wheels()
    for dt in (0.1, 0.3):
        rolling.roll((RADIUS, 0, 0), dt)
    rolling.roll((0, 0, 0), 5)
    assert rolling.angles == pytest.approx([0.4] * 4)


def test_other_joints_stay_where_they_are() -> None:
    arm = replace(MODEL.joints["front_left_joint"], name="arm", child="arm")
    link = replace(MODEL.links["front_left_wheel"], name="arm")
    model = replace(MODEL, joints={**MODEL.joints, "arm": arm}, links={**MODEL.links, "arm": link})
    assert rates(wheels(model), (1, 1, 1))["arm"] == 0
