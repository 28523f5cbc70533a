"""Each key has one name, which the error for another spelling gives."""

import pytest

from services.teleop.control.layouts import FIXED, NAMED, KeyNameError, is_foreign, key_name


def test_a_right_name_stays() -> None:
    for name in ["i", "I", "<", "+", ";", "é", "ц", "1", "up", "shift+left", "ctrl+x", "alt+w", "f12"]:
        assert key_name(name) == name


def test_every_name_that_there_is_is_right() -> None:
    for name in [*NAMED, *FIXED, "ctrl++", "alt++", "ctrl+alt+shift+pagedown"]:
        assert key_name(name) == name


def test_a_blank_is_space() -> None:
    assert key_name(" ") == "space"


def test_a_wrong_name_is_refused() -> None:
    for text, words in [
        ("Up", "is no key: write 'up'"),
        ("Shift+Left", "is no key: write 'shift+left'"),
        ("shift+ctrl+left", "is no key: write 'ctrl+shift+left'"),
        ("shift+shift+left", "is no key: write 'shift+left'"),
        ("shift+w", "is no key: write what it types, such as 'W'"),
        ("ctrl+X", "is no key: write 'ctrl+x'"),
        ("ctrl+i", "is 'tab' to a terminal"),
        ("ctrl+m", "is 'enter' to a terminal"),
        ("lef", "is no key: write one character, or a name: did you mean 'left'?"),
        ("meta+x", "is no key: write one character, or a name: use up, down"),
        ("ctrl+", "is no key: write one character, or a name"),
        ("", "is empty"),
        ("  ", "is empty"),
        ("\t", "is empty"),
        ("\x1b", "is no key"),
        ("界", "is no key"),
        ("\u0301", "is no key"),
        ("ab", "is no key"),
    ]:
        with pytest.raises(KeyNameError) as error:
            key_name(text)
        assert str(error.value).startswith(words)


def test_letters_of_other_scripts_are_known() -> None:
    rows = [("ш", True), ("Ш", True), ("ctrl+\u0441", True), ("β", True), ("ש", True),
                                              ("z", False), ("ü", False), ("ñ", False), ("ğ", False), (";", False),
                                              ("9", False), ("up", False), ("", False)]  # fmt: skip
    for key, foreign in rows:
        assert is_foreign(key) == foreign
