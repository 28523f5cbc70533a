"""The keys of a robot's drive: commands in, odometry and status out."""

from holozen.bus import Bus
from holozen.limits import STOP, Planar
from holozen.messages import (
    CommandStatus,
    Header,
    Odometry,
    TFMessage,
    Time,
    Twist,
    TwistStamped,
)
from holozen.publisher import Publisher
from holozen.readers import Subscription
from holozen.robot.model import Drive
from holozen.wire import MAX_COMMAND_BYTES, key_for

from .drives import Limited, Moved
from .intake import Intake
from .motion import JointMotion
from .reports import Schedule, covariance, odometry, transform

STATUS_RATE = 10.0  # Hz of real time: it is for people


class DriveKeys:
    """What a drive hears and tells, its keys in the place `prefix`, a robot's name or empty."""

    def __init__(self, bus: Bus, prefix: str, drive: Drive, intake: Intake, tf: Publisher[TFMessage]) -> None:
        self._bus, self._drive, self._intake, self._tf = bus, drive, intake, tf
        self._frames = key_for("", prefix)
        self._variances = covariance(drive)
        self._limited = Limited(drive)
        command = intake.keys[0]
        self._commands: list[Subscription[Twist | TwistStamped]] = [
            bus.subscribe(key, Twist, TwistStamped, limit=MAX_COMMAND_BYTES) for key in intake.keys
        ]
        self._odom: Publisher[Odometry] = bus.publisher(key_for(drive.odometry_topic, prefix), Odometry)
        self._status: Publisher[CommandStatus] = bus.publisher(f"{command}_status", CommandStatus)
        self._status_due = Schedule(STATUS_RATE)

    def hear(self, now: float, clocks: tuple[float, ...], since: float) -> None:
        """Take what waits at `now`; it came after `since`. `clocks` are those of stamps. All in seconds."""
        for commands in self._commands:
            while (received := commands.try_recv()) is not None:
                self._intake.take(received, now, clocks, since)

    def tell_status(self, now: float, at_once: bool = False) -> None:
        """Publish who drives, when it is due or `at_once`."""
        if self._status_due.due(now) or at_once:
            self._status.put(self._intake.status(now))

    def wanted(self, now: float, dt: float) -> Planar | JointMotion:
        """What the robot is told to do in the next step of `dt` seconds, within the limits of its file."""
        motion = self._intake.arbiter.motion(now)
        if isinstance(motion, JointMotion):
            self._limited(STOP, dt)
            return motion
        return self._limited(motion, dt)

    def tell(self, stamp: Time, moved: Moved) -> None:
        """Publish odometry."""
        position, rotation, velocity = moved
        header = Header(stamp, f"{self._frames}{self._drive.odometry_frame}")
        base = f"{self._frames}{self._drive.robot_base_frame}"
        if self._drive.publish_odom:
            self._odom.put(odometry(header, base, position, rotation, velocity, self._variances))
        if self._drive.publish_odom_tf:
            self._tf.put(TFMessage([transform(header, base, position, rotation)]))

    def close(self) -> None:
        """Leave the wire."""
        for commands in self._commands:
            self._bus.drop(commands)
        for publisher in (self._odom, self._status):
            publisher.close()
