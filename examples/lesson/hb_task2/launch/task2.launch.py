"""The arena with its camera, three robots on it, and what Gazebo needs for that."""

import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import Command
from launch_ros.actions import Node

HERE = get_package_share_directory("hb_task2")
PLACES = {1: (0.5, -0.1), 2: (-0.2, -0.5), 3: (-0.45, 0.4)}  # the first corners of their shapes


def spawned(number):
    x, y = PLACES[number]
    description = Command(
        ["xacro ", os.path.join(HERE, "urdf", "hb_bot.urdf.xacro"), f" number:={number}"]
    )
    name = f"hb_bot_{number}"
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            namespace=name,
            parameters=[{"robot_description": description}],
        ),
        Node(
            package="gazebo_ros",
            executable="spawn_entity.py",
            arguments=[
                "-topic",
                f"/{name}/robot_description",
                "-entity",
                name,
                "-x",
                str(x),
                "-y",
                str(y),
            ],
        ),
    ]


def generate_launch_description():
    gazebo = os.path.join(get_package_share_directory("gazebo_ros"), "launch", "gazebo.launch.py")
    world = os.path.join(HERE, "worlds", "task2.world")
    return LaunchDescription(
        [
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(gazebo), launch_arguments={"world": world}.items()
            ),
            *(action for number in (1, 2, 3) for action in spawned(number)),
        ]
    )
