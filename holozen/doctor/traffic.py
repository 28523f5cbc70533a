"""The robots: whether their odom comes, who commands them, and whether they are stopped."""

from collections.abc import Iterable, Iterator, Sequence

from holozen.bus import Bus
from holozen.doctor.finding import ERROR, OK, WARNING, Finding
from holozen.graph import Endpoint
from holozen.messages import CommandSource, CommandStatus, Odometry
from holozen.readers import Latest
from holozen.tap import Tap

TALKS = 2.0  # Hz; who sends less is not taken to command a robot all the time
MOST = 50  # robots that are listened to; a hundred at once would be a load


class Robots:
    """Listens to the robots that `endpoints` tell of, from when it is made."""

    def __init__(self, bus: Bus, endpoints: Iterable[Endpoint]) -> None:
        rows = [end for end in endpoints if end.kind == "pub"]
        odoms = {end.key: end.node for end in rows if end.type == Odometry.ROS}
        statuses = sorted({end.key for end in rows if end.type == CommandStatus.ROS})
        self.count, self._nodes = len(odoms), odoms
        # Bytes alone, and the newest of them: nothing is decoded that is only to be heard.
        self._odoms: dict[str, Tap] = {key: bus.tap(key, depth=1) for key in sorted(odoms)[:MOST]}
        self._statuses: dict[str, Latest[CommandStatus]] = {
            key: bus.latest(key, CommandStatus) for key in statuses[:MOST]
        }

    def look(self, listened: float) -> Iterator[Finding]:
        """The findings after `listened` seconds."""
        silent = [key for key, tap in self._odoms.items() if tap.try_recv() is None]
        for key in silent:
            text = f"{key} is stale: {self._nodes[key]} has told nothing for {listened:.1f} s"
            mend = "wake or restart it (fg, kill -CONT), or set its real_time_factor up"
            yield Finding("odom", ERROR, text, mend)
        if self._odoms and not silent:
            more = f" of the first {MOST} robots" if self.count > MOST else ""
            yield Finding("odom", OK, f"fresh on {', '.join(self._odoms)}" if not more else f"fresh{more}")
        for key, latest in self._statuses.items():
            status, _age = latest.read()
            if status:
                yield from judged(key.removesuffix("_status"), status)


def judged(key: str, status: CommandStatus) -> Iterator[Finding]:
    """The findings about who commands the robot on `key`."""
    if status.stopped:
        robot = key.rpartition("/")[0]
        text = f"the robot is stopped by {status.stopped}, and obeys nobody"
        yield Finding(key, WARNING, text, f"holozen release {robot}".strip())
    talking = [source for source in status.sources if source.rate >= TALKS]
    if len(talking) > 1:
        level = ERROR if _are_equal(talking) else WARNING
        who = ", ".join(f"{source.source} ({_told(source)})" for source in talking)
        mend = "end all but one; a person at the teleop comes before scripts, and those before the controller"
        yield Finding(key, level, f"{len(talking)} sources command the robot at once: {who}", mend)


def _are_equal(sources: Sequence[CommandSource]) -> bool:
    """Whether the strongest of them are as strong as each other, so that neither wins."""
    from holozen.tap import PRIORITIES

    ranks = sorted(PRIORITIES.index(source.priority) for source in sources if source.priority in PRIORITIES)
    return len(ranks) > 1 and ranks[0] == ranks[1]


def _told(source: CommandSource) -> str:
    return f"{source.priority}, {source.rate:.0f} Hz, {'obeyed' if source.obeyed else 'not obeyed'}"
