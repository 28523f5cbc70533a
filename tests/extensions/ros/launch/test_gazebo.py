"""Gazebo in a launch file is our sim, and its spawn_entity.py is `holozen spawn`."""

from pathlib import Path
from typing import Any

import pytest

from holozen import data
from holozen.ros import packages
from holozen.ros.ament_index_python import get_package_share_directory
from holozen.ros.launch.actions import ExecuteProcess, GroupAction, IncludeLaunchDescription
from holozen.ros.launch.launch_context import LaunchError
from holozen.ros.launch.launch_description_sources import PythonLaunchDescriptionSource
from holozen.ros.launch.substitutions import (
    Command,
    FindPackageShare,
    LaunchConfiguration,
    PathJoinSubstitution,
)
from holozen.ros.launch_ros import Node, ParameterValue, PushROSNamespace

from ..conftest import Write
from .conftest import Follow

EMPTY = str(data.find("worlds", "empty.world"))
ARENA = str(data.find("worlds", "arena.world"))
ROBOT = '<robot name="r"><link name="base"/></robot>'


def included(package: str, name: str, **arguments: str) -> IncludeLaunchDescription:
    path = PathJoinSubstitution([FindPackageShare(package), "launch", name])
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource([path]), launch_arguments=arguments.items()
    )


def spawn(*words: Any, **more: Any) -> Node:
    return Node(package="gazebo_ros", executable="spawn_entity.py", arguments=list(words), **more)


def publisher(robot: Any, **more: Any) -> Node:
    texts = [{"robot_description": robot, "use_sim_time": True}]
    return Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        parameters=texts,
        **more,
    )


def test_gazebos_launch_files_start_the_sim(
    follow: Follow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("here.world", "my.sdf"):
        Path(name).touch()
    for package, name, arguments, world in [
        ("gazebo_ros", "gazebo.launch.py", {}, EMPTY),
        ("gazebo_ros", "gazebo.launch.py", {"world": "", "gui": "false"}, EMPTY),
        ("gazebo_ros", "gzserver.launch.py", {"world": "worlds/empty.world"}, EMPTY),
        ("gazebo_ros", "gazebo.launch.py", {"world": "arena.world"}, ARENA),
        ("gazebo_ros", "gazebo.launch.py", {"world": "here.world"}, "here.world"),
        ("ros_gz_sim", "gz_sim.launch.py", {"gz_args": "-r -v 4 empty.sdf"}, EMPTY),
        ("ros_gz_sim", "gz_sim.launch.py", {"gz_args": "-r my.sdf -v4"}, "my.sdf"),
        ("ros_gz_sim", "gz_sim.launch.py", {"gz_args": ""}, EMPTY),
        ("ros_ign_gazebo", "ign_gazebo.launch.py", {"ign_args": "-r arena.sdf"}, ARENA),
    ]:
        kept = follow([included(package, name, **arguments)])
        assert kept.words() == ["sim", "--empty", "--world", world]
        assert kept.programs[0].required


def test_a_world_that_is_not_there_is_an_error_before_anything_starts(follow: Follow) -> None:
    launched = included("gazebo_ros", "gazebo.launch.py", world="aren.world")
    with pytest.raises(LaunchError, match=r"'aren.world': there is no such file .*arena.world"):
        follow([ExecuteProcess(cmd=["true"]), launched])


def test_a_world_of_the_package_is_used_as_it_is(follow: Follow, write: Write) -> None:
    world = str(write("src/my_bot/worlds/empty.world", "<sdf/>"))
    assert follow([included("gazebo_ros", "gazebo.launch.py", world=world)]).words()[-1] == world


def test_the_folder_of_gazebo_ros_is_asked_for_in_python_too(follow: Follow) -> None:
    path = f"{get_package_share_directory('gazebo_ros')}/launch/gzserver.launch.py"
    assert follow([IncludeLaunchDescription(path)]).words()[0] == "sim"


def test_server_and_window_are_one_sim(follow: Follow, capsys: pytest.CaptureFixture[str]) -> None:
    kept = follow(
        [included("gazebo_ros", name) for name in ("gzserver.launch.py", "gzclient.launch.py")]
    )
    assert len(kept.programs) == 1
    assert "Gazebo's window is left out; `holozen view`" in capsys.readouterr().err
    both = follow(
        [included("gazebo_ros", "gazebo.launch.py"), included("gazebo_ros", "gzserver.launch.py")]
    )
    assert len(both.programs) == 1


def test_gazebo_as_a_program_is_the_sim(
    follow: Follow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my.world").touch()
    for command, world in [
        (["gazebo", "--verbose", "-s", "libgazebo_ros_factory.so", "arena.world"], ARENA),
        (["gzserver", "-s", "libgazebo_ros_init.so"], EMPTY),
        (["/usr/bin/gazebo", "my.world"], "my.world"),
        (["gz", "sim", "-r", "empty.sdf"], EMPTY),
        (["ign", "gazebo", "-r", "arena.sdf"], ARENA),
    ]:
        assert follow([ExecuteProcess(cmd=command, output="screen")]).words() == [
            "sim",
            "--empty",
            "--world",
            world,
        ]


def test_an_unknown_launch_file_of_gazebo_is_reported(follow: Follow) -> None:
    for package, name, message in [
        (
            "gazebo_ros",
            "gazeb.launch.py",
            r"has no launch file 'gazeb.launch.py' \(did you mean 'gazebo.launch.py'",
        ),
        (
            "ros_gz_sim",
            "ros_gz_spawn_model.launch.py",
            r"has no launch file 'ros_gz_spawn_model.launch.py' \(did you mean 'gz_sim",
        ),
        ("nave2_bringup", "x.launch.py", "no package 'nave2_bringup'"),
    ]:
        with pytest.raises(LaunchError, match=rf"^{__file__}:\d+: .*{message}"):
            follow([included(package, name)])


def test_a_file_is_spawned_at_the_root_of_the_keys(follow: Follow) -> None:
    words = [
        "-entity",
        "hb_bot",
        "-file",
        "a.urdf",
        "-x",
        "1",
        "-z",
        "-0.5",
        "-Y",
        "1.57",
        "-unpause",
    ]
    kept = follow([spawn(*words, "-reference_frame", "world", "--ros-args", "--log-level", "info")])
    places = ["-x=1", "-z=-0.5", "-Y=1.57"]
    assert kept.words() == [
        "spawn",
        "--name",
        "hb_bot",
        "-file",
        "a.urdf",
        *places,
        "--namespace",
        "/",
        "--timeout",
        "60",
    ]


def test_a_value_that_the_spawner_would_refuse_is_wrong_before_anything_starts(
    follow: Follow,
) -> None:
    with pytest.raises(
        LaunchError,
        match=rf"^{__file__}:\d+: `holozen spawn`, .*: argument -x: 'far': use a number",
    ):
        follow([spawn("-entity", "hb_bot", "-file", "a.urdf", "-x", "far")])


def test_a_namespace_and_a_timeout_are_kept(follow: Follow) -> None:
    words = ["-file", "a.urdf", "-robot_namespace", "fred", "-timeout", "9"]
    assert follow([spawn(*words)]).words() == [
        "spawn",
        "-file",
        "a.urdf",
        "--namespace",
        "fred",
        "--timeout",
        "9",
    ]


def test_what_the_launch_lets_a_file_read_the_spawner_may_read(
    follow: Follow, write: Write
) -> None:
    packages.use({}, env=["TOKEN"])
    kept = follow([spawn("-file", "a.urdf")])
    assert kept.words()[:5] == ["spawn", "-file", "a.urdf", "--allow-env", "TOKEN"]


def test_topic_robot_description_is_what_robot_state_publisher_has(
    follow: Follow, write: Write
) -> None:
    """Whichever of the two comes first in the launch file."""
    path = write("src/my_bot/urdf/r.urdf.xacro", ROBOT)
    robot = ParameterValue(
        Command(["xacro ", str(path), " robot:=", LaunchConfiguration("robot")]), value_type=str
    )
    actions = [publisher(robot), spawn("-topic", "robot_description", "-entity", "r")]
    for ordered in (actions, actions[::-1]):
        kept = follow(ordered, robot="me")
        assert kept.words()[:5] == ["spawn", "--name", "r", str(path), "robot:=me"]


def test_a_text_that_no_file_holds_is_written_into_one(follow: Follow) -> None:
    kept = follow([publisher(ROBOT, namespace="fred"), spawn("-topic", "/fred/robot_description")])
    path = Path(kept.words()[1])
    assert path.read_text() == ROBOT
    assert kept.context.temporary_files == [path]
    path.unlink()


def test_robot_state_publisher_may_have_the_file_as_its_word(follow: Follow, write: Write) -> None:
    path = str(write("r.urdf", ROBOT))
    state = Node(
        package="robot_state_publisher", executable="robot_state_publisher", arguments=[path]
    )
    assert follow([state, spawn("-topic", "robot_description")]).words()[:2] == ["spawn", path]


def test_three_robots_of_one_file_come_from_the_topics_of_their_namespaces(
    follow: Follow, write: Write
) -> None:
    groups = []
    for name in ("ann", "bob"):
        robot = Command(["cat ", str(write(f"{name}.urdf", ROBOT.replace("r", name, 1)))])
        group = [publisher(robot), spawn("-topic", "robot_description", "-entity", name)]
        groups.append(GroupAction([PushROSNamespace(name), *group]))
    robot = Command(["cat ", str(write("cyd.urdf", ROBOT))])
    state = publisher(robot, namespace="cyd")
    kept = follow(
        [*groups, state, spawn("-topic", "robot_description", "-entity", "cyd", namespace="cyd")]
    )
    for number, name in enumerate(("ann", "bob", "cyd")):
        words = kept.words(number)
        assert words[:3] == ["spawn", "--name", name]
        assert Path(words[3]).name == f"{name}.urdf"
        assert words[words.index("--namespace") + 1] == name


def test_the_spawner_of_new_gazebo_takes_texts_too(follow: Follow) -> None:
    words = [
        "-name",
        "r",
        "-string",
        ROBOT,
        "-world",
        "empty",
        "-allow_renaming",
        "true",
        "-x",
        "2",
    ]
    kept = follow([Node(package="ros_gz_sim", executable="create", arguments=words)])
    assert kept.words()[:4] == ["spawn", "--name", "r", "-x=2"]
    assert Path(kept.words()[4]).read_text() == ROBOT
    texts = [{"robot_description": ROBOT}]
    words = ["-param", "robot_description"]
    kept = follow(
        [Node(package="ros_gz_sim", executable="create", arguments=words, parameters=texts)]
    )
    assert Path(kept.words()[1]).read_text() == ROBOT


def test_a_robot_that_cannot_be_found_is_one_line(follow: Follow) -> None:
    for words, message in [
        (
            ["-topic", "robot_description"],
            "-topic robot_description: nothing in this launch file publishes",
        ),
        (["-param", "robot"], "-param robot: this Node has no parameter 'robot'"),
        (["-entity", "r"], "give -file FILE or -topic robot_description"),
        (["-enttiy", "r"], r"unknown flag '-enttiy' to spawn a robot \(did you mean '-entity'"),
        (["-database", "r"], "unknown flag '-database' to spawn a robot"),
        (["-file"], "-file needs a value"),
    ]:
        with pytest.raises(LaunchError, match=rf"^{__file__}:\d+: .*{message}"):
            follow([spawn(*words)])
