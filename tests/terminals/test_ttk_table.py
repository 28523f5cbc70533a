"""Every key of teleop_twist_keyboard, typed in a terminal, commands what it commands there."""

from collections.abc import Callable

import pytest

from holozen.testing import Terminal, Wire
from tests.integration.robots import Robot, planar

from .motion import press_until

V, W = 0.4, 0.8  # m/s, rad/s
LIMITS = 0.9, 1.4  # m/s, rad/s

# Forward, left, up (times the speed), counter-clockwise (times the turn).
TABLE = {
    "u": (1, 0, 0, 1),
    "i": (1, 0, 0, 0),
    "o": (1, 0, 0, -1),
    "j": (0, 0, 0, 1),
    "l": (0, 0, 0, -1),
    "m": (-1, 0, 0, -1),
    ",": (-1, 0, 0, 0),
    ".": (-1, 0, 0, 1),
    "U": (1, 1, 0, 0),
    "I": (1, 0, 0, 0),
    "O": (1, -1, 0, 0),
    "J": (0, 1, 0, 0),
    "L": (0, -1, 0, 0),
    "M": (-1, 1, 0, 0),
    "<": (-1, 0, 0, 0),
    ">": (-1, -1, 0, 0),
    "t": (0, 0, 1, 0),
    "b": (0, 0, -1, 0),
    # Ours besides: the arrows, with shift too.
    "\x1b[A": (1, 0, 0, 0),
    "\x1b[B": (-1, 0, 0, 0),
    "\x1b[D": (0, 0, 0, 1),
    "\x1b[C": (0, 0, 0, -1),
    "\x1b[1;2D": (0, 1, 0, 0),
    "\x1b[1;2C": (0, -1, 0, 0),
}

# The keys of the speeds, one after the other, and what each multiplies speed and turn by.
SPEEDS = {
    "q": (1.1, 1.1),
    "z": (0.9, 0.9),
    "w": (1.1, 1),
    "x": (0.9, 1),
    "e": (1, 1.1),
    "c": (1, 0.9),
}


class Keys:
    """The keys of a teleop that latches, and what it commands after them."""

    def __init__(self, terminal: Terminal, robot: Robot) -> None:
        self._terminal, self._robot = terminal, robot

    def until(self, keys: str, shown: Callable[[], object]) -> None:
        """Type them until that is shown."""
        terminal = self._terminal
        press_until(shown, lambda: terminal.type(keys), lambda: None, terminal.screen)

    def shows(self, speed: float, turn: float) -> bool:
        screen = self._terminal.screen()
        return f"{speed:.3f} m/s" in screen and f"{turn:.3f} rad/s" in screen

    def typed(self, key: str, moves: bool = True) -> tuple[float, ...]:
        """The first motion, or stop, that is commanded after this key is typed."""
        commands = self._robot.commands.from_now()

        def found() -> list[tuple[float, ...]]:
            found = map(planar, commands.messages())
            return [command for command in found if any(command) == moves]

        self.until(key, found)
        return found()[0]

    def assert_commands(self, key: str, speed: float, turn: float) -> None:
        x, y, z, counter_clockwise = TABLE[key]
        self.typed("k", moves=False)
        assert self.typed(key) == pytest.approx(
            (x * speed, y * speed, z * speed, counter_clockwise * turn)
        ), key

    def change(
        self, key: str, speed: float, turn: float, faster: float, more: float
    ) -> tuple[float, float]:
        """Type a key that changes speed and turn by these factors. Returns what they are then: a
        key that a busy machine took late was typed again, and counts each time.
        """
        found = [(speed, turn)]

        def press() -> None:
            found.append((found[-1][0] * faster, found[-1][1] * more))
            self._terminal.type(key)

        press_until(
            lambda: any(self.shows(*one) for one in found[1:]),
            press,
            lambda: None,
            self._terminal.screen,
        )
        self.typed("k", moves=False)
        forward, _, _, counter_clockwise = self.typed("u")  # it drives and turns
        assert (forward, counter_clockwise) in [pytest.approx(one) for one in found[1:]], key
        return forward, counter_clockwise


def test_every_key_commands_what_it_does_there(town: Wire, robot: Robot) -> None:
    limits = ("--speed-limit", str(LIMITS[0]), "--turn-limit", str(LIMITS[1]))
    with town.terminal(
        "teleop", "--mode", "latch", "--speed", str(V), "--turn", str(W), *limits
    ) as terminal:
        terminal.wait_for_text("listening sim")
        keys = Keys(terminal, robot)
        for key in TABLE:
            keys.assert_commands(key, V, W)
        speed, turn = V, W
        for key, (faster, more) in SPEEDS.items():
            speed, turn = keys.change(key, speed, turn, faster, more)
        keys.until("q" * 12, lambda: keys.shows(*LIMITS))
        for key in TABLE:
            keys.assert_commands(key, *LIMITS)
        keys.change("z", *LIMITS, 0.9, 0.9)
