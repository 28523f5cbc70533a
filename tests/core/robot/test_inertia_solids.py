"""Solid bodies of the shapes of links."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest

from holozen.robot.inertia import is_absurd, moments
from holozen.robot.model import Pose, Shape
from holozen.robot.rotation import matrix_of

CORNERS = [(1 + x, 2 + y, 3 + z) for x, y, z in product((0.0, 0.2), (0.0, 0.4), (0.0, 0.6))]
HULL = Shape("hull", (), Pose(), points=tuple(CORNERS))
BOX = Shape("box", (0.2, 0.4, 0.6), Pose())


def tensor(
    *shapes: Shape, at: Sequence[float] = (0, 0, 0), rpy: Sequence[float] = (0, 0, 0)
) -> list[list[float]]:
    found = moments((shape, np.array(at), matrix_of(rpy)) for shape in shapes)
    assert found is not None
    rows: list[list[float]] = found.tolist()
    return rows


def test_a_hull_turns_as_its_bounding_box_wherever_it_is() -> None:
    assert np.allclose(tensor(HULL), tensor(BOX))
    assert np.allclose(tensor(HULL, at=(5, 6, 7)), tensor(BOX))
    assert np.allclose(np.diag(tensor(BOX, rpy=(0, 0, np.pi / 2))), np.diag(tensor(BOX))[[1, 0, 2]])


@pytest.mark.parametrize(
    "shape", [Shape("plane", (1, 1), Pose()), Shape("mesh", (1, 1, 1), Pose())]
)
def test_what_has_no_volume_does_not_count(shape: Shape) -> None:
    assert moments([(shape, np.zeros(3), np.eye(3))]) is None
    assert tensor(BOX, shape) == tensor(BOX)


def test_a_64th_of_a_solid_body_s_moment_about_any_axis_is_absurd() -> None:
    least = np.diag([1.0, 2.0, 3.0])
    assert not is_absurd(least[[2, 0, 1]][:, [2, 0, 1]] * 10 / 60, 10, least)
    assert is_absurd(np.diag([10 / 70, 20, 30]), 10, least)
    assert is_absurd(np.diag([10, 20, 30 / 500]), 10, least)
