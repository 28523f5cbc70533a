"""Gazebo with hb_bot, the goals, and the controller that drives to them."""

import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import Command, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

HERE = os.path.dirname(os.path.abspath(__file__))
ROBOT = os.path.join(HERE, "..", "..", "..", "..", "urdf", "hb_bot.urdf.xacro")


def generate_launch_description():
    gazebo = os.path.join(get_package_share_directory("gazebo_ros"), "launch", "gazebo.launch.py")
    description = ParameterValue(Command(["xacro ", LaunchConfiguration("robot")]), value_type=str)
    kp_linear = ParameterValue(LaunchConfiguration("kp_linear"), value_type=float)
    return LaunchDescription(
        [
            DeclareLaunchArgument("robot", default_value=ROBOT, description="a xacro file"),
            DeclareLaunchArgument(
                "kp_linear", default_value="1.5", description="speed in m/s for each metre to go"
            ),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(gazebo)),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[{"robot_description": description}],
            ),
            Node(
                package="gazebo_ros",
                executable="spawn_entity.py",
                arguments=["-topic", "robot_description", "-entity", "hb_bot"],
            ),
            Node(package="hb_control", executable="service_node.py", output="screen"),
            Node(
                package="hb_control",
                executable="controller.py",
                output="screen",
                parameters=[{"kp_linear": kp_linear}],
            ),
        ]
    )
