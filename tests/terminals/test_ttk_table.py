"""Every key of teleop_twist_keyboard, typed in a terminal, says on the wire what it says there, at every speed."""

from collections.abc import Iterator

import pytest

from holozen.testing import Terminal, Wire, wait_for
from tests.integration.robots import Record, Robot, planar

V, W = 0.4, 0.8  # m/s, rad/s
LIMITS = 0.9, 1.4  # m/s, rad/s

# Forward, left, up (times the speed), counter-clockwise (times the turn).
TABLE = {
    "u": (1, 0, 0, 1), "i": (1, 0, 0, 0), "o": (1, 0, 0, -1),
    "j": (0, 0, 0, 1), "l": (0, 0, 0, -1),
    "m": (-1, 0, 0, -1), ",": (-1, 0, 0, 0), ".": (-1, 0, 0, 1),
    "U": (1, 1, 0, 0), "I": (1, 0, 0, 0), "O": (1, -1, 0, 0),
    "J": (0, 1, 0, 0), "L": (0, -1, 0, 0),
    "M": (-1, 1, 0, 0), "<": (-1, 0, 0, 0), ">": (-1, -1, 0, 0),
    "t": (0, 0, 1, 0), "b": (0, 0, -1, 0),
    # Ours besides: the arrows, with shift too.
    "\x1b[A": (1, 0, 0, 0), "\x1b[B": (-1, 0, 0, 0), "\x1b[D": (0, 0, 0, 1), "\x1b[C": (0, 0, 0, -1),
    "\x1b[1;2D": (0, 1, 0, 0), "\x1b[1;2C": (0, -1, 0, 0),
}  # fmt: skip

# What is typed, and the speed and the turn that follow.
SPEEDS = {
    "at the start": ("", V, W),
    "q": ("q", V * 1.1, W * 1.1),
    "z": ("z", V * 0.9, W * 0.9),
    "w": ("w", V * 1.1, W),
    "x": ("x", V * 0.9, W),
    "e": ("e", V, W * 1.1),
    "c": ("c", V, W * 0.9),
    "qqxe": ("qqxe", V * 1.1**2 * 0.9, W * 1.1**3),
    "at the limits": ("q" * 12, *LIMITS),
    "below the limits again": ("q" * 12 + "z", LIMITS[0] * 0.9, LIMITS[1] * 0.9),
}


@pytest.fixture(params=SPEEDS)
def speeds(request: pytest.FixtureRequest) -> tuple[str, float, float]:
    keys: tuple[str, float, float] = SPEEDS[request.param]
    return keys


@pytest.fixture
def teleop(town: Wire, robot: Robot, speeds: tuple[str, float, float]) -> Iterator[Terminal]:
    """A teleop, latched, whose speeds were changed by these keys."""
    limits = ("--speed-limit", str(LIMITS[0]), "--turn-limit", str(LIMITS[1]))
    with town.terminal("teleop", "--mode", "latch", "--speed", str(V), "--turn", str(W), *limits) as terminal:
        terminal.wait_for_text("listening sim")
        terminal.type(speeds[0])
        yield terminal


def said(commands: Record, terminal: Terminal, key: str) -> tuple[float, ...]:
    """The first motion that is commanded after a stop and this key."""
    begin = len(commands.messages())
    terminal.type("k")
    wait_for(lambda: any(not any(planar(m)) for m in commands.messages()[begin:]), what="a stop")
    begin = len(commands.messages())
    terminal.type(key)
    found = wait_for(lambda: [m for m in commands.messages()[begin:] if any(planar(m))], what=f"a command of {key!r}")
    return planar(found[0])


def test_every_key_says_what_it_says_there(teleop: Terminal, robot: Robot, speeds: tuple[str, float, float]) -> None:
    _, speed, turn = speeds
    heard = {key: said(robot.commands, teleop, key) for key in TABLE}
    factors = (speed, speed, speed, turn)
    expected = {key: tuple(d * f for d, f in zip(TABLE[key], factors, strict=True)) for key in TABLE}
    assert heard == {key: pytest.approx(motion) for key, motion in expected.items()}


def test_a_speed_over_its_limit_is_brought_down_from_the_start(town: Wire, robot: Robot) -> None:
    with town.terminal("teleop", "--mode", "latch", "--speed", "3", "--speed-limit", "0.3") as terminal:
        terminal.wait_for_text("listening sim")
        terminal.type("i")
        robot.odom.next(lambda odom: odom.twist.twist.linear.x == pytest.approx(0.3))
