"""STL files, binary and ASCII, in one part or many."""

import io
from typing import Any

import numpy as np
import pytest
import trimesh

from holozen.robot.errors import RobotError
from holozen.robot.files import meshes
from holozen.robot.files.meshes import read_stl, write_stl

BALL = trimesh.creation.icosphere(2)
BINARY = BALL.export(file_type="stl")
ASCII = BALL.export(file_type="stl_ascii").encode()


def corners(data: bytes) -> Any:
    parts = [part.points for part in read_stl(io.BytesIO(data), len(data), "a.stl")]
    return np.vstack([np.zeros((0, 3)), *parts])


def refusal(data: bytes) -> str:
    with pytest.raises(RobotError) as error:
        corners(data)
    return str(error.value)


def test_the_corners_are_those_that_trimesh_sees() -> None:
    for data in [BINARY, ASCII, ASCII.replace(b"\n", b"\r\n"), ASCII.upper(), b"  " + ASCII]:
        assert corners(data) == pytest.approx(BALL.triangles.reshape(-1, 3), abs=1e-6)


def test_a_binary_file_may_start_with_solid_and_end_with_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert len(corners(b"solid" + BINARY[5:])) == len(BALL.faces) * 3
    assert len(corners(BINARY + b"made by a modeller")) == len(BALL.faces) * 3


def test_a_file_is_read_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes, "TRIANGLES_AT_ONCE", 7)
    monkeypatch.setattr(meshes, "BLOCK", 1000)
    for data in (BINARY, ASCII):
        assert corners(data) == pytest.approx(BALL.triangles.reshape(-1, 3), abs=1e-6)


def test_an_ascii_file_may_hold_several_solids() -> None:
    assert len(corners(ASCII + b"\n" + ASCII)) == len(BALL.faces) * 6


@pytest.mark.parametrize("data", [ASCII[:-20], ASCII[: len(ASCII) // 2], b"solid " + b"x" * 100])
def test_an_ascii_file_that_is_cut_off_is_reported(data: bytes) -> None:
    assert (
        refusal(data)
        == "a.stl: is truncated: it does not end with 'endsolid'; export it again as STL"
    )


def test_a_facet_of_two_vertices_is_reported() -> None:
    first = ASCII.index(b"vertex")
    assert "is truncated" in refusal(ASCII[:first] + ASCII[ASCII.index(b"vertex", first + 1) :])


def test_a_long_file_without_facets_is_not_gathered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes, "BLOCK", 100)
    file = io.BytesIO(b"solid" + b" " * 10_000)
    with pytest.raises(RobotError, match="is truncated"):
        list(read_stl(file, 10_005, "a.stl"))
    assert file.tell() < 1000


def test_a_vertex_without_numbers_is_reported() -> None:
    data = (
        b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 x\nendloop\nendfacet\nendsolid a"
        + b" " * 84
    )
    assert (
        refusal(data) == "a.stl: a vertex is not a number: could not convert string to float: b'x'"
    )


def test_what_is_written_is_read_again() -> None:
    points = np.arange(12.0).reshape(4, 3)
    assert set(map(tuple, corners(write_stl(points)))) == set(map(tuple, points))
