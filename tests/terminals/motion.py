"""What the robot does while an operator is at the keys."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from holozen.testing import wait_for
from tests.integration.robots import Part, Record, Robot, moves, planar

OFTEN = 100 if os.environ.get("HOLOZEN_LONG") else 1
"""How often a test that looks for a race runs; scripts/test --long asks for the whole hundred."""
MISSED = ("does not answer", "answers again", "paused:", "press a key again")
"""The teleop's line after a terminal, or it itself, was held up: a key of that time does not count.
"""
# s until a key that moved nothing may have been one of those; longer than a key is ignored
PATIENCE = 2.0
# s that a few processes wait for a processor together, where the machine is too busy to keep time
HOLD_UP = 0.2


def drives(robot: Robot, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> None:
    robot.odom.next(lambda odom: moves(odom, x, y, turn))


def stands(robot: Robot) -> None:
    robot.wait_for_stop_command()
    robot.stands()


def press_until(
    shown: Callable[[], object],
    press: Callable[[], object],
    let_go: Callable[[], object],
    screen: Callable[[], str],
) -> None:
    """Press a key, and wait for its effect. A busy machine may hold a terminal up for longer than
    the teleop waits for its answer: if the screen shows that, the key is pressed again, as a person
    would.
    """
    for _ in range(5):
        press()
        with suppress(AssertionError):
            wait_for(shown, PATIENCE)
            return
        if not any(words in screen() for words in MISSED):
            break
        let_go()
    wait_for(shown, what=lambda: f"what the key does; the screen:\n{screen()}")


class Since:
    """Whether the robot has moved in a certain way since this was made."""

    def __init__(self, odom: Record) -> None:
        self._odom, self._seen = odom.from_now(), 0

    def drove(self, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> bool:
        """Whether the robot has moved so at any time; each message is looked at once."""
        new = self._odom.messages()[self._seen :]
        self._seen += len(new)
        return any(moves(odom, x, y, turn) for odom in new)


def assert_nothing_moves(robot: Robot, seconds: float = 0.3) -> None:
    """Check that no command on cmd_vel moves the robot for this long by the sim's clock."""
    commands = robot.commands.from_now()
    robot.pass_time(seconds)
    assert_nothing_moved(commands)


def assert_nothing_moved(commands: Part) -> None:
    """Check that none of these commands moves the robot."""
    new = [planar(command) for command in commands.messages()]
    assert not any(map(any, new)), f"commands since then (forward, left, up, turn): {new}"


class HeldUp:
    """How long the machine keeps processes waiting for a processor, from now on."""

    def __init__(self, *pids: int) -> None:
        self._before = {pid: _waited(pid) for pid in pids}

    def seconds(self) -> float:
        """The sum of the processes' waits; each by the thread that waited longest."""
        return sum(
            max((at - before.get(thread, 0.0) for thread, at in _waited(pid).items()), default=0.0)
            for pid, before in self._before.items()
        )


def _waited(pid: int) -> dict[str, float]:
    """The seconds for which each thread has waited so far."""
    waited = {}
    for file in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with suppress(OSError):
            waited[file.parent.name] = int(file.read_text().split()[1]) * 1e-9
    return waited


def assert_drives_on(
    robot: Robot, motion: tuple[float, ...], again: Callable[[], object], *pids: int
) -> None:
    """Check that the robot gets this motion and no other for a second. A second in which these
    processes waited for a processor proves nothing: the robot is then made to drive `again`.
    """
    for _ in range(5):
        commands, held_up = robot.commands.from_now(), HeldUp(*pids)
        robot.pass_time(1.0)
        reported = {planar(command) for command in commands.messages()}
        if reported == {motion}:
            return
        assert held_up.seconds() > HOLD_UP, (
            f"it was commanded {reported} on a machine that kept time"
        )
        again()
    raise AssertionError(f"it was commanded {reported}, five times")
