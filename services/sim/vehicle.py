"""A robot in the world: what it hears on its keys, what it does at a step, and what it tells."""

from holozen.bus import Bus, Publisher
from holozen.errors import ServiceError
from holozen.messages import (
    CommandStatus,
    Header,
    JointState,
    Odometry,
    TFMessage,
    Time,
    TriggerReply,
    TriggerRequest,
    Twist,
    TwistStamped,
)
from holozen.readers import Subscription
from holozen.robot.model import Drive, RobotModel
from holozen.wire import MAX_COMMAND_BYTES, key_for

from .intake import Intake
from .reports import JointFrames, Schedule, covariance, odometry, transform
from .wheels import Wheels
from .world import PlanarBody

JOINT_RATE = 50.0  # Hz of sim time
STATUS_RATE = 10.0  # Hz of real time: it is for people


class Vehicle:
    """A robot with a planar_move drive. `robot` is its name, empty for the one at the root of the keys."""

    def __init__(self, bus: Bus, robot: str, model: RobotModel, drive: Drive, body: PlanarBody, intake: Intake) -> None:
        self.body, self._intake, self._drive = body, intake, drive
        self._prefix = key_for("", robot)
        self._variances = covariance(drive)
        self._wheels, self._frames = Wheels(model), JointFrames(model, self._prefix)
        self._rolled = 0.0  # sim time up to which the wheels have turned
        self._now = 0.0
        command = key_for(drive.command_topic, robot)
        place = command.rpartition("/")[0]  # a namespace in the robot's file is as good as a name
        self._commands: Subscription[Twist | TwistStamped] = bus.subscribe(
            command, Twist, TwistStamped, limit=MAX_COMMAND_BYTES
        )
        self._resume = bus.serve(key_for("resume", place), TriggerRequest, TriggerReply, self._on_resume)
        self._odom: Publisher[Odometry] = bus.publisher(key_for(drive.odometry_topic, robot), Odometry)
        self._joints: Publisher[JointState] = bus.publisher(key_for("joint_states", place), JointState)
        self._tf: Publisher[TFMessage] = bus.publisher(key_for("tf", place), TFMessage)
        self._status: Publisher[CommandStatus] = bus.publisher(f"{command}_status", CommandStatus)
        self._odom_due, self._joints_due = Schedule(drive.odometry_rate), Schedule(JOINT_RATE)
        self._status_due = Schedule(STATUS_RATE)

    def hear(self, now: float, clocks: tuple[float, ...], since: float) -> None:
        """Take what waits at `now`; it came after `since`. `clocks` are those of stamps. All in seconds."""
        self._now = now
        while (received := self._commands.try_recv()) is not None:
            self._intake.take(received, now, clocks, since)
        self._resume.answer_pending()
        if self._status_due.due(now):
            self._status.put(self._intake.status(now))

    def move(self, now: float, dt: float) -> None:
        """Set the commanded velocity for the next step of `dt` seconds."""
        self.body.drive(self._intake.arbiter.velocity(now), dt)

    def tell(self, time: float, dt: float) -> None:
        """Publish what is due at the sim time `time`, after a step of `dt` seconds."""
        odom_due, joints_due = self._odom_due.due(time), self._joints_due.due(time)
        if not (odom_due or joints_due):
            return
        velocity, stamp = self.body.velocity(dt), Time.of(time)
        self._wheels.roll(velocity, time - self._rolled)
        self._rolled = time
        if odom_due:
            self._tell_odom(stamp, velocity)
        if joints_due:
            self._tell_joints(stamp)

    def _tell_odom(self, stamp: Time, velocity: tuple[float, float, float]) -> None:
        position, rotation = self.body.pose()
        header = Header(stamp, f"{self._prefix}{self._drive.odometry_frame}")
        base = f"{self._prefix}{self._drive.robot_base_frame}"
        if self._drive.publish_odom:
            self._odom.put(odometry(header, base, position, rotation, velocity, self._variances))
        if self._drive.publish_odom_tf:
            self._tf.put(TFMessage([transform(header, base, position, rotation)]))

    def _tell_joints(self, stamp: Time) -> None:
        wheels = self._wheels
        angles = dict(zip(wheels.names, wheels.angles, strict=True))
        self._joints.put(JointState(Header(stamp), wheels.names, wheels.angles, wheels.rates))
        self._tf.put(TFMessage(self._frames.transforms(stamp, angles)))

    def _on_resume(self, _request: TriggerRequest) -> TriggerReply:
        if reason := self._intake.arbiter.resume(self._now):
            raise ServiceError(reason)
        return TriggerReply(True, "every source may drive")
