"""The keys of a robot's drive: commands in, odometry and status out."""

import math
from collections.abc import Mapping
from typing import Any

from holozen.bus import Bus
from holozen.limits import STOP, Planar
from holozen.messages import (
    CommandStatus,
    Header,
    JointState,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Twist,
    TwistStamped,
    TwistWithCovariance,
    Vector3,
)
from holozen.robot.model import Drive, Mecanum, RobotModel
from holozen.robot.model import Planar as PlanarDrive
from holozen.robot.rigid import Frame
from holozen.rotation import XYZ, XYZW, from_axis_angle, multiply
from holozen.transport.pubsub import Publisher, Subscription
from holozen.wire import MAX_COMMAND_BYTES, key_for

from ..command.inputs import JointInput, TwistInput
from ..command.motion import JointMotion
from ..physics.movers import Limited, Moved

JOINT_RATE = 50.0  # Hz of sim time


class JointTopics:
    """The keys of a robot's joints, in the namespace `place`. `names` are those of the engine's joints."""

    def __init__(
        self, bus: Bus, place: str, model: RobotModel, names: list[str], prefix: str, twist_input: JointInput,
        tf: Publisher[TFMessage],
    ) -> None:  # fmt: skip
        self._input, self._tf, self.names = twist_input, tf, names
        self._frames = JointFrames(model, key_for("", prefix))
        self._commands = bus.subscribe(twist_input.key, JointState, limit=MAX_COMMAND_BYTES)
        self._states: Publisher[JointState] = bus.publisher(key_for("joint_states", place), JointState)

    @property
    def command_key(self) -> str:
        """The key of joint commands."""
        return self._input.key

    def read_commands(self, now: float, since: float) -> None:
        """Process the commands that wait at `now` and came after `since`, in seconds."""
        arrived = self._commands.waiting(self._commands.raw.listen())
        if arrived or self._input.freshness.is_waiting:
            self._input.take(arrived, now, since)

    @property
    def wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return self._states.wanted or self._tf.wanted

    def publish(self, stamp: Time, states: tuple[list[float], list[float]]) -> None:
        """Publish the joints' positions and rates, and the transforms of the links, to who wants them."""
        positions, rates = states
        if self._states.wanted:
            self._states.put(JointState(Header(stamp), self.names, positions, rates))
        if self._tf.wanted:
            transforms = self._frames.transforms(stamp, dict(zip(self.names, positions, strict=True)))
            self._tf.put(TFMessage(transforms))

    def close(self) -> None:
        """Close the keys."""
        self._commands.close()
        self._states.close()


UNKNOWN = 1e12  # m^2, rad^2; Gazebo's variance of what planar_move does not control


class Schedule:
    """When something with a rate in Hz is due, on a monotonic clock in seconds. `phase`, from 0 to 1, sets several of
    one rate apart.
    """

    def __init__(self, rate: float, phase: float = 0.0) -> None:
        self._phase = phase
        self.set_rate(rate)

    def set_rate(self, rate: float) -> None:
        """Set the rate; it is due at once."""
        self.rate, self._count = rate, -1

    def due(self, time: float) -> bool:
        """Whether a new period has begun since the last call."""
        count = int(time * self.rate + self._phase + 1e-6)
        began = count > self._count
        self._count = count
        return began

    @property
    def next(self) -> float:
        """From when on it is due, at the earliest."""
        return (self._count + 1 - self._phase - 1e-6) / self.rate if self.rate else math.inf


def covariance(drive: Drive) -> list[float]:
    """The 6 x 6 diagonal of Gazebo's planar_move."""
    x, y, yaw = drive.covariance
    diagonal = (x, y, UNKNOWN, UNKNOWN, UNKNOWN, yaw)
    return [diagonal[row] if row == column else 0.0 for row in range(6) for column in range(6)]


def odometry(
    header: Header, child: str, position: XYZ, rotation: XYZW, velocity: Planar, variances: list[float]
) -> Odometry:
    """The world pose, and the velocity in the body frame."""
    pose = Pose(Point(*position), Quaternion(*rotation))
    return Odometry(
        header, child, PoseWithCovariance(pose, variances), TwistWithCovariance(Twist.planar(*velocity), variances)
    )


def transform(header: Header, child: str, position: XYZ, rotation: XYZW) -> TransformStamped:
    """The pose of the frame `child` in the frame of `header`."""
    return TransformStamped(header, child, Transform(Vector3(*position), Quaternion(*rotation)))


class JointFrames:
    """The transforms of all links to their parents. `prefix` goes before each frame's name."""

    def __init__(self, model: RobotModel, prefix: str) -> None:
        self._joints = [
            (joint.name, f"{prefix}{joint.parent}", f"{prefix}{joint.child}", joint.axis, Frame.of(joint.pose))
            for joint in model.joints.values()
        ]
        self._at = [(frame.xyz, frame.quaternion) for *_, frame in self._joints]

    def transforms(self, stamp: Time, angles: Mapping[str, float]) -> list[TransformStamped]:
        """The transforms at the joint `angles` (rad); a joint that is not given is at zero."""
        return [
            transform(
                Header(stamp, parent), child, xyz, multiply(rotation, from_axis_angle(axis, angles.get(name, 0.0)))
            )
            for (name, parent, child, axis, _), (xyz, rotation) in zip(self._joints, self._at, strict=True)
        ]


STATUS_RATE = 10.0  # Hz of real time: people read it


class DriveTopics:
    """The keys of a drive. `prefix` is the robot's name or empty, `name` its name in the world."""

    def __init__(
        self, bus: Bus, prefix: str, name: str, drive: Drive, twist_input: TwistInput, tf: Publisher[TFMessage]
    ) -> None:
        self._name, self._strafes = name, isinstance(drive.mechanism, PlanarDrive | Mecanum)
        self._drive, self._input, self._tf = drive, twist_input, tf
        self._frames = key_for("", prefix)
        self._variances = covariance(drive)
        self._limited = Limited(drive)
        command = twist_input.keys[0]
        self._commands: list[Subscription[Twist | TwistStamped]] = [
            bus.subscribe(key, Twist, TwistStamped, limit=MAX_COMMAND_BYTES) for key in twist_input.keys
        ]
        self.listen = self._commands[0].raw.listen  # a cheap look whether any command waits
        self.is_waiting = len(self._commands) > 1  # whether to read, though nothing came on the first key
        self._odom: Publisher[Odometry] = bus.publisher(key_for(drive.odometry_topic, prefix), Odometry)
        self._status: Publisher[CommandStatus] = bus.publisher(f"{command}_status", CommandStatus)
        self._status_due = Schedule(STATUS_RATE)
        self.status_at = -math.inf  # s from when on a status is due

    def read_commands(self, first: Any, now: float, clocks: tuple[float, ...], since: float) -> None:
        """Process the commands that wait at `now` and came after `since`, after the sample `first` that `listen`
        returned. `clocks`: the times that stamps may be measured by. All in seconds.
        """
        arrived = [received for commands in self._commands for received in commands.waiting(commands.raw.listen())]
        if first is not None:
            arrived = self._commands[0].waiting(first) + arrived
        self._input.take(arrived, now, clocks, since)
        if self._input.has_news:
            self.status_at = now
        self.is_waiting = self._input.freshness.is_waiting or len(self._commands) > 1

    def publish_status(self, now: float, at_once: bool = False) -> None:
        """Publish the command status, when it is due or names a new source, and is wanted, or `at_once`."""
        if at_once or ((self._status_due.due(now) or self._input.has_news) and self._status.wanted):
            status, drive = self._input.status(now), self._drive
            status.name, status.strafes = self._name, self._strafes
            status.max_linear = min(self._input.linear, drive.max_linear)
            status.max_angular = min(self._input.angular, drive.max_angular)
            self._status.put(status)
        self.status_at = self._status_due.next

    @property
    def wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return (self._drive.publish_odom and self._odom.wanted) or (self._drive.publish_odom_tf and self._tf.wanted)

    @property
    def is_steady(self) -> bool:
        """Whether `motion` remains the same while the command does."""
        return self._limited.is_reached

    def motion(self, now: float, dt: float) -> Planar | JointMotion:
        """The commanded motion of the next step of `dt` seconds, within the limits of its file."""
        motion = self._input.arbiter.motion(now)
        if isinstance(motion, JointMotion):
            self._limited(STOP, dt)
            return motion
        return self._limited(motion, dt)

    def publish(self, stamp: Time, moved: Moved) -> None:
        """Publish odometry to who wants it."""
        position, rotation, velocity = moved
        header = Header(stamp, f"{self._frames}{self._drive.odometry_frame}")
        base = f"{self._frames}{self._drive.robot_base_frame}"
        if self._drive.publish_odom and self._odom.wanted:
            self._odom.put(odometry(header, base, position, rotation, velocity, self._variances))
        if self._drive.publish_odom_tf and self._tf.wanted:
            self._tf.put(TFMessage([transform(header, base, position, rotation)]))

    def close(self) -> None:
        """Close the keys."""
        for commands in self._commands:
            commands.close()
        for publisher in (self._odom, self._status):
            publisher.close()
