"""Each rule finds its mistake in a robot that is good but for it, and nothing else is found."""

import ast
import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.check import rules_xml
from holozen.check.subject import Requirements
from holozen.robot.files import gazebo_plugins
from holozen.robot.files.loading import load
from tests.extensions.check.conftest import HERE, Findings, check_here

Rules = Callable[..., list[str]]

HEAVY = (
    '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
    'iyz="0"/></inertial>'
)
ARM_LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'
LEFT = (
    '<parent link="base"/><child link="left_wheel"/><origin xyz="0.05 0.12 0"/><axis xyz="0 1 0"/>'
)
RIGHT = (
    '<parent link="base"/><child link="right_wheel"/><origin xyz="0.05 -0.12 0"/><axis xyz="0 '
    '1 0"/>'
)
PRODUCTS = 'ixy="0" ixz="0" iyz="0"'
BASE = '<mass value="2"/><inertia ixx="0.009" ixy="0" ixz="0" iyy="0.017" iyz="0" izz="0.024"/>'
SECOND_PARENT = '<joint name="x" type="fixed"><parent link="ball"/><child link="arm"/></joint>'
FRAME = "<robotBaseFrame>footprint</robotBaseFrame>"
BODY = '<collision><origin xyz="0 0 0.02"/><geometry><box size="0.3 0.2 0.1"/>'
SWAPPED = "<leftJoint>right_joint</leftJoint><rightJoint>left_joint<"
PLUGIN = '<plugin name="drive" filename="libgazebo_ros_diff_drive.so">'

SENSOR = (
    '<gazebo reference="base"><sensor name="s" type="imu"><plugin name="i" '
    'filename="libgazebo_ros_imu_sensor.so">'
    "<frame_name>footprnt</frame_name></plugin></sensor></gazebo>"
)
CONTROL = '<ros2_control name="x" type="system"><joint name="{}"/></ros2_control></robot>'
NAMELESS = (
    '<visual><geometry><sphere radius="0.01"/></geometry><material name=""><color '
    'rgba="{}"/></material></visual>'
)
FRAME_ONLY = '<inertial><mass value="0"/></inertial>'

BROKEN = [
    # rule, what is in the good robot, what is there instead, what the finding speaks of
    ("xml", '<link name="arm">', '<!-- a -- b --><link name="arm">', "comment with --"),
    ("xml", '<link name="arm">', '<link name="arm" name="hand">', "twice"),
    (
        "tag",
        '<collision><origin xyz="0 0 0.1"/>',
        '<colision/><collision><origin xyz="0 0 0.1"/>',
        "write <collision>",
    ),
    ("tag", ARM_LIMIT, ARM_LIMIT + '<dynamic damping="1"/>', "write <dynamics>"),
    ("tag", "<mu1>1.0</mu1>", "<slefCollide>true</slefCollide>", "write <selfCollide>"),
    (
        "tag",
        "<commandTopic>cmd_vel</commandTopic>",
        "<comandTopic>cmd_vel</comandTopic>",
        "write <commandTopic>",
    ),
    ("tag", '<link name="arm">', '<Link name="x"/><link name="arm">', "write <link>"),
    (
        "load",
        "<commandTopic>cmd_vel<",
        "<commandTopic>odom<",
        ":63: error: the robot's file puts its commands and its",
    ),
    ("attribute", 'iyy="0.017" iyz="0"', 'iyy="0.017" ivz="0"', "write iyz="),
    (
        "attribute",
        '<sphere radius="0.015"/>',
        '<sphere radius="0.015" raduis="1"/>',
        "write radius=",
    ),
    (
        "attribute",
        'radius="0.05" length="0.03"',
        'radius="0.05" length="0.03" lenght="0.03"',
        "write length=",
    ),
    ("attribute", '<origin xyz="0 0 0.05"/>', '<origin xyz="0 0 0.05" ryp="0 0 0"/>', "write rpy="),
    (
        "place",
        "<inertial>" + BASE + "</inertial>",
        "<inertial>" + BASE + '</inertial><mass value="1"/>',
        "<inertial>",
    ),
    (
        "joint-type",
        'name="arm_joint" type="revolute"',
        'name="arm_joint" type="revolut"',
        'type="revolute"',
    ),
    ("twice", "</robot>", '<link name="ball"/></robot>', "first at"),
    (
        "no-link",
        '<parent link="arm"/><child link="thumb"/>',
        '<parent link="amr"/><child link="thumb"/>',
        "'arm'",
    ),
    (
        "no-link",
        '<parent link="arm"/><child link="thumb"/>',
        '<parent link="arm "/><child link="thumb"/>',
        "'arm '",
    ),
    ("gazebo-link", 'reference="left_wheel"', 'reference="lef_wheel"', "'left_wheel'"),
    (
        "ignored",
        '<sphere radius="0.015"/></geometry>',
        '<sphere radius="0.015"/></geometry><surface/>',
        "<mu1>",
    ),
    ("ignored", '<link name="arm">', '<link name="arm"><pose>0 0 1 0 0 0</pose>', "<origin"),
    ("ignored", ARM_LIMIT, ARM_LIMIT + '<joint_properties damping="1"/>', "<dynamics"),
    (
        "ignored",
        '<sphere radius="0.015"/>',
        '<sphere radius="0.015">0.015</sphere>',
        "'0.015' in <sphere>",
    ),
    (
        "ignored",
        '<sphere radius="0.015"/>',
        '<sphere radius="0.015">0.015</sphere>',
        'write radius="..."',
    ),
    (
        "ignored",
        '<sphere radius="0.015"/>',
        '<sphere radius="0.015"/><sphere radius="1"/>',
        "a second shape in",
    ),
    (
        "ignored",
        ARM_LIMIT,
        ARM_LIMIT + '<axis xyz="0 0 1"/>',
        "a second <axis> in <joint name='arm_joint'>",
    ),
    ("ignored", "</robot>", "--></robot>", "the text '-->' in <robot name='good'> is not read"),
    ("ignored", "</robot>", '<include filename="a.xacro"/></robot>', "write <xacro:include"),
    (
        "ignored",
        "</robot>",
        "<unheard_of/></robot>",
        "<unheard_of> in <robot name='good'> is not read",
    ),
    (
        "ignored",
        '<link name="arm">',
        '<link name="arm"><foo>1</foo>',
        "collision, gravity, inertial, visual",
    ),
    ("floating", '<link name="base">', '<link name="base"><gravity>false</gravity>', "link 'base'"),
    ("wheel-load", BODY, BODY.replace("0.02", "0"), "'base' is as low as the wheels"),
    (
        "wheel-side",
        "<leftJoint>left_joint</leftJoint><rightJoint>right_joint<",
        SWAPPED,
        "'left_joint' (a right joint",
    ),
    (
        "wheel-forward",
        LEFT,
        LEFT.replace("0 1 0", "0 -1 0"),
        "'left_joint' turns about (0 -1 0); forward is",
    ),
    (
        "wheel-measure",
        "<wheelSeparation>0.24",
        "<wheelSeparation>0.3",
        "is 0.3 m, and the wheels are 0.24 m apart",
    ),
    (
        "wheel-measure",
        "<wheelDiameter>0.1<",
        "<wheelDiameter>0.05<",
        "is 0.05 m, and that of 'left_wheel' is 0.1 m",
    ),
    ("tree", "</robot>", '<link name="lost"/></robot>', "'lost' has no parent joint"),
    (
        "tree",
        '<parent link="footprint"/><child link="base"/>',
        '<parent link="ball"/><child link="base"/>',
        "",
    ),
    ("colour", '<material name="orange"/>', '<material name="ornge"/>', "'orange'"),
    (
        "colour",
        '<material name="orange"/>',
        '<material name="orange"><color rgba="1 0 0 1"/></material>',
        "another",
    ),
    ("colour", "0.95 0.45 0.1 1", "0.95 0.45 0.1", "has no alpha, so ROS shows it black"),
    (
        "tag",
        "<robotBaseFrame>",
        "<robot_base_fram>x</robot_base_fram><robotBaseFrame>",
        "write <robot_base_frame>",
    ),
    ("tag", "<mu1>1.0</mu1>", "<sensr/>", "write <sensor>"),
    ("load", '<parent link="base"/><child link="arm"/>', '<child link="arm"/>', "has no <parent>"),
    ("tree", "</robot>", SECOND_PARENT + "</robot>", "two joints"),
    ("attribute", ARM_LIMIT, ARM_LIMIT.replace("/>", ' effrt="1"/>'), "write effort="),
    ("plugin-link", FRAME, FRAME + "<frameName>footprnt</frameName>", "write footprint"),
    ("plugin-link", "</robot>", SENSOR + "</robot>", "write base, which has the sensor; links: "),
    (
        "unused-colour",
        "</robot>",
        '<material name="blue"><color rgba="0 0 1 1"/></material></robot>',
        "'blue'",
    ),
    ("limit", ARM_LIMIT, "", "continuous"),
    (
        "limit-range",
        ARM_LIMIT,
        '<limit lower="1" upper="-1" effort="5" velocity="2"/>',
        "swap them",
    ),
    ("limit-range", ARM_LIMIT, '<limit effort="5" velocity="2"/>', "both 0"),
    (
        "limit-effort",
        ARM_LIMIT,
        '<limit lower="-1" upper="1" effort="0" velocity="2"/>',
        "effort 0",
    ),
    ("limit-effort", ARM_LIMIT, '<limit lower="-1" upper="1" effort="5"/>', "no velocity"),
    ("mimic", '<mimic joint="finger_joint"/>', '<mimic joint="fingr_joint"/>', "'finger_joint'"),
    ("mimic", '<mimic joint="finger_joint"/>', '<mimic joint="thumb_joint"/>', "itself"),
    ("degrees", ARM_LIMIT, '<limit lower="-90" upper="90" effort="5" velocity="2"/>', "1.571"),
    (
        "degrees",
        '<origin xyz="0 0 0.05"/>',
        '<origin xyz="0 0 0.05" rpy="0 0 90"/>',
        "looks like degrees",
    ),
    ("no-inertia", "<inertial>" + BASE + "</inertial>", "", "'base'"),
    ("massless", '<mass value="2"/>', '<mass value="0"/>', "0 kg"),
    (
        "massless",
        '<link name="footprint"/>',
        '<link name="footprint">' + FRAME_ONLY + "</link>",
        "only a frame",
    ),
    (
        "massless",
        BASE,
        '<mass value="2"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>',
        "is zero",
    ),
    ("mass", '<mass value="2"/>', '<mass value="-2"/>', "-2 kg"),
    ("mass", '<mass value="2"/>', "", "no <mass>"),
    ("attribute", '<mass value="2"/>', '<mass vlaue="2"/>', "write value="),
    (
        "heavy",
        BASE,
        '<mass value="2000"/><inertia ixx="9" iyy="17" izz="24" ixy="0" ixz="0" iyz="0"/>',
        "2000 kg",
    ),
    ("inertia", 'ixx="0.009"', 'ixx="-0.009"', "not positive definite"),
    ("inertia", 'ixx="0.009" ', "", "has no ixx; omitted values are 0"),
    (
        "number",
        '<origin xyz="0 0 0.05"/>',
        '<origin xyz="0 0 abc"/>',
        "'abc' is not a finite number",
    ),
    ("number", '<origin xyz="0 0 0.05"/>', '<origin xyz="0 0"/>', "write 3"),
    ("inertia", 'ixx="0.009" ixy="0"', 'ixx="0.009" ixy="0.02"', "not positive definite"),
    ("inertia", 'izz="0.024"', 'izz="0.029"', "sum of the other two"),
    ("inertia-part", 'iyy="0.017" iyz="0"', 'iyy="0.017"', "the inertia of link 'base' has no iyz"),
    (
        "inertia-part",
        BASE,
        BASE.replace(' ixy="0" ixz="0"', "").replace(' iyz="0"', ""),
        f"write {PRODUCTS}",
    ),
    (
        "inertia-size",
        BASE,
        f'<mass value="2"/><inertia ixx="1" iyy="1" izz="1" {PRODUCTS}/>',
        "up to 1 kg m^2",
    ),
    (
        "inertia-size",
        BASE,
        f'<mass value="2"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" {PRODUCTS}/>',
        "a solid body",
    ),
    (
        "floating",
        "</robot>",
        '<gazebo reference="base"><gravity>0</gravity></gazebo></robot>',
        "gravity is off",
    ),
    (
        "floating",
        "</robot>",
        '<gazebo reference="arm"><turnGravityOff>1</turnGravityOff></gazebo></robot>',
        "'arm'",
    ),
    ("wheel-axis", LEFT, LEFT.replace("0 1 0", "1 0 0"), "turns about (1 0 0)"),
    ("wheel-height", LEFT, LEFT.replace("0.12 0", "0.12 0.02"), "20 mm above the other wheels"),
    (
        "wheel-height",
        '<sphere radius="0.015"/>',
        '<box size="0.26 0.02 0.05"/>',
        "the robot stands on",
    ),
    ("plugin-name", "gazebo_ros_diff_drive", "gazebo_ros_dif_drive", "libgazebo_ros_diff_drive.so"),
    (
        "plugin-name",
        "gazebo_ros_diff_drive",
        "gazebo_ros_diff",
        "write libgazebo_ros_diff_drive.so",
    ),
    (
        "plugin-name",
        "ros_diff_drive.so",
        "ros_diff_drive_plugin.so",
        "write libgazebo_ros_diff_drive.so",
    ),
    (
        "plugin-name",
        "libgazebo_ros_diff_drive.so",
        "gazebo_ros_diff_drive",
        "write libgazebo_ros_diff_drive.so",
    ),
    (
        "plugin",
        PLUGIN,
        '<plugin name="x" filename="libmy_magic.so"/>' + PLUGIN,
        "remove it, or correct its name",
    ),
    ("plugin-link", FRAME, "<robotBaseFrame>chasis</robotBaseFrame>", "names no link"),
    ("plugin-joint", "<leftJoint>left_joint", "<leftJoint>left_jiont", "'left_joint'"),
    (
        "plugin-joint",
        "</robot>",
        CONTROL.format("left_jiont"),
        "<ros2_control> is 'left_jiont', which names no joint",
    ),
    ("static", "</robot>", "<gazebo><static>true</static></gazebo></robot>", "remove <static>"),
    (
        "two-drives",
        PLUGIN,
        '<plugin name="a" filename="libgazebo_ros_planar_move.so"/>' + PLUGIN,
        "keep one",
    ),
]


BLUE = '<material name="blue"><color rgba="0 0 1 1"/></material>'
TRANSMISSION = (
    '<transmission name="t"><type>x</type><joint name="left_joint"/><actuator '
    'name="a"/></transmission>'
)
FORK = (
    '<link name="fork"><inertial><mass value="0.1"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" '
    f"{PRODUCTS}/></inertial>"
    "</link>"
    '<joint name="fork_joint" type="continuous"><parent link="base"/><child link="fork"/>'
    '<axis xyz="0 0 1"/></joint>'
    '<link name="front_wheel"><inertial><mass value="0.1"/>'
    f'<inertia ixx="1e-5" iyy="1e-5" izz="1e-5" {PRODUCTS}/></inertial>'
    '<collision><geometry><sphere radius="0.02"/></geometry></collision></link>'
    '<joint name="front_wheel_joint" type="continuous"><parent link="fork"/><child '
    'link="front_wheel"/>'
    '<origin xyz="0.1 0 0.3"/><axis xyz="0 1 0"/></joint>'
)

LEGACY = "<legacyMode>true</legacyMode>"
ROS2_CONTROL = (
    '<ros2_control name="x" '
    'type="system"><hardware><plugin>gazebo_ros2_control/GazeboSystem</plugin></hardware>'
    "</ros2_control>"
)

FINE = [
    # what is in the good robot, and what may as well be there
    ("</robot>", '<gazebo reference="ball"><gravity>false</gravity></gazebo></robot>'),
    ("</robot>", BLUE + BLUE.replace("blue", "green") + "</robot>"),
    ("</robot>", TRANSMISSION + "</robot>"),
    ("</robot>", FORK + "</robot>"),
    ("</robot>", '<ns:extension xmlns:ns="x" raduis="1"/></robot>'),
    ("<mu1>1.0</mu1>", "<mu>1.0</mu><legacyModeNS>true</legacyModeNS><verbose>true</verbose>"),
    ('<sphere radius="0.015"/>', '<sphere radius="0.012"/>'),  # leans back on its ball
    ('<sphere radius="0.015"/>', '<sphere radius="0.03"/>'),  # and forward
    ('<mass value="0.01"/><inertia ixx="1e-6"', '<mass value="0.01"/><inertia ixx="1.001e-6"'),
    (FRAME, FRAME + "<frameName>map</frameName>"),
    (FRAME, FRAME + "<legacyModeNS>true</legacyModeNS>"),
    (LEFT, LEFT.replace("0.12", "0.11")),  # reaches into the body, and out of it
    ('<origin xyz="0 0 0.05"/>', '<origin xyz="0 0 0.05" rpy="0 0 5"/>'),
    (BASE, BASE.replace('izz="0.024"', 'izz="0.0261"')),  # a figure too few
    ("<wheelSeparation>0.24", "<wheelSeparation>0.28"),
    ("<wheelDiameter>0.1<", "<wheelDiameter>0.09<"),
    (
        "<leftJoint>left_joint</leftJoint><rightJoint>right_joint<",
        SWAPPED.replace("<leftJ", LEGACY + "<leftJ", 1),
    ),
    ("</robot>", ROS2_CONTROL + "</robot>"),
    ("</robot>", CONTROL.format("left_joint")),
    (
        '<link name="arm">',
        '<link name="arm">' + NAMELESS.format("1 0 0 1") + NAMELESS.format("0 1 0 1"),
    ),
]


SPAWN_WARNS = [
    # what is in the good robot, and what spawn warns of, which no rule finds
    (
        PLUGIN,
        '<plugin name="x" filename="libgazebo_ros_harness.so"><bodyName>base</bodyName></plugin>'
        + PLUGIN,
    ),
    # Parameters of a plugin that is unknown here may have any name.
    (
        PLUGIN,
        '<plugin name="x" filename="libgazebo_my.so"><max_x_velocity>1</max_x_velocity></plugin>'
        + PLUGIN,
    ),
    (
        PLUGIN,
        '<plugin name="x" filename="libgazebo_my.so"><some_joint>left_jiont</some_joint></plugin>'
        + PLUGIN,
    ),
    (PLUGIN, '<plugin name="x" filename="libgazebo_ros_p3d.so"/>' + PLUGIN),
    (PLUGIN, PLUGIN + "<ros><remapping>cmd_vel=drive</remapping></ros>"),
    (PLUGIN, '<plugin name="x" filename="libhector_gazebo_ros_gps.so"/>' + PLUGIN),
    (FRAME, "<robotBaseFrame>/robot/footprint</robotBaseFrame>"),
    ('<inertia ixx="1e-6"', '<inertia ixx="1e-9"'),
    ("</robot>", '<transmission name="t"><joint name="lost"/></transmission></robot>'),
]


def test_what_spawn_warns_of_is_reported_in_the_same_words(
    good: str, findings: Findings, tmp_path: Path
) -> None:
    for old, new in SPAWN_WARNS:
        assert good.count(old) > 0
        found = [
            finding
            for finding in findings(good.replace(old, new, 1))
            if finding.rule == "load-note"
        ]
        words = [
            f"{finding.place.file}, line {finding.place.line}: {finding.problem}"
            for finding in found
        ]
        assert tuple(words) == load(tmp_path / "robot.urdf").warnings != ()


def test_a_finding_about_one_element_does_not_hide_what_spawn_finds_in_another(
    good: str, findings: Findings
) -> None:
    plugin = (
        '<plugin name="x" filename="libgazebo_ros_p3d.so"><bodyName>bsae</bodyName></plugin>'
        + PLUGIN
    )
    found = {finding.rule: finding.problem for finding in findings(good.replace(PLUGIN, plugin))}
    assert list(found) == ["plugin-link", "load-note"]
    assert found["load-note"].endswith("is not supported; odom and tf are published anyway")


WEIGHTLESS = (
    '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" '
    'izz="0"/></inertial>'
)


@pytest.mark.parametrize(
    "drive", ["", '<gazebo><plugin name="d" filename="libgazebo_ros_planar_move.so"/></gazebo>']
)
def test_a_robot_that_the_sim_refuses_is_an_error(drive: str, findings: Findings) -> None:
    box = '<collision><geometry><box size=".2 .2 .2"/></geometry></collision>'
    found = findings(f'<robot name="r"><link name="base">{WEIGHTLESS}{box}</link>{drive}</robot>')
    (error,) = [finding for finding in found if finding.severity == "error"]
    assert error.rule == "load" and "mass" in error.problem and "give" in error.problem
    crowded = f'<robot name="r"><link name="base">{HEAVY}{box * 501}</link>{drive}</robot>'
    assert "'r' has 501 collision shapes; at most 500" in findings(crowded)[0].problem


def test_a_robot_without_a_collision_shape_falls(findings: Findings) -> None:
    text = f'<robot name="r"><link name="base">{HEAVY}</link></robot>'
    (finding,) = findings(text)
    assert (finding.rule, finding.severity) == ("no-collision", "warning")
    assert finding.problem == "<robot name='r'> has no collision shape and falls through the ground"
    light = text.replace(
        "</robot>", '<gazebo reference="base"><gravity>false</gravity></gazebo></robot>'
    )
    assert [finding.rule for finding in findings(light)] == ["floating"]


def test_what_is_no_mistake_is_not_reported(good: str, findings: Findings) -> None:
    for old, new in FINE:
        assert good.count(old) > 0
        assert findings(good.replace(old, new, 1)) == []


def test_wheels_and_plugins_but_no_drive(good: str, findings: Findings) -> None:
    found = {
        finding.rule: finding.problem
        for finding in findings(good.replace("ros_diff_drive", "ros_camera"))
    }
    assert sorted(found) == ["load-note", "no-drive"]
    assert (
        "no drive plugin" in found["no-drive"] and "(camera) is not simulated" in found["load-note"]
    )


def test_a_drive_outside_gazebo_is_misplaced_and_nothing_else_is_wrong(
    good: str, findings: Findings
) -> None:
    (finding,) = findings(good.replace("<gazebo>", "").replace("</gazebo>\n</robot>", "</robot>"))
    assert (finding.rule, finding.severity, finding.place.line) == ("place", "error", 60)
    assert (finding.problem, finding.fix) == (
        "<plugin> does not belong in <robot name='good'>",
        "move it into <gazebo>",
    )


def test_gazebo_fixes_a_root_called_world_in_place(good: str, findings: Findings) -> None:
    (finding,) = findings(good.replace("footprint", "world"))
    assert (finding.rule, finding.place.line) == ("static", 4)
    assert finding.problem == "the root link is 'world', which Gazebo fixes in place"


def test_a_mere_description_needs_no_drive(good: str, findings: Findings) -> None:
    description = good[: good.index("<gazebo")] + "</robot>"
    assert findings(description) == []


@pytest.mark.parametrize("instead", ["", '<plugin name="c" filename="libgazebo_ros2_control.so"/>'])
def test_ros2_control_alone_drives_nothing_here(
    instead: str, good: str, findings: Findings
) -> None:
    start, end = good.index("<plugin"), good.index("</plugin>") + len("</plugin>")
    text = good[:start] + instead + good[end:]
    (finding,) = findings(text.replace("</robot>", ROS2_CONTROL + "</robot>"))
    assert (finding.rule, finding.severity) == ("no-drive", "warning")
    assert (
        "2 wheels but no drive plugin; not supported:" in finding.problem
        and "ros2" in finding.problem
    )
    assert "libgazebo_ros_diff_drive.so" in finding.fix and "--drive planar_move" in finding.fix


def test_an_arm_needs_no_drive(findings: Findings) -> None:
    shape = '<collision><geometry><sphere radius="1"/></geometry></collision>'
    assert (
        findings(f'<robot name="r"><link name="a">{HEAVY}{shape}</link>{ROS2_CONTROL}</robot>')
        == []
    )


def test_the_settings_of_a_file_for_others_to_include_are_not_lost(rules: Rules) -> None:
    assert "gazebo-link" not in rules(
        '<robot name="r"><gazebo reference="base"><mu1>1</mu1></gazebo></robot>'
    )


def test_a_world_is_refused_with_the_command_that_shows_it(findings: Findings) -> None:
    (finding,) = findings('<sdf version="1.9"><world name="w"/></sdf>', "w.sdf")
    assert "is a world; see it with: holozen sim --world FILE" in finding.problem
    assert finding.fix == "check takes a robot, or a single <model>"


def test_the_good_robots_are_silent(good: str, good_sdf: str, findings: Findings) -> None:
    assert findings(good) == []
    assert findings(good_sdf, "robot.sdf") == []


def test_a_rule_finds_its_mistake_and_no_other_does(good: str, findings: Findings) -> None:
    for rule, old, new, message in BROKEN:
        assert good.count(old) > 0
        found = findings(good.replace(old, new, 1))
        assert {finding.rule for finding in found} == {rule}, "\n".join(map(str, found))
        assert any(message in str(finding) for finding in found)


BALL = '<parent link="base"/><child link="ball"/><origin xyz="-0.12 0 -0.034"/>'


def test_two_casters_as_low_as_the_wheels_are_told(good: str, findings: Findings) -> None:
    low = BALL.replace("-0.034", "-0.035")
    link = good[good.index('<link name="ball">') : good.index('<joint name="ball_joint"')]
    front = low.replace('"ball"', '"front"').replace("-0.12", "0.16")
    more = (
        link.replace('"ball"', '"front"')
        + f'<joint name="front_joint" type="fixed">{front}</joint></robot>'
    )
    level = good.replace(BALL, low).replace("</robot>", more)
    (finding,) = findings(level)
    assert finding.rule == "wheel-load" and "raise the casters by 0.5 mm" in str(finding)
    assert findings(level.replace("-0.035", "-0.0345")) == [], "that is enough"
    assert findings(good.replace(BALL, low)) == [], "one of them carries what the wheels do not"


def test_a_link_with_mass_alone_stands_for_the_body_that_it_is_fixed_to(
    good: str, rules: Rules
) -> None:
    inertial = "<inertial>" + BASE + "</inertial>"
    joint = (
        '<joint name="mass_joint" type="fixed"><parent link="base"/><child link="mass"/></joint>'
    )
    extra = f'<link name="mass">{inertial}</link>{joint}</robot>'
    assert rules(good.replace(inertial, "", 1).replace("</robot>", extra)) == []


def test_a_wheel_without_collision_sinks(good: str, rules: Rules) -> None:
    start = good.index("<collision><origin rpy=")
    end = good.index("</collision>", start) + len("</collision>")
    assert rules(good[:start] + good[end:]) == ["wheel-collision"]


def test_a_robot_heavier_than_steel_though_no_link_is(good: str, findings: Findings) -> None:
    heavy = good.replace(
        BASE,
        '<mass value="149"/><inertia ixx="0.67" iyy="1.27" izz="1.79" ixy="0" ixz="0" iyz="0"/>',
        1,
    )
    assert findings(heavy) == []
    body, finger, rest = heavy.partition('<link name="finger">')
    (finding,) = findings(
        body + finger + rest.replace('<mass value="0.01"/>', '<mass value="100"/>', 1)
    )
    assert finding.rule == "heavy" and "block of steel" in finding.problem


def test_a_warning_does_not_hide_why_a_part_cannot_be_loaded(good: str, rules: Rules) -> None:
    text = good.replace('<material name="orange"/>', '<material name="ornge"/>', 1)
    assert rules(text.replace('<origin xyz="0 0 0.02"/>', '<origin xyz="0 0 abc"/>', 1)) == [
        "colour",
        "number",
    ]


def test_a_wrong_value_hides_no_other(findings: Findings) -> None:
    """All are found at once: mass, numbers, inertia and axis, in one link or several."""
    text = (
        '<robot name="r"><link name="a"><inertial><mass value="nan"/><origin xyz="0 0 abc"/>'
        '<inertia iyy="1" izz="1"/></inertial><collision><geometry><box size="1 inf '
        '1"/></geometry></collision></link>'
        '<link name="b"/><joint name="j" type="continuous"><parent link="a"/><child '
        'link="b"/><axis xyz="0 0 0"/>'
        "</joint></robot>"
    )
    problems = " ".join(each.problem for each in findings(text) if each.severity == "error")
    for part in (
        "mass of link 'a' is not a number",
        "'abc'",
        "'inf'",
        "has no ixx",
        "no direction in xyz",
    ):
        assert part in problems


def test_a_file_that_is_wrong_all_over_ends_soon(good: str, findings: Findings) -> None:
    wrong = "".join(f'<link name="lost{number}"/>' for number in range(3000))
    found = findings(good.replace("</robot>", wrong + "</robot>"))
    assert len(found) == 101
    assert "more than 100" in found[0].problem


def test_a_finding_stands_at_its_line(good: str, findings: Findings) -> None:
    text = good.replace('iyz="0"', 'ivz="0"', 1)
    line = text[: text.index("ivz")].count("\n") + 1
    (finding,) = findings(text)
    assert (finding.place.line, finding.place.expanded) == (line, False)
    assert finding.severity == "error"


MOUNTED = """<robot name="r">
  <link name="base"><inertial><mass value="2"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.02"/><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision></link>
  {wheels}
  <gazebo><plugin name="drive" filename="libgazebo_ros_planar_move.so"/></gazebo>
</robot>"""  # noqa: E501
MOUNT = """
  <link name="wheel_mount{0}"><inertial><mass value="0.05"/>
    <inertia ixx="2e-5" iyy="2e-5" izz="2e-5" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.03 0.03 0.03"/></geometry></collision></link>
  <joint name="drive{0}" type="continuous"><parent link="base"/><child link="wheel_mount{0}"/>
    <origin xyz="{1} {2} 0" rpy="0 0 {3}"/><axis xyz="1 0 0"/></joint>
  <link name="rim{0}"><inertial><mass value="0.2"/>
    <inertia ixx="2e-4" iyy="2e-4" izz="2e-4" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin rpy="0 1.5708 0"/><geometry><cylinder radius="0.05" length="0.03"/></geometry></collision></link>
  <joint name="fix{0}" type="fixed"><parent link="wheel_mount{0}"/><child link="rim{0}"/></joint>"""  # noqa: E501


def test_a_wheel_on_a_mount_that_turns_is_one_body_with_it(findings: Findings) -> None:
    turns = [number * 2 * math.pi / 3 for number in range(3)]
    wheels = "".join(
        MOUNT.format(number, 0.13 * math.cos(turn), 0.13 * math.sin(turn), turn)
        for number, turn in enumerate(turns)
    )
    assert findings(MOUNTED.format(wheels=wheels)) == []


def test_sdf_has_the_same_rules(good_sdf: str, rules: Rules) -> None:
    for old, new, rule in [
        ("<child>left_wheel</child>", "<child>left_whel</child>", "no-link"),
        ("<mass>2</mass>", "<mass>0</mass>", "massless"),
        ("<izz>0.024</izz>", "<izz>0.24</izz>", "inertia"),
        ("<ixx>0.009</ixx><iyy>0.017</iyy><izz>0.024</izz>", "", "inertia-size"),
        ("<radius>0.05</radius>", "<raduis>0.05</raduis>", "tag"),
        ("0.05 0.12 0.05 -1.5708", "0.05 0.12 0.07 -1.5708", "wheel-height"),
        ("<left_joint>left_joint", "<left_joint>left", "plugin-joint"),
        ("gz-sim-diff-drive-system", "gz-sim-diff-drvie-system", "plugin-name"),
        ('<link name="right_wheel">', '<link name="left_wheel">', "twice"),
    ]:
        assert old in good_sdf
        assert rule in rules(good_sdf.replace(old, new, 1), "robot.sdf")
    wrong = good_sdf.replace(
        "<xyz>0 0 1</xyz>", "<xyz>0 0 1</xyz><limit><effort>abc</effort></limit>", 1
    )
    assert rules(wrong, "robot.sdf") == ["number"]


def test_in_sdf_a_plugin_counts_in_a_model_a_world_or_a_sensor(good_sdf: str, rules: Rules) -> None:
    plugin, link = '<plugin name="x" filename="libmy_magic.so"/>', '<link name="right_wheel">'
    assert link in good_sdf
    assert rules(good_sdf.replace(link, plugin + link), "robot.sdf") == ["plugin"]
    sensor = f'<sensor name="s" type="imu">{plugin}</sensor>'
    assert rules(good_sdf.replace(link, link + sensor), "robot.sdf") == ["plugin"]
    assert rules(good_sdf.replace(link, link + plugin), "robot.sdf") == []


def test_a_skid_steer_may_be_given_a_wider_base(good: str, rules: Rules) -> None:
    wide = good.replace("<wheelSeparation>0.24", "<wheelSeparation>0.4")
    assert rules(wide) == ["wheel-measure"]
    start, end = wide.index('<link name="left_wheel">'), wide.index('<link name="ball">')
    rear = (
        wide[start:end]
        .replace("_wheel", "_rear")
        .replace("_joint", "_rear_joint")
        .replace("0.05 ", "-0.1 ", 4)
    )
    tags = "<leftJoint>left_rear_joint</leftJoint><rightJoint>right_rear_joint</rightJoint><wheelSeparation>"  # noqa: E501
    assert rules(wide[:end] + rear + wide[end:].replace("<wheelSeparation>", tags)) == []
    crossed = (
        tags.replace("left_rear", "x")
        .replace("right_rear", "left_rear")
        .replace("x_", "right_rear_")
    )
    assert rules(wide[:end] + rear + wide[end:].replace("<wheelSeparation>", crossed)) == [
        "wheel-side"
    ]


def test_no_measure_is_taken_from_a_robot_in_millimetres(good: str, findings: Findings) -> None:
    large = '<link name="x"><visual><geometry><box size="300 20 10"/></geometry></visual></link>'
    joint = '<joint name="x" type="fixed"><parent link="base"/><child link="x"/></joint></robot>'
    (finding,) = findings(
        good.replace("<wheelSeparation>0.24", "<wheelSeparation>0.3").replace(
            "</robot>", large + joint
        )
    )
    assert finding.problem == "the robot measures 300 m; its file may be in millimetres"


def test_files_for_robots_to_include_are_silent() -> None:
    """The robots of urdf/ are checked in tests/integration/test_robots.py."""
    for name in ("materials.xacro", "wheels.xacro"):
        assert check_here(HERE.parents[2] / "urdf" / name) == []


def test_a_requested_size_is_measured(good: str, findings: Findings) -> None:
    assert findings(good, requirements=Requirements((0.31, 0.28, 0.34))) == []
    (finding,) = findings(good, requirements=Requirements((0.4, 0.2)))
    assert finding.rule == "fits"
    assert (
        "0.3 x 0.27 x 0.32 m" in finding.problem
        and "width (y) 0.27 m is too much" in finding.problem
    )


def test_names_are_required_by_a_file(good: str, findings: Findings, tmp_path: Path) -> None:
    lines = [
        "# the homework",
        "link base",
        "joint arm_joint revolute  # arm",
        "joint left_joint prismatic",
        "link bsae",
    ]
    (tmp_path / "names.txt").write_text("\n".join([*lines, "wheel x", "joint a b", "link"]))
    found = findings(good, requirements=Requirements(require=tmp_path / "names.txt"))
    message = [(finding.rule, finding.place.line, finding.problem) for finding in found]
    assert [line for rule, line, _ in message if rule == "require-file"] == [6, 7, 8]
    assert [problem for rule, _, problem in message if rule == "require"] == [
        "there is no link 'bsae' (did you mean 'base'?)",
        "joint 'left_joint' is continuous, not prismatic",
    ]


def test_a_file_of_names_that_is_not_there_is_reported(
    good: str, rules: Rules, tmp_path: Path
) -> None:
    assert rules(good, requirements=Requirements(require=tmp_path / "nowhere.txt")) == [
        "require-file"
    ]


def test_a_name_that_ends_with_a_space_is_one_like_any_other(rules: Rules) -> None:
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    assert rules(
        '<robot name="r"><link name="a "><inertial><mass '
        f'value="1"/></inertial>{box}</link></robot>'
    ) == ["inertia"]


READERS = {
    "tag",
    "each",
    "word",
    "number",
    "optional",
    "length",
    "timeout",
    "flag",
    "frame",
    "topic",
}
"""The methods of Settings, whose words are names of tags."""


def test_each_tag_that_a_plugin_reads_is_known_in_both_spellings() -> None:
    calls = [
        node
        for node in ast.walk(ast.parse(Path(gazebo_plugins.__file__).read_text()))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in READERS
    ]
    words = [arg.value for call in calls for arg in call.args if isinstance(arg, ast.Constant)]
    names = {word for word in words if isinstance(word, str) and word.islower() and "_" in word}
    assert len(names) > 30
    camels = {re.sub("_(.)", lambda found: found[1].upper(), name) for name in names}
    assert (names | camels) - rules_xml.PLUGIN == {"cmd_vel", "cmdVel"}, "a default, no tag"
