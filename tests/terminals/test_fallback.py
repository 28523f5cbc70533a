"""Where a terminal tells no releases, a key that repeats drives without a stutter, and stops when it repeats no more.

These tests look at the clock, since the bound itself is what is asked for. A busy machine types, reads and publishes
late: a try that fails shows nothing, and a few that keep the bound are enough. A teleop that is too slow is so always.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import pytest

from holozen.bus import Bus
from holozen.messages import Twist
from holozen.testing import Terminal, Wire, wait_for
from holozen.transport.errors import BusError
from tests.integration.robots import Robot, moves, planar

GRACE = 0.06  # s after the interval, until the stop is on the wire
REPEATS = 20
ENOUGH, TRIES = 3, 12
KEYBOARDS = [(0.25, 0.03), (0.5, 0.04)]


class Hold(NamedTuple):
    """What came of a key that was held. `late`: how late the keys were sent, s; `stutters`: stops while it repeated;
    `after`: from the last repeat to the stop, s.
    """

    late: float
    stutters: int
    after: float


class Stopwatch:
    """The commands, each with the time at which it came."""

    def __init__(self, bus: Bus) -> None:
        self.came: list[tuple[float, bool]] = []  # when, and whether it moves
        self._commands = bus.subscribe("cmd_vel", Twist, depth=1000)
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        with suppress(BusError):
            while True:
                message = self._commands.recv().message
                self.came.append((time.monotonic(), message is not None and any(planar(message))))

    def hold(self, terminal: Terminal, delay: float, interval: float) -> Hold:
        """Hold a key until it has repeated often."""
        begin = len(self.came)
        sent = terminal.hold("i", delay + (REPEATS - 0.5) * interval, delay, interval)
        dues = [sent[0], *(sent[0] + delay + count * interval for count in range(len(sent) - 1))]

        def stopped() -> float | None:
            return next((at for at, moves in self.came[begin:] if at > sent[-1] and not moves), None)

        end = wait_for(stopped, what="a stop") or 0.0
        first = next(at for at, moves in self.came[begin:] if moves)
        stutters = sum(not moves for at, moves in self.came[begin:] if first < at <= sent[-1])
        return Hold(max(a - b for a, b in zip(sent, dues, strict=True)), stutters, end - sent[-1])


@pytest.fixture(scope="module")
def stopwatch(town: Wire, only_robot: Robot) -> Iterator[Stopwatch]:
    with Bus("stopwatch", town.connection) as bus:
        yield Stopwatch(bus)


@pytest.mark.parametrize(("delay", "interval"), KEYBOARDS, ids=lambda seconds: f"{seconds * 1000:g} ms")
def test_a_held_key_drives_without_a_stutter_and_stops_one_interval_after_its_last_repeat(
    town: Wire, robot: Robot, stopwatch: Stopwatch, delay: float, interval: float
) -> None:
    good = 0
    seen: list[list[Hold]] = []
    while good < ENOUGH and len(seen) < TRIES:
        with town.terminal("teleop") as terminal:  # a new one: it has to learn the keyboard
            terminal.wait_for_text("listening sim")
            holds = []
            for _ in range(2):
                robot.stands()
                holds.append(stopwatch.hold(terminal, delay, interval))
        seen.append(holds)
        good += all(hold.stutters == 0 and hold.after <= interval + GRACE for hold in holds)
    assert good >= ENOUGH, seen


def test_a_key_that_repeats_already_at_the_start_moves_nothing(town: Wire, robot: Robot) -> None:
    with town.terminal("teleop") as terminal:
        begin = len(robot.commands.messages())
        while "listening sim" not in terminal.screen():
            terminal.hold("i", 0.03, 0.03)
        terminal.hold("i", 0.5, 0.03, 0.03)
        robot.newest()
        assert not [command for command in robot.commands.messages()[begin:] if any(planar(command))]
        time.sleep(0.8)  # let go, for longer than any keyboard waits before it repeats
        terminal.type("i")
        robot.odom.next(lambda odom: moves(odom, 0.5, 0, 0))
        robot.told_to_stop()


def test_a_key_that_is_tapped_moves_the_robot_and_it_stops_by_itself(town: Wire, robot: Robot) -> None:
    with town.terminal("teleop") as terminal:
        terminal.wait_for_text("listening sim")
        terminal.type("i")
        robot.odom.next(lambda odom: moves(odom, 0.5, 0, 0))
        robot.told_to_stop()
        robot.stands()


def test_another_key_takes_over_at_once(town: Wire, robot: Robot) -> None:
    with town.terminal("teleop") as terminal:
        terminal.wait_for_text("listening sim")
        terminal.hold("i", 0.4, 0.25, 0.03)
        terminal.type("J")
        robot.odom.next(lambda odom: moves(odom, 0, 0.5, 0))
        robot.told_to_stop()
        robot.stands()
