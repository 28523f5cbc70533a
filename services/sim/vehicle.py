"""A robot in the world: what it hears on its keys, what it does at a step, and what it tells."""

from holozen.bus import Bus, Publisher
from holozen.messages import TFMessage, Time
from holozen.robot.drives import Balancing
from holozen.robot.model import Drive, RobotModel
from holozen.wire import COMMAND_SILENCE, key_for

from .arbiter import Arbiter
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


class Vehicle:
    """A robot with a drive, with joints, or with both. `prefix` is its name on the wire, empty at the root."""

    def __init__(self, bus: Bus, prefix: str, model: RobotModel, mover: Mover, limits: tuple[float, float]) -> None:
        self.mover = mover
        drive = model.drive
        command = key_for(drive.command_topic if drive else "cmd_vel", prefix)
        place = command.rpartition("/")[0]
        self.arbiter = wheels = Arbiter(drive.command_timeout if drive else COMMAND_SILENCE)
        self._other_arbiter = others = Arbiter(COMMAND_SILENCE)
        intake = Intake(command, wheels, *limits, others=_aliases(drive, prefix or model.name))
        self._wheels, self._others = _motors(mover)
        self._tf: Publisher[TFMessage] = bus.publisher(key_for("tf", place), TFMessage)
        self._drive = DriveKeys(bus, prefix, drive, intake, self._tf, others) if drive else None
        pairs = ((self._wheels, wheels), (self._others, others))
        groups = [(motors.names, arbiter) for motors, arbiter in pairs if motors]
        ledger = intake.ledger if drive else Ledger()
        hands = JointIntake(key_for("joint_command", place), ledger, groups, mover.names)
        self._joints = JointKeys(bus, place, model, mover.names, prefix, hands, self._tf)
        self._looked = 0.0  # when joint commands and calls were heard last
        self._jointed = mover.body if isinstance(mover.body, JointedBody) else None
        self._odom_due = Schedule(drive.odometry_rate if drive else 0.0)
        self._joints_due = Schedule(JOINT_RATE)

    def hear(self, now: float, clocks: tuple[float, ...], since: float) -> None:
        """Take what waits at `now`; it came after `since`. `clocks` are those of stamps. All in seconds."""
        if self._drive:
            self._drive.hear(now, clocks, since)
        if now - self._looked >= LOOK:
            self._joints.hear(now, min(since, self._looked or since))
            if self._drive:
                self._drive.answer(now)
            self._looked = now

    def move(self, now: float, dt: float) -> None:
        """Do what is commanded for the next step of `dt` seconds."""
        if self._drive:
            wanted = self._drive.wanted(now, dt)
            if self._wheels:
                self._wheels.do(wanted if isinstance(wanted, JointMotion) else None)
            if not isinstance(wanted, JointMotion):
                self.mover.move(wanted, dt)
        if self._others:
            motion = self._other_arbiter.motion(now)
            self._others.do(motion if isinstance(motion, JointMotion) else None)
        if self._jointed:
            self._jointed.mimic()

    def tell(self, time: float, dt: float) -> None:
        """Publish what is due at the sim time `time`, after a step of `dt` seconds."""
        odom_due, joints_due = self._odom_due.due(time), self._joints_due.due(time)
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
        self._tf.close()


def _aliases(drive: Drive | None, name: str) -> tuple[str, ...]:
    """More keys for commands: wheely_boi's plugin listens on `cmd` below its model's name, twice."""
    return (f"{name}/{name}/cmd",) if drive and isinstance(drive.mechanism, Balancing) else ()


def _motors(mover: Mover) -> tuple[Motors | None, Motors | None]:
    """Those of the wheels and those of the other joints, where commands may move them."""
    if not isinstance(mover.body, JointedBody):
        return None, None
    free = frozenset(mover.names) - mover.wheels - mover.kept
    return (Motors(mover.body, mover.wheels) if mover.wheels else None), (Motors(mover.body, free) if free else None)
