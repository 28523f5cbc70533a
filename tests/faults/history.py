"""What was sent and how the robot moved, and what holds between the two. Times in seconds of the robot's clock."""

from dataclasses import dataclass

from holozen.testing import Process
from holozen.wire import COMMAND_SILENCE

STEP = 1 / 240  # s
MOVES = 0.02  # m/s; slower is standing
CLOCKS = 0.004  # s that the observer's mapping of sim time to its own clock may be off


def whole_lines(process: Process) -> list[str]:
    """What a program has printed, but for a line that it has only begun."""
    return process.out.rpartition("\n")[0].splitlines()


@dataclass(frozen=True)
class History:
    """When each command was sent, and each odom as (when it was true, whether the robot moved)."""

    sent: list[float]
    odom: list[tuple[float, bool]]

    @classmethod
    def of(cls, drivers: list[Process], observer: Process, clock: float) -> "History":
        """From what the programs printed. The drivers' clock is `clock` seconds ahead of the robot's."""
        lines = [line for driver in drivers for line in whole_lines(driver)]
        sent = sorted(float(line) - clock for line in lines if line != "stop")
        rows = [tuple(map(float, line.split())) for line in whole_lines(observer)]
        behind = min((came - stamp for came, stamp, _ in rows), default=0.0)
        return cls(sent, [(stamp + behind, speed > MOVES) for _, stamp, speed in rows])

    def last_sent(self, at: float) -> float:
        """When the last command before `at` was sent."""
        return max((sent for sent in self.sent if sent <= at), default=float("-inf"))

    def moves(self, begin: float, end: float = float("inf")) -> list[float]:
        """When the robot was seen to move between two times."""
        return [at for at, moves in self.odom if moves and begin < at < end]

    def longest(self, begin: float = 0.0) -> float:
        """The longest that the robot moved on after the last command was sent, from `begin` on."""
        return max((at - self.last_sent(at) for at in self.moves(begin)), default=0.0)

    def check_silence(self, begin: float = 0.0) -> None:
        """Motion ends half a second and a step after the last command was sent."""
        assert self.longest(begin) <= COMMAND_SILENCE + STEP + CLOCKS

    def check_mend(self, mended: float, until: float = float("inf")) -> None:
        """A robot that stood when the link was mended moves by nothing that was sent before."""
        stood = not self.moves(mended - 0.05, mended)
        late = [at for at in self.moves(mended, until) if stood and self.last_sent(at) < mended]
        assert late == [], f"it moved {len(late)} times by what waited, {late[0] - mended:.3f} s after the mend"
