"""The drive plugins of ROS and of its lessons -> drives.

Tags and defaults are those of gazebo_plugins/src/gazebo_ros_planar_move.cpp, gazebo_ros_diff_drive.cpp and
gazebo_ros_skid_steer_drive.cpp in ros-simulation/gazebo_ros_pkgs, in ROS 1 (noetic) and ROS 2 (galactic), and of
hector_gazebo's diffdrive_plugin_multi_wheel.cpp. Three differ here: odometry and its tf are told unless the file
forbids it; a command that grows old stops the robot; and wheels whose measures are not told are measured.
"""

import math
from collections.abc import Mapping

from holozen.robot.drives import Balancing, Differential, Drive, Planar
from holozen.robot.errors import cut
from holozen.robot.parts import Joint
from holozen.robot.plugins.settings import SMALLEST, Settings
from holozen.robot.plugins.wheel_joints import turning, wheel_joint, wheel_joints
from holozen.robot.source import Source

Joints = Mapping[str, Joint]

TORQUE = 5.0  # N m
FAST = 100.0  # Hz; how often all but planar_move tell odometry
SKID_COVARIANCE = (1e-4, 1e-4, 1e-2)
SOURCES = {"encoder": True, "0": True, "world": False, "1": False}


def planar_move(settings: Settings, joints: Joints, source: Source) -> Drive:
    """gazebo_ros_planar_move.cpp. Raises RobotError, as all of these do."""
    plain = Drive()
    rate = settings.number(plain.odometry_rate, "odometry_rate", "publish_rate", zero=False)
    return _drive(settings, Planar(), rate, plain.covariance)


def diff_drive(settings: Settings, joints: Joints, source: Source) -> Drive:
    """gazebo_ros_diff_drive.cpp: one pair of wheels, in ROS 2 maybe several."""
    left = wheel_joints(settings, joints, source, "left_joint", "left_joint")
    right = wheel_joints(settings, joints, source, "right_joint", "right_joint")
    if len(left) != len(right):
        told = f"has {len(left)} left and {len(right)} right joints; wheels come in pairs"
        raise settings.owner.wrong(told)
    if settings.flag("legacy_mode", default=False):  # noetic: the file means the other side
        left, right = right, left
    _check_pairs(settings, len(left), source)
    # Both versions tell the true pose unless asked for the encoders.
    wheels = _differential(settings, left, right, encoder=_encoder(settings))
    return _drive(settings, wheels, _rate(settings), Drive().covariance)


def skid_steer(settings: Settings, joints: Joints, source: Source) -> Drive:
    """gazebo_ros_skid_steer_drive.cpp: four wheels; odometry tells the true pose."""
    names = [f"{side}_{place}_joint" for side in ("left", "right") for place in ("front", "rear")]
    front_left, rear_left, front_right, rear_right = (
        wheel_joint(settings, joints, source, name, name) for name in names
    )
    wheels = _differential(settings, (front_left, rear_left), (front_right, rear_right), encoder=False)
    return _drive(settings, wheels, _rate(settings), SKID_COVARIANCE)


def multi_wheel(settings: Settings, joints: Joints, source: Source) -> Drive:
    """diffdrive_plugin_multi_wheel.cpp: any number of wheels a side, in one tag a side."""
    left, right = (wheel_joints(settings, joints, source, f"{side}_joint", f"{side}_joints", f"{side}_joint")
                   for side in ("left", "right"))  # fmt: skip
    return _drive(settings, _differential(settings, left, right, encoder=False), _rate(settings), Drive().covariance)


def balancing(settings: Settings, joints: Joints, source: Source) -> Drive:
    """The wheely_boi lesson's libwb_plugin.so, which knows its joints by name and has no tags."""
    left, right = (turning(settings.owner, name, joints, source) for name in ("jointL", "jointR"))
    return _drive(settings, Balancing(left, right), _rate(settings), Drive().covariance)


def _drive(
    settings: Settings,
    mechanism: Planar | Differential | Balancing,
    rate: float,
    variances: tuple[float, float, float],
) -> Drive:
    named = zip(("covariance_x", "covariance_y", "covariance_yaw"), variances, strict=True)
    x, y, yaw = (settings.number(variance, name) for name, variance in named)
    told = settings.flag("publish_odom", "publish_odometry", "publish_tf")
    return Drive(
        command_topic=settings.topic("cmd_vel", "command_topic"),
        odometry_topic=settings.topic("odom", "odometry_topic"),
        odometry_frame=settings.frame("odometry_frame") or "odom",
        odometry_rate=rate,
        robot_base_frame=settings.frame("robot_base_frame"),
        command_timeout=settings.timeout("cmd_timeout", "command_timeout"),
        publish_odom=told,
        publish_odom_tf=settings.flag("publish_odom_tf", "publish_odometry_tf", "broadcast_transform", "broadcast_tf"),
        covariance=(x, y, yaw),
        mechanism=mechanism,
    )


def _differential(settings: Settings, left: tuple[str, ...], right: tuple[str, ...], encoder: bool) -> Differential:
    acceleration = settings.number(0.0, "wheel_acceleration", "max_wheel_acceleration")
    return Differential(
        left,
        right,
        separation=settings.maybe_measure("wheel_separation"),
        radius=settings.maybe_measure("wheel_diameter", least=2 * SMALLEST) / 2,
        torque=settings.number(TORQUE, "wheel_torque", "max_wheel_torque", "torque"),
        encoder=encoder,
        acceleration=acceleration or math.inf,
    )


def _rate(settings: Settings) -> float:
    return settings.number(FAST, "update_rate", "odometry_rate", "publish_rate", zero=False)


def _encoder(settings: Settings) -> bool:
    word = settings.word("odometry_source").lower() or "world"
    if word not in SOURCES:
        told = f"is {cut(word)}; it has to be encoder (0) or world (1)"
        raise settings.tag("odometry_source").wrong(told)
    return SOURCES[word]


def _check_pairs(settings: Settings, pairs: int, source: Source) -> None:
    told = settings.tag("num_wheel_pairs")
    if told.value() and settings.number(1, "num_wheel_pairs") != pairs:
        raise told.wrong(f"is {cut(told.value())}, but there are {pairs} left and {pairs} right joints")
    for name in ("wheel_separation", "wheel_diameter"):
        values = settings.each(name)
        if len({tag.value() for tag in values}) > 1:
            source.warn(values[1], "differs from the first; one measure is kept for all pairs, the first")
