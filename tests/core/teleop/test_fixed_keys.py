"""Each key has one name, which the error for another spelling gives."""

import pytest

from services.teleop.control.layouts import FIXED, NAMED, KeyNameError, is_foreign, key_name


def test_a_right_name_stays() -> None:
    for name in [
        "i",
        "I",
        "<",
        "+",
        ";",
        "é",
        "ц",
        "1",
        "up",
        "shift+left",
        "ctrl+x",
        "alt+w",
        "f12",
    ]:
        assert key_name(name) == name


def test_every_name_that_there_is_is_right() -> None:
    for name in [*NAMED, *FIXED, "ctrl++", "alt++", "ctrl+alt+shift+pagedown"]:
        assert key_name(name) == name


def test_a_blank_is_space() -> None:
    assert key_name(" ") == "space"


def test_a_wrong_name_is_refused() -> None:
    for text, words in [
        ("Up", "is not a key: write 'up'"),
        ("Shift+Left", "is not a key: write 'shift+left'"),
        ("shift+ctrl+left", "is not a key: write 'ctrl+shift+left'"),
        ("shift+shift+left", "is not a key: write 'shift+left'"),
        ("shift+w", "is not a key: write what it types, such as 'W'"),
        ("ctrl+X", "is not a key: write 'ctrl+x'"),
        ("ctrl+i", "is 'tab' to a terminal"),
        ("ctrl+m", "is 'enter' to a terminal"),
        ("lef", "is not a key: write one character, or a name (did you mean 'left'?)"),
        ("meta+x", "is not a key: write one character, or a name; use up, down"),
        ("ctrl+", "is not a key: write one character, or a name"),
        ("", "is empty"),
        ("  ", "is empty"),
        ("\t", "is empty"),
        ("\x1b", "is not a key"),
        ("界", "is not a key"),
        ("\u0301", "is not a key"),
        ("ab", "is not a key"),
    ]:
        with pytest.raises(KeyNameError) as error:
            key_name(text)
        assert str(error.value).startswith(words)


def test_letters_of_other_scripts_are_known() -> None:
    rows = [
        ("ш", True),
        ("Ш", True),
        ("ctrl+\u0441", True),
        ("β", True),
        ("ש", True),
        ("z", False),
        ("ü", False),
        ("ñ", False),
        ("ğ", False),
        (";", False),
        ("9", False),
        ("up", False),
        ("", False),
    ]
    for key, foreign in rows:
        assert is_foreign(key) == foreign
