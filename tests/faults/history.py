"""What was sent and how the robot moved, and what holds between the two. Times in seconds of the robot's clock.

No event has one exact time, since a process may be held up between two lines. Each lies in an interval whose ends are
known, and a check assumes the end that speaks for the robot, so that load alone breaks none.
"""

import sys
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from holozen.testing import Process
from holozen.wire import COMMAND_SILENCE

STEP = 1 / 240  # s; odom is to come at each step
MOVES = 0.02  # m/s; slower is standing
EACH_STEP = ("param", "set", "sim", "odometry_rate", f"{1 / STEP:g}")  # odom, so that its times are close
CLOCK = 4000  # s that the drivers' clock is ahead


def whole_lines(process: Process) -> list[str]:
    """What a program has printed, but for a line that it has only begun."""
    return process.out.rpartition("\n")[0].splitlines()


def script(name: str, endpoint: str) -> list[str]:
    """The words that run `driver.py` or `observer.py`."""
    return [sys.executable, str(Path(__file__).with_name(f"{name}.py")), endpoint]


def newest(observer: Process) -> float:
    """When the newest odom was sent."""
    return next((float(line.split()[0]) for line in reversed(whole_lines(observer))), 0.0)


@dataclass(frozen=True)
class Row:
    """An odom that was sent at `end`. The robot's last step was decided after `begin`, when the one before was sent."""

    begin: float
    end: float
    moves: bool


@dataclass(frozen=True)
class History:
    """Each odom in order, and when the sending of each command began and when it ended at the latest."""

    began: list[float]
    ended: list[float]
    odom: list[Row]

    @classmethod
    def of(cls, drivers: list[Process], observer: Process, clock: float) -> "History":
        """From what the programs printed. The drivers' clock is `clock` seconds ahead of the robot's."""
        began: list[float] = []
        ended: list[float] = []
        for driver in drivers:
            rows = [line.split() for line in whole_lines(driver)]
            sent = [(what, float(at) - clock) for what, at in rows]
            began += [at for what, at in sent if what == "begin"]
            # One that was killed while it sent prints no end.
            ended += [after if end == "end" else at for (what, at), (end, after) in pairwise([*sent, ("", 0.0)])
                      if what == "begin"]  # fmt: skip
        seen = [tuple(map(float, line.split())) for line in whole_lines(observer)]
        odom = [Row(before, at, speed > MOVES) for (before, _), (at, speed) in pairwise(seen)]
        return cls(sorted(began), sorted(ended), odom)

    def moves(self, begin: float, end: float = float("inf")) -> list[Row]:
        """Where the robot surely moved between two times."""
        return [row for row in self.odom if row.moves and begin < row.begin and row.end < end]

    def longest(self, begin: float = 0.0) -> float:
        """The longest that the robot surely moved on after the last command was sent, from `begin` on."""
        return max((row.begin - self._sent(row.end) for row in self.moves(begin)), default=0.0)

    def check_silence(self, begin: float = 0.0) -> None:
        """Motion ends half a second and a step after the last command was sent."""
        late = self.longest(begin)
        assert late <= COMMAND_SILENCE + STEP, f"it moved on for {late:.3f} s"

    def check_restored(self, restored: float, until: float = float("inf")) -> None:
        """A robot that stood when the link came back moves by nothing that was sent before."""
        before = [row for row in self.odom if row.end < restored]
        if before[-1].moves:
            return
        first = next(iter(self.began[bisect_right(self.began, restored) :]), float("inf"))
        late = [row.end - restored for row in self.odom if row.moves and restored < row.end < min(first, until)]
        assert late == [], f"it moved {len(late)} times by what waited, {late[0]:.3f} s after the link came back"

    def _sent(self, at: float) -> float:
        """When at the latest the last command was sent of those that may have been before `at`."""
        index = bisect_left(self.began, at)
        return self.ended[index - 1] if index else float("-inf")
