"""The keys of a robot's drive: commands in, odometry and status out."""

import math
from collections.abc import Mapping
from random import Random
from typing import Any

from holozen.bus import Bus
from holozen.command.inputs import JointInput, TwistInput
from holozen.command.motion import AppliedForces, JointMotion
from holozen.limits import STOP, Planar
from holozen.messages import (
    CommandStatus,
    Header,
    JointState,
    Odometry,
    TFMessage,
    Time,
    TransformStamped,
    Twist,
    TwistStamped,
)
from holozen.odometry import odometry, transform
from holozen.robot.model import Drive, Mecanum, Omni, RobotModel
from holozen.robot.model import Planar as PlanarDrive
from holozen.robot.rigid import moved_by
from holozen.rotation import conjugate, from_axis_angle, multiply, rotate
from holozen.transport.pubsub import Publisher, Subscription
from holozen.wire import MAX_COMMAND_BYTES, key_for

from ..link_states import link_tree, placed
from ..physics.body import Moved
from ..physics.engine import JointStates
from ..physics.movers import Limited

JOINT_RATE = 50.0  # Hz of sim time


class JointTopics:
    """The keys of a robot's joints, in the namespace `place`. `names` are the joints' names in the engine's order."""

    def __init__(
        self, bus: Bus, place: str, model: RobotModel, names: list[str], prefix: str, joint_input: JointInput,
        tf: Publisher[TFMessage],
    ) -> None:  # fmt: skip
        self._tf, self.names, self.command_key = tf, names, joint_input.keys[0]
        self._frames = JointFrames(model, key_for("", prefix))
        self._commands = bus.subscribe(self.command_key, JointState, limit=MAX_COMMAND_BYTES, dealt=True)
        self.readers = [joint_input.reader(self._commands)]
        self._states: Publisher[JointState] = bus.publisher(key_for("joint_states", place), JointState)

    @property
    def wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return self._states.wanted or self._tf.wanted

    def publish(self, stamp: Time, states: JointStates) -> None:
        """Publish the joints' positions, rates and efforts, and the transforms of the links, if anyone wants them."""
        positions, rates, efforts = states
        if self._states.wanted:
            self._states.queue(JointState(Header(stamp), self.names, positions, rates, efforts))
        if self._tf.wanted:
            transforms = self._frames.transforms(stamp, dict(zip(self.names, positions, strict=True)))
            self._tf.queue(TFMessage(transforms))

    def close(self) -> None:
        """Close the keys."""
        self._commands.close()
        self._states.close()


UNKNOWN = 1e12  # m^2, rad^2; Gazebo's variance of what planar_move does not control


def covariance(drive: Drive) -> list[float]:
    """The 36 numbers of the diagonal 6 x 6 covariance of Gazebo's planar_move."""
    x, y, yaw = drive.covariance
    diagonal = (x, y, UNKNOWN, UNKNOWN, UNKNOWN, yaw)
    return [diagonal[row] if row == column else 0.0 for row in range(6) for column in range(6)]


class JointFrames:
    """The transforms of all links, and of sensors with a frame of their own, to their parents. The name of each frame
    begins with `prefix`.
    """

    def __init__(self, model: RobotModel, prefix: str) -> None:
        self._joints = [
            (joint, f"{prefix}{joint.parent}", f"{prefix}{joint.child}", xyz, rotation)
            for joint, xyz, rotation in link_tree(model).joints
        ]
        mounts = {one.frame: (one.link, placed(one.mount)) for one in model.sensors if one.mount}
        self._mounts: list[Any] = [(f"{prefix}{link}", f"{prefix}{frame}", *at) for frame, (link, at) in mounts.items()]

    def transforms(self, stamp: Time, positions: Mapping[str, float]) -> list[TransformStamped]:
        """The transforms at the joint `positions` (rad, or m if prismatic). A joint that is not given is at zero."""
        links = [
            transform(Header(stamp, parent), child, *moved_by(joint, xyz, rotation, positions.get(joint.name, 0.0)))
            for joint, parent, child, xyz, rotation in self._joints
        ]
        return links + [transform(Header(stamp, parent), *at) for parent, *at in self._mounts]


NONE = (False, False)


class DriveTopics:
    """The keys of a drive. `prefix` is the robot's name or empty, `name` its name in the world."""

    def __init__(
        self, bus: Bus, prefix: str, name: str, drive: Drive, twist_input: TwistInput, tf: Publisher[TFMessage]
    ) -> None:
        self._name, self._strafes = name, isinstance(drive.mechanism, PlanarDrive | Mecanum | Omni)
        self._drive, self._input, self._tf = drive, twist_input, tf
        frames = key_for("", prefix)
        self._frame, self._base = f"{frames}{drive.odometry_frame}", f"{frames}{drive.robot_base_frame}"
        self._variances = covariance(drive)
        command = twist_input.keys[0]
        self._commands: list[Subscription[Twist | TwistStamped]] = [
            bus.subscribe(key, Twist, TwistStamped, limit=MAX_COMMAND_BYTES, dealt=True) for key in twist_input.keys
        ]
        self.readers = [*map(twist_input.reader, self._commands)]
        twist_input.on_news = self.publish_status
        self._odom: Publisher[Odometry] = bus.publisher(key_for(drive.odometry_topic, prefix), Odometry)
        self._status: Publisher[CommandStatus] = bus.publisher(f"{command}_status", CommandStatus)

    def publish_status(self, now: float, at_once: bool = False) -> None:
        """Publish the command status, if anyone wants it or `at_once`."""
        if at_once or self._status.wanted:
            status, drive = self._input.status(now), self._drive
            status.name, status.strafes = self._name, self._strafes
            status.max_linear = min(self._input.linear, drive.max_linear)
            status.max_angular = min(self._input.angular, drive.max_angular)
            self._status.put(status)

    @property
    def wanted(self) -> tuple[bool, bool]:
        """Whether anyone wants odometry, and whether anyone wants its transform."""
        drive = self._drive
        return drive.publish_odom and self._odom.wanted, drive.publish_odom_tf and self._tf.wanted

    def reset(self, moved: Moved) -> None:
        """The robot has a new body, which stands in the state `moved`."""
        self._limited, self._start = Limited(self._drive), moved[:2]

    def motion(self, now: float, dt: float) -> Planar | JointMotion:
        """The commanded motion of the next step of `dt` seconds, within the limits of the robot's file."""
        motion = self._input.arbiter.motion(now)
        assert not isinstance(motion, AppliedForces), "forces are another arbiter's where a drive is"
        if isinstance(motion, JointMotion):
            self._limited(STOP, dt)
            return motion
        motion = self._limited(motion, dt)
        if not self._limited.is_reached:
            self._input.arbiter.due = -math.inf  # the next step changes it again
        return motion

    def publish(self, stamp: Time, moved: Moved, wanted: tuple[bool, bool]) -> None:
        """Publish odometry and its transform, where `wanted`."""
        position, rotation, velocity = self._measured(stamp, moved)
        header = Header(stamp, self._frame)
        if wanted[0]:
            self._odom.queue(odometry(header, self._base, position, rotation, velocity, self._variances))
        if wanted[1]:
            self._tf.queue(TFMessage([transform(header, self._base, position, rotation)]))

    def _measured(self, stamp: Time, moved: Moved) -> Moved:
        """The state for odometry: relative to the start, and with noise, if the file says so. The noise depends on the
        stamp alone, so that all readers get the same.
        """
        ((x, y, z), rotation, velocity), noise = moved, self._drive.odometry_noise
        if self._drive.odometry_from_start:
            (x0, y0, z0), back = self._start[0], conjugate(self._start[1])
            (x, y, z), rotation = rotate(back, (x - x0, y - y0, z - z0)), multiply(back, rotation)
        if noise:
            random = Random(f"{self._name} {stamp.sec} {stamp.nanosec}")
            dx, dy, turn, vx, vy, rate = (random.gauss(0.0, noise) for _ in range(6))
            x, y, rotation = x + dx, y + dy, multiply(from_axis_angle((0.0, 0.0, 1.0), turn), rotation)
            velocity = velocity[0] + vx, velocity[1] + vy, velocity[2] + rate
        return (x, y, z), rotation, velocity

    def close(self) -> None:
        """Close the keys."""
        for commands in self._commands:
            commands.close()
        for publisher in (self._odom, self._status):
            publisher.close()
