"""256 points stand for a mesh: the bounding box is exact, and the error is the one that is
stated.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.robot.files.meshes import POINTS_AT_ONCE, extremes

AWAY = np.array([1e4, 0, 0])


def points_of(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, 3))


@given(st.integers(0, 2**32 - 1), st.integers(1, 3000))
def test_the_bounding_box_is_exact_and_no_point_is_made_up(seed: int, count: int) -> None:
    points = points_of(seed, count)
    kept = extremes([points], "mesh")
    assert (kept.min(axis=0) == points.min(axis=0)).all() and (
        kept.max(axis=0) == points.max(axis=0)
    ).all()
    assert set(map(tuple, kept)) <= set(map(tuple, points))
    assert len(kept) <= 256


def test_the_bounding_box_is_exact_even_where_no_direction_points() -> None:
    turn = np.linspace(0, 2 * np.pi, 100_000, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    kept = extremes([circle, circle[:, [2, 0, 1]]], "mesh")
    assert kept.min(axis=0).tolist() == [-1, -1, -1] and kept.max(axis=0).tolist() == [1, 1, 1]


def test_parts_of_any_length_give_the_same_as_one() -> None:
    points = points_of(1, 3 * POINTS_AT_ONCE + 5)
    whole = extremes([points], "mesh")
    assert (extremes(np.array_split(points, 7), "mesh") == whole).all()
    assert len(extremes([], "mesh")) == 0


def test_a_mesh_far_from_its_origin_loses_no_digits() -> None:
    points = points_of(2, 500) * 1e-3
    near, far = extremes([points], "mesh"), extremes([points + AWAY], "mesh")
    assert far - AWAY == pytest.approx(near, abs=1e-11)


def test_of_a_ball_the_hull_loses_at_most_what_is_stated() -> None:
    ball = points_of(3, 200_000)
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    kept = extremes([ball], "mesh")
    assert (ball[:5000] @ kept.T).max(axis=1).min() > 1 - 0.017


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_of_a_wheel_the_rim_loses_at_most_what_is_stated(axis: int) -> None:
    turn = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    rims = [
        np.insert(np.stack([np.cos(turn), np.sin(turn)], axis=1), axis, side, axis=1)
        for side in (-0.3, 0.3)
    ]
    kept = extremes(rims, "mesh")
    for rim, side in zip(rims, (-0.3, 0.3), strict=True):
        corners = kept[kept[:, axis] == side]
        assert ((rim @ corners.T) - side * side).max(axis=1).min() > 1 - 0.005
