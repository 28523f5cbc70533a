"""What a robot publishes: odometry, joint states, transforms, sensors, and the status of its
commands.
"""

import math

from holozen.bus import Bus
from holozen.command.collision_monitor import CollisionMonitor
from holozen.messages import CommandStatus, TFMessage, Time
from holozen.robot.model import STEP
from holozen.transport.pubsub import Publisher
from holozen.wire import key_for

from .actuators import Actuators
from .identity import Identity
from .io.sensor_topics import SensorTopics, Step, Surroundings
from .io.topics import JOINT_RATE, NOTHING, DriveTopics, JointTopics
from .schedule import Schedule

DEMAND_CHECK = 0.1  # s of sim time between two checks whether anyone reads unread joints


class Telemetry:
    """The keys on which one robot is published.

    Attributes:
        joint_names: The names of its moving joints.
    """

    def __init__(
        self,
        bus: Bus,
        identity: Identity,
        actuators: Actuators,
        around: Surroundings,
        phase: float,
        monitor: CollisionMonitor | None,
    ) -> None:
        """`phase`, from 0 to 1, shifts it in time from that of other robots. `monitor` drives by
        its sensors.
        """
        model = identity.model
        self._actuators = actuators
        self._tf: Publisher[TFMessage] = bus.publisher(key_for("tf", identity.namespace), TFMessage)
        self._drive = DriveTopics(bus, identity, model.drive, self._tf) if model.drive else None
        self._odometry_due = Schedule(model.drive.odometry_rate if model.drive else 0.0, phase)
        self._joints = JointTopics(bus, identity, actuators.mover.names, self._tf)
        self._joints_due = Schedule(JOINT_RATE, phase)
        self._joint_demand_due = 0.0  # s of sim time; when to look again whether anyone reads them
        self._sensors: SensorTopics | None = None
        if model.sensors:
            self._sensors = SensorTopics(bus, identity, around, phase, monitor)
        self.joint_names = self._joints.names
        self.start()

    def start(self) -> None:
        """Begin odometry anew: the body is a new one, which stands."""
        if self._drive:
            self._drive.start(self._actuators.mover.moved(0.0, STEP))

    def reset(self) -> None:
        """The world was reset: what it publishes is due at once."""
        self._joint_demand_due = 0.0
        if self._sensors:
            self._sensors.reset()

    @property
    def odometry_rate(self) -> float:
        """The rate of odometry in Hz of sim time."""
        return self._odometry_due.rate

    def set_odometry_rate(self, rate: float) -> None:
        """Set the rate of odometry in Hz of sim time. It is due at once."""
        self._odometry_due.set_rate(rate)
        self._joint_demand_due = 0.0

    def publish_status(self, status: CommandStatus) -> None:
        """Publish the command status, if there is a drive."""
        if self._drive:
            self._drive.publish_status(status)

    def poll_status_wanted(self) -> bool:
        """Whether anyone wants the command status."""
        return self._drive is not None and self._drive.poll_status_wanted()

    def publish(self, time: float, dt: float) -> float:
        """Queue what is wanted and due at the sim time `time` after a step of `dt` (s). Returns
        when anything is due again. Raises ValueError if its position is not finite.
        """
        is_odometry_due = self._odometry_due.advance(time)
        are_joints_due = time >= self._joint_demand_due and self._joints_due.advance(time)
        if self._sensors and time >= self._sensors.next:
            self._sensors.publish(Step(time, round(time / dt)), self._actuators.link_states)
        self._queue(time, dt, is_odometry_due, are_joints_due)
        return self._next()

    def publish_all(self, time: float, dt: float) -> float:
        """Queue all that is wanted, whether it is due or not, except what sensors measure: no time
        has passed. Returns when anything is due again. Raises ValueError if its position is not
        finite.
        """
        self._odometry_due.advance(time)
        self._joints_due.advance(time)
        self._queue(time, dt, odometry=True, joints=True)
        return self._next()

    def _next(self) -> float:
        joints = max(self._joints_due.next, self._joint_demand_due)
        sensors = self._sensors.next if self._sensors else math.inf
        return min(self._odometry_due.next, joints, sensors)

    def _queue(self, time: float, dt: float, odometry: bool, joints: bool) -> None:
        """Queue what of these anyone wants."""
        drive = self._drive if odometry else None
        wanted = drive.poll_wanted() if drive else NOTHING
        if joints and not self._joints.poll_wanted():
            joints, self._joint_demand_due = False, time + DEMAND_CHECK
        mover = self._actuators.mover
        if mover.body.glides and not joints and wanted == NOTHING:
            return  # it has neither encoders nor wheels that have to be kept up to date
        stamp, moved = Time.of(time), mover.moved(time, dt)
        if not math.isfinite(sum(moved[0])):  # encoding would find it, but only for a reader
            raise ValueError(f"its position became {moved[0]}")
        if drive:
            drive.publish(stamp, moved, wanted)
        if joints:
            self._joints.publish(stamp, mover.states())

    def close(self) -> None:
        """Close the keys."""
        if self._drive:
            self._drive.close()
        self._joints.close()
        self._tf.close()
        if self._sensors:
            self._sensors.close()
