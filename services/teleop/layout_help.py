"""What the keys mean, in words made from the layout itself. Pure."""

import textwrap
from collections.abc import Mapping

WIDTH = 40  # columns; the narrowest screen that is filled
GAP = "   "
OTHER = "others"

AXES = (("forward", "back"), ("left", "right"), ("up (z)", "down (z)"), ("turn left", "turn right"))
PAIRS = ("forward/back", "strafe", "up/down", "turn")
ACTIONS = {
    "resume": "let others drive",
    "next_robot": "next robot",
    "help": "all keys",
    "suspend": "to the shell",
    "quit": "quit",
    "stop": "stop",
}
SHORT = ("resume", "help", "quit")

Moves = Mapping[str, tuple[int, int, int, int]]
Speeds = Mapping[str, tuple[float, float]]
Actions = Mapping[str, str]


def rows(moves: Moves, speeds: Speeds, actions: Actions) -> list[tuple[list[str], str]]:
    """(keys, meaning) of everything, in the order to show: motions from the simple to the combined, speeds, actions."""
    order = sorted(dict.fromkeys(moves.values()), key=_simple_first)
    found = [(_keys(moves, direction), _motion(direction)) for direction in order]
    found += [(_keys(speeds, factors), _change(factors)) for factors in dict.fromkeys(speeds.values())]
    found += [(_keys(actions, action), words) for action, words in ACTIONS.items() if action in actions.values()]
    return found


def table(moves: Moves, speeds: Speeds, actions: Actions) -> list[str]:
    """A line for each meaning, `meaning keys`; what is longer than 40 columns goes on in the next line."""
    lines = []
    for keys, meaning in rows(moves, speeds, actions):
        text = f"{meaning:<20} {' '.join([*keys, *([OTHER] if meaning == 'stop' else [])])}"
        lines += textwrap.wrap(text, WIDTH, subsequent_indent=" " * 21)
    return lines


def short(moves: Moves, speeds: Speeds, actions: Actions) -> list[str]:
    """The first key for each motion and speed, opposites together, as many in a line as there is room for."""
    items = [f"{keys} {meaning}" for keys, meaning in [*_pairs(moves), *_speeds(speeds)]]
    items += [f"{_keys(actions, action)[0]} {ACTIONS[action]}" for action in SHORT if action in actions.values()]
    lines: list[str] = []
    for item in [*items, f"{OTHER} stop"]:
        if lines and len(f"{lines[-1]}{GAP}{item}") <= WIDTH:
            lines[-1] += f"{GAP}{item}"
        else:
            lines += textwrap.wrap(item, WIDTH)
    return lines


def markdown(moves: Moves, speeds: Speeds, actions: Actions) -> str:
    """The rows as a table for a page."""
    lines = ["| keys | meaning |", "|---|---|"]
    for keys, meaning in rows(moves, speeds, actions):
        words = [*(f"`{key}`" for key in keys), *(["and all others"] if meaning == "stop" else [])]
        lines.append(f"| {' '.join(words)} | {meaning} |")
    return "\n".join(lines) + "\n"


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


def _pairs(moves: Moves) -> list[tuple[str, str]]:
    """The simple motions, each with its opposite; then those that drive and turn, and the diagonals."""
    found = []
    for axis, words in enumerate(PAIRS):
        ways = [tuple(sign * (index == axis) for index in range(4)) for sign in (1, -1)]
        found.append(("/".join(key for way in ways for key in _keys(moves, way)[:1]), words))
    found.append((" ".join(key for key, way in moves.items() if (way[0] or way[1]) and way[3]), "while turning"))
    found.append((" ".join(key for key, way in moves.items() if way[0] and way[1] and not way[3]), "diagonal"))
    return [(keys, words) for keys, words in found if keys]


def _speeds(speeds: Speeds) -> list[tuple[str, str]]:
    """The first key that makes faster and the first that makes slower, for both speeds and for each."""
    found: dict[str, dict[bool, str]] = {}
    for key, factors in speeds.items():
        found.setdefault(_which(factors), {}).setdefault(max(factors) > 1, key)
    return [("/".join(ways[way] for way in (True, False) if way in ways), words) for words, ways in found.items()]
