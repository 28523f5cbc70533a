"""A user's layout file is read, or refused in one line that names the file and the place."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.control.layout_file import MOTIONS, load
from services.teleop.control.layouts import FIXED
from services.teleop.toml_file import InputError

GOOD = """
name = "my keys"
positional = true
[moves]
w = "forward"
"shift+left" = "left"
y = "forward+turn-left"
"ц" = "back + right + up"
[speeds]
"+" = "both +10%"
"-" = "speed -12.5 %"
"." = "turn -90%"
[actions]
h = "resume"
x = "stop"
"""


def written(folder: Path, text: str) -> str:
    (folder / "my_keys.toml").write_text(text)
    return str(folder / "my_keys.toml")


def refusal(folder: Path, text: str) -> str:
    file = written(folder, text)
    with pytest.raises(InputError) as error:
        load(file)
    assert str(error.value).startswith(f"{file}:")
    assert str(error.value).isprintable()
    assert len(str(error.value)) < len(file) + 400
    return str(error.value).removeprefix(file)


def test_a_file_maps_keys_to_motions(tmp_path: Path) -> None:
    layout = load(written(tmp_path, GOOD))
    assert (layout.name, layout.positional) == ("my keys", True)
    assert layout.moves == {
        "w": (1, 0, 0, 0),
        "shift+left": (0, 1, 0, 0),
        "y": (1, 0, 0, 1),
        "ц": (-1, -1, 1, 0),
    }
    assert layout.speeds == {"+": (1.1, 1.1), "-": (0.875, 1.0), ".": (1.0, 0.1)}
    assert layout.actions == {**FIXED, "h": "resume", "x": "stop"}


def test_moves_are_enough_and_the_file_gives_the_name(tmp_path: Path) -> None:
    layout = load(written(tmp_path, '[moves]\nw = "forward"\n'))
    assert (layout.name, layout.positional) == ("my_keys", False)
    assert (layout.speeds, layout.actions) == ({}, FIXED)
    assert layout.help == ["w forward/back   ? all keys", "ctrl+c quit   others stop"]


def test_a_wrong_file_is_refused_in_one_line(tmp_path: Path) -> None:
    rows = [
        ("", ': [moves] has no key, so nothing would drive; write lines such as w = "forward"'),
        (
            "[moves]",
            ': [moves] has no key, so nothing would drive; write lines such as w = "forward"',
        ),
        ('[move]\nw = "forward"', ": 'move' is unknown (did you mean 'moves'?)"),
        ("xyz = 1", ": 'xyz' is unknown; use name, positional, moves, speeds, actions"),
        ("name = 1", ": name is 1; write up to 40 letters in quotes"),
        ('name = ""', ": name is ''; write up to 40 letters in quotes"),
        ('name = "a\\nb"', ": name is 'a\\nb'; write up to 40 letters in quotes"),
        ('positional = "yes"', ": positional is 'yes'; write true or false"),
        ("moves = 1", ": moves is 1; write a section [moves] of lines"),
        ("[[moves]]", ": moves is [{}]; write a section [moves] of lines"),
        (
            '[moves]\nw = "forwards"',
            ": [moves] 'w' = 'forwards': 'forwards' is not a motion (did you mean 'forward'?)",
        ),
        (
            '[moves]\nw = "turn_left"',
            ": [moves] 'w' = 'turn_left': 'turn_left' is not a motion (did you mean 'turn-left'?)",
        ),
        ('[moves]\nw = "Up"', ": [moves] 'w' = 'Up': 'Up' is not a motion (did you mean 'up'?)"),
        ('[moves]\nw = ""', f": [moves] 'w' = '': '' is not a motion; use {', '.join(MOTIONS)}"),
        (
            '[moves]\nw = "forward+back"',
            ": [moves] 'w' = 'forward+back': 'back' is there already, or its opposite",
        ),
        (
            '[moves]\nw = "left+left"',
            ": [moves] 'w' = 'left+left': 'left' is there already, or its opposite",
        ),
        ("[moves]\nw = 1", ": [moves] 'w' = 1; put key and meaning in quotes"),
        ('[moves]\nw.x = "back"', ": [moves] 'w' = {'x': 'back'}; put key and meaning in quotes"),
        (
            '[moves]\nup = "back"\nlft = "left"',
            ": [moves] 'lft' is not a key: write one character, or a name (did you mean 'left'?)",
        ),
        (
            '[moves]\n"shift+w" = "back"',
            ": [moves] 'shift+w' is not a key: write what it types, such as 'W'",
        ),
        ('[moves]\nspace = "back"', ": [moves] 'space' is fixed: it means stop in every layout"),
        ('[moves]\n" " = "back"', ": [moves] ' ' is fixed: it means stop in every layout"),
        (
            '[moves]\n"ctrl+c" = "back"',
            ": [moves] 'ctrl+c' is fixed: it means quit in every layout",
        ),
        ('[moves]\n"ctrl+i" = "back"', ": [moves] 'ctrl+i' is 'tab' to a terminal"),
        (
            '[moves]\nw = "back"\n[actions]\n"?" = "help"',
            ": [actions] '?' is fixed: it means help in every layout",
        ),
        (
            '[moves]\nw = "back"\n[speeds]\nw = "both +1%"',
            ": [speeds] 'w' is given twice, before in [moves]",
        ),
        (
            '[moves]\nw = "back"\n[actions]\nw = "stop"',
            ": [actions] 'w' is given twice, before in [moves]",
        ),
        (
            '[moves]\nw = "back"\nw = "left"',
            ":3: is not TOML: Cannot overwrite a value: 'w = \"left\"'",
        ),
        ('[moves]\n+ = "back"', ":2: is not TOML: Invalid statement: '+ = \"back\"'"),
        (
            '[speeds]\na = "both 10%"',
            ": [speeds] 'a' = 'both 10%': "
            "write both, speed or turn and up to 90 %, such as 'both "
            "+10%'",
        ),
        (
            '[speeds]\na = "both +91%"',
            ": [speeds] 'a' = 'both +91%': "
            "write both, speed or turn and up to 90 %, such as 'both "
            "+10%'",
        ),
        (
            '[speeds]\na = "trun +10%"',
            ": [speeds] 'a' = 'trun +10%': 'trun' is unknown (did you mean 'turn'?)",
        ),
        (
            '[actions]\na = "resum"',
            ": [actions] 'a' = 'resum': is unknown (did you mean 'resume'?)",
        ),
    ]
    for text, words in rows:
        assert refusal(tmp_path, text) == words


def test_what_is_no_file_is_refused_and_never_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    os.mkfifo(tmp_path / "ttk")
    for name, words in (
        ("", "is a folder"),
        ("fifo", "is not a regular file"),
        ("none", "No such file"),
        ("a\0b", "null"),
    ):
        with pytest.raises(InputError, match=words) as error:
            load(f"{tmp_path}/{name}")
        assert str(error.value).isprintable()
    with pytest.raises(InputError, match="is not a regular file"):
        load(f"{tmp_path}/ttk")  # with a slash it is a file, though there is a layout of this name


KEYS = st.one_of(
    st.sampled_from(["w", "W", "up", "shift+up", "space", " ", "ctrl+c", "?"]), st.text(max_size=3)
)
MEANINGS = st.one_of(
    st.sampled_from([*MOTIONS, "forward+turn-left", "both +10%", "turn -5 %", "stop", "resume"]),
    st.text(max_size=9),
)


def quoted(text: str) -> str:
    return (
        '"'
        + "".join(f"\\U{ord(letter):08x}" for letter in text if not 0xD800 <= ord(letter) < 0xE000)
        + '"'
    )


@given(
    st.lists(st.tuples(st.sampled_from(["moves", "speeds", "actions"]), KEYS, MEANINGS), max_size=6)
)
def test_any_file_is_a_layout_or_one_line(
    tmp_path_factory: pytest.TempPathFactory, lines: list[tuple[str, str, str]]
) -> None:
    text = "".join(
        f"[{section}]\n"
        + "".join(
            f"{quoted(key)} = {quoted(value)}\n" for where, key, value in lines if where == section
        )
        for section in ("moves", "speeds", "actions")
    )
    file = written(tmp_path_factory.getbasetemp(), text)
    try:
        layout = load(file)
    except InputError as error:
        assert str(error).startswith(file)
        assert str(error).isprintable()
    else:
        assert layout.moves and all(any(way) for way in layout.moves.values())
        assert all(0.05 < factor < 2 for factors in layout.speeds.values() for factor in factors)
        assert FIXED.items() <= layout.actions.items()
        assert all(len(line) <= 40 for line in [*layout.help, *layout.table])
