"""What the lidars of robots see: points in the frame of each robot's odometry."""

import math
from collections.abc import Iterable

from holozen.bus import Bus
from holozen.frames import RobotFrames
from holozen.messages import LaserScan
from holozen.plotting import Point
from holozen.transport.graph import Endpoint, Graph
from holozen.wire import key_for

MOST = 32  # lidars; anyone may announce more
MOST_RAYS = 1000  # of a scan; of more, every second or third is taken


class Scanners:
    """The lidars that the graph shows: of one `robot`, by its name, "" being that at the root; or
    of all robots.
    """

    def __init__(self, bus: Bus, robot: str | None = None) -> None:
        self._bus, self._robot = bus, robot
        self._scanners: dict[str, Scanner] = {}  # by key
        self._looked: int | None = None  # at the graph, by its `seen`

    def update(self, graph: Graph) -> None:
        """Listen to the lidars that are in the graph now, and take in the scans that wait."""
        ends = graph.endpoints()
        if graph.seen != self._looked:
            self._looked = graph.seen
            self._follow(ends)
        for scanner in self._scanners.values():
            scanner.take()

    def _follow(self, ends: Iterable[Endpoint]) -> None:
        published = [end for end in ends if end.kind == "pub"]
        robots = {end.key.removesuffix("odom") for end in published if end.key.endswith("odom")}
        keys = {end.key for end in published if end.type == LaserScan.ROS and "*" not in end.key}
        for gone in self._scanners.keys() - keys:
            self._scanners.pop(gone).close()
        for new in keys - self._scanners.keys():
            owners = [start for start in robots if new.startswith(start)]
            owner = max(owners, key=len).removesuffix("/") if owners else None
            if owner is not None and self._robot in (None, owner) and len(self._scanners) < MOST:
                self._scanners[new] = Scanner(self._bus, new, owner)

    @property
    def points(self) -> list[Point]:
        """What the newest scan of each lidar holds, in m."""
        return [point for scanner in self._scanners.values() for point in scanner.points]

    def close(self) -> None:
        """Stop listening."""
        for scanner in self._scanners.values():
            scanner.close()
        self._scanners.clear()


class Scanner:
    """The points that one lidar sees."""

    def __init__(self, bus: Bus, key: str, namespace: str) -> None:
        self._scans = bus.state(key, LaserScan)
        self._frames = RobotFrames(bus, namespace, key_for("odom", namespace))
        self.points: list[Point] = []  # of the newest scan

    def take(self) -> None:
        """Take in the newest scan."""
        self._frames.update()
        if (received := self._scans.try_recv()) and (scan := received.message):
            if (at := self._frames.of(scan.header.frame_id, self._frames.root)) is None:
                return
            self.points = []
            stride = max(1, math.ceil(len(scan.ranges) / MOST_RAYS))
            for index in range(0, len(scan.ranges), stride):
                far = scan.ranges[index]
                if scan.range_min <= far <= scan.range_max:
                    angle = scan.angle_min + index * scan.angle_increment
                    self.points.append(
                        at.apply((far * math.cos(angle), far * math.sin(angle), 0.0))[:2]
                    )

    def close(self) -> None:
        """Stop listening."""
        self._scans.close()
        self._frames.close()
