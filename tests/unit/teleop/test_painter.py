"""Real bytes into a terminal: the picture is right, only changes are written, and nothing old is left over."""

import pyte
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.painter import BEGIN, COLORS, END, Painter
from services.teleop.state import Line

STYLES = st.sampled_from(["", *COLORS])
LINES = st.lists(st.lists(st.tuples(STYLES, st.text("ab▄⣿ ", min_size=1, max_size=5)), max_size=4), max_size=6)


class Terminal:
    """A painter, and the terminal it writes to."""

    def __init__(self, columns: int = 20, rows: int = 6, color: bool = True) -> None:
        self.screen = pyte.Screen(columns, rows)
        self.stream = pyte.Stream(self.screen)
        self.written: list[str] = []
        self.painter = Painter(self.write, color)

    def write(self, text: str) -> None:
        self.written.append(text)
        self.stream.feed(text)

    def paint(self, *lines: Line) -> str:
        """Show the lines; what was written for it."""
        before = len(self.written)
        self.painter.paint(list(lines), self.screen.columns, self.screen.lines)
        return "".join(self.written[before:])

    def text(self) -> list[str]:
        return [line.rstrip() for line in self.screen.display]


def test_lines_are_shown_in_their_rows_and_nothing_else_is() -> None:
    terminal = Terminal()
    terminal.stream.feed("rests of the shell\r\n" * 8)
    terminal.paint([("", "one")], [], [("good", "thr"), ("dim", "ee")])
    assert terminal.text() == ["one", "", "three", "", "", ""]


def test_a_full_line_keeps_its_last_letter_and_scrolls_nothing() -> None:
    terminal = Terminal(columns=5, rows=2)
    terminal.paint([("title", "abcde")], [("alarm", "fghij")])
    assert terminal.text() == ["abcde", "fghij"]
    terminal.paint([("title", "abcdX")], [("alarm", "fghiY")])
    assert terminal.text() == ["abcdX", "fghiY"]
    assert not [text for text in terminal.written if "\x1b[K" in text]  # at the last column xterm would erase that


def test_a_picture_is_one_write_inside_a_synchronized_update() -> None:
    terminal = Terminal()
    terminal.paint([("", "a")], [("", "b")])
    (text,) = terminal.written
    assert text.startswith("\x1b[?2026h")
    assert text.endswith("\x1b[?2026l")
    assert pyte.modes.DECAWM in terminal.screen.mode  # lines wrap again


def test_the_same_picture_is_not_written_again() -> None:
    terminal = Terminal()
    terminal.paint([("", "same")])
    assert terminal.paint([("", "same")]) == ""


def test_only_the_part_that_changed_is_written() -> None:
    terminal = Terminal(columns=80, rows=24)
    rows: list[Line] = [[("", "speed "), ("good", f"{row:+.3f}"), ("dim", " m/s" * 8)] for row in range(24)]
    whole = terminal.paint(*rows)
    rows[7] = [("", "speed "), ("good", "+9.876"), ("dim", " m/s" * 8)]
    change = terminal.paint(*rows)
    assert change == f"{BEGIN}\x1b[8;7H\x1b[0;32m+9.876\x1b[m{END}"
    assert len(change) * 20 < len(whole)
    assert terminal.text()[7].startswith("speed +9.876 m/s m/s")


def test_a_line_that_got_shorter_or_went_away_leaves_nothing() -> None:
    terminal = Terminal()
    terminal.paint([("", "long long"), ("good", " line")], [("", "second")])
    terminal.paint([("", "long")])
    assert terminal.text() == ["long", "", "", "", "", ""]


def test_parts_that_moved_are_written_where_they_are_now() -> None:
    terminal = Terminal()
    terminal.paint([("", "age "), ("good", "9"), ("dim", " ms")])
    terminal.paint([("", "age "), ("good", "10"), ("dim", " ms")])
    assert terminal.text()[0] == "age 10 ms"


@pytest.mark.parametrize(("columns", "rows"), [(40, 4), (8, 6), (3, 2), (120, 40)])
def test_after_a_resize_nothing_of_the_old_picture_is_left(columns: int, rows: int) -> None:
    terminal = Terminal()
    terminal.paint([("", "new")], *[[("alarm", "old" * 6)] for _ in range(5)])
    terminal.screen.resize(rows, columns)
    terminal.stream.feed("\x1b[Hreflowed in its way " * 3)
    terminal.paint([("", "new")])
    assert terminal.text() == ["new", *[""] * (rows - 1)]


def test_what_was_forgotten_is_painted_whole() -> None:
    terminal = Terminal()
    terminal.paint([("", "picture")])
    terminal.stream.feed("\x1b[2;2Hthe shell was here")
    terminal.painter.forget()
    terminal.paint([("", "picture")])
    assert terminal.text() == ["picture", "", "", "", "", ""]


def test_after_a_write_that_failed_all_is_painted_again() -> None:
    terminal = Terminal()
    terminal.paint([("", "first")])

    def fail(text: str) -> None:
        terminal.stream.feed(text.partition("ond")[0])
        raise BlockingIOError

    terminal.painter._write = fail
    with pytest.raises(BlockingIOError):
        terminal.paint([("", "second")])
    terminal.painter._write = terminal.write
    terminal.paint([("", "first")])
    assert terminal.text()[0] == "first"


def test_lines_that_are_too_long_or_too_many_hurt_nobody() -> None:
    """The window was made smaller just now."""
    terminal = Terminal(columns=4, rows=2)
    terminal.paint([("", "abcdefgh")], [("", "second")], [("", "third")])
    assert terminal.text()[0].startswith("abc")
    assert terminal.text()[1].startswith("sec")


def test_an_alarm_is_reverse_bold_and_red_and_without_colors_still_reverse_and_bold() -> None:
    for color, red in ((True, "red"), (False, "default")):
        terminal = Terminal(color=color)
        terminal.paint([("alarm", "NO"), ("good", "yes"), ("", "plain")])
        alarm, good, plain = (terminal.screen.buffer[0][column] for column in (0, 2, 5))
        assert (alarm.reverse, alarm.bold, alarm.fg) == (True, True, red)
        assert (good.reverse, good.bold, good.fg) == (False, False, "green" if color else "default")
        assert (plain.reverse, plain.bold, plain.fg) == (False, False, "default")


def test_without_colors_none_is_written() -> None:
    terminal = Terminal(color=False)
    text = terminal.paint(*[[(style, style)] for style in COLORS])
    assert not [code for code in range(30, 50) if f";{code}m" in text or f"[{code}m" in text]


@given(st.lists(LINES, max_size=4))
def test_after_any_pictures_the_terminal_shows_the_last_as_if_it_were_the_first(pictures: list[list[Line]]) -> None:
    terminal, fresh = Terminal(), Terminal()
    for picture in pictures:
        terminal.paint(*picture)
    fresh.paint(*pictures[-1] if pictures else [])
    assert terminal.text() == fresh.text()
    for row in range(6):
        for column in range(20):
            one, other = terminal.screen.buffer[row][column], fresh.screen.buffer[row][column]
            assert one == other or (one.data, one.reverse) == (other.data, other.reverse) == (" ", False)
