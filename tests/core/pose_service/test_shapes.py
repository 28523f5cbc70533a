"""Shapes are closed tours of the given sizes; a file of goals is read or refused with its line."""

import math
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.pose_service.shapes import SHAPES, Goal, GoalsError, infinity, read_goals

sizes = st.floats(0.01, 1000)


def sides(goals: list[Goal]) -> list[float]:
    """The distances between successive goals, starting at the origin and returning to it."""
    starts = [(0.0, 0.0, 0.0), *goals[:-1]]
    return [math.dist(start[:2], goal[:2]) for start, goal in zip(starts, goals, strict=True)]


def extent(goals: list[Goal]) -> tuple[float, float]:
    xs, ys = [x for x, _, _ in goals], [y for _, y, _ in goals]
    return max(xs) - min(xs), max(ys) - min(ys)


def test_there_are_the_shapes_of_the_lesson() -> None:
    assert set(SHAPES) == {"square", "triangle", "rectangle", "infinity", "hexagon"}


@pytest.mark.parametrize("name", SHAPES)
@given(size=sizes)
def test_a_shape_ends_at_the_origin_where_it_begins(name: str, size: float) -> None:
    assert SHAPES[name](size)[-1][:2] == pytest.approx((0, 0), abs=1e-9 * size)


def test_a_polygon_has_its_corners_and_its_sides() -> None:
    for name, lengths in {
        "square": [2] * 4,
        "triangle": [2] * 3,
        "rectangle": [2, 1] * 2,
        "hexagon": [2] * 6,
    }.items():
        goals = SHAPES[name](2.0)
        assert len(goals) == len(lengths)
        assert sides(goals) == pytest.approx(lengths)


def test_a_shape_is_as_wide_and_high_as_its_parameters() -> None:
    rows = [
        ("square", 2, 2),
        ("triangle", 2, math.sqrt(3)),
        ("rectangle", 2, 1),
        ("hexagon", 4, 2 * math.sqrt(3)),
        ("infinity", 4, 2),
    ]
    for name, width, height in rows:
        assert extent(SHAPES[name](2.0)) == pytest.approx((width, height))


def test_polygons_turn_left_at_every_corner_by_the_same_angle() -> None:
    for name in ("square", "triangle", "rectangle", "hexagon"):
        goals = SHAPES[name](1.0)
        headings = [goals[-1][2], *(theta for _, _, theta in goals)]
        turns = [(after - before) % math.tau for before, after in pairwise(headings)]
        assert turns == pytest.approx([math.tau / len(goals)] * len(goals))


def test_at_each_goal_the_robot_looks_where_it_goes_next() -> None:
    for name in SHAPES:
        goals = SHAPES[name](1.5)
        for (x, y, theta), (next_x, next_y, _) in zip(goals, goals[1:] + goals[:1], strict=True):
            length = math.dist((x, y), (next_x, next_y))
            assert (x + length * math.cos(theta), y + length * math.sin(theta)) == pytest.approx(
                (next_x, next_y)
            )


def test_infinity_is_geronos_lemniscate_through_the_origin() -> None:
    goals = infinity(2.0)
    assert len(goals) == 24
    for x, y, _ in goals:
        assert (x / 2) ** 4 == pytest.approx((x / 2) ** 2 - (y / 2) ** 2, abs=1e-9)
    assert sum(math.hypot(x, y) < 1e-9 for x, y, _ in goals) == 2
    assert sum(y > 1e-9 for _, y, _ in goals) == sum(y < -1e-9 for _, y, _ in goals)


def written(path: Path, text: str) -> list[Goal]:
    path.write_text(text)
    return read_goals(path)


def test_a_file_has_a_goal_a_line_with_commas_comments_and_theta_at_will(tmp_path: Path) -> None:
    text = "# the kitchen\n1 2 3.14\n\n  -1.5,0,-1e-1  # back\n4 5\n   \n"
    assert written(tmp_path / "goals", text) == [(1, 2, 3.14), (-1.5, 0, -0.1), (4, 5, 0)]


def test_a_line_that_is_no_goal_is_quoted_with_its_number(tmp_path: Path) -> None:
    for line in [
        "1",
        "1 2 3 4",
        "x y z",
        "1 2 nan",
        "inf 0 0",
        "1 2e6 0",
        "1 2 3deg",
        "1;2;3",
        "0x10 0 0",
        "1,2,3,4",
    ]:
        path = tmp_path / "goals"
        with pytest.raises(GoalsError) as error:
            written(path, f"# first\n1 1 1\n  {line}  \n2 2 2\n")
        assert str(error.value) == (
            f"goals {path}:3: {line!r}; write x y theta in metres and radians, such as 1.0 0 1.57"
        )


def test_a_file_without_a_goal_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "goals"
    for text in ("", "\n\n", "# nothing here\n"):
        with pytest.raises(GoalsError) as error:
            written(path, text)
        assert str(error.value) == f"goals {path}: no goals; write one x y theta per line"


def test_a_file_that_cannot_be_read_or_has_no_end_is_one_line(tmp_path: Path) -> None:
    latin = tmp_path / "latin"
    latin.write_bytes(b"1 2 3 # k\xfcche\n")
    for path in (tmp_path / "nothing", tmp_path, latin, Path("/dev/zero")):
        with pytest.raises(GoalsError) as error:
            read_goals(path)
        assert str(error.value).startswith(f"goals {path}: ")
        assert "\n" not in str(error.value)
