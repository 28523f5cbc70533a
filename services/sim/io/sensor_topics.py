"""The keys of a robot's sensors: what they measure, with their noise, at their rates."""

import math
import zlib
from array import array
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from holozen.bus import Bus
from holozen.messages import (
    ContactsState,
    ContactState,
    Exposure,
    Header,
    LaserScan,
    Message,
    PointCloud2,
    PointField,
    Pose,
    Quaternion,
    Range,
    SeenEntity,
    Time,
    Vector3,
)
from holozen.messages import Imu as ImuMessage
from holozen.robot.model import Bumper, Camera, Imu, Lidar, Noise, Sensor, WorldSpec
from holozen.robot.sensors import WORLD
from holozen.rotation import XYZ, conjugate, rotate
from holozen.transport.pubsub import Publisher
from holozen.wire import key_for

from ..cameras import Cameras
from ..link_states import LinkState, placed
from ..physics.engine import Array
from ..physics.ray_caster import RayCaster
from .topics import Schedule

LinkStates = Mapping[str, LinkState]
"""Those of a robot's links, by name."""


class Step(NamedTuple):
    """A step of the world after which sensors measure: `time` in s, and its `number`."""

    time: float
    number: int


class Surroundings(NamedTuple):
    """What sensors of a world share: what rays hit and what cameras see there now, the seed of all noise, and the
    process that renders.
    """

    world: WorldSpec
    look: Callable[[], RayCaster]
    seen: Callable[[], list[SeenEntity]]
    seed: int
    cameras: Cameras | None


class SensorTopics:
    """All sensors of the robot `name`, whose keys and frames are below `prefix`. `phase` is that of a Schedule."""

    def __init__(
        self, bus: Bus, name: str, prefix: str, sensors: Iterable[Sensor], around: Surroundings, phase: float
    ) -> None:
        self._phase = phase
        self._all: list[tuple[LidarTopic | ImuTopic | BumperTopic | CameraTopic, Schedule]] = []
        for sensor in sensors:
            draw = Draw(around.seed, f"{name}/{sensor.name}")
            match sensor.device:
                case Lidar():
                    self._add(LidarTopic(bus, name, prefix, sensor, sensor.device, around, draw))
                case Imu():
                    self._add(ImuTopic(bus, prefix, sensor, sensor.device, around, draw))
                case Bumper():
                    self._add(BumperTopic(bus, name, prefix, sensor, around))
                case Camera() if around.cameras:
                    self._add(CameraTopic(prefix, sensor, sensor.device, around, around.cameras))
        self.next = -math.inf  # s of sim time from when on `publish` has something to do

    def _add(self, topic: "LidarTopic | ImuTopic | BumperTopic | CameraTopic") -> None:
        self._all.append((topic, Schedule(topic.sensor.rate, self._phase)))

    def publish(self, step: Step, links: Callable[[], LinkStates]) -> None:
        """Publish what is due, and wanted."""
        due = [topic for topic, schedule in self._all if schedule.due(step.time) and topic.wanted]
        self.next = min((schedule.next for _, schedule in self._all), default=math.inf)
        if due:
            now = links()
            for topic in due:
                topic.publish(step, now)

    def start_anew(self) -> None:
        """The world was reset: all are due at once, and know nothing of before."""
        self.next = -math.inf
        for topic, schedule in self._all:
            schedule.set_rate(schedule.rate)
            topic.start_anew()

    def close(self) -> None:
        """Close the keys."""
        for topic, _ in self._all:
            topic.close()


class Draw:
    """Random numbers of a sensor that depend on the seed and the step alone: not on what was drawn before."""

    def __init__(self, seed: int, sensor: str) -> None:
        self._seed = seed, zlib.crc32(sensor.encode())

    def noise(self, steps: int, noises: Iterable[Noise], count: int = 1) -> Array:
        """The noise (n, count) of n quantities after so many steps."""
        random = np.random.default_rng((*self._seed, steps))
        return np.array([noise.mean + noise.stddev * random.standard_normal(count) for noise in noises])


class LidarTopic:
    """A lidar, which sends a scan or points, or what measures a distance."""

    def __init__(
        self, bus: Bus, name: str, prefix: str, sensor: Sensor, lidar: Lidar, around: Surroundings, draw: Draw
    ) -> None:
        self.sensor, self._lidar, self._around, self._draw = sensor, lidar, around, draw
        self._own, self._frame = (name, sensor.link), key_for(sensor.frame, prefix)
        self._xyz, self._rotation = placed(sensor.pose)
        self._directions = directions(lidar)
        key = key_for(sensor.topic, prefix)
        kind, self._message = MESSAGES[lidar.message]
        self._publisher: Publisher[Any] = bus.publisher(key, kind)

    @property
    def wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return self._publisher.wanted

    def publish(self, step: Step, links: LinkStates) -> None:
        """Look, and publish it."""
        lidar, at = self._lidar, links[self.sensor.link].at(self._xyz, self._rotation)
        ranges = self._around.look().ranges(at.xyz, at.rotation, self._directions, lidar.near, lidar.far, self._own)
        if lidar.noise.mean or lidar.noise.stddev:
            noise = self._draw.noise(step.number, [lidar.noise], len(ranges))[0]
            ranges = np.where(np.isfinite(ranges), np.clip(ranges + noise, lidar.near, lidar.far), ranges)
        header = Header(Time.of(step.time), self._frame)
        self._publisher.put(self._message(header, self.sensor, lidar, self._directions, ranges))

    def start_anew(self) -> None:
        """Nothing is kept."""

    def close(self) -> None:
        """Close the key."""
        self._publisher.close()


def directions(lidar: Lidar) -> Array:
    """The unit vectors (n, 3) of its rays: those of the lowest row first, in it counter-clockwise."""
    fans = (lidar.vertical, lidar.horizontal)
    up, left = np.meshgrid(*(np.linspace(fan.first, fan.last, fan.count) for fan in fans), indexing="ij")
    rays = np.stack([np.cos(up) * np.cos(left), np.cos(up) * np.sin(left), np.sin(up)], axis=-1)
    return rays.reshape(-1, 3)


def _scan(header: Header, sensor: Sensor, lidar: Lidar, _rays: Array, ranges: Array) -> LaserScan:
    """The row at the middle of those of a lidar that looks up and down too."""
    fan = lidar.horizontal
    row = ranges.reshape(lidar.vertical.count, fan.count)[lidar.vertical.count // 2]
    values = array("f")
    values.frombytes(row.astype(np.float32).tobytes())
    return LaserScan(header, fan.first, fan.last, fan.step, 0.0, 1 / sensor.rate, lidar.near, lidar.far, values)


def _nearest(header: Header, _sensor: Sensor, lidar: Lidar, _rays: Array, ranges: Array) -> Range:
    """The distance of what is nearest."""
    kind, width = Range.INFRARED if lidar.infrared else Range.ULTRASOUND, lidar.horizontal.last - lidar.horizontal.first
    return Range(header, kind, width, lidar.near, lidar.far, float(ranges.min()))


FIELDS = [PointField(name, 4 * place, PointField.FLOAT32, 1) for place, name in enumerate("xyz")]
POINT = 12  # bytes


def _points(header: Header, _sensor: Sensor, _lidar: Lidar, rays: Array, ranges: Array) -> PointCloud2:
    """The points that were hit, in one row."""
    hit = np.isfinite(ranges)
    points = (rays[hit] * ranges[hit, None]).astype("<f4")
    size = POINT * len(points)
    return PointCloud2(header, 1, len(points), FIELDS, False, POINT, size, array("B", points.tobytes()), True)


MESSAGES: dict[str, tuple[type[Message], Callable[[Header, Sensor, Lidar, Array, Array], Message]]] = {
    "scan": (LaserScan, _scan),
    "points": (PointCloud2, _points),
    "range": (Range, _nearest),
}
"""A lidar's messages, with what makes one of its rays (n, 3) and ranges (n,)."""


class ImuTopic:
    """An inertial measurement unit: its acceleration is the mean since the message before."""

    def __init__(self, bus: Bus, prefix: str, sensor: Sensor, imu: Imu, around: Surroundings, draw: Draw) -> None:
        self.sensor, self._imu, self._around, self._draw = sensor, imu, around, draw
        self._frame = key_for(sensor.frame, prefix)
        self._xyz, self._rotation = placed(sensor.pose)
        self._noises = (*imu.rate, *imu.acceleration)
        self._publisher: Publisher[ImuMessage] = bus.publisher(key_for(sensor.topic, prefix), ImuMessage)
        self._before: tuple[float, XYZ] | None = None  # s, and the velocity then

    wanted = True  # also without subscribers: what is measured must not depend on them

    def publish(self, step: Step, links: LinkStates) -> None:
        """Measure, and publish it."""
        at = links[self.sensor.link].at(self._xyz, self._rotation)
        before, self._before = self._before, (step.time, at.linear)
        if not self._publisher.wanted:
            return
        changes = [0.0] * 3
        if before and step.time > before[0]:
            seconds = step.time - before[0]
            changes = [(now - then) / seconds for now, then in zip(at.linear, before[1], strict=True)]
        back = conjugate(at.rotation)
        ax, ay, az = (change - pull for change, pull in zip(changes, self._around.world.gravity, strict=True))
        turn, force = rotate(back, at.angular), rotate(back, (ax, ay, az))
        noise = self._draw.noise(step.number, self._noises)[:, 0]
        values = [value + extra for value, extra in zip((*turn, *force), noise.tolist(), strict=True)]
        oriented = self._imu.oriented
        self._publisher.put(
            ImuMessage(
                Header(Time.of(step.time), self._frame),
                Quaternion(*at.rotation) if oriented else Quaternion(),
                [0.0 if oriented else -1.0, *[0.0] * 8],  # -1: not measured
                Vector3(*values[:3]), _covariance(self._imu.rate), Vector3(*values[3:]),
                _covariance(self._imu.acceleration),
            )
        )  # fmt: skip

    def start_anew(self) -> None:
        """Forget the velocity of before."""
        self._before = None

    def close(self) -> None:
        """Close the key."""
        self._publisher.close()


class BumperTopic:
    """A bumper: what touches its link. Forces are not measured."""

    def __init__(self, bus: Bus, name: str, prefix: str, sensor: Sensor, around: Surroundings) -> None:
        self.sensor, self._around, self._own = sensor, around, (name, sensor.link)
        self._frame = sensor.frame if sensor.frame == WORLD else key_for(sensor.frame, prefix)
        self._publisher: Publisher[ContactsState] = bus.publisher(key_for(sensor.topic, prefix), ContactsState)

    @property
    def wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return self._publisher.wanted

    def publish(self, step: Step, links: LinkStates) -> None:
        """Publish what touches it now."""
        own = "::".join(self._own)
        states = [
            ContactState(
                f"{len(touch.points)} contacts", own, "::".join(touch.other),
                contact_positions=[Vector3(*self._in_frame(point, links, place=True)) for point in touch.points],
                contact_normals=[Vector3(*self._in_frame(normal, links)) for normal in touch.normals],
                depths=touch.depths,
            )
            for touch in self._around.look().touches(*self._own)
        ]  # fmt: skip
        self._publisher.put(ContactsState(Header(Time.of(step.time), self._frame), states))

    def _in_frame(self, vector: XYZ, links: LinkStates, place: bool = False) -> XYZ:
        if self.sensor.frame == WORLD:
            return vector
        at = links[self.sensor.frame]
        if place:
            x, y, z = (value - origin for value, origin in zip(vector, at.xyz, strict=True))
            vector = x, y, z
        return rotate(conjugate(at.rotation), vector)

    def start_anew(self) -> None:
        """Nothing is kept."""

    def close(self) -> None:
        """Close the key."""
        self._publisher.close()


class CameraTopic:
    """A camera, whose pictures another process renders."""

    def __init__(self, prefix: str, sensor: Sensor, camera: Camera, around: Surroundings, cameras: Cameras) -> None:
        self.sensor, self._camera, self._around, self._cameras = sensor, camera, around, cameras
        self._frame = key_for(sensor.frame, prefix)
        self._xyz, self._rotation = placed(sensor.pose)
        keys = (camera.image, camera.info, camera.depth)
        self._image, self._info, self._depth = (key and key_for(key, prefix) for key in keys)

    @property
    def wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return self._cameras.wanted

    def publish(self, step: Step, links: LinkStates) -> None:
        """Send what it sees."""
        camera, around = self._camera, self._around
        at = links[self.sensor.link].at(self._xyz, self._rotation)
        self._cameras.expose(
            Exposure(
                Header(Time.of(step.time), self._frame), self._image, self._info, self._depth, camera.width,
                camera.height, camera.field_of_view, camera.near, camera.far, camera.encoding, camera.noise.mean,
                camera.noise.stddev, around.seed % 2**64, Pose.of(at.xyz, at.rotation), around.world.ground,
                around.seen(),
            )
        )  # fmt: skip

    def start_anew(self) -> None:
        """Nothing is kept."""

    def close(self) -> None:
        """It has no keys: those of its pictures are the other process's."""


def _covariance(noises: Iterable[Noise]) -> list[float]:
    x, y, z = (noise.stddev**2 for noise in noises)
    return [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]
