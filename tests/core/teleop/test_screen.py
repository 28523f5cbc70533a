"""Real bytes into a terminal: the picture is right, only changes are written, and nothing old is
left over.
"""

import pyte
from hypothesis import given, settings
from hypothesis import strategies as st

from services.teleop.screen import BEGIN, END
from services.teleop.view import Line
from tests.core.teleop.picture import Drawing

STYLES = ["", "title", "driving", "good", "warning", "dim", "alarm"]
LINES = st.lists(
    st.lists(
        st.tuples(st.sampled_from(STYLES), st.text("ab▄⣿ ", min_size=1, max_size=5)), max_size=4
    ),
    max_size=6,
)


class Terminal:
    """A drawing, and the terminal that it is drawn on."""

    def __init__(self, columns: int = 20, rows: int = 6, colour: bool = True) -> None:
        self.screen = pyte.Screen(columns, rows)
        self.stream = pyte.Stream(self.screen)
        self.written: list[str] = []
        self.drawing = Drawing(self.write, (columns, rows), colour)

    def write(self, text: str) -> None:
        self.written.append(text)
        self.stream.feed(text)

    def resize(self, columns: int, rows: int) -> None:
        """Do what the window does on a resize, of which it notifies the teleop: move the cursor
        home and redraw.
        """
        self.screen.resize(rows, columns)
        self.drawing.size = columns, rows
        self.drawing.forget()

    def paint(self, *lines: Line) -> str:
        """Show the lines, and return what was written to do so."""
        before = len(self.written)
        self.drawing.draw(list(lines))
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


def test_a_picture_is_one_write_inside_a_synchronized_update() -> None:
    terminal = Terminal()
    terminal.written.clear()
    terminal.paint([("", "a")], [("", "b")])
    (text,) = terminal.written
    assert text.startswith(BEGIN)
    assert text.endswith(END)


def test_of_the_same_picture_no_letter_is_written_again() -> None:
    terminal = Terminal()
    terminal.paint([("", "same")])
    assert "same" not in terminal.paint([("", "same")])


def test_only_the_part_that_changed_is_written() -> None:
    terminal = Terminal(columns=80, rows=24)
    rows: list[Line] = [
        [("", "speed "), ("good", f"{row:+.3f}"), ("dim", " m/s" * 8)] for row in range(24)
    ]
    whole = terminal.paint(*rows)
    rows[7] = [("", "speed "), ("good", "+9.876"), ("dim", " m/s" * 8)]
    change = terminal.paint(*rows)
    assert "m/s" not in change
    assert len(change) * 10 < len(whole)
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


def test_after_a_resize_nothing_of_the_old_picture_is_left() -> None:
    for columns, rows in [(40, 4), (8, 6), (3, 2), (120, 40)]:
        terminal = Terminal()
        terminal.paint([("", "new")], *[[("alarm", "old" * 6)] for _ in range(5)])
        terminal.resize(columns, rows)
        terminal.stream.feed("\x1b[Hreflowed in its way " * 3)
        terminal.paint([("", "new")])
        assert terminal.text() == ["new", *[""] * (rows - 1)]


def test_what_was_forgotten_is_painted_whole() -> None:
    terminal = Terminal()
    terminal.paint([("", "picture")])
    terminal.drawing.forget()
    terminal.stream.feed("\x1b[2;2Hthe shell was here")
    terminal.paint([("", "picture")])
    assert terminal.text() == ["picture", "", "", "", "", ""]


def test_lines_that_are_too_long_or_too_many_are_cut() -> None:
    """The window has just been made smaller."""
    terminal = Terminal(columns=4, rows=2)
    terminal.paint([("", "abcdefgh")], [("", "second")], [("", "third")])
    assert terminal.text() == ["abcd", "seco"]


def test_an_alarm_is_reverse_bold_and_red_and_without_colours_still_reverse_and_bold() -> None:
    for colour, red in ((True, "red"), (False, "default")):
        terminal = Terminal(colour=colour)
        terminal.paint([("alarm", "NO"), ("good", "yes"), ("", "plain")])
        alarm, good, plain = (terminal.screen.buffer[0][column] for column in (0, 2, 5))
        assert (alarm.reverse, alarm.bold, alarm.fg) == (True, True, red)
        assert (good.reverse, good.bold, good.fg) == (
            False,
            False,
            "green" if colour else "default",
        )
        assert (plain.reverse, plain.bold, plain.fg) == (False, False, "default")


def test_without_colours_none_is_written() -> None:
    terminal = Terminal(colour=False)
    text = terminal.paint(*[[(style, style or "none")] for style in STYLES])
    assert not [code for code in range(30, 50) if f";{code}" in text or f"[{code}m" in text]


@settings(max_examples=15)
@given(st.lists(LINES, max_size=4))
def test_after_any_pictures_the_terminal_shows_the_last_as_if_it_were_the_first(
    pictures: list[list[Line]],
) -> None:
    terminal, fresh = Terminal(), Terminal()
    for picture in pictures:
        terminal.paint(*picture)
    fresh.paint(*pictures[-1] if pictures else [])
    assert terminal.text() == fresh.text()
    for row in range(6):
        for column in range(20):
            one, other = terminal.screen.buffer[row][column], fresh.screen.buffer[row][column]
            assert one == other or (one.data, one.reverse) == (other.data, other.reverse) == (
                " ",
                False,
            )
