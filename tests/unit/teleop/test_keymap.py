"""The keys mean what they mean in teleop_twist_keyboard."""

import pytest

from services.teleop import keymap
from services.teleop.keymap import MOVES, SPEEDS

# Key, forward, left, up, turn: the bindings of teleop_twist_keyboard 2.4, shifted keys strafe.
TABLE = """
i  1  0  0  0
o  1  0  0 -1
j  0  0  0  1
l  0  0  0 -1
u  1  0  0  1
, -1  0  0  0
. -1  0  0  1
m -1  0  0 -1
O  1 -1  0  0
I  1  0  0  0
J  0  1  0  0
L  0 -1  0  0
U  1  1  0  0
< -1  0  0  0
> -1 -1  0  0
M -1  1  0  0
t  0  0  1  0
b  0  0 -1  0
"""
ARROWS = {"up": "i", "down": ",", "left": "j", "right": "l", "s-left": "J", "s-right": "L"}


@pytest.mark.parametrize("row", TABLE.strip().splitlines())
def test_a_moving_key_means_what_it_does_there(row: str) -> None:
    key, *direction = row.split()
    assert MOVES[key] == tuple(map(int, direction))


def test_there_are_no_other_moving_keys_but_the_arrows() -> None:
    assert set(MOVES) == {row[0] for row in TABLE.strip().splitlines()} | set(ARROWS)


@pytest.mark.parametrize("arrow", ARROWS)
def test_an_arrow_means_what_its_letter_does(arrow: str) -> None:
    assert MOVES[arrow] == MOVES[ARROWS[arrow]]


def test_speed_keys_change_a_tenth() -> None:
    assert SPEEDS == {"q": (1.1, 1.1), "z": (0.9, 0.9), "w": (1.1, 1), "x": (0.9, 1), "e": (1, 1.1), "c": (1, 0.9)}


def test_no_key_has_two_meanings() -> None:
    assert not set(MOVES) & set(SPEEDS)
    assert not {keymap.RESUME, keymap.QUIT, "k", "K", " "} & (set(MOVES) | set(SPEEDS))


def test_the_help_shows_every_letter() -> None:
    words = set(keymap.HELP.replace("/", " ").split())
    assert {key for key in [*MOVES, *SPEEDS, keymap.RESUME, "k", "K"] if len(key) == 1} <= words
