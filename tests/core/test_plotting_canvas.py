"""Dots become braille, or ASCII, in the right place; what is outside is not drawn."""

import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from holozen.plotting import Canvas, glyph

NUMBERS = st.floats(-1e9, 1e9)


def drawn(*dots: tuple[int, int], columns: int = 2, rows: int = 1) -> list[str]:
    canvas = Canvas(columns, rows)
    for dot in dots:
        canvas.dot(*dot)
    return canvas.lines()


def test_an_empty_canvas_is_blank() -> None:
    assert drawn(columns=3, rows=2) == ["   ", "   "]


def test_each_dot_of_a_cell_is_the_one_of_that_name_in_unicode() -> None:
    places = {
        1: (0, 0),
        2: (0, 1),
        3: (0, 2),
        4: (1, 0),
        5: (1, 1),
        6: (1, 2),
        7: (0, 3),
        8: (1, 3),
    }
    for name, place in places.items():
        assert unicodedata.name(drawn(place)[0][0]) == f"BRAILLE PATTERN DOTS-{name}"


def test_dots_of_one_cell_come_together_and_others_stay_apart() -> None:
    assert drawn((0, 0), (1, 3), (2, 0), (3, 4), rows=2) == ["⢁⠁", " ⠈"]


def test_a_dot_outside_is_not_drawn() -> None:
    assert drawn((-1, 0), (0, -1), (4, 0), (0, 4)) == ["  "]


def test_lines_run_from_end_to_end_in_every_direction() -> None:
    for start, end in (((0, 0), (3, 3)), ((3, 3), (0, 0))):
        canvas = Canvas(2, 1)
        canvas.line(*start, *end)
        assert canvas.lines() == ["⠑⢄"]
    canvas = Canvas(2, 1)
    canvas.line(1, 1, 1, 1)
    assert canvas.lines() == ["⠐ "]


def test_of_a_long_line_the_part_inside_is_drawn_at_once() -> None:
    canvas = Canvas(4, 1)
    canvas.line(-1e9, 2, 1e9, 2)
    assert canvas.lines() == ["⠤⠤⠤⠤"]
    canvas.line(0, -1e9, -5, 1e9)
    assert canvas.lines() == ["⠤⠤⠤⠤"]


def test_in_ascii_the_upper_and_the_lower_half_differ() -> None:
    canvas = Canvas(4, 1)
    for dot in ((0, 0), (3, 3), (4, 1), (4, 2)):
        canvas.dot(*dot)
    assert canvas.lines(ascii=True) == ["'.: "]


def test_every_cell_has_a_letter_of_one_column() -> None:
    assert {unicodedata.east_asian_width(glyph(dots)) for dots in range(256)} <= {"N", "Na"}
    assert {glyph(dots, ascii=True) for dots in range(256)} == set(" '.:")


@given(
    st.integers(0, 9),
    st.integers(0, 9),
    st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS), max_size=4),
)
def test_any_lines_on_any_canvas_keep_its_size(
    columns: int, rows: int, lines: list[tuple[float, ...]]
) -> None:
    canvas = Canvas(columns, rows)
    for line in lines:
        canvas.line(*line)
    assert [len(text) for text in canvas.lines()] == [columns] * rows
