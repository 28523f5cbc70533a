"""Mesh files become hulls: of the right size, read once, and every bad one is one line."""

import base64
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
import trimesh

from holozen.robot.errors import RobotError
from holozen.robot.files import meshes
from holozen.robot.files.meshes import bounds, data_hull, data_uri, hull

REPO = Path(__file__).parents[3]
CUBE = trimesh.creation.box((1, 2, 3))
STL = CUBE.export(file_type="stl")
DATA = "data:model/stl;base64,"


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    """A binary STL of a box of 1 x 2 x 3 round the origin."""
    path = tmp_path / "cube.stl"
    path.write_bytes(STL)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(RobotError) as error:
        hull(path)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_box_has_its_size_in_metres_at_any_scale(tmp_path: Path) -> None:
    for name in ["cube.stl", "cube.STL", "cube_ascii.stl", "cube.obj"]:
        path = tmp_path / name
        kind = "stl_ascii" if "ascii" in name else name[-3:].lower()
        CUBE.export(path, file_type=kind)
        assert bounds(path) == ((-0.5, -1, -1.5), (0.5, 1, 1.5))
        assert bounds(path, (0.001, 0.01, -0.1)) == pytest.approx(
            np.array([(-0.0005, -0.01, -0.15), (0.0005, 0.01, 0.15)])
        )
        assert set(hull(path)) == {
            (x, y, z) for x in (-0.5, 0.5) for y in (-1, 1) for z in (-1.5, 1.5)
        }


@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array")  # by pycollada
@pytest.mark.parametrize("name", ["base.dae", "wheel.stl"])
def test_the_meshes_of_the_lesson_have_the_bounding_box_that_trimesh_sees(name: str) -> None:
    path = REPO / "meshes" / name
    assert np.array(bounds(path)) == pytest.approx(trimesh.load_scene(path).bounds, rel=1e-6)


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The STL files that were read since."""
    seen: list[str] = []

    def counting(file: BinaryIO, size: int, place: str) -> Iterator[meshes.Surface]:
        seen.append(place)
        return meshes.read_stl(file, size, place)

    monkeypatch.setitem(meshes.READERS, ".stl", (counting, 1_000_000))
    return seen


def test_a_mesh_is_read_once_whatever_its_scale(cube: Path, reads: list[str]) -> None:
    assert hull(cube, (2, 2, 2)) and hull(cube, (1, -1, 1)) and bounds(cube) and data_uri(cube)
    assert reads == [str(cube)]


def stl_of(triangles: int, corners: np.ndarray) -> bytes:
    """A binary STL whose header gives `triangles`."""
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *row.ravel(), 0) for row in corners.reshape(-1, 3, 3)
    )
    return bytes(80) + struct.pack("<I", triangles) + body


NAN = stl_of(1, np.array([0, 0, 0, 1, 0, 0, 0, np.nan, 0]))
# numpy warns of it; a warning fails a test
SIGNALLING = NAN.replace(struct.pack("<f", np.nan), b"\x01\x00\x80\x7f")
INF = stl_of(1, np.array([0, 0, 0, 1, 0, 0, 0, np.inf, 0]))
FAR = stl_of(1, np.array([0, 0, 0, 1, 0, 0, 0, 1e30, 0]))
LINE = stl_of(1, np.array([0, 0, 0, 1, 0, 0, 2, 0, 0]))
NEEDLE = stl_of(1, np.array([0, 0, 0, 1, 0, 0, 0, 2**-16, 0]))
POINT = stl_of(1, np.ones(9))


def test_a_bad_mesh_is_reported_in_one_line_with_its_file(tmp_path: Path) -> None:
    rows = [
        ("a.stl", b"", "is empty (0 bytes)"),
        ("a.dae", b"", "is empty (0 bytes)"),
        ("a.obj", b"", "is empty (0 bytes)"),
        (
            "a.stl",
            STL[:-1],
            "is truncated: it has 683 bytes, but 12 triangles take 684; export it again as STL",
        ),
        (
            "a.stl",
            b"no mesh",
            "is truncated: it has 7 bytes, but the head alone takes 84; export it again as STL",
        ),
        ("a.stl", stl_of(0, np.zeros(0)), "has no faces"),
        ("a.stl", NAN, "has a vertex that is NaN or infinite; export it again"),
        ("a.stl", SIGNALLING, "has a vertex that is NaN or infinite; export it again"),
        ("a.stl", INF, "has a vertex that is NaN or infinite; export it again"),
        (
            "a.obj",
            b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n",
            "has a vertex that is NaN or infinite; export it again",
        ),
        ("a.stl", FAR, "has a vertex beyond 1e+09; export it again, in metres"),
        ("a.stl", LINE, "is 2 x 0 x 0 m, which has no volume; check its scale"),
        ("a.stl", NEEDLE, "is 1 x 1.52588e-05 x 0 m, which has no volume; check its scale"),
        ("a.stl", POINT, "is 0 x 0 x 0 m, which has no volume; check its scale"),
        ("a.step", STL, "is not a supported mesh; use a .dae, .obj, .stl file"),
        ("a", STL, "is not a supported mesh; use a .dae, .obj, .stl file"),
    ]
    for number, (name, data, message) in enumerate(rows):
        path = tmp_path / f"{number}{name}"
        path.write_bytes(data)
        assert refusal(path) == f"{path}: {message}"


@pytest.mark.parametrize(
    ("name", "size"), [("a.stl", 301_000_000), ("a.dae", 101_000_000), ("a.obj", 81_000_000)]
)
def test_a_huge_file_is_refused_unread(tmp_path: Path, name: str, size: int) -> None:
    path = tmp_path / name
    with path.open("wb") as file:
        file.truncate(size)
    assert f"{path}: has {size / 1e6:.0f} MB, at most {size / 1e6 - 1:.0f} MB are read" in refusal(
        path
    )


def test_many_triangles_are_read_a_part_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(meshes, "TRIANGLES_AT_ONCE", 100)
    path, count = tmp_path / "giant.stl", 250
    points = bytes(50 * (count - 12))  # in the middle
    path.write_bytes(bytes(80) + struct.pack("<I", count) + STL[84:384] + points + STL[384:])
    with path.open("rb") as file:
        assert [len(part.points) for part in meshes.read_stl(file, path.stat().st_size, "")] == [
            300,
            300,
            150,
        ]
    assert bounds(path) == ((-0.5, -1, -1.5), (0.5, 1, 1.5))


def test_a_fifo_is_not_opened(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    os.mkfifo(path)
    assert refusal(path) == f"{path}: is not a file that could contain a mesh"


def test_a_folder_and_a_missing_file_are_reported(tmp_path: Path) -> None:
    (tmp_path / "a.stl").mkdir()
    assert (
        refusal(tmp_path / "a.stl") == f"{tmp_path}/a.stl: is not a file that could contain a mesh"
    )
    assert refusal(tmp_path / "gone.stl") == f"{tmp_path}/gone.stl: No such file or directory"
    assert "null" in refusal(tmp_path / "\0.stl")


def test_a_file_that_may_not_be_read_is_reported(
    cube: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_words: object) -> None:
        raise PermissionError(13, "Permission denied")

    # many tests run as root, which may read everything
    monkeypatch.setattr("builtins.open", refuse)
    assert refusal(cube) == f"{cube}: Permission denied"


def test_a_flat_mesh_is_made_a_millimetre_thick(tmp_path: Path) -> None:
    path = tmp_path / "sheet.obj"
    path.write_text("v 0 0 5\nv 2 0 5\nv 2 1 5\nv 0 1 5\nf 1 2 3 4\n")
    low, high = bounds(path)
    assert low == pytest.approx((0, 0, 5 - meshes.THICK / 2))
    assert high == pytest.approx((2, 1, 5 + meshes.THICK / 2))


def test_a_data_uri_gives_the_hull_back(cube: Path) -> None:
    uri = data_uri(cube)
    assert uri.startswith(DATA) and len(uri) < 1000
    assert set(data_hull(uri, (2, 1, 1))) == set(hull(cube, (2, 1, 1)))
    assert set(data_hull(uri.replace(",", ",\n "))) == set(hull(cube))


def test_the_hull_of_any_mesh_is_a_short_text() -> None:
    uri = data_uri(REPO / "meshes" / "wheel.stl")
    assert len(uri) < 8000
    assert len(data_hull(uri)) <= 256


def encoded(data: bytes) -> str:
    return DATA + base64.b64encode(data).decode()


def test_a_bad_data_uri_is_reported() -> None:
    for uri, message in [
        ("data:,x", "'data:,x' is not supported; write data:model/stl;base64,..."),
        (
            "data:text/html;base64,AAAA",
            "'data:text/html;base64,AAAA' is not supported; write data:model/stl;base64,...",
        ),
        (DATA + "%%%", f"'{DATA}%%%' is not valid base64"),
        (DATA + "ä", f"'{DATA}ä' is not valid base64"),
        (
            DATA,
            "data: URI: is truncated: it has 0 bytes, but the head alone takes 84; export it "
            "again as STL",
        ),
        (encoded(NAN), "data: URI: has a vertex that is NaN or infinite; export it again"),
        (encoded(POINT), "data: URI: is 0 x 0 x 0 m, which has no volume; check its scale"),
        (DATA + "A" * 1_000_000, "a data: URI of 1000022 characters; at most 1000000 are read"),
    ]:
        with pytest.raises(RobotError) as error:
            data_hull(uri)
        assert str(error.value) == message
