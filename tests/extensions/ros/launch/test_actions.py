"""The other actions of a launch file, and programs that it starts."""

import os
import sys
from typing import Any

import pytest

from holozen.ros.launch import actions as a
from holozen.ros.launch.event_handlers import (
    OnProcessExit,
    OnProcessStart,
    OnShutdown,
    ProcessExited,
    ProcessStarted,
)
from holozen.ros.launch.event_handlers import Shutdown as ShutdownEvent
from holozen.ros.launch.launch_context import LaunchError
from holozen.ros.launch.launch_description import LaunchDescription
from holozen.ros.launch.launch_description_sources import PythonLaunchDescriptionSource
from holozen.ros.launch.substitutions import (
    EnvironmentVariable,
    LaunchConfiguration,
    ThisLaunchFileDir,
)
from holozen.ros.launch_ros import Node

from ..conftest import Write
from .conftest import Follow

ROBOT = LaunchConfiguration("robot")
GREETING = a.LogInfo(msg=["I am ", ROBOT])


def reported(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return capsys.readouterr().err.splitlines()


def test_an_argument_has_the_value_given_or_its_default(
    follow: Follow, capsys: pytest.CaptureFixture[str]
) -> None:
    declared = a.DeclareLaunchArgument("robot", default_value=["no", "body"], description="a name")
    follow([declared, GREETING])
    follow([declared, GREETING], robot="Fred")
    assert reported(capsys) == ["I am nobody", "I am Fred"]


def test_an_argument_without_a_good_value_is_reported(follow: Follow) -> None:
    for declared, message in [
        (
            a.DeclareLaunchArgument("which"),
            "launch argument 'which' has no value; give which:=VALUE",
        ),
        (
            a.DeclareLaunchArgument("robot", choices=["Ann", "Bob"]),
            "robot:=Fred: it must be one of Ann, Bob",
        ),
    ]:
        with pytest.raises(LaunchError, match=rf"^{__file__}:\d+: {message}"):
            follow([declared], robot="Fred")


def test_values_and_the_environment_can_be_set(
    follow: Follow, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = follow(
        [
            a.SetLaunchConfiguration("robot", "Ann"),
            GREETING,
            a.UnsetLaunchConfiguration("robot"),
            a.SetEnvironmentVariable("ROBOT", "Ann"),
            a.AppendEnvironmentVariable("ROBOT", "Bob"),
            a.AppendEnvironmentVariable("ROBOT", "Eve", prepend=True),
            a.LogInfo(msg=EnvironmentVariable("ROBOT")),
            a.ExecuteProcess(cmd=["true"], additional_env={"MORE": "1"}),
            a.UnsetEnvironmentVariable("ROBOT"),
            a.ExecuteProcess(cmd=["true"], env={"ALONE": "1"}),
        ]
    )
    assert reported(capsys) == ["I am Ann", "Eve:Ann:Bob"]
    first, second = (program.environment for program in kept.programs)
    assert (first["ROBOT"], first["MORE"], first["PATH"]) == (
        "Eve:Ann:Bob",
        "1",
        os.environ["PATH"],
    )
    assert second == {"ALONE": "1"}
    assert "ROBOT" not in os.environ


def test_a_launch_file_is_included_with_values(
    follow: Follow, write: Write, capsys: pytest.CaptureFixture[str]
) -> None:
    text = """
from holozen.ros.launch.actions import DeclareLaunchArgument, LogInfo
from holozen.ros.launch import LaunchDescription
from holozen.ros.launch.substitutions import LaunchConfiguration, ThisLaunchFileDir
def generate_launch_description():
    robot = DeclareLaunchArgument("robot", default_value="none")
    return LaunchDescription([robot, LogInfo(msg=[ThisLaunchFileDir(), " ", LaunchConfiguration("robot")])])
"""  # noqa: E501
    path = write("other/b.launch.py", text)
    source = PythonLaunchDescriptionSource(str(path))
    include = a.IncludeLaunchDescription(source, launch_arguments={"robot": ["Fr", "ed"]}.items())
    kept = follow([include, a.LogInfo(msg=ThisLaunchFileDir())])
    assert reported(capsys) == [f"{path.parent} Fred", str(kept.context.file.parent)]
    # as in ROS, where includes are not scoped
    assert kept.context.launch_configurations["robot"] == "Fred"


def test_a_file_that_cannot_be_included_is_reported(follow: Follow, write: Write) -> None:
    for name, text, message in [
        (
            "c.launch.py",
            "",
            r"b.launch.py does not exist; launch files in that folder: c.launch.py",
        ),
        (
            "b.launch.xml",
            "<launch/>",
            "launch files are in Python here; write b.launch.py, with a Node",
        ),
        ("b.launch.txt", "", "not a launch file; the names of launch files end with .py"),
        ("b.launch.py", "x = 1", "has no function generate_launch_description"),
        (
            "b.launch.py",
            "def generate_launch_description(): return 7",
            r"returned 7, not a LaunchDescription",
        ),
    ]:
        path = write(f"other/{name}", text)
        wanted = path if name[0] == "b" else path.with_name("b.launch.py")
        with pytest.raises(LaunchError, match=rf"^{__file__}:\d+: .*{message}"):
            follow([a.IncludeLaunchDescription(wanted)])


def test_files_that_include_themselves_are_reported(follow: Follow, write: Write) -> None:
    text = """
from holozen.ros.launch.actions import IncludeLaunchDescription
from holozen.ros.launch import LaunchDescription
def generate_launch_description():
    return LaunchDescription([IncludeLaunchDescription(__file__)])
"""
    with pytest.raises(
        LaunchError, match="launch files include one another more than 30 levels deep"
    ):
        follow([a.IncludeLaunchDescription(write("b.launch.py", text))])


def test_a_function_is_called_and_what_it_returns_is_done(
    follow: Follow, capsys: pytest.CaptureFixture[str]
) -> None:
    def choose(context: Any, *args: str, again: str) -> Any:
        name = ROBOT.perform(context)
        assert context.perform_substitution(ROBOT) == context.launch_configurations["robot"] == name
        return [a.LogInfo(msg=f"{name} {args} {again}")] if name == "Fred" else None

    def actions() -> list[Any]:
        return [a.OpaqueFunction(function=choose, args=["x"], kwargs={"again": "y"})]

    follow(actions(), robot="Fred")
    follow(actions(), robot="Ann")
    assert reported(capsys) == ["Fred ('x',) y"]


def test_a_function_that_returns_no_actions_is_reported(follow: Follow) -> None:
    for function in [lambda _context: [7], lambda _context: 7]:
        with pytest.raises(LaunchError, match=r"7 is not an action; write Node"):
            follow([a.OpaqueFunction(function=function)])


def test_timers_and_handlers_are_kept_for_later(follow: Follow) -> None:
    timer, handler = (
        a.TimerAction(period=ROBOT, actions=[GREETING]),
        OnShutdown(on_shutdown=[GREETING]),
    )
    kept = follow(
        [timer, a.RegisterEventHandler(handler), a.TimerAction(period=1, actions=[])], robot="2.5"
    )
    assert (kept.timers[0], kept.handlers) == ((2.5, [GREETING]), [handler])
    timer.cancel()
    assert [seconds for seconds, _ in kept.timers] == [1.0]
    assert (
        follow([a.RegisterEventHandler(handler), a.UnregisterEventHandler(handler)]).handlers == []
    )


def test_the_launch_can_be_ended(follow: Follow) -> None:
    for action in [a.Shutdown(reason="done"), a.EmitEvent(event=ShutdownEvent(reason="done"))]:
        assert follow([action]).reason == "done"


def test_a_handler_answers_for_its_own_action(follow: Follow) -> None:
    mine, other = a.ExecuteProcess(cmd=["true"]), a.ExecuteProcess(cmd=["true"])
    context = follow([]).context
    ended, started = ProcessExited(mine, "true-1", 3), ProcessStarted(mine, "true-1")
    assert list(OnProcessExit(target_action=mine, on_exit=[GREETING]).handle(ended, context)) == [
        GREETING
    ]
    assert list(OnProcessExit(target_action=mine, on_exit=GREETING).handle(started, context)) == []
    assert (
        list(OnProcessStart(target_action=other, on_start=[GREETING]).handle(started, context))
        == []
    )
    assert list(OnProcessStart(on_start=[GREETING]).handle(started, context)) == [GREETING]
    reported: list[Any] = []
    OnProcessExit(on_exit=lambda event, _context: reported.append(event.returncode)).handle(
        ended, context
    )
    OnProcessExit(target_action=lambda action: action is other, on_exit=[GREETING])
    assert reported == [3]


def test_scripts_of_python_and_verbs_of_ros2_are_ours(follow: Follow, write: Write) -> None:
    write("src/my_bot/scripts/c.py")
    kept = follow(
        [
            a.ExecuteProcess(cmd=["python3", "a.py", "-x"], output="screen"),
            a.ExecuteProcess(cmd=[sys.executable, ["a", ".py"]]),
            a.ExecuteProcess(
                cmd=["ros2", "topic", "pub", "-1", "/cmd_vel", "geometry_msgs/msg/Twist", "{}"]
            ),
            a.ExecuteProcess(cmd=["ros2", "run", "my_bot", "c.py", "--fast"]),
        ]
    )
    words = [kept.words(number) for number in range(4)]
    assert words[:2] == [["run", "a.py", "-x"], ["run", "a.py"]]
    assert words[2] == ["topic", "pub", "-1", "/cmd_vel", "geometry_msgs/msg/Twist", "{}"]
    assert words[3] == ["run", "my_bot", "c.py", "--fast"]
    assert [program.name for program in kept.programs] == ["a.py", "a.py", "ros2 topic", "ros2 run"]


def test_a_verb_of_ros2_that_is_not_ours_is_left_out(
    follow: Follow, capsys: pytest.CaptureFixture[str]
) -> None:
    action = a.ExecuteProcess(cmd=["ros2", "control", "load_controller", "arm"])
    assert follow([action]).left == [(action, True)]
    assert reported(capsys) == [
        "launch: `ros2 control load_controller arm` is left out: there is no verb 'control' here"
    ]


def test_a_line_for_the_shell_may_be_ours_too(follow: Follow) -> None:
    line = ["ros2 service call ", "/spawn ", "turtlesim/srv/Spawn ", '"{x: 2, y: 2}"']
    kept = follow(
        [
            a.ExecuteProcess(cmd=[line], shell=True),
            a.ExecuteProcess(cmd=["ros2 topic list | wc -l"], shell=True),
        ]
    )
    assert kept.words() == ["service", "call", "/spawn", "turtlesim/srv/Spawn", "{x: 2, y: 2}"]
    assert list(kept.programs[1].words) == ["ros2 topic list | wc -l"]


def test_a_terminal_is_left_out_with_what_to_run_in_one(
    follow: Follow, capsys: pytest.CaptureFixture[str]
) -> None:
    script = {"package": "my_bot", "executable": "teleop.py"}
    kept = follow(
        [
            a.ExecuteProcess(cmd=["xterm", "-e", "ros2", "run", "my_bot", "teleop.py"]),
            Node(prefix="xterm -e", **script),
        ]
    )
    assert kept.programs == []
    assert reported(capsys) == [
        "launch: xterm is left out: run this in another terminal: holozen run my_bot teleop.py",
        "launch: my_bot teleop.py is left out: run it in another terminal: holozen run my_bot "
        "teleop.py",
    ]


def test_other_programs_are_started_as_they_are(follow: Follow) -> None:
    kept = follow(
        [
            a.ExecuteProcess(cmd=["echo", ROBOT], name="hi"),
            a.ExecuteProcess(cmd=["echo", ROBOT, "|", "cat"], shell=True),
            a.ExecuteProcess(cmd=["sleep", "1"], respawn=True, respawn_delay=2),
        ],
        robot="Fred",
    )
    first, second, third = kept.programs
    assert (list(first.words), first.name, first.shell) == (["echo", "Fred"], "hi", False)
    assert (list(second.words), second.shell) == (["echo Fred | cat"], True)
    assert third.respawn == 2.0


def test_what_is_written_wrong_is_reported_with_its_place() -> None:
    rows: list[tuple[Any, str]] = [
        (
            lambda: a.ExecuteProcess(cmd="echo a"),
            "cmd='echo a' is one text; write a list of words",
        ),
        (
            lambda: a.LogInfo(msg="", mesg=""),
            r"LogInfo has no argument 'mesg' \(did you mean 'msg'",
        ),
        (lambda: LaunchDescription(["x"]), "'x' is not an action; write Node"),
        (lambda: a.GroupAction([None]), "None is not an action"),
        (lambda: a.OpaqueFunction(function="f"), "function='f' is not a function"),
        (lambda: a.EmitEvent(event="stop"), r"only launch.events.Shutdown\(\) can be emitted here"),
    ]
    for make, message in rows:
        with pytest.raises(LaunchError, match=rf"^{__file__}:\d+: .*{message}"):
            make()


def test_what_cannot_be_done_is_reported_with_its_place(follow: Follow) -> None:
    for action, message in [
        (a.ExecuteProcess(), "ExecuteProcess has no cmd"),
        (a.TimerAction(period=-1, actions=[]), "period is '-1'; it must be a number from 0 up"),
        (a.GroupAction([], scoped="perhaps"), "scoped is 'perhaps'; it must be true or false"),
    ]:
        with pytest.raises(LaunchError, match=rf"^{__file__}:\d+: {message}"):
            follow([action])
