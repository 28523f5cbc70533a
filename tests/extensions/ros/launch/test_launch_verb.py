"""`holozen launch` with launch files as they are written, all of it but the sim."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from holozen.messages import Clock, TFMessage
from holozen.messages.codec import decode
from holozen.ros import importer
from holozen.testing import Process, Wire, wait_for
from holozen.transport.samples import Sample

from ..conftest import Write
from .conftest import gone

Launch = Callable[..., subprocess.CompletedProcess[str]]
REPO = Path(__file__).parents[4]
HEAD = """
from launch import LaunchDescription; from launch.event_handlers import OnProcessExit
from launch.actions import *
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
"""


def line(wire: Wire, *words: str) -> list[str]:
    return [sys.executable, "-m", "holozen", "launch", *wire.flags, *words]


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(REPO), "PYTHONUNBUFFERED": ""}


@pytest.fixture
def launch(my_bot: Path, wire: Wire) -> Launch:
    """`launch("my_bot", "a.launch.py")`: follow it to its end, in the workspace."""

    def launch(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            line(wire, *words), capture_output=True, text=True, timeout=60, env=environment()
        )

    return launch


@pytest.fixture
def refuse(my_bot: Path, wire: Wire, call: Launch) -> Iterator[Launch]:
    """As `launch`, in this process: for what starts none of the others."""
    yield partial(call, "launch", *wire.flags)
    importer.remove()


def described(*entities: str) -> str:
    return (
        f"{HEAD}\ndef generate_launch_description():\n    return "
        f"LaunchDescription([{', '.join(entities)}])\n"
    )


def test_a_launch_file_with_missing_modules_gets_a_hint(refuse: Launch, write: Write) -> None:
    path = write("a.launch.py", "import os\nimport interactive_markers.interactive_marker_server\n")
    done = refuse(str(path))
    assert done.stderr.startswith(f"holozen launch: {path}:2: ")
    assert "there are no interactive markers here" in done.stderr
    assert done.stderr.count("\n") == 1


def test_gazebos_own_launch_files_start_the_sim(my_bot: Path, wire: Wire) -> None:
    words = ["gazebo_ros", "gazebo.launch.py", "gui:=false"]
    with Process(line(wire, *words), env=environment()) as launch:
        launch.wait_for_line("`holozen sim` replaces Gazebo")
        launch.wait_for_line("no robot yet", within=60)
        assert launch.interrupt() == 0
    assert "does not use" not in launch.err


def test_gazebos_own_launch_files_take_a_world(refuse: Launch) -> None:
    done = refuse("gazebo_ros", "gazebo.launch.py", "world:=nowhere.world")
    assert done.returncode == 1
    assert "nowhere.world" in done.stderr


def test_a_wrong_name_of_gazebos_launch_files_gets_the_closest(refuse: Launch) -> None:
    for words, expected in [
        (
            ["gazebo_ros", "gazeboo.launch.py"],
            "'gazeboo.launch.py' (did you mean 'gazebo.launch.py'?)",
        ),
        (["ros_gz_sim", "qqqq.py"], "'qqqq.py'; there are gz_sim.launch.py"),
    ]:
        done = refuse(*words)
        assert (done.returncode, done.stderr.count("\n")) == (1, 1)
        start = f"holozen launch: {words[0]}, which holozen replaces, has no launch file"
        assert done.stderr == f"{start} {expected}\n"


def test_gazebo_in_a_launch_file_is_refused_beside_another_sim(
    refuse: Launch, write: Write, wire: Wire
) -> None:
    wire.bus("sim").publisher("clock", Clock)
    gazebo = "ExecuteProcess(cmd=['gazebo', 'empty.world'])"
    path = write("a.launch.py", described(gazebo, "ExecuteProcess(cmd=['echo', 'started'])"))
    done = refuse(str(path))
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert done.stderr.startswith(f"holozen launch: {path}:8: sim@")
    assert done.stderr.endswith(
        " simulates here already; end it, or leave Gazebo out of the launch file to use it\n"
    )


CONTROLLER = """#!/usr/bin/env python3
import sys
import rclpy
from rclpy.node import Node
rclpy.init()
node = Node("nobody")
node.declare_parameter("kp", 0.0)
name = node.get_namespace(), node.get_name()
print(*name, node.get_parameter("kp").value, node.resolve_topic_name("cmd_vel"), sys.argv[1])
"""
NODE = """Node(package='my_bot', executable='controller.py', name='controller', namespace='fred', arguments=['--fast'],
    parameters=[{'kp': LaunchConfiguration('kp')}], remappings=[('cmd_vel', '/drive')], output='screen')"""  # noqa: E501
ARGUMENTS = ("DeclareLaunchArgument('kp', default_value='1.5', description='how eager')",)


def test_a_node_runs_with_its_words(launch: Launch, write: Write) -> None:
    write("src/my_bot/scripts/controller.py", CONTROLLER)
    write("src/my_bot/launch/a.launch.py", described(*ARGUMENTS, NODE))
    done = launch("my_bot", "a.launch.py", "kp:=2.5")
    line = "[controller.py-1] /fred controller 2.5 /drive --fast\n"
    assert (done.stdout, done.stderr, done.returncode) == (line, "", 0)


def test_show_args_lists_the_arguments_and_starts_nothing(refuse: Launch, write: Write) -> None:
    gui = (
        "DeclareLaunchArgument('gui', default_value=PathJoinSubstitution(['a', 'b']), "
        "choices=['a', 'b'])"
    )
    others = "DeclareLaunchArgument('world')", "ExecuteProcess(cmd=['false'])"
    write("a.launch.py", described(*ARGUMENTS, f"GroupAction([{gui}])", *others))
    done = refuse("-s", "a.launch.py")
    lines = [
        "kp:= how eager (default: 1.5)",
        "gui:= (default: <a/b>; one of a, b)",
        "world:= (required)",
    ]
    assert (done.returncode, done.stdout.splitlines(), done.stderr) == (0, lines, "")
    write("a.launch.py", described())
    # of which only the first does anything
    done = refuse("a.launch.py", "--show-args", "--noninteractive", "-d", "-a")
    assert (done.stdout, done.stderr) == ("it has no arguments\n", "")


def test_a_value_that_nothing_uses_is_reported(refuse: Launch, write: Write) -> None:
    write("a.launch.py", described(*ARGUMENTS))
    message = "holozen launch: a.launch.py does not use 'kpp' (did you mean 'kp'?)\n"
    assert (refuse("a.launch.py", "kpp:=3").stderr) == message


NAP = "ExecuteProcess(cmd=['sleep', '60'])"
LATER = (
    "RegisterEventHandler(OnProcessExit(on_exit=[LogInfo(msg=LaunchConfiguration('{}', "
    "default='x'))]))"
)


def test_a_value_that_nothing_uses_is_reported_while_the_launch_goes_on(
    my_bot: Path, wire: Wire, write: Write
) -> None:
    """Also while a handler and a timer wait that may use another one."""
    timer = f"TimerAction(period=99.0, actions=[{NAP}])"
    write("a.launch.py", described(*ARGUMENTS, LATER.format("kp"), timer, NAP))
    with Process(line(wire, "a.launch.py", "kpp:=3"), env=environment()) as going:
        assert going.wait_for_line("does not use 'kpp' (did you mean 'kp'?)")
        assert going.interrupt() == 0
    assert going.err.count("kpp") == 1


def test_a_value_that_may_be_used_later_is_not_reported(launch: Launch, write: Write) -> None:
    for later in [
        LATER.format("kpp"),
        "TimerAction(period=0.1, actions=[OpaqueFunction(function=lambda c: c.used.add('kpp'))])",
    ]:
        write("a.launch.py", described(*ARGUMENTS, later, "ExecuteProcess(cmd=['true'])"))
        assert "kpp" not in launch("a.launch.py", "kpp:=3").stderr.replace("launch: x", "")


def test_a_launch_file_of_a_package_in_xml_is_not_read(refuse: Launch, write: Write) -> None:
    write("src/my_bot/launch/a.launch.xml", "<launch/>")
    done = refuse("my_bot", "a.launch.xml")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert (
        "a.launch.xml: launch files are in Python here; write a.launch.py, with a "
        "Node(package=..., " in done.stderr
    )


def test_what_cannot_be_followed_is_one_line(refuse: Launch, write: Write) -> None:
    for text, message in [
        (
            "from launch.actions import ExecuteLocal",
            "a.launch.py:1: launch.actions has no 'ExecuteLocal' here",
        ),
        ("import launch.frontend", "a.launch.py:1: launch has no 'frontend' here"),
        ("import launch_testing", "a.launch.py:1: "),
        ("import launch\nlaunch.actions.Foo()", "a.launch.py:2: launch.actions has no 'Foo' here"),
        (
            "from ament_index_python.packages import "
            "get_package_share_directory\nget_package_share_directory('nav2')",
            "a.launch.py:2: no package 'nav2' around ",
        ),
        (
            described("Node(package='my_bot', executable='x', nam='y')"),
            "a.launch.py:8: Node has no argument 'nam' (did",
        ),
        (
            described("Node(package='my_bot', node_executable='x')"),
            "a.launch.py:8: Node has no argument 'node_executable', which is its name in XML or "
            "an older ROS; write ",
        ),
        (
            described("Node(pkg='my_bot', exec='x')"),
            "a.launch.py:8: Node has no argument 'pkg', which is its name in XML or an older ROS; "
            "write package=...",
        ),
        (described("Node(package='my_bot')"), "a.launch.py:8: Node lacks executable='...'"),
        (
            described("Node(package='my_bot', executable='x', remappings=['cmd_vel', '/drive'])"),
            "a.launch.py:8: remappings=['cmd_vel', '/drive'] is not a list of pairs; write [(",
        ),
        (
            described("IncludeLaunchDescription('b.launch.py', launch_arguments=['ab'])"),
            "a.launch.py:8: launch_arguments=['ab'] is not a list of pairs",
        ),
        (described("GroupAction([], launch_configurations=[1])"), "a.launch.py:8: "),
        (
            described("ExecuteProcess(cmd=['true'], env=['ab', 'c'])"),
            "a.launch.py:8: ExecuteProcess: ",
        ),
        (
            described("Node(package='nav2', executable='x')"),
            "a.launch.py:8: nav2 x cannot run here: there is no package 'nav2' here; --package "
            "nav2=DIR gives its "
            "folder; nobody does its work; only a simulation goes on without it",
        ),
        (described("'x'"), "a.launch.py:8: 'x' is not an action"),
        ("", "/a.launch.py has no function generate_launch_description()"),
    ]:
        write("a.launch.py", text)
        done = refuse(str(Path("a.launch.py").absolute()))
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
        assert done.stderr.startswith("holozen launch: ")
        assert message in done.stderr


def test_a_robot_that_cannot_be_expanded_is_one_line(
    refuse: Launch, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the library, of other tests in this process
    monkeypatch.delitem(sys.modules, "xacro", raising=False)
    robot = write(
        "r.urdf.xacro",
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n<link '
        'name="${lost}"/></robot>',
    )
    for entities in (
        ["LogInfo(msg=xacro.process_file('r.urdf.xacro').toxml())"],
        ["OpaqueFunction(function=lambda context: xacro.process_file('r.urdf.xacro') and None)"],
        ["LogInfo(msg=Command(['xacro ', 'r.urdf.xacro']))"],
    ):
        path = write(
            "a.launch.py",
            f"import xacro; from launch.substitutions import Command\n{described(*entities)}",
        )
        done = refuse(str(path))
        assert (done.returncode, done.stderr.count("\n")) == (1, 1)
        assert done.stderr.startswith(f"holozen launch: {path}:9: {robot.name}, line 2: ")


def test_a_file_that_is_not_there_is_one_line(refuse: Launch) -> None:
    for words, code, message in [
        (
            ["b.launch.py"],
            1,
            "b.launch.py does not exist, and there are no launch files in that folder",
        ),
        (["my_bot", "b.launch.py"], 1, "no launch file 'b.launch.py' in "),
        (["my_boot", "a.launch.py"], 1, "no package 'my_boot' around "),
        (["my_bot"], 1, "my_bot is a package; give one of its launch files too: none"),
        (
            ["gazebo_ros", "spawn_entity.py"],
            1,
            "no launch file 'spawn_entity.py'; use `holozen spawn`",
        ),
        (
            ["gazebo_ros"],
            1,
            "gazebo_ros is a package; give one of its launch files too: gazebo.launch.py, ",
        ),
        (["my_boot"], 1, "my_boot does not exist, and there are no launch files in that folder"),
        (["a", "b", "c"], 2, "give FILE, or PACKAGE FILE, not 'a b c'"),
        (["x:=1"], 2, "give FILE, or PACKAGE FILE, not 'nothing'"),
    ]:
        done = refuse(*words)
        assert (done.returncode, done.stderr.count("\n")) == (code, 1)
        assert message in done.stderr


def test_an_error_in_the_launch_file_has_its_own_traceback(launch: Launch, write: Write) -> None:
    write("a.launch.py", "def generate_launch_description():\n    return {}['lost']\n")
    done = launch("a.launch.py")
    assert done.returncode == 1
    assert "holozen" not in done.stderr
    assert done.stderr.splitlines()[-1] == "KeyError: 'lost'"


def test_a_node_that_fails_makes_the_launch_fail(launch: Launch, write: Write) -> None:
    write("src/my_bot/scripts/controller.py", "import sys; sys.exit(4)")
    write("a.launch.py", described("Node(package='my_bot', executable='controller.py')"))
    done = launch("a.launch.py")
    assert (done.returncode, done.stderr) == (
        1,
        "launch: controller.py-1 failed with exit code 4\n",
    )


SPINNER = """
import rclpy
rclpy.init()
node = rclpy.create_node("spinner")
try:
    print("spins")
    rclpy.spin(node)
finally:
    print("ends")
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP], ids=lambda n: n.name)
def test_a_signal_ends_the_nodes_and_the_launch(
    wire: Wire, write: Write, my_bot: Path, number: int
) -> None:
    write("src/my_bot/scripts/controller.py", SPINNER)
    write("a.launch.py", described("Node(package='my_bot', executable='controller.py')"))
    with Process(line(wire, "a.launch.py"), env=environment()) as process:
        process.wait_for_line("[controller.py-1] spins")
        process.signal(number)
        assert process.wait() == 0
        assert "[controller.py-1] ends" in process.out
        assert "Traceback" not in process.err.replace("[controller.py-1] Traceback", "")


def test_a_part_that_ends_by_ctrl_c_shows_no_traceback_but_that_of_its_own_fault(
    wire: Wire, write: Write, my_bot: Path
) -> None:
    sleeps = "print('sleeps', flush=True); import time; time.sleep(100)"
    write("plain.py", sleeps)
    write("faulty.py", f"try:\n    {sleeps}\nfinally:\n    int('x')\n")
    parts = [
        f"ExecuteProcess(cmd=['sh', '-c', 'exec python3 {one}.py'])" for one in ("plain", "faulty")
    ]
    write("a.launch.py", described(*parts))
    with Process(line(wire, "a.launch.py"), env=environment()) as process:
        process.wait_for_line("[sh-1] sleeps")
        process.wait_for_line("[sh-2] sleeps")
        assert process.interrupt() == 0
        assert "[sh-1] " not in process.err
        assert process.err.endswith(
            "[sh-2] ValueError: invalid literal for int() with base 10: 'x'\n"
        )


def test_a_signal_ends_it_even_if_its_output_is_not_read(
    wire: Wire, write: Write, my_bot: Path
) -> None:
    write("a.launch.py", described("ExecuteProcess(cmd=['yes'])"))
    with subprocess.Popen(
        line(wire, "a.launch.py"), env=environment(), stdout=subprocess.PIPE
    ) as process:
        assert process.stdout
        process.stdout.read(100_000)  # and no more, so that the pipe is full at once
        process.send_signal(signal.SIGTERM)
        try:
            assert process.wait(60) == 0
        finally:
            process.kill()


def test_it_goes_on_although_the_reader_has_gone(wire: Wire, write: Write, my_bot: Path) -> None:
    speak = "ExecuteProcess(cmd=['sh', '-c', 'echo 1; echo 2; echo 3 >&2; touch done'])"
    write("a.launch.py", described("LogInfo(msg='begins')", speak))
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        line(wire, "a.launch.py"), env=environment(), stdout=writer, stderr=writer, timeout=60
    )
    os.close(writer)
    assert done.returncode == 0
    assert Path("done").exists()


BY_SERVICE = """
import sys
import launch
from ament_index_python.packages import get_package_share_directory
from launch.actions import ExecuteProcess, LogInfo
from launch_ros.actions import Node

service = launch.LaunchService(argv=sys.argv[1:])
gazebo = get_package_share_directory('gazebo_ros')
good = [Node(executable='/usr/bin/python3', arguments=['-u', 'b.py', '--fast'], name='b', namespace='fred')]
service.include_launch_description(launch.LaunchDescription(good))
print('ended with', service.run())
service = launch.LaunchService()
service.include_launch_description(launch.LaunchDescription([ExecuteProcess(cmd=['nowhere'])]))
print('ended with', service.run(shutdown_when_idle=True))
"""  # noqa: E501


def test_a_script_runs_launch_descriptions_by_a_launch_service(
    my_bot: Path, wire: Wire, write: Write
) -> None:
    path = write("a.py", BY_SERVICE)
    write("b.py", CONTROLLER)
    words = [sys.executable, "-m", "holozen", "run", *wire.flags, "a.py"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, env=environment())
    assert done.stdout.splitlines() == [
        "[b.py-1] /fred b 0.0 /fred/cmd_vel --fast",
        "ended with 0",
        "ended with 1",
    ]
    assert done.stderr == f"launch: {path}:14: cannot start 'nowhere': No such file or directory\n"


def test_a_static_transform_is_published(wire: Wire, write: Write, my_bot: Path) -> None:
    words = "arguments=['1', '0', '0', '0', '0', '0', 'map', 'odom'], name='still'"
    write(
        "a.launch.py",
        described(f"Node(package='tf2_ros', executable='static_transform_publisher', {words})"),
    )
    with Process(line(wire, "a.launch.py"), env=environment()):
        bus = wire.bus()

        def held() -> list[Sample]:  # what a late node is given
            return [one for one in bus.ask("tf_static", 5.0) if isinstance(one, Sample)]

        (message,) = wait_for(held)
        (transform,) = decode(message.payload, message.encoding, (TFMessage,)).transforms
        assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
        assert transform.transform.translation.x == 1.0
        graph = bus.graph()
        wait_for(lambda: "still" in {end.node for end in graph.endpoints()})


def test_killed_it_leaves_nothing(wire: Wire, write: Write, my_bot: Path) -> None:
    write("src/my_bot/scripts/controller.py", "import os, time; print(os.getpid()); time.sleep(60)")
    write("a.launch.py", described("Node(package='my_bot', executable='controller.py')"))
    with Process(line(wire, "a.launch.py"), env=environment()) as process:
        pid = int(process.wait_for_line("[controller.py-1] ").split()[-1])
        process.kill()
        wait_for(lambda: gone(pid))
