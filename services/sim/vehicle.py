"""A robot in the world: what it hears on its keys, what it does at a step, and what it tells."""

from holozen.bus import Bus
from holozen.messages import TFMessage, Time
from holozen.publisher import Publisher
from holozen.robot.drives import Balancing, Differential
from holozen.robot.model import RobotModel
from holozen.wire import COMMAND_SILENCE, key_for

from .arbiter import Arbiter
from .calls import Calls
from .drive_keys import DriveKeys
from .drives import Mover
from .intake import Intake
from .joint_intake import JointIntake
from .joint_keys import JOINT_RATE, JointKeys
from .jointed import JointedBody
from .joints import Motors
from .ledger import Ledger
from .motion import JointMotion
from .reports import Schedule

LOOK = 0.004  # s; joint commands and calls need not be heard at every step of a sim that runs fast

Memory = tuple[Arbiter, Arbiter]


class Vehicle:
    """A robot with a drive, with joints, or with both. `prefix` is its name on the wire, empty at the root."""

    def __init__(self, bus: Bus, prefix: str, model: RobotModel, mover: Mover, limits: tuple[float, float]) -> None:
        self.mover, self._bus = mover, bus
        drive = model.drive
        command = command_key(model, prefix)
        place = command.rpartition("/")[0]  # a namespace in the robot's file is as good as a name
        self.arbiter = Arbiter(drive.command_timeout if drive else COMMAND_SILENCE)
        self.joint_arbiter = Arbiter(COMMAND_SILENCE)
        self._wheels, self._others = _motors(mover, model)
        self._tf: Publisher[TFMessage] = bus.publisher(key_for("tf", place), TFMessage)
        self.prefix = prefix
        self._intake = intake = Intake(command, self.arbiter, *limits, others=_aliases(model, prefix))
        self._drive = DriveKeys(bus, prefix, drive, intake, self._tf) if drive else None
        pairs = ((self._wheels, self.arbiter), (self._others, self.joint_arbiter))
        groups = [(motors.names, arbiter) for motors, arbiter in pairs if motors]
        ledger = intake.ledger if drive else Ledger()
        hands = JointIntake(key_for("joint_command", place), ledger, groups, mover.names)
        self._joints = JointKeys(bus, place, model, mover.names, prefix, hands, self._tf)
        self._calls = Calls(bus, command, self.memory, self._tell_status)
        self._looked = self._now = 0.0  # when joint commands and calls were heard last, and commands
        self._jointed = mover.body if isinstance(mover.body, JointedBody) else None
        self.odom_due = Schedule(drive.odometry_rate if drive else 0.0)
        self._joints_due = Schedule(JOINT_RATE)

    @property
    def memory(self) -> Memory:
        """Who is held, and who stopped it, for the robot that takes the place of this one."""
        return self.arbiter, self.joint_arbiter

    def inherit(self, memory: Memory) -> None:
        """Hold whom the robot before this one held, and stand if it was stopped: replacing it frees nobody."""
        for arbiter, other in zip(self.memory, memory, strict=True):
            arbiter.inherit(other)

    def hear(self, now: float, clocks: tuple[float, ...], since: float) -> None:
        """Take what waits at `now`; it came after `since`. `clocks` are those of stamps. All in seconds."""
        self._now = now
        if self._drive:
            self._drive.hear(now, clocks, since)
        if now - self._looked >= LOOK:
            self._joints.hear(now, min(since, self._looked or since))
            self._calls.answer(now)
            if self._drive:
                self._drive.tell_status(now)
            self._looked = now

    @property
    def drives(self) -> bool:
        """Whether cmd_vel moves it."""
        return self._drive is not None

    def limit(self, linear: float, angular: float) -> None:
        """Clamp the next commands to these limits, in m/s and rad/s."""
        self._intake.linear, self._intake.angular = linear, angular

    def watch(self, timeout: float) -> None:
        """Stand after `timeout` seconds without a command, from now on."""
        self.arbiter.wait_for(timeout, self._now)

    def forget(self, source: str) -> None:
        """Stand, if `source` drives: its process is gone. What it said before is heard first."""
        self._joints.hear(self._now, self._looked)
        for arbiter in self.memory:
            arbiter.forget(source)

    def move(self, now: float, dt: float) -> None:
        """Do what is commanded for the next step of `dt` seconds."""
        if self._drive:
            wanted = self._drive.wanted(now, dt)
            if not isinstance(wanted, JointMotion):
                if self._wheels:
                    self._wheels.forget()
                self.mover.move(wanted, dt)
            elif self._wheels:
                self._wheels.do(wanted)
        if self._others:
            motion = self.joint_arbiter.motion(now)
            self._others.do(motion if isinstance(motion, JointMotion) else None)
        if self._jointed:
            self._jointed.mimic()

    def tell(self, time: float, dt: float) -> None:
        """Publish what is due at the sim time `time`, after a step of `dt` seconds."""
        odom_due, joints_due = self.odom_due.due(time), self._joints_due.due(time)
        if not (odom_due or joints_due):
            return
        stamp, moved = Time.of(time), self.mover.moved(time, dt)
        if odom_due and self._drive:
            self._drive.tell(stamp, moved)
        if joints_due:
            self._joints.tell(stamp, self.mover.states())

    def close(self) -> None:
        """Leave the wire."""
        if self._drive:
            self._drive.close()
        self._joints.close()
        self._calls.close()
        self._tf.close()

    def _tell_status(self) -> None:
        if self._drive:
            self._drive.tell_status(self._now, at_once=True)


def command_key(model: RobotModel, prefix: str) -> str:
    """Where a robot below `prefix` hears commands; all its other keys but odometry are beside it."""
    return key_for(model.drive.command_topic if model.drive else "cmd_vel", prefix)


def keys_of(model: RobotModel, prefix: str) -> list[str]:
    """All keys of a robot below `prefix`, none of which another one may have too."""
    command = command_key(model, prefix)
    place = command.rpartition("/")[0]
    keys = [key_for(key, place) for key in ("tf", "joint_states", "joint_command", *Calls.VERBS)]
    if model.drive:
        odometry = key_for(model.drive.odometry_topic, prefix)
        keys += [command, f"{command}_status", odometry, *_aliases(model, prefix)]
    return keys


def _aliases(model: RobotModel, prefix: str) -> tuple[str, ...]:
    """More keys for commands: wheely_boi's plugin listens on `cmd` below its model's name, twice."""
    name = prefix or model.name
    return (f"{name}/{name}/cmd",) if model.drive and isinstance(model.drive.mechanism, Balancing) else ()


def _motors(mover: Mover, model: RobotModel) -> tuple[Motors | None, Motors | None]:
    """Those of the wheels and those of the other joints, where commands may move them."""
    if not isinstance(mover.body, JointedBody):
        return None, None
    mechanism = model.drive.mechanism if model.drive else None
    wheels = others = None
    if isinstance(mechanism, Differential) and mover.wheels:
        wheels = Motors(mover.body, mover.wheels, mechanism.torque, together=True)
    if free := frozenset(mover.names) - mover.wheels - mover.kept:
        others = Motors(mover.body, free)
    return wheels, others
