"""What each key means, as data: the layouts `ttk`, `wasd` and `arrows`, and those that people write themselves."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from . import layout_help
from .fixed_keys import FIXED, is_foreign

Direction = tuple[int, int, int, int]
"""Forward, left, up, counter-clockwise: each -1, 0 or 1, times the speed (the last: times the turn)."""

ACTIONS = ("stop", "resume", "next_robot", "help", "quit", "suspend")


class LayoutError(ValueError):
    """A layout that cannot be used; the text is one line that says why."""


@dataclass(frozen=True)
class Layout:
    """Which key does what. Keys are named as in `keys.py`; one that is in no table stops the robot.

    `speeds` holds what a key multiplies the speed and the turn by. `positional`: keys mean places on the keyboard, not
    letters, where the terminal tells the place.
    """

    name: str
    moves: Mapping[str, Direction]
    speeds: Mapping[str, tuple[float, float]]
    actions: Mapping[str, str]
    positional: bool = False

    @cached_property
    def help(self) -> list[str]:
        """The most needed keys in few lines, each at most 40 columns wide."""
        return layout_help.short(self.moves, self.speeds, self.actions)

    @cached_property
    def table(self) -> list[str]:
        """All keys, a line for each meaning, at most 40 columns wide."""
        return layout_help.table(self.moves, self.speeds, self.actions)

    def markdown(self) -> str:
        """All keys as a table for a page."""
        return layout_help.markdown(self.moves, self.speeds, self.actions)

    def key_for(self, typed: str, base: str) -> str:
        """The key of this layout that was pressed. `typed` is what it types, `base` what its place types on a keyboard
        of the US with shift applied, or "" if the terminal does not tell.

        Fixed keys go by what they type; so do signs in a positional layout that has nothing at their place. On a
        keyboard of another script no letter of a layout can be typed: there the place counts in every layout.
        """
        if typed in FIXED:
            return typed
        if self.positional and base and base not in FIXED and (base in self or _is_letter(typed)):
            return base
        if typed in self or not base:
            return typed
        by_place = is_foreign(typed) or (not typed[-1:].isalpha() and base not in FIXED)
        return base if by_place and base in self else typed

    def __contains__(self, key: str) -> bool:
        return key in self.moves or key in self.speeds or key in self.actions


def _is_letter(key: str) -> bool:
    return len(key) == 1 and key.isalpha()


FORWARD, BACK = (1, 0, 0, 0), (-1, 0, 0, 0)
LEFT, RIGHT = (0, 1, 0, 0), (0, -1, 0, 0)
TURN_LEFT, TURN_RIGHT = (0, 0, 0, 1), (0, 0, 0, -1)

# With shift held for strafing, the other arrows go on meaning what they do.
ARROWS: dict[str, Direction] = {
    "up": FORWARD, "down": BACK, "left": TURN_LEFT, "right": TURN_RIGHT,
    "shift+up": FORWARD, "shift+down": BACK, "shift+left": LEFT, "shift+right": RIGHT,
}  # fmt: skip

TTK = Layout(
    name="ttk",
    moves={
        "u": (1, 0, 0, 1), "i": FORWARD, "o": (1, 0, 0, -1),
        "j": TURN_LEFT, "l": TURN_RIGHT,
        "m": (-1, 0, 0, -1), ",": BACK, ".": (-1, 0, 0, 1),
        "U": (1, 1, 0, 0), "I": FORWARD, "O": (1, -1, 0, 0),
        "J": LEFT, "L": RIGHT,
        "M": (-1, 1, 0, 0), "<": BACK, ">": (-1, -1, 0, 0),
        "t": (0, 0, 1, 0), "b": (0, 0, -1, 0),
        **ARROWS,
    },
    speeds={
        "q": (1.1, 1.1), "z": (0.9, 0.9),
        "w": (1.1, 1.0), "x": (0.9, 1.0),
        "e": (1.0, 1.1), "c": (1.0, 0.9),
    },
    actions={**FIXED, "k": "stop", "K": "stop", "r": "resume"},
)  # fmt: skip

_WASD: dict[str, Direction] = {
    "w": FORWARD, "s": BACK, "a": LEFT, "d": RIGHT, "q": TURN_LEFT, "e": TURN_RIGHT,
}  # fmt: skip
_PLUS_MINUS = {"+": (1.1, 1.1), "=": (1.1, 1.1), "-": (0.9, 0.9)}

WASD = Layout(
    name="wasd",
    moves={**_WASD, **{key.upper(): direction for key, direction in _WASD.items()}},  # caps lock is no reason to stand
    speeds=_PLUS_MINUS,
    actions={**FIXED, "r": "resume", "R": "resume"},
    positional=True,
)

ARROW_KEYS = Layout(name="arrows", moves=ARROWS, speeds=_PLUS_MINUS, actions={**FIXED, "r": "resume"})

LAYOUTS = {layout.name: layout for layout in (TTK, WASD, ARROW_KEYS)}


def load(name_or_path: str) -> Layout:
    """The layout with a name, else the one in a file; LayoutError."""
    from .layout_file import read

    return LAYOUTS.get(name_or_path) or read(name_or_path)
