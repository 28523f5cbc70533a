"""The plane from above, as text of exactly the size that was asked for."""

import math

from hypothesis import given
from hypothesis import strategies as st

from holozen.plotting import Plane, Robot, draw

SIZE = (80, 24)
POINTS = st.tuples(st.floats(), st.floats())


def place(lines: list[str], sign: str) -> tuple[int, int]:
    """Row and column of a sign."""
    return next((row, line.index(sign)) for row, line in enumerate(lines) if sign in line)


def test_north_is_up_and_east_is_right() -> None:
    plane = Plane([Robot("", 0, 0, 0.0)], goals=[(0, 1)], objects={"box": (1, 0)})
    lines = draw(plane, SIZE)
    robot, goal, box = place(lines, "→"), place(lines, "x"), place(lines, "□box")
    assert goal[1] == robot[1]
    assert goal[0] < robot[0] == box[0]
    assert robot[1] < box[1]


def test_a_metre_is_as_long_in_both_directions() -> None:
    lines = draw(Plane(goals=[(0, 0)], objects={"N": (0, 2), "E": (2, 0)}), SIZE)
    here, north, east = place(lines, "x"), place(lines, "□N"), place(lines, "□E")
    # a row is as high as two columns are wide
    assert abs(2 * (here[0] - north[0]) - (east[1] - here[1])) <= 2


def test_the_arrow_points_where_the_robot_faces_and_bears_its_name() -> None:
    for turn, arrow in ((0, "→"), (1, "↑"), (2, "←"), (3, "↓"), (-1, "↓"), (0.5, "↗")):
        assert f"{arrow}Fred" in "".join(
            draw(Plane([Robot("Fred", 3, 4, turn * math.pi / 2)]), SIZE)
        )


def test_every_robot_bears_its_whole_name_also_at_the_edge_and_among_others() -> None:
    names = [
        "a-robot-with-a-long-name",
        "another-robot-in-the-east",
        "its-neighbour",
        "right-on-top-of-it",
    ]
    for places in ([(0, 0), (9, 0), (9, 1), (9, 1)], [(0, 0), (0, 0), (0, 0), (0, 0)]):
        robots = [Robot(name, *at, 0.0) for name, at in zip(names, places, strict=True)]
        text = "\n".join(draw(Plane(robots), SIZE))
        assert [name for name in names if name not in text] == []
        assert text.count("→") == len(set(places))


def test_the_way_it_came_is_drawn() -> None:
    trail = [(0.0, 0.0), (0.0, 2.0), (2.0, 2.0)]
    with_it = "".join(draw(Plane([Robot("", 2, 2, 0, trail)]), SIZE))
    without = "".join(draw(Plane([Robot("", 2, 2, 0)], goals=[(0.0, 0.0)]), SIZE))
    assert with_it.count(" ") < without.count(" ")


def test_the_last_row_shows_the_scale() -> None:
    plane = Plane([Robot("", 0, 0, 0)], goals=[(10, 0)], note="robot x 0.00 y 0.00")
    caption = draw(plane, SIZE)[-1]
    bar, _, rest = caption.partition("| ")
    metres = float(rest.split()[0])
    lines = draw(plane, SIZE)
    columns = (place(lines, "x")[1] - place(lines, "→")[1]) / 10 * metres
    assert abs(columns - len(bar)) <= 1
    assert caption.endswith("x goal   robot x 0.00 y 0.00")


def test_in_ascii_there_is_nothing_else() -> None:
    plane = Plane([Robot("a", 0, 0, 1.0, [(-1, 0), (0, 0)])], [(1, 1)], {"box": (2, 2)})
    assert "".join(draw(plane, SIZE, ascii=True)).isascii()


@given(
    st.lists(st.tuples(POINTS, st.floats(), st.lists(POINTS, max_size=4)), max_size=4),
    st.lists(POINTS, max_size=4),
    st.tuples(st.integers(20, 200), st.integers(4, 60)),
)
def test_anything_fits_into_any_terminal(
    robots: list[tuple[tuple[float, float], float, list[tuple[float, float]]]],
    goals: list[tuple[float, float]],
    size: tuple[int, int],
) -> None:
    plane = Plane(
        [Robot("r", *at, yaw, trail) for at, yaw, trail in robots],
        goals,
        dict.fromkeys("ab", (0.0, 0.0)),
    )
    lines = draw(plane, size)
    assert len(lines) == size[1]
    assert all(len(line) <= size[0] for line in lines)
