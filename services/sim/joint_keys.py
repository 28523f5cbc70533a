"""The keys of a robot's joints: joint_command in, joint_states and tf out."""

from holozen.bus import Bus
from holozen.messages import Header, JointState, TFMessage, Time
from holozen.publisher import Publisher
from holozen.robot.model import RobotModel
from holozen.wire import MAX_COMMAND_BYTES, key_for

from .joint_intake import JointIntake
from .reports import JointFrames

JOINT_RATE = 50.0  # Hz of sim time


class JointKeys:
    """What a robot's joints hear and tell, their keys below `place`. `names` are those of the engine's joints."""

    def __init__(
        self, bus: Bus, place: str, model: RobotModel, names: list[str], prefix: str, intake: JointIntake,
        tf: Publisher[TFMessage],
    ) -> None:  # fmt: skip
        self._bus, self._intake, self._tf, self.names = bus, intake, tf, names
        self._frames = JointFrames(model, key_for("", prefix))
        self._commands = bus.subscribe(intake.key, JointState, limit=MAX_COMMAND_BYTES)
        self._states: Publisher[JointState] = bus.publisher(key_for("joint_states", place), JointState)

    def hear(self, now: float, since: float) -> None:
        """Take what waits at `now`; it came after `since`, in seconds."""
        while (received := self._commands.try_recv()) is not None:
            self._intake.take(received, now, since)

    def tell(self, stamp: Time, states: tuple[list[float], list[float]]) -> None:
        """Publish the joints' positions and rates, and where they put the links."""
        positions, rates = states
        self._states.put(JointState(Header(stamp), self.names, positions, rates))
        transforms = self._frames.transforms(stamp, dict(zip(self.names, positions, strict=True)))
        self._tf.put(TFMessage(transforms))

    def close(self) -> None:
        """Leave the wire."""
        self._bus.drop(self._commands)
        self._states.close()
