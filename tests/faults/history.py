"""What was sent and how the robot moved, and what holds between the two. Times in seconds of the
robot's clock.

No event has one exact time, since a process may be held up between two lines. Each lies in an
interval whose ends are known, and a check assumes the end that speaks for the robot, so that load
alone breaks none.
"""

import sys
from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from pathlib import Path
from typing import NamedTuple

from holozen.testing import Process, wait_for
from holozen.testing.wire import STAMPED
from holozen.wire import COMMAND_SILENCE

PROMPT = 0.05  # s; a robot at rest may obey a command that took no longer, see docs/safety.md
STEP = 1 / 240  # s; odom is to come at each step
MOVES = 0.02  # m/s; slower is standing
# odom, so that its times are close
EACH_STEP = ("param", "set", "sim", "odometry_rate", f"{1 / STEP:g}")
STAMPS = ("--cfg", ":".join(STAMPED))  # of a sim, so that each odom has the time of its sending
CLOCK = 4000  # s that the drivers' clock is ahead


def whole_lines(process: Process) -> list[str]:
    """The lines that a program has printed, without one that it has only begun."""
    return process.out.rpartition("\n")[0].splitlines()


def script(name: str, endpoint: str) -> list[str]:
    """The command that runs `driver.py` or `observer.py`."""
    return [sys.executable, str(Path(__file__).with_name(f"{name}.py")), endpoint]


@dataclass(frozen=True)
class Row:
    """An odom that was sent at `end`. The robot's last step was decided after `begin`, when the one
    before was sent.
    """

    begin: float
    end: float
    moves: bool


def newest(observer: Process) -> Row:
    """The newest odom."""
    seen = [line.split() for line in observer.out.rpartition("\n")[0].rsplit("\n", 2)[-2:]]
    return (
        Row(float(seen[0][0]), float(seen[1][0]), float(seen[1][1]) > MOVES)
        if len(seen) > 1
        else Row(0.0, 0.0, False)
    )


def wait_for_odom(observer: Process, at: float) -> None:
    """Wait for an odom that was sent after this."""
    wait_for(lambda: newest(observer).end > at, what="odom")


def wait_for_motion(observer: Process, since: float, moves: bool = True) -> None:
    """Wait until the robot certainly moves, or stands, at a time after this."""
    wait_for(
        lambda: (row := newest(observer)).begin > since and row.moves is moves,
        what=f"a robot that moves: {moves}",
    )


class Command(NamedTuple):
    """When the sending of a command began, when it ended at the latest, and the number of its
    driver.
    """

    began: float
    ended: float
    driver: int = 0


class Violation(AssertionError):
    """A promise that was broken at a time."""

    def __init__(self, what: str, at: float) -> None:
        super().__init__(what)
        self.at = at


@dataclass(frozen=True)
class History:
    """The commands in the order in which they began, and each odom in order."""

    commands: list[Command]
    odom: list[Row]

    @classmethod
    def of(cls, drivers: list[Process], observer: Process, clock: float) -> "History":
        """From what the programs printed. The drivers' clock is `clock` seconds ahead of the
        robot's.
        """
        commands: list[Command] = []
        for number, driver in enumerate(drivers):
            rows = [line.split() for line in whole_lines(driver)]
            sent = [(what, float(at) - clock) for what, at in rows]
            # One that was killed while it sent prints no end.
            commands += [
                Command(at, after if end == "end" else at, number)
                for (what, at), (end, after) in pairwise([*sent, ("", 0.0)])
                if what == "begin"
            ]
        seen = [tuple(map(float, line.split())) for line in whole_lines(observer)]
        odom = [Row(before, at, speed > MOVES) for (before, _), (at, speed) in pairwise(seen)]
        return cls(sorted(commands), odom)

    def moves(self, begin: float, end: float = float("inf")) -> list[Row]:
        """The odom messages between two times at which the robot was certainly moving."""
        return [row for row in self.odom if row.moves and begin < row.begin and row.end < end]

    def longest(self, begin: float = 0.0) -> float:
        """How long after the last command was sent the robot certainly still moved, at most, from
        `begin` on.
        """
        return max((row.begin - self._sent(row.end) for row in self.moves(begin)), default=0.0)

    def check_silence(self, begin: float = 0.0) -> None:
        """Motion ends half a second and a step after the last command was sent."""
        for row in self.moves(begin):
            if (late := row.begin - self._sent(row.end)) > COMMAND_SILENCE + STEP:
                raise Violation(f"it moved {late:.3f} s after the last command was sent", row.begin)

    def check_restored(self, restored: float, until: float = float("inf")) -> None:
        """A robot that was at rest when the link came back is not set in motion by older commands,
        unless they were prompt: a link that is reset delays nothing, and the newest of the commands
        that waited may
            still be fresh.
        """
        last = bisect_left(self.odom, restored, key=lambda row: row.end)
        fresh = min(
            (each.began for each in self.commands if each.ended >= restored), default=float("inf")
        )
        odom = [row for row in self.odom[max(0, last - 1) :] if row.end < min(fresh, until)]
        if not odom or odom[0].moves:
            return
        for before, row in pairwise(odom):
            if row.moves and not before.moves and row.begin - self._sent(row.end) > PROMPT:
                late = row.end - restored
                raise Violation(
                    f"it was moved by what waited, {late:.3f} s after the link came back", row.end
                )

    @cached_property
    def _latest(self) -> list[float]:
        """For each command, the latest time at which it and all before it had been sent."""
        return list(accumulate((each.ended for each in self.commands), max))

    def _sent(self, at: float) -> float:
        """The latest time at which the last of the commands that may precede `at` was sent."""
        index = bisect_left(self.commands, (at,))
        return self._latest[index - 1] if index else float("-inf")
