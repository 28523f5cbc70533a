"""Parses a terminal's input into events: keys, replies to queries, focus. Pure: bytes and times in,
events out.

It parses the traditional sequences and the Kitty keyboard protocol, which also reports releases
(sw.kovidgoyal.net/kitty/keyboard-protocol). An unknown sequence becomes one `Unknown`, so that none
of its letters is taken for a key.
"""

import math
import re
from collections.abc import Iterator
from typing import NamedTuple


class Key(NamedTuple):
    """A key event. `name` is what the key types ("i", "I", "space", "shift+left", "ctrl+c"), `base`
    what its place types on a US keyboard ("" if unknown). `kind` is "press", "repeat" or "release",
    and `code` identifies the key; or "typed" if the terminal reports no releases.
    """

    name: str
    base: str = ""
    kind: str = "typed"
    code: str = ""


class Unknown(NamedTuple):
    """Something typed that has no name here."""

    text: str


FINALS = {
    "A": "up",
    "B": "down",
    "C": "right",
    "D": "left",
    "H": "home",
    "F": "end",
    "E": "begin",
    "P": "f1",
    "Q": "f2",
    "R": "f3",
    "S": "f4",
}
NUMBERS = {
    1: "home",
    2: "insert",
    3: "delete",
    4: "end",
    5: "pageup",
    6: "pagedown",
    7: "home",
    8: "end",
    11: "f1",
    12: "f2",
    13: "f3",
    14: "f4",
    15: "f5",
    17: "f6",
    18: "f7",
    19: "f8",
    20: "f9",
    21: "f10",
    23: "f11",
    24: "f12",
}
CODES = {9: "tab", 13: "enter", 27: "escape", 32: "space", 127: "backspace"}
KEYPAD = {
    57414: "enter",
    57417: "left",
    57418: "right",
    57419: "up",
    57420: "down",
    57421: "pageup",
    57422: "pagedown",
    57423: "home",
    57424: "end",
    57425: "insert",
    57426: "delete",
}
KEYPAD_TYPES = dict(zip(range(57399, 57414), "0123456789./*-+", strict=True))
SILENT = {*range(57358, 57364), *range(57441, 57455)}  # modifiers such as Shift, Ctrl and Caps Lock
SHIFTED_FINALS = {"a": "up", "b": "down", "c": "right", "d": "left"}  # rxvt's encoding of Shift

SHIFT, ALT, CTRL, SUPER, CAPS = 1, 2, 4, 8 | 16 | 32, 64
KINDS = {1: "press", 2: "repeat", 3: "release"}
US_SHIFTED = dict(zip("`1234567890-=[]\\;',./", '~!@#$%^&*()_+{}|:"<>?', strict=True))


def key(fields: list[list[int]], final: str, releases: bool) -> Key | Unknown | None:
    """The key event of a control sequence with these parameters; None for a modifier key."""
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
            place = name  # Ctrl combinations count by the letter, not the place
    else:
        return Unknown(f"key {code}")
    # by place: the layout may change before the release
    return Key(name, place, kind, str(base or codes[0]))


def _typed(text: str, shifted: str, modifiers: int) -> str:
    """What a key types with these modifiers, if it types `text` alone and `shifted` with Shift."""
    if modifiers & (CTRL | ALT | SUPER):
        return _with(modifiers, text.lower())
    if bool(modifiers & SHIFT) != (bool(modifiers & CAPS) and text.isalpha()):
        return shifted or US_SHIFTED.get(text) or text.upper()
    return text


def _with(modifiers: int, name: str) -> str:
    held = [
        word
        for bit, word in ((CTRL, "ctrl"), (ALT, "alt"), (SUPER, "super"), (SHIFT, "shift"))
        if modifiers & bit
    ]
    return "+".join([*held, name])


ESCAPE_WAIT = 0.05  # s after which an Escape is the key, and not the start of a sequence
LATE = 0.5  # s within which the rest of a sequence may arrive on a slow line
LONG_PASTE = 10.0  # s without a byte after which an unfinished paste is given up
MAX_SEQUENCE = 4096  # bytes; longer sequences are discarded


class Answer(NamedTuple):
    """A reply of the terminal. `to` is the query: "keyboard" (it supports the Kitty protocol, and
    has these flags on), "terminal" (its identity) or "alive".
    """

    to: str
    flags: int = 0


class Focus(NamedTuple):
    """The terminal's window gained (or lost) focus."""

    gained: bool


Event = Key | Answer | Focus | Unknown

PASTE = re.compile(rb"\x1b\[200~(?s:.*?)\x1b\[201~")
CONTROL = re.compile(rb"\x1b\[([0-?]*)[ -/]*([@-~])")
STRING = re.compile(rb"\x1b[P\]_^X](?s:.*?)(?:\x1b\\|\x07)")
CONSOLE = re.compile(rb"\x1b\[\[([A-E])")  # F1 to F5 of the Linux console
PARAMETERS = re.compile(r"\d{0,9}(?:[:;]\d{0,9})*")
SINGLE = re.compile(rb"\x1bO([ -~])")
UNFINISHED = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*|\[\[|O|[P\]_^X](?s:.*))?\Z")
UNFINISHED_KEY = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*|\[\[|O)")
OPEN_PASTE = b"\x1b[200~"


class Keyboard:
    """Parses the input of a terminal; times in seconds. `releases`: the terminal reports key
    releases, so an event without a kind is a press.
    """

    def __init__(self) -> None:
        self.releases = False
        self.rest = b""  # an incomplete sequence
        self._since = 0.0  # when its last byte arrived
        self._escaped = -LATE  # when an Escape was last taken for the key
        self._reported = False  # whether the incomplete sequence was reported

    def feed(self, data: bytes, now: float) -> list[Event]:
        """The events that are complete once `data` has arrived."""
        if not self.rest and data[:1] in (b"[", b"O") and now - self._escaped < LATE:
            data = b"\x1b" + data  # the rest of a sequence whose Escape arrived much earlier
        self.rest, self._since, self._reported = self.rest + data, now, False
        return list(self._events())

    def wait(self, now: float) -> list[Event]:
        """The events that are complete since nothing more has arrived: a lone Escape, or an
        unfinished sequence.
        """
        silent = now - self._since
        if self.rest == b"\x1b" and silent >= ESCAPE_WAIT:
            self.rest, self._escaped = b"", now
            return [Key("escape")]
        if self.rest[:1] != b"\x1b" or silent < LATE:
            return []
        reported, self._reported = self._reported, True
        if silent >= _patience(self.rest):
            self.rest = b""
        return [] if reported else [Unknown("an unfinished sequence")]

    def forget(self) -> None:
        """Discard an incomplete sequence."""
        self.rest = b""

    def _events(self) -> Iterator[Event]:
        while self.rest:
            found = _split(self.rest, self.releases)
            if found is None:
                if len(self.rest) > MAX_SEQUENCE:
                    self.rest = (
                        OPEN_PASTE + self.rest[-6:]
                        if self.rest.startswith(OPEN_PASTE)
                        else self.rest[:2]
                    )
                return
            event, length = found
            self.rest = self.rest[length:]
            if event is not None:
                yield event


def _patience(rest: bytes) -> float:
    """How long (s) an incomplete sequence is kept, so that its end is not taken for keys."""
    if UNFINISHED_KEY.fullmatch(rest):
        return math.inf
    return LONG_PASTE if rest.startswith(OPEN_PASTE) else LATE


def _split(data: bytes, releases: bool) -> tuple[Event | None, int] | None:
    """The first event of `data` (None: to be ignored) and its number of bytes; None if it is
    incomplete.
    """
    if data[0] != 0x1B:
        return _character(data)
    if match := PASTE.match(data) or STRING.match(data):
        return None, match.end()
    if data.startswith(OPEN_PASTE):
        return None
    if match := CONSOLE.match(data):
        return Key(f"f{match[1][0] - 0x40}"), match.end()
    if UNFINISHED.match(data):
        return None
    if match := CONTROL.match(data):
        return _control(match[1].decode(), match[2].decode(), releases), match.end()
    if match := SINGLE.match(data):
        name = FINALS.get(match[1].decode())
        return (Key(name, name) if name else Unknown(repr(match[0]))), match.end()
    return _after_escape(data)


def _after_escape(data: bytes) -> tuple[Event | None, int] | None:
    """The event of an Escape that starts no known sequence: a character with Alt, two Escapes, an
    aborted sequence.
    """
    if data[1] == 0x1B:
        return Key("escape"), 1
    if data[1] == 0x5B:
        return Unknown(repr(data[:2])), 2
    if (found := _character(data[1:])) is None:
        return None
    event, length = found
    return (Key(f"alt+{event.name}") if isinstance(event, Key) else event), length + 1


def _character(data: bytes) -> tuple[Event, int] | None:
    first = data[0]
    if first < 0x20 or first == 0x7F:
        return Key(_control_character(first)), 1
    length = 1 if first < 0xC0 else 2 if first < 0xE0 else 3 if first < 0xF0 else 4
    if len(data) < length and all(0x80 <= byte < 0xC0 for byte in data[1:]):
        return None
    try:
        text = data[:length].decode()
    except UnicodeDecodeError:
        return Unknown(repr(data[:1])), 1
    name = "space" if text == " " else text
    return Key(name, name if text.isascii() else ""), length


def _control_character(byte: int) -> str:
    if byte in CODES or byte in (8, 10):
        return CODES.get(byte) or ("backspace" if byte == 8 else "enter")
    return "ctrl+space" if byte == 0 else f"ctrl+{chr(byte + 0x40).lower()}"


def _control(parameters: str, final: str, releases: bool) -> Event | None:
    """The event of the sequence `CSI parameters final`; None for reports that are to be ignored."""
    if (parameters, final) == ("0", "n"):
        return Answer("alive")
    if parameters.startswith("?"):
        flags = parameters[1:]
        return (
            Answer(
                {"u": "keyboard", "c": "terminal"}[final],
                int(flags[:9]) if flags.isdecimal() else 0,
            )
            if final in "uc"
            else None
        )
    if parameters[:1] in ("<", "=", ">") or final in "MmtynR":
        return None  # reports such as mouse events and the cursor position
    if not parameters and final in "IO":
        return Focus(final == "I")
    if not parameters and final in SHIFTED_FINALS:
        return Key(f"shift+{SHIFTED_FINALS[final]}", f"shift+{SHIFTED_FINALS[final]}")
    if (parameters, final) == ("", "Z"):
        return Key("shift+tab")
    if not PARAMETERS.fullmatch(parameters):
        return Unknown(f"CSI {parameters[:20]} {final}")
    fields = [[int(part or 0) for part in field.split(":")] for field in parameters.split(";")]
    return key(fields, final, releases)
