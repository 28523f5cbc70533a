"""Wheels that stand, float, drag or overlap."""

from collections.abc import Callable
from math import atan, degrees, pi

import numpy as np
import pytest

from holozen.check.geometry import Placed
from holozen.check.rules_wheels import stand
from holozen.robot.model import Pose, Shape
from holozen.robot.rigid import Frame
from tests.extensions.check.conftest import Findings

Rules = Callable[..., list[str]]

BODY = '<collision><origin xyz="0 0 0.02"/><geometry><box size="0.3 0.2 0.1"/>'
LOW = BODY.replace("0.02", "0")
BALL = '<link name="ball">'
PLANAR = '<plugin name="drive" filename="libgazebo_ros_planar_move.so">'
SMOOTH = '<gazebo reference="base"><mu1>0.1</mu1><mu2>0.1</mu2></gazebo>'
FOOT = '<link name="foot"><inertial><mass value="0.01"/>'
FOOT += '<inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial>'


def foot(name: str, shape: str, x: float) -> str:
    """A part of the body that reaches as deep as the wheels."""
    joint = (
        f'<joint name="j" type="fixed"><parent link="base"/><child link="{name}"/><origin '
        f'xyz="{x} 0 -0.04"/></joint>'
    )
    collision = f"<collision><geometry>{shape}</geometry></collision>"
    return FOOT.replace("foot", name) + collision + "</link>" + joint + "</robot>"


BOX = '<box size="0.02 0.02 0.02"/>'


def test_what_is_as_low_as_the_wheels_drags(good: str, rules: Rules) -> None:
    for old, new, expected in [
        (BODY, LOW, ["wheel-load"]),
        ("</robot>", foot("foot", BOX, 0.0), ["wheel-load"]),
        ("</robot>", foot("foot", BOX, 0.13), ["wheel-load"]),
        ("</robot>", foot("foot", '<cylinder radius="0.01" length="0.02"/>', 0.0), ["wheel-load"]),
        ("</robot>", foot("foot", '<sphere radius="0.01"/>', 0.0), []),
        ("</robot>", foot("front_caster", BOX, 0.0), []),
        ("</robot>", foot("ball_2", BOX, 0.0), []),
        ("</robot>", foot("foot", BOX, 0.0).replace("-0.04", "-0.036"), []),
    ]:
        assert good.count(old) == 1
        assert rules(good.replace(old, new)) == expected


@pytest.mark.parametrize("smooth", [SMOOTH, SMOOTH.replace("<mu1>0.1</mu1>", "")])
def test_what_is_smooth_slides(smooth: str, good: str, rules: Rules) -> None:
    assert rules(good.replace(BODY, LOW).replace("</robot>", smooth + "</robot>")) == []


def test_a_part_that_the_robot_would_tip_without_is_its_third_leg(good: str, rules: Rules) -> None:
    start, end = good.index(BALL), good.index('<link name="arm">')
    assert rules((good[:start] + good[end:]).replace("</robot>", foot("foot", BOX, -0.12))) == []


def test_a_body_between_two_wheels_carries_in_their_place(good: str, rules: Rules) -> None:
    start, end = good.index(BALL), good.index('<link name="arm">')
    assert rules((good[:start] + good[end:]).replace(BODY, LOW)) == ["wheel-load"]


def test_what_moves_the_robot_as_a_whole_may_drag_it(good: str, rules: Rules) -> None:
    plugin = good[good.index("<plugin") : good.index("<robotBaseFrame>")]
    assert rules(good.replace(BODY, LOW).replace(plugin, PLANAR)) == []


def ball(x: float, y: float, z: float, radius: float = 0.1) -> Placed:
    shape, frame = Shape("sphere", (radius,), Pose()), Frame.of(Pose((x, y, z)))
    return Placed("ball", "collision", shape, shape, frame, frame.position, np.full(3, radius))


def test_on_four_equal_balls_it_stands_level() -> None:
    balls = [ball(x, y, 0.1) for x in (-1, 1) for y in (-1, 1)]
    ground = stand(balls, (0.1, 0.2, 0.5))
    assert not ground.tips
    assert (ground.a, ground.b, ground.c) == pytest.approx((0, 0, 0), abs=1e-6)
    assert [ground.above(one) for one in balls] == pytest.approx([0, 0, 0, 0], abs=1e-6)


def test_on_three_balls_it_leans_until_all_touch() -> None:
    balls = [ball(1, -1, 0.1), ball(1, 1, 0.1), ball(-1, 0, 0.2)]
    ground = stand(balls, (0, 0, 0.5))
    assert ground.a == pytest.approx(-0.05, abs=1e-6)
    assert [ground.above(one) for one in balls] == pytest.approx([0, 0, 0], abs=1e-6)


def test_a_fourth_ball_in_the_air_stays_there() -> None:
    balls = [ball(1, -1, 0.1), ball(1, 1, 0.1), ball(-1, 0, 0.1), ball(0, 0, 0.15)]
    assert stand(balls, (0, 0, 0.5)).above(balls[3]) == pytest.approx(0.05, abs=1e-6)


def test_on_two_balls_it_tips() -> None:
    ground = stand([ball(0, -1, 0.1), ball(0, 1, 0.1)], (0.3, 0, 0.5))
    assert ground.tips
    assert degrees(atan(abs(ground.a))) == pytest.approx(20, abs=2)


INERTIA = (
    '<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" '
    'iyz="0"/></inertial>'
)


def robot(places: list[tuple[float, float]], width: float = 0.02) -> str:
    """A box of 0.4 x 0.2 x 0.1 m and wheels 5 cm in radius at these x and y, 3 cm below its
    middle.
    """
    parts = [
        f'<link name="base">{INERTIA}<collision><geometry><box size="0.4 0.2 '
        '0.1"/></geometry></collision></link>'
    ]
    inertia = (
        '<inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" '
        'ixz="0" iyz="0"/></inertial>'
    )
    for number, (x, y) in enumerate(places):
        shape = (
            f'<origin rpy="{pi / 2} 0 0"/><geometry><cylinder radius="0.05" '
            f'length="{width}"/></geometry>'
        )
        parts.append(f'<link name="wheel{number}">{inertia}<collision>{shape}</collision></link>')
        ends = (
            f'<parent link="base"/><child link="wheel{number}"/><origin xyz="{x} {y} '
            '-0.03"/><axis xyz="0 1 0"/>'
        )
        parts.append(f'<joint name="j{number}" type="continuous">{ends}</joint>')
    return f'<robot name="r">{"".join(parts)}</robot>'


CORNERS = [(x, y) for x in (-0.15, 0.15) for y in (-1.0, 1.0)]


def corners(y: float) -> str:
    return robot([(x, y * side) for x, side in CORNERS])


def test_wheels_inside_the_body_are_one_finding(findings: Findings) -> None:
    (finding,) = findings(corners(0.08))
    assert (finding.rule, finding.severity) == ("overlap", "warning")
    wheels = "'wheel0', 'wheel1', 'wheel2', 'wheel3'"
    assert finding.problem == f"more than half of {wheels} is inside the collision shape of 'base'"
    assert "push" not in str(finding)  # they hang on the body, and do not collide with it


@pytest.mark.parametrize("y", [0.097, 0.1, 0.15])
def test_wheels_that_are_half_inside_the_body_at_most_are_silent(
    y: float, findings: Findings
) -> None:
    assert findings(corners(y)) == []


def test_wheels_inside_each_other_are_one_finding(findings: Findings) -> None:
    places = [(0.15, 0.15), (0.1, 0.15), (0.15, -0.15), (0.1, -0.15)]
    (finding,) = [found for found in findings(robot(places)) if found.rule == "overlap"]
    assert (
        finding.problem
        == "wheels 'wheel0' and 'wheel1', 'wheel2' and 'wheel3' are inside each other"
    )
