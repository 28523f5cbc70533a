"""The keys of a robot's sensors: what they measure, with their noise, at their rates."""

import math
import zlib
from array import array
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from holozen.bus import Bus
from holozen.command.collision_monitor import CollisionMonitor
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
from holozen.robot.files.sensors import WORLD
from holozen.robot.model import Bumper, Camera, Imu, Lidar, Noise, Sensor, WorldSpec, is_watched
from holozen.rotation import XYZ, conjugate, rotate
from holozen.transport.pubsub import Publisher
from holozen.wire import key_for

from ..cameras import Cameras
from ..identity import Identity
from ..link_states import LinkState, LinkStates, placed
from ..physics.engine import Array
from ..physics.ray_caster import RayCaster
from ..schedule import Schedule


class Step(NamedTuple):
    """A step of the world after which sensors measure: `time` in s, and its `number`."""

    time: float
    number: int


class Surroundings(NamedTuple):
    """What the sensors of a world share: `look` gives what rays hit and `seen` what cameras see at
    present, `seed` is that of all noise, and `cameras` is the process that renders.
    """

    world: WorldSpec
    look: Callable[[], RayCaster]
    seen: Callable[[], list[SeenEntity]]
    seed: int
    cameras: Cameras | None


class SensorTopics:
    """All sensors of one robot. `phase` is that of a Schedule, `monitor` what drives by them."""

    def __init__(
        self,
        bus: Bus,
        identity: Identity,
        around: Surroundings,
        phase: float,
        monitor: CollisionMonitor | None = None,
    ) -> None:
        self._phase = phase
        self._all: list[tuple[SensorTopic, Schedule]] = []
        name, prefix = identity.name, identity.prefix
        for sensor in identity.model.sensors:
            draw = Draw(around.seed, f"{name}/{sensor.name}")
            match sensor.device:
                case Lidar():
                    watching = monitor if is_watched(sensor) else None
                    self._add(
                        LidarTopic(bus, name, prefix, sensor, sensor.device, around, draw, watching)
                    )
                case Imu():
                    self._add(ImuTopic(bus, prefix, sensor, sensor.device, around, draw))
                case Bumper():
                    self._add(BumperTopic(bus, name, prefix, sensor, around))
                case Camera() if around.cameras:
                    self._add(CameraTopic(prefix, sensor, sensor.device, around, around.cameras))

    @property
    def next(self) -> float:
        """The sim time (s) until which nothing is due."""
        return min((schedule.next for _, schedule in self._all), default=math.inf)

    def _add(self, topic: "SensorTopic") -> None:
        self._all.append((topic, Schedule(topic.sensor.rate, self._phase)))

    def publish(self, step: Step, links: Callable[[], LinkStates]) -> None:
        """Publish the sensors that are due and wanted."""
        due = [
            topic
            for topic, schedule in self._all
            if schedule.advance(step.time) and topic.poll_wanted()
        ]
        if due:
            now = links()
            for topic in due:
                topic.publish(step, now)

    def reset(self) -> None:
        """The world was reset: forget all earlier measurements, and let all sensors be due at
        once.
        """
        for topic, schedule in self._all:
            schedule.set_rate(schedule.rate)
            topic.reset()

    def close(self) -> None:
        """Close the keys."""
        for topic, _ in self._all:
            topic.close()


class Draw:
    """Random numbers of a sensor. They depend on the seed and the step alone, and not on what was
    drawn before.
    """

    def __init__(self, seed: int, sensor: str) -> None:
        self._seed = seed, zlib.crc32(sensor.encode())

    def noise(self, steps: int, noises: Iterable[Noise], count: int = 1) -> Array:
        """The noise (n, count) of n quantities at the step number `steps`."""
        random = np.random.default_rng((*self._seed, steps))
        return np.array(
            [noise.mean + noise.stddev * random.standard_normal(count) for noise in noises]
        )


class SensorTopic:
    """A sensor of a robot with this `prefix`, and its publisher; None if another process publishes
    for it.
    """

    def __init__(
        self, sensor: Sensor, prefix: str, around: Surroundings, publisher: Publisher[Any] | None
    ) -> None:
        self.sensor, self._around, self._publisher = sensor, around, publisher
        self._frame = key_for(sensor.frame, prefix)
        self._xyz, self._rotation = placed(sensor.pose)

    def poll_wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return self._publisher is not None and self._publisher.poll_wanted()

    def publish(self, step: Step, links: LinkStates) -> None:
        """Publish what the sensor measures after a step."""
        if self._publisher:
            self._publisher.put(self._measured(step, links))

    def _measured(self, step: Step, links: LinkStates) -> Message:
        raise NotImplementedError

    def _at(self, links: LinkStates) -> LinkState:
        """The state of the sensor's frame."""
        return links[self.sensor.link].at(self._xyz, self._rotation)

    def reset(self) -> None:
        """The world was reset: forget all earlier measurements."""

    def close(self) -> None:
        """Close the key."""
        if self._publisher:
            self._publisher.close()


class LidarTopic(SensorTopic):
    """A lidar, which publishes a scan or points; or a distance sensor."""

    def __init__(
        self,
        bus: Bus,
        name: str,
        prefix: str,
        sensor: Sensor,
        lidar: Lidar,
        around: Surroundings,
        draw: Draw,
        monitor: CollisionMonitor | None = None,
    ) -> None:
        """`monitor` drives by what it measures."""
        self._monitor, self._key = monitor, key_for(sensor.topic, prefix)
        kind, self._message = MESSAGES[lidar.message]
        super().__init__(sensor, prefix, around, bus.publisher(key_for(sensor.topic, prefix), kind))
        self._lidar, self._draw, self._own, self._directions = (
            lidar,
            draw,
            (name, sensor.link),
            directions(lidar),
        )

    def poll_wanted(self) -> bool:
        """Whether anyone wants what it measures."""
        return super().poll_wanted() or (self._monitor is not None and self._monitor.seconds > 0)

    def publish(self, step: Step, links: LinkStates) -> None:
        """Measure, and publish it if anyone wants it."""
        measured = self._measured(step, links)
        if self._monitor and isinstance(measured, LaserScan | Range):
            self._monitor.see(self._key, measured)
        if self._publisher and super().poll_wanted():
            self._publisher.put(measured)

    def _measured(self, step: Step, links: LinkStates) -> Message:
        lidar, at = self._lidar, self._at(links)
        ranges = self._around.look().ranges(
            at.xyz, at.rotation, self._directions, lidar.near, lidar.far, self._own
        )
        if lidar.noise.mean or lidar.noise.stddev:
            noise = self._draw.noise(step.number, [lidar.noise], len(ranges))[0]
            ranges = np.where(
                np.isfinite(ranges), np.clip(ranges + noise, lidar.near, lidar.far), ranges
            )
        return self._message(
            Header(Time.of(step.time), self._frame), self.sensor, lidar, self._directions, ranges
        )


def directions(lidar: Lidar) -> Array:
    """The unit vectors (n, 3) of its rays: row by row from the lowest one, each row
    counter-clockwise.
    """
    fans = (lidar.vertical, lidar.horizontal)
    up, left = np.meshgrid(
        *(np.linspace(fan.first, fan.last, fan.count) for fan in fans), indexing="ij"
    )
    rays = np.stack([np.cos(up) * np.cos(left), np.cos(up) * np.sin(left), np.sin(up)], axis=-1)
    return rays.reshape(-1, 3)


def _scan(header: Header, sensor: Sensor, lidar: Lidar, _rays: Array, ranges: Array) -> LaserScan:
    """The scan of the lidar's middle row."""
    fan = lidar.horizontal
    row = ranges.reshape(lidar.vertical.count, fan.count)[lidar.vertical.count // 2]
    values = array("f")
    values.frombytes(row.astype(np.float32).tobytes())
    return LaserScan(
        header, fan.first, fan.last, fan.step, 0.0, 1 / sensor.rate, lidar.near, lidar.far, values
    )


def _nearest(header: Header, _sensor: Sensor, lidar: Lidar, _rays: Array, ranges: Array) -> Range:
    """The shortest range."""
    kind, width = (
        Range.INFRARED if lidar.infrared else Range.ULTRASOUND,
        lidar.horizontal.last - lidar.horizontal.first,
    )
    return Range(header, kind, width, lidar.near, lidar.far, float(ranges.min()))


FIELDS = [PointField(name, 4 * place, PointField.FLOAT32, 1) for place, name in enumerate("xyz")]
POINT = 12  # bytes


def _points(
    header: Header, _sensor: Sensor, _lidar: Lidar, rays: Array, ranges: Array
) -> PointCloud2:
    """The points that the rays hit, in one row."""
    hit = np.isfinite(ranges)
    points = (rays[hit] * ranges[hit, None]).astype("<f4")
    size = POINT * len(points)
    return PointCloud2(
        header, 1, len(points), FIELDS, False, POINT, size, array("B", points.tobytes()), True
    )


MESSAGES: dict[
    str, tuple[type[Message], Callable[[Header, Sensor, Lidar, Array, Array], Message]]
] = {
    "scan": (LaserScan, _scan),
    "points": (PointCloud2, _points),
    "range": (Range, _nearest),
}
"""The message types of a lidar, each with the function that makes one from its rays (n, 3) and
ranges (n,).
"""


class ImuTopic(SensorTopic):
    """An inertial measurement unit. Its acceleration is the mean since the previous measurement."""

    def __init__(
        self, bus: Bus, prefix: str, sensor: Sensor, imu: Imu, around: Surroundings, draw: Draw
    ) -> None:
        super().__init__(
            sensor, prefix, around, bus.publisher(key_for(sensor.topic, prefix), ImuMessage)
        )
        self._imu, self._draw, self._noises = imu, draw, (*imu.rate, *imu.acceleration)
        self._before: tuple[float, XYZ] | None = None  # s, and the velocity then

    def poll_wanted(self) -> bool:
        """Always true: its measurements must not depend on who subscribes."""
        return True

    def publish(self, step: Step, links: LinkStates) -> None:
        """Measure, and publish it if anyone wants it."""
        self._now = self._at(links)
        if super().poll_wanted():
            super().publish(step, links)
        self._before = step.time, self._now.linear

    def _measured(self, step: Step, links: LinkStates) -> ImuMessage:
        before, at = self._before, self._now
        changes = [0.0] * 3
        if before and step.time > before[0]:
            seconds = step.time - before[0]
            changes = [
                (now - then) / seconds for now, then in zip(at.linear, before[1], strict=True)
            ]
        back = conjugate(at.rotation)
        ax, ay, az = (
            change - pull for change, pull in zip(changes, self._around.world.gravity, strict=True)
        )
        turn, force = rotate(back, at.angular), rotate(back, (ax, ay, az))
        noise = self._draw.noise(step.number, self._noises)[:, 0]
        values = [
            value + extra for value, extra in zip((*turn, *force), noise.tolist(), strict=True)
        ]
        oriented = self._imu.oriented
        return ImuMessage(
            Header(Time.of(step.time), self._frame),
            Quaternion(*at.rotation) if oriented else Quaternion(),
            [0.0 if oriented else -1.0, *[0.0] * 8],  # -1: not measured
            Vector3(*values[:3]),
            _covariance(self._imu.rate),
            Vector3(*values[3:]),
            _covariance(self._imu.acceleration),
        )

    def reset(self) -> None:
        """The world was reset: forget the last velocity."""
        self._before = None


class BumperTopic(SensorTopic):
    """A bumper: what touches its link. Forces are not measured."""

    def __init__(
        self, bus: Bus, name: str, prefix: str, sensor: Sensor, around: Surroundings
    ) -> None:
        super().__init__(
            sensor, prefix, around, bus.publisher(key_for(sensor.topic, prefix), ContactsState)
        )
        self._own = (name, sensor.link)
        if sensor.frame == WORLD:
            self._frame = WORLD

    def _measured(self, step: Step, links: LinkStates) -> ContactsState:
        own = "::".join(self._own)
        states = [
            ContactState(
                f"{len(touch.points)} contacts",
                own,
                "::".join(touch.other),
                contact_positions=[
                    Vector3(*self._in_frame(point, links, place=True)) for point in touch.points
                ],
                contact_normals=[
                    Vector3(*self._in_frame(normal, links)) for normal in touch.normals
                ],
                depths=touch.depths,
            )
            for touch in self._around.look().touches(*self._own)
        ]
        return ContactsState(Header(Time.of(step.time), self._frame), states)

    def _in_frame(self, vector: XYZ, links: LinkStates, place: bool = False) -> XYZ:
        if self.sensor.frame == WORLD:
            return vector
        at = links[self.sensor.frame]
        if place:
            x, y, z = (value - origin for value, origin in zip(vector, at.xyz, strict=True))
            vector = x, y, z
        return rotate(conjugate(at.rotation), vector)


class CameraTopic(SensorTopic):
    """A camera, whose pictures another process renders."""

    def __init__(
        self, prefix: str, sensor: Sensor, camera: Camera, around: Surroundings, cameras: Cameras
    ) -> None:
        super().__init__(sensor, prefix, around, None)
        self._camera, self._cameras = camera, cameras
        keys = (camera.image, camera.info, camera.depth)
        self._image, self._info, self._depth = (key and key_for(key, prefix) for key in keys)

    def poll_wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return self._cameras.poll_wanted()

    def publish(self, step: Step, links: LinkStates) -> None:
        """Send an exposure to the process that renders."""
        camera, around, at = self._camera, self._around, self._at(links)
        self._cameras.expose(
            Exposure(
                Header(Time.of(step.time), self._frame),
                self._image,
                self._info,
                self._depth,
                camera.width,
                camera.height,
                camera.field_of_view,
                camera.near,
                camera.far,
                camera.encoding,
                camera.noise.mean,
                camera.noise.stddev,
                around.seed % 2**64,
                Pose.of(at.xyz, at.rotation),
                around.world.ground,
                around.seen(),
            )
        )

    def close(self) -> None:
        """Have the keys closed by the process that publishes on them."""
        self._cameras.expose(Exposure(image=self._image, depth=self._depth))


def _covariance(noises: Iterable[Noise]) -> list[float]:
    x, y, z = (noise.stddev**2 for noise in noises)
    return [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]
