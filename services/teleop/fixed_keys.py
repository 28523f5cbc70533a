"""The names of keys: `i`, `I`, `<`, `space`, `up`, `shift+left`, `ctrl+c`."""

import re
import unicodedata

from .toml_file import closest

NAMED = (
    "up", "down", "left", "right", "space", "tab", "escape", "enter", "backspace",
    "insert", "delete", "home", "end", "pageup", "pagedown", *(f"f{number}" for number in range(1, 13)),
)  # fmt: skip
SAME = {"ctrl+i": "tab", "ctrl+m": "enter", "ctrl+j": "enter", "ctrl+h": "backspace", "ctrl+[": "escape"}
"""What a terminal has sent for these since the teletype: it cannot tell the two apart."""

FIXED = {
    "ctrl+c": "quit", "ctrl+z": "suspend", "?": "help", "tab": "next_robot", "space": "stop", "escape": "stop",
}  # fmt: skip
"""Keys that do the same in every layout. With --deadman space is the dead-man instead."""

_MODIFIERS = ("ctrl", "alt", "shift")
_SPLIT = re.compile(r"((?:(?:ctrl|alt|shift)\+)*)(.+)", re.DOTALL | re.IGNORECASE)


class KeyNameError(ValueError):
    """No key has this name; the text says which name is right, if it can be told."""


def key_name(text: str) -> str:
    """The one name of the key that `text` names; KeyNameError."""
    if text == " ":
        return "space"
    match = _SPLIT.fullmatch(text)
    if not match or text.isspace():
        raise KeyNameError("is empty")
    words, last = match[1].lower(), match[2] if len(match[2]) == 1 else match[2].lower()
    modifiers = [word for word in _MODIFIERS if f"{word}+" in words]
    if is_character(last):
        _check_character(modifiers, last)
    elif last not in NAMED:
        raise KeyNameError(f"is no key: write one character, or a name: {closest(last, list(NAMED))}")
    name = "+".join([*modifiers, last])
    if text != name:
        raise KeyNameError(f"is no key: write {name!r}")
    return name


def is_character(text: str) -> bool:
    """Whether `text` is one printable character, one column wide."""
    if len(text) != 1 or text == " " or not text.isprintable():
        return False
    return not unicodedata.combining(text) and unicodedata.east_asian_width(text) not in "WF"


def is_foreign(key: str) -> bool:
    """Whether a key types a letter of another script than Latin, such as Cyrillic."""
    last = key[-1:]
    return last.isalpha() and not unicodedata.name(last, "LATIN").startswith("LATIN")


def _check_character(words: list[str], last: str) -> None:
    if "shift" in words:
        raise KeyNameError(f"is no key: write what it types, such as {last.upper()!r}")
    if "ctrl" in words and last.lower() != last:
        raise KeyNameError(f"is no key: write 'ctrl+{last.lower()}'")
    if words == ["ctrl"] and f"ctrl+{last}" in SAME:
        raise KeyNameError(f"is {SAME[f'ctrl+{last}']!r} to a terminal")
