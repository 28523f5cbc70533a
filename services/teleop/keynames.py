"""What the keys are called: the numbers and letters of control sequences, as names. Pure."""

from typing import NamedTuple


class Key(NamedTuple):
    """A key event. `name` is what it types ("i", "I", "space", "shift+left", "ctrl+c"), `base` the same by its place on
    a US keyboard ("" if unknown). `kind` is "press", "repeat" or "release" of the key `code`, or "typed" where the
    terminal tells no releases.
    """

    name: str
    base: str = ""
    kind: str = "typed"
    code: str = ""


class Unknown(NamedTuple):
    """Something that was typed and that nobody knows here."""

    text: str


FINALS = {"A": "up", "B": "down", "C": "right", "D": "left", "H": "home", "F": "end", "E": "begin",
           "P": "f1", "Q": "f2", "R": "f3", "S": "f4"}  # fmt: skip
NUMBERS = {1: "home", 2: "insert", 3: "delete", 4: "end", 5: "pageup", 6: "pagedown", 7: "home", 8: "end",
           11: "f1", 12: "f2", 13: "f3", 14: "f4", 15: "f5", 17: "f6", 18: "f7", 19: "f8", 20: "f9", 21: "f10",
           23: "f11", 24: "f12"}  # fmt: skip
CODES = {9: "tab", 13: "enter", 27: "escape", 32: "space", 127: "backspace"}
KEYPAD = {57414: "enter", 57417: "left", 57418: "right", 57419: "up", 57420: "down", 57421: "pageup",
          57422: "pagedown", 57423: "home", 57424: "end", 57425: "insert", 57426: "delete"}  # fmt: skip
KEYPAD_TYPES = dict(zip(range(57399, 57414), "0123456789./*-+", strict=True))
SILENT = {*range(57358, 57364), *range(57441, 57455)}  # Shift, Ctrl, Caps Lock and their like mean nothing alone
SHIFTED_FINALS = {"a": "up", "b": "down", "c": "right", "d": "left"}  # as rxvt says Shift

SHIFT, ALT, CTRL, SUPER, CAPS = 1, 2, 4, 8 | 16 | 32, 64
KINDS = {1: "press", 2: "repeat", 3: "release"}
US_SHIFTED = dict(zip("`1234567890-=[]\\;',./", '~!@#$%^&*()_+{}|:"<>?', strict=True))


def key(fields: list[list[int]], final: str, releases: bool) -> Key | Unknown | None:
    """The key of a control sequence with these parameters; None for one that means nothing alone."""
    code, modifiers, kind = fields[0][0], 0, 0
    if len(fields) > 1:
        modifiers, kind = max(fields[1][0] - 1, 0), fields[1][1] if len(fields[1]) > 1 else 0
    if final == "u":
        return _kitty(fields[0], modifiers, KINDS.get(kind or 1, "press"))
    name = NUMBERS.get(code) if final == "~" else FINALS.get(final)
    if name is None:
        return Unknown(f"CSI {code} {final}")
    typed = _with(modifiers, name)
    return Key(typed, typed, KINDS.get(kind, "press" if releases else "typed"), name)


def _kitty(codes: list[int], modifiers: int, kind: str) -> Key | Unknown | None:
    code, shifted, base = (*codes, 0, 0)[:3]
    if code in SILENT:
        return None
    name = CODES.get(code) or KEYPAD.get(code)
    if name is None and code in KEYPAD_TYPES:
        code = ord(KEYPAD_TYPES[code])
    if name is not None:
        name = place = _with(modifiers, name)
    elif 0x20 < code < 0xE000:
        name = _typed(chr(code), chr(shifted) if 0x20 < shifted < 0xE000 else "", modifiers)
        place = _typed(chr(base or code), "", modifiers) if (base or code) < 0x7F else ""
        if modifiers & CTRL and code < 0x7F:
            place = name  # what Ctrl does goes by the letter, wherever it is
    else:
        return Unknown(f"key {code}")
    return Key(name, place, kind, str(base or codes[0]))  # the layout may change before it is let go


def _typed(text: str, shifted: str, modifiers: int) -> str:
    """What a key types that types `text` alone and `shifted` with Shift."""
    if modifiers & (CTRL | ALT | SUPER):
        return _with(modifiers, text.lower())
    if bool(modifiers & SHIFT) != (bool(modifiers & CAPS) and text.isalpha()):
        return shifted or US_SHIFTED.get(text) or text.upper()
    return text


def _with(modifiers: int, name: str) -> str:
    held = [word for bit, word in ((CTRL, "ctrl"), (ALT, "alt"), (SUPER, "super"), (SHIFT, "shift")) if modifiers & bit]
    return "+".join([*held, name])
