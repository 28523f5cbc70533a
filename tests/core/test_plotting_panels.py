"""Numbers over time, as text of exactly the size that was asked for."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.plotting import LABEL, panels

RAMP = [(t / 10, t / 10) for t in range(101)]


def test_a_ramp_goes_from_the_lower_left_to_the_upper_right() -> None:
    title, *rows, axis = panels({"odom.x": RAMP}, 10.0, 10.0, (80, 24))
    assert title == "odom.x: 10"
    assert rows[0].startswith(f"{'10':>{LABEL - 1}} ")
    assert rows[-1].startswith(f"{'0':>{LABEL - 1}} ")
    first = [len(row[LABEL:]) - len(row[LABEL:].lstrip()) for row in rows]
    assert first == sorted(first, reverse=True)
    assert axis.split() == ["-10", "s", "now"]


def test_only_the_window_is_shown_and_its_scale() -> None:
    _, top, *_, bottom, _ = panels({"x": RAMP}, 10.0, 2.0, (80, 24))
    assert (top.split()[0], bottom.split()[0]) == ("10", "8")


def test_a_level_line_is_in_the_middle() -> None:
    _, *rows, _ = panels({"x": [(0, 5.0), (10, 5.0)]}, 10.0, 10.0, (40, 12))
    drawn = [index for index, row in enumerate(rows) if row[LABEL:].strip()]
    assert drawn == [len(rows) // 2]


def test_each_line_has_a_panel_while_there_is_room() -> None:
    lines = panels({f"x{i}": RAMP for i in range(30)}, 10.0, 10.0, (80, 24))
    assert [line for line in lines if line.startswith("x")] == [f"x{i}: 10" for i in range(7)]
    assert len(lines) == 24


def test_a_path_without_points_is_reported() -> None:
    assert panels({"x": []}, 10.0, 10.0, (80, 24))[0] == "x: no messages"


def test_in_ascii_there_is_nothing_else() -> None:
    assert "".join(panels({"x": RAMP}, 10.0, 10.0, (80, 24), ascii=True)).isascii()


@given(
    st.lists(st.tuples(st.floats(-20, 20), st.floats() | st.floats(1e299, 1e301))),
    st.tuples(st.integers(20, 200), st.integers(4, 60)),
    st.integers(1, 5),
)
def test_any_numbers_fit_into_any_terminal(
    points: list[tuple[float, float]], size: tuple[int, int], count: int
) -> None:
    lines = panels(
        {f"x{i}": sorted(points, key=lambda p: p[0]) for i in range(count)}, 10.0, 10.0, size
    )
    assert len(lines) == size[1]
    assert all(len(line) <= size[0] for line in lines)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.7e308])
def test_what_is_no_number_is_left_out(value: float) -> None:
    assert panels({"x": [(9.0, value)]}, 10.0, 10.0, (80, 24))[0] == "x: no messages"
