"""The keys of one robot on the bus: commands out, odometry and status in."""

import math
import time

from holozen.bus import Bus
from holozen.messages import CommandStatus, Header, Time, Twist, TwistStamped
from holozen.odometry import LOST, OdometryFeedback
from holozen.transport.pubsub import Publisher
from holozen.wire import PRIORITY_OF, key_for

JUMP = 0.5  # m between two polls, more than its motion explains, that mean a reset


class RobotClient:
    """A robot to drive. Its other keys are siblings of `command`, its command key; `stamped` is as for Session."""

    def __init__(self, bus: Bus, robot: str, command: str, stamped: str | None) -> None:
        self.robot, self.key = robot, command or key_for("cmd_vel", robot)
        self._stamped = stamped
        kind: type[Twist] | type[TwistStamped] = Twist if stamped is None else TwistStamped
        self._commands: Publisher[Twist | TwistStamped] = bus.publisher(self.key, kind, PRIORITY_OF["teleop"])
        self.odom = OdometryFeedback(bus, self.beside("odom"))
        self._odom_writers = bus.writers(self.beside("odom"))
        self.status_key = f"{self.key}_status"
        self.name = ""  # in the sim; empty while it is not known
        self._seen: tuple[float, float, float] | None = None  # stamp and position of the last odom seen
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

    def was_reset(self) -> bool:
        """Whether the robot has been reset since the last call: its clock went back, or its position jumped."""
        odom, _ = self.odom.read()
        if odom is None:
            return False
        place, twist, stamp = odom.pose.pose.position, odom.twist.twist.linear, odom.header.stamp.seconds()
        before, self._seen = self._seen, (stamp, place.x, place.y)
        if before is None:
            return False
        driven = 2 * math.hypot(twist.x, twist.y) * (stamp - before[0])  # at most
        return stamp < before[0] or math.dist(before[1:], self._seen[1:]) > JUMP + driven

    def was_removed(self) -> bool:
        """Whether a publisher of its odom has left since the last call: it was removed, though another one may have
        taken its place.
        """
        tokens = list(iter(self._odom_writers.try_recv, None))
        return any(token.is_deletion for token in tokens)

    def close(self) -> None:
        """Close its publishers and subscriptions."""
        self._commands.close()
        self._odom_writers.close()
        self.odom.close()
        self._status.close()
