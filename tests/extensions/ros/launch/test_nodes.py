"""A Node becomes `holozen run` with ROS's own words; what is ROS's own is done otherwise, or left
out with a word.
"""

import math
from pathlib import Path
from typing import Any

import pytest

from holozen.ros.launch.actions import (
    ExecuteProcess,
    GroupAction,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetLaunchConfiguration,
)
from holozen.ros.launch.launch_context import LaunchContext, LaunchError
from holozen.ros.launch.substitutions import FindPackageShare, LaunchConfiguration
from holozen.ros.launch_ros import (
    ComposableNode,
    ComposableNodeContainer,
    LifecycleNode,
    LoadComposableNodes,
    Node,
    Parameter,
    ParameterFile,
    ParameterValue,
    PushROSNamespace,
    SetParameter,
    SetParametersFromFile,
    SetRemap,
    SetUseSimTime,
)
from holozen.ros.rclpy import arguments

from ..conftest import Write
from .conftest import Follow, Kept

VALUE = LaunchConfiguration("value")
ROBOT = "<robot name='r'><!-- link: 1 --></robot>"  # which YAML takes for a map


@pytest.fixture(autouse=True)
def controller(my_bot: Path, write: Write) -> Path:
    return write("src/my_bot/scripts/controller.py")


def node(**words: Any) -> Node:
    return Node(package="my_bot", executable="controller.py", **words)


def parameters(kept: Kept) -> dict[str, Any]:
    """What the node reads off its command line."""
    return dict(arguments.parse(kept.words()).parameters_for("/any"))


def test_a_node_runs_where_the_launch_meets(follow: Follow, my_bot: Path) -> None:
    kept = follow(
        [node(name="c", namespace="fred", arguments=["--fast", VALUE], output="screen")], value="9"
    )
    (program,) = kept.programs
    assert program.name == "controller.py"
    assert list(program.words)[3:8] == ["run", "--wire", "cdr", "--package", f"my_bot={my_bot}"]
    ros = ["--ros-args", "-r", "__node:=c", "-r", "__ns:=/fred"]
    assert kept.words() == ["run", "my_bot", "controller.py", "--fast", "9", *ros]


def test_a_node_without_words_gets_none(follow: Follow) -> None:
    assert follow([node(exec_name="c")]).words() == ["run", "my_bot", "controller.py"]


def test_remappings_are_its_own_before_those_of_its_group(follow: Follow) -> None:
    kept = follow(
        [SetRemap("b", "c"), node(remappings=[("/cmd_vel", ["fred/", VALUE])])], value="cmd_vel"
    )
    assert kept.words()[3:] == ["--ros-args", "-r", "/cmd_vel:=fred/cmd_vel", "-r", "b:=c"]


def test_a_parameter_arrives_as_it_was_meant(follow: Follow) -> None:
    rows = [
        (1, 1),
        (1.0, 1.0),
        (1e-7, 1e-7),
        (1e30, 1e30),
        (math.inf, math.inf),
        (True, True),
        ("1", "1"),
        ("", ""),
        ("a: 'b' \"c\"\n#", "a: 'b' \"c\"\n#"),
        ([1, 2], [1, 2]),
        ([0.5, 1.0], [0.5, 1.0]),
        (["a", "b"], ["a", "b"]),
        (("true", "x"), ["true", "x"]),
        (VALUE, 7),
        ([VALUE, ".5"], 7.5),
        (ParameterValue(VALUE, value_type=str), "7"),
        (ParameterValue(VALUE, value_type=float), 7.0),
        (ParameterValue(VALUE), 7),
        (ParameterValue([VALUE, "0"], value_type=int), 70),
        (LaunchConfiguration("yes"), True),
        (LaunchConfiguration("list"), [1, 2]),
        (LaunchConfiguration("broken"), "[1, 2"),
        (LaunchConfiguration("robot"), ROBOT),
    ]
    for given, read in rows:
        values = {"value": "7", "yes": "true", "list": "[1, 2]", "broken": "[1, 2", "robot": ROBOT}
        found = parameters(follow([node(parameters=[{"p": given}])], **values))["p"]
        assert (found, type(found)) == (read, type(read))


def test_parameters_come_from_maps_files_and_the_group(follow: Follow, write: Write) -> None:
    path = write("p.yaml", "/**:\n  ros__parameters:\n    kp: 3.0\n    ki: 1.0\n")
    other = write("q.yaml", "/**: {ros__parameters: {kd: 9.0, ki: 8.0}}")
    kept = follow(
        [
            SetUseSimTime(True),
            SetParameter("kp", 1.0),
            SetParametersFromFile(str(other)),
            node(
                parameters=[
                    path,
                    {"pid": {"low": 1, VALUE: "x"}},
                    ParameterFile(str(other)),
                    Parameter("n", 2),
                ]
            ),
        ],
        value="high",
    )
    want = {
        "use_sim_time": True,
        "kp": 3.0,
        "ki": 8.0,
        "kd": 9.0,
        "pid.low": 1,
        "pid.high": "x",
        "n": 2,
    }
    assert parameters(kept) == want


def test_a_wrong_node_is_one_line_with_its_place(follow: Follow) -> None:
    rows: list[tuple[dict[str, Any], str]] = [
        (
            {"parameters": {"a": 1}},
            r"parameters={'a': 1} is not a list; write \[{'name': value}, 'file.yaml'\]",
        ),
        (
            {"parameters": [{"a": None}]},
            "a parameter cannot be None; it must be a bool, a number, a text",
        ),
        (
            {"parameters": [{"a": ParameterValue("x", value_type=int)}]},
            "the parameter is 'x', not an int",
        ),
        ({"arguments": "-x 1"}, "arguments='-x 1' is one text; write a list of words"),
        ({"condition": "true"}, "condition='true' is not a condition"),
        ({"paramters": []}, r"Node has no argument 'paramters' \(did you mean 'parameters'"),
        ({"cwd": "nowhere"}, "cwd='nowhere' is not a folder"),
        ({"respawn": "often"}, "respawn is 'often'; it must be true or false"),
    ]
    for wrong, message in rows:
        with pytest.raises(LaunchError, match=rf"^{__file__}:\d+: {message}"):
            follow([node(**wrong)])


def test_a_node_that_is_not_there_is_reported_before_anything_runs(follow: Follow) -> None:
    for package, executable, message in [
        (
            "my_bot",
            "controler.py",
            r"package 'my_bot' has no executable 'controler.py' \(did you mean 'controller.py'\?\)",
        ),
        (
            "gazebo_ros",
            "spawn_entty.py",
            r"package 'gazebo_ros' has no executable 'spawn_entty.py' \(did you mean "
            r"'spawn_entity.py'\?\); those that",
        ),
    ]:
        with pytest.raises(LaunchError, match=rf"^{__file__}:\d+: {message}"):
            follow([Node(package=package, executable=executable)])


MUX = """
twist_mux:
  ros__parameters:
    topics: {joystick: {topic: joy_vel, timeout: 0.5, priority: 100}, nav: {topic: nav_vel, timeout: 0.5, priority: 10}}
    locks: {pause: {topic: pause_all, timeout: 0.0, priority: 255}}
"""  # noqa: E501
CPP = """auto a = node->create_publisher<Twist>("cmd_vel", 10);
b = this->create_subscription<sensor_msgs::msg::LaserScan>(
    "scan", qos, f);
"""


def test_what_lacks_without_a_node_that_cannot_run_is_told(follow: Follow, write: Write) -> None:
    mux = str(write("mux.yaml", MUX))
    write("src/my_bot/CMakeLists.txt", "add_executable(guard src/guard.cpp)")
    write("src/my_bot/src/guard.cpp", CPP)
    write("src/rqt_mine/package.xml", "<package><name>rqt_mine</name></package>")
    write("src/rqt_mine/scripts/mine.py")
    binary = write("guard", "\x7fELF")
    out = [("/cmd_vel_out", "/cmd_vel")]
    for action, message in [
        (
            Node(package="twist_mux", executable="twist_mux", parameters=[mux], remappings=out),
            "twist_mux: it chooses among commands, as the sim itself does by the priority of "
            "their senders; "
            "nobody forwards joy_vel, nav_vel to cmd_vel and its locks pause_all stop nothing",
        ),
        (
            Node(package="robot_localization", executable="ekf_node"),
            "robot_localization ekf_node: it fuses odometry; the sim publishes exact odom and its "
            "tf; nobody publishes "
            "odometry/filtered",
        ),
        (
            Node(package="nav2_collision_monitor", executable="collision_monitor"),
            "nav2_collision_monitor collision_monitor: it stops a robot before obstacles; this "
            "guard is gone and "
            "nobody forwards cmd_vel_smoothed to cmd_vel",
        ),
        (
            Node(package="topic_tools", executable="relay", arguments=["/a", "/b"]),
            "topic_tools relay: it forwards topics; remap them; nobody forwards /a to /b",
        ),
        (
            Node(package="my_boot", executable="x", remappings=[("a", "b")]),
            "my_boot x: there is no package 'my_boot' here (did you mean 'my_bot'?); --package "
            "my_boot=DIR gives its "
            "folder; nobody does its work, with a to b",
        ),
        (
            Node(package="my_bot", executable="guard", remappings=[("cmd_vel", "/fred/cmd_vel")]),
            "my_bot guard: it is C++, which does not run here; nobody publishes fred/cmd_vel or "
            "reads scan for it",
        ),
        (
            Node(executable=str(binary)),
            f"{binary}: it is not a Python script, and others do not run here; nobody does its "
            "work",
        ),
        (
            LifecycleNode(package="my_bot", executable="controller", name="c", namespace=""),
            "my_bot controller: it is a lifecycle node, and none run here; nobody does its work",
        ),
        (
            ExecuteProcess(cmd=["ros2", "run", "my_bot", "guard"]),
            "my_bot guard: it is C++, which does not run here; nobody publishes cmd_vel or reads "
            "scan for it",
        ),
        (
            IncludeLaunchDescription(
                [FindPackageShare("slam_toolbox"), "/launch/online_async_launch.py"]
            ),
            "slam_toolbox online_async_launch.py: it maps; there is no SLAM here; nobody "
            "publishes map, nor "
            "map -> odom in tf",
        ),
    ]:
        kept = follow([action])
        assert (kept.programs, kept.lacking, len(kept.left)) == ([], [message], 1)
    assert follow([Node(package="rqt_mine", executable="mine.py")]).words() == [
        "run",
        "rqt_mine",
        "mine.py",
    ]


def test_a_strict_launch_ends_where_a_node_cannot_run(follow: Follow) -> None:
    def strict(context: LaunchContext) -> None:
        context.strict = True

    state = Node(package="robot_state_publisher", executable="robot_state_publisher")
    assert follow([OpaqueFunction(function=strict), state]).left
    with pytest.raises(
        LaunchError,
        match=rf"^{__file__}:\d+: twist_mux cannot run here: it chooses among commands, ",
    ):
        follow([OpaqueFunction(function=strict), Node(package="twist_mux", executable="twist_mux")])


def test_components_with_a_script_or_a_stand_in_are_nodes(
    follow: Follow, capsys: pytest.CaptureFixture[str]
) -> None:
    def component(plugin: str, package: str = "my_bot", **words: Any) -> ComposableNode:
        return ComposableNode(package=package, plugin=plugin, **words)

    state = {"parameters": [{"robot_description": ROBOT}]}
    container = ComposableNodeContainer(
        name="all",
        namespace="",
        package="rclcpp_components",
        executable="component_container",
        composable_node_descriptions=[
            component("my_bot::Controller", name="c", remappings=[("a", "b")]),
            component(
                "robot_state_publisher::RobotStatePublisher", "robot_state_publisher", **state
            ),
            component("my_bot::LidarFilter"),
        ],
    )
    kept = follow(
        [container, LoadComposableNodes(composable_node_descriptions=[component("Controller")])]
    )
    assert kept.words() == [
        "run",
        "my_bot",
        "controller",
        "--ros-args",
        "-r",
        "__node:=c",
        "-r",
        "a:=b",
    ]
    assert kept.words(1) == ["run", "my_bot", "controller"]
    assert kept.context.descriptions == {"robot_description": ROBOT}
    assert kept.left[0] == (container, False)
    lidar = (
        "my_bot lidar_filter: it is a component in C++, which does not run here; nobody does "
        "its work"
    )
    assert kept.lacking == [lidar]
    assert capsys.readouterr().err.count("\n") == 1


def test_python_as_the_executable_runs_its_script(follow: Follow) -> None:
    kept = follow([Node(executable="/usr/bin/python3", arguments=["-u", "a.py", "x"], name="a")])
    assert kept.words() == ["run", "a.py", "x", "--ros-args", "-r", "__node:=a"]
    assert kept.programs[0].name == "a.py"
    with pytest.raises(LaunchError, match="python3 without a script"):
        follow([Node(executable="python3")])


def test_a_group_holds_what_is_set_in_it(follow: Follow) -> None:
    nodes = [node(namespace="c"), node(namespace="/d")]
    inner = GroupAction(
        [PushROSNamespace("a"), GroupAction([PushROSNamespace("b"), node()]), *nodes]
    )
    kept = follow([inner, node(), node(namespace="/d")])
    spaces = [program.words[-1].partition("__ns:=")[2] for program in kept.programs]
    assert spaces == ["/a/b", "/a/c", "/d", "", "/d"]


def test_a_group_that_is_not_scoped_lets_it_out(follow: Follow) -> None:
    group = GroupAction([SetLaunchConfiguration("value", "2")], scoped=False)
    assert follow([group, node(arguments=[VALUE])], value="1").words()[-1] == "2"
    group = GroupAction([SetLaunchConfiguration("value", "2")])
    assert follow([group, node(arguments=[VALUE])], value="1").words()[-1] == "1"


def test_what_is_left_out_is_named_with_what_to_use(
    follow: Follow, capsys: pytest.CaptureFixture[str]
) -> None:
    for package, executable, message in [
        (
            "rviz2",
            "rviz2",
            "launch: rviz2 is left out: `holozen view` or `holozen map` in another terminal",
        ),
        ("rqt_graph", "rqt_graph", "is left out: `holozen plot`"),
        (
            "joint_state_publisher_gui",
            "joint_state_publisher_gui",
            "is left out: the sim publishes joint_states",
        ),
        ("ros_gz_bridge", "parameter_bridge", "is left out: the sim is on the keys itself"),
        ("teleop_twist_keyboard", "teleop_twist_keyboard", "`holozen teleop` in another one"),
        (
            "robot_state_publisher",
            "robot_state_publisher",
            "the sim itself publishes joint_states and tf",
        ),
    ]:
        action = Node(package=package, executable=executable)
        kept = follow([action])
        assert message in capsys.readouterr().err
        assert (kept.programs, kept.left) == ([], [(action, False)])


def test_a_spawner_of_controllers_is_as_good_as_over(follow: Follow) -> None:
    spawner = Node(
        package="controller_manager", executable="spawner", arguments=["joint_state_broadcaster"]
    )
    assert follow([spawner]).left == [(spawner, True)]
