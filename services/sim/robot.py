"""A robot in the world: reads commands from its keys, moves at each step, publishes its state."""

import math

from holozen.bus import Bus
from holozen.messages import TFMessage, Time
from holozen.robot.model import Balancing, Differential, RobotModel
from holozen.transport.pubsub import Publisher
from holozen.wire import COMMAND_SILENCE, key_for

from .command.arbiter import Arbiter
from .command.freshness import Senders
from .command.inputs import CommandStats, JointInput, TwistInput
from .command.motion import JointMotion
from .io.robot_services import RobotServices
from .io.topics import JOINT_RATE, DriveTopics, JointTopics, Schedule
from .physics.jointed import JointedBody, Motors
from .physics.movers import Mover

POLL = 0.004  # s; a sim that runs fast does not read joint commands and requests at every step

Memory = tuple[Arbiter, Arbiter]


class Robot:
    """A robot with a drive, with joints, or with both.

    `name` is its name in the world, `prefix` that on the wire, which is empty at the root. `phase`, from 0 to 1, sets
    its telemetry apart from that of others in time.
    """

    def __init__(
        self, bus: Bus, name: str, prefix: str, model: RobotModel, mover: Mover, limits: tuple[float, float],
        senders: Senders, phase: float = 0.0,
    ) -> None:  # fmt: skip
        self.mover, self._bus = mover, bus
        drive = model.drive
        command = command_key(model, prefix)
        namespace = command.rpartition("/")[0]  # a namespace in the robot's file serves as a name
        self.arbiter = Arbiter(drive.command_timeout if drive else COMMAND_SILENCE)
        self.joint_arbiter = Arbiter(COMMAND_SILENCE)
        self._wheels, self._others = _motors(mover, model)
        self._tf: Publisher[TFMessage] = bus.publisher(key_for("tf", namespace), TFMessage)
        self.prefix = prefix
        self._input = twist_input = TwistInput(command, self.arbiter, senders, *limits, others=_aliases(model, prefix))
        self._drive = DriveTopics(bus, prefix, name, drive, twist_input, self._tf) if drive else None
        pairs = ((self._wheels, self.arbiter), (self._others, self.joint_arbiter))
        groups = [(motors.names, arbiter) for motors, arbiter in pairs if motors]
        stats = twist_input.stats if drive else CommandStats()
        joint_input = JointInput(key_for("joint_command", namespace), senders, stats, groups, mover.names)
        self._sifters = (twist_input.freshness, joint_input.freshness)
        self._joints = JointTopics(bus, namespace, model, mover.names, prefix, joint_input, self._tf)
        self._services = RobotServices(bus, command, self.memory, self._publish_status)
        self._polled = self._now = 0.0  # when joint commands and requests were last read, and when commands were
        self._jointed = mover.body if isinstance(mover.body, JointedBody) else None
        self._odom_due = Schedule(drive.odometry_rate if drive else 0.0, phase)
        self._joints_due = Schedule(JOINT_RATE, phase)
        self.publishes_at = -math.inf  # s of sim time from when on `publish` has something to do

    @property
    def memory(self) -> Memory:
        """Held sources and the software stop, for the robot that replaces this one."""
        return self.arbiter, self.joint_arbiter

    def inherit(self, memory: Memory) -> None:
        """Take over the held sources and the software stop of the robot that this one replaces."""
        for arbiter, other in zip(self.memory, memory, strict=True):
            arbiter.inherit(other)

    def read_commands(self, now: float, clocks: tuple[float, ...], since: float) -> None:
        """Process the commands that wait at `now` and came after `since`. `clocks`: the times that stamps may be
        measured by. All in seconds.
        """
        self._now, drive = now, self._drive
        if drive and ((first := drive.listen()) is not None or drive.is_waiting):
            drive.read_commands(first, now, clocks, since)
        if now - self._polled >= POLL:
            self._joints.read_commands(now, min(since, self._polled or since))
            self._services.answer(now)
            if drive and now >= drive.status_at:
                drive.publish_status(now)
            self._polled = now

    @property
    def command_keys(self) -> tuple[str, ...]:
        """The keys of its commands."""
        return (*self._input.keys, self._joints.command_key)

    @property
    def drives(self) -> bool:
        """Whether cmd_vel moves it."""
        return self._drive is not None

    def limit(self, linear: float, angular: float) -> None:
        """Clamp the next commands to these limits, in m/s and rad/s."""
        self._input.linear, self._input.angular = linear, angular

    def require_age(self, limit: float) -> None:
        """Refuse what moves the robot and may be older than `limit` seconds, from the next command on."""
        for freshness in self._sifters:
            freshness.max_age = limit

    def set_timeout(self, timeout: float) -> None:
        """Stop after `timeout` seconds without a command, from now on."""
        self.arbiter.set_timeout(timeout, self._now)

    def forget(self, source: str, session: str) -> None:
        """Stop if `source` drives: its process, that of `session`, is gone. Its last commands are read first.

        A token of another session under the same name is a forgery, and changes nothing.
        """
        self._joints.read_commands(self._now, self._polled)
        if all(freshness.is_session(source, session) for freshness in self._sifters):
            for arbiter in self.memory:
                arbiter.forget(source)

    def has_to_move(self, now: float) -> bool:
        """Whether the next step needs `move`; else the robot goes on as it was told last."""
        return not self.mover.body.glides or now > self.arbiter.due or not (self._drive and self._drive.is_steady)

    def move(self, now: float, dt: float) -> None:
        """Apply the commands to the next step of `dt` seconds."""
        if self._drive:
            motion = self._drive.motion(now, dt)
            if not isinstance(motion, JointMotion):
                if self._wheels:
                    self._wheels.forget()
                self.mover.move(motion, dt)
            elif self._wheels:
                self._wheels.do(motion)
        if self._others:
            commanded = self.joint_arbiter.motion(now)
            self._others.do(commanded if isinstance(commanded, JointMotion) else None)
        if self._jointed:
            self._jointed.mimic()

    @property
    def odometry_rate(self) -> float:
        """The rate of odometry in Hz of sim time."""
        return self._odom_due.rate

    def set_odometry_rate(self, rate: float) -> None:
        """Set the rate of odometry in Hz of sim time."""
        self._odom_due.set_rate(rate)
        self.publishes_at = -math.inf

    def publish(self, time: float, dt: float) -> None:
        """Publish what is due at the sim time `time`, after a step of `dt` seconds, and wanted."""
        drive = self._drive if self._odom_due.due(time) else None
        joints = self._joints if self._joints_due.due(time) else None
        self.publishes_at = min(self._odom_due.next, self._joints_due.next)
        wanted = (drive and drive.wanted) or (joints and joints.wanted)
        if self.mover.body.glides and not wanted:
            return  # else encoders, and the wheels for the eye, count on whoever looks
        stamp, moved = Time.of(time), self.mover.moved(time, dt)
        if not math.isfinite(sum(moved[0])):  # nobody may read, and so nobody encode, what would show it
            raise ValueError(f"its position became {moved[0]}")
        if drive:
            drive.publish(stamp, moved)
        if joints and joints.wanted:
            joints.publish(stamp, self.mover.states())

    def close(self) -> None:
        """Close its keys."""
        if self._drive:
            self._drive.close()
        self._joints.close()
        self._services.close()
        self._tf.close()

    def _publish_status(self) -> None:
        if self._drive:
            self._drive.publish_status(self._now, at_once=True)


def command_key(model: RobotModel, prefix: str) -> str:
    """The command key of a robot with this `prefix`; all its other keys but odometry share the same namespace."""
    return key_for(model.drive.command_topic if model.drive else "cmd_vel", prefix)


def keys_of(model: RobotModel, prefix: str) -> list[str]:
    """All keys of a robot with this `prefix`; no other robot may have one of them."""
    command = command_key(model, prefix)
    namespace = command.rpartition("/")[0]
    keys = [key_for(key, namespace) for key in ("tf", "joint_states", "joint_command", *RobotServices.VERBS)]
    if model.drive:
        odometry = key_for(model.drive.odometry_topic, prefix)
        keys += [command, f"{command}_status", odometry, *_aliases(model, prefix)]
    return keys


def _aliases(model: RobotModel, prefix: str) -> tuple[str, ...]:
    """More keys for commands: wheely_boi's plugin listens on `cmd` below its model's name, twice."""
    name = prefix or model.name
    return (f"{name}/{name}/cmd",) if model.drive and isinstance(model.drive.mechanism, Balancing) else ()


def _motors(mover: Mover, model: RobotModel) -> tuple[Motors | None, Motors | None]:
    """The motors of the wheels and of the other joints; None where commands cannot move any."""
    if not isinstance(mover.body, JointedBody):
        return None, None
    mechanism = model.drive.mechanism if model.drive else None
    wheels = others = None
    if isinstance(mechanism, Differential) and mover.wheels:
        wheels = Motors(mover.body, mover.wheels, mechanism.torque, together=True)
    if free := frozenset(mover.names) - mover.wheels - mover.kept:
        others = Motors(mover.body, free)
    return wheels, others
