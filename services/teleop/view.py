"""Lays the screen out as styled lines, for a terminal of any size. Pure: a `State` in, lines
out.
"""

import math
from collections.abc import Sequence
from itertools import groupby, zip_longest

from msgspec import Struct

from holozen.limits import STOP, Planar
from holozen.plotting import FARTHEST, Plane, Robot, drawn
from holozen.wire import SENDERS

Line = list[tuple[str, str]]
"""(style, text) from left to right; a style is "", "title", "driving", "good", "warning", "dim" or
"alarm".
"""


class Source(Struct):
    """A command source: its Zenoh priority, its rate (Hz), and how the sim treats it."""

    name: str
    priority: str = ""
    rate: float = 0.0
    obeyed: bool = False
    held: bool = False


class State(Struct):
    """Everything that the screen shows, in m, rad, m/s, rad/s and s.

    Names and warnings came over the wire and may hold anything; they are made printable where they
    are drawn.
    """

    robot: str = ""  # "" is the robot at the root
    name: str = ""  # in the sim; empty while it is not known
    others: list[str] = []  # robots that Tab switches to
    mode: str = "hold"  # or "latch"
    why: str = ""  # how key releases are detected, or why they are not needed
    detached: bool = False  # whether no operator can see the terminal
    deadman: bool = False
    deadman_held: bool = False
    speed: float = 0.5
    turn: float = 1.0
    speed_limit: float = 1000.0
    turn_limit: float = 1000.0
    command: Planar | None = None  # None: no commands are published
    measured: Planar = STOP
    odom_age: float = math.inf  # inf before the first odom
    stale: bool = True
    round_trip: float | None = None  # to the sim and back; None: unknown
    real_time_factor: float | None = None
    listeners: list[str] = []
    sources: list[Source] = []  # command sources that the sim reports; may include ourselves
    obeyed: str = ""
    held: bool = False  # whether the autopilot is held until `resume`
    source: str = ""  # our own name
    stopped: str = ""  # source of the software stop
    paused: bool = False  # whether the sim is
    pose: tuple[float, float, float] | None = None  # x, y, yaw in the frame of odom
    trail: Sequence[tuple[float, float]] = ()  # oldest first
    seen: Sequence[tuple[float, float]] = ()  # by its lidars
    warning: str = ""  # the latest
    key: str = "cmd_vel"
    keys: list[str] = []  # help of the active layout, lines of at most 40 characters
    help: bool = False  # whether the whole layout is shown in place of the picture
    ascii: bool = False  # for a terminal whose font has no braille

    @property
    def known(self) -> bool:
        """Whether `measured` is current."""
        return not self.stale and math.isfinite(self.odom_age)

    @property
    def moving(self) -> bool:
        """Whether we command motion."""
        return self.command is not None and any(self.command)


LINK_LIMIT = 0.25  # s of round trip; beyond, the operator steers by outdated data


def clean(text: str, longest: int = 200) -> str:
    """The text in printable ASCII, whose width is its length, cut to `longest` characters; `?` for
    all others.
    """
    if not (text.isascii() and text.isprintable()):
        text = "".join(letter if " " <= letter <= "~" else "?" for letter in text[: longest + 1])
    return text if len(text) <= longest else text[: max(0, longest - 1)] + "~"


def number(value: float) -> str:
    """A velocity with its sign, in at most 7 characters: +0.500, -12.34, +1e+300. There is no
    -0.000.
    """
    if abs(value) < 5e-4:
        value = 0.0
    size = abs(value)
    digits = 3 if size < 9.9995 else 2 if size < 99.995 else 1 if size < 999.95 else 0
    return f"{value:+.{digits}f}" if size < 99999 else f"{value:+.0e}"


def short(value: float) -> str:
    """A velocity with its sign and two digits, in 5 characters below 10: +0.50."""
    if abs(value) < 5e-3:
        value = 0.0
    return f"{value:+.2f}" if abs(value) < 9.995 else number(value)


def amount(value: float) -> str:
    """A speed, without a sign: 0.500, 1000."""
    return number(abs(value))[1:]


def seconds(value: float) -> str:
    """A duration: 0.62 ms, 12 ms, 3.2 s."""
    if not value < 1:
        return f"{value:.1f} s" if value < 99999 else "an age"
    milliseconds = max(0.0, value) * 1000
    return f"{milliseconds:.{2 if milliseconds < 1 else 1 if milliseconds < 10 else 0}f} ms"


def planar(velocity: tuple[float, float, float]) -> str:
    """A planar velocity (m/s, m/s, rad/s) as text."""
    x, y, turn = map(number, velocity)
    return f"x {x} y {y} m/s turn {turn} rad/s"


def alarms(state: State) -> list[list[str]]:
    """The alarms, the most severe first; each is a list of wordings, from the longest to the
    shortest.
    """
    found = []
    if state.stopped:
        release = f"`holozen release{' ' * bool(state.robot)}{clean(state.robot, 64)}`"
        by = f"STOPPED by {clean(state.stopped, 40)}: {release}"
        found.append([f"{by} lets it drive again", by, f"STOPPED: {release}", "STOPPED"])
    if state.paused:
        play = "PAUSED: `holozen sim play`"
        found.append([f"{play} continues the sim", play, "PAUSED"])
    if state.detached:
        found.append(
            [
                "terminal detached: hands off; attach to it again to drive",
                "terminal detached: hands off",
            ]
        )
    if not state.listeners:
        found.append([f"NO SUBSCRIBER on {clean(state.key, 100)}", "NO SUBSCRIBER"])
    if not math.isfinite(state.odom_age):
        found.append(["NO ODOM: nothing was heard from a robot", "NO ODOM"])
    elif state.stale:
        found.append(
            [f"ODOM IS STALE: the last one came {seconds(state.odom_age)} ago", "ODOM IS STALE"]
        )
    if state.round_trip is not None and state.round_trip > LINK_LIMIT:
        delay = seconds(state.round_trip)
        found.append([f"SLOW LINK: the robot answers {delay} later", f"SLOW LINK: {delay}"])
    if state.deadman and not state.deadman_held:
        found.append(["dead man: hold space", "dead man"])
    return found


def driver(state: State) -> tuple[str, str]:
    """A style, and the source that drives: a warning if that is not us while we command motion."""
    if state.obeyed and state.obeyed == state.source:
        return "good", "you drive"
    if state.obeyed:
        name = clean(state.obeyed, 24)
        return ("warning", f"{name} drives, not you") if state.moving else ("", f"{name} drives")
    return "", "no driver; the autopilot is held" if state.held else "no driver"


def mode(state: State) -> str:
    """How keys drive, and why."""
    name = f"{state.mode} + dead man" if state.deadman else state.mode
    return clean(f"{name}: {state.why}" if state.why else name)


NUMBER = 7  # characters
AXES = (("x forward", "x", "m/s"), ("y left", "y", "m/s"), ("turn left", "turn", "rad/s"))
SHORT = 39  # columns; minimum for the bars
LONG = 72  # columns from which on the axes have long names and units


def velocity_bars(state: State, columns: int) -> list[Line]:
    """Five lines: a header, a line for each of x, y and turn, and the set speeds with their
    limits.
    """
    long = columns >= LONG
    label, unit, gap = (11, 6, 3) if long else (6, 0, 1)
    cells = min(41, max(3, (columns - label - unit - gap) // 2 - NUMBER))
    cells -= 1 - cells % 2  # odd: the middle one is zero
    half = cells + NUMBER + gap
    measured = state.measured if state.known else None
    lines = [_header(state, label, half)]
    for axis, (full, name, of) in enumerate(AXES):
        most = _scale(state, axis)
        line = [("", f" {full if long else name}".ljust(label))]
        line += _cell(state.command, axis, most, cells, "driving", state.ascii)
        line += [("", " " * gap), *_cell(measured, axis, most, cells, "good", state.ascii)]
        lines.append([*line, ("dim", f" {of}")] if long else line)
    return [*lines, _settings(state, label + half if long else 0)]


def _header(state: State, label: int, half: int) -> Line:
    style, text = (
        ("driving" if state.moving else "", "command")
        if state.command
        else ("dim", "command: silent")
    )
    known = ("", "measured") if state.known else ("dim", "measured: unknown")
    return [("", " " * label), (style, text.ljust(half)), known]


def _settings(state: State, second: int) -> Line:
    """The line of the set speeds. The turn begins at the column `second`, or if that is 0, after
    the speed.
    """
    speed, turn = amount(state.speed), amount(state.turn)
    most, fastest = f"{state.speed_limit:.4g}", f"{state.turn_limit:.4g}"
    if not second:
        return [
            ("", f" speed {speed}"),
            ("dim", f" of {most}"),
            ("", f"  turn {turn}"),
            ("dim", f" of {fastest}"),
        ]
    parts = [("", f" speed     {speed}"), ("dim", f" m/s, limit {most}")]
    parts.append(("", " " * (second - sum(len(text) for _, text in parts))))
    return [*parts, ("", f"turn {turn}"), ("dim", f" rad/s, limit {fastest}")]


def _scale(state: State, axis: int) -> float:
    """The value of a full bar: the set speed, or more if it is exceeded. x and y share one
    scale.
    """
    axes, setting = ((2,), state.turn) if axis == 2 else ((0, 1), state.speed)
    shown = [state.command] if state.command else []
    shown += [state.measured] if state.known else []
    sizes = [abs(velocity[each]) for velocity in shown for each in axes]
    return max([setting, *(size for size in sizes if math.isfinite(size))])


def _cell(
    velocity: Planar | None, axis: int, most: float, cells: int, style: str, ascii: bool
) -> Line:
    if velocity is None:
        return [*bar(0.0, cells, style, ascii), ("dim", "-".rjust(NUMBER))]
    value = velocity[axis]
    part = value / most if most > 0 and math.isfinite(value) else 0.0
    # Left is positive for y and for a turn, as in ROS; the bar points where the robot goes.
    still = number(value) == number(0.0)
    return [
        *bar(part if axis == 0 else -part, cells, style, ascii),
        ("" if still else style, number(value).rjust(NUMBER)),
    ]


def bar(part: float, cells: int, style: str, ascii: bool = False) -> Line:
    """A bar for a `part` from -1 to 1, in an odd number of cells: from the middle to the right, or
    to the left if it is negative.
    """
    full, half, rest = ("=", "=", "-") if ascii else ("▄", "▖" if part > 0 else "▗", "▁")
    side = cells // 2
    halves = min(2 * side, round(abs(part) * 2 * side))
    filled = full * (halves // 2) + half * (halves % 2)
    empty = rest * (side - len(filled))
    if part > 0:
        return [("dim", f"{rest * side}|"), (style, filled), ("dim", empty)]
    return [("dim", empty), (style, filled[::-1]), ("dim", f"|{rest * side}")]


def plain_line(state: State) -> str:
    """The contents of the screen in one line, alarms first; printable ASCII without a line end."""
    parts = [wordings[0] for wordings in alarms(state)]
    parts += [clean(state.name or state.robot, 64) or "robot at the root", driver(state)[1]]
    parts.append(f"command {planar(state.command)}" if state.command else "command silent")
    parts.append(f"measured {planar(state.measured)}" if state.known else "measured unknown")
    parts += _plain_links(state)
    parts.append(f"speed {amount(state.speed)} of {state.speed_limit:.4g} m/s")
    parts.append(f"turn {amount(state.turn)} of {state.turn_limit:.4g} rad/s")
    parts.append(mode(state))
    if state.warning:
        parts.append(f"warning: {clean(state.warning)}")
    return "; ".join(parts)


def _plain_links(state: State) -> list[str]:
    """Ages, subscribers and other sources. Problems are among the alarms."""
    parts = []
    if state.known:
        parts.append(f"odom {seconds(state.odom_age)} old")
    if state.round_trip is not None:
        parts.append(f"round trip {seconds(state.round_trip)}")
    if state.real_time_factor is not None:
        parts.append(f"real time {amount(state.real_time_factor)}")
    if state.listeners:
        parts.append("listening: " + ", ".join(clean(name, 64) for name in state.listeners))
    others = [source for source in state.sources if source.name != state.source]
    if others:
        parts.append(
            "also sending: " + ", ".join(f"{clean(s.name, 64)}{' (held)' * s.held}" for s in others)
        )
    return parts


ROOT = "the robot at the root"  # whose keys begin with no name
WIDE, TALL = 80, 20  # from this size on, text and keys are on the left, and the map is on the right
LEFT = 55  # columns of the left side
LABEL = 11  # columns before a value
KEYS = 41  # columns of a line of help
ROOMY = 30  # rows from which on everything fits
# s of round trip, and real-time factor; worse values are noticeable when driving
SLOW, LATE = (0.1, 0.95)

Ranked = tuple[int, Line]
"""A rank and a line: if there is no room for all lines, those of the highest rank are dropped
first.
"""

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
    """All parts below one another. With few rows or columns, velocities are text instead of
    bars.
    """
    driving, how = [("", " "), driver(state)], [("", f" {mode(state)}")]
    if columns >= SHORT and rows >= len(loud) + 6:
        speeds = _speeds(state, columns)
    else:
        speeds, driving, how = (
            [(SPEED, line) for line in _compact(state, columns)],
            driving[1:],
            [("", mode(state))],
        )
    lines = [
        _title(state, columns),
        *loud,
        (DRIVER, driving),
        (DRIVER, how),
        *speeds,
        *_links(state, columns, 3),
    ]
    if state.warning:
        lines.append((SETTING, _warning(state)))
    shown = _fit(lines, rows)
    if rows - len(shown) > 2 and state.keys:
        shown += [[], *_keys(state, columns, rows - len(shown) - 1)]
    room = rows - len(shown)
    return [*shown, *(chart(state, columns - 1, min(20, room)) if room > 4 else [])]


def _help(state: State, loud: list[Ranked], columns: int, rows: int) -> list[Line]:
    """The whole layout in as many columns as it needs, below the alarms and velocities."""
    speeds = [(SPEED, line) for line in _compact(state, columns)]
    top = _fit([_title(state, columns), *loud, *speeds, EMPTY], rows)
    room = rows - len(top) - 1
    if room < 1:
        return top
    lines, missing = _columns([clean(key, KEYS - 1) for key in state.keys], columns, room)
    end = " ? back" + (f"   {missing} more lines: enlarge" if missing else "")
    return [*top, *([("", line)] for line in lines), [("dim", end)]]


def _columns(texts: list[str], columns: int, rows: int) -> tuple[list[str], int]:
    """As many texts as fit, in columns, and the number of those that do not fit."""
    lines, shown = [""] * min(rows, len(texts)), 0
    while shown < len(texts):
        beside = texts[shown : shown + rows]
        start = max(map(len, lines)) + bool(shown or columns >= KEYS)  # a blank before each
        if shown and start + max(map(len, beside)) > columns:
            break
        lines = [
            f"{line:<{start}}{text}" for line, text in zip_longest(lines, beside, fillvalue="")
        ]
        shown += len(beside)
    return lines, len(texts) - shown


def _alarms(state: State, columns: int, rows: int) -> list[Line]:
    """The alarms, each as wide as the screen and in the longest wording that fits; all in one line
    if they are many.
    """
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
    robot = clean(state.name or state.robot, 64) or ROOT
    others = ", ".join(clean(name, 64) or ROOT for name in state.others)
    product = "holozen teleop   " if columns >= WIDE else ""
    left = f" {product}{robot}" + (f"   Tab: {others}" if others else "")
    parts = _sides([("", left)], [("", f"{clean(state.source, 40)} ")], columns)
    return TITLE, [("title", "".join(text for _, text in parts).ljust(columns))]


def _speeds(state: State, columns: int) -> list[Ranked]:
    ranks = (HEADER, SPEED, SPEED, SPEED, SETTING)
    return list(zip(ranks, velocity_bars(state, columns), strict=True))


def _compact(state: State, columns: int) -> list[Line]:
    """Velocities as text: one line if it fits, else three of at most 20 columns."""
    command = "silent" if state.command is None else " ".join(map(short, state.command))
    measured = " ".join(map(short, state.measured)) if state.known else "unknown"
    speed = short(math.hypot(*state.measured[:2]))[1:] if state.known else "?"
    style = "driving" if state.moving else ""
    pace = ("", f"speed {speed} of {short(abs(state.speed))[1:]}")
    if columns < 72:
        return [[pace], [(style, f"go {command}")], [("", f"is {measured}")]]
    return [
        [("", " "), pace, ("", "   command "), (style, command), ("", f"   measured {measured}")]
    ]


def _links(state: State, columns: int, most: int) -> list[Ranked]:
    """Subscribers, age of odom, and sources: at most `most` of them."""
    names = ", ".join(clean(name, 64) for name in state.listeners)
    heard = ("good", names) if state.listeners else ("warning", "none")
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
    """The age of odom, in a field of constant width, since it changes all the time."""
    if not math.isfinite(state.odom_age):
        return _labelled("odom age", ("warning", "none"))
    style, age = "good" if state.known else "warning", state.odom_age
    return _labelled(
        "odom age", (style, (f"{age * 1000:.0f} ms" if age < 1 else seconds(age)).ljust(6))
    )


def _pace(state: State) -> Line:
    trip, factor = state.round_trip, state.real_time_factor
    parts: Line = []
    if trip is not None:
        parts += [
            ("dim", " round trip "),
            ("" if trip < SLOW else "warning", f"{seconds(trip):<9}"),
        ]
    if factor is not None:
        parts += [
            ("dim", " real time "),
            ("" if factor > LATE else "warning", f"{short(abs(factor))[1:]}x"),
        ]
    return parts


def _source(state: State, source: Source) -> Line:
    verdict = "obeyed" if source.obeyed else "held" if source.held else "waits"
    ours = bool(source.name) and source.name == state.source
    name = "you" if ours else clean(source.name, 20)
    kind = clean(SENDERS.get(source.priority, source.priority), 20)
    text = f"{verdict:<6} {clean(f'{source.rate:3.0f}', 4)} Hz  {name} {kind}"
    return [("good" if ours and source.obeyed else "" if source.obeyed else "dim", text)]


def _labelled(label: str, *parts: tuple[str, str]) -> Line:
    return [("", f" {label}".ljust(LABEL)), *parts]


def _keys(state: State, columns: int, room: int) -> list[Line]:
    """The lines of help; if they do not fit, the last one tells how to see the rest."""
    if room < 1:
        return []
    lines: list[Line] = [[("", _key(key, columns))] for key in state.keys[:room]]
    return lines if len(state.keys) <= room else [*lines[:-1], [("dim", " ? shows all keys")]]


def _key(text: str, columns: int) -> str:
    return f"{' ' if columns >= KEYS else ''}{clean(text, KEYS - 1)}"


def _warning(state: State) -> Line:
    return [("warning", f" {clean(state.warning)}")] if state.warning else []


def _sides(left: Line, right: Line, columns: int) -> Line:
    """One part at the left edge, and one at the right edge, cut to fit, with two blanks or more
    between them.
    """
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
    """The lines that fit. Of those with the highest rank, the last is dropped first."""
    kept = sorted(range(len(lines)), key=lambda index: (lines[index][0], index))[: max(0, rows)]
    return [lines[index][1] for index in sorted(kept)]


def _cut(line: Line, columns: int) -> Line:
    """A line cut to `columns`."""
    kept = []
    for style, text in line:
        if text and columns > 0:
            kept.append((style, text[:columns]))
        columns -= len(text)
    return kept


FAR_SIGHT = 50  # columns of a map that shows what lidars see, which leaves the track less room
PLACES = {"sign": "driving", "trail": "good", "grid": "dim", "": ""}
"""The styles of the map's parts while odom is current."""


def chart(state: State, columns: int, rows: int) -> list[Line]:
    """The map: `rows` lines of at most `columns` characters, the last with the pose and the
    scale.
    """
    if columns < 8 or rows < 3:
        return []
    pose = state.pose
    if pose and not (max(map(abs, pose[:2])) < FARTHEST and math.isfinite(pose[2])):
        pose = None
    robot = Robot("", *(pose or (math.nan, math.nan, 0.0)), state.trail)
    seen = state.seen if columns >= FAR_SIGHT else ()
    cells, scale = drawn(Plane([robot], seen=seen), (columns, rows), state.ascii, grid=True)
    styles = PLACES if state.known else dict.fromkeys(PLACES, "dim")
    lines: list[Line] = []
    for row in cells:
        runs = groupby(row, lambda cell: cell[0])
        lines.append([(styles[part], "".join(letter for _, letter in run)) for part, run in runs])
    return [*lines, _chart_caption(pose, scale, columns)]


def _chart_caption(pose: tuple[float, float, float] | None, scale: str, columns: int) -> Line:
    """The pose and the scale; where there is no room for both, the pose."""
    if pose is None:
        beside, alone = ["no pose yet", ""], []
    else:
        place = f"x {short(pose[0])} y {short(pose[1])}"
        turned = f" {math.degrees(math.remainder(pose[2], math.tau)):+.0f} deg"
        beside = [f"x {number(pose[0])} y {number(pose[1])} {turned}", place + turned]
        alone = [*beside, place]
    for text in beside:
        if len(text) + 2 + len(scale) <= columns:
            return [("", text), ("dim", scale.rjust(columns - len(text)))]
    for text in alone:
        if len(text) <= columns:
            return [("", text)]
    return [("dim", scale[:columns].rjust(columns))]
