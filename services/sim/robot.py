"""A robot in the world: it reads commands from its keys, moves at each step, and publishes its state."""

import math
import time
from collections.abc import Callable
from functools import partial

from holozen.bus import Bus
from holozen.command.arbiter import Arbiter, CommandTime
from holozen.command.freshness import Senders
from holozen.command.inputs import CommandStats, ForceInput, JointInput, ReportLimit, TwistInput
from holozen.command.motion import JointMotion
from holozen.command.stop_services import RobotServices
from holozen.command.wait_set import Reader
from holozen.messages import TFMessage, Time, Wrench
from holozen.robot.keys import aliases, command_key
from holozen.robot.model import STEP, Differential, Force, Pushed, RobotModel
from holozen.suggest import listed
from holozen.transport.pubsub import Publisher
from holozen.wire import COMMAND_SILENCE, MAX_COMMAND_BYTES, key_for

from .io.sensor_topics import LinkStates, SensorTopics, Step, Surroundings
from .io.topics import JOINT_RATE, NONE, DriveTopics, JointTopics
from .link_states import LinkState, link_tree
from .physics.jointed import Forces, JointedBody, Motors
from .physics.movers import Mover
from .schedule import Agenda, Schedule

IDLE = 0.1  # s of sim time; how often it checks whether anyone reads the joints, while no one does

Memory = tuple[Arbiter, Arbiter, Arbiter]
REPORTS = ReportLimit()  # of all robots
NO_DRIVE = "no drive: this robot is moved by forces, on {keys}"


class Robot:
    """A robot with a drive, with joints, or with both.

    `name` is its name in the world, `prefix` the one on the wire, which is empty at the root. `phase`, from 0 to 1,
    shifts its telemetry in time from that of others. `keep_stop` is called at each stop and release, and returns why
    that is not kept, or "".
    """

    def __init__(
        self, bus: Bus, name: str, prefix: str, model: RobotModel, mover: Mover, limits: tuple[float, float],
        senders: Senders, phase: float, time: CommandTime, keep_stop: Callable[[], str],
    ) -> None:  # fmt: skip
        self._model, self.prefix = model, prefix
        self._agenda: Agenda[Robot] = Agenda()  # unused, until `schedule_on`
        self._pushed_on: dict[str, list[Force]] = {}  # the forces by the keys of their commands
        for force in model.forces:
            self._pushed_on.setdefault(key_for(force.topic, prefix), []).append(force)
        self._set_body(mover)
        drive = model.drive
        command = command_key(model, prefix)
        namespace = command.rpartition("/")[0]  # the robot's file may give one in place of a name
        self.arbiter = Arbiter(drive.command_timeout if drive else COMMAND_SILENCE, time, namespace)
        self.arbiter.changed = self._activate
        self.joint_arbiter = Arbiter(COMMAND_SILENCE, time, namespace)
        self._spare = Arbiter(COMMAND_SILENCE, time, namespace)
        # If only forces move the robot, a stop on cmd_vel ends them. Else they disturb a robot that drives.
        self.force_arbiter = self._spare if self.drives else self.arbiter
        self.keys = command, key_for(drive.odometry_topic, prefix) if drive else ""  # of commands and odometry
        self._tf: Publisher[TFMessage] = bus.publisher(key_for("tf", namespace), TFMessage)
        refusal = "" if self.drives else NO_DRIVE.format(keys=listed(self._pushed_on))
        self._input = twist_input = TwistInput(
            command, self.arbiter, senders, *limits, others=aliases(model, prefix), refusal=refusal, limit=REPORTS
        )
        self._drive = DriveTopics(bus, prefix, name, drive, twist_input, self._tf) if drive else None
        if self._drive:
            self._drive.reset(mover.moved(0.0, STEP))
        pairs = ((self._wheels, self.arbiter), (self._others, self.joint_arbiter))
        self._obeys_joints = any(motors for motors, _ in pairs)
        groups = [(motors.names, arbiter) for motors, arbiter in pairs if motors]
        stats = twist_input.stats if drive else CommandStats(limit=REPORTS)
        joint_input = JointInput(key_for("joint_command", namespace), senders, stats, groups, mover.names)
        force_input = ForceInput(tuple(self._pushed_on), self.force_arbiter, senders, stats)
        self._filters = (twist_input.freshness, joint_input.freshness, force_input.freshness)
        self._pushes = [bus.subscribe(key, Wrench, limit=MAX_COMMAND_BYTES, dealt=True) for key in self._pushed_on]
        self._push_readers = [*map(force_input.reader, self._pushes)]
        self._of_members = bus.member is not None
        self._joints = JointTopics(bus, namespace, model, mover.names, prefix, joint_input, self._tf)
        self._services = RobotServices(bus, command, self.memory, partial(self._on_stop, keep_stop))
        self._odom_due = Schedule(drive.odometry_rate if drive else 0.0, phase)
        self._joints_due = Schedule(JOINT_RATE, phase)
        self._joints_at = -math.inf  # s of sim time; when to check again whether anyone reads the joints
        self._sensors: SensorTopics | None = None
        self._tree = link_tree(model)

    def schedule_on(self, agenda: "Agenda[Robot]") -> None:
        """Move to an agenda, on which everything is due at once."""
        self._agenda.forget(self)
        self._agenda = agenda
        self._activate()
        agenda.publishes.set(self, -math.inf)
        agenda.statuses.set(self, -math.inf)

    def add_sensors(self, bus: Bus, name: str, around: Surroundings, phase: float) -> None:
        """Publish what its sensors measure."""
        self._sensors = SensorTopics(bus, name, self.prefix, self._model.sensors, around, phase)

    def link_states(self) -> LinkStates:
        """The states of its links."""
        positions, rates = (dict(zip(self.mover.names, values, strict=True)) for values in self.mover.states()[:2])
        return self._tree.states(LinkState(*self.body.pose(), *self.body.twist()), positions, rates)

    @property
    def memory(self) -> Memory:
        """The arbiters, with the held sources and the software stop that a robot in its place inherits."""
        return self.arbiter, self.joint_arbiter, self._spare

    def inherit(self, memory: Memory, now: float) -> None:
        """Take over held sources and the software stop at `now` (s) from the robot that was in its place."""
        for arbiter, other in zip(self.memory, memory, strict=True):
            arbiter.inherit(other, now)

    @property
    def command_readers(self) -> list[Reader]:
        """The readers of all that moves or stops it."""
        drive = self._drive.readers if self._drive else []
        joints = self._joints.readers if self._obeys_joints else []
        return [*drive, *self._push_readers, *joints, *self._services.stop]

    @property
    def request_readers(self) -> list[Reader]:
        """The readers of its other services, and of joint commands if no joint obeys them: they are only refused."""
        return [*([] if self._obeys_joints else self._joints.readers), *self._services.others]

    def publish_status(self, now: float, at_once: bool = False) -> None:
        """Publish the command status at `now` (s), if anyone wants it or `at_once`."""
        if self._drive:
            self._drive.publish_status(now, at_once)

    def _on_stop(self, keep_stop: Callable[[], str], now: float) -> str:
        self.publish_status(now, at_once=True)
        return keep_stop()

    @property
    def is_waiting(self) -> bool:
        """Whether a command waits for its sender's clock."""
        return any(freshness.is_waiting for freshness in self._filters)

    def rebuild(self, mover: Mover) -> None:
        """Go on with a new body, which stands. Keys, held sources and the software stop remain."""
        self._set_body(mover)
        if self._drive:
            self._drive.reset(mover.moved(0.0, STEP))

    def _set_body(self, mover: Mover) -> None:
        self.mover, self.body = mover, mover.body
        self.body.woken = self._activate
        self._activate()
        self._wheels, self._others = _motors(mover, self._model)
        self._jointed = mover.body if isinstance(mover.body, JointedBody) else None
        brakes = None if self.drives else self._others
        pushed = self._jointed if self._pushed_on else None
        self._forces = Forces(pushed, self._pushed_on, self._model, brakes) if pushed else None

    def _activate(self) -> None:
        self._agenda.active[self] = None

    def reset(self) -> None:
        """The world was reset: only a new command moves it, and what it publishes is due at once."""
        self.drop_commands()
        self._joints_at = -math.inf
        self._agenda.publishes.set(self, -math.inf)
        if self._sensors:
            self._sensors.reset()

    def drop_commands(self, without_watchdog: bool = True) -> None:
        """Let only a new command move it. If its watchdog is off, only `without_watchdog`."""
        for arbiter in self.memory:
            arbiter.drop_driver(without_watchdog)
        if without_watchdog or self.arbiter.timeout >= 0:
            for freshness in self._filters:
                freshness.drop_waiting()

    @property
    def joint_names(self) -> list[str]:
        """The names of its moving joints."""
        return self._joints.names

    @property
    def joint_positions(self) -> list[float]:
        """The positions of these, in rad or m."""
        return self.mover.states()[0]

    @property
    def command_keys(self) -> tuple[str, ...]:
        """The keys of its commands."""
        return (*self._input.keys, self._joints.command_key, *self._pushed_on)

    @property
    def drives(self) -> bool:
        """Whether cmd_vel moves it."""
        return self._model.drive is not None and not isinstance(self._model.drive.mechanism, Pushed)

    def limit(self, linear: float, angular: float) -> None:
        """Clamp commands to these limits, in m/s and rad/s, from the next one on."""
        self._input.linear, self._input.angular = linear, angular

    def require_age(self, limit: float) -> None:
        """Refuse commands that may be older than `limit` seconds, except stops, from the next one on."""
        for freshness in self._filters:
            freshness.max_age = limit

    def forget(self, source: str, session: str) -> None:
        """Stop if `source` drives: its process, with this `session`, is gone. Its last commands have to be read before.

        If another session uses the same name, that is a forgery, and changes nothing.
        """
        if all(freshness.is_session(source, session) for freshness in self._filters):
            for arbiter in self.memory:
                arbiter.forget(source, self._of_members)

    def move(self, now: float, dt: float) -> None:
        """Apply the commands to the next step of `dt` seconds."""
        if self._drive and self.drives:
            motion = self._drive.motion(now, dt)
            if isinstance(motion, JointMotion):
                if self._wheels:
                    self._wheels.apply(motion)
            else:
                if self._wheels:
                    self._wheels.forget()
                self.mover.move(motion, dt)
        if self._forces:
            self._forces.apply(self.force_arbiter.pushes(now))
        if self._others:
            commanded = self.joint_arbiter.motion(now)
            self._others.apply(commanded if isinstance(commanded, JointMotion) else None)
        if self._jointed:
            self._jointed.mimic()

    @property
    def odometry_rate(self) -> float:
        """The rate of odometry in Hz of sim time."""
        return self._odom_due.rate

    def set_odometry_rate(self, rate: float) -> None:
        """Set the rate of odometry in Hz of sim time."""
        self._odom_due.set_rate(rate)
        self._joints_at = -math.inf
        self._agenda.publishes.set(self, -math.inf)

    def publish(self, time: float, dt: float, at_once: bool = False) -> None:
        """Queue all telemetry that is wanted and, unless `at_once`, due at the sim time `time` after a step of `dt`
        (s).
        """
        drive = self._drive if self._odom_due.due(time) or at_once else None
        wanted = drive.wanted if drive else NONE
        joints = None
        if time >= self._joints_at or at_once:
            joints = self._joints if self._joints_due.due(time) or at_once else None
            if joints and not joints.wanted:
                joints, self._joints_at = None, time + IDLE
        next_at = min(self._odom_due.next, max(self._joints_due.next, self._joints_at))
        if self._sensors:
            if time >= self._sensors.next and not at_once:  # no time has passed: there is nothing new to measure
                self._sensors.publish(Step(time, round(time / dt)), self.link_states)
            next_at = min(next_at, self._sensors.next)
        self._agenda.publishes.set(self, next_at)
        if self.body.glides and not joints and wanted == NONE:
            return  # gliding robots have neither encoders nor wheels that have to be kept up to date
        stamp, moved = Time.of(time), self.mover.moved(time, dt)
        if not math.isfinite(sum(moved[0])):  # encoding would find it too, but only if there is a reader
            raise ValueError(f"its position became {moved[0]}")
        if drive:
            drive.publish(stamp, moved, wanted)
        if joints:
            joints.publish(stamp, self.mover.states())

    def close(self) -> None:
        """Close its keys. Its `memory` is then for the next robot of that name to inherit."""
        for arbiter in self.memory:
            arbiter.settle(time.monotonic())
        self.schedule_on(Agenda())
        if self._drive:
            self._drive.close()
        self._joints.close()
        for pushes in self._pushes:
            pushes.close()
        self._services.close()
        self._tf.close()
        if self._sensors:
            self._sensors.close()


def _motors(mover: Mover, model: RobotModel) -> tuple[Motors | None, Motors | None]:
    """The motors of the wheels and of the other joints; None if commands cannot move any."""
    if not isinstance(mover.body, JointedBody):
        return None, None
    mechanism = model.drive.mechanism if model.drive else None
    wheels = others = None
    if mover.wheels:
        torque = mechanism.torque if isinstance(mechanism, Differential) else math.inf
        wheels = Motors(mover.body, mover.wheels, torque, together=True)
    if free := frozenset(mover.names) - mover.wheels - mover.reserved:
        others = Motors(mover.body, free)
    return wheels, others
