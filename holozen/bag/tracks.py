"""Where the robots of a bag went, and how fast: odometry and commands as rows of numbers, in bounded memory."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from holozen import codec, wire
from holozen.bag.reader import Message
from holozen.messages import Odometry, Twist, TwistStamped

FARTHEST = 1e9  # m, m/s; what claims to be beyond it is not drawn
MOST = 20_000  # rows of a track; of more, every second one is left out again and again
TWISTS = (Twist, TwistStamped)


@dataclass
class Track:
    """What came on one key.

    `rows`: time in s since the bag's start, x and y in m, forward and left in m/s, turn in rad/s. A command has no
    place: its x and y are 0.
    """

    key: str
    rows: list[tuple[float, ...]] = field(default_factory=list)
    count: int = 0
    _stride: int = 1

    def add(self, row: tuple[float, ...]) -> None:
        """One more message."""
        if self.count % self._stride == 0:
            self.rows.append(row)
        self.count += 1
        if len(self.rows) >= MOST:
            self.rows, self._stride = self.rows[::2], 2 * self._stride

    def column(self, number: int) -> list[float]:
        """The numbers of one column."""
        return [row[number] for row in self.rows]


@dataclass
class Tracks:
    """The tracks of a bag, by key."""

    odometry: dict[str, Track] = field(default_factory=dict)
    commands: dict[str, Track] = field(default_factory=dict)
    bad: int = 0  # messages on such keys that were something else, or are nowhere

    def add(self, rows: dict[str, Track], key: str, row: tuple[float, ...]) -> None:
        """One more row of a key."""
        if all(abs(value) < FARTHEST for value in row[1:]):  # a NaN is not
            rows.setdefault(key, Track(key)).add(row)
        else:
            self.bad += 1


def tracks(messages: Iterable[Message]) -> Tracks:
    """Collect the odometry and the commands of a bag."""
    made, start = Tracks(), None
    for message in messages:
        start = message.at if start is None else start
        _see(made, message, (message.at - start) / 1e9)
    return made


def _see(made: Tracks, message: Message, time: float) -> None:
    key, kind = message.channel.key, message.channel.type
    row = wire.topic(key)
    name = kind or (row.type.ROS if row else "")
    try:
        if name == Odometry.ROS:
            odom = codec.decode(message.payload, message.channel.encoding, (Odometry,))
            at, moves = odom.pose.pose.position, odom.twist.twist
            numbers = (time, at.x, at.y, moves.linear.x, moves.linear.y, moves.angular.z)
            made.add(made.odometry, key, numbers)
        elif name in (Twist.ROS, TwistStamped.ROS):
            command: Any = codec.decode(message.payload, message.channel.encoding, TWISTS)
            twist = command.twist if isinstance(command, TwistStamped) else command
            numbers = (time, 0.0, 0.0, twist.linear.x, twist.linear.y, twist.angular.z)
            made.add(made.commands, key, numbers)
    except codec.CodecError:
        made.bad += 1
