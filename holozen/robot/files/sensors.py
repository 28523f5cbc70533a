"""Sensors: the `<sensor>` elements of Gazebo classic and gz-sim, and plugins that sense without
one.

Tags and defaults are those of sdformat's sensor.sdf and of gazebo_ros_pkgs
(gazebo_ros_{laser,ray_sensor,imu, imu_sensor,range,camera}.cpp) in ROS 1 (noetic) and ROS 2
(galactic). Two things differ here: a sensor publishes its ROS message whether it has a plugin or
not, and one without an update rate has that of RATES.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping

from msgspec import structs

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Source, Tag, number
from holozen.robot.files.gazebo_plugins import SENSING, Settings, kind_of, plugins_outside_sensors
from holozen.robot.model import (
    HERE,
    NO_NOISE,
    Bumper,
    Camera,
    Fan,
    Imu,
    Lidar,
    Link,
    Noise,
    Pose,
    Sensor,
)
from holozen.robot.rigid import compose
from holozen.suggest import cut

MAX_RAYS = 10_000  # of one sensor
MAX_PIXELS = 2_100_000  # of one camera: full HD
FIELD_OF_VIEW = (0.01, 3.0)  # rad, horizontal
MAX_SENSORS = 100  # of one robot
FASTEST = 1000.0  # Hz
# a camera's optical frame (REP 103): x right, y down, z forward
OPTICAL = Pose(rpy=(-math.pi / 2, 0.0, -math.pi / 2))
SONAR_RAYS = 5  # across and up a sonar's cone

WORLD = "world"  # the frame of contacts, unless a link is tagged

RAYS = ("ray", "gpu_ray", "lidar", "gpu_lidar")
CAMERAS = ("camera", "depth", "depth_camera", "rgbd_camera", "rgbd")
SIMULATED = (*RAYS, "sonar", "imu", "contact", *CAMERAS)
RATES: dict[type, float] = {Lidar: 10.0, Imu: 100.0, Bumper: 50.0, Camera: 10.0}  # Hz


def read_sensors(
    robot: Tag, links: Mapping[str, Link], names: Iterable[str], source: Source
) -> list[Sensor]:
    """The sensors of a `<robot>`. `links` are those that are simulated, `names` those of all links
    in the file. A sensor that cannot be simulated is left out, with a warning that names it.
    """
    reading = _Reading(links, source)
    for gazebo in robot.all("gazebo"):
        link = gazebo.attributes.get("reference", "").strip()
        if not link or link in names:  # there is a warning already about a reference to no link
            for tag in gazebo.all("sensor"):
                reading.take(tag, link)
    for plugin in plugins_outside_sensors(robot):
        if kind_of(plugin) in SENSING:
            reading.take_plugin(plugin)
    return reading.found


def sdf_sensors(
    owners: Iterable[tuple[str, Pose, Tag, Source]], links: Mapping[str, Link]
) -> list[Sensor]:
    """The same for SDF: `owners` are the name of a link in `links`, the pose in it of a `<link>`
    element that became part of it, that element, and its source.
    """
    reading = None
    for name, pose, owner, source in owners:
        for tag in owner.all("sensor"):
            reading = reading or _Reading(links, source)
            reading.take(tag, name, pose, source)
    return reading.found if reading else []


def warn_unsimulated(tag: Tag, source: Source) -> None:
    """Warn about a `<sensor>` of a type that is not simulated."""
    kind = tag.attributes.get("type", "").strip()
    near = source.suggest(kind, SIMULATED) if kind else ""
    source.warn(tag, f"({kind[:80] or 'unknown'}) is not simulated{near}")


class _Reading:
    """Collects the sensors of a robot."""

    def __init__(self, links: Mapping[str, Link], source: Source) -> None:
        self._links, self._source, self._at = links, source, HERE
        self.found: list[Sensor] = []
        self._topics: set[str] = set()

    def take(self, tag: Tag, link: str, at: Pose = HERE, source: Source | None = None) -> None:
        """Add a `<sensor>` of the link `link`, whose element has the frame `at` in it."""
        self._source, self._at = source or self._source, at
        kind = tag.attributes.get("type", "").strip()
        if kind not in SIMULATED:
            warn_unsimulated(tag, self._source)
        elif link not in self._links:
            where = f"on {cut(link)}, which is not simulated" if link else "on no link"
            self._source.warn(tag, f'({kind}) is {where}; write it into <gazebo reference="LINK">')
        else:
            self._try(tag, lambda: self._sensors(tag, link, kind))

    def take_plugin(self, plugin: Tag) -> None:
        """Add a plugin that senses without a `<sensor>`."""
        kind = SENSING[kind_of(plugin)]
        if kind == "imu":
            self._try(plugin, lambda: [self._lone_imu(plugin)])
        else:
            near = "; write it into a <sensor>" if kind in SIMULATED else ""
            self._source.warn(plugin, f"({kind}) is not simulated{near}")

    def _try(self, tag: Tag, read: Callable[[], Iterable[Sensor]]) -> None:
        try:
            for sensor in read():
                self._add(sensor, tag)
        except RobotError as error:
            self._source.warnings.append(f"{error}; {tag} is left out")

    def _add(self, sensor: Sensor, tag: Tag) -> None:
        if len(self.found) == MAX_SENSORS:
            raise tag.wrong(f"is one of more than {MAX_SENSORS} sensors")
        if taken := self._topics.intersection(sensor.topics):
            self._source.warn(
                tag, f"publishes on {min(taken)!r} as another sensor does; it is left out"
            )
            return
        self._topics.update(sensor.topics)
        self.found.append(sensor)

    def _sensors(self, tag: Tag, link: str, kind: str) -> Iterator[Sensor]:
        plugin = next((each for each in tag.all("plugin") if kind_of(each) in SENSING), None)
        for other in tag.all("plugin"):
            if other is not plugin:
                self._source.warn(
                    other, f"is not supported in a <sensor>; {tag} publishes its ROS message anyway"
                )
        sensor = _SensorTag(tag, plugin, kind)
        sensor.plugin.check_remappings(self._source)
        for unkept in ("distortion", "lens"):
            for child in (part for owner in tag.all("camera") for part in owner.all(unkept)):
                if any(number(value.value()) for value in child.children):
                    self._source.warn(child, "is ignored; pictures have no distortion")
        for name in ("bias_mean", "bias_stddev", "dynamic_bias_stddev"):
            for child in tag.below(name):
                if number(child.value()):
                    self._source.warn(child, "is ignored; noise has no bias")
        devices = _devices(sensor, self._source)
        pose, frame, mount = self._placed(sensor, link)
        for topic, device in devices:
            yield Sensor(
                sensor.name,
                link,
                pose,
                frame,
                mount,
                topic,
                sensor.rate(RATES[type(device)]),
                device,
            )

    def _placed(self, sensor: "_SensorTag", link: str) -> tuple[Pose, str, Pose | None]:
        """The pose of a sensor on a link; the name of the frame of its messages: a tagged one, that
        of the link, or one of its own if the sensor is not at the link's origin; and, unless that
        is a link, the frame's pose on the link.
        """
        pose = compose(self._at, _pose(sensor))
        tagged = sensor.plugin.frame("frame_name", "frame_id") or sensor.own.frame(
            "gz_frame_id", "ignition_frame_id", "optical_frame_id"
        )
        tagged = tagged.rpartition("/")[2]
        if sensor.kind == "contact":
            return HERE, tagged if tagged in self._links else WORLD, None
        if tagged in self._links or (not tagged and pose == HERE):
            return pose, tagged or link, None
        if sensor.kind in CAMERAS and "optical" in tagged:
            return pose, tagged, compose(pose, OPTICAL)
        return (
            pose,
            tagged or (sensor.name if sensor.name not in self._links else f"{link}_{sensor.name}"),
            pose,
        )

    def _lone_imu(self, plugin: Tag) -> Sensor:
        """gazebo_ros_imu.cpp, with its link in a tag."""
        settings = Settings(plugin)
        link = settings.frame("body_name")
        if link not in self._links:
            known = self._source.suggest(link, self._links)
            raise settings.tag("body_name").wrong(f"is {cut(link)}, which names no link{known}")
        noise = Noise(stddev=settings.number(0.0, "gaussian_noise"))
        name = plugin.attributes.get("name", "").strip() or "imu"
        rate = settings.number(0.0, "update_rate", most=FASTEST) or RATES[Imu]
        return Sensor(
            name,
            link,
            HERE,
            link,
            None,
            settings.topic("imu", "topic_name"),
            rate,
            Imu((noise,) * 3, (noise,) * 3),
        )


class _SensorTag:
    """A `<sensor>` of a `kind`, with its own settings and those of its plugin, if it has one."""

    def __init__(self, tag: Tag, plugin: Tag | None, kind: str) -> None:
        self.tag, self.kind, self.own = tag, kind, Settings(tag)
        self.plugin = Settings(plugin or tag.empty("plugin"))
        self.plugin_kind = kind_of(plugin) if plugin else ""
        self.plugin_name = plugin.attributes.get("name", "").strip() if plugin else ""
        self.name = tag.attributes.get("name", "").strip() or kind

    def inside(self, *path: str) -> Settings:
        """The settings of the element at a path, of which each part may be several names separated
        by spaces, the first that is there; those of an empty element if it is missing.
        """
        tag = self.tag
        for names in path:
            tag = next(
                (child for name in names.split() if (child := tag.first(name))), None
            ) or tag.empty(names)
        return Settings(tag)

    def rate(self, default: float) -> float:
        """The update rate in Hz."""
        rate = self.own.number(0.0, "update_rate", most=FASTEST)
        return (
            rate
            or self.plugin.number(0.0, "update_rate", "update_rate_hz", most=FASTEST)
            or default
        )

    def topic(self, default: str, *names: str) -> str:
        """The key: by the plugin's tags `names`, ROS 2's `~/out`, or gz-sim's `<topic>`; else
        `default`.
        """
        if self.plugin_kind in (
            "gazebo_ros_ray_sensor",
            "gazebo_ros_imu_sensor",
        ) and not self.plugin.word(*names):
            if self.plugin.is_remapped("out"):
                return self.plugin.topic("out")
            if self.plugin_kind == "gazebo_ros_ray_sensor" or self.plugin.owner.first("ros"):
                return self.plugin.topic(f"{self.plugin_name or self.name}/out")
        return (
            self.plugin.topic(default, *names)
            if self.plugin_kind
            else self.own.topic(default, "topic")
        )


def _devices(sensor: _SensorTag, source: Source) -> list[tuple[str, Lidar | Imu | Bumper | Camera]]:
    """The devices that a sensor consists of, each with its key."""
    if sensor.kind == "imu":
        return [(sensor.topic("imu", "topic_name"), _imu(sensor))]
    if sensor.kind == "contact":
        default = sensor.inside("contact").topic("bumper_states", "topic")  # gz-sim's
        return [
            (
                sensor.plugin.topic(default, "bumper_topic_name")
                if sensor.plugin_kind
                else default,
                Bumper(),
            )
        ]
    if sensor.kind in CAMERAS:
        camera = _camera(sensor, source.for_ros2)
        return [(camera.image or camera.depth, camera)]
    lidar = _sonar(sensor) if sensor.kind == "sonar" else _lidar(sensor, source)
    topic = sensor.topic(lidar.message, "topic_name")
    # gz-sim publishes both
    if lidar.vertical.count > 1 and not sensor.plugin_kind and sensor.kind != "sonar":
        return [(topic, lidar), (f"{topic}/points", structs.replace(lidar, message="points"))]
    return [(topic, lidar)]


def _pose(sensor: _SensorTag) -> Pose:
    tag = sensor.tag.first("pose")
    if tag is None or not tag.value():
        return HERE
    if relative := tag.attributes.get("relative_to", "").strip():
        raise tag.wrong(f"is relative to {cut(relative)}; write it relative to its link")
    x, y, z, *rpy = tag.content(6)
    return Pose((x, y, z), (rpy[0], rpy[1], rpy[2]))


# Lidars, sonars and range sensors.


def _lidar(sensor: _SensorTag, source: Source) -> Lidar:
    limits = sensor.inside("ray lidar", "range")
    near = limits.number(0.0, "min")
    far = limits.number(math.nan, "max", zero=False) if limits.word("max") else math.nan
    if math.isnan(far):
        raise sensor.tag.wrong("has no <range> with a <max>, in metres")
    if far <= near:
        raise limits.owner.wrong(f"has min {near:g} and max {far:g}; min must be less than max")
    horizontal, vertical = (
        _fan(sensor.inside("ray lidar", "scan", name)) for name in ("horizontal", "vertical")
    )
    if (rays := horizontal.count * vertical.count) > MAX_RAYS:
        vertical = _thinned(vertical, MAX_RAYS // 2)
        horizontal = _thinned(horizontal, MAX_RAYS // vertical.count)
        fewer = f"{horizontal.count} x {vertical.count} of them, evenly spread, are simulated"
        source.warn(sensor.tag, f"has {rays} rays; at most {MAX_RAYS} are simulated, so {fewer}")
    noise = _noise(sensor.inside("ray lidar", "noise")) or _plugin_noise(sensor)
    radiation = sensor.plugin.word("radiation", "radiation_type").lower()
    return Lidar(
        horizontal, vertical, near, far, noise, _message(sensor), radiation != "ultrasound"
    )


def _message(sensor: _SensorTag) -> str:
    match sensor.plugin_kind:
        case "gazebo_ros_range" | "hector_gazebo_ros_sonar":
            return "range"
        case "gazebo_ros_block_laser" | "gazebo_ros_velodyne_laser":
            return "points"
        case "gazebo_ros_ray_sensor":
            word = sensor.plugin.word("output_type").rpartition("/")[2] or "PointCloud2"
            kinds = {"LaserScan": "scan", "PointCloud2": "points", "Range": "range"}
            if word not in kinds:
                problem = (
                    f"is {cut(word)}; sensor_msgs/{', sensor_msgs/'.join(kinds)} are supported"
                )
                raise sensor.plugin.tag("output_type").wrong(problem)
            return kinds[word]
    return "scan"


def _sonar(sensor: _SensorTag) -> Lidar:
    """`<sonar>`: a cone along x with a radius at its end."""
    sonar = sensor.inside("sonar")
    near, far = sonar.number(0.0, "min"), sonar.number(5.0, "max", zero=False)
    if far <= near:
        raise sonar.owner.wrong(f"has min {near:g} and max {far:g}; min must be less than max")
    half = math.atan(sonar.number(0.5, "radius") / far)
    fan = Fan(-half, half, SONAR_RAYS)
    return Lidar(fan, fan, near, far, _plugin_noise(sensor), "range", infrared=False)


def _fan(settings: Settings) -> Fan:
    if not settings.owner.children:
        return Fan()
    samples = settings.number(1.0, "samples", zero=False) * settings.number(
        1.0, "resolution", zero=False
    )
    first, last = (_angle(settings, name) for name in ("min_angle", "max_angle"))
    if last < first:
        raise settings.owner.wrong(
            f"has min_angle {first:g} and max_angle {last:g}; min_angle must be the smaller"
        )
    count = max(1, round(samples))
    return Fan(first, last, count) if count > 1 else Fan((first + last) / 2, (first + last) / 2)


def _thinned(fan: Fan, most: int) -> Fan:
    """The fan with at most that many angles, between the same ends."""
    return structs.replace(fan, count=min(fan.count, most))


def _angle(settings: Settings, name: str) -> float:
    word = settings.word(name)
    value = number(word) if word else 0.0
    if value is None or abs(value) > 2 * math.pi + 0.01:
        raise settings.tag(name).wrong(f"is {cut(word)}; it must be an angle in radians")
    return value


# Noise.


def _noise(settings: Settings) -> Noise | None:
    """An SDF `<noise>`; None without one. Raises RobotError."""
    if not settings.owner.children:
        return None
    kind = (
        settings.owner.attributes.get("type", "").strip() or settings.word("type") or "none"
    ).lower()
    if kind == "none":
        return NO_NOISE
    if not kind.startswith("gaussian"):
        raise settings.owner.wrong(f"has the type {cut(kind)}; gaussian and none are supported")
    word = settings.word("mean")
    mean = number(word) if word else 0.0
    if mean is None:
        raise settings.tag("mean").wrong(f"is {cut(word)}; it must be a number")
    return Noise(mean, settings.number(0.0, "stddev"))


def _plugin_noise(sensor: _SensorTag) -> Noise:
    return Noise(stddev=sensor.plugin.number(0.0, "gaussian_noise"))


def _imu(sensor: _SensorTag) -> Imu:
    plain = _plugin_noise(sensor)
    old = {name: _noise_in(sensor.inside("imu", "noise", name)) for name in ("rate", "accel")}
    values = []
    for name, short in (("angular_velocity", "rate"), ("linear_acceleration", "accel")):
        x, y, z = (
            _noise(sensor.inside("imu", name, axis, "noise")) or old[short] or plain
            for axis in "xyz"
        )
        values.append((x, y, z))
    return Imu(values[0], values[1], sensor.inside("imu").flag("enable_orientation"))


def _noise_in(settings: Settings) -> Noise | None:
    """A `<rate>` or `<accel>` of SDF 1.4, where the element around it gives the type."""
    return Noise(0.0, settings.number(0.0, "stddev")) if settings.owner.children else None


# Cameras.


def _camera(sensor: _SensorTag, for_ros2: bool) -> Camera:
    tag = sensor.inside("camera")
    image, clip = sensor.inside("camera", "image"), sensor.inside("camera", "clip")
    width, height = (
        round(image.number(size, name, zero=False))
        for name, size in (("width", 320.0), ("height", 240.0))
    )
    if not (0 < width * height <= MAX_PIXELS):
        raise image.owner.wrong(
            f"has {width} x {height} pixels; from 1 to {MAX_PIXELS} are rendered"
        )
    field_of_view = tag.number(1.047, "horizontal_fov", zero=False)
    low, high = FIELD_OF_VIEW
    if not low <= field_of_view <= high:
        raise tag.tag("horizontal_fov").wrong(f"is {field_of_view:g}; use {low:g} to {high:g} rad")
    near, far = clip.number(0.1, "near", zero=False), clip.number(100.0, "far", zero=False)
    if far <= near:
        raise clip.owner.wrong(f"has near {near:g} and far {far:g}; near must be less than far")
    noise = _noise(sensor.inside("camera", "noise")) or NO_NOISE
    picture, info, depth = _camera_topics(sensor, for_ros2)
    mono = image.word("format").upper() in ("L8", "L_INT8", "GRAY8")
    encoding = "mono8" if mono else "rgb8"
    return Camera(width, height, field_of_view, near, far, picture, info, depth, encoding, noise)


def _camera_topics(sensor: _SensorTag, for_ros2: bool) -> tuple[str, str, str]:
    """The keys of pictures, of their CameraInfo, and of depth. ROS 2's plugin knows no tags in
    camelCase, and has the sensor's name for its camera.
    """
    sees_depth = sensor.kind != "camera"
    if not sensor.plugin_kind:  # gz-sim
        topic = sensor.own.topic(f"{sensor.name}/image_raw", "topic")
        place = topic.rpartition("/")[0]
        info = f"{place}/camera_info".strip("/")
        if sensor.kind == "depth_camera":
            return "", info, topic
        if sees_depth and sensor.own.word("topic"):  # which is a prefix then
            return f"{topic}/image", f"{topic}/camera_info", f"{topic}/depth_image"
        return topic, info, f"{place}/depth_image".strip("/") if sees_depth else ""
    plugin = sensor.plugin
    if for_ros2:
        known = [tag for tag in plugin.owner.children if tag.name == tag.name.lower()]
        plugin = Settings(structs.replace(plugin.owner, children=known))
    has_own = for_ros2 or plugin.owner.first("ros")
    name = plugin.word("camera_name").strip("/") or (sensor.name if has_own else "")
    image, info, depth = (
        plugin.topic_within(name, *names)
        for names in (
            ("image_raw", "image_topic_name"),
            ("camera_info", "camera_info_topic_name"),
            ("depth/image_raw", "depth_image_topic_name"),
        )
    )
    return image, info, depth if sees_depth else ""
