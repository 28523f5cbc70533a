"""The keys on which a robot's drive and joints are published."""

from collections.abc import Mapping
from random import Random
from typing import Any, NamedTuple

from holozen.bus import Bus
from holozen.messages import (
    CommandStatus,
    Header,
    JointState,
    Odometry,
    TFMessage,
    Time,
    TransformStamped,
)
from holozen.odometry import odometry, transform
from holozen.robot.model import Drive, Mecanum, Omni, RobotModel
from holozen.robot.model import Planar as PlanarDrive
from holozen.robot.rigid import moved_by
from holozen.rotation import conjugate, from_axis_angle, multiply, rotate
from holozen.transport.pubsub import Publisher
from holozen.wire import key_for

from ..identity import Identity
from ..link_states import link_tree, placed
from ..physics.body import Moved
from ..physics.engine import JointStates

JOINT_RATE = 50.0  # Hz of sim time


class JointTopics:
    """The keys of a robot's joints. `names` are the joints' names in the engine's order."""

    def __init__(
        self, bus: Bus, identity: Identity, names: list[str], tf: Publisher[TFMessage]
    ) -> None:
        self.names = names
        self._tf = tf
        self._frames = JointFrames(identity.model, key_for("", identity.prefix))
        self._states: Publisher[JointState] = bus.publisher(
            key_for("joint_states", identity.namespace), JointState
        )

    def poll_wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        return self._states.poll_wanted() or self._tf.poll_wanted()

    def publish(self, stamp: Time, states: JointStates) -> None:
        """Publish the joints' positions, rates and efforts, and the transforms of the links, if
        anyone wants them.
        """
        positions, rates, efforts = states
        if self._states.poll_wanted():
            self._states.queue(JointState(Header(stamp), self.names, positions, rates, efforts))
        if self._tf.poll_wanted():
            transforms = self._frames.transforms(
                stamp, dict(zip(self.names, positions, strict=True))
            )
            self._tf.queue(TFMessage(transforms))

    def close(self) -> None:
        """Close the keys."""
        self._states.close()


UNKNOWN = 1e12  # m^2, rad^2; Gazebo's variance of what planar_move does not control


def covariance(drive: Drive) -> list[float]:
    """The 36 numbers of the diagonal 6 x 6 covariance of Gazebo's planar_move."""
    x, y, yaw = drive.covariance
    diagonal = (x, y, UNKNOWN, UNKNOWN, UNKNOWN, yaw)
    return [diagonal[row] if row == column else 0.0 for row in range(6) for column in range(6)]


class JointFrames:
    """The transforms of all links, and of sensors with a frame of their own, to their parents. The
    name of each frame begins with `prefix`.
    """

    def __init__(self, model: RobotModel, prefix: str) -> None:
        self._joints = [
            (joint, f"{prefix}{joint.parent}", f"{prefix}{joint.child}", xyz, rotation)
            for joint, xyz, rotation in link_tree(model).joints
        ]
        mounts = {one.frame: (one.link, placed(one.mount)) for one in model.sensors if one.mount}
        self._mounts: list[Any] = [
            (f"{prefix}{link}", f"{prefix}{frame}", *at) for frame, (link, at) in mounts.items()
        ]

    def transforms(self, stamp: Time, positions: Mapping[str, float]) -> list[TransformStamped]:
        """The transforms at the joint `positions` (rad, or m if prismatic). A joint that is not
        given is at zero.
        """
        links = [
            transform(
                Header(stamp, parent),
                child,
                *moved_by(joint, xyz, rotation, positions.get(joint.name, 0.0)),
            )
            for joint, parent, child, xyz, rotation in self._joints
        ]
        return links + [transform(Header(stamp, parent), *at) for parent, *at in self._mounts]


class Wanted(NamedTuple):
    """What of a drive anyone wants.

    Attributes:
        odometry: Whether its odometry.
        transform: Whether the transform of that.
    """

    odometry: bool = False
    transform: bool = False


NOTHING = Wanted()


class DriveTopics:
    """The keys on which a drive is published: odometry, its transform, and the status of
    commands.
    """

    def __init__(
        self, bus: Bus, identity: Identity, drive: Drive, tf: Publisher[TFMessage]
    ) -> None:
        self._name = identity.name
        self._drive = drive
        self._tf = tf
        self._strafes = isinstance(drive.mechanism, PlanarDrive | Mecanum | Omni)
        frames = key_for("", identity.prefix)
        self._frame, self._base = (
            f"{frames}{drive.odometry_frame}",
            f"{frames}{drive.robot_base_frame}",
        )
        self._variances = covariance(drive)
        odometry_key = key_for(drive.odometry_topic, identity.prefix)
        self._odom: Publisher[Odometry] = bus.publisher(odometry_key, Odometry)
        self._status: Publisher[CommandStatus] = bus.publisher(
            f"{identity.command_key}_status", CommandStatus
        )

    def poll_status_wanted(self) -> bool:
        """Whether anyone wants the command status."""
        return self._status.poll_wanted()

    def publish_status(self, status: CommandStatus) -> None:
        """Publish a command status, completed by what the drive is."""
        status.name, status.strafes = self._name, self._strafes
        status.max_linear = min(status.max_linear, self._drive.max_linear)
        status.max_angular = min(status.max_angular, self._drive.max_angular)
        self._status.put(status)

    def poll_wanted(self) -> Wanted:
        """What anyone wants now."""
        drive = self._drive
        return Wanted(
            drive.publish_odom and self._odom.poll_wanted(),
            drive.publish_odom_tf and self._tf.poll_wanted(),
        )

    def start(self, moved: Moved) -> None:
        """The robot has a new body, which stands in the state `moved`."""
        self._start = moved[:2]

    def publish(self, stamp: Time, moved: Moved, wanted: Wanted) -> None:
        """Publish what is `wanted`."""
        position, rotation, velocity = self._measured(stamp, moved)
        header = Header(stamp, self._frame)
        if wanted.odometry:
            self._odom.queue(
                odometry(header, self._base, position, rotation, velocity, self._variances)
            )
        if wanted.transform:
            self._tf.queue(TFMessage([transform(header, self._base, position, rotation)]))

    def _measured(self, stamp: Time, moved: Moved) -> Moved:
        """The state for odometry: relative to the start, and with noise, if the file says so. The
        noise depends on the stamp alone, so that all readers get the same.
        """
        ((x, y, z), rotation, velocity), noise = moved, self._drive.odometry_noise
        if self._drive.odometry_from_start:
            (x0, y0, z0), back = self._start[0], conjugate(self._start[1])
            (x, y, z), rotation = rotate(back, (x - x0, y - y0, z - z0)), multiply(back, rotation)
        if noise:
            random = Random(f"{self._name} {stamp.sec} {stamp.nanosec}")
            dx, dy, turn, vx, vy, rate = (random.gauss(0.0, noise) for _ in range(6))
            x, y, rotation = (
                x + dx,
                y + dy,
                multiply(from_axis_angle((0.0, 0.0, 1.0), turn), rotation),
            )
            velocity = velocity[0] + vx, velocity[1] + vy, velocity[2] + rate
        return (x, y, z), rotation, velocity

    def close(self) -> None:
        """Close the keys."""
        for publisher in (self._odom, self._status):
            publisher.close()
