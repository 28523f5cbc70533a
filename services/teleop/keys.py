"""What a terminal sends, as events: keys, answers to questions, focus. Pure: bytes and times in, events out.

It reads the sequences that terminals have sent for decades and the Kitty keyboard protocol, which tells releases too
(sw.kovidgoyal.net/kitty/keyboard-protocol). What it does not know becomes `Unknown` whole: no letter of a longer
sequence is ever taken for a key.
"""

import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from .keynames import CODES, FINALS, SHIFTED_FINALS, Key, Unknown, key

ESCAPE_WAIT = 0.05  # s until an Escape is one, and not the start of something longer
LATE = 0.5  # s in which the rest of a sequence may come on a slow line
LONG_PASTE = 10.0  # s without a byte until the end of a paste is no longer waited for
LONGEST = 4096  # bytes; a sequence that is longer has no end


class Answer(NamedTuple):
    """What the terminal answers: "keyboard" (it speaks the Kitty protocol, and which flags are on), "terminal" (what it
    is) or "alive".
    """

    to: str
    flags: int = 0


class Focus(NamedTuple):
    """The terminal's window got (or lost) the focus."""

    gained: bool


__all__ = ["Answer", "Event", "Focus", "Key", "Keyboard", "Unknown"]

Event = Key | Answer | Focus | Unknown

PASTE = re.compile(rb"\x1b\[200~(?s:.*?)\x1b\[201~")
CONTROL = re.compile(rb"\x1b\[([0-?]*)[ -/]*([@-~])")
STRING = re.compile(rb"\x1b[P\]_^X](?s:.*?)(?:\x1b\\|\x07)")
CONSOLE = re.compile(rb"\x1b\[\[([A-E])")  # F1 to F5 of the Linux console
NUMBERS = re.compile(r"\d{0,9}(?:[:;]\d{0,9})*")
SINGLE = re.compile(rb"\x1bO([ -~])")
UNFINISHED = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*|\[\[|O|[P\]_^X](?s:.*))?\Z")
UNFINISHED_KEY = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*|\[\[|O)")
OPEN_PASTE = b"\x1b[200~"


class Keyboard:
    """Reads what a terminal sends; times in seconds. `releases`: it tells them, so what tells no kind is pressed."""

    def __init__(self) -> None:
        self.releases = False
        self._rest = b""  # the start of something longer
        self._since = 0.0  # when its last byte came
        self._escaped = -LATE  # when an Escape turned out to be one
        self._told = False  # that it is unfinished

    def feed(self, data: bytes, now: float) -> list[Event]:
        """The events that are complete with `data`."""
        if not self._rest and data[:1] in (b"[", b"O") and now - self._escaped < LATE:
            data = b"\x1b" + data  # the rest of a sequence whose first byte came long before
        self._rest, self._since, self._told = self._rest + data, now, False
        return list(self._events())

    def wait(self, now: float) -> list[Event]:
        """What is known without more bytes: a lone Escape, or a sequence that was never finished."""
        silent = now - self._since
        if self._rest == b"\x1b" and silent >= ESCAPE_WAIT:
            self._rest, self._escaped = b"", now
            return [Key("escape")]
        if self._rest[:1] != b"\x1b" or silent < LATE:
            return []
        told, self._told = self._told, True
        if silent >= _patience(self._rest):
            self._rest = b""
        return [] if told else [Unknown("an unfinished sequence")]

    def forget(self) -> None:
        """Drop what is incomplete."""
        self._rest = b""

    def _events(self) -> Iterator[Event]:
        while self._rest:
            found = _split(self._rest, self.releases)
            if found is None:
                if len(self._rest) > LONGEST:
                    self._rest = OPEN_PASTE + self._rest[-6:] if self._rest.startswith(OPEN_PASTE) else self._rest[:2]
                return
            event, length = found
            self._rest = self._rest[length:]
            if event is not None:
                yield event


def _patience(rest: bytes) -> float:
    """How long the start of something is kept: its end must never be taken for keys."""
    if UNFINISHED_KEY.fullmatch(rest):
        return math.inf
    return LONG_PASTE if rest.startswith(OPEN_PASTE) else LATE


def _split(data: bytes, releases: bool) -> tuple[Event | None, int] | None:
    """The first event of `data` (None: nothing that counts) and how many bytes it took; None while it is incomplete."""
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
    """Escape and what is no sequence: a character with Alt, two Escapes, or a sequence that broke off."""
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
    return Key("space" if text == " " else text, _shown(text)), length


def _control_character(byte: int) -> str:
    if byte in CODES or byte in (8, 10):
        return CODES.get(byte) or ("backspace" if byte == 8 else "enter")
    return "ctrl+space" if byte == 0 else f"ctrl+{chr(byte + 0x40).lower()}"


def _shown(text: str) -> str:
    return "space" if text == " " else text if text.isascii() else ""


def _control(parameters: str, final: str, releases: bool) -> Event | None:
    """The event of `CSI parameters final`; None for reports that are nobody's key."""
    if (parameters, final) == ("0", "n"):
        return Answer("alive")
    if parameters.startswith("?"):
        flags = parameters[1:]
        return (
            Answer({"u": "keyboard", "c": "terminal"}[final], int(flags[:9]) if flags.isdecimal() else 0)
            if final in "uc"
            else None
        )
    if parameters[:1] in ("<", "=", ">") or final in "MmtynR":
        return None  # the mouse, the cursor's place and their like
    if not parameters and final in "IO":
        return Focus(final == "I")
    if not parameters and final in SHIFTED_FINALS:
        return Key(f"shift+{SHIFTED_FINALS[final]}", f"shift+{SHIFTED_FINALS[final]}")
    if (parameters, final) == ("", "Z"):
        return Key("shift+tab")
    if not NUMBERS.fullmatch(parameters):
        return Unknown(f"CSI {parameters[:20]} {final}")
    fields = [[int(part or 0) for part in field.split(":")] for field in parameters.split(";")]
    return key(fields, final, releases)
