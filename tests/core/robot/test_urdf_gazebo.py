"""What `<gazebo reference>` adds to a link."""

from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.loading import parse
from holozen.robot.model import RobotModel, Surface

ORIGIN = Path("somewhere/robot.urdf")
PARTS = (
    '<link name="a"/><link name="b"/><joint name="j" type="fixed"><parent link="a"/><child '
    'link="b"/></joint>'
)


def robot(*gazebo: str) -> RobotModel:
    return parse(f'<robot name="r">\n{PARTS}\n{"".join(gazebo)}</robot>', ORIGIN)


def on(link: str, tags: str) -> str:
    return f'<gazebo reference="{link}">{tags}</gazebo>'


def test_each_tag_of_a_surface_is_read() -> None:
    for tags, surface in [
        ("", Surface()),
        ("<mu1>0.5</mu1><mu2>0.25</mu2>", Surface(mu1=0.5, mu2=0.25)),
        ('<mu1 value="0.5"/><mu2 value="0"/>', Surface(mu1=0.5, mu2=0)),
        ("<mu>0.5</mu>", Surface(mu1=0.5, mu2=0.5)),
        ("<mu1>1</mu1>", Surface(mu1=1)),
        ("<kp>1000000.0</kp><kd> 1.0 </kd>", Surface(kp=1e6, kd=1)),
        ("<kp>1e12</kp>", Surface(kp=1e12)),
        ("<selfCollide>true</selfCollide>", Surface(self_collide=True)),
        ("<self_collide>1</self_collide>", Surface(self_collide=True)),
        ("<selfCollide>False</selfCollide>", Surface()),
        (
            "<collision><surface><friction><ode><mu>0.1</mu><mu2>0.2</mu2></ode></friction>"
            "<contact><ode><kp>3</kp><kd>4</kd></ode></contact></surface></collision>",
            Surface(0.1, 0.2, 3, 4),
        ),
    ]:
        model = robot(on("b", tags))
        assert (model.links["b"].surface, model.links["a"].surface, model.warnings) == (
            surface,
            Surface(),
            (),
        )


def test_gravity_is_switched_off_in_either_spelling() -> None:
    for tags, pulls in [
        ("", True),
        ("<gravity>0</gravity>", False),
        ("<gravity>false</gravity>", False),
        ("<gravity>1</gravity>", True),
        ("<turnGravityOff>true</turnGravityOff>", False),
        ("<turnGravityOff>false</turnGravityOff>", True),
    ]:
        assert robot(on("b", tags)).links["b"].gravity is pulls


def test_several_elements_for_one_link_add_up_and_the_last_wins() -> None:
    model = robot(
        on("b", "<mu1>1</mu1><kp>5</kp>"),
        on("b", "<mu1>2</mu1><turnGravityOff>1</turnGravityOff>"),
        on("b", ""),
    )
    assert model.links["b"].surface == Surface(mu1=2, kp=5)
    assert model.links["b"].gravity is False


@pytest.mark.parametrize("word", ["false", "0"])
def test_gravity_in_a_link_is_honoured_and_a_gazebo_element_overrides_it(word: str) -> None:
    light = f'<link name="c"><gravity>{word}</gravity></link>'
    joint = '<joint name="jc" type="fixed"><parent link="a"/><child link="c"/></joint>'
    assert robot(light + joint).links["c"].gravity is False
    assert robot(light + joint, on("c", "<gravity>true</gravity>")).links["c"].gravity is True
    with pytest.raises(
        RobotError, match="<gravity> of <link name='c'> is 'flase'; it must be true or false"
    ):
        robot(light.replace(word, "flase") + joint)


def test_a_reference_to_a_joint_is_no_mistake() -> None:
    assert robot(on("j", "<implicitSpringDamper>1</implicitSpringDamper>")).warnings == ()


def test_a_reference_to_nothing_is_reported_with_the_nearest_name() -> None:
    model = robot("\n", on("bb", "<mu1>1</mu1>"))
    assert model.warnings == (
        f"{ORIGIN}, line 4: <gazebo reference='bb'> names no link and no joint "
        "(did you mean 'b'?); it is left out; links: a, b",
    )


def test_a_robot_is_static_when_its_file_declares_it() -> None:
    assert robot(
        "<gazebo><static>true</static></gazebo><gazebo><plugin "
        "filename='libgazebo_ros_planar_move.so'/></gazebo>"
    ).static
    assert not robot("<gazebo/>").static


def test_a_robot_whose_root_is_the_world_is_static() -> None:
    parts = PARTS.replace('"a"', '"world"')
    assert parse(f'<robot name="r">{parts}</robot>', ORIGIN).static


def test_a_value_that_cannot_be_is_refused_with_its_line() -> None:
    for tags, message in [
        (
            "<mu1>-1</mu1>",
            "<mu1> of <gazebo reference='b'> is '-1'; it must be a number not below 0",
        ),
        ("<mu2>abc</mu2>", "is 'abc'; it must be a number not below 0"),
        ("<kp>nan</kp>", "is 'nan'"),
        ("<kp>1e300</kp>", "is '1e300'; it must be at most 1e+18"),
        ("<selfCollide>perhaps</selfCollide>", "is 'perhaps'; it must be true or false"),
        ("<gravity>-9.8</gravity>", "is '-9.8'; it must be true or false"),
    ]:
        with pytest.raises(RobotError) as error:
            robot(on("b", tags))
        assert str(error.value).startswith(f"{ORIGIN}, line 3: ") and message in str(error.value)
