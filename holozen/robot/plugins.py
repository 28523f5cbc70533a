"""Gazebo plugin tags -> how a robot is driven. Spelled as in ROS 1 (commandTopic), ROS 2, or mixed."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from holozen.robot.drives import Drive
from holozen.robot.source import Source
from holozen.robot.tag import Tag, number
from holozen.wire import COMMAND_SILENCE

PLANAR_MOVE = re.compile(r"(.*/)?(lib)?gazebo_ros_planar_move(\.so)?")

_KEY = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*(/[A-Za-z0-9_][A-Za-z0-9_-]*)*")


def read_plugins(robot: Tag, links: Mapping[str, object], root: str, source: Source) -> Drive | None:
    """The planar_move plugin of a `<robot>`, if it has one; other plugins make warnings. Raises RobotError."""
    drive: Drive | None = None
    for plugin in _plugins(robot):
        filename = plugin.attributes.get("filename", "").strip()
        if not PLANAR_MOVE.fullmatch(filename):
            source.warn(plugin, f"({filename or 'no filename'}) is not known here and does nothing")
        elif drive is not None:
            source.warn(plugin, "is a second planar_move; only the first one drives")
        else:
            drive = _with_known_frame(_planar_move(plugin), plugin, links, root, source)
    return drive


def _plugins(robot: Tag) -> Iterator[Tag]:
    for gazebo in robot.all("gazebo"):
        yield from gazebo.below("plugin")


def _with_known_frame(drive: Drive, plugin: Tag, links: Mapping[str, object], root: str, source: Source) -> Drive:
    if drive.robot_base_frame in links:
        return drive
    if drive.robot_base_frame:
        source.warn(plugin, f"names the base frame {drive.robot_base_frame!r}, which is no link; {root!r} is used")
    return replace(drive, robot_base_frame=root)


def _planar_move(plugin: Tag) -> Drive:
    """The tags of gazebo_ros_planar_move.cpp, in its ROS 1 (noetic) and its ROS 2 version."""
    plain, settings = Drive(), _Settings(plugin)
    variances = zip(("covariance_x", "covariance_y", "covariance_yaw"), plain.covariance, strict=True)
    x, y, yaw = (settings.number(default, name) for name, default in variances)
    return Drive(
        command_topic=settings.topic("cmd_vel", "command_topic"),
        odometry_topic=settings.topic("odom", "odometry_topic"),
        odometry_frame=settings.word("odometry_frame").strip("/") or plain.odometry_frame,
        odometry_rate=settings.number(plain.odometry_rate, "odometry_rate", "publish_rate", zero=False),
        robot_base_frame=settings.word("robot_base_frame").strip("/"),
        command_timeout=settings.timeout("cmd_timeout", "command_timeout"),
        publish_odom=settings.flag("publish_odom", "publish_odometry"),
        publish_odom_tf=settings.flag("publish_odom_tf", "publish_odometry_tf", "broadcast_transform"),
        covariance=(x, y, yaw),
    )


class _Settings:
    """The tags inside a plugin by their ROS 2 spelling; of two with one name the first counts."""

    def __init__(self, plugin: Tag) -> None:
        self.plugin = plugin
        self.tags = {_snake_case(tag.name): tag for tag in reversed(plugin.children)}

    def tag(self, *names: str) -> Tag:
        """The first of `names` that is there and not empty, else an empty tag."""
        found = (self.tags[name] for name in names if name in self.tags)
        return next((tag for tag in found if tag.text.strip()), Tag(names[0], {}, self.plugin.place, self.plugin))

    def word(self, *names: str) -> str:
        return self.tag(*names).text.strip()

    def number(self, default: float, *names: str, zero: bool = True) -> float:
        """A number above zero, or zero where that is allowed."""
        word = self.word(*names)
        value = number(word) if word else default
        if value is None or value < 0 or (value == 0 and not zero):
            raise self.tag(*names).wrong(f"is {word!r}; it has to be a number {'not below' if zero else 'above'} 0")
        return value

    def timeout(self, *names: str) -> float:
        """Seconds, or -1 for a watchdog that is off."""
        value = number(self.word(*names) or "")
        return -1.0 if value is not None and value < 0 else self.number(COMMAND_SILENCE, *names, zero=False)

    def flag(self, *names: str) -> bool:
        """True unless the file says otherwise."""
        word = self.word(*names).lower() or "true"
        if word not in ("true", "1", "false", "0"):
            raise self.tag(*names).wrong(f"is {word!r}; it has to be true or false")
        return word in ("true", "1")

    def topic(self, default: str, name: str) -> str:
        """The key of a topic: its name, as remapped, after the namespace unless it starts with a slash."""
        remapped = self._remappings()
        topic = self.word(name) or default
        topic = remapped.get(topic.strip("/"), remapped.get(default, topic))
        key = topic if topic.startswith("/") else f"{self._namespace()}/{topic}"
        key = re.sub("/+", "/", key).strip("/")
        if not _KEY.fullmatch(key):
            problem = f"makes the topic {key[:80]!r}; a topic has letters, digits, '_', '-' and single '/'"
            raise self.tag(name).wrong(problem)
        return key

    def _namespace(self) -> str:
        ros = self.tags.get("ros")
        namespace = ros.first("namespace") if ros else None
        return namespace.text.strip() if namespace else self.word("robot_namespace")

    def _remappings(self) -> dict[str, str]:
        ros = self.tags.get("ros")
        pairs = [tag.text.partition(":=") for tag in (ros.all("remapping") if ros else ())]
        return {old.strip().strip("/"): new.strip() for old, _, new in pairs if new.strip()}


def _snake_case(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
