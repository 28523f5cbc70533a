"""What drags over the ground, so that the wheels do not carry the robot."""

from collections.abc import Callable

import pytest

Rules = Callable[..., list[str]]

BODY = '<collision><origin xyz="0 0 0.02"/><geometry><box size="0.3 0.2 0.1"/>'
LOW = BODY.replace("0.02", "0")
BALL = '<link name="ball">'
PLANAR = '<plugin name="drive" filename="libgazebo_ros_planar_move.so">'
SMOOTH = '<gazebo reference="base"><mu1>0.1</mu1><mu2>0.1</mu2></gazebo>'
FOOT = '<link name="foot"><inertial><mass value="0.01"/><inertia ixx="1e-6" iyy="1e-6" izz="1e-6"/></inertial>'


def foot(name: str, shape: str, x: float) -> str:
    """A part of the body that reaches as deep as the wheels."""
    joint = (
        f'<joint name="j" type="fixed"><parent link="base"/><child link="{name}"/><origin xyz="{x} 0 -0.04"/></joint>'
    )
    collision = f"<collision><geometry>{shape}</geometry></collision>"
    return FOOT.replace("foot", name) + collision + "</link>" + joint + "</robot>"


BOX = '<box size="0.02 0.02 0.02"/>'


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (BODY, LOW, ["wheel-load"]),
        ("</robot>", foot("foot", BOX, 0.0), ["wheel-load"]),
        ("</robot>", foot("foot", BOX, 0.13), ["wheel-load"]),
        ("</robot>", foot("foot", '<cylinder radius="0.01" length="0.02"/>', 0.0), ["wheel-load"]),
        ("</robot>", foot("foot", '<sphere radius="0.01"/>', 0.0), []),
        ("</robot>", foot("front_caster", BOX, 0.0), []),
        ("</robot>", foot("ball_2", BOX, 0.0), []),
        ("</robot>", foot("foot", BOX, 0.0).replace("-0.04", "-0.036"), []),
    ],
)
def test_what_is_as_low_as_the_wheels_drags(old: str, new: str, expected: list[str], good: str, rules: Rules) -> None:
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
