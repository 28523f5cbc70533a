"""The limits of URDF joints."""

import math
from pathlib import Path

from holozen.robot.files.loading import parse
from holozen.robot.model import RobotModel

ORIGIN = Path("somewhere/robot.urdf")


def limited(limit: str, kind: str = "revolute") -> RobotModel:
    joint = f'<joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{limit}</joint>'
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    links = f'<link name="a">{mass}</link><link name="b">{mass}</link>'
    return parse(f'<robot name="r">{links}\n{joint}</robot>', ORIGIN)


def test_a_limit_below_zero_is_none_and_is_reported() -> None:
    for name in ["effort", "velocity"]:
        for kind in ["revolute", "continuous"]:
            model = limited(f'<limit {name}="-1" lower="-1" upper="1"/>', kind)
            assert getattr(model.joints["j"].limits, name) == math.inf
            assert model.warnings == (
                f"{ORIGIN}, line 2: <limit> of <joint name='j'> {name}: -1 is negative; it is "
                "treated as unlimited",
            )


def test_a_limit_of_zero_stays() -> None:
    model = limited('<limit effort="0" velocity="0" lower="-1" upper="1"/>')
    assert (model.joints["j"].limits.effort, model.joints["j"].limits.velocity) == (0, 0)
    assert model.warnings == ()
