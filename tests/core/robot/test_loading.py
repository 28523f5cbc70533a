"""Files become checked robots, as people really keep them, or texts that need no other file."""

import math
import re
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given
from hypothesis import strategies as st
from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files import description, loading
from holozen.robot.files.loading import both, load, parse
from holozen.robot.files.meshes import hull
from holozen.robot.inertia import ROUNDING
from holozen.robot.model import (
    Drive,
    Inertial,
    Limits,
    Link,
    Omni,
    Planar,
    Pose,
    Shape,
    driven,
)
from tests.core.robots import ORIGIN, robot
from tests.students import MIXED, ROS_1, ROS_2, hb_bot, workspace

pytestmark = pytest.mark.usefixtures("forked")

REPO = Path(__file__).parents[3]

TWO_LINKS = '<link name="base"/><link name="wheel"/>'
JOINT = '<joint name="j" type="continuous"><parent link="base"/><child link="wheel"/>{}</joint>'


def refusal(body: str) -> str:
    with pytest.raises(RobotError) as error:
        robot(body)
    message = str(error.value)
    assert "\n" not in message
    return message


def inertial(
    mass: str = "1", inertia: str = 'ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"'
) -> str:
    return f'<link name="a"><inertial><mass value="{mass}"/><inertia {inertia}/></inertial></link>'


def collision(geometry: str) -> str:
    return f'<link name="a"><collision><geometry>{geometry}</geometry></collision></link>'


def test_links_joints_and_root_are_read() -> None:
    model = robot(
        '<link name="base"><inertial><origin xyz="0 0 0.28" rpy="0.1 0 0"/><mass value="0.28"/>'
        '<inertia ixx="1.5" ixy="0.1" ixz="0.2" iyy="2" iyz="0.3" izz="3"/></inertial></link>'
        '<joint name="j" type="revolute"><origin xyz="0 0.68 0.18" rpy="0 0 1.5"/><parent '
        'link="base"/>'
        '<child link="wheel"/><axis xyz="2 3 6"/><limit effort="5" velocity="6" lower="-1" '
        'upper="2"/>'
        "</joint>"
        '<link name="wheel"><inertial><mass value="1"/><inertia ixx="1" iyy="1" '
        'izz="1"/></inertial></link>'
    )
    assert (model.name, model.root, list(model.links), model.warnings) == (
        "r",
        "base",
        ["base", "wheel"],
        (),
    )
    expected = Inertial(Pose((0, 0, 0.28), (0.1, 0, 0)), 0.28, (1.5, 0.1, 0.2, 2, 0.3, 3))
    assert model.links["base"] == Link("base", expected, (), ())
    joint = model.joints["j"]
    assert (joint.kind, joint.parent, joint.child) == ("revolute", "base", "wheel")
    assert joint.pose == Pose((0, 0.68, 0.18), (0, 0, 1.5))
    assert joint.axis == pytest.approx((2 / 7, 3 / 7, 6 / 7))
    assert joint.limits == Limits(5, 6, -1, 2)


def test_each_kind_of_joint_is_known() -> None:
    for kind in ["continuous", "revolute", "prismatic", "fixed", "floating", "planar"]:
        assert (
            robot(TWO_LINKS + JOINT.format("").replace("continuous", kind)).joints["j"].kind == kind
        )


def test_what_a_joint_leaves_out_takes_the_urdf_default() -> None:
    joint = robot(TWO_LINKS + JOINT.format("")).joints["j"]
    assert (joint.pose, joint.axis, joint.limits) == (Pose(), (1, 0, 0), Limits())
    joint = robot(
        TWO_LINKS + JOINT.format('<limit effort="5" velocity="5" lower="0" upper="0"/>')
    ).joints["j"]
    assert (joint.limits.lower, joint.limits.upper) == (-math.inf, math.inf)


def test_a_fixed_joint_may_have_an_axis_without_direction() -> None:
    body = TWO_LINKS + JOINT.format('<axis xyz="0 0 0"/>')
    for kind in ("fixed", "floating"):
        assert robot(body.replace("continuous", kind)).joints["j"].axis == (1, 0, 0)
    assert "<axis> of <joint name='j'> has no direction" in refusal(body)


def test_each_kind_of_shape_keeps_its_size_in_metres(tmp_path: Path) -> None:
    base = Path(shutil.copy(REPO / "meshes" / "base.dae", tmp_path))
    shapes = {
        '<box size="1 2  3"/>': Shape("box", (1, 2, 3), Pose()),
        '<cylinder length="0.13" radius="0.14"/>': Shape("cylinder", (0.14, 0.13), Pose()),
        '<sphere radius="0.5"/>': Shape("sphere", (0.5,), Pose()),
        '<mesh filename="base.dae" scale="0.01  0.01 -0.01"/>': Shape(
            "mesh", (0.01, 0.01, -0.01), Pose(), base, points=hull(base, (0.01, 0.01, -0.01))
        ),
        '<mesh filename="base.dae"/>': Shape("mesh", (1, 1, 1), Pose(), base, points=hull(base)),
    }
    for text, shape in shapes.items():
        model = parse(f'<robot name="r">{collision(text)}</robot>', tmp_path / "robot.urdf")
        assert model.links["a"].collisions == (shape,)
        assert model.warnings == ()


def test_visuals_and_collisions_have_their_own_pose() -> None:
    box = '<origin xyz="0 0 {}"/><geometry><box size="1 1 1"/></geometry>'
    link = (
        "<link "
        f'name="a"><visual>{box.format(1)}</visual><collision>{box.format(2)}</collision></link>'
    )
    parts = robot(link).links["a"]
    assert [shape.pose.xyz for shape in (*parts.visuals, *parts.collisions)] == [
        (0, 0, 1),
        (0, 0, 2),
    ]


def test_loose_attributes_crlf_and_comments_are_accepted() -> None:
    text = (
        '<?xml version="1.0" encoding="ISO-8859-1" ?>\r\n<!DOCTYPE robot>\r\n<robot name ="r" >\r\n'
        '<!-- Räder --><link\tname = "a">\r\n<inertial><mass value ="  2 "/>'
        '<inertia ixx="1" iyy="1" izz="1"/></inertial></link>\r\n</robot>\r\n'
    )
    link = parse(text, ORIGIN).links["a"]
    assert link.inertial is not None and link.inertial.mass == 2


def test_joints_of_a_transmission_are_no_joints_of_the_robot() -> None:
    assert robot('<link name="a"/><transmission><joint name="j"/></transmission>').joints == {}


def test_a_mistake_is_refused_with_file_line_and_element() -> None:
    for body, message in [
        ("", "line 1: <robot name='r'> has no <link>; a robot has at least one"),
        ("<link/>", "line 2: <link> of <robot name='r'> has no name"),
        ('<link name="a"/>\n<link name="a"/>', "line 3: <link name='a'> is defined twice"),
        (
            TWO_LINKS + JOINT.format("") + "\n" + JOINT.format(""),
            "line 3: <joint name='j'> is defined twice",
        ),
        ('<link name="a"/><link name="b"/>', "<robot name='r'> has 2 root links: a, b"),
        (
            '<link name="base"/>' + JOINT.format(""),
            "names the unknown child link 'wheel'; links: base",
        ),
        (
            '<link name="wheel"/>' + JOINT.format(""),
            "names the unknown parent link 'base'; links: wheel",
        ),
        (
            TWO_LINKS + JOINT.format("").replace("continuous", "hinge"),
            "unknown type 'hinge'; known types: continuous",
        ),
        (
            TWO_LINKS + JOINT.format("").replace('type="continuous"', ""),
            "<joint name='j'> has no type",
        ),
        (
            TWO_LINKS + JOINT.format("").replace('<child link="wheel"/>', ""),
            "<joint name='j'> has no <child>",
        ),
        (
            TWO_LINKS + JOINT.format("").replace("<parent link", "<parent lnk"),
            "<parent> of <joint name='j'> has no link",
        ),
        (TWO_LINKS + JOINT.format('<origin rpy="0 1"/>'), "rpy: '0 1' has 2 numbers instead of 3"),
        (TWO_LINKS + JOINT.format('<origin xyz="0, 1, 2"/>'), "xyz: '0,' is not a finite number"),
        (TWO_LINKS + JOINT.format('<origin xyz=""/>'), "<origin> of <joint name='j'> has no xyz"),
        (
            TWO_LINKS
            + JOINT.format('<limit lower="2" upper="1"/>').replace("continuous", "revolute"),
            "above upper=1",
        ),
        (
            TWO_LINKS + JOINT.format('<dynamics friction="-1"/>'),
            "<dynamics> of <joint name='j'> has friction -1.0 and damping 0.0",
        ),
        (
            TWO_LINKS + JOINT.format('<dynamics damping="abc"/>'),
            "damping: 'abc' is not a finite number",
        ),
        (TWO_LINKS + JOINT.format("<mimic/>"), "<mimic> of <joint name='j'> has no joint"),
        (TWO_LINKS + JOINT.format('<limit effort="abc"/>'), "effort: 'abc' is not a finite number"),
        (inertial(mass="-1"), "<mass> of <link name='a'> value: -1.0 kg is negative"),
        (inertial(mass="nan"), "'nan' is not a finite number"),
        (inertial(mass="inf"), "'inf' is not a finite number"),
        (inertial(mass="1e999"), "'1e999' is not a finite number"),
        (inertial(mass="1_0"), "'1_0' is not a finite number"),
        (inertial(mass="1e300"), "'1e300' is beyond 1e+06"),
        (inertial(mass=""), "<mass> of <link name='a'> has no value"),
        (
            inertial(mass="${mass}"),
            "'${mass}' is not a finite number; write a number, or ${...} in a xacro file",
        ),
        (
            inertial(mass="pi/2"),
            "'pi/2' is not a finite number; write a number, or ${...} in a xacro file",
        ),
        (
            inertial(mass="\u22121"),
            "'\u22121' is not a finite number; write -1, with the minus sign of the keyboard",
        ),
        (inertial(inertia='ixx="-1" iyy="1" izz="1"'), "a moment of inertia is never negative"),
        (inertial(inertia='ixx="abc"'), "ixx: 'abc' is not a finite number"),
        ('<link name="a"><inertial/></link>', "<inertial> of <link name='a'> has no <mass>"),
        ('<link name="a"><visual/></link>', "<visual> of <link name='a'> has no <geometry>"),
        (collision(""), "contains nothing; it must contain <box>, <cylinder>, <sphere> or <mesh>"),
        (collision("<cone/>"), "contains <cone>; it must contain"),
        (
            collision('<box size="1 1 0"/>'),
            "has the size (1.0, 1.0, 0.0) m; each number must be 1e-06 or more",
        ),
        (collision('<cylinder radius="-1" length="1"/>'), "has the size (-1.0, 1.0) m"),
        (collision('<sphere radius="0"/>'), "<sphere> of <link name='a'> has the size (0.0,) m"),
        (
            collision('<mesh filename="x" scale="0.01"/>'),
            "scale: '0.01' has 1 numbers instead of 3",
        ),
        (collision("<mesh/>"), "<mesh> of <link name='a'> has no filename"),
    ]:
        line = refusal(body)
        assert line.startswith(f"{ORIGIN}, line ") and message in line


def joined(*pairs: str) -> str:
    """Links a, b, c and a fixed joint for each pair of letters, parent and child, one a line."""
    links = "".join(f'<link name="{name}"/>' for name in "abc")
    joint = '\n<joint name="{0}" type="fixed"><parent link="{0[0]}"/><child link="{0[1]}"/></joint>'
    return links + "".join(joint.format(pair) for pair in pairs)


def test_a_circle_of_joints_is_refused_also_beside_a_sound_tree() -> None:
    assert "has joints that form a loop through the links a, b, c;" in refusal(
        joined("ab", "bc", "ca")
    )
    assert "has joints that form a loop through the links b, c;" in refusal(joined("bc", "cb"))
    assert "has joints that form a loop through the links c;" in refusal(joined("ab", "cc"))


def test_a_link_with_two_parents_is_refused() -> None:
    message = (
        f"{ORIGIN}, line 5: <joint name='bc'> has the child link 'c', which is already the "
        "child of joint 'ac'"
    )
    assert refusal(joined("ab", "ac", "bc")) == message


def test_what_is_no_robot_is_refused_with_its_line() -> None:
    for text, message in [
        ("", ": the file is empty"),
        (" \r\n", ": the file is empty"),
        (
            "<robot name='r'>\n<link name='a'>\n</robot>",
            ", line 3: broken XML: mismatched tag; <link name='a'> of ",
        ),
        ("<robot name='r'>\n<link", ", line 2: broken XML: unclosed token; <robot name='r'> of "),
        ("just text", ", line 1: broken XML: syntax error"),
        ("<sdf version='1.6'/>", ", line 1: <sdf> "),
        ("<urdf/>", ", line 1: <urdf> is not a robot; a URDF file starts with <robot name=...>"),
        ("<robot><link name='a'/></robot>", ", line 1: <robot> has no name"),
        (
            "<!DOCTYPE r [\n<!ENTITY a SYSTEM 'file:///etc/passwd'>]><robot/>",
            ", line 2: the entity 'a' is declared",
        ),
        (
            "<!DOCTYPE r [<!ENTITY a 'x'><!ENTITY b '&a;&a;'>]><robot>&b;</robot>",
            "the entity 'a' is declared",
        ),
        ("<robot name='r'>&a;</robot>", "broken XML: undefined entity"),
        ("<robot name='\ud800'/>", "<robot name='?'> has no <link>"),
    ]:
        with pytest.raises(RobotError) as error:
            parse(text, ORIGIN)
        assert str(error.value).startswith(
            f"{ORIGIN}{message}" if message[0] in ",:" else str(ORIGIN)
        )
        assert message in str(error.value)


def test_an_inertia_that_no_body_has_makes_a_point_mass_and_is_reported() -> None:
    for inertia, possible in [
        ('ixx="0" iyy="0" izz="0"', False),
        ('ixx="1" iyy="1" ivz="1"', False),
        ('ixx="1" iyy="1" izz="1" ixy="5"', False),
        ('ixx="1" iyy="1" izz="1" ixz="-5"', False),
        ('ixx="1" iyy="1" izz="1" iyz="5"', False),
        ('ixx="1e-9" iyy="1e-9" izz="1e-9"', True),
        ('ixx="2" iyy="2" izz="2" ixy="0.5" ixz="-0.5" iyz="0.25"', True),
    ]:
        model = robot(inertial(inertia=inertia))
        part = model.links["a"].inertial
        assert part is not None and part.mass == 1
        assert any(part.inertia) == possible
        message = f"{ORIGIN}, line 2: <inertia> of <link name='a'> is zero or not positive definite"
        assert [warning.startswith(message) for warning in model.warnings] == (
            [] if possible else [True]
        )


def test_a_long_value_is_cut_and_an_error_outside_all_elements_stands_alone() -> None:
    assert f"value: '{'9' * 77}...' is not a finite number" in refusal(
        inertial(mass="9" * 300 + "x")
    )
    assert f"value: '{'9' * 79}x' is not a finite number" in refusal(inertial(mass="9" * 79 + "x"))
    with pytest.raises(RobotError) as error:
        parse("just text", ORIGIN)
    assert str(error.value).startswith(
        f"{ORIGIN}, line 1: broken XML: syntax error; write each element as"
    )


def test_a_mass_of_zero_is_reported() -> None:
    (warning,) = robot(inertial(mass="0")).warnings
    assert warning.startswith(f"{ORIGIN}, line 2: <inertial> of <link name='a'> has no mass")


def test_a_missing_mesh_is_a_warning_that_names_file_line_and_element() -> None:
    model = robot(
        '<link name="a">\n<visual><geometry><mesh '
        'filename="package://holo/gone.dae"/></geometry></visual>\n'
        '<collision><geometry><mesh filename="gone.stl"/></geometry></collision></link>'
    )
    visual, hit = model.warnings
    box = "is replaced by a box of 0.1 x 0.1 x 0.1 m"
    assert visual.startswith(f"{ORIGIN}, line 3: <mesh> of <link name='a'> (visual) {box}: ")
    assert hit.startswith(
        f"{ORIGIN}, line 4: <mesh> of <link name='a'> (collision) {box}: no such file 'gone.stl'"
    )
    assert (
        model.links["a"].visuals
        == model.links["a"].collisions
        == (Shape("box", (0.1, 0.1, 0.1), Pose()),)
    )


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_joint_that_needs_a_limit_and_has_none_is_a_warning(kind: str) -> None:
    model = robot(TWO_LINKS + JOINT.format("").replace("continuous", kind))
    assert model.warnings == (
        f"{ORIGIN}, line 2: <joint name='j'> is {kind} and has no <limit>; it is treated as "
        "unlimited",
    )


def test_a_bound_that_a_limit_leaves_out_is_zero() -> None:
    joint = JOINT.format('<axis/><limit lower="-1e16"/>').replace("continuous", "revolute")
    assert robot(TWO_LINKS + joint).joints["j"].limits == Limits(math.inf, math.inf, -1e16, 0)
    assert (
        robot(TWO_LINKS + joint.replace("lower", "upper").replace("-", "")).joints["j"].limits.lower
        == 0
    )
    assert robot(TWO_LINKS + joint.replace("-1e16", "0")).joints["j"].limits.upper == 0
    assert robot(TWO_LINKS + joint).joints["j"].axis == (1, 0, 0)


@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_an_inertia_is_kept_exactly_when_a_body_can_have_its_principal_moments(
    entries: list[float],
) -> None:
    xx, xy, xz, yy, yz, zz = entries
    xx, yy, zz = abs(xx), abs(yy), abs(zz)
    least, _, largest = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    # of the sum of the other two, and a little for rounding
    above = largest - (xx + yy + zz) * (0.5 + ROUNDING)
    assume(abs(least) > 1e-6 and abs(above) > 1e-6)
    text = f'ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"'
    part = robot(inertial(inertia=text)).links["a"].inertial
    assert part is not None and any(part.inertia) == (least > 0 > above)


def test_four_hundred_links_in_a_row_are_read() -> None:
    links = "".join(f'<link name="l{i}"/>' for i in range(400))
    joint = '<joint name="j{0}" type="fixed"><parent link="l{0}"/><child link="l{1}"/></joint>'
    model = robot(links + "".join(joint.format(i, i + 1) for i in range(399)))
    assert model.root == "l0" and len(model.joints) == 399


def test_a_thousand_links_are_read_and_one_more_is_refused() -> None:
    links = [f'<link name="l{i}"/>' for i in range(1001)]
    joint = '<joint name="j{0}" type="fixed"><parent link="l0"/><child link="l{0}"/></joint>'
    joints = [joint.format(i) for i in range(1, 1000)]
    assert len(robot("".join([*links[:1000], *joints])).links) == 1000
    assert "has 1001 links; a robot has at most 1000 links and 1000 joints" in refusal(
        "".join(links)
    )
    many = "".join(joint.format(i) for i in range(1001))
    assert "has 1001 joints; a robot has at most 1000" in refusal(links[0] + many)


def test_dynamics_of_a_joint_are_read() -> None:
    joint = robot(TWO_LINKS + JOINT.format('<dynamics friction="0.1" damping="0.2"/>')).joints["j"]
    assert (joint.friction, joint.damping) == (0.1, 0.2)
    joint = robot(TWO_LINKS + JOINT.format('<dynamics damping="0.2"/>')).joints["j"]
    assert (joint.friction, joint.damping) == (0.0, 0.2)


def test_a_robot_without_drive_gets_planar_move_on_its_root_and_one_with_a_drive_keeps_it() -> None:
    model = driven(robot('<link name="a"/>'), "planar_move")
    assert model.drive == Drive(robot_base_frame="a")
    assert driven(model, "planar_move") is model
    omni = driven(model, "omni").drive
    assert omni == Drive(robot_base_frame="a", mechanism=Omni())
    assert driven(driven(model, "omni"), "omni").drive == omni


def test_an_sdf_text_is_read_as_one() -> None:
    text = (
        "<sdf version='1.6'><model name='m'><link "
        "name='a'><inertial><mass>2</mass></inertial></link></model></sdf>"
    )
    model = parse(text, ORIGIN)
    assert (model.name, model.root) == ("m", "a")


def test_a_file_that_is_too_large_is_refused_by_its_size(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    with path.open("wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(
        RobotError, match=r"contains 100\.0 MB of XML; a robot or world has at most 4 MB"
    ):
        load(path)


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff<robot name='r'>{}</robot>",
        "<?a b?><robot name='r'><!-- ü -->{}<?c?></robot>",
        "<robot xmlns='x' xmlns:y='z' name='r'>\r\n{}\r\n<y:b/></robot>",
    ],
)
def test_what_xml_allows_around_the_elements_does_not_matter(text: str) -> None:
    assert parse(text.format("<link name='a'/>"), ORIGIN).root == "a"


def test_a_xacro_file_is_loaded_with_its_arguments(tmp_path: Path) -> None:
    path = tmp_path / "robot.xacro"
    head = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    path.write_text(
        f'{head}<xacro:arg name="m" default="1"/><link name="{{}}"/></robot>'.format("$(arg m)")
    )
    assert load(path).root == "1"
    assert load(path, {"m": "b"}).root == "b"
    for name in ("robot.xacro", "robot.urdf"):
        (tmp_path / name).write_text(f'\n{head}<xacro:property name="x" value="1"/></robot>')
        with pytest.raises(RobotError, match=rf"{name}, line 2: <robot name"):
            load(tmp_path / name)


def test_a_mistake_in_a_macro_is_at_its_line_also_in_another_file(tmp_path: Path) -> None:
    head = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
    (tmp_path / "part.xacro").write_text(
        f'{head}<xacro:macro name="part" params="name">\n<link '
        f'name="${{name}}">\n<visual>\n<origin xyz="0 0 abc"/>'
        '<geometry><box size="1 1 1"/></geometry></visual></link></xacro:macro></robot>'
    )
    path = tmp_path / "robot.xacro"
    path.write_text(
        f'{head}<xacro:include filename="part.xacro"/>\n\n<xacro:part name="a"/></robot>'
    )
    for function in (load, partial(both, args={}, packages={}, strict=False, allow_env=())):
        with pytest.raises(
            RobotError, match=r"part\.xacro, line 5: <origin> of <link name='a'> xyz: 'abc'"
        ):
            function(path)
    computed = '<xacro:arg name="f" default="part"/><xacro:include filename="$(arg f).xacro"/>'
    path.write_text(f'{head}{computed}\n<xacro:part name="a"/></robot>')
    with pytest.raises(
        RobotError, match=r"robot\.xacro \(as `holozen xacro` prints it\), line \d+: <origin>"
    ):
        load(path)


def test_packages_are_given_to_xacro_and_to_meshes(tmp_path: Path) -> None:
    (tmp_path / "else").mkdir()
    shutil.copy(REPO / "meshes" / "base.dae", tmp_path / "else")
    path = tmp_path / "robot.urdf"
    mesh = collision('<mesh filename="package://p/base.dae"/>')
    path.write_text(f'<robot name="r">{mesh}</robot>')
    (shape,) = load(path, packages={"p": tmp_path / "else"}).links["a"].collisions
    assert shape.path == tmp_path / "else" / "base.dae"


def test_hb_bot_is_read_as_the_lesson_describes_it() -> None:
    model = load(REPO / "urdf" / "hb_bot.urdf.xacro")
    assert model.warnings == ()
    assert (model.name, model.root, len(model.links)) == ("hb_bot", "footprint_link", 5)
    base = model.links["base_link"]
    assert base.inertial == Inertial(
        Pose((0, 0, 0.28)), 0.28, (0.01166666666667, 0, 0, 0.01166666666667, 0, 0.01166666666667)
    )
    (visual,) = base.visuals
    assert visual.size == (0.01, 0.01, 0.01)
    wheels = [joint for joint in model.joints.values() if joint.kind == "continuous"]
    assert [joint.pose.xyz for joint in wheels] == [
        (0, 0.68, 0.18),
        (-0.58, -0.36, 0.18),
        (0.58, -0.36, 0.18),
    ]
    assert {joint.axis for joint in wheels} == {(0, 1, 0)}
    assert {joint.limits for joint in wheels} == {Limits(effort=5, velocity=5)}
    assert model.drive is not None and model.drive.command_topic == "cmd_vel"


REPOSITORY = Path(__file__).parents[3]
ELSEWHERE = Path("/elsewhere/robot.urdf")
DATA = re.compile(r"data:model/stl;base64,[A-Za-z0-9+/=]+")

URDF = """<?xml version="1.0" encoding="utf-8"?>
<!-- ä: <collision><geometry><mesh filename="box.stl"/></geometry></collision> -->
<robot name="r" note='filename="box.stl"'>\r
  <link name="a>b">
    <visual><geometry><mesh filename="box.stl" scale="1 1 2"/></geometry></visual>
    <collision><geometry>
      <mesh
        scale="1 1 2"  filename = '%s'  />
    </geometry></collision>
    <collision><geometry><mesh filename="package://p/box.stl"></mesh></geometry></collision>
  </link>
</robot>
<!-- end -->
"""
SDF = """<sdf version="1.6"><model name="m"><link name="a">
<visual name="v"><geometry><mesh><uri>box.stl</uri></mesh></geometry></visual>
<collision name="c"><geometry><mesh><scale>2 2 2</scale><uri> model://p/box.stl </uri></mesh></geometry></collision>
</link></model></sdf>
"""  # noqa: E501


@pytest.fixture
def folder(home: Path) -> Path:
    """Where box.stl is."""
    trimesh.creation.box((1, 2, 3)).export(home / "box.stl")
    return home


def sent(folder: Path, text: str, name: str = "robot.urdf") -> tuple[str, tuple[str, ...]]:
    (folder / name).write_text(text, newline="")
    model, text = both(folder / name, {}, {"p": folder}, False, ())
    return text, model.warnings


def without_files(text: str, uri: str) -> str:
    """The text with its whole files replaced by a URI again."""
    return re.sub(r"data:model/stl\+gzip;base64,[\w+/=]+", uri, text)


def test_only_the_uris_of_meshes_are_replaced(folder: Path) -> None:
    text, warnings = sent(folder, URDF % "box.stl")
    assert warnings == ()
    text = without_files(text, "box.stl")
    assert len(DATA.findall(text)) == 2
    first, second = DATA.finditer(text)
    assert (
        text[: first.start()] + "box.stl" + text[first.end() : second.start()]
        == (URDF % "box.stl").partition("package://")[0]
    )
    assert text[second.end() :] == URDF.partition("package://p/box.stl")[2]


def test_elsewhere_it_has_the_hulls_that_it_has_here(folder: Path) -> None:
    text, _ = sent(folder, URDF % "box.stl")
    there = parse(text, ELSEWHERE, confined=True)
    assert there.warnings == ()
    first, second = there.links["a>b"].collisions
    assert set(first.points) == set(hull(folder / "box.stl", (1, 1, 2)))
    assert set(second.points) == set(hull(folder / "box.stl"))


def test_an_sdf_file_is_sent_with_its_hulls_too(folder: Path) -> None:
    text, (warning,) = sent(folder, SDF, "model.sdf")
    assert "has no <inertial>" in warning
    assert re.sub(DATA, " model://p/box.stl ", without_files(text, "box.stl")) == SDF
    (shape,) = parse(text, ELSEWHERE, confined=True).links["a"].collisions
    assert set(shape.points) == set(hull(folder / "box.stl", (2, 2, 2)))


def test_an_sdf_s_uri_in_cdata_is_replaced_whole(folder: Path) -> None:
    text, _ = sent(folder, SDF.replace(" model://p/box.stl ", "<![CDATA[box.stl]]>"), "model.sdf")
    assert "CDATA" not in text and len(DATA.findall(text)) == 1


def test_a_mesh_that_cannot_be_sent_is_left_with_a_warning(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, warnings = sent(folder, URDF % "gone.stl")
    assert "'gone.stl'" in text and len(DATA.findall(text)) == 1
    assert len(warnings) == 1 and "(collision) is replaced by a box" in warnings[0]
    monkeypatch.setattr(loading, "MAX_SHOWN", 100)
    text, warnings = loading.with_meshes(URDF % "box.stl", folder / "robot.urdf", {"p": folder})
    assert "box.stl" in text and len(DATA.findall(text)) == 2
    assert (
        set(warnings) == {warnings[0]}
        and "the visual mesh" in warnings[0]
        and "take more than" in warnings[0]
    )


def test_an_oversized_mesh_leaves_out_itself_alone_and_equal_ones_are_sent_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("big.stl", "huge.stl"):
        trimesh.creation.icosphere(subdivisions=4, radius=len(name)).export(folder / name)
    names = ("big.stl", "box.stl", "box.stl", "huge.stl", "box.stl")
    visuals = "".join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>' for name in names
    )
    (folder / "robot.urdf").write_text(f'<robot name="r"><link name="a">{visuals}</link></robot>')
    monkeypatch.setattr(loading, "MAX_SHOWN", 2000)
    text, (warning,) = loading.with_meshes(
        (folder / "robot.urdf").read_text(), folder / "robot.urdf", {}
    )
    assert (
        "the visual meshes 'big.stl', 'huge.stl' are not sent: the visual meshes take more than"
        in warning
    )
    assert len(re.findall("base64", text)) == 1 and "big.stl" in text and "huge.stl" in text
    one, *more = [
        shape.data
        for shape in parse(text, ELSEWHERE, confined=True).links["a"].visuals
        if shape.data
    ]
    assert one.startswith("data:model/stl+gzip;base64,") and more == [one, one]
    shown = description.written(parse(text, ELSEWHERE, confined=True))
    assert shown.count(one) == 1 and len(description.read(shown).meshes[0][2]) == 1


def test_what_gazebo_forgives_in_a_urdf_is_forgiven(folder: Path) -> None:
    """A scale of 0 flattens a mesh, a friction of 1e15 does not slip, and a picture may be far
    away.
    """
    link = (
        '<collision><geometry><mesh filename="box.stl" scale="1 1 0"/></geometry></collision>'
        '<visual><origin xyz="4e6 0 0"/><geometry><box size="1 1 1"/></geometry></visual>'
    )
    gazebo = '<gazebo reference="a"><mu1>1e15</mu1><mu2>1e15</mu2></gazebo>'
    (folder / "r.urdf").write_text(f'<robot name="r"><link name="a">{link}</link>{gazebo}</robot>')
    model = load(folder / "r.urdf")
    (warning,) = model.warnings
    assert "has the scale (1.0, 1.0, 0.0); a zero flattens the mesh" in warning
    a = model.links["a"]
    assert (a.surface.mu1, a.visuals[0].pose.xyz[0]) == (1e15, 4e6)
    assert max(point[2] for point in a.collisions[0].points) < 0.002


def test_what_holds_its_mesh_already_is_kept(folder: Path) -> None:
    text, _ = sent(folder, URDF % "box.stl")
    assert sent(folder, text)[0] == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot>", "broken XML"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "the entity 'a' is declared"),
        ("", "is empty"),
    ],
)
def test_a_file_that_is_none_is_refused(folder: Path, text: str, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        sent(folder, text)


def test_the_lesson_s_robot_is_expanded_and_the_same_elsewhere() -> None:
    path = REPOSITORY / "urdf" / "hb_bot.urdf.xacro"
    model, text = both(path, {}, {}, False, ())
    assert model.warnings == () and "${" not in text
    there, here = parse(text, ELSEWHERE, confined=True), load(path)
    assert there.warnings == ()
    assert [link.collisions for link in there.links.values()] == [
        link.collisions for link in here.links.values()
    ]
    assert there.drive == here.drive


DRIVE = Drive(odometry_rate=50, robot_base_frame="footprint_link")


@pytest.mark.parametrize(
    ("folder", "package", "named", "plugin"),
    [
        ("holo", "holo", False, ROS_1),
        ("eyrc_hb", "holo", True, ROS_2),
        ("my workspace/src/hb_task_1b", "hb_task_1b", True, MIXED),
        ("Übung-3", "hb_task_1b", False, ROS_2),
    ],
)
def test_a_workspace_called_anything_loads_without_a_word(
    home: Path, folder: str, package: str, named: bool, plugin: str
) -> None:
    path = workspace(home, folder, hb_bot(package, plugin), package if named else None)
    model = load(path)
    drive = replace(DRIVE, mechanism=Planar(update_rate=100)) if "update_rate" in plugin else DRIVE
    assert (model.warnings, model.drive, len(model.links)) == ((), drive, 5)
    assert {shape.path for link in model.links.values() for shape in link.visuals} == {
        path.parents[1] / "meshes" / "base.dae",
        path.parents[1] / "meshes" / "wheel.stl",
    }


@pytest.mark.parametrize(
    ("turn", "axis", "names"),
    [
        (0.0, "0 -1  0", ("w1", "w2", "w3")),
        (1.0, "0 0 1", ("right_wheel", "Left-Wheel", "wheel 3")),
        (-2.5, "1 0 0", ("a", "b", "c")),
        (math.pi, "0 1 0", ("left", "front", "right")),
    ],
)
def test_wheels_may_stand_anywhere_turn_either_way_and_have_any_name(
    home: Path, turn: float, axis: str, names: tuple[str, str, str]
) -> None:
    model = load(workspace(home, "ws", hb_bot(names=names, turn=turn, axis=axis)))
    assert (model.warnings, model.drive) == ((), DRIVE)
    assert {f"{name}_joint" for name in names} <= set(model.joints)
    assert all(model.links[name].visuals[0].color == (0, 0, 0, 1) for name in names)


def test_a_file_saved_on_windows_loads_as_well(home: Path) -> None:
    assert load(workspace(home, "ws", "\ufeff" + hb_bot(), ends="\r\n")).warnings == ()


MISTAKES = {
    '<gazebo reference="chasis"><mu1>1</mu1></gazebo>': "<gazebo reference='chasis'> names no link "
    "and no joint (did you mean 'chassis'?); it is left out; links: caster, chassis, "
    "footprint_link, front, left, right",
    '<gazebo reference="chassis"><material>Gazebo/Organe</material></gazebo>': "<material> of "
    "<gazebo reference='chassis'> names the colour 'Gazebo/Organe', which Gazebo does not have "
    "(did you mean 'Gazebo/Orange'?)",
    '<gazebo><plugin name="c" filename="libgazebo_ros_control.so"/></gazebo>': "<plugin name='c'> "
    "(libgazebo_ros_control.so) is not supported; joint_states is published anyway, and joints "
    "follow joint_command",
    '<gazebo reference="chassis"><sensor type="gps" name="eye"/></gazebo>': "<sensor name='eye'> "
    "(gps) is not simulated",
    '<transmission name="t"><joint name="font_joint"/></transmission>': "<transmission name='t'> "
    "names the joint 'font_joint', which does not exist (did you mean 'front_joint'?); it is left "
    "out",
    '<link name="caster"/><joint name="c" type="continuous"><parent link="chassis"/>'
    '<child link="caster"/></joint>': "<link name='caster'> has no mass, so it is left out, as in "
    "Gazebo, with the joint 'c'; give it an <inertial>",
}


def test_each_mistake_that_people_make_is_reported_in_one_line_and_the_robot_drives(
    home: Path,
) -> None:
    path = workspace(home, "ws", hb_bot(frame="chasis", extra="\n".join(MISTAKES)))
    model = load(path)
    assert model.drive == DRIVE
    expected = [
        "<robotBaseFrame> of <plugin name='object_controller'> names the base frame 'chasis', "
        "which is not a link; 'footprint_link' is used",
        *MISTAKES.values(),
    ]
    places, problems = zip(*(each.split(": ", 1) for each in model.warnings), strict=True)
    assert all(place.startswith(f"{path}, line ") for place in places)
    assert sorted(problems) == sorted(expected)


def test_a_second_plugin_of_the_lesson_is_reported(home: Path) -> None:
    model = load(workspace(home, "ws", hb_bot(plugin=ROS_1 + ROS_2)))
    assert model.drive == DRIVE
    (warning,) = model.warnings
    assert warning.endswith(
        "<plugin name='object_controller'> is a second drive; only the first one drives"
    )


def test_a_plain_file_whose_elements_use_xacro_is_expanded_as_by_ros_and_a_comment_is_not_xacro(
    tmp_path: Path,
) -> None:
    """As ROS's launch files do, whatever its name is; so the sim, `spawn` and `check` read the same
    robot.
    """
    path = tmp_path / "robot.urdf"
    path.write_text('<robot name="r${1+1}"><!-- ${foo} --><link name="a"/></robot>')
    assert load(path).name == "r2"
    path.write_text('<robot name="r"><!-- ${foo} --><link name="a"/></robot>')
    assert load(path).name == "r"
    path.write_text('<robot name="${foo}"><link name="a"/></robot>')
    with pytest.raises(RobotError, match="'foo' is not defined"):
        load(path)


def test_a_warning_of_the_expansion_is_one_of_the_models(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "colours.xacro").write_text("<robot/>")
    path = tmp_path / "robot.xacro"
    path.write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include '
        'filename="/other/colours.xacro"/>'
        '<link name="a"/></robot>'
    )
    (warning,) = load(path).warnings
    both(path, {}, {}, False, ())
    assert "there is no file '/other/colours.xacro'" in warning
    assert capsys.readouterr().err == "", "its caller prints it, once"
