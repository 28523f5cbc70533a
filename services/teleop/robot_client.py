"""The keys of one robot on the bus: commands out, odometry and status in."""

import time

from holozen.bus import Bus
from holozen.messages import CommandStatus, Header, Time, Twist, TwistStamped
from holozen.odometry import LOST, RobotFeedback
from holozen.transport.pubsub import Publisher
from holozen.wire import PRIORITY_OF, key_for


class RobotClient:
    """A robot to drive. Its other keys are siblings of `command`, its command key; `stamped` is as for Session."""

    def __init__(self, bus: Bus, robot: str, command: str, stamped: str | None) -> None:
        self.robot, self.key = robot, command or key_for("cmd_vel", robot)
        self._stamped = stamped
        kind: type[Twist] | type[TwistStamped] = Twist if stamped is None else TwistStamped
        self._commands: Publisher[Twist | TwistStamped] = bus.publisher(self.key, kind, PRIORITY_OF["teleop"])
        self.odom = RobotFeedback(bus, self.beside("odom"))
        self.status_key = f"{self.key}_status"
        self.name = ""  # in the sim; empty while it is not known
        self._status = bus.latest(self.status_key, CommandStatus)

    def beside(self, name: str) -> str:
        """The robot's key with this name, beside its command key."""
        return key_for(name, self.key.rpartition("/")[0])

    def put(self, twist: Twist) -> None:
        """Publish a command."""
        if self._stamped is None:
            self._commands.put(twist)
        else:
            self._commands.put(TwistStamped(Header(Time.of(time.time()), self._stamped), twist))

    def status(self) -> CommandStatus:
        """The sim's last command status; empty if it is outdated."""
        status, age = self._status.read()
        self.name = status.name if status else ""
        return status if status and age < 3 * LOST else CommandStatus()

    def close(self) -> None:
        """Close its publishers and subscriptions."""
        self._commands.close()
        self.odom.close()
        self._status.close()
