"""Draws a bag: the paths of the robots, and their velocities next to those commanded."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

from holozen import wire
from holozen.bags import BagError, Message
from holozen.bags.deviation import Deviation, Point, closed, deviation
from holozen.bags.reader import Bag
from holozen.messages import Odometry, Twist, TwistStamped, codec

FORMATS = (".png", ".svg")
SIZE = (12.0, 6.0)  # inches
# column of a track, title
PANELS = ((3, "forward in m/s"), (4, "left in m/s"), (5, "turn in rad/s"))
FARTHEST = 1e9  # m, m/s; larger values are not drawn
MAX_ROWS = 20_000  # rows of a track; when it has more, every other row is dropped
TWISTS = (Twist, TwistStamped)


class Track(Struct):
    """The messages of one key.

    `rows`: time in s since the start of the bag, x and y in m, forward and left in m/s, turn in
    rad/s. For commands x and y are 0.
    """

    key: str
    rows: list[tuple[float, ...]] = []
    count: int = 0
    _stride: int = 1

    def add(self, row: tuple[float, ...]) -> None:
        """Add a message."""
        if self.count % self._stride == 0:
            self.rows.append(row)
        self.count += 1
        if len(self.rows) >= MAX_ROWS:
            self.rows, self._stride = self.rows[::2], 2 * self._stride

    def column(self, number: int) -> list[float]:
        """The numbers of one column."""
        return [row[number] for row in self.rows]


class Tracks(Struct):
    """The tracks of a bag, by key."""

    odometry: dict[str, Track] = {}
    commands: dict[str, Track] = {}
    bad: int = 0  # messages of these types that cannot be read or are out of range

    def add(self, rows: dict[str, Track], key: str, row: tuple[float, ...]) -> None:
        """Add a row of a key."""
        if all(abs(value) < FARTHEST for value in row[1:]):  # false for NaN
            rows.setdefault(key, Track(key)).add(row)
        else:
            self.bad += 1


def tracks(messages: Iterable[Message]) -> Tracks:
    """Collect the odometry and the commands of a bag."""
    made, start = Tracks(), None
    for message in messages:
        start = message.at if start is None else start
        _add(made, message, (message.at - start) / 1e9)
    return made


def _add(made: Tracks, message: Message, time: float) -> None:
    key, kind = message.channel.key, message.channel.type
    row = wire.topic(key)
    name = kind or (row.type_name if row else "")
    try:
        if name == Odometry.ROS:
            odom = codec.decode(
                message.payload, message.channel.encoding, (Odometry,), tolerant=True
            )
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


class Drawn(Struct):
    """What was drawn: the number of messages by key, and how far the trails of odometry are from
    their paths.
    """

    topics: dict[str, int]
    deviations: dict[str, Deviation]

    def __str__(self) -> str:
        off = {key: f"; {deviation}" for key, deviation in self.deviations.items()}
        return ", ".join(
            f"{key} ({count} messages{off.get(key, '')})" for key, count in self.topics.items()
        )


def draw(
    source: Path,
    target: Path,
    keys: list[str] | None = None,
    paths: Mapping[str, Sequence[Point]] | None = None,
) -> Drawn:
    """Draw the bag `source` into the picture `target`, beside the wished `paths` in m by the key of
    odometry; the empty key is that of all others.

    Raises BagError, also if there is nothing to draw.
    """
    paths = paths or {}
    if target.suffix.lower() not in FORMATS:
        raise BagError(f"{target}: pictures end in {' or '.join(FORMATS)}")
    with Bag(source) as bag:
        found = tracks(bag.messages())
    if missing := [
        key
        for key in dict.fromkeys([*(keys or ()), *filter(None, paths)])
        if key not in found.odometry
    ]:
        raise BagError(
            f"{source} has no odometry on {', '.join(missing)}; on: "
            f"{', '.join(found.odometry) or 'none'}"
        )
    if not found.odometry:
        raise BagError(f"{source} has no odometry to draw; `holozen bag info` lists its keys")
    if keys:
        found.odometry = {key: found.odometry[key] for key in keys}
    shapes = {key: paths.get(key, paths.get("", ())) for key in found.odometry}
    try:
        _figure(found, source.name, shapes).savefig(target, dpi=100)
    except OSError as error:
        raise BagError(f"cannot write {target}: {error.strerror or error}") from None
    off = {
        key: deviation([(row[1], row[2]) for row in found.odometry[key].rows], path)
        for key, path in shapes.items()
        if path
    }
    return Drawn(
        {track.key: track.count for track in (*found.odometry.values(), *found.commands.values())},
        off,
    )


def _figure(found: Tracks, title: str, shapes: Mapping[str, Sequence[Point]]) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, layout="constrained")
    halves: Any = figure.subfigures(1, 2)
    left, right = halves
    figure.suptitle(title)
    path, panels = left.subplots(), right.subplots(len(PANELS), 1, sharex=True)
    for index, track in enumerate(found.odometry.values()):
        if shape := shapes[track.key]:
            corners = tuple(zip(*closed(shape), strict=True))
            wished = f"{track.key}: wished path"
            path.plot(*corners, "--", color=f"C{index % 10}", linewidth=1, label=wished)
        _draw_path(path, track, f"C{index % 10}")
        for panel, (column, _) in zip(panels, PANELS, strict=True):
            panel.plot(
                track.column(0),
                track.column(column),
                color=f"C{index % 10}",
                label=f"{track.key}: measured",
            )
            if command := found.commands.get(track.key.removesuffix("odom") + "cmd_vel"):
                panel.plot(
                    command.column(0),
                    command.column(column),
                    ":",
                    color="0.4",
                    label=f"{command.key}: commanded",
                )
    path.set(xlabel="x in m", ylabel="y in m", aspect="equal")
    path.legend()
    for panel, (_, name) in zip(panels, PANELS, strict=True):
        panel.set_ylabel(name)
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize="small")
    panels[-1].set_xlabel("s")
    return figure


def _draw_path(panel: Any, track: Track, color: str) -> None:
    x, y = track.column(1), track.column(2)
    panel.plot(x, y, color=color, label=track.key)
    panel.plot(x[:1], y[:1], "o", color=color)  # a dot at the start, a square at the end
    panel.plot(x[-1:], y[-1:], "s", color=color)
    panel.grid(alpha=0.3)
