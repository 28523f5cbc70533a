"""`<sensor>` elements, and the plugins that sense without one. They are read and not simulated yet."""

from collections.abc import Mapping

from holozen.robot.errors import cut
from holozen.robot.parts import Sensor
from holozen.robot.plugins.names import kind_of
from holozen.robot.plugins.settings import Settings
from holozen.robot.source import Source
from holozen.robot.tag import Tag, number

SENSING = {
    "gazebo_ros_imu": "imu",
    "gazebo_ros_imu_sensor": "imu",
    "hector_gazebo_ros_imu": "imu",
    "hector_gazebo_ros_gps": "gps",
    "gazebo_ros_gps_sensor": "gps",
    "hector_gazebo_ros_magnetic": "magnetometer",
    "hector_gazebo_ros_sonar": "sonar",
    "gazebo_ros_f3d": "force_torque",
    "gazebo_ros_ft_sensor": "force_torque",
    "gazebo_ros_bumper": "contact",
    "gazebo_ros_laser": "ray",
    "gazebo_ros_gpu_laser": "gpu_ray",
    "gazebo_ros_block_laser": "ray",
    "gazebo_ros_ray_sensor": "ray",
    "gazebo_ros_range": "ray",
    "gazebo_ros_camera": "camera",
    "gazebo_ros_multicamera": "multicamera",
    "gazebo_ros_depth_camera": "depth",
    "gazebo_ros_openni_kinect": "depth",
    "gazebo_ros_velodyne_laser": "ray",
}
"""Plugin -> the kind of sensor that it is where it stands outside of a `<sensor>`."""


def read_sensors(robot: Tag, links: Mapping[str, object], root: str, source: Source) -> tuple[Sensor, ...]:
    """The sensors of a `<robot>`, with a warning for each `<sensor>`; `read_plugins` warns of the sensing plugins."""
    found = []
    for gazebo in robot.all("gazebo"):
        link = gazebo.attributes.get("reference", "").strip() or root
        if link not in links:
            continue  # told as a reference that names no link
        found += [read_sensor(tag, link, source) for tag in gazebo.all("sensor")]
        found += [_of_plugin(tag, link, links, source) for tag in gazebo.all("plugin") if kind_of(tag) in SENSING]
    return tuple(found)


def read_sensor(tag: Tag, link: str, source: Source) -> Sensor:
    """A `<sensor>` on `link`, of URDF or SDF."""
    kind = tag.attributes.get("type", "").strip() or "unknown"
    plugin = tag.first("plugin") or Tag("plugin", {}, tag.place, tag)
    rate = _rate(tag, source) or _rate(plugin, source)
    source.warn(tag, f"({kind[:80]}) is not simulated yet")
    return Sensor(tag.attributes.get("name", kind), kind, link, rate, _topic(tag) or _topic(plugin))


def _of_plugin(tag: Tag, link: str, links: Mapping[str, object], source: Source) -> Sensor:
    settings, kind = Settings(tag), SENSING[kind_of(tag)]
    body = settings.frame("body_name", "frame_id", "frame_name")
    on = body if body in links else link
    return Sensor(tag.attributes.get("name", kind), kind, on, _rate(tag, source), _topic(tag))


def _rate(owner: Tag, source: Source) -> float:
    """Hz; 0 where the file says nothing that can be a rate."""
    told = Settings(owner).tag("update_rate")
    word = told.value()
    value = number(word) if word else 0.0
    if value is None or value < 0:
        source.warn(told, f"is {cut(word)}; it is taken as every step")
    return max(0.0, value or 0.0)


def _topic(owner: Tag) -> str:
    """As the file spells it: `<topic>` of a sensor, or the tags of the plugins that ROS has for sensors."""
    settings = Settings(owner)
    ros = owner.first("ros")
    for remapping in ros.all("remapping") if ros else ():
        old, _, new = remapping.value().partition(":=")
        if old.strip().rpartition("/")[2] in ("out", "image_raw"):
            return new.strip().strip("/")
    topic = settings.word("topic", "topic_name", "image_topic_name")
    camera = settings.word("camera_name")
    return "/".join(part.strip("/") for part in (camera, topic) if part) if camera else topic.strip("/")
