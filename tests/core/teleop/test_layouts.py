"""The layouts mean what people are used to, and their help fits the screen."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.control.layout_file import load
from services.teleop.control.layouts import (
    ACTIONS,
    FIXED,
    LAYOUTS,
    TTK,
    WASD,
    WIDTH,
    Layout,
    key_name,
)
from services.teleop.toml_file import InputError

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
ARROWS = {
    "up": "i",
    "down": ",",
    "left": "j",
    "right": "l",
    "shift+up": "I",
    "shift+down": "<",
    "shift+left": "J",
    "shift+right": "L",
}
EVERY = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.name)


def test_a_moving_key_means_what_it_does_in_teleop_twist_keyboard() -> None:
    for row in TABLE.strip().splitlines():
        key, *direction = row.split()
        assert TTK.moves[key] == tuple(map(int, direction))


def test_there_are_no_other_moving_keys_but_the_arrows() -> None:
    assert set(TTK.moves) == {row[0] for row in TABLE.strip().splitlines()} | set(ARROWS)


def test_an_arrow_means_what_its_letter_does() -> None:
    for arrow in ARROWS:
        assert TTK.moves[arrow] == TTK.moves[ARROWS[arrow]] == LAYOUTS["arrows"].moves[arrow]


def test_speed_keys_change_a_tenth() -> None:
    speeds = {
        "q": (1.1, 1.1),
        "z": (0.9, 0.9),
        "w": (1.1, 1),
        "x": (0.9, 1),
        "e": (1, 1.1),
        "c": (1, 0.9),
    }
    assert TTK.speeds == speeds


def test_wasd_walks_strafes_and_turns() -> None:
    assert {key: WASD.moves[key] for key in "wsadqe"} == {
        "w": (1, 0, 0, 0),
        "s": (-1, 0, 0, 0),
        "a": (0, 1, 0, 0),
        "d": (0, -1, 0, 0),
        "q": (0, 0, 0, 1),
        "e": (0, 0, 0, -1),
    }
    assert all(WASD.moves[key.upper()] == WASD.moves[key] for key in "wsadqe")


@EVERY
def test_no_key_has_two_meanings(layout: Layout) -> None:
    keys = [*layout.moves, *layout.speeds, *layout.actions]
    assert len(keys) == len(set(keys))
    assert [key_name(key) for key in keys] == keys


@EVERY
def test_fixed_keys_and_resume_are_in_every_layout(layout: Layout) -> None:
    assert FIXED.items() <= layout.actions.items()
    assert layout.actions["r"] == "resume"
    assert set(layout.actions.values()) <= set(ACTIONS)


@EVERY
def test_each_layout_goes_every_way_in_the_plane(layout: Layout) -> None:
    ways = {(1, 0, 0, 0), (-1, 0, 0, 0), (0, 1, 0, 0), (0, -1, 0, 0), (0, 0, 0, 1), (0, 0, 0, -1)}
    assert ways <= set(layout.moves.values())


@EVERY
def test_the_help_fits_a_narrow_screen_and_names_a_key_for_each_motion(layout: Layout) -> None:
    assert all(0 < len(line) <= WIDTH for line in layout.help)
    assert len(layout.help) <= 8
    words = " ".join(layout.help).replace("/", " ").split()
    for direction in set(layout.moves.values()):
        assert {key for key, way in layout.moves.items() if way == direction} & set(words)
    assert {"ctrl+c", "?", "r"} <= set(words)


@EVERY
def test_the_table_fits_a_narrow_screen_and_names_every_key(layout: Layout) -> None:
    assert all(0 < len(line) <= WIDTH for line in layout.table)
    words = " ".join(layout.table).split()
    assert {*layout.moves, *layout.speeds, *layout.actions} <= set(words)


def test_the_help_reads_well() -> None:
    assert WASD.help == [
        "w/s forward/back   a/d strafe   q/e turn",
        "+/- both speeds   r let others drive",
        "? all keys   ctrl+c quit   others stop",
    ]
    assert "forward              w W" in WASD.table
    assert "turn left            q Q" in WASD.table
    assert "forward + right      O" in TTK.table
    assert "both speeds +10 %    q" in TTK.table
    assert "turn speed -10 %     c" in TTK.table
    assert TTK.table[-2:] == [
        "stop                 space escape k K",
        "                     others",
    ]


def test_without_strafing_it_names_no_way_to_the_side() -> None:
    planted = TTK.without_strafing
    assert " ".join(planted.help).startswith("i/, forward/back   t/b up/down j/l turn")
    assert not any(
        word in " ".join([*planted.help, *planted.table])
        for word in ("strafe", "diagonal", "+ left", "+ right")
    )
    assert planted.speeds == TTK.speeds and planted.actions == TTK.actions


def test_a_press_means_a_key_of_the_layout() -> None:
    for keyboard, name, typed, base, key in [
        ("US", "ttk", "i", "i", "i"),
        ("US", "ttk", "<", "<", "<"),
        ("any, no place reported", "ttk", "i", "", "i"),
        ("AZERTY: the letter counts", "ttk", ",", "m", ","),
        ("AZERTY: a sign by its place", "ttk", ";", ",", ","),
        ("QWERTZ: a sign by its place", "ttk", ";", "<", "<"),
        ("AZERTY: a letter with no meaning stops", "ttk", "a", "q", "a"),
        ("AZERTY", "ttk", "?", "<", "?"),
        ("QWERTZ: y has no meaning", "ttk", "y", "z", "y"),
        ("QWERTZ", "ttk", "z", "y", "z"),
        ("Spanish: a letter of the same script", "ttk", "ñ", ";", "ñ"),
        ("Russian", "ttk", "ш", "i", "i"),
        ("Russian, shift", "ttk", "Ш", "I", "I"),
        ("Russian", "ttk", "ctrl+\u0441", "ctrl+c", "ctrl+c"),
        ("Russian, nothing there", "ttk", "ф", "a", "ф"),
        ("Russian", "wasd", "ц", "w", "w"),
        ("AZERTY", "wasd", "z", "w", "w"),
        ("AZERTY", "wasd", "q", "a", "a"),
        ("AZERTY", "wasd", "a", "q", "q"),
        ("AZERTY, shift", "wasd", "Z", "W", "W"),
        ("AZERTY: no meaning by place", "wasd", "-", "6", "-"),
        ("AZERTY, no place reported", "wasd", "z", "", "z"),
        ("AZERTY: the letter of another place", "wasd", "w", "z", "z"),
        ("Dvorak", "wasd", ",", "w", "w"),
        ("Dvorak: the letter of another place", "wasd", "w", ",", ","),
        ("Dvorak: quits by the letter", "wasd", "ctrl+c", "ctrl+i", "ctrl+c"),
        ("Dvorak: not by the place", "wasd", "ctrl+j", "ctrl+c", "ctrl+j"),
        ("QWERTZ: help by the letter", "wasd", "?", "_", "?"),
        ("QWERTZ: not by the place", "wasd", "_", "?", "_"),
        ("US", "arrows", "shift+left", "", "shift+left"),
        ("US", "wasd", "space", "space", "space"),
    ]:
        assert LAYOUTS[name].key_for(typed, base) == key, keyboard


def test_a_fixed_key_goes_by_what_it_types_also_where_its_place_has_a_meaning() -> None:
    layout = Layout("mine", {"_": (1, 0, 0, 0)}, {}, FIXED, positional=True)
    assert layout.key_for("?", "_") == "?"
    assert layout.key_for("é", "_") == "_"


@given(st.sampled_from(list(LAYOUTS)), st.text(max_size=8), st.text(max_size=8))
def test_a_press_means_one_of_its_two_names(name: str, typed: str, base: str) -> None:
    assert LAYOUTS[name].key_for(typed, base) in (typed, base)


def test_layouts_are_loaded_by_name() -> None:
    assert {load(name).name for name in ("ttk", "wasd", "arrows")} == {"ttk", "wasd", "arrows"}


def test_an_unknown_name_is_refused_with_those_that_exist() -> None:
    with pytest.raises(InputError) as error:
        load("wsad")
    assert str(error.value) == "wsad: no such file, and no such layout (did you mean 'wasd'?)"
