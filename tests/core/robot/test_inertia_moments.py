"""A link whose inertia is missing or absurd has that of its shapes."""

from pathlib import Path

import numpy as np
import pytest

from holozen.robot.files.loading import parse
from holozen.robot.model import Pose, RobotModel
from holozen.robot.rigid import lump

ORIGIN = Path("somewhere/robot.urdf")
BOX = '<box size="0.3 0.3 0.3"/>'
TAKEN = "the inertia of its solid collision shapes is used"
CUBE = 2 * 0.3**2 / 6  # kg m^2; 2 kg


def robot(inertia: str, *shapes: str, more: str = "") -> RobotModel:
    """A link of 2 kg, with collision shapes."""
    collisions = "".join(f"<collision>{shape}</collision>" for shape in shapes)
    inertial = f'<inertial><origin xyz="0.1 0 0" rpy="0 0 1"/><mass value="2"/>{inertia}</inertial>'
    return parse(
        f'<robot name="r">\n<link name="a">{inertial}{collisions}</link>{more}</robot>', ORIGIN
    )


def geometry(shape: str, origin: str = "") -> str:
    return f"{origin}<geometry>{shape}</geometry>"


def moments(model: RobotModel) -> tuple[float, ...]:
    part = model.links["a"].inertial
    assert part is not None
    assert part.pose == Pose((0.1, 0, 0)), (
        "the centre of mass stays, and the axes are those of the link"
    )
    return part.inertia


SMALL = "is absurdly small for the size of the link's collision shapes"


def test_an_inertia_that_no_such_body_has_is_taken_from_the_shapes() -> None:
    for inertia, message in [
        ("", "<inertial> of <link name='a'> has no <inertia>"),
        (
            '<inertia ixx="0" iyy="0" izz="0"/>',
            "is zero or not positive definite, which is impossible",
        ),
        (
            '<inertia ixx="1" iyy="1" izz="1" ixy="5"/>',
            "is zero or not positive definite, which is impossible",
        ),
        (
            '<inertia ixx="0.01" iyy="0.01" izz="0.1"/>',
            "has one moment above the sum of the other two (ixx=0.01, iyy=0.01, izz=0.1), which "
            "is impossible",
        ),
        ('<inertia ixx="1e-6" iyy="1e-6" izz="1e-6"/>', SMALL),
        ('<inertia ixx="1" iyy="1" izz="1e-6"/>', SMALL),
    ]:
        model = robot(inertia, geometry(BOX))
        assert moments(model) == pytest.approx((CUBE, 0, 0, CUBE, 0, CUBE))
        (warning,) = model.warnings
        assert warning.startswith(f"{ORIGIN}, line 2: ")
        assert warning.endswith(f"{message}; {TAKEN}")


@pytest.mark.parametrize("factor", [1 / 50, 1, 50])
def test_an_inertia_that_is_but_wrong_stays(factor: float) -> None:
    value = CUBE * factor
    model = robot(f'<inertia ixx="{value}" iyy="{value}" izz="{value}"/>', geometry(BOX))
    part = model.links["a"].inertial
    assert part is not None and part.inertia == (value, 0, 0, value, 0, value)
    assert model.warnings == ()


def test_a_plate_with_rounded_moments_keeps_them() -> None:
    model = robot(
        '<inertia ixx="0.015" iyy="0.015" izz="0.0302"/>', geometry('<box size="0.3 0.3 0.001"/>')
    )
    part = model.links["a"].inertial
    assert part is not None and part.inertia == (0.015, 0, 0, 0.015, 0, 0.0302)
    assert model.warnings == ()


def test_a_rod_that_is_easily_turned_about_its_length_is_none_too_small() -> None:
    along, across = 2 * 0.005**2 / 2, 2 * 1.0 / 12
    model = robot(
        f'<inertia ixx="{across}" iyy="{across}" izz="{along}"/>',
        geometry('<cylinder radius="0.005" length="1"/>'),
    )
    assert model.warnings == ()


def test_a_link_without_shapes_is_a_point_mass() -> None:
    model = robot("")
    part = model.links["a"].inertial
    assert part is not None and part.inertia == (0, 0, 0, 0, 0, 0)
    assert model.warnings[0].endswith("has no <inertia>; the link is treated as a point mass")


def test_a_cylinder_on_its_side_turns_as_one() -> None:
    shape = geometry(
        '<cylinder radius="0.2" length="0.1"/>',
        '<origin rpy="1.5707963267948966 0 0" xyz="0 0 5"/>',
    )
    across = 2 * (3 * 0.2**2 + 0.1**2) / 12
    assert moments(robot("", shape)) == pytest.approx(
        (across, 0, 0, 2 * 0.2**2 / 2, 0, across), abs=1e-12
    )


def test_a_ball_turns_as_one() -> None:
    value = 0.4 * 2 * 0.2**2
    assert moments(robot("", geometry('<sphere radius="0.2"/>'))) == pytest.approx(
        (value, 0, 0, value, 0, value)
    )


def test_two_boxes_turn_as_the_one_that_they_make() -> None:
    halves = [
        geometry('<box size="0.3 0.3 0.15"/>', f'<origin xyz="0 0 {z}"/>') for z in (1.0, 1.15)
    ]
    assert moments(robot("", *halves)) == pytest.approx((CUBE, 0, 0, CUBE, 0, CUBE))


def test_a_whole_robot_turns_as_its_shapes_where_mass_and_shapes_are_those_of_different_links() -> (
    None
):
    body = f'<link name="b"><collision>{geometry(BOX)}</collision></link>'
    joint = '<joint name="ab" type="fixed"><parent link="a"/><child link="b"/></joint>'
    assert lump(robot("", more=body + joint)).inertia == pytest.approx((CUBE, CUBE, CUBE))


def test_an_sdf_link_has_the_inertia_of_its_shapes_too() -> None:
    shape = (
        '<collision name="c"><geometry><box><size>0.3 0.3 0.3</size></box></geometry></collision>'
    )
    zero = "<mass>2</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>"
    text = (
        '<sdf version="1.9"><model name="m"{}><link '
        'name="a"><inertial>{}</inertial>{}</link></model></sdf>'
    )
    model = parse(text.format("", zero, shape), Path("m.sdf"))
    part = model.links["a"].inertial
    assert part is not None and np.allclose(part.inertia, (CUBE, 0, 0, CUBE, 0, CUBE))
    assert model.warnings[0].endswith(TAKEN)
