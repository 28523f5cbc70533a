"""The screen at 80x24, 120x40, 40x12 and smaller: velocities, the driver, and an alarm for each
problem.
"""

import math
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from services.teleop.control.layout_file import load
from services.teleop.view import Line, Source, State, render
from tests.core.teleop.picture import scene, terminal
from tests.core.teleop.states import BROKEN, states

GOOD = scene()
TABLE = load("ttk").table
SIZES = [(80, 24), (120, 40), (40, 12)]
ALARMS = ["STOPPED", "NO SUBSCRIBER", "ODOM IS STALE", "dead man: hold space"]
every_size = pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")


def rows(state: State, size: tuple[int, int] = (80, 24)) -> list[str]:
    """The lines that a terminal of this size shows."""
    return [line.rstrip() for line in terminal(state, *size).display]


def text(state: State, size: tuple[int, int] = (80, 24)) -> str:
    return "\n".join(rows(state, size))


def row(state: State, label: str, size: tuple[int, int] = (80, 24)) -> str:
    """The only line that begins with a label."""
    (found,) = [line for line in rows(state, size) if line.startswith(f" {label} ")]
    return found


def loud(state: State, size: tuple[int, int]) -> list[str]:
    """The lines that are reversed, bold and red across the whole width."""
    screen = terminal(state, *size)
    lines = [[screen.buffer[row][column] for column in range(size[0])] for row in range(size[1])]
    return [
        "".join(cell.data for cell in line).strip()
        for line in lines
        if all((cell.reverse, cell.bold, cell.fg) == (True, True, "red") for cell in line)
    ]


def styles(state: State, words: str, size: tuple[int, int] = (80, 24)) -> set[str]:
    """The styles of the parts of lines in which these words stand."""
    return {style for line in render(state, *size) for style, part in line if words in part}


@every_size
def test_command_and_measured_stand_side_by_side(size: tuple[int, int]) -> None:
    shown = text(GOOD, size)
    assert "command" in shown
    assert "measured" in shown
    labels = ("x", "y", "turn") if size[0] < 72 else ("x forward", "y left", "turn left")
    numbers = [("+0.500", "+0.471"), ("+0.250", "+0.221"), ("-1.000", "-0.813")]
    for label, (command, measured) in zip(labels, numbers, strict=True):
        line = row(GOOD, label, size)
        assert line.index(command) < line.index(measured)


@every_size
def test_when_all_is_well_nothing_is_loud(size: tuple[int, int]) -> None:
    assert loud(GOOD, size) == []
    assert not {"alarm", "warning"} & {style for line in render(GOOD, *size) for style, _ in line}


def test_what_is_wrong_is_loud_at_every_size() -> None:
    for size in [*SIZES, (80, 12), (20, 5), (40, 4)]:
        found = loud(BROKEN, size)
        for words in ALARMS:
            assert any(line.startswith(words) for line in found), words


def test_every_alarm_is_shown_whole_where_there_is_room() -> None:
    assert loud(BROKEN, (80, 24)) == [
        "STOPPED by topic@77aa00: `holozen release Fred` lets it drive again",
        "NO SUBSCRIBER on Fred/cmd_vel",
        "ODOM IS STALE: the last one came 3.2 s ago",
        "dead man: hold space",
    ]
    assert loud(replace(GOOD, robot="", stopped="me"), (80, 24)) == [
        "STOPPED by me: `holozen release` lets it drive again"
    ]
    assert loud(replace(GOOD, paused=True), (80, 24)) == [
        "PAUSED: `holozen sim play` continues the sim"
    ]
    assert loud(replace(GOOD, stale=True, odom_age=math.inf), (80, 24)) == [
        "NO ODOM: nothing was heard from a robot"
    ]
    assert loud(replace(GOOD, deadman=True, deadman_held=True), (80, 24)) == []


def test_alarms_share_a_line_before_one_is_lost() -> None:
    assert loud(BROKEN, (80, 3)) == ["STOPPED + NO SUBSCRIBER + ODOM IS STALE + dead man"]


def test_before_any_sample_the_alarms_are_shown() -> None:
    assert loud(State(keys=["i forward"]), (80, 24)) == [
        "NO SUBSCRIBER on cmd_vel",
        "NO ODOM: nothing was heard from a robot",
    ]
    assert "you drive" not in text(State())
    assert loud(replace(GOOD, odom_age=math.nan, stale=False), (80, 24)) == [
        "NO ODOM: nothing was heard from a robot"
    ]


@every_size
def test_at_every_size_one_sees_what_matters_for_safety(size: tuple[int, int]) -> None:
    """Also when every alarm takes a line of its own."""
    for state, driver in ((GOOD, "you drive"), (BROKEN, "teleop@2b3c4d drives, not you")):
        shown = text(state, size)
        assert driver in shown
        assert "hold" in shown
        assert "+0.500" in shown
        assert "speed" in shown


def test_the_smallest_screen_still_shows_alarms_and_the_speed() -> None:
    assert rows(BROKEN, (20, 5)) == [
        *(f" {words}"[-20:] for words in ALARMS[:3]),
        ALARMS[3],
        "speed ? of 0.50",
    ]
    assert "speed 0.52 of 0.50" in rows(GOOD, (20, 5))
    assert "go +0.50 +0.25 -1.00" in rows(GOOD, (20, 5))
    assert "is +0.47 +0.22 -0.81" in rows(GOOD, (20, 5))


def test_speeds_that_are_not_known_are_not_shown() -> None:
    for size in (*SIZES, (20, 5), (80, 4)):
        shown = text(replace(GOOD, stale=True, odom_age=3.0), size)
        assert "unknown" in shown
        assert "+0.47" not in shown


def test_a_silent_teleop_is_shown_as_silent_and_a_stop_as_zeros() -> None:
    silent, stop = replace(GOOD, command=None), replace(GOOD, command=(0.0, -0.0, -0.0001))
    assert "command: silent" in text(silent)
    assert "go silent" in text(silent, (20, 5))
    assert "command: silent" not in text(stop)
    assert "+0.000" in row(stop, "turn left")
    assert "-0.000" not in text(stop)


def test_a_command_that_moves_the_robot_stands_out() -> None:
    assert styles(GOOD, "command") == {"driving"}
    assert styles(replace(GOOD, command=(0.0, 0.0, 0.0)), "command") == {""}
    assert styles(replace(GOOD, command=None), "command") == {"dim"}


def bars(state: State, label: str) -> list[tuple[int, int]]:
    """The filled cells left and right of the middle, of the command and of the measured
    velocity.
    """
    line = row(state, label)
    middles = [index for index, letter in enumerate(line) if letter == "|"]
    sides = []
    for middle in middles:
        left, right = line[middle - 11 : middle], line[middle + 1 : middle + 12]
        assert set(left + right) <= set("▁▄▖▗")
        sides.append(
            (sum(letter in "▄▗" for letter in left), sum(letter in "▄▖" for letter in right))
        )
    return sides


def test_bars_go_where_the_robot_goes() -> None:
    """Left is positive, as in ROS, and a bar to the left."""
    assert bars(GOOD, "x forward") == [(0, 11), (0, 11)]
    assert bars(GOOD, "y left") == [(6, 0), (5, 0)]
    assert bars(GOOD, "turn left") == [(0, 11), (0, 9)]


def test_a_full_bar_is_the_speed_that_is_set_or_more_if_there_is_more() -> None:
    assert bars(replace(GOOD, command=(0.25, 0, 0), measured=(0.25, 0, 0)), "x forward") == [
        (0, 6),
        (0, 6),
    ]
    assert bars(replace(GOOD, measured=(1.0, 0, 0)), "x forward") == [(0, 6), (0, 11)]
    assert bars(replace(GOOD, measured=(math.nan, math.inf, 0)), "x forward") == [(0, 11), (0, 0)]


def test_the_speeds_are_shown_with_their_limits() -> None:
    assert "0.500 m/s, limit 1.5 " in row(GOOD, "speed")
    assert "turn 1.000 rad/s, limit 3" in row(GOOD, "speed")
    assert row(GOOD, "speed", (40, 12)) == " speed 0.500 of 1.5  turn 1.000 of 3"
    slow = replace(GOOD, speed_limit=1000.0, turn_limit=1000.0)
    assert row(slow, "speed", (40, 12)) == " speed 0.500 of 1000  turn 1.000 of 1000"


def test_listeners_odom_age_and_round_trip_are_shown() -> None:
    assert "sim, recorder" in row(GOOD, "listening")
    assert (
        row(GOOD, "odom age").split("real time 1.00x")[0]
        == " odom age  12 ms  round trip 0.61 ms   "
    )
    late = replace(GOOD, real_time_factor=0.4, round_trip=0.25)
    assert styles(late, "0.40x") == {"warning"}
    assert styles(late, "250 ms") == {"warning"}
    unknown = text(replace(GOOD, real_time_factor=None, round_trip=None))
    assert "round trip" not in unknown
    assert "real time" not in unknown
    assert rows(GOOD, (40, 12))[9:11] == [
        " odom age  12 ms",
        " round trip 0.61 ms   real time 1.00x",
    ]


def test_a_link_of_more_than_a_quarter_of_a_second_is_an_alarm_with_its_delay() -> None:
    assert loud(replace(GOOD, round_trip=0.25), (80, 24)) == []
    assert loud(replace(GOOD, round_trip=0.31), (80, 24)) == [
        "SLOW LINK: the robot answers 310 ms later"
    ]


def test_each_publisher_is_named_with_its_priority_its_rate_and_what_becomes_of_it() -> None:
    shown = rows(GOOD)
    ours = next(index for index, line in enumerate(shown) if line.startswith(" sources "))
    assert shown[ours].startswith(" sources   obeyed  20 Hz  you person")
    assert shown[ours + 1].startswith("           held    20 Hz  controller@9f8e7d controller")
    more = replace(GOOD, sources=[Source(f"script@{n}", "DATA", 5.0) for n in range(7)])
    assert "waits    5 Hz  script@0 script" in text(more)
    assert "and 4 more" in text(more)
    assert "script@6" in text(more, (120, 40))


def test_the_driver_is_named_and_is_a_warning_where_another_source_has_the_robot() -> None:
    other = replace(GOOD, obeyed="teleop@2b3c4d")
    assert styles(other, "teleop@2b3c4d drives, not you") == {"warning"}
    assert "not you" not in text(replace(other, command=None))
    assert "no driver" in text(replace(GOOD, obeyed="", held=False))
    assert "no driver; the autopilot is held" in text(replace(GOOD, obeyed="", held=True))


def test_the_mode_is_shown_with_its_reason() -> None:
    assert "hold: this terminal reports key releases" in rows(GOOD)[1]
    latched = replace(GOOD, mode="latch", why="--mode latch", deadman=True, deadman_held=True)
    assert "latch + dead man: --mode latch" in text(latched)
    assert "latch + dead man: --mode latch" in text(latched, (40, 12))


def test_the_title_names_the_robot_those_that_tab_switches_to_and_us() -> None:
    assert rows(GOOD)[0].split("   ")[:3] == [" holozen teleop", "Fred", "Tab: Barney"]
    assert "Tab: the robot at the root, Ann" in rows(replace(GOOD, others=["", "Ann"]))[0]
    assert rows(GOOD)[0].endswith("teleop@1a2b3c")
    assert "the robot at the root" in rows(replace(GOOD, robot="", others=[]))[0]
    assert "Tab:" not in rows(replace(GOOD, others=[]))[0]


def test_the_last_warning_is_shown() -> None:
    warned = replace(GOOD, warning="not handed over")
    for size in [*SIZES, (40, 30)]:
        assert " not handed over" in rows(warned, size)
        assert styles(warned, "not handed over", size) == {"warning"}


def test_the_keys_are_shown_where_there_is_room() -> None:
    for size in [(80, 24), (120, 40), (40, 30)]:
        shown = rows(GOOD, size)
        for key in GOOD.keys:
            assert any(key in line for line in shown), (key, size)


def test_a_line_of_help_that_is_as_wide_as_the_screen_is_whole() -> None:
    line = "Tab".ljust(34) + "robots"
    assert line in rows(replace(GOOD, keys=[line]), (40, 30))
    assert f" {line}" in rows(replace(GOOD, keys=[line]), (41, 30))


def test_keys_without_room_are_shown_with_how_to_see_them() -> None:
    assert " ? shows all keys" in text(replace(GOOD, keys=TABLE))
    assert "ctrl+c" not in text(replace(GOOD, keys=TABLE))


@every_size
def test_the_page_of_help_shows_the_layout_and_keeps_alarms_and_speeds(
    size: tuple[int, int],
) -> None:
    shown = text(replace(BROKEN, help=True, keys=TABLE), (size[0], 24 if size[0] > 40 else 45))
    for words in (*TABLE, *ALARMS[:3], "? back"):
        assert words in shown
    assert "+0.50 +0.25 -1.00" in shown


def test_a_long_layout_takes_more_columns_and_shows_what_is_cut() -> None:
    long = replace(GOOD, help=True, keys=[f"{n:02}".ljust(38) + "." for n in range(50)])
    assert rows(long, (120, 24))[3] == f" 00{'.':>37} 20{'.':>37} 40{'.':>37}"
    assert rows(long, (119, 24))[3] == f" 00{'.':>37} 20{'.':>37}"
    assert rows(long, (119, 24))[-1] == " ? back   10 more lines: enlarge"
    assert " ? back   44 more lines: enlarge" in rows(long, (40, 12))


def cells(lines: list[Line], *wanted: str) -> str:
    return "".join(part for line in lines for style, part in line if style in wanted)


def dots(state: State, style: str) -> int:
    """How many braille dots have a style."""
    return sum(
        (ord(letter) - 0x2800).bit_count()
        for letter in cells(render(state, 80, 24), style)
        if letter >= "\u2800"
    )


def test_the_map_shows_trail_heading_and_scale() -> None:
    assert "grid 0.5 m" in text(GOOD, (120, 40))
    assert "x -1.28 y -0.84 -50 deg" in text(GOOD), "80 columns have no room for more"
    assert dots(GOOD, "good") > 50
    assert dots(replace(GOOD, trail=[]), "good") == 0
    assert dots(GOOD, "driving") > 10
    assert dots(replace(GOOD, pose=None), "driving") == 0
    assert "x -1.283 y -0.842  -50 deg" in text(GOOD, (120, 40))
    assert "no pose yet" in text(replace(GOOD, pose=None), (120, 40))


def test_the_scale_of_the_map_grows_in_steps() -> None:
    message = []
    for reach in (0.1, 1.0, 3.0, 7.0, 40.0, 900.0, 1e5):
        line = next(
            line
            for line in rows(replace(GOOD, pose=None, trail=[(0, 0), (reach, reach)]))
            if " grid " in line
        )
        message.append(line.split(" grid ")[1])
    assert message == ["0.2 m", "0.5 m", "2 m", "5 m", "20 m", "500 m", "50000 m"]


def test_a_wide_map_shows_what_lidars_see() -> None:
    def seen(size: tuple[int, int]) -> str:
        walls = [(0.1 * step, 4.0) for step in range(40)]
        return cells(render(replace(GOOD, pose=None, trail=[], seen=walls), *size), "good")

    assert any(letter > "\u2800" for letter in seen((120, 40)))
    assert not any(letter > "\u2800" for letter in seen((80, 24))), "it would leave no room"


def test_impossible_places_are_not_on_the_map() -> None:
    nowhere = [(math.nan, 0.0), (0.0, 1.7e308), (-1.7e308, 0.0), (math.inf, math.inf)]
    assert text(replace(GOOD, trail=[*nowhere, *GOOD.trail])) == text(GOOD)
    for pose in ((0.0, 1.7e308, 0.0), (math.nan, 0.0, 0.0), (0.0, 0.0, math.inf)):
        assert text(replace(GOOD, pose=pose)) == text(replace(GOOD, pose=None))


def test_a_map_that_is_not_of_now_is_dim() -> None:
    stale = replace(GOOD, stale=True)
    assert dots(stale, "good") == 0
    assert dots(stale, "dim") > 50


def test_in_ascii_everything_is_and_the_robot_is_an_arrow() -> None:
    for yaw, arrow in [(0, ">"), (90, "^"), (180, "<"), (-90, "v"), (-170, "<"), (700, ">")]:
        plain = replace(GOOD, ascii=True, pose=(0.3, 0.1, math.radians(yaw)))
        shown = text(plain)
        assert shown.isascii()
        (letter,) = [
            letter for letter in cells(render(plain, 80, 24), "driving") if letter in "<>^v"
        ]
        assert letter == arrow
        assert "=====" in row(plain, "x forward")


def test_what_came_over_the_wire_cannot_move_the_cursor_or_the_columns() -> None:
    evil = "\x1b[2J\n日本e\u0301" + "x" * 300
    state = replace(
        BROKEN,
        robot=evil,
        others=[evil],
        why=evil,
        obeyed=evil,
        source=evil,
        stopped=evil,
        warning=evil,
        key=evil,
        keys=[evil],
        listeners=[evil],
        sources=[Source(evil, evil, 20.0)],
    )
    for size in SIZES:
        for line in render(state, *size):
            for _, part in line:
                assert all(
                    " " <= letter <= "~" or unicodedata.category(letter) == "So" for letter in part
                )
        assert "?[2J???e?xxx" in text(state, size)


def test_after_a_change_only_a_little_is_redrawn() -> None:
    """Lines are made of parts, so that the screen finds those that have not changed."""
    before, after = (
        render(GOOD, 80, 24),
        render(replace(GOOD, odom_age=0.007, measured=(0.46, 0.2214, -0.8126)), 80, 24),
    )
    changed = [
        index for index, (one, other) in enumerate(zip(before, after, strict=True)) if one != other
    ]
    assert len(changed) == 2
    assert all(len(set(before[index]) - set(after[index])) <= 2 for index in changed)


@given(states(), st.integers(1, 130), st.integers(1, 45))
def test_any_state_fits_a_terminal_of_any_size(state: State, columns: int, rows: int) -> None:
    lines = render(state, columns, rows)
    assert len(lines) <= rows
    for line in lines:
        shown = "".join(part for _, part in line)
        assert len(shown) <= columns
        assert all(" " <= letter <= "~" or not state.ascii for letter in shown)
        assert {style for style, _ in line} <= {
            "",
            "title",
            "driving",
            "good",
            "warning",
            "dim",
            "alarm",
        }
        assert all(part for _, part in line)


@given(states(), st.sampled_from(SIZES))
def test_no_alarm_is_ever_lost(state: State, size: tuple[int, int]) -> None:
    alarms = [part for line in render(state, *size) for style, part in line if style == "alarm"]
    expected = "\n".join(alarms)
    assert ("STOPPED" in expected) == bool(state.stopped)
    assert ("PAUSED" in expected) == state.paused
    assert ("NO SUBSCRIBER" in expected) == (not state.listeners)
    assert ("NO ODOM" in expected) == (not math.isfinite(state.odom_age))
    assert ("ODOM IS STALE" in expected) == (math.isfinite(state.odom_age) and state.stale)
    assert ("dead man: hold space" in expected) == (state.deadman and not state.deadman_held)
    assert {len(line) for line in alarms} <= {size[0]}


def test_a_terminal_without_a_size_shows_nothing() -> None:
    for size in [(0, 5), (5, 0), (-1, 3)]:
        assert render(GOOD, *size) == []


def test_a_slow_link_is_reported_with_the_figure() -> None:
    assert "SLOW LINK" not in text(replace(GOOD, round_trip=0.25))
    assert "SLOW LINK: the robot answers 310 ms later" in text(replace(GOOD, round_trip=0.31))
