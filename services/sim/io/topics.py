"""The keys of a robot's drive: commands in, odometry and status out."""

from collections.abc import Mapping

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
        arrived = list(iter(self._commands.try_recv, None))
        if arrived or self._input.freshness.is_waiting:
            self._input.take(arrived, now, since)

    def publish(self, stamp: Time, states: tuple[list[float], list[float]]) -> None:
        """Publish the joints' positions and rates, and the transforms of the links."""
        positions, rates = states
        self._states.put(JointState(Header(stamp), self.names, positions, rates))
        transforms = self._frames.transforms(stamp, dict(zip(self.names, positions, strict=True)))
        self._tf.put(TFMessage(transforms))

    def close(self) -> None:
        """Close the keys."""
        self._commands.close()
        self._states.close()


UNKNOWN = 1e12  # m^2, rad^2; Gazebo's variance of what planar_move does not control


class Schedule:
    """When something with a rate in Hz is due, on a monotonic clock in seconds."""

    def __init__(self, rate: float) -> None:
        self.set_rate(rate)

    def set_rate(self, rate: float) -> None:
        """Set the rate; it is due at once."""
        self.rate, self._count = rate, -1

    def due(self, time: float) -> bool:
        """Whether a new period has begun since the last call."""
        count = int(time * self.rate + 1e-6)
        began = count > self._count
        self._count = count
        return began


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
        self._odom: Publisher[Odometry] = bus.publisher(key_for(drive.odometry_topic, prefix), Odometry)
        self._status: Publisher[CommandStatus] = bus.publisher(f"{command}_status", CommandStatus)
        self._status_due = Schedule(STATUS_RATE)

    def read_commands(self, now: float, clocks: tuple[float, ...], since: float) -> None:
        """Process the commands that wait at `now` and came after `since`. `clocks`: the times that stamps may be
        measured by. All in seconds.
        """
        arrived = [received for commands in self._commands for received in iter(commands.try_recv, None)]
        if arrived or self._input.freshness.is_waiting:
            self._input.take(arrived, now, clocks, since)

    def publish_status(self, now: float, at_once: bool = False) -> None:
        """Publish the command status, when it is due or `at_once`."""
        if self._status_due.due(now) or at_once:
            status, drive = self._input.status(now), self._drive
            status.name, status.strafes = self._name, self._strafes
            status.max_linear = min(self._input.linear, drive.max_linear)
            status.max_angular = min(self._input.angular, drive.max_angular)
            self._status.put(status)

    def motion(self, now: float, dt: float) -> Planar | JointMotion:
        """The commanded motion of the next step of `dt` seconds, within the limits of its file."""
        motion = self._input.arbiter.motion(now)
        if isinstance(motion, JointMotion):
            self._limited(STOP, dt)
            return motion
        return self._limited(motion, dt)

    def publish(self, stamp: Time, moved: Moved) -> None:
        """Publish odometry."""
        position, rotation, velocity = moved
        header = Header(stamp, f"{self._frames}{self._drive.odometry_frame}")
        base = f"{self._frames}{self._drive.robot_base_frame}"
        if self._drive.publish_odom:
            self._odom.put(odometry(header, base, position, rotation, velocity, self._variances))
        if self._drive.publish_odom_tf:
            self._tf.put(TFMessage([transform(header, base, position, rotation)]))

    def close(self) -> None:
        """Close the keys."""
        for commands in self._commands:
            commands.close()
        for publisher in (self._odom, self._status):
            publisher.close()
