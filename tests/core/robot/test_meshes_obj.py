"""Wavefront OBJ files: the vertices that faces use."""

import io

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.meshes import read_obj

POINTS = "v 0 0 0\nv 1 0 0\nv\t0 1e0 0 1.0\n"


def vertices(text: str) -> list[list[float]]:
    data = text.encode()
    return [
        point
        for part in read_obj(io.BytesIO(data), len(data), "a.obj")
        for point in part.points.tolist()
    ]


def test_faces_name_vertices_in_every_way_the_format_has() -> None:
    for face in [
        "f 1 2 3",
        "f 1/1 2/2 3/3",
        "f 1//1 2//1 3//1",
        "f 1/1/1 2/1/1 3/1/1",
        "f -1 -2 -3",
        "f\t1 2 3\r",
    ]:
        assert vertices(f"# a\no part\n{POINTS}vn 0 0 1\nvt 0 0\ng x\nusemtl m\n{face}\n") == [
            [0, 0, 0],
            [1, 0, 0],
            [0, 1, 0],
        ]


def test_a_vertex_that_no_face_uses_does_not_count() -> None:
    assert [9, 9, 9] not in vertices(f"{POINTS}v 9 9 9\nf 1 2 3\n")


def test_a_file_without_faces_has_no_vertices() -> None:
    assert vertices(POINTS) == []


def test_what_is_no_mesh_is_reported_with_its_line() -> None:
    for line, message in [
        ("v 0 0", "a.obj, line 4: a vertex with 2 numbers instead of 3"),
        ("v 0 0 x", "a.obj, line 4: could not convert string to float: b'x'"),
        ("f 1 2 x", "a.obj, line 4: invalid literal for int() with base 10: b'x'"),
        ("f 1 2 4", "a.obj: a face refers to vertex 4 of 3"),
        ("f 1 2 -4", "a.obj: a face refers to vertex 0 of 3"),
        (
            "f 1 2 99999999999999999999",
            "a.obj, line 4: a face refers to a vertex that does not exist",
        ),
    ]:
        with pytest.raises(RobotError) as error:
            vertices(f"{POINTS}{line}\n")
        assert str(error.value) == message
