"""The wheeled plugins of ROS: their tags in both spellings, and their mistakes."""

import math

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.loading import parse
from holozen.robot.model import Balancing, Differential, Drive, RobotModel, sides_of
from tests.core.robots import ORIGIN, drive_of

DIFF, SKID, MULTI, WB = (
    f"lib{name}.so"
    for name in (
        "gazebo_ros_diff_drive",
        "gazebo_ros_skid_steer_drive",
        "diffdrive_plugin_multi_wheel",
        "wb_plugin",
    )
)
WHEELS = ("fl", "fr", "rl", "rr")
PAIR = "<leftJoint>fl</leftJoint><rightJoint>fr</rightJoint>"
CORNERS = (
    "<leftFrontJoint>fl</leftFrontJoint><rightFrontJoint>fr</rightFrontJoint>"
    "<leftRearJoint>rl</leftRearJoint><rightRearJoint>rr</rightRearJoint>"
)


def robot(tags: str, filename: str = DIFF, wheels: tuple[str, ...] = WHEELS) -> RobotModel:
    """A robot with a joint for each of `wheels`, a fixed one called stiff, and one plugin on line
    3.
    """
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    inertial += '<collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>'
    links = "".join(
        f'<link name="{name}">{inertial}</link>'
        for name in ("base", "s", *(f"l_{name}" for name in wheels))
    )
    ends = '<parent link="base"/><child link="{}"/></joint>'
    joints = "".join(
        f'<joint name="{name}" type="continuous"><origin xyz="0 {index} '
        f'0"/>{ends.format(f"l_{name}")}'
        for index, name in enumerate(wheels)
    )
    joints += f'<joint name="stiff" type="fixed">{ends.format("s")}'
    plugin = f'<plugin name="p" filename="{filename}">{tags}</plugin>'
    return parse(f'<robot name="r">\n{links}{joints}\n<gazebo>{plugin}</gazebo></robot>', ORIGIN)


def wheels(tags: str, filename: str = DIFF) -> Differential:
    mechanism = drive_of(robot(tags, filename)).mechanism
    assert isinstance(mechanism, Differential)
    return mechanism


def refusal(tags: str, filename: str = DIFF) -> str:
    with pytest.raises(RobotError) as error:
        robot(tags, filename)
    message = str(error.value)
    assert message.startswith(f"{ORIGIN}, line 3: ") and "\n" not in message
    return message.removeprefix(f"{ORIGIN}, line 3: ")


def test_without_tags_the_defaults_of_gazebo_hold_and_the_links_measure_the_wheels() -> None:
    expected = Differential(("fl",), ("fr",), 1, 0.1, torque=5, encoder=False)
    assert drive_of(robot(PAIR)) == Drive(
        "cmd_vel", "odom", "odom", 100, "base", mechanism=expected
    )


def test_the_tags_of_ros_1_are_read() -> None:
    tags = (
        f"{PAIR}<rosDebugLevel>Debug</rosDebugLevel><robotNamespace>/</robotNamespace><wheelSeparation>0.4</wheelSeparation>"
        "<wheelDiameter>0.4</wheelDiameter><wheelTorque>20</wheelTorque><wheelAcceleration>1.8</wheelAcceleration>"
        "<commandTopic>go</commandTopic><odometryTopic>where</odometryTopic><odometryFrame>map</odometryFrame>"
        "<odometrySource>encoder</odometrySource><updateRate>30</updateRate><robotBaseFrame>base</robotBaseFrame>"
        "<publishTf>1</publishTf><publishOdomTF>false</publishOdomTF><publishWheelTF>true</publishWheelTF>"
        "<publishWheelJointState>true</publishWheelJointState><legacyMode>false</legacyMode>"
    )
    expected = Differential(("fl",), ("fr",), 0.4, 0.2, 20, True, 1.8)
    assert drive_of(robot(tags)) == Drive(
        "go", "where", "map", 30, "base", publish_odom_tf=False, mechanism=expected
    )


def test_the_tags_of_ros_2_are_read() -> None:
    tags = (
        "<ros><namespace>/demo</namespace><remapping>cmd_vel:=go</remapping><remapping>/odom:=/where</remapping></ros>"
        "<update_rate>30</update_rate><num_wheel_pairs>2</num_wheel_pairs><left_joint>fl</left_joint>"
        "<right_joint>fr</right_joint><left_joint>rl</left_joint><right_joint>rr</right_joint>"
        "<wheel_separation>0.4</wheel_separation><wheel_separation>0.4</wheel_separation>"
        "<wheel_diameter>0.4</wheel_diameter><max_wheel_torque>20</max_wheel_torque>"
        "<max_wheel_acceleration>1.0</max_wheel_acceleration><publish_odom>true</publish_odom>"
        "<publish_odom_tf>true</publish_odom_tf><publish_wheel_tf>true</publish_wheel_tf>"
        "<odometry_frame>map</odometry_frame><robot_base_frame>base</robot_base_frame>"
        "<odometry_source>0</odometry_source><covariance_x>0.1</covariance_x>"
    )
    expected = Differential(("fl", "rl"), ("fr", "rr"), 0.4, 0.2, 20, True, 1)
    found = Drive(
        "demo/go", "where", "map", 30, "base", covariance=(0.1, 1e-5, 1e-3), mechanism=expected
    )
    assert drive_of(robot(tags)) == found


def test_both_spellings_may_be_mixed() -> None:
    tags = (
        "<leftJoint>fl</leftJoint><right_joint>fr</right_joint><wheelSeparation>2</wheelSeparation>"
        "<ros><remapping>/cmd_vel:=/x</remapping></ros>"
    )
    assert wheels(tags) == Differential(("fl",), ("fr",), 2, 0.1, 5, False)
    assert drive_of(robot(tags)).command_topic == "x"


def test_odometry_comes_from_the_encoders_or_the_world() -> None:
    for word, encoder in [
        ("encoder", True),
        ("ENCODER", True),
        ("0", True),
        ("world", False),
        ("1", False),
    ]:
        assert wheels(f"{PAIR}<odometrySource>{word}</odometrySource>").encoder is encoder
        assert wheels(f"{PAIR}<odometry_source>{word}</odometry_source>").encoder is encoder


def test_an_acceleration_of_zero_is_none() -> None:
    assert wheels(f"{PAIR}<wheelAcceleration>0</wheelAcceleration>").acceleration == math.inf


def test_legacy_mode_names_the_sides_the_other_way_round() -> None:
    swapped = wheels(f"{PAIR}<legacyMode>true</legacyMode>")
    assert (swapped.left, swapped.right) == (("fr",), ("fl",))


def test_publish_tf_of_ros_1_switches_odometry_off() -> None:
    assert drive_of(robot(f"{PAIR}<publishTf>0</publishTf>")).publish_odom is False


def test_the_joints_have_the_names_of_the_plugin_when_no_tag_names_them() -> None:
    model = robot("", DIFF, ("left_joint", "right_joint"))
    assert model.drive is not None
    assert sum(sides_of(model.drive.mechanism), ()) == ("left_joint", "right_joint")


def test_pairs_that_differ_are_reported_and_the_first_counts() -> None:
    pairs = (
        "<left_joint>fl</left_joint><left_joint>rl</left_joint>"
        "<right_joint>fr</right_joint><right_joint>rr</right_joint>"
    )
    model = robot(
        f"{pairs}<wheel_diameter>0.2</wheel_diameter><wheel_diameter>0.3</wheel_diameter>"
    )
    assert model.drive is not None and isinstance(model.drive.mechanism, Differential)
    assert model.drive.mechanism.radius == 0.1
    message = (
        "<wheel_diameter> of <plugin name='p'> differs from the first; the first is used "
        "for all pairs of wheels"
    )
    assert model.warnings == (f"{ORIGIN}, line 3: {message}",)


def test_a_skid_steer_has_four_wheels_and_publishes_the_true_pose() -> None:
    assert drive_of(robot(CORNERS, SKID)) == Drive(
        odometry_rate=100,
        robot_base_frame="base",
        covariance=(1e-4, 1e-4, 1e-2),
        mechanism=Differential(("fl", "rl"), ("fr", "rr"), 1, 0.1, 5, False),
    )
    tags = (
        f"{CORNERS}<wheelSeparation>0.4</wheelSeparation><wheelDiameter>0.4</wheelDiameter><torque>7</torque>"
        "<covariance_x>0</covariance_x><covariance_yaw>0.5</covariance_yaw><broadcastTF>0</broadcastTF>"
        "<robotNamespace>/ns</robotNamespace><updateRate>50</updateRate>"
    )
    found = drive_of(robot(tags, SKID))
    assert found.mechanism == Differential(("fl", "rl"), ("fr", "rr"), 0.4, 0.2, 7, False)
    assert (found.covariance, found.publish_odom_tf, found.odometry_rate) == (
        (0, 1e-4, 0.5),
        False,
        50,
    )
    assert (found.command_topic, found.odometry_topic) == ("ns/cmd_vel", "ns/odom")


def test_the_joints_of_a_skid_steer_have_default_names() -> None:
    names = ("left_front_joint", "left_rear_joint", "right_front_joint", "right_rear_joint")
    model = robot("", SKID, names)
    assert model.drive is not None and sum(sides_of(model.drive.mechanism), ()) == names


def test_hectors_plugin_names_all_wheels_of_a_side_in_one_tag() -> None:
    tags = (
        "<leftJoints>fl  rl</leftJoints><rightJoints>fr "
        "rr</rightJoints><wheelDiameter>0.4</wheelDiameter>"
    )
    assert wheels(tags, MULTI) == Differential(("fl", "rl"), ("fr", "rr"), 1, 0.2, 5, False)


def test_hectors_plugin_understands_the_tags_of_the_others_and_has_their_default_names() -> None:
    assert wheels(PAIR, MULTI).left == ("fl",)
    model = robot("", MULTI, ("left_joint", "right_joint"))
    assert model.drive is not None and sum(sides_of(model.drive.mechanism), ()) == (
        "left_joint",
        "right_joint",
    )


def test_a_wheel_may_hang_on_a_revolute_joint() -> None:
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    inertial += '<collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>'
    ends = '<parent link="a"/><child link="{0}"/><origin xyz="0 {1} 0"/>'
    joint = f'<joint name="{{0}}" type="revolute">{ends}<limit upper="9"/></joint>'
    links = "".join(f'<link name="{name}">{inertial}</link>' for name in ("a", "fl", "fr"))
    plugin = f'<gazebo><plugin filename="{DIFF}">{PAIR}</plugin></gazebo>'
    model = parse(
        f'<robot name="r">{links}{joint.format("fl", 1)}{joint.format("fr", -1)}{plugin}</robot>',
        ORIGIN,
    )
    assert model.drive is not None and sum(sides_of(model.drive.mechanism), ()) == ("fl", "fr")


def test_a_joint_with_a_space_in_its_name_is_one_joint() -> None:
    model = robot(
        "<leftJoint>left one</leftJoint><rightJoint>fr</rightJoint>", DIFF, ("left one", "fr")
    )
    assert model.drive is not None and sum(sides_of(model.drive.mechanism), ()) == (
        "left one",
        "fr",
    )


def test_wheely_boi_balances_on_its_two_joints() -> None:
    model = robot("", WB, ("jointL", "jointR"))
    assert model.drive is not None and model.warnings == ()
    assert model.drive.mechanism == Balancing("jointL", "jointR")
    assert model.drive.command_topic == "cmd_vel"
    assert refusal("", WB) == (
        "<plugin name='p'> names the joint 'jointL', which does not exist; joints: fl, fr, rl, "
        "rr, stiff"
    )


def test_a_mistake_is_refused_with_the_tag_and_what_there_is() -> None:
    for tags, message in [
        ("", "<plugin name='p'> has no <left_joint>; joints: fl, fr, rl, rr, stiff"),
        ("<leftJoint>fl</leftJoint>", "<plugin name='p'> has no <right_joint>; joints"),
        (
            "<leftJoint>FL</leftJoint><rightJoint>fr</rightJoint>",
            "<leftJoint> of <plugin name='p'> names the joint 'FL', which does not exist (did you "
            "mean 'fl'?); "
            "joints: fl, fr, rl, rr, stiff",
        ),
        (
            "<leftJoint>stiff</leftJoint><rightJoint>fr</rightJoint>",
            "<leftJoint> of <plugin name='p'> names the joint 'stiff', which is fixed; a wheel's "
            "joint is continuous",
        ),
        (
            f"{PAIR}<left_joint>rl</left_joint>",
            "<plugin name='p'> has 2 left and 1 right joints; wheels come in pairs",
        ),
        (
            f"{PAIR}<num_wheel_pairs>2</num_wheel_pairs>",
            "is '2', but there are 1 left and 1 right joints",
        ),
        (
            f"{PAIR}<wheelSeparation>-0.4</wheelSeparation>",
            "is '-0.4'; it must be a number above 0",
        ),
        (f"{PAIR}<wheelSeparation>0</wheelSeparation>", "is '0'; it must be a number above 0"),
        (
            f"{PAIR}<wheelDiameter>nan</wheelDiameter>",
            "<wheelDiameter> of <plugin name='p'> is 'nan'",
        ),
        (f"{PAIR}<wheelDiameter>1e9</wheelDiameter>", "is '1e9'; it must be at most 1e+06"),
        (f"{PAIR}<wheelTorque>-5</wheelTorque>", "is '-5'; it must be a number not below 0"),
        (f"{PAIR}<updateRate>0</updateRate>", "is '0'; it must be a number above 0"),
        (
            f"{PAIR}<odometrySource>gps</odometrySource>",
            "is 'gps'; it must be encoder (0) or world (1)",
        ),
        (f"{PAIR}<publishOdomTF>often</publishOdomTF>", "is 'often'; it must be true or false"),
    ]:
        assert message in refusal(tags)
