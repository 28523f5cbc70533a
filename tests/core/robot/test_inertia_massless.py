"""Links without mass: lumped over fixed joints, left out on moving ones, as in Gazebo Classic, with
a warning.
"""

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.model import Surface
from tests.core.robots import ORIGIN, robot

HEAVY = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
ZERO = '<inertial><mass value="0"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>\n'


def joint(name: str, kind: str = "continuous", inside: str = "") -> str:
    """A joint called by the letters of its parent and its child."""
    ends = f'<parent link="{name[0]}"/><child link="{name[1]}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def test_a_massless_link_on_a_fixed_joint_is_normal() -> None:
    parts = (link("a"), link("b", HEAVY), link("c"), joint("ab", "fixed"), joint("bc", "fixed"))
    model = robot(*parts)
    assert (list(model.links), model.warnings) == (["a", "b", "c"], ())


@pytest.mark.parametrize("inside", ["", ZERO])
def test_a_massless_link_on_a_moving_joint_is_left_out_with_all_below_it(inside: str) -> None:
    parts = (link("a", HEAVY), link("b", inside), link("c", HEAVY), link("d"))
    model = robot(*parts, joint("ab"), joint("bc"), joint("cd", "fixed"))
    assert (list(model.links), list(model.joints)) == (["a"], [])
    assert model.warnings == (
        f"{ORIGIN}, line 3: <link name='b'> has no mass, so it is left out, as in Gazebo, with "
        "the joint 'ab' "
        "and the links below it: c, d; give it an <inertial>",
    )


def test_a_massless_link_gets_the_mass_of_what_is_fixed_to_it() -> None:
    model = robot(link("a", HEAVY), link("b"), link("c", HEAVY), joint("ab"), joint("bc", "fixed"))
    assert (list(model.links), model.warnings) == (["a", "b", "c"], ())


def test_a_mass_of_zero_on_a_fixed_joint_is_reported_and_kept() -> None:
    model = robot(link("a", HEAVY), link("b", ZERO), joint("ab", "fixed"))
    assert list(model.links) == ["a", "b"]
    message = (
        "<inertial> of <link name='b'> has no mass; the link is treated as massless, with "
        "no inertia"
    )
    assert model.warnings == (f"{ORIGIN}, line 3: {message}",)


@pytest.mark.parametrize(("mass", "kept"), [("1e-6", False), ("2e-6", True)])
def test_a_millionth_of_a_kilogram_is_no_mass(mass: str, kept: bool) -> None:
    light = HEAVY.replace('mass value="1"', f'mass value="{mass}"')
    model = robot(link("a", HEAVY), link("b", light), joint("ab"))
    assert ("b" in model.links, len(model.warnings)) == (kept, 0 if kept else 1)


def test_a_robot_without_any_mass_keeps_its_links() -> None:
    model = robot(link("a"), link("b"), joint("ab"))
    assert (list(model.links), list(model.joints), model.warnings) == (["a", "b"], ["ab"], ())


def test_what_hangs_on_a_link_that_is_gone_goes_too() -> None:
    follows = joint("ac", inside='<mimic joint="ab"/>')
    gazebo = '<gazebo reference="b"><mu1>1</mu1><sensor name="s" type="imu"/></gazebo>'
    model = robot(link("a", HEAVY), link("b"), link("c", HEAVY), joint("ab"), follows, gazebo)
    assert model.joints["ac"].mimic is None
    assert model.links["c"].surface == Surface()
    assert len(model.warnings) == 2


def test_a_base_frame_that_is_gone_is_reported() -> None:
    move = (
        "<gazebo><plugin "
        'filename="libgazebo_ros_planar_move.so"><robotBaseFrame>b</robotBaseFrame></plugin></gazebo>'
    )
    model = robot(link("a", HEAVY), link("b"), joint("ab"), move)
    assert model.drive is not None and model.drive.robot_base_frame == "a"
    assert "names the base frame 'b', which is not a link; 'a' is used" in model.warnings[1]


def drive(filename: str) -> str:
    tags = "<leftJoint>ab</leftJoint><rightJoint>ac</rightJoint>"
    tags += "<wheelSeparation>0.4</wheelSeparation><wheelDiameter>0.2</wheelDiameter>"
    return f'<gazebo><plugin name="p" filename="{filename}">{tags}</plugin></gazebo>'


def test_a_drive_whose_wheel_has_no_mass_is_refused() -> None:
    with pytest.raises(RobotError) as error:
        robot(
            link("a", HEAVY),
            link("b", HEAVY),
            link("c"),
            joint("ab"),
            joint("ac"),
            drive("libgazebo_ros_diff_drive.so"),
        )
    assert str(error.value) == (
        f"{ORIGIN}, line 4: <link name='c'> has no mass, so the joint 'ac' is left out, as in "
        "Gazebo, "
        "but the drive needs it; give it an <inertial>"
    )


def test_a_root_without_mass_is_reported_and_refused_where_wheels_have_to_push_it() -> None:
    parts = (link("a"), link("b", HEAVY), link("c", HEAVY), joint("ab"), joint("ac"))
    message = (
        f"{ORIGIN}, line 2: <link name='a'> is the root and has no mass, nor have the links "
        "fixed to it; "
    )
    warnings = robot(*parts, drive("libgazebo_ros_planar_move.so")).warnings
    (warning,) = (each for each in warnings if "changes nothing" not in each)
    assert (
        warning == f"{message}Gazebo drops such a robot, but it is kept here: give it an <inertial>"
    )
    with pytest.raises(RobotError) as error:
        robot(*parts, drive("libgazebo_ros_diff_drive.so"))
    assert str(error.value) == f"{message}Gazebo drops such a robot: give it an <inertial>"
