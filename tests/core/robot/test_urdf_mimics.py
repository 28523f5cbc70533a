"""Joints that follow others, never themselves."""

from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.loading import parse
from holozen.robot.model import Mimic, RobotModel

ORIGIN = Path("somewhere/robot.urdf")
JOINT = '\n<joint name="{0}" type="continuous"><parent link="base"/><child link="l{0}"/>{1}</joint>'


def robot(**follows: str) -> RobotModel:
    """Joints by name, each following what it is given, "" for none."""
    links = "".join(f'<link name="l{name}"/>' for name in follows)
    mimic = {
        name: other and f'<mimic joint="{other}" multiplier="-2" offset="0.5"/>'
        for name, other in follows.items()
    }
    joints = "".join(JOINT.format(name, mimic[name]) for name in follows)
    return parse(f'<robot name="r"><link name="base"/>{links}{joints}</robot>', ORIGIN)


def test_a_mimic_is_read_with_its_defaults() -> None:
    assert robot(a="", b="a").joints["b"].mimic == Mimic("a", -2, 0.5)
    text = (
        f'<robot name="r"><link name="base"/><link name="la"/>{JOINT.format("a", "")}<link '
        f'name="lb"/>{{}}</robot>'
    )
    plain = parse(text.format(JOINT.format("b", '<mimic joint="a"/>')), ORIGIN)
    assert plain.joints["b"].mimic == Mimic("a", 1, 0)
    assert plain.joints["a"].mimic is None


def test_a_joint_may_follow_one_that_follows_another() -> None:
    assert robot(a="b", b="c", c="", d="b", e="a").warnings == ()


def test_a_mimic_that_cannot_be_is_refused() -> None:
    for follows, message in [
        (
            {"a": "a"},
            "line 2: <mimic> of <joint name='a'> follows itself in a loop through the joints a",
        ),
        (
            {"a": "b", "b": "a"},
            "line 2: <mimic> of <joint name='a'> follows itself in a loop through the joints a, b",
        ),
        (
            {"a": "b", "b": "c", "c": "b"},
            "line 3: <mimic> of <joint name='b'> follows itself in a loop through the joints b, c",
        ),
        (
            {"wheel": "", "b": "wheell"},
            "line 3: <mimic> of <joint name='b'> follows the joint 'wheell', which does not exist "
            "(did you mean 'wheel'?); joints: b, wheel",
        ),
    ]:
        with pytest.raises(RobotError) as error:
            robot(**follows)
        assert str(error.value) == f"{ORIGIN}, {message}"


def test_a_thousand_joints_in_a_chain_of_mimics_are_read() -> None:
    names = [f"j{index}" for index in range(999)]
    assert len(robot(**dict(zip(names, ["", *names], strict=False))).joints) == 999
