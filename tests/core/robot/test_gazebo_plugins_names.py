"""A plugin is known by its file, wherever it lies, or for gz-sim by its class."""

from holozen.robot.files.elements import Tag
from holozen.robot.files.gazebo_plugins import kind_of


def test_a_plugin_is_known_by_file_or_class() -> None:
    for filename, name, kind in [
        ("libgazebo_ros_diff_drive.so", "x", "gazebo_ros_diff_drive"),
        ("gazebo_ros_diff_drive", "x", "gazebo_ros_diff_drive"),
        (" /opt/ros/lib/libgazebo_ros_diff_drive.so ", "", "gazebo_ros_diff_drive"),
        ("libwb_plugin.so", "", "wb_plugin"),
        ("gz-sim-diff-drive-system", "x", "gz:diff-drive"),
        ("libgz-sim-diff-drive-system.so", "", "gz:diff-drive"),
        ("gz-sim8-velocity-control-system", "", "gz:velocity-control"),
        ("libignition-gazebo-mecanum-drive-system.so", "", "gz:mecanum-drive"),
        ("libignition-gazebo6-odometry-publisher-system.so", "", "gz:odometry-publisher"),
        ("anything.so", "gz::sim::systems::VelocityControl", "gz:velocity-control"),
        ("", "ignition::gazebo::systems::DiffDrive", "gz:diff-drive"),
        ("", "ignition::gazebo::v6::systems::MecanumDrive", "gz:mecanum-drive"),
        ("", "gz::sim::systems::", ""),
        ("", "", ""),
    ]:
        assert kind_of(Tag("plugin", {"filename": filename, "name": name}, "f")) == kind


def test_a_plugin_without_attributes_is_none() -> None:
    assert kind_of(Tag("plugin", {}, "f")) == ""
