"""What each key means, as data: the layouts `ttk`, `wasd` and `arrows`, and the help that is made
from them.
"""

import re
import textwrap
import unicodedata
from collections.abc import Mapping
from functools import cached_property

from msgspec import Struct
from msgspec.structs import replace

from ..toml_file import one_of

NAMED = (
    "up",
    "down",
    "left",
    "right",
    "space",
    "tab",
    "escape",
    "enter",
    "backspace",
    "insert",
    "delete",
    "home",
    "end",
    "pageup",
    "pagedown",
    *(f"f{number}" for number in range(1, 13)),
)
SAME = {
    "ctrl+i": "tab",
    "ctrl+m": "enter",
    "ctrl+j": "enter",
    "ctrl+h": "backspace",
    "ctrl+[": "escape",
}
"""Keys for which a terminal sends the same bytes as for another key."""

FIXED = {
    "ctrl+c": "quit",
    "ctrl+z": "suspend",
    "?": "help",
    "tab": "next_robot",
    "space": "stop",
    "escape": "stop",
}
"""Keys that do the same in every layout. With --deadman space is the dead-man instead."""

_MODIFIERS = ("ctrl", "alt", "shift")
_SPLIT = re.compile(r"((?:(?:ctrl|alt|shift)\+)*)(.+)", re.DOTALL | re.IGNORECASE)


class KeyNameError(ValueError):
    """No key has this name. The text suggests a valid name if there is one."""


def key_name(text: str) -> str:
    """The canonical name of the key that `text` names. Raises KeyNameError."""
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
        raise KeyNameError(
            f"is not a key: write one character, or a name{one_of(last, list(NAMED))}"
        )
    name = "+".join([*modifiers, last])
    if text != name:
        raise KeyNameError(f"is not a key: write {name!r}")
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
        raise KeyNameError(f"is not a key: write what it types, such as {last.upper()!r}")
    if "ctrl" in words and last.lower() != last:
        raise KeyNameError(f"is not a key: write 'ctrl+{last.lower()}'")
    if words == ["ctrl"] and f"ctrl+{last}" in SAME:
        raise KeyNameError(f"is {SAME[f'ctrl+{last}']!r} to a terminal")


WIDTH = 40  # columns of a line of help
GAP = "   "
OTHER = "others"

AXES = (("forward", "back"), ("left", "right"), ("up (z)", "down (z)"), ("turn left", "turn right"))
PAIRS = ("forward/back", "strafe", "up/down", "turn")
ACTION_WORDS = {
    "resume": "let others drive",
    "next_robot": "next robot",
    "help": "all keys",
    "suspend": "to the shell",
    "quit": "quit",
    "stop": "stop",
}
SHORT = ("resume", "help", "quit")


def _keys(table: Mapping[str, object], meaning: object) -> list[str]:
    return [key for key, value in table.items() if value == meaning]


def _simple_first(direction: tuple[int, ...]) -> tuple[int, list[int], list[int]]:
    moved = [axis for axis, value in enumerate(direction) if value]
    return len(moved), moved, [-direction[axis] for axis in moved]


def _motion(direction: tuple[int, ...]) -> str:
    return " + ".join(AXES[axis][value < 0] for axis, value in enumerate(direction) if value)


def _change(factors: tuple[float, float]) -> str:
    return f"{_which(factors)} {100 * (factors[factors[0] == 1] - 1):+.3g} %"


def _which(factors: tuple[float, float]) -> str:
    speed, turn = factors
    return "both speeds" if speed == turn else "speed" if turn == 1 else "turn speed"


def _pairs(moves: Mapping[str, "Direction"]) -> list[tuple[str, str]]:
    """The simple motions, each with its opposite; then combinations with turning, and the
    diagonals.
    """
    found = []
    for axis, words in enumerate(PAIRS):
        ways = [tuple(sign * (index == axis) for index in range(4)) for sign in (1, -1)]
        found.append(("/".join(key for way in ways for key in _keys(moves, way)[:1]), words))
    found.append(
        (
            " ".join(key for key, way in moves.items() if (way[0] or way[1]) and way[3]),
            "while turning",
        )
    )
    found.append(
        (
            " ".join(key for key, way in moves.items() if way[0] and way[1] and not way[3]),
            "diagonal",
        )
    )
    return [(keys, words) for keys, words in found if keys]


def _speeds(speeds: Mapping[str, tuple[float, float]]) -> list[tuple[str, str]]:
    """The first keys that increase and decrease, for both speeds together and for each."""
    found: dict[str, dict[bool, str]] = {}
    for key, factors in speeds.items():
        found.setdefault(_which(factors), {}).setdefault(max(factors) > 1, key)
    return [
        ("/".join(ways[way] for way in (True, False) if way in ways), words)
        for words, ways in found.items()
    ]


Direction = tuple[int, int, int, int]
"""Forward, left, up, counter-clockwise: each is -1, 0 or 1, to be multiplied by the speed, the last
by the turn.
"""

ACTIONS = ("stop", "resume", "next_robot", "help", "quit", "suspend")


class Layout(Struct, frozen=True, dict=True):
    """The meaning of keys, by the names of `key_name`; a key that is in no table stops the robot.

    `speeds` holds the factors of speed and turn. `positional`: keys are places on the keyboard
    rather than letters, where the terminal reports the place.
    """

    name: str
    moves: Mapping[str, Direction]
    speeds: Mapping[str, tuple[float, float]]
    actions: Mapping[str, str]
    positional: bool = False

    def meanings(self) -> list[tuple[list[str], str]]:
        """(keys, meaning) of everything in display order: motions from simple to combined, speeds,
        actions.
        """
        order = sorted(dict.fromkeys(self.moves.values()), key=_simple_first)
        found = [(_keys(self.moves, direction), _motion(direction)) for direction in order]
        found += [
            (_keys(self.speeds, factors), _change(factors))
            for factors in dict.fromkeys(self.speeds.values())
        ]
        return found + [
            (keys, words)
            for action, words in ACTION_WORDS.items()
            if (keys := _keys(self.actions, action))
        ]

    @cached_property
    def help(self) -> list[str]:
        """The first key for each motion and speed, opposites together, in lines of at most 40
        columns.
        """
        items = [
            f"{keys} {meaning}" for keys, meaning in [*_pairs(self.moves), *_speeds(self.speeds)]
        ]
        items += [
            f"{keys[0]} {ACTION_WORDS[action]}"
            for action in SHORT
            if (keys := _keys(self.actions, action))
        ]
        lines: list[str] = []
        for item in [*items, f"{OTHER} stop"]:
            if lines and len(f"{lines[-1]}{GAP}{item}") <= WIDTH:
                lines[-1] += f"{GAP}{item}"
            else:
                lines += textwrap.wrap(item, WIDTH)
        return lines

    @cached_property
    def table(self) -> list[str]:
        """All keys, a line for each meaning, at most 40 columns wide."""
        lines = []
        for keys, meaning in self.meanings():
            text = f"{meaning:<20} {' '.join([*keys, *([OTHER] if meaning == 'stop' else [])])}"
            lines += textwrap.wrap(text, WIDTH, subsequent_indent=" " * 21)
        return lines

    @cached_property
    def without_strafing(self) -> "Layout":
        """What is left of it for a drive that cannot move sideways."""
        return replace(self, moves={key: way for key, way in self.moves.items() if not way[1]})

    def key_for(self, typed: str, base: str) -> str:
        """The key of this layout that was pressed. `typed` is what it types, `base` what the same
        place types on a US keyboard, with shift applied, or "" if the terminal does not report it.

        Fixed keys count by what they type, and so do symbols in a positional layout that has
        nothing at their place. On a keyboard for another script no letter of a layout can be typed,
        so the place counts in every layout.
        """
        if typed in FIXED:
            return typed
        if (
            self.positional
            and base
            and base not in FIXED
            and (base in self or (len(typed) == 1 and typed.isalpha()))
        ):
            return base
        if typed in self or not base:
            return typed
        by_place = is_foreign(typed) or (not typed[-1:].isalpha() and base not in FIXED)
        return base if by_place and base in self else typed

    def __contains__(self, key: str) -> bool:
        return key in self.moves or key in self.speeds or key in self.actions


FORWARD, BACK = (1, 0, 0, 0), (-1, 0, 0, 0)
LEFT, RIGHT = (0, 1, 0, 0), (0, -1, 0, 0)
TURN_LEFT, TURN_RIGHT = (0, 0, 0, 1), (0, 0, 0, -1)

# With shift held for strafing, the other arrows keep their meaning.
ARROWS: dict[str, Direction] = {
    "up": FORWARD,
    "down": BACK,
    "left": TURN_LEFT,
    "right": TURN_RIGHT,
    "shift+up": FORWARD,
    "shift+down": BACK,
    "shift+left": LEFT,
    "shift+right": RIGHT,
}

TTK = Layout(
    name="ttk",
    moves={
        "u": (1, 0, 0, 1),
        "i": FORWARD,
        "o": (1, 0, 0, -1),
        "j": TURN_LEFT,
        "l": TURN_RIGHT,
        "m": (-1, 0, 0, -1),
        ",": BACK,
        ".": (-1, 0, 0, 1),
        "U": (1, 1, 0, 0),
        "I": FORWARD,
        "O": (1, -1, 0, 0),
        "J": LEFT,
        "L": RIGHT,
        "M": (-1, 1, 0, 0),
        "<": BACK,
        ">": (-1, -1, 0, 0),
        "t": (0, 0, 1, 0),
        "b": (0, 0, -1, 0),
        **ARROWS,
    },
    speeds={
        "q": (1.1, 1.1),
        "z": (0.9, 0.9),
        "w": (1.1, 1.0),
        "x": (0.9, 1.0),
        "e": (1.0, 1.1),
        "c": (1.0, 0.9),
    },
    actions={**FIXED, "k": "stop", "K": "stop", "r": "resume"},
)

_WASD: dict[str, Direction] = {
    "w": FORWARD,
    "s": BACK,
    "a": LEFT,
    "d": RIGHT,
    "q": TURN_LEFT,
    "e": TURN_RIGHT,
}
_PLUS_MINUS = {"+": (1.1, 1.1), "=": (1.1, 1.1), "-": (0.9, 0.9)}

WASD = Layout(
    name="wasd",
    # also with caps lock
    moves={**_WASD, **{key.upper(): direction for key, direction in _WASD.items()}},
    speeds=_PLUS_MINUS,
    actions={**FIXED, "r": "resume", "R": "resume"},
    positional=True,
)

ARROW_KEYS = Layout(
    name="arrows", moves=ARROWS, speeds=_PLUS_MINUS, actions={**FIXED, "r": "resume"}
)

LAYOUTS = {layout.name: layout for layout in (TTK, WASD, ARROW_KEYS)}
