"""The meshes and the logo: sizes at the scale of the URDF, closed surfaces, the script that makes
them.
"""

import struct
import subprocess
import sys
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

ROOT = Path(__file__).parents[2]
MESHES = ROOT / "meshes"
FILES = ["base.dae", "wheel.stl", "logo.png"]
DAE = "{http://www.collada.org/2005/11/COLLADASchema}"
ORIGIN = 0.28  # of base.dae above footprint_link, in the URDF
WHEELS = np.array([(0.0, 0.68), (-0.58, -0.36), (0.58, -0.36)])


def make(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, MESHES / "make_meshes.py", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "new" / "folder"
    assert make(folder).returncode == 0
    return folder


def base_parts() -> dict[str, trimesh.Trimesh]:
    """base.dae by geometry, in metres above footprint_link, with the file's own normals."""
    parts = {}
    for geometry in ElementTree.parse(MESHES / "base.dae").iter(f"{DAE}geometry"):
        points, normals = (rows(array) for array in geometry.iter(f"{DAE}float_array"))
        corners = np.array((geometry.findtext(f".//{DAE}p") or "").split(), dtype=int).reshape(
            -1, 3, 2
        )
        part = trimesh.Trimesh(
            points * scale("base.dae") + (0, 0, ORIGIN), corners[..., 0], process=False
        )
        part.metadata["normals"] = normals[corners[:, 0, 1]]
        parts[geometry.attrib["id"]] = part
    return parts


def scale(name: str) -> float:
    """The one scale that the URDF gives a mesh in all directions."""
    meshes = ElementTree.parse(ROOT / "urdf" / "hb_bot.urdf.xacro").iter("mesh")
    (text,) = {
        mesh.attrib["scale"]
        for mesh in meshes
        if mesh.attrib["filename"].endswith(f"/meshes/{name}")
    }
    (value,) = set(text.split())
    return float(value)


def rows(array: ElementTree.Element) -> np.ndarray:
    return np.array((array.text or "").split(), dtype=float).reshape(-1, 3)


def wheel() -> trimesh.Trimesh:
    mesh = trimesh.load_mesh(MESHES / "wheel.stl")
    return trimesh.Trimesh(mesh.vertices * scale("wheel.stl"), mesh.faces)


def pixels(png: bytes) -> bytes:
    """The unpacked rows of a PNG whose image is one IDAT chunk, right after the header."""
    (size,) = struct.unpack(">I", png[33:37])
    assert png[37:41] == b"IDAT"
    return zlib.decompress(png[41 : 41 + size])


def test_the_wheel_fits_its_collision_cylinder_with_the_axle_along_y() -> None:
    mesh = wheel()
    assert mesh.bounds == pytest.approx(
        np.array([(-0.14, -0.065, -0.14), (0.14, 0.065, 0.14)]), abs=1e-5
    )
    assert np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 2]).max() == pytest.approx(0.14, abs=1e-5)


def test_the_wheel_is_a_hub_and_two_rows_of_rollers_set_half_a_pitch_apart() -> None:
    rim = [
        piece for piece in wheel().split() if np.hypot(*piece.vertices[:, [0, 2]].T).max() > 0.13
    ]
    middles = np.array([piece.bounds.mean(axis=0) for piece in rim])
    angles = np.degrees(np.arctan2(middles[:, 2], middles[:, 0]))
    inner, outer = (np.sort(angles[middles[:, 1] * side > 0.03]) for side in (-1, 1))
    assert len(rim) == len(inner) + len(outer) == 16
    assert np.diff(inner) == pytest.approx(np.full(7, 45), abs=0.1)
    assert np.abs(inner - outer) == pytest.approx(np.full(8, 22.5), abs=0.1)


def test_every_surface_is_closed_and_faces_outwards() -> None:
    for name, mesh in {"wheel": wheel(), **base_parts()}.items():
        assert mesh.is_watertight, name
        assert all(piece.volume > 0 for piece in mesh.split()), name


def test_the_normals_in_base_dae_are_those_of_its_faces() -> None:
    for part in base_parts().values():
        assert part.metadata["normals"] == pytest.approx(part.face_normals, abs=2e-3)


def test_the_base_fits_between_the_wheels_and_above_the_ground() -> None:
    points = np.vstack([part.vertices for part in base_parts().values()])
    assert 0.59 < np.hypot(points[:, 0], points[:, 1]).max() < 0.68 - 0.13 / 2
    assert points[:, 2].min() > 0.04 + 0.05  # the robot settles 0.04 lower than footprint_link
    assert points[:, 2].max() == pytest.approx(0.342, abs=1e-4)


def test_the_deck_lies_level_between_0_2_and_0_35() -> None:
    low, high = base_parts()["deck"].bounds
    assert 0.2 < low[2] < high[2] < 0.35
    assert high[2] - low[2] < 0.03 < high[0] - low[0]


def test_each_motor_lies_on_the_line_from_the_centre_to_its_wheel() -> None:
    found = np.array([piece.bounds.mean(axis=0) for piece in base_parts()["motors"].split()])
    ways = WHEELS / np.linalg.norm(WHEELS, axis=1, keepdims=True)
    assert len(found) == 3
    for way in ways:
        along = found[(found[:, :2] @ way).argmax()]
        assert along == pytest.approx([*(way * 0.497), 0.18], abs=0.015)


def test_the_nose_points_forward_along_x() -> None:
    low, high = base_parts()["nose"].bounds
    assert high[0] > 0.39 and high[0] > -low[0] + 0.2
    assert low[1] == pytest.approx(-high[1], abs=1e-4)


@pytest.mark.parametrize("name", ["base.dae", "wheel.stl"])
def test_making_the_meshes_again_gives_the_committed_bytes(made: Path, name: str) -> None:
    assert (made / name).read_bytes() == (MESHES / name).read_bytes()


def test_making_the_logo_again_gives_the_committed_picture(made: Path) -> None:
    again, committed = ((folder / "logo.png").read_bytes() for folder in (made, MESHES))
    assert again[:33] == committed[:33]
    assert pixels(again) == pixels(committed)  # not the bytes: builds of zlib pack differently


def test_the_logo_is_a_png_of_512_by_512_with_transparency() -> None:
    data = (MESHES / "logo.png").read_bytes()
    assert data[:16] == b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + b"IHDR"
    assert struct.unpack(">IIBBBBB", data[16:29]) == (512, 512, 8, 6, 0, 0, 0)
    assert struct.unpack(">I", data[29:33]) == (zlib.crc32(data[12:29]),)
    assert len(pixels(data)) == 512 * (1 + 4 * 512)
    assert data.endswith(b"IEND" + struct.pack(">I", zlib.crc32(b"IEND")))


def test_all_files_together_stay_under_2_mb() -> None:
    assert 0 < sum((MESHES / name).stat().st_size for name in FILES) < 2_000_000


def test_a_folder_that_cannot_be_written_is_named_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    result = make(tmp_path / "file" / "folder")
    assert result.returncode == 2
    assert f"cannot write into {tmp_path}/file/folder: Not a directory" in result.stderr
    assert "Traceback" not in result.stderr
