"""The systems of gz-sim and Ignition Gazebo."""

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.loading import parse
from holozen.robot.model import Differential, Drive, Mecanum, Planar, RobotModel
from tests.core.robots import ORIGIN, drive_of

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
PLACES = {"fl": "0.2 0.2 0", "fr": "0.2 -0.2 0", "rl": "-0.2 0.2 0", "rr": "-0.2 -0.2 0"}
WHEELS = ("fl", "fr", "rl", "rr")
ROUND = '<collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>'
PAIRS = "".join(
    f"<{side}_joint>{name}</{side}_joint>"
    for side, name in zip(("left", "right") * 2, WHEELS, strict=True)
)
CORNERS = "".join(
    f"<{corner}_joint>{name}</{corner}_joint>"
    for corner, name in zip(
        ("front_left", "front_right", "back_left", "back_right"), WHEELS, strict=True
    )
)


def plugin(system: str, tags: str = "") -> str:
    return f'<plugin filename="gz-sim-{system}-system" name="p">{tags}</plugin>'


def robot(*plugins: str) -> RobotModel:
    names = ("base", *(f"l_{name}" for name in WHEELS))
    links = "".join(f'<link name="{name}">{INERTIAL}{ROUND}</link>' for name in names)
    joint = (
        '<joint name="{0}" type="continuous"><parent link="base"/><child '
        'link="l_{0}"/><origin xyz="{1}"/></joint>'
    )
    joints = "".join(joint.format(*wheel) for wheel in PLACES.items())
    return parse(
        f'<robot name="bot">\n{links}{joints}\n<gazebo>{"".join(plugins)}</gazebo></robot>', ORIGIN
    )


def message(model: RobotModel) -> list[str]:
    return [warning.removeprefix(f"{ORIGIN}, line 3: ") for warning in model.warnings]


def test_velocity_control_moves_the_whole_robot() -> None:
    assert drive_of(robot(plugin("velocity-control"))) == Drive(
        odometry_rate=50, robot_base_frame="base", mechanism=Planar()
    )


def test_a_diff_drive_has_the_defaults_of_gz_sim() -> None:
    expected = Differential(("fl", "rl"), ("fr", "rr"), 0.4, 0.1)
    assert drive_of(robot(plugin("diff-drive", PAIRS))) == Drive(
        odometry_rate=50, robot_base_frame="base", mechanism=expected
    )


def test_each_tag_of_a_diff_drive_is_read() -> None:
    tags = (
        f"{PAIRS}<wheel_separation>0.5</wheel_separation><wheel_radius>0.2</wheel_radius><topic>/go</topic>"
        "<odom_topic>where</odom_topic><tf_topic>/tf</tf_topic><frame_id>map</frame_id>"
        "<child_frame_id>bot/base</child_frame_id><odom_publish_frequency>30</odom_publish_frequency>"
        "<max_linear_velocity>1</max_linear_velocity><min_linear_velocity>-1</min_linear_velocity>"
        "<max_angular_velocity>2</max_angular_velocity><max_linear_acceleration>3</max_linear_acceleration>"
        "<min_angular_acceleration>-4</min_angular_acceleration>"
    )
    expected = Drive(
        "go",
        "where",
        "map",
        30,
        "base",
        mechanism=Differential(("fl", "rl"), ("fr", "rr"), 0.5, 0.2),
        max_linear=1,
        max_angular=2,
        max_linear_acceleration=3,
        max_angular_acceleration=4,
    )
    assert drive_of(robot(plugin("diff-drive", tags))) == expected


def test_a_drive_of_gz_sim_slows_down_for_what_its_robot_sees_too() -> None:
    tags = f"{PAIRS}<time_before_collision>1.2</time_before_collision>"
    model = robot(plugin("diff-drive", tags))
    assert model.drive is not None and model.drive.time_before_collision == 1.2


def test_a_limit_for_both_holds_where_none_of_its_own_is_reported() -> None:
    tags = (
        "<max_velocity>1</max_velocity><max_angular_velocity>2</max_angular_velocity>"
        "<max_acceleration>3</max_acceleration>"
    )
    found = drive_of(robot(plugin("diff-drive", PAIRS + tags)))
    assert (found.max_linear, found.max_angular) == (1, 2)
    assert (found.max_linear_acceleration, found.max_angular_acceleration) == (3, 3)


def test_limits_that_differ_are_reported_and_the_smaller_holds() -> None:
    tags = "<max_linear_velocity>1</max_linear_velocity><min_linear_velocity>-0.5</min_linear_velocity>"  # noqa: E501
    model = robot(plugin("diff-drive", PAIRS + tags))
    assert model.drive is not None and model.drive.max_linear == 0.5
    assert message(model) == [
        "<min_linear_velocity> of <plugin name='p'> differs from max_linear_velocity; 0.5 holds "
        "both ways"
    ]


def test_a_limit_of_jerk_and_a_start_in_motion_are_reported() -> None:
    jerk = plugin("diff-drive", f"{PAIRS}<max_linear_jerk>1</max_linear_jerk>")
    assert message(robot(jerk)) == [
        "<max_linear_jerk> of <plugin name='p'> is ignored; velocity and acceleration are "
        "limited, jerk is not"
    ]
    moving = plugin(
        "velocity-control",
        "<initial_linear>0.3 0 0</initial_linear><initial_angular>0 0 0</initial_angular>",
    )
    turning = plugin("velocity-control", "<initial_angular>0 0 1</initial_angular>")
    assert message(robot(turning)) == [
        "<initial_angular> of <plugin name='p'> is not used; a robot stands still until it is "
        "commanded"
    ]
    assert message(robot(moving)) == [
        "<initial_linear> of <plugin name='p'> is not used; a robot stands still until it is "
        "commanded"
    ]


def test_the_topics_of_gz_sim_itself_are_those_of_ros() -> None:
    tags = "<topic>/model/bot/cmd_vel</topic><odom_topic>model/bot/odometry</odom_topic>"
    found = drive_of(robot(plugin("velocity-control", tags)))
    assert (found.command_topic, found.odometry_topic) == ("cmd_vel", "odom")
    other = drive_of(robot(plugin("velocity-control", "<topic>/model/other/cmd_vel</topic>")))
    assert other.command_topic == "model/other/cmd_vel"


def test_a_system_in_an_sdf_model_knows_the_models_name() -> None:
    link = "<link name='a'><inertial><mass>1</mass></inertial></link>"
    system = plugin("velocity-control", "<topic>/model/m/cmd_vel</topic><frame_id>m/map</frame_id>")
    model = parse(f"<sdf version='1.6'><model name='m'>{link}{system}</model></sdf>", ORIGIN)
    assert model.drive == Drive(odometry_frame="map", odometry_rate=50, robot_base_frame="a")


def test_a_mecanum_drive_has_a_wheel_at_each_corner() -> None:
    measures = "<wheel_separation>0.5</wheel_separation><wheelbase>0.6</wheelbase><wheel_radius>0.2</wheel_radius>"  # noqa: E501
    assert drive_of(robot(plugin("mecanum-drive", CORNERS))).mechanism == Mecanum(
        *WHEELS, 0.4, 0.4, 0.1
    )
    assert drive_of(robot(plugin("mecanum-drive", CORNERS + measures))).mechanism == Mecanum(
        *WHEELS, 0.5, 0.6, 0.2
    )


def test_a_second_wheel_at_a_corner_is_reported() -> None:
    model = robot(plugin("mecanum-drive", f"{CORNERS}<front_left_joint>rr</front_left_joint>"))
    assert model.drive is not None and model.drive.mechanism == Mecanum(*WHEELS, 0.4, 0.4, 0.1)
    assert message(model) == [
        "<front_left_joint> of <plugin name='p'> is a second wheel at one corner; only 'fl' drives"
    ]


@pytest.mark.parametrize("first", [True, False])
def test_an_odometry_publisher_publishes_the_true_pose_of_a_drive(first: bool) -> None:
    tags = (
        "<odom_frame>bot/map</odom_frame><robot_base_frame>bot/l_fl</robot_base_frame><odom_topic>/where</odom_topic>"
        "<odom_publish_frequency>10</odom_publish_frequency><dimensions>3</dimensions>"
    )
    pair = [plugin("odometry-publisher", tags), plugin("diff-drive", PAIRS)]
    wheels = Differential(("fl", "rl"), ("fr", "rr"), 0.4, 0.1, encoder=False)
    expected = Drive("cmd_vel", "where", "map", 10, "l_fl", mechanism=wheels)
    assert drive_of(robot(*(pair if first else pair[::-1]))) == expected


def test_an_odometry_publisher_keeps_the_frame_of_the_drive() -> None:
    tags = f"{CORNERS}<child_frame_id>l_rr</child_frame_id>"
    found = drive_of(robot(plugin("mecanum-drive", tags), plugin("odometry-publisher")))
    assert found.robot_base_frame == "l_rr" and found.odometry_topic == "odom"
    assert found.mechanism == Mecanum(*WHEELS, 0.4, 0.4, 0.1, encoder=False)


def test_a_system_has_no_default_names_for_joints() -> None:
    links = f'<link name="base">{INERTIAL}</link><link name="l">{INERTIAL}</link>'
    joint = (
        '<joint name="left_joint" type="continuous"><parent link="base"/><child link="l"/></joint>'
    )
    with pytest.raises(RobotError, match="has no <left_joint>; joints: left_joint"):
        parse(
            f'<robot name="bot">{links}{joint}<gazebo>{plugin("diff-drive")}</gazebo></robot>',
            ORIGIN,
        )


def test_an_odometry_publisher_without_a_drive_is_reported() -> None:
    model = robot(plugin("odometry-publisher"))
    assert model.drive is None
    assert message(model) == ["<plugin name='p'> publishes odometry, but the robot has no drive"]


def test_a_tag_of_another_drive_is_reported_and_one_of_gazebo_alone_is_not() -> None:
    tags = "<cmdTimeout>60</cmdTimeout><topic>go</topic><alwaysOn>true</alwaysOn>"
    assert message(robot(plugin("velocity-control", tags))) == [
        "<cmdTimeout> of <plugin name='p'> changes nothing: gz-sim-velocity-control-system does "
        "not read it, as others do"
    ]
    publisher = plugin("odometry-publisher", "<odom_frame>o</odom_frame><topic>go</topic>")
    (reason,) = message(robot(plugin("velocity-control"), publisher))
    assert reason.startswith("<topic> of <plugin name='p'> changes nothing")


def test_a_mistake_is_refused_with_the_tag() -> None:
    for system, tags, wrong in [
        ("diff-drive", "", "<plugin name='p'> has no <left_joint>; joints: fl, fr, rl, rr"),
        (
            "diff-drive",
            "<left_joint>lf</left_joint>",
            "<left_joint> of <plugin name='p'> names the joint 'lf'",
        ),
        (
            "diff-drive",
            f"{PAIRS}<wheel_radius>-1</wheel_radius>",
            "is '-1'; it must be a number above 0",
        ),
        (
            "diff-drive",
            f"{PAIRS}<max_linear_velocity>-1</max_linear_velocity>",
            "is '-1'; it must be a number above 0",
        ),
        (
            "diff-drive",
            f"{PAIRS}<min_velocity>1</min_velocity>",
            "is '1'; it must be a number below 0",
        ),
        (
            "diff-drive",
            f"{PAIRS}<max_acceleration>x</max_acceleration>",
            "is 'x'; it must be a number above 0",
        ),
        (
            "mecanum-drive",
            CORNERS.replace("rr", "x"),
            "<back_right_joint> of <plugin name='p'> names the joint 'x'",
        ),
        (
            "velocity-control",
            "<topic>a b</topic>",
            "<topic> of <plugin name='p'> makes the topic 'a b'",
        ),
        (
            "velocity-control",
            "<odom_publish_frequency>0</odom_publish_frequency>",
            "it must be a number above 0",
        ),
    ]:
        with pytest.raises(RobotError) as error:
            robot(plugin(system, tags))
        assert str(error.value).startswith(f"{ORIGIN}, line 3: ") and wrong in str(error.value)
