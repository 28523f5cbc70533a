"""The drive systems of gz-sim and of Ignition Gazebo -> drives.

Parameters and defaults are those of src/systems/*/{DiffDrive,MecanumDrive,OdometryPublisher,VelocityControl}.hh in
gazebosim/gz-sim. Two differ here: a topic under /model/NAME/ has the name that ROS gives it, and wheels whose
measures are not told are measured.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from holozen.robot.drives import Differential, Drive, Mecanum, Mechanism, Planar
from holozen.robot.errors import cut
from holozen.robot.parts import Joint
from holozen.robot.plugins.settings import Settings
from holozen.robot.plugins.wheel_joints import wheel_joints
from holozen.robot.source import Source
from holozen.robot.tag import number

Joints = Mapping[str, Joint]

RATE = 50.0  # Hz
UNKEPT = ("min_jerk", "max_jerk", "min_linear_jerk", "max_linear_jerk", "min_angular_jerk", "max_angular_jerk")


def velocity_control(settings: Settings, joints: Joints, source: Source) -> Drive:
    """VelocityControl: the whole model moves as commanded. Raises RobotError, as all of these do."""
    for name in ("initial_linear", "initial_angular"):
        tag = settings.tag(name)
        if any(number(word) != 0 for word in tag.value().split()):
            source.warn(tag, "is not used; a robot stands until it is told to drive")
    return _drive(settings, Planar(), source)


def diff_drive(settings: Settings, joints: Joints, source: Source) -> Drive:
    """DiffDrive: any number of wheels a side; odometry adds up their turns."""
    left = wheel_joints(settings, joints, source, "", "left_joint")
    right = wheel_joints(settings, joints, source, "", "right_joint")
    separation, radius = settings.maybe_measure("wheel_separation"), settings.maybe_measure("wheel_radius")
    return _drive(settings, Differential(left, right, separation, radius), source)


def mecanum_drive(settings: Settings, joints: Joints, source: Source) -> Drive:
    """MecanumDrive: one wheel a corner."""
    corners = []
    for corner in ("front_left", "front_right", "back_left", "back_right"):
        name = f"{corner}_joint"
        named = wheel_joints(settings, joints, source, "", name)
        if len(named) > 1:
            source.warn(settings.each(name)[-1], f"is a second wheel at one corner; only {cut(named[0])} drives")
        corners.append(named[0])
    front_left, front_right, back_left, back_right = corners
    wheels = Mecanum(
        front_left,
        front_right,
        back_left,
        back_right,
        separation=settings.maybe_measure("wheel_separation"),
        wheelbase=settings.maybe_measure("wheelbase"),
        radius=settings.maybe_measure("wheel_radius"),
    )
    return _drive(settings, wheels, source)


def with_publisher(drive: Drive, settings: Settings, source: Source) -> Drive:
    """The drive with the odometry of an OdometryPublisher, which tells the true pose."""
    wheels = drive.mechanism
    if isinstance(wheels, Differential | Mecanum):
        wheels = replace(wheels, encoder=False)
    return replace(
        drive,
        odometry_topic=_topic(settings, "odometry", "odom", "odom_topic"),
        odometry_frame=_frame(settings, "odom_frame") or "odom",
        odometry_rate=settings.number(RATE, "odom_publish_frequency", zero=False),
        robot_base_frame=_frame(settings, "robot_base_frame") or drive.robot_base_frame,
        mechanism=wheels,
    )


def _drive(settings: Settings, mechanism: Mechanism, source: Source) -> Drive:
    for name in UNKEPT:
        if settings.word(name):
            source.warn(settings.tag(name), "is not kept; velocity and acceleration are limited, jerk is not")
    return Drive(
        command_topic=_topic(settings, "cmd_vel", "cmd_vel", "topic"),
        odometry_topic=_topic(settings, "odometry", "odom", "odom_topic"),
        odometry_frame=_frame(settings, "frame_id") or "odom",
        odometry_rate=settings.number(RATE, "odom_publish_frequency", zero=False),
        robot_base_frame=_frame(settings, "child_frame_id"),
        mechanism=mechanism,
        max_linear=_limit(settings, "linear_velocity", source),
        max_angular=_limit(settings, "angular_velocity", source),
        max_linear_acceleration=_limit(settings, "linear_acceleration", source),
        max_angular_acceleration=_limit(settings, "angular_acceleration", source),
    )


def _model(settings: Settings) -> str:
    """The name of the robot or model that the plugin stands in."""
    owner = settings.owner.parent
    while owner is not None and owner.name not in ("robot", "model"):
        owner = owner.parent
    return owner.attributes.get("name", "") if owner else ""


def _topic(settings: Settings, own: str, key: str, name: str) -> str:
    """`key` where gz-sim would use its own /model/NAME/`own`, said or not, else the topic that is said."""
    said = settings.word(name).strip("/")
    return key if said in ("", f"model/{_model(settings)}/{own}") else settings.topic(key, name)


def _frame(settings: Settings, name: str) -> str:
    return settings.frame(name).removeprefix(f"{_model(settings)}/")


def _limit(settings: Settings, what: str, source: Source) -> float:
    """The most of `what` either way; the smaller where forwards and backwards differ."""
    tags = [settings.tag(f"{end}_{what}", f"{end}_{what.partition('_')[2]}") for end in ("max", "min")]
    values = [number(tag.value()) for tag in tags if tag.value()]
    for tag, sign in zip(tags, (1, -1), strict=True):
        value = number(tag.value()) if tag.value() else sign * math.inf
        if value is None or value * sign <= 0:
            raise tag.wrong(f"is {cut(tag.value())}; it has to be a number {'above' if sign > 0 else 'below'} 0")
    sizes = sorted(abs(value) for value in values if value is not None)
    if sizes and sizes[0] != sizes[-1]:
        source.warn(tags[1], f"differs from {tags[0].name}; {sizes[0]:g} holds both ways")
    return sizes[0] if sizes else math.inf
