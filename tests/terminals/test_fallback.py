"""Where a terminal reports no releases, a repeating key drives without a stutter, and stops after
its last repeat.
"""

import math
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

from holozen.testing import Terminal, Wire, wait_for
from tests.integration.robots import Robot, planar, sent_at

from .broken import ROOT
from .motion import Since, assert_nothing_moved

pytestmark = pytest.mark.alone

DELAY, INTERVAL = 0.25, 0.03  # s until a key repeats, and between its repeats
REPEATS = 20  # more than the teleop measures the interval by
GRACE = 0.06  # s after the interval, until the stop is on the wire
TRIES = 12


class Hold(NamedTuple):
    """What came of a key that was held, by the times at which the teleop sent its commands, as it
    does with each key that it reads. `stutters`: stops while it repeated; `longest`: the longest
    interval between repeats, s; `after`: from the last repeat to the stop, s.
    """

    stutters: int
    longest: float
    after: float


def hold(robot: Robot, terminal: Terminal) -> Hold:
    """Hold a key until it has repeated often."""
    commands = robot.commands.from_now()
    typed = terminal.hold("i", DELAY + (REPEATS - 0.5) * INTERVAL, DELAY, INTERVAL)
    robot.wait_for_stop_command()
    sent = [(sent_at(received), received.message) for received in commands.all()]
    moves = [at for at, message in sent if message and any(planar(message))]
    stops = [at for at, message in sent if message and not any(planar(message))]
    # inf: a key that was not obeyed
    read = [next((at for at in moves if at >= key), math.inf) for key in typed]
    stopped = next((at for at in stops if at > read[-1]), math.inf)
    stutters = sum(read[0] < at < read[-1] for at in stops)
    return Hold(stutters, max(b - a for a, b in pairwise(read[1:])), stopped - read[-1])


def test_a_held_key_drives_without_a_stutter_and_stops_one_interval_after_its_last_repeat(
    town: Wire, robot: Robot
) -> None:
    """A busy machine types late, which is a stutter, and wakes the teleop late: one try that is as
    it should be is enough. A teleop that is too slow is so always; test_key_state.py shows that it
    never stutters by itself.
    """
    tries: list[tuple[Hold, ...]] = []
    steady = quick = False
    while not (steady and quick) and len(tries) < TRIES:
        with town.terminal("teleop") as terminal:  # a new one: it has to learn the keyboard
            terminal.wait_for_text("listening sim")
            holds = []
            for _ in range(2):
                robot.stands()
                holds.append(hold(robot, terminal))
        tries.append(tuple(holds))
        steady |= not any(hold.stutters for hold in holds)
        quick |= any(hold.after <= hold.longest + GRACE for hold in holds)
    assert steady, tries
    assert quick, tries


LATE = """
import select, sys
sys.path.insert(0, {root!r})
from services.teleop import __main__ as teleop
from services.teleop.input.terminal_liveness import TerminalLiveness
begin = TerminalLiveness.begin
def begin_late(self):
    select.select([0], [], [])
    begin(self)
TerminalLiveness.begin = begin_late
sys.exit(teleop.main(sys.argv[1:]))
"""
"""A teleop that begins when a key is there to be read."""


def test_a_key_that_repeats_already_at_the_start_moves_nothing_until_it_was_let_go(
    town: Wire, robot: Robot, tmp_path: Path
) -> None:
    script = tmp_path / "late.py"
    script.write_text(LATE.format(root=str(ROOT)))
    with Terminal([sys.executable, str(script), *town.flags]) as terminal:
        commands = robot.commands.from_now()
        while "listening sim" not in terminal.screen():
            terminal.hold("i", 0.03, 0.03)
        terminal.hold("i", 0.5, 0.03, 0.03)
        robot.newest()
        assert_nothing_moved(commands)
        time.sleep(0.8)  # let go, for longer than any keyboard waits before it repeats
        since = Since(robot.odom)
        terminal.type("i")
        wait_for(lambda: since.drove(x=0.5))
        robot.wait_for_stop_command()


def test_another_key_takes_over_at_once_and_the_robot_stops_by_itself(
    town: Wire, robot: Robot
) -> None:
    with town.terminal("teleop") as terminal:
        terminal.wait_for_text("listening sim")
        since = Since(robot.odom)
        terminal.type("i")
        wait_for(lambda: since.drove(x=0.5))
        terminal.type("J")
        wait_for(lambda: since.drove(y=0.5))
        robot.wait_for_stop_command()
        robot.stands()
