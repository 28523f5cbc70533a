"""Every key of teleop_twist_keyboard, typed in a terminal, commands what it commands there."""

from collections.abc import Callable

import pytest

from holozen.testing import Wire
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


def test_every_key_commands_what_it_does_there(town: Wire, robot: Robot) -> None:
    limits = ("--speed-limit", str(LIMITS[0]), "--turn-limit", str(LIMITS[1]))
    with town.terminal(
        "teleop", "--mode", "latch", "--speed", str(V), "--turn", str(W), *limits
    ) as terminal:
        terminal.wait_for_text("listening sim")

        def type_until(keys: str, shown: Callable[[], object]) -> None:
            press_until(shown, lambda: terminal.type(keys), lambda: None, terminal.screen)

        def typed(key: str, moves: bool = True) -> tuple[float, ...]:
            """The first motion, or stop, that is commanded after this key is typed."""
            commands = robot.commands.from_now()

            def found() -> list[tuple[float, ...]]:
                found = map(planar, commands.messages())
                return [command for command in found if any(command) == moves]

            type_until(key, found)
            return found()[0]

        def assert_commands(key: str, speed: float, turn: float) -> None:
            x, y, z, counter_clockwise = TABLE[key]
            typed("k", moves=False)
            assert typed(key) == pytest.approx(
                (x * speed, y * speed, z * speed, counter_clockwise * turn)
            ), key

        def change(keys: str, speed: float, turn: float) -> None:
            """Type the keys that lead to these speeds."""
            type_until(
                keys,
                lambda: all(
                    f"{v:.3f} {u}" in terminal.screen()
                    for v, u in ((speed, "m/s"), (turn, "rad/s"))
                ),
            )

        for key in TABLE:
            assert_commands(key, V, W)
        speed, turn = V, W
        for key, (faster, more) in SPEEDS.items():
            speed, turn = speed * faster, turn * more
            change(key, speed, turn)
            assert_commands("u", speed, turn)  # it drives and turns
        change("q" * 12, *LIMITS)
        for key in TABLE:
            assert_commands(key, *LIMITS)
        change("z", LIMITS[0] * 0.9, LIMITS[1] * 0.9)
        assert_commands("u", LIMITS[0] * 0.9, LIMITS[1] * 0.9)
