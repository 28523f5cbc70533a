"""Gazebo plugins: the drive and the forces of a robot, and warnings about plugins that have no
effect here.

A plugin is identified by its file name, or for gz-sim by its class.
"""

import math
import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

from msgspec.structs import replace

from holozen.limits import TIMES
from holozen.robot.errors import RobotError
from holozen.robot.files.elements import LARGEST, Source, Tag, number
from holozen.robot.model import (
    PLANAR,
    Balancing,
    Differential,
    Drive,
    Force,
    Joint,
    Limits,
    Link,
    Mecanum,
    Mechanism,
    Omni,
    Planar,
    Pose,
    Pushed,
    RobotModel,
    Sensor,
    is_watched,
    sides_of,
)
from holozen.robot.rigid import link_frames, radius_across, round_radius
from holozen.suggest import cut, listed, shorten
from holozen.wire import COMMAND_SILENCE

_GZ_FILE = re.compile(r"(?:gz-sim|ignition-gazebo)\d*-(.+)-system")
_GZ_CLASS = re.compile(r"(?:gz::sim|ignition::gazebo)::(?:v\d+::)?systems::(\w+)")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def kind_of(plugin: Tag) -> str:
    """`gazebo_ros_diff_drive` for libgazebo_ros_diff_drive.so, `gz:diff-drive` for gz-sim's and
    ignition's DiffDrive, identified by its file or by its class; empty for a plugin without a file
    name.
    """
    stem = file_of(plugin).rpartition("/")[2].removeprefix("lib").removesuffix(".so")
    system, name = (
        _GZ_FILE.fullmatch(stem),
        _GZ_CLASS.fullmatch(plugin.attributes.get("name", "").strip()),
    )
    if system:
        return f"gz:{system[1]}"
    return f"gz:{_HUMP.sub('-', name[1]).lower()}" if name else stem.removesuffix("-system")


def file_name(kind: str) -> str:
    """The `filename` to write for a plugin of a kind."""
    return f"gz-sim-{kind[3:]}-system" if kind.startswith("gz:") else f"lib{kind}.so"


def file_of(plugin: Tag) -> str:
    """The plugin's `filename` as written."""
    return plugin.attributes.get("filename", "").strip()


# Settings: the elements inside a plugin or `<gazebo reference>`, in the spelling of ROS 1, ROS 2,
# or a mix of both.


LONG_TIMEOUT = 2.0  # s; a robot that drives on for longer without a command causes a warning
SMALLEST = 1e-3  # m; smallest wheel radius, and distance between wheels

PUBLISHED_TOO = ("tf", "joint_states")  # by drives in Gazebo; here they have these names

_KEY = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*(/[A-Za-z0-9_][A-Za-z0-9_-]*)*")


class Settings:
    """The child elements of `owner` by their ROS 2 spelling; the first of duplicates counts.

    Attributes:
        owner: The element that has them.
        asked: The names that a reader asked for, whether the file gives them or not.
    """

    def __init__(self, owner: Tag) -> None:
        self.owner = owner
        self.asked: set[str] = set()
        self._tags = {_snake_case(tag.name): tag for tag in reversed(owner.children)}
        # those that were asked for, by the names that a remapping may give
        self._topics: set[str] = set()

    def tag(self, *names: str) -> Tag:
        """The first of `names` that is present and not empty, else an empty tag."""
        return self._found(names) or self.owner.empty(names[0])

    def each(self, *names: str) -> list[Tag]:
        """Every non-empty child called one of `names`, in file order."""
        self.asked.update(names)
        return [
            tag for tag in self.owner.children if _snake_case(tag.name) in names and tag.value()
        ]

    def word(self, *names: str) -> str:
        """The text of the first of `names` that is present, else an empty string."""
        found = self._found(names)
        return found.value() if found else ""

    def number(
        self, default: float, *names: str, zero: bool = True, most: float = LARGEST
    ) -> float:
        """A positive number, or zero where allowed, up to `most`. Raises RobotError."""
        word = self.word(*names)
        value = number(word) if word else default
        if value is None or value < 0 or (value == 0 and not zero):
            problem = f"is {cut(word)}; it must be a number {'not below' if zero else 'above'} 0"
            raise self.tag(*names).wrong(problem)
        if value > most and word:
            raise self.tag(*names).wrong(f"is {cut(word)}; it must be at most {most:g}")
        return value

    def optional(self, *names: str, most: float = LARGEST) -> float | None:
        """A non-negative number, or None if none of `names` is present. Raises RobotError."""
        return self.number(0.0, *names, most=most) if self.word(*names) else None

    def length(self, *names: str, least: float = SMALLEST) -> float:
        """Metres, at least `least`, or 0 if none of `names` is present. Raises RobotError."""
        value = self.number(0.0, *names, zero=False) if self.word(*names) else 0.0
        if 0 < value < least:
            raise self.tag(*names).wrong(
                f"is {cut(self.word(*names))}; it must be at least {least:g} m"
            )
        return value

    def timeout(self, *names: str) -> float | None:
        """Seconds; None for a watchdog that is disabled, by a negative number. Raises
        RobotError.
        """
        value = number(self.word(*names))
        if value is not None and value < 0:
            return None
        return self.number(COMMAND_SILENCE, *names, zero=False)

    def flag(self, *names: str, default: bool = True) -> bool:
        """True, false, 1 or 0; `default` if not set. Raises RobotError."""
        word = self.word(*names).lower() or str(default).lower()
        if word not in ("true", "1", "false", "0"):
            raise self.tag(*names).wrong(f"is {cut(word)}; it must be true or false")
        return word in ("true", "1")

    def frame(self, *names: str) -> str:
        """A frame's name without the leading slashes of ROS 1."""
        return self.word(*names).strip("/")

    def topic(self, default: str, *names: str) -> str:
        """The key of a topic: its name after remapping, prefixed with the namespace unless it
        starts with a slash.

        Raises RobotError for an invalid key.
        """
        remapped = dict(self._remappings())
        topic = self.word(*names) or default
        self._topics |= {default, topic.strip("/")}
        topic = remapped.get(topic.strip("/"), remapped.get(default, topic))
        key = topic if topic.startswith("/") else f"{self._namespace()}/{topic}"
        key = re.sub("/+", "/", key).strip("/")
        if not _KEY.fullmatch(key):
            problem = (
                f"makes the topic {cut(key)}; a topic has letters, digits, '_', '-' and single '/'"
            )
            raise (self.tag(*names) if names else self.owner).wrong(problem)
        return key

    def topic_within(self, folder: str, default: str, *names: str) -> str:
        """As `topic`, below `folder` unless it is remapped or starts with a slash."""
        word = self.word(*names)
        if not folder or word.startswith("/") or self.is_remapped(word or default):
            return self.topic(default, *names)
        return self.topic(f"{folder}/{word or default}")

    def is_remapped(self, topic: str) -> bool:
        """Whether ROS 2's `<remapping>` gives it another name."""
        return topic in dict(self._remappings())

    def check_remappings(self, source: Source, complete: bool = False) -> None:
        """Warn of each `<remapping>` that is not OLD:=NEW; and if all topics were read
        (`complete`), of one of none.
        """
        known = sorted(self._topics)
        for tag, old, new in self._remapping_tags():
            if not (old and new):
                source.warn(
                    tag,
                    f"is {cut(tag.value())}, which renames nothing; write OLD:=NEW, as "
                    "cmd_vel:=my_vel",
                )
            elif complete and old not in (*known, *PUBLISHED_TOO):
                near = source.suggest(old, known)
                source.warn(
                    tag,
                    f"renames {cut(old)}, which is no topic of this plugin{near}; topics: "
                    f"{listed(known)}",
                )

    def warn_unread(self, source: Source, known: Container[str]) -> None:
        """Warn of each element that the reader of this plugin did not ask for, though it is one of
        those `known`, which mean something in other plugins.
        """
        plugin = file_name(kind_of(self.owner))
        for name, tag in reversed(self._tags.items()):
            if name in known and name not in self.asked and tag.value():
                source.warn(tag, f"changes nothing: {plugin} does not read it, as others do")

    def _found(self, names: tuple[str, ...]) -> Tag | None:
        self.asked.update(names)
        return next(
            (self._tags[name] for name in names if name in self._tags and self._tags[name].value()),
            None,
        )

    def _namespace(self) -> str:
        ros = self._tags.get("ros")
        namespace = ros.first("namespace") if ros else None
        return namespace.value() if namespace else self.word("robot_namespace")

    def _remappings(self) -> Iterator[tuple[str, str]]:
        return ((old, new) for _, old, new in self._remapping_tags() if new)

    def _remapping_tags(self) -> Iterator[tuple[Tag, str, str]]:
        ros = self._tags.get("ros")
        for tag in (*(ros.all("remapping") if ros else ()), *self.owner.all("remapping")):
            old, _, new = tag.value().partition(":=")
            yield tag, old.strip().removeprefix("~").strip("/"), new.strip()


def _snake_case(name: str) -> str:
    return _HUMP.sub("_", name).lower()


# Wheels: the joints that a plugin names, and dimensions it omits, measured on the robot's links.


Joints = Mapping[str, Joint]

TURNING = ("continuous", "revolute")


def wheel_joint(
    settings: Settings, joints: Joints, source: Source, default: str, *names: str
) -> str:
    """The joint named by the first of the tags `names`, else `default`. Raises RobotError as
    `turning` does.
    """
    tag = settings.tag(*names)
    if not tag.value() and default not in joints:
        raise settings.owner.wrong(f"has no <{names[0]}>; joints: {listed(joints)}")
    return turning(tag, tag.value() or default, joints, source)


def wheel_joints(
    settings: Settings, joints: Joints, source: Source, default: str, *names: str
) -> tuple[str, ...]:
    """All joints named by tags called one of `names`, each holding one or several separated by
    spaces; else `default`.

    Raises RobotError as `turning` does.
    """
    # A joint's name may have spaces in it.
    named = [
        (tag, name)
        for tag in settings.each(*names)
        for name in ([tag.value()] if tag.value() in joints else tag.value().split())
    ]
    if not named:
        return (wheel_joint(settings, joints, source, default, *names),)
    return tuple(turning(tag, name, joints, source) for tag, name in named)


def turning(tag: Tag, name: str, joints: Joints, source: Source) -> str:
    """`name`. Raises RobotError, listing the joints, unless it is a joint that turns."""
    if name not in joints:
        near = source.suggest(name, joints)
        problem = f"names the joint {cut(name)}, which does not exist{near}"
        raise tag.wrong(f"{problem}; joints: {listed(joints)}")
    if joints[name].kind not in TURNING:
        raise tag.wrong(
            f"names the joint {cut(name)}, which is {joints[name].kind}; a wheel's joint is "
            "continuous"
        )
    return name


def measured(drive: Drive, plugin: Tag, robot: RobotModel) -> Drive:
    """The drive, with the wheel dimensions that the file omits measured on the robot's links.

    Raises RobotError at `plugin` for a joint used for two wheels, and for a dimension that is
    neither given nor measurable.
    """
    wheels = drive.mechanism
    if isinstance(wheels, Planar | Omni | Pushed):
        return drive
    left, right = sides_of(wheels)
    _check_once(left, right, plugin)
    if any(robot.joints[name].child not in robot.links for name in (*left, *right)):
        return drive  # such a wheel has no mass, which `check_drive` reports
    if isinstance(wheels, Balancing):
        _check_round((*left, *right), plugin, robot)
        return drive
    found = {
        "separation": wheels.separation or _apart(left, right, "wheel_separation", plugin, robot)
    }
    if isinstance(wheels, Mecanum):
        front, back = (wheels.front_left, wheels.front_right), (wheels.back_left, wheels.back_right)
        found["wheelbase"] = wheels.wheelbase or _apart(front, back, "wheelbase", plugin, robot)
    found["radius"] = wheels.radius or _radius(left[0], plugin, robot)
    return replace(drive, mechanism=replace(wheels, **found))


ONE_EACH = "; each wheel needs a joint of its own"


def _check_once(left: tuple[str, ...], right: tuple[str, ...], plugin: Tag) -> None:
    for name in left:
        if name in right:
            raise plugin.wrong(f"has the joint {cut(name)} on the left and on the right{ONE_EACH}")
    for side, names in (("left", left), ("right", right)):
        for name in names:
            if names.count(name) > 1:
                raise plugin.wrong(f"has the joint {cut(name)} twice on the {side}{ONE_EACH}")


def _check_round(names: tuple[str, ...], plugin: Tag, robot: RobotModel) -> None:
    for name in names:
        link = robot.links[robot.joints[name].child]
        if round_radius(link) < SMALLEST:
            problem = (
                f"balances on the wheel {cut(link.name)}, whose collision shapes are not round"
            )
            raise plugin.wrong(
                f"{problem}; give it a <cylinder> with a radius of {SMALLEST:g} m or more"
            )


APART = {"wheel_separation": (1, "left and right", "y"), "wheelbase": (0, "front and back", "x")}
"""Tag of a distance between wheels -> the index of its axis in the root frame, which wheels, and
the axis's name.
"""


def _apart(
    some: tuple[str, ...], others: tuple[str, ...], tag: str, plugin: Tag, robot: RobotModel
) -> float:
    """Metres between the mean positions of two groups of wheels, which `tag` would give."""
    frames, (axis, which, along) = link_frames(robot), APART[tag]
    places = [
        [frames[robot.joints[name].child].xyz[axis] for name in names] for names in (some, others)
    ]
    one, other = (sum(values) / len(values) for values in places)
    if abs(one - other) < SMALLEST:
        raise _missing_tag(plugin, tag, f"its {which} wheels are at the same {along}")
    return abs(one - other)


def _radius(name: str, plugin: Tag, robot: RobotModel) -> float:
    """The radius in metres of the wheel on joint `name`."""
    joint = robot.joints[name]
    link = robot.links[joint.child]
    radius = round_radius(link) or radius_across(link, joint.axis)
    if radius < SMALLEST:
        problem = f"its wheel {cut(link.name)} has no shape with a radius of {SMALLEST:g} m or more"
        raise _missing_tag(
            plugin,
            "wheel_radius" if kind_of(plugin).startswith("gz:") else "wheel_diameter",
            problem,
        )
    return radius


def _missing_tag(plugin: Tag, tag: str, reason: str) -> RobotError:
    """The error for a missing `tag`, which is spelt as in gz-sim and ROS 2."""
    head, *rest = tag.split("_")
    either = (
        ""
        if kind_of(plugin).startswith("gz:")
        else f", or <{head}{''.join(map(str.title, rest))}> in ROS 1"
    )
    return plugin.wrong(f"has no <{tag}>, and {reason}; give <{tag}>{either}, in metres")


# The drive plugins of ROS and of its lessons. Tags and defaults are those of
# gazebo_ros_planar_move.cpp, gazebo_ros_diff_drive.cpp and gazebo_ros_skid_steer_drive.cpp in
# ros-simulation/gazebo_ros_pkgs, in ROS 1 (noetic) and ROS 2 (galactic), and of hector_gazebo's
# diffdrive_plugin_multi_wheel.cpp. Three things differ here: odometry and its tf are published
# unless the file disables them; a stale command stops the robot; and wheel dimensions that the file
# omits are measured.


TORQUE = 5.0  # N m
WHEELED_RATE = 100.0  # Hz; default odometry rate of drives on wheels
COVARIANCE = Drive().covariance
SKID_COVARIANCE = (1e-4, 1e-4, 1e-2)
ENCODER = {"encoder": True, "0": True, "world": False, "1": False}
"""Value of odometry_source -> whether odometry integrates the rotation of the wheels."""


def planar_move(settings: Settings, joints: Joints, source: Source) -> Drive:
    """gazebo_ros_planar_move.cpp. Raises RobotError, like all of these."""
    return _ros_drive(settings, Planar(settings.number(PLANAR.update_rate, "update_rate")))


def omni_drive(settings: Settings, joints: Joints, source: Source) -> Drive:
    """holozen's own: the robot's own wheels, with free rollers on their rims. Its tags are those of
    planar_move, and odometry_source.
    """
    return _ros_drive(settings, Omni(_encoder(settings)))


def diff_drive(settings: Settings, joints: Joints, source: Source) -> Drive:
    """gazebo_ros_diff_drive.cpp: one pair of wheels, possibly several in ROS 2."""
    left = wheel_joints(settings, joints, source, "left_joint", "left_joint")
    right = wheel_joints(settings, joints, source, "right_joint", "right_joint")
    if len(left) != len(right):
        problem = f"has {len(left)} left and {len(right)} right joints; wheels come in pairs"
        raise settings.owner.wrong(problem)
    if settings.flag("legacy_mode", default=False):  # noetic: left and right are swapped
        left, right = right, left
    _check_pairs(settings, len(left), source)
    # Both versions publish the true pose unless set to use the encoders.
    return _ros_drive(settings, _differential(settings, left, right, encoder=_encoder(settings)))


def skid_steer(settings: Settings, joints: Joints, source: Source) -> Drive:
    """gazebo_ros_skid_steer_drive.cpp: four wheels; odometry is the true pose."""
    names = [f"{side}_{place}_joint" for side in ("left", "right") for place in ("front", "rear")]
    front_left, rear_left, front_right, rear_right = (
        wheel_joint(settings, joints, source, name, name) for name in names
    )
    wheels = _differential(
        settings, (front_left, rear_left), (front_right, rear_right), encoder=False
    )
    return _ros_drive(settings, wheels, SKID_COVARIANCE)


def multi_wheel(settings: Settings, joints: Joints, source: Source) -> Drive:
    """diffdrive_plugin_multi_wheel.cpp: any number of wheels per side, in one tag per side."""
    left, right = (
        wheel_joints(settings, joints, source, f"{side}_joint", f"{side}_joints", f"{side}_joint")
        for side in ("left", "right")
    )
    return _ros_drive(settings, _differential(settings, left, right, encoder=False))


def balancing(settings: Settings, joints: Joints, source: Source) -> Drive:
    """The wheely_boi lesson's libwb_plugin.so, which has fixed joint names and no tags."""
    left, right = (turning(settings.owner, name, joints, source) for name in ("jointL", "jointR"))
    return _ros_drive(settings, Balancing(left, right))


def _ros_drive(
    settings: Settings,
    mechanism: Planar | Differential | Omni | Balancing,
    variances: tuple[float, float, float] = COVARIANCE,
) -> Drive:
    named = zip(("covariance_x", "covariance_y", "covariance_yaw"), variances, strict=True)
    x, y, yaw = (settings.number(variance, name) for name, variance in named)
    rate, tags = Drive().odometry_rate, ["odometry_rate", "publish_rate"]
    if isinstance(mechanism, Omni):
        settings.number(0.0, "update_rate")  # of commands, which are obeyed at each step
    elif not isinstance(mechanism, Planar):
        rate, tags = WHEELED_RATE, ["update_rate", *tags]
    return Drive(
        command_topic=settings.topic("cmd_vel", "command_topic"),
        odometry_topic=settings.topic("odom", "odometry_topic"),
        odometry_frame=settings.frame("odometry_frame") or "odom",
        odometry_rate=settings.number(rate, *tags, zero=False),
        robot_base_frame=settings.frame("robot_base_frame"),
        command_timeout=settings.timeout("cmd_timeout", "command_timeout"),
        publish_odom=settings.flag("publish_odom", "publish_odometry", "publish_tf"),
        publish_odom_tf=settings.flag(
            "publish_odom_tf", "publish_odometry_tf", "broadcast_transform", "broadcast_tf"
        ),
        covariance=(x, y, yaw),
        odometry_from_start=_from_start(settings),
        odometry_noise=settings.number(0.0, "gaussian_noise"),
        mechanism=mechanism,
        max_linear=settings.number(math.inf, "max_linear_velocity", zero=False),
        max_angular=settings.number(math.inf, "max_angular_velocity", zero=False),
        max_linear_acceleration=settings.number(math.inf, "max_linear_acceleration", zero=False),
        max_angular_acceleration=settings.number(math.inf, "max_angular_acceleration", zero=False),
        time_before_collision=_time_before_collision(settings),
    )


MONITOR = "time_before_collision"  # holozen's own, in any drive; the word is that of Nav2


def _time_before_collision(settings: Settings) -> float:
    return settings.number(0.0, MONITOR, most=TIMES[1])


def _from_start(settings: Settings) -> bool:
    word = settings.word("odometry_origin") or "world"
    if word not in ("world", "start"):
        raise settings.tag("odometry_origin").wrong(f"is {cut(word)}; it must be world or start")
    return word == "start"


def _differential(
    settings: Settings, left: tuple[str, ...], right: tuple[str, ...], encoder: bool
) -> Differential:
    return Differential(
        left,
        right,
        separation=settings.length("wheel_separation"),
        radius=settings.length("wheel_diameter", least=2 * SMALLEST) / 2,
        torque=settings.number(TORQUE, "wheel_torque", "max_wheel_torque", "torque"),
        encoder=encoder,
        acceleration=settings.number(0.0, "wheel_acceleration", "max_wheel_acceleration")
        or math.inf,
    )


def _encoder(settings: Settings) -> bool:
    word = settings.word("odometry_source").lower() or "world"
    if word not in ENCODER:
        problem = f"is {cut(word)}; it must be encoder (0) or world (1)"
        raise settings.tag("odometry_source").wrong(problem)
    return ENCODER[word]


def _check_pairs(settings: Settings, pairs: int, source: Source) -> None:
    tag = settings.tag("num_wheel_pairs")
    if tag.value() and settings.number(1, "num_wheel_pairs") != pairs:
        raise tag.wrong(
            f"is {cut(tag.value())}, but there are {pairs} left and {pairs} right joints"
        )
    for name in ("wheel_separation", "wheel_diameter"):
        values = settings.each(name)
        if len({tag.value() for tag in values}) > 1:
            source.warn(
                values[1], "differs from the first; the first is used for all pairs of wheels"
            )


# The drive systems of gz-sim and Ignition Gazebo. Parameters and defaults are those of
# src/systems/*/{DiffDrive,MecanumDrive,OdometryPublisher,VelocityControl}.hh in gazebosim/gz-sim.
# Two things differ here: a topic under /model/NAME/ gets its ROS name, and wheel dimensions that
# the file omits are measured.


RATE = 50.0  # Hz
JERK_LIMITS = (
    "min_jerk",
    "max_jerk",
    "min_linear_jerk",
    "max_linear_jerk",
    "min_angular_jerk",
    "max_angular_jerk",
)


def velocity_control(settings: Settings, joints: Joints, source: Source) -> Drive:
    """VelocityControl: the whole model moves as commanded. Raises RobotError, like all of these."""
    for name in ("initial_linear", "initial_angular"):
        tag = settings.tag(name)
        if any(number(word) != 0 for word in tag.value().split()):
            source.warn(tag, "is not used; a robot stands still until it is commanded")
    return _gz_drive(settings, Planar(), source)


def gz_diff_drive(settings: Settings, joints: Joints, source: Source) -> Drive:
    """DiffDrive: any number of wheels per side; odometry integrates their rotation."""
    left = wheel_joints(settings, joints, source, "", "left_joint")
    right = wheel_joints(settings, joints, source, "", "right_joint")
    separation, radius = settings.length("wheel_separation"), settings.length("wheel_radius")
    return _gz_drive(settings, Differential(left, right, separation, radius), source)


def mecanum_drive(settings: Settings, joints: Joints, source: Source) -> Drive:
    """MecanumDrive: one wheel per corner. Wheels that carry rollers, as links of their own, are
    driven by motors; others only turn as the robot moves.
    """
    corners = []
    for corner in ("front_left", "front_right", "back_left", "back_right"):
        name = f"{corner}_joint"
        named = wheel_joints(settings, joints, source, "", name)
        if len(named) > 1:
            source.warn(
                settings.each(name)[-1],
                f"is a second wheel at one corner; only {cut(named[0])} drives",
            )
        corners.append(named[0])
    front_left, front_right, back_left, back_right = corners
    wheels = Mecanum(
        front_left,
        front_right,
        back_left,
        back_right,
        separation=settings.length("wheel_separation"),
        wheelbase=settings.length("wheelbase"),
        radius=settings.length("wheel_radius"),
    )
    carriers = {joint.parent for joint in joints.values() if joint.kind == "continuous"}
    if all(joints[name].child in carriers for name in corners):
        return _gz_drive(settings, Omni(encoder=True), source)
    return _gz_drive(settings, wheels, source)


def with_publisher(drive: Drive, settings: Settings) -> Drive:
    """The drive with the odometry of an OdometryPublisher, which is the true pose."""
    wheels = drive.mechanism
    if isinstance(wheels, Differential | Mecanum | Omni):
        wheels = replace(wheels, encoder=False)
    return replace(
        drive,
        odometry_topic=_gz_topic(settings, "odometry", "odom", "odom_topic"),
        odometry_frame=_frame(settings, "odom_frame") or "odom",
        odometry_rate=settings.number(RATE, "odom_publish_frequency", zero=False),
        odometry_noise=settings.number(0.0, "gaussian_noise"),
        robot_base_frame=_frame(settings, "robot_base_frame") or drive.robot_base_frame,
        mechanism=wheels,
    )


def _gz_drive(settings: Settings, mechanism: Mechanism, source: Source) -> Drive:
    for name in JERK_LIMITS:
        if settings.word(name):
            source.warn(
                settings.tag(name), "is ignored; velocity and acceleration are limited, jerk is not"
            )
    return Drive(
        command_topic=_gz_topic(settings, "cmd_vel", "cmd_vel", "topic"),
        odometry_topic=_gz_topic(settings, "odometry", "odom", "odom_topic"),
        odometry_frame=_frame(settings, "frame_id") or "odom",
        odometry_rate=settings.number(RATE, "odom_publish_frequency", zero=False),
        robot_base_frame=_frame(settings, "child_frame_id"),
        mechanism=mechanism,
        max_linear=_limit(settings, "linear_velocity", source),
        max_angular=_limit(settings, "angular_velocity", source),
        max_linear_acceleration=_limit(settings, "linear_acceleration", source),
        max_angular_acceleration=_limit(settings, "angular_acceleration", source),
        time_before_collision=_time_before_collision(settings),
    )


def _model(settings: Settings) -> str:
    """The name of the robot or model that contains the plugin."""
    owner = settings.owner.parent
    while owner is not None and owner.name not in ("robot", "model"):
        owner = owner.parent
    return owner.attributes.get("name", "") if owner else ""


def _gz_topic(settings: Settings, own: str, key: str, name: str) -> str:
    """`key` if the topic is gz-sim's own /model/NAME/`own`, explicit or by default; else the
    configured topic.
    """
    topic = settings.word(name).strip("/")
    return key if topic in ("", f"model/{_model(settings)}/{own}") else settings.topic(key, name)


def _frame(settings: Settings, name: str) -> str:
    return settings.frame(name).removeprefix(f"{_model(settings)}/")


def _limit(settings: Settings, quantity: str, source: Source) -> float:
    """The limit of a quantity, such as "linear_velocity"; the smaller one if forward and backward
    differ.
    """
    tags = [
        settings.tag(f"{end}_{quantity}", f"{end}_{quantity.partition('_')[2]}")
        for end in ("max", "min")
    ]
    values = [number(tag.value()) for tag in tags if tag.value()]
    for tag, sign in zip(tags, (1, -1), strict=True):
        value = number(tag.value()) if tag.value() else sign * math.inf
        if value is None or value * sign <= 0:
            raise tag.wrong(
                f"is {cut(tag.value())}; it must be a number {'above' if sign > 0 else 'below'} 0"
            )
    sizes = sorted(abs(value) for value in values if value is not None)
    if sizes and sizes[0] != sizes[-1]:
        source.warn(tags[1], f"differs from {tags[0].name}; {sizes[0]:g} holds both ways")
    return sizes[0] if sizes else math.inf


# Plugins that sense; `sensors` reads them.


def _by_plugin(groups: Mapping[str, str]) -> dict[str, str]:
    """Plugin -> its group, from groups with the plugins in each."""
    return {plugin: group for group, plugins in groups.items() for plugin in plugins.split()}


SENSING = _by_plugin(
    {
        "imu": "gazebo_ros_imu gazebo_ros_imu_sensor hector_gazebo_ros_imu",
        "gps": "hector_gazebo_ros_gps gazebo_ros_gps_sensor",
        "magnetometer": "hector_gazebo_ros_magnetic",
        "sonar": "hector_gazebo_ros_sonar",
        "force_torque": "gazebo_ros_f3d gazebo_ros_ft_sensor",
        "contact": "gazebo_ros_bumper",
        "ray": "gazebo_ros_laser gazebo_ros_block_laser gazebo_ros_ray_sensor gazebo_ros_range "
        "gazebo_ros_velodyne_laser",
        "gpu_ray": "gazebo_ros_gpu_laser",
        "camera": "gazebo_ros_camera gazebo_ros_triggered_camera gazebo_ros_prosilica",
        "multicamera": "gazebo_ros_multicamera",
        "depth": "gazebo_ros_depth_camera gazebo_ros_openni_kinect",
    }
)
"""Plugin -> the kind of sensor that it makes where no `<sensor>` contains it."""


# Forces. Tags and defaults are those of gazebo_ros_force.cpp in ros-simulation/gazebo_ros_pkgs, in
# ROS 1 (noetic) and ROS 2 (galactic). One thing differs here: a force ends when its source falls
# silent.


FORCE = "gazebo_ros_force"
FRAMES = {"world": False, "link": True}


def read_forces(
    robot: Tag, links: Mapping[str, Link], root: str, drive: Drive | None, source: Source
) -> tuple[Drive | None, tuple[Force, ...]]:
    """The drive and the force plugins of a `<robot>` or `<model>`; without another `drive` the
    forces are its drive.

    A force that names no link causes a warning. Raises RobotError for a frame that is neither world
    nor link.
    """
    plugins = [plugin for plugin in plugins_outside_sensors(robot) if kind_of(plugin) == FORCE]
    forces = [force for plugin in plugins if (force := _force(plugin, links, source))]
    if drive is None and forces:
        namespace = forces[0].topic.rpartition("/")[0]
        command, odometry = (f"{namespace}/{key}".strip("/") for key in ("cmd_vel", "odom"))
        return Drive(
            command, odometry, odometry_rate=RATE, robot_base_frame=root, mechanism=Pushed()
        ), tuple(forces)
    return drive, tuple(forces)


def _force(plugin: Tag, links: Mapping[str, Link], source: Source) -> Force | None:
    settings = Settings(plugin)
    tag = settings.tag("link_name", "body_name")
    if tag.value() not in links:
        near = source.suggest(tag.value(), links)
        problem = (
            f"names the link {cut(tag.value())}, which does not exist{near}"
            if tag.value()
            else "is missing"
        )
        source.warn(tag, f"{problem}; this force pushes nothing; links: {listed(links)}")
        return None
    frame = settings.word("force_frame") or "world"
    if frame not in FRAMES:
        raise settings.tag("force_frame").wrong(f"is {cut(frame)}; it must be world or link")
    topic = settings.topic(FORCE, "topic_name")
    _warn_of_unused(settings, source)
    return Force(tag.value(), topic, FRAMES[frame])


# The plugins of a robot.


def warn_unseen(robot: Tag, drive: Drive | None, sensors: Iterable[Sensor], source: Source) -> None:
    """Warn of a drive that is to slow down for what no sensor of the robot sees."""
    if drive is None or not drive.time_before_collision or any(map(is_watched, sensors)):
        return
    for plugin in plugins_outside_sensors(robot):
        if (tag := Settings(plugin).tag(MONITOR)).value():
            source.warn(tag, "changes nothing: the robot has no sensor with a scan or a range")


DriveReader = Callable[[Settings, Mapping[str, Joint], Source], Drive]

DRIVES: dict[str, DriveReader] = {
    "gazebo_ros_planar_move": planar_move,
    "gazebo_ros_diff_drive": diff_drive,
    "gazebo_ros_skid_steer_drive": skid_steer,
    "gazebo_ros_diff_drive_multi_wheel": multi_wheel,
    "diffdrive_plugin_multi_wheel": multi_wheel,
    "hector_gazebo_ros_diff_drive_multi_wheel": multi_wheel,
    "wb_plugin": balancing,
    "gz:velocity-control": velocity_control,
    "gz:diff-drive": gz_diff_drive,
    "gz:mecanum-drive": mecanum_drive,
}
PUBLISHER = "gz:odometry-publisher"
OMNI = "holozen_omni_drive"  # alone, or beside a planar_move, which drives a robot in Gazebo

JOINTS = "joint_states is published anyway, and joints follow joint_command"
WHOLE = "--drive planar_move moves the robot as a whole"
INSTEAD = _by_plugin(
    {
        JOINTS: "gazebo_ros_control gazebo_ros2_control gz_ros2_control ign_ros2_control "
        "gz:joint-position-controller"
        " gz:joint-trajectory-controller gz:joint-controller gazebo_ros_joint_pose_trajectory",
        "joint_states is published anyway": "gazebo_ros_joint_state_publisher "
        "gz:joint-state-publisher",
        "odom and tf are published anyway": "gazebo_ros_p3d gz:pose-publisher",
        "the sim does this itself": "gz:physics gz:user-commands gz:scene-broadcaster "
        "gazebo_ros_state gazebo_ros_init"
        " gazebo_ros_factory",
        "a URDF <mimic> does the same": "roboticsgroup_gazebo_mimic_joint_plugin",
        WHOLE: "gazebo_ros_tricycle_drive gazebo_ros_ackermann_drive gz:ackermann-steering "
        "gz:tracked-vehicle",
        "nothing holds the robot up": "gazebo_ros_harness",
        "nothing is held": "gazebo_ros_vacuum_gripper",
        "friction is that of <mu1> and <mu2>": "gazebo_ros_wheel_slip gz:wheel-slip",
        "images are not rendered": "gazebo_ros_projector gazebo_ros_video",
    }
)
"""Plugin that is not simulated -> what replaces it, or what is missing."""
# without these gz-sim runs no sensor; here they all run
OF_SENSORS = ("gz:sensors", "gz:imu", "gz:contact")
KNOWN = (*DRIVES, *INSTEAD, *SENSING, *OF_SENSORS, PUBLISHER, FORCE, OMNI)
MOVING_ELSEWHERE = frozenset(name for name, reason in INSTEAD.items() if reason in (JOINTS, WHOLE))
"""Plugins that move a robot in Gazebo, but not here."""


def read_plugins(
    robot: Tag, links: Mapping[str, Link], joints: Mapping[str, Joint], root: str, source: Source
) -> Drive | None:
    """The drive of a `<robot>` or `<model>`: its first drive plugin; others cause warnings.

    `links` and `joints` are by name. Plugins inside a `<sensor>` belong to the sensor. Raises
    RobotError for a drive plugin that cannot work as written.
    """
    drive, publishers, wheels = None, [], None
    _warn_of_places(robot, source)
    for plugin in plugins_outside_sensors(robot):
        kind = kind_of(plugin)
        if kind == PUBLISHER:
            publishers.append(plugin)
        elif kind == OMNI:
            wheels = wheels or plugin
        elif kind not in DRIVES:
            _warn_not_run(plugin, kind, source)
        elif drive is not None:
            source.warn(plugin, "is a second drive; only the first one drives")
        else:
            settings = Settings(plugin)
            found = DRIVES[kind](settings, joints, source)
            _warn_of_unused(settings, source)
            drive, driver = (
                measured(found, plugin, RobotModel("", root, links, joints, None)),
                plugin,
            )
    if wheels and drive:
        drive = _on_wheels(drive, driver, wheels, source)
    elif wheels:
        settings = Settings(wheels)
        drive, driver = omni_drive(settings, joints, source), wheels
        _warn_of_unused(settings, source)
    if drive is None:
        _warn_of_no_drive(publishers, source)
        return None
    _warn_of_timeout(drive, Settings(driver), source)
    for plugin in publishers:
        settings = Settings(plugin)
        drive, driver = with_publisher(drive, settings), plugin
        settings.warn_unread(source, drive_tags())
    return _with_known_frame(drive, driver, links, root, source)


def _warn_of_places(robot: Tag, source: Source) -> None:
    for plugin in robot.all("plugin") if robot.name == "robot" else ():
        source.warn(
            plugin, "is not inside <gazebo>, so it is ignored; put <gazebo> ... </gazebo> around it"
        )


def _warn_of_no_drive(publishers: list[Tag], source: Source) -> None:
    for plugin in publishers:
        source.warn(plugin, "publishes odometry, but the robot has no drive")


def _on_wheels(drive: Drive, driver: Tag, wheels: Tag, source: Source) -> Drive:
    """The drive of planar_move, on the wheels of another plugin."""
    if not isinstance(drive.mechanism, Planar):
        raise wheels.wrong(
            f"is a second drive beside {cut(kind_of(driver))}; use it with planar_move, or alone"
        )
    settings = Settings(wheels)
    mechanism = Omni(_encoder(settings))
    _warn_of_unused(settings, source)
    return replace(drive, mechanism=mechanism)


class _AnyJoint(dict[str, Joint]):
    """Has every joint that a plugin may name."""

    def __contains__(self, name: object) -> bool:
        return True

    def __missing__(self, name: str) -> Joint:
        return Joint(name, TURNING[0], "", "", Pose(), (1.0, 0.0, 0.0), Limits())


@cache
def drive_tags() -> frozenset[str]:
    """Each element, in snake_case, that some drive reads: what their readers ask an empty plugin
    for.
    """
    asked: set[str] = set()
    for read in (*DRIVES.values(), omni_drive):
        settings = Settings(Tag("plugin", {}, ""))
        drive = read(settings, _AnyJoint(), Source(Path(), {}))
        with_publisher(drive, settings)
        asked |= settings.asked
    return frozenset(asked)


def _warn_of_unused(settings: Settings, source: Source) -> None:
    """Warn of remappings and elements that change nothing in a plugin that has been read."""
    settings.check_remappings(source, complete=True)
    settings.warn_unread(source, drive_tags())


def plugins_outside_sensors(robot: Tag) -> Iterator[Tag]:
    """The plugins outside sensors: of a `<robot>` those at any depth in a `<gazebo>`, of a
    `<model>` its own.
    """
    waiting = robot.all("gazebo" if robot.name == "robot" else "plugin")[::-1]
    while waiting:
        tag = waiting.pop()
        if tag.name == "plugin":
            yield tag
        elif tag.name != "sensor":
            waiting += reversed(tag.children)


def _warn_not_run(plugin: Tag, kind: str, source: Source) -> None:
    if kind in INSTEAD:
        source.warn(plugin, f"({shorten(file_of(plugin))}) is not supported; {INSTEAD[kind]}")
    elif kind not in (*SENSING, *OF_SENSORS, FORCE):  # `read_forces` reads that
        known = {file_name(name): name for name in (kind, *KNOWN)}
        others = [file for file in known if known[file] != kind]
        near = source.suggest(
            file_name(kind), others, lambda file: known[file].removeprefix("gazebo_ros_"), alike=0.8
        )
        source.warn(
            plugin, f"({shorten(file_of(plugin)) or 'no filename'}) is unknown and is ignored{near}"
        )


def _warn_of_timeout(drive: Drive, settings: Settings, source: Source) -> None:
    timeout = drive.command_timeout
    if timeout is None or timeout > LONG_TIMEOUT:
        tag = settings.tag("cmd_timeout", "command_timeout")
        long = "for ever" if timeout is None else f"for {timeout:g} s"
        problem = (
            f"is {cut(tag.value())}: a robot whose driver hangs, or whose link is cut, "
            f"drives on {long}"
        )
        source.warn(tag, f"{problem}; without this element it stops after {COMMAND_SILENCE:g} s")


def _with_known_frame(
    drive: Drive, plugin: Tag, links: Mapping[str, Link], root: str, source: Source
) -> Drive:
    frame = drive.robot_base_frame
    if frame in links:
        return drive
    if frame:
        tag = next((tag for tag in plugin.children if tag.value().strip("/") == frame), plugin)
        source.warn(
            tag, f"names the base frame {cut(frame)}, which is not a link; {cut(root)} is used"
        )
    return replace(drive, robot_base_frame=root)
