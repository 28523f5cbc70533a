"""Gazebo plugins -> how a robot is driven. Each is known by its file name, or for gz-sim by its class."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from holozen.robot.drives import Drive
from holozen.robot.errors import cut
from holozen.robot.parts import Joint, Link
from holozen.robot.plugins import gz, ros
from holozen.robot.plugins.measures import Robot, measured
from holozen.robot.plugins.names import file_of, kind_of
from holozen.robot.plugins.settings import Settings
from holozen.robot.sensors import SENSING
from holozen.robot.source import Source
from holozen.robot.tag import Tag

Reader = Callable[[Settings, Mapping[str, Joint], Source], Drive]

DRIVES: dict[str, Reader] = {
    "gazebo_ros_planar_move": ros.planar_move,
    "gazebo_ros_diff_drive": ros.diff_drive,
    "gazebo_ros_skid_steer_drive": ros.skid_steer,
    "gazebo_ros_diff_drive_multi_wheel": ros.multi_wheel,
    "diffdrive_plugin_multi_wheel": ros.multi_wheel,
    "hector_gazebo_ros_diff_drive_multi_wheel": ros.multi_wheel,
    "wb_plugin": ros.balancing,
    "gz:velocity-control": gz.velocity_control,
    "gz:diff-drive": gz.diff_drive,
    "gz:mecanum-drive": gz.mecanum_drive,
}
PUBLISHER = "gz:odometry-publisher"

JOINTS = "joint_states is published anyway, and joints obey joint_command"
STATES = "joint_states is published anyway"
POSES = "odom and tf are published anyway"
SERVER = "the sim does this itself"
INSTEAD = {
    "gazebo_ros_control": JOINTS,
    "gazebo_ros2_control": JOINTS,
    "gz_ros2_control": JOINTS,
    "ign_ros2_control": JOINTS,
    "gz:joint-position-controller": JOINTS,
    "gz:joint-trajectory-controller": JOINTS,
    "gz:joint-controller": JOINTS,
    "gazebo_ros_joint_pose_trajectory": JOINTS,
    "gazebo_ros_joint_state_publisher": STATES,
    "gz:joint-state-publisher": STATES,
    "gazebo_ros_p3d": POSES,
    "gz:pose-publisher": POSES,
    "gz:physics": SERVER,
    "gz:user-commands": SERVER,
    "gz:scene-broadcaster": SERVER,
    "gz:sensors": "sensors are not simulated yet",
    "gz:imu": "sensors are not simulated yet",
    "gz:contact": "sensors are not simulated yet",
    "roboticsgroup_gazebo_mimic_joint_plugin": "a URDF <mimic> does the same",
}
"""Plugin that drives nothing -> what happens without it."""


def read_plugins(
    robot: Tag, links: Mapping[str, Link], joints: Mapping[str, Joint], root: str, source: Source
) -> Drive | None:
    """What drives a `<robot>` or `<model>`: the first plugin that drives; the others make warnings.

    `links` and `joints` are those there are, by name. Plugins inside a `<sensor>` are the sensor's own. Raises
    RobotError for a plugin that drives and cannot as it is written.
    """
    drive, publishers = None, []
    for plugin in _plugins(robot):
        kind = kind_of(plugin)
        if kind == PUBLISHER:
            publishers.append(plugin)
        elif kind not in DRIVES:
            _tell(plugin, kind, source)
        elif drive is not None:
            source.warn(plugin, "is a second drive; only the first one drives")
        else:
            told = DRIVES[kind](Settings(plugin), joints, source)
            drive, driver = measured(told, plugin, Robot(links, joints, root)), plugin
    if drive is None:
        for plugin in publishers:
            source.warn(plugin, "tells the odometry of a drive, and there is none")
        return None
    for plugin in publishers:
        drive, driver = gz.with_publisher(drive, Settings(plugin), source), plugin
    return _with_known_frame(drive, driver, links, root, source)


def _plugins(robot: Tag) -> Iterator[Tag]:
    """Those outside of sensors, at any depth below a `<gazebo>`, or directly below a `<model>`."""
    waiting = [tag for tag in reversed(robot.children) if tag.name in ("gazebo", "plugin")]
    while waiting:
        tag = waiting.pop()
        if tag.name == "plugin":
            yield tag
        elif tag.name != "sensor":
            waiting += reversed(tag.children)


def _tell(plugin: Tag, kind: str, source: Source) -> None:
    if kind in INSTEAD:
        source.warn(plugin, f"({_file(plugin)}) is not run here; {INSTEAD[kind]}")
    elif kind in SENSING:
        source.warn(plugin, f"({SENSING[kind]}) is not simulated yet")
    else:
        known = (*DRIVES, *INSTEAD, *SENSING, PUBLISHER)
        near = source.nearest(kind, known, "gazebo_ros_", alike=0.8) if kind else ""
        source.warn(plugin, f"({_file(plugin) or 'no filename'}) is not known here and does nothing{near}")


def _file(plugin: Tag) -> str:
    name = file_of(plugin)
    return name if len(name) <= 80 else f"{name[:77]}..."


def _with_known_frame(drive: Drive, plugin: Tag, links: Mapping[str, Link], root: str, source: Source) -> Drive:
    frame = drive.robot_base_frame
    if frame in links:
        return drive
    if frame:
        source.warn(plugin, f"names the base frame {cut(frame)}, which is no link; {cut(root)} is used")
    return replace(drive, robot_base_frame=root)
