"""Launch files as students of Gazebo lessons write them, with the real sim."""

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from holozen import data, entities
from holozen.testing import Process, Wire, wait_for
from tests.integration.robots import Robot

REPO = Path(__file__).parents[4]
Launch = Callable[..., Process]

CLASSIC = """
import os
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import Command, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description():
    share = get_package_share_directory('my_bot')
    gazebo_ros = get_package_share_directory('gazebo_ros')
    use_sim_time = LaunchConfiguration('use_sim_time', default='true')
    xacro_file = os.path.join(share, 'urdf', 'hb_bot.urdf.xacro')
    robot = ParameterValue(Command(['xacro ', xacro_file]), value_type=str)

    gazebo = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(os.path.join(gazebo_ros, 'launch', 'gazebo.launch.py')),
        launch_arguments={'world': os.path.join(share, 'worlds', 'lesson.world'), 'verbose': 'true'}.items(),
    )
    state = Node(package='robot_state_publisher', executable='robot_state_publisher', output='screen',
                 parameters=[{'robot_description': robot, 'use_sim_time': use_sim_time}])
    spawn = Node(package='gazebo_ros', executable='spawn_entity.py', output='screen',
                 arguments=['-topic', 'robot_description', '-entity', 'hb_bot', '-x', '0.5', '-Y', '0.0'])
    controller = Node(package='my_bot', executable='controller.py', name='controller', output='screen',
                      parameters=[{'goal': LaunchConfiguration('goal')}])
    return LaunchDescription([
        Node(package='twist_mux', executable='twist_mux'),
        DeclareLaunchArgument('goal', default_value='1.0', description='how far to go, in metres'),
        gazebo,
        state,
        spawn,
        RegisterEventHandler(OnProcessExit(target_action=spawn, on_exit=[controller])),
        Node(package='rviz2', executable='rviz2', arguments=['-d', os.path.join(share, 'rviz', 'a.rviz')]),
    ])
"""  # noqa: E501

SERVER_AND_CLIENT = """
import os
import xacro
from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import ExecuteProcess, IncludeLaunchDescription, TimerAction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def part(name, **more):
    path = PathJoinSubstitution([FindPackageShare('gazebo_ros'), 'launch', name])
    return IncludeLaunchDescription(PythonLaunchDescriptionSource([path]), **more)


def generate_launch_description():
    path = get_package_share_path('my_bot') / 'urdf' / 'hb_bot.urdf.xacro'
    text = xacro.process_file(str(path)).toxml()
    return LaunchDescription([
        part('gzserver.launch.py'),
        part('gzclient.launch.py', condition=IfCondition('true')),
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             parameters=[{'robot_description': text}], namespace='ann'),
        Node(package='gazebo_ros', executable='spawn_entity.py',
             arguments=['-topic', '/ann/robot_description', '-entity', 'ann', '-robot_namespace', 'ann', '-x', '-1']),
        TimerAction(period=0.5, actions=[
            Node(package='gazebo_ros', executable='spawn_entity.py',
                 arguments=['-file', str(path), '-entity', 'bob', '-y', '2.0', '-timeout', '60']),
        ]),
    ])
"""  # noqa: E501

CONTROLLER = """#!/usr/bin/env python3
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node


class Controller(Node):
    def __init__(self):
        super().__init__('unused')
        self.goal = self.declare_parameter('goal', 0.0).value
        self.x = None
        self.create_subscription(Odometry, '/odom', self.odom_cb, 10)
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.create_timer(0.05, self.drive)

    def odom_cb(self, msg):
        self.x = msg.pose.pose.position.x

    def drive(self):
        if self.x is None:
            return
        command = Twist()
        if self.x >= self.goal:
            self.publisher.publish(command)
            self.get_logger().info(f'{self.get_name()} is there')
            raise SystemExit
        command.linear.x = 0.4
        self.publisher.publish(command)


def main():
    rclpy.init()
    rclpy.spin(Controller())


if __name__ == '__main__':
    main()
"""


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A workspace with the package my_bot, whose robot and meshes are those of the lessons."""
    package = tmp_path / "src" / "my_bot"
    files = {
        "package.xml": "<package><name>my_bot</name></package>",
        "launch/classic.launch.py": CLASSIC,
        "launch/parts.launch.py": SERVER_AND_CLIENT,
        "scripts/controller.py": CONTROLLER,
        "worlds/lesson.world": data.find("worlds", "empty.world").read_text(),
    }
    for name in ("hb_bot.urdf.xacro", "materials.xacro"):
        files[f"urdf/{name}"] = (
            data.find("urdf", name).read_text().replace("$(find holo)", "$(find my_bot)")
        )
    for name, text in files.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text)
    (package / "meshes").symlink_to(data.find("meshes"))
    return tmp_path


@pytest.fixture
def launch(wire: Wire, workspace: Path) -> Iterator[Launch]:
    """`launch("a.launch.py", "goal:=2")`: the launch file of my_bot, which runs on."""
    started: list[Process] = []

    def launch(*words: str) -> Process:
        flags = [*wire.flags, "--package", f"my_bot={workspace / 'src' / 'my_bot'}"]
        line = [sys.executable, "-m", "holozen", "launch", *flags, "my_bot", *words]
        started.append(Process(line, env={"PYTHONPATH": str(REPO), "ROS_DISTRO": ""}))
        return started[-1]

    yield launch
    for process in started:
        process.close()
        print(process.out, process.err)


def children(pid: int) -> list[int]:
    found = []
    for each in map(int, filter(str.isdecimal, os.listdir("/proc"))):
        try:
            stat = Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(stat[1]) == pid and stat[0] != "Z":
            found.append(each)
    return found


def test_a_lesson_in_gazebo_is_launched_and_its_controller_drives(
    wire: Wire, launch: Launch
) -> None:
    process = launch("classic.launch.py", "goal:=0.8")
    process.wait_for_line("hb_bot listens on cmd_vel", within=60)
    robot = Robot(wire.bus())
    assert robot.newest().pose.pose.position.x > 0.4  # where the launch file put it
    process.wait_for_line("[controller]: controller is there", within=60)
    assert robot.newest().pose.pose.position.x >= 0.75
    for left_out in ("robot_state_publisher", "rviz2", "twist_mux"):
        assert f"launch: {left_out} is left out: " in process.err
    assert "Traceback" not in process.err
    parts = children(process.pid)
    assert parts
    assert process.interrupt() == 0
    wait_for(lambda: not any(Path(f"/proc/{pid}/cmdline").exists() for pid in parts))


def test_server_client_xacro_in_python_and_two_robots(wire: Wire, launch: Launch) -> None:
    process = launch("parts.launch.py")
    process.wait_for_line("bob listens on cmd_vel", within=60)
    process.wait_for_line("ann listens on ann/cmd_vel", within=60)
    bus = wire.bus()
    assert entities.names(bus) == ["ann", "bob"]
    ann, bob = (entities.pose(bus, name).position for name in ("ann", "bob"))
    assert [ann.x, bob.y] == pytest.approx([-1, 2], abs=0.05)
    assert "Gazebo's window is left out" in process.err
    assert process.terminate() == 0
