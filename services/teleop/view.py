"""What the screen says, as styled lines for a terminal of any size. Pure: a `State` in, lines out."""

import math
from itertools import zip_longest

from . import bars
from .map import chart
from .state import Line, Source, State
from .words import alarms, clean, driver, mode, seconds, short

__all__ = ["Line", "Source", "State", "render"]

WIDE, TALL = 80, 20  # from this size on words and keys are on the left, the map is on the right
LEFT = 55  # columns of the left side
LABEL = 11  # columns before a value
KEYS = 41  # columns of a line of help
ROOMY = 30  # rows from which on there is room for everything
SLOW, LATE = 0.1, 0.95  # s, and the part of real time: beyond these driving feels wrong

Ranked = tuple[int, Line]
"""A line and its rank: where there is no room, those of the highest rank go first."""

ALARM, SPEED, DRIVER, SETTING, HEADER, TITLE, LINK, BLANK, SPARE = range(9)
EMPTY: Ranked = (BLANK, [])


def render(state: State, columns: int, rows: int) -> list[Line]:
    """The picture: at most `rows` lines, each at most `columns` wide."""
    if columns < 1 or rows < 1:
        return []
    loud = [(ALARM, line) for line in _alarms(state, columns, rows)]
    if state.help:
        lines = _help(state, loud, columns, rows)
    elif columns >= WIDE and rows >= TALL:
        lines = _wide(state, loud, columns, rows)
    else:
        lines = _narrow(state, loud, columns, rows)
    return [_cut(line, columns) for line in lines[:rows]]


def _wide(state: State, loud: list[Ranked], columns: int, rows: int) -> list[Line]:
    status = (DRIVER, _sides([("", " "), driver(state)], [("", f"{mode(state)} ")], columns))
    *speeds, settings = _speeds(state, columns)
    top = [_title(state, columns), *loud, status, EMPTY, *speeds, (SPARE, []), settings, EMPTY]
    links = [line for _, line in _links(state, columns, 12 if rows >= ROOMY else 3)]
    needed = len(links) + 1 + len(state.keys)
    upper = _fit(top, max(rows - 1 - needed, sum(rank < BLANK for rank, _ in top)))
    room = rows - 1 - len(upper)
    left = [*links, [], *_keys(state, columns, room - len(links) - 1)][:room]
    right = chart(state, columns - LEFT - 1, room)
    return [*upper, *_beside(left, right, room), _warning(state)]


def _narrow(state: State, loud: list[Ranked], columns: int, rows: int) -> list[Line]:
    """One side only. With few rows or columns the bars go, and velocities are words."""
    who, how = [("", " "), driver(state)], [("", f" {mode(state)}")]
    if columns >= bars.SHORT and rows >= len(loud) + 6:
        speeds = _speeds(state, columns)
    else:
        speeds, who, how = [(SPEED, line) for line in _compact(state, columns)], who[1:], [("", mode(state))]
    lines = [_title(state, columns), *loud, (DRIVER, who), (DRIVER, how), *speeds, *_links(state, columns, 3)]
    if state.warning:
        lines.append((SETTING, _warning(state)))
    shown = _fit(lines, rows)
    if rows - len(shown) > 2 and state.keys:
        shown += [[], *_keys(state, columns, rows - len(shown) - 1)]
    room = rows - len(shown)
    return [*shown, *(chart(state, columns - 1, min(20, room)) if room > 4 else [])]


def _help(state: State, loud: list[Ranked], columns: int, rows: int) -> list[Line]:
    """The whole layout, in as many columns as it takes; alarms and velocities stay."""
    speeds = [(SPEED, line) for line in _compact(state, columns)]
    top = _fit([_title(state, columns), *loud, *speeds, EMPTY], rows)
    room = rows - len(top) - 1
    if room < 1:
        return top
    lines, missing = _columns([clean(key, KEYS - 1) for key in state.keys], columns, room)
    end = " ? back" + (f"   {missing} more lines: enlarge" if missing else "")
    return [*top, *([("", line)] for line in lines), [("dim", end)]]


def _columns(texts: list[str], columns: int, rows: int) -> tuple[list[str], int]:
    """Texts below and beside each other, as many as there is room for; and how many are missing."""
    lines, shown = [""] * min(rows, len(texts)), 0
    while shown < len(texts):
        beside = texts[shown : shown + rows]
        start = max(map(len, lines)) + bool(shown or columns >= KEYS)  # a blank before each
        if shown and start + max(map(len, beside)) > columns:
            break
        lines = [f"{line:<{start}}{text}" for line, text in zip_longest(lines, beside, fillvalue="")]
        shown += len(beside)
    return lines, len(texts) - shown


def _alarms(state: State, columns: int, rows: int) -> list[Line]:
    """Each as wide as the screen, in the longest wording that fits; all in one line if there are too many."""
    found = alarms(state)
    if len(found) >= rows:
        all_of_them = " + ".join(wordings[-1] for wordings in found)
        found = [[all_of_them]] if found and len(all_of_them) <= columns else found
    lines: list[Line] = []
    for wordings in found:
        text = next((words for words in wordings if len(words) <= columns), wordings[-1])
        lines.append([("alarm", (f" {text}" if len(text) < columns else text).ljust(columns))])
    return lines


def _title(state: State, columns: int) -> Ranked:
    robot = clean(state.robot, 64) or "the robot at the root"
    others = ", ".join(clean(name, 64) for name in state.others)
    product = "holozen teleop   " if columns >= WIDE else ""
    left = f" {product}{robot}" + (f"   Tab: {others}" if others else "")
    parts = _sides([("", left)], [("", f"{clean(state.source, 40)} ")], columns)
    return TITLE, [("title", "".join(text for _, text in parts).ljust(columns))]


def _speeds(state: State, columns: int) -> list[Ranked]:
    ranks = (HEADER, SPEED, SPEED, SPEED, SETTING)
    return list(zip(ranks, bars.table(state, columns), strict=True))


def _compact(state: State, columns: int) -> list[Line]:
    """Velocities in words: one line where there is room, else three of at most 20 columns."""
    command = "silent" if state.command is None else " ".join(map(short, state.command))
    measured = " ".join(map(short, state.measured)) if state.known else "unknown"
    speed = short(math.hypot(*state.measured[:2]))[1:] if state.known else "?"
    style = "driving" if state.moving else ""
    pace = ("", f"speed {speed} of {short(abs(state.speed))[1:]}")
    if columns < 72:
        return [[pace], [(style, f"go {command}")], [("", f"is {measured}")]]
    return [[("", " "), pace, ("", "   command "), (style, command), ("", f"   measured {measured}")]]


def _links(state: State, columns: int, most: int) -> list[Ranked]:
    """Who hears us, how old odom is, and who publishes: at most `most` of them."""
    names = ", ".join(clean(name, 64) for name in state.listeners)
    heard = ("good", names) if state.listeners else ("warning", "nobody")
    age, pace = _odom(state), _pace(state)
    roomy = columns >= LEFT
    lines = [_labelled("listening", heard)]
    lines += [[*age, *pace]] if roomy else [age, pace] if pace else [age]
    for index, source in enumerate(state.sources[:most]):
        label = " " if not roomy else " sources" if index == 0 else ""
        lines.append([("", label.ljust(LABEL if roomy else 1)), *_source(state, source)])
    if len(state.sources) > most:
        lines.append([("dim", f"{'':{LABEL if roomy else 1}}and {len(state.sources) - most} more")])
    return [(LINK, line) for line in lines]


def _odom(state: State) -> Line:
    """Its age, in a field of one width: it is another one in every picture."""
    if not math.isfinite(state.odom_age):
        return _labelled("odom age", ("warning", "none"))
    style, age = "good" if state.known else "warning", state.odom_age
    return _labelled("odom age", (style, (f"{age * 1000:.0f} ms" if age < 1 else seconds(age)).ljust(6)))


def _pace(state: State) -> Line:
    trip, factor = state.round_trip, state.real_time_factor
    parts: Line = []
    if trip is not None:
        parts += [("dim", " round trip "), ("" if trip < SLOW else "warning", f"{seconds(trip):<9}")]
    if factor is not None:
        parts += [("dim", " real time "), ("" if factor > LATE else "warning", f"{short(abs(factor))[1:]}x")]
    return parts


def _source(state: State, source: Source) -> Line:
    verdict = "obeyed" if source.obeyed else "held" if source.held else "waits"
    ours = bool(source.name) and source.name == state.source
    name = "you" if ours else clean(source.name, 20)
    text = f"{verdict:<6} {clean(f'{source.rate:3.0f}', 4)} Hz  {name} {clean(source.priority, 20)}"
    return [("good" if ours and source.obeyed else "" if source.obeyed else "dim", text)]


def _labelled(label: str, *parts: tuple[str, str]) -> Line:
    return [("", f" {label}".ljust(LABEL)), *parts]


def _keys(state: State, columns: int, room: int) -> list[Line]:
    """The help; where some of it finds no room, how to see the rest."""
    if room < 1:
        return []
    lines: list[Line] = [[("", _key(key, columns))] for key in state.keys[:room]]
    return lines if len(state.keys) <= room else [*lines[:-1], [("dim", " ? shows all keys")]]


def _key(text: str, columns: int) -> str:
    return f"{' ' if columns >= KEYS else ''}{clean(text, KEYS - 1)}"


def _warning(state: State) -> Line:
    return [("warning", f" {clean(state.warning)}")] if state.warning else []


def _sides(left: Line, right: Line, columns: int) -> Line:
    """One part at the left edge, another at the right one as far as there is room, two blanks between them."""
    room = columns - sum(len(text) for _, text in left) - 2
    fits = _cut(right, max(0, room))
    return [*left, ("", " " * (room + 2 - sum(len(text) for _, text in fits))), *fits]


def _beside(left: list[Line], right: list[Line], rows: int) -> list[Line]:
    lines = []
    for row in range(rows):
        line = _cut(left[row], LEFT) if row < len(left) else []
        blank = ("", " " * (LEFT - sum(len(text) for _, text in line)))
        lines.append([*line, blank, *right[row]] if row < len(right) else line)
    return lines


def _fit(lines: list[Ranked], rows: int) -> list[Line]:
    """The lines that find room: of the highest rank the last goes first."""
    kept = sorted(range(len(lines)), key=lambda index: (lines[index][0], index))[: max(0, rows)]
    return [lines[index][1] for index in sorted(kept)]


def _cut(line: Line, columns: int) -> Line:
    """As much of a line as fits into `columns`."""
    kept = []
    for style, text in line:
        if text and columns > 0:
            kept.append((style, text[:columns]))
        columns -= len(text)
    return kept
