"""The planar_move plugin is read in the spelling of ROS 1, of ROS 2, and mixed."""

import pytest
from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files.loading import parse
from holozen.robot.model import Drive, Planar, RobotModel
from tests.core.robots import ORIGIN, drive_of


def robot(*gazebo: str) -> RobotModel:
    body = "".join(f"<gazebo>{text}</gazebo>\n" for text in gazebo)
    return parse(f'<robot name="r">\n<link name="base"/>\n{body}</robot>', ORIGIN)


def plugin(tags: str, filename: str = "libgazebo_ros_planar_move.so") -> str:
    return f'<plugin name="drive" filename="{filename}">{tags}</plugin>'


def test_a_robot_without_plugin_has_no_drive() -> None:
    model = robot("<material>Gazebo/Black</material>")
    assert model.drive is None and model.warnings == ()


def test_without_tags_gazebos_defaults_hold_with_the_watchdog_on() -> None:
    assert drive_of(robot(plugin(""))) == Drive(
        "cmd_vel", "odom", "odom", 20.0, "base", 0.5, True, True, (1e-5, 1e-5, 1e-3)
    )


def test_ros_1_tags_are_read() -> None:
    tags = (
        "<robotNamespace>/</robotNamespace><commandTopic>/drive</commandTopic><odometryTopic>where</odometryTopic>"
        "<odometryFrame>/map</odometryFrame><odometryRate>50.0</odometryRate><robotBaseFrame>base</robotBaseFrame>"
        "<cmdTimeout>0.25</cmdTimeout><broadcastTransform>false</broadcastTransform>"
    )
    assert drive_of(robot(plugin(tags))) == Drive(
        "drive", "where", "map", 50.0, "base", 0.25, True, False
    )


def test_ros_2_tags_are_read() -> None:
    tags = (
        "<ros><namespace>/demo</namespace><remapping>cmd_vel:=drive</remapping>"
        "<remapping>odom:=/where</remapping></ros><update_rate>100</update_rate><publish_rate>10</publish_rate>"
        "<publish_odom>true</publish_odom><publish_odom_tf>0</publish_odom_tf>"
        "<odometry_frame>map</odometry_frame><robot_base_frame>base</robot_base_frame>"
        "<covariance_x>0.1</covariance_x><covariance_y>0.2</covariance_y><covariance_yaw>0.3</covariance_yaw>"
    )
    expected = Drive("demo/drive", "where", "map", 10.0, "base", 0.5, True, False, (0.1, 0.2, 0.3))
    expected = replace(expected, mechanism=Planar(update_rate=100))
    assert drive_of(robot(plugin(tags))) == expected


def test_both_spellings_may_be_mixed_and_spaced() -> None:
    tags = (
        "<ros><remapping> cmd_vel := /drive "
        "</remapping></ros><command_topic>cmd_vel</command_topic>"
        "<odometryFrame> "
        "map\n</odometryFrame><odometry_rate>30</odometry_rate><publishRate>10</publishRate>"
    )
    assert drive_of(robot(plugin(tags))) == Drive("drive", "odom", "map", 30.0, "base")


def test_a_namespace_stands_before_relative_topics_only() -> None:
    tags = "<robotNamespace>a/b/</robotNamespace><commandTopic>//cmd_vel</commandTopic>"
    assert (
        drive_of(robot(plugin(tags))).command_topic,
        drive_of(robot(plugin(tags))).odometry_topic,
    ) == ("cmd_vel", "a/b/odom")


def test_a_topic_is_remapped_by_its_default_name_and_by_its_own() -> None:
    assert (
        drive_of(robot(plugin("<ros><remapping>/cmd_vel:=go/</remapping></ros>"))).command_topic
        == "go"
    )
    own = "<commandTopic>/drive</commandTopic><ros><remapping>drive:=go</remapping></ros>"
    assert drive_of(robot(plugin(own))).command_topic == "go"


def test_a_remapping_without_effect_is_warned_of() -> None:
    for remapping, problem in [
        (
            "cmd_vel=go",
            "is 'cmd_vel=go', which renames nothing; write OLD:=NEW, as cmd_vel:=my_vel",
        ),
        ("cmd_vel:=", "is 'cmd_vel:=', which renames nothing"),
        (
            "cmd_vl:=go",
            "renames 'cmd_vl', which is no topic of this plugin (did you mean 'cmd_vel'?); "
            "topics: cmd_vel",
        ),
    ]:
        model = robot(plugin(f"<ros><remapping>{remapping}</remapping></ros>"))
        assert model.drive is not None and model.drive.command_topic == "cmd_vel"
        (warning,) = model.warnings
        assert warning.startswith(
            f"{ORIGIN}, line 3: <remapping> of <plugin name='drive'> {problem}"
        )
    assert (
        robot(
            plugin("<ros><remapping>tf:=my_tf</remapping><remapping>odom:=here</remapping></ros>")
        ).warnings
        == ()
    )


def test_spellings_that_people_use_are_understood() -> None:
    for tags, expected in [
        ("<command_timeout>2</command_timeout>", Drive(robot_base_frame="base", command_timeout=2)),
        (
            "<publishOdometry>FALSE</publishOdometry>",
            Drive(robot_base_frame="base", publish_odom=False),
        ),
        (
            "<publish_odometry_tf>0</publish_odometry_tf>",
            Drive(robot_base_frame="base", publish_odom_tf=False),
        ),
        ("<publish_odom>1</publish_odom>", Drive(robot_base_frame="base")),
        ("<odometryFrame>/</odometryFrame>", Drive(robot_base_frame="base")),
        ("<robotBaseFrame>/base</robotBaseFrame>", Drive(robot_base_frame="base")),
        (
            "<covariance_y>0</covariance_y>",
            Drive(robot_base_frame="base", covariance=(1e-5, 0, 1e-3)),
        ),
    ]:
        assert drive_of(robot(plugin(tags))) == expected


def test_a_robot_that_is_to_slow_down_needs_a_sensor_that_sees_what_is_near() -> None:
    text = (
        '<robot name="r"><link name="base"/>\n\n<gazebo>{}</gazebo><gazebo reference="base">'
        '<sensor name="s" type="{}"><ray><range><max>5</max></range></ray></sensor>'
        "</gazebo></robot>"
    )
    for tag in ("time_before_collision", "timeBeforeCollision"):
        drives = plugin(f"<{tag}>1.5</{tag}>")
        seeing, blind = (parse(text.format(drives, kind), ORIGIN) for kind in ("ray", "imu"))
        for model in (seeing, blind):
            assert model.drive is not None and model.drive.time_before_collision == 1.5
        assert seeing.warnings == ()
        assert blind.warnings == (
            f"{ORIGIN}, line 3: <{tag}> of <plugin name='drive'> changes nothing: the robot has no "
            "sensor with a scan or a range",
        )


def test_a_model_of_sdf_is_told_the_same() -> None:
    drives = plugin("<time_before_collision>1.5</time_before_collision>")
    text = (
        '<sdf version="1.6"><model name="m"><link name="base"><inertial><mass>1</mass></inertial>'
        f"{{}}</link>{drives}</model></sdf>"
    )
    lidar = '<sensor name="s" type="ray"><ray><range><max>5</max></range></ray></sensor>'
    seeing, blind = (parse(text.format(sensor), ORIGIN).warnings for sensor in (lidar, ""))
    assert [warning for warning in blind if warning not in seeing] == [
        f"{ORIGIN}, line 1: <time_before_collision> of <plugin name='drive'> changes nothing: the "
        "robot has no sensor with a scan or a range"
    ]


def test_of_two_equal_tags_the_first_counts_and_an_empty_one_has_no_effect() -> None:
    tags = (
        "<odometryRate>30</odometryRate><odometryRate>40</odometryRate><odometryFrame> "
        "</odometryFrame>"
    )
    assert (
        drive_of(robot(plugin(tags))).odometry_rate,
        drive_of(robot(plugin(tags))).odometry_frame,
    ) == (30, "odom")


def test_a_negative_timeout_switches_the_watchdog_off_which_is_reported_as_a_long_one_is() -> None:
    for name, text, timeout, long in (
        ("cmdTimeout", "-1", None, "for ever"),
        ("cmd_timeout", "-0.2", None, "for ever"),
        ("cmdTimeout", "60", 60, "for 60 s"),
    ):
        model = robot(plugin(f"<{name}>{text}</{name}>"))
        assert model.drive is not None and model.drive.command_timeout == timeout
        on = f"a robot whose driver hangs, or whose link is cut, drives on {long}"
        message = (
            f"<{name}> of <plugin name='drive'> is '{text}': {on}; without this element it "
            "stops after 0.5 s"
        )
        assert model.warnings == (f"{ORIGIN}, line 3: {message}",)
    # without a warning
    assert drive_of(robot(plugin("<cmdTimeout>2</cmdTimeout>"))).command_timeout == 2


def test_a_base_frame_that_is_no_link_is_reported_and_the_root_is_taken() -> None:
    model = robot(plugin("<robotBaseFrame>chasis</robotBaseFrame>"))
    assert model.drive is not None and model.drive.robot_base_frame == "base"
    message = (
        "<robotBaseFrame> of <plugin name='drive'> names the base frame 'chasis', which is "
        "not a link; 'base' is used"
    )
    assert model.warnings == (f"{ORIGIN}, line 3: {message}",)


def test_a_plugin_that_does_not_drive_is_named_with_what_happens_without_it() -> None:
    for filename, message in [
        (
            "libgazebo_ros_control.so",
            "is not supported; joint_states is published anyway, and joints follow joint_command",
        ),
        (
            "libgazebo_ros_joint_state_publisher.so",
            "is not supported; joint_states is published anyway",
        ),
        ("libgazebo_ros_p3d.so", "is not supported; odom and tf are published anyway"),
        ("gz-sim-physics-system", "is not supported; the sim does this itself"),
        (
            "libgz_ros2_control-system.so",
            "is not supported; joint_states is published anyway, and joints follow joint_command",
        ),
        (
            "libgazebo_ros_planarmove.so",
            "is unknown and is ignored (did you mean 'libgazebo_ros_planar_move.so'?)",
        ),
        ("libsomething_else.so", "is unknown and is ignored"),
        ("libgazebo_ros_magic_wand.so", "is unknown and is ignored"),
        ("libmecanum.so", "is unknown and is ignored"),
    ]:
        model = robot(plugin("<x/>", filename), plugin(""))
        assert model.drive is not None
        assert model.warnings == (
            f"{ORIGIN}, line 3: <plugin name='drive'> ({filename}) {message}",
        )


def test_a_plugin_without_file_name_is_reported() -> None:
    (warning,) = robot("<plugin/>").warnings
    assert warning.endswith("<plugin> of <robot name='r'> (no filename) is unknown and is ignored")


def test_a_plugin_outside_gazebo_is_reported_and_ignored_as_in_gazebo() -> None:
    model = parse(f'<robot name="r">\n<link name="base"/>\n{plugin("")}</robot>', ORIGIN)
    problem = (
        "<plugin name='drive'> is not inside <gazebo>, so it is ignored; put <gazebo> ... "
        "</gazebo> around it"
    )
    assert (model.drive, model.warnings) == (None, (f"{ORIGIN}, line 3: {problem}",))


def test_a_plugin_directly_in_an_sdf_model_drives_it() -> None:
    link = "<link name='base'><inertial><mass>1</mass></inertial></link>"
    text = (
        "<sdf version='1.6'><model "
        f"name='m'>{link}{plugin('<commandTopic>go</commandTopic>')}</model></sdf>"
    )
    model = parse(text, ORIGIN)
    assert model.drive == Drive("go", robot_base_frame="base")


@pytest.mark.parametrize(
    "filename", ["gazebo_ros_planar_move", "/opt/ros/lib/libgazebo_ros_planar_move.so"]
)
def test_the_plugin_is_known_by_its_file_name(filename: str) -> None:
    assert robot(plugin("", filename)).drive is not None


def test_a_second_planar_move_is_reported_and_the_first_drives() -> None:
    first, second = (plugin(f"<odometryRate>{rate}</odometryRate>") for rate in (1, 2))
    for gazebo in (
        (first, second),
        (first + second,),
        (f"<a>{first}</a>{second}",),
        (f"<a>{first}{second}</a>",),
    ):
        model = robot(*gazebo)
        assert model.drive is not None and model.drive.odometry_rate == 1
        (warning,) = model.warnings
        assert warning.endswith(
            "<plugin name='drive'> is a second drive; only the first one drives"
        )


def test_a_value_that_cannot_be_is_refused_with_its_tag() -> None:
    for tags, message in [
        (
            "<odometryRate>0</odometryRate>",
            "<odometryRate> of <plugin name='drive'> is '0'; it must be a number above 0",
        ),
        ("<odometryRate>-5</odometryRate>", "is '-5'; it must be a number above 0"),
        ("<publish_rate>nan</publish_rate>", "<publish_rate> of <plugin name='drive'> is 'nan'"),
        ("<odometryRate>fast</odometryRate>", "is 'fast'"),
        (
            "<cmdTimeout>0</cmdTimeout>",
            "<cmdTimeout> of <plugin name='drive'> is '0'; it must be a number above 0",
        ),
        ("<cmdTimeout>inf</cmdTimeout>", "is 'inf'"),
        (
            "<time_before_collision>11</time_before_collision>",
            "<time_before_collision> of <plugin name='drive'> is '11'; it must be at most 10",
        ),
        ("<timeBeforeCollision>-1</timeBeforeCollision>", "it must be a number not below 0"),
        ("<update_rate>fast</update_rate>", "is 'fast'; it must be a number not below 0"),
        ("<covariance_x>-1</covariance_x>", "is '-1'; it must be a number not below 0"),
        ("<publish_odom>perhaps</publish_odom>", "is 'perhaps'; it must be true or false"),
        (
            "<commandTopic>*</commandTopic>",
            "<commandTopic> of <plugin name='drive'> makes the topic '*'",
        ),
        ("<commandTopic>@holozen/x</commandTopic>", "makes the topic '@holozen/x'"),
        ("<robotNamespace>a b</robotNamespace>", "makes the topic 'a b/cmd_vel'"),
        ("<ros><remapping>odom:=**</remapping></ros>", "makes the topic '**'"),
    ]:
        with pytest.raises(RobotError) as error:
            robot(plugin(tags))
        assert str(error.value).startswith(f"{ORIGIN}, line 3: ") and message in str(error.value)
