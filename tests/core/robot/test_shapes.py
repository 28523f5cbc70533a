"""Meshes of a robot file: found, read if something can touch them, replaced by a box if they are
bad.
"""

import base64
import os
from pathlib import Path

import pytest
import trimesh
from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files import shapes
from holozen.robot.files.elements import Source, read_xml
from holozen.robot.files.meshes import data_uri
from holozen.robot.files.shapes import mesh_shape, read_shape
from holozen.robot.model import Pose, Shape, solid

STL = trimesh.creation.box((1, 2, 3)).export(file_type="stl")
CORNERS = {(x, y, z) for x in (-0.5, 0.5) for y in (-1, 1) for z in (-1.5, 1.5)}
INERTIAL = '<inertial><mass value="12"/><inertia ixx="0.13" iyy="0.10" izz="0.05"/></inertial>'


@pytest.fixture
def source(home: Path) -> Source:
    """A robot file with box.stl beside it."""
    (home / "box.stl").write_bytes(STL)
    return Source(home / "robot.urdf", {})


def shape(source: Source, uri: str, use: str = "collision", more: str = "") -> Shape:
    text = (
        f"<link name='a'>{INERTIAL}\n<{use}><geometry><mesh filename='{uri}' "
        f"{more}/></geometry></{use}></link>"
    )
    return read_shape(read_xml(text, "robot.urdf").children[1], source)


def test_a_collision_mesh_becomes_solid_and_other_shapes_stay_as_they_are(
    source: Source, home: Path
) -> None:
    found = shape(source, "box.stl", more='scale="2 1 -1"')
    assert found == Shape("mesh", (2, 1, -1), Pose(), home / "box.stl", points=found.points)
    hull = solid(found)
    assert (hull.kind, hull.size, hull.path) == ("hull", (), home / "box.stl")
    assert set(hull.points) == {(2 * x, y, -z) for x, y, z in CORNERS}
    assert solid(hull) is hull
    box = Shape("box", (1, 1, 1), Pose())
    assert solid(box) is box
    lost = Shape("mesh", (1, 1, 1), Pose())
    assert solid(lost) is lost


@pytest.mark.parametrize("data", [b"", STL[:-1], b"nonsense"])
def test_a_bad_collision_mesh_is_a_warning_and_the_box_of_the_link_s_inertia(
    source: Source, home: Path, data: bytes
) -> None:
    (home / "box.stl").write_bytes(data)
    found = shape(source, "box.stl")
    assert found.kind == "box" and found.size == pytest.approx((0.1, 0.2, 0.3))
    (warning,) = source.warnings
    box = "is replaced by a box of 0.1 x 0.2 x 0.3 m"
    assert warning.startswith(
        f"robot.urdf, line 2: <mesh> of <link name='a'> (collision) {box}: {home}/box.stl: is "
    )


@pytest.mark.parametrize("use", ["visual", "collision"])
def test_a_missing_mesh_is_a_warning_and_in_strict_an_error(source: Source, use: str) -> None:
    assert shape(source, "gone.stl", use).kind == "box"
    assert (
        f"({use}) is replaced by a box of 0.1 x 0.2 x 0.3 m: no such file 'gone.stl'"
        in source.warnings[0]
    )
    message = (
        rf"^robot.urdf, line 2: <mesh> of <link name='a'> \({use}\): no such file "
        r"'gone.stl'; looked for /"
    )
    with pytest.raises(RobotError, match=message):
        shape(replace(source, strict=True), "gone.stl", use)


def test_a_bad_collision_mesh_is_an_error_in_strict(source: Source, home: Path) -> None:
    (home / "box.stl").write_bytes(b"")
    with pytest.raises(
        RobotError, match=r"line 2: .* \(collision\): /.*/box\.stl: is empty \(0 bytes\)"
    ):
        shape(replace(source, strict=True), "box.stl")


def test_a_visual_mesh_is_found_but_not_read(source: Source, home: Path) -> None:
    (home / "box.stl").write_bytes(b"")
    assert shape(source, "box.stl", "visual").path == home / "box.stl"
    assert source.warnings == []


def test_another_file_with_the_name_is_taken_with_a_warning_that_names_it(
    source: Source, home: Path
) -> None:
    assert shape(source, "/home/asha/ws/box.stl").path == home / "box.stl"
    (warning,) = source.warnings
    message = (
        f"(collision): there is no file '/home/asha/ws/box.stl'; {home}/box.stl, which has "
        "the same name, is used"
    )
    assert warning == f"robot.urdf, line 2: <mesh> of <link name='a'> {message}; write box.stl"


def test_a_data_uri_is_a_hull_at_the_urdf_s_scale(source: Source, home: Path) -> None:
    uri = data_uri(home / "box.stl")
    for confined in (False, True):
        found = shape(replace(source, confined=confined), uri, more='scale="1 1 2"')
        assert (found.kind, found.path) == ("hull", None)
        assert set(found.points) == {(x, y, 2 * z) for x, y, z in CORNERS}


def test_a_bad_data_uri_is_a_box_and_a_warning_that_stays_one_short_line(source: Source) -> None:
    uri = "data:model/stl;base64," + base64.b64encode(b"x" * 90_000).decode()
    assert shape(source, uri).kind == "box"
    assert "data: URI: is truncated" in source.warnings[0] and len(source.warnings[0]) < 300


def test_a_confined_text_opens_no_file_beside_it_nor_a_guess(source: Source, home: Path) -> None:
    wire = replace(source, confined=True)
    for uri in ("box.stl", str(home / "box.stl"), "/home/asha/box.stl", f"file://{home}/box.stl"):
        assert shape(wire, uri).kind == "box"
    assert len(wire.warnings) == 4


def test_a_confined_text_has_a_limited_number_of_meshes(
    source: Source, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shapes, "MAX_MESHES", 2)
    uri, wire = data_uri(home / "box.stl"), replace(source, confined=True)
    assert [shape(wire, uri).kind for _ in range(3)] == ["hull", "hull", "box"]
    assert "is mesh number 3; the sim reads at most 2 collision meshes" in wire.warnings[0]
    assert [shape(source, uri).kind for _ in range(3)] == ["hull"] * 3


def test_no_large_file_is_read_for_a_confined_text(
    source: Source, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shapes, "MAX_BYTES", len(STL) - 1)
    wire = replace(source, confined=True, packages={"p": home})
    assert shape(wire, "package://p/box.stl").kind == "box"
    assert (
        f"{home}/box.stl: is too large to be read by the sim; send the mesh itself"
        in wire.warnings[0]
    )
    assert shape(replace(source, packages={"p": home}), "package://p/box.stl").kind == "mesh"


def test_visual_meshes_of_a_confined_text_are_not_even_looked_for(
    source: Source, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os.path, "isfile", None)
    assert shape(replace(source, confined=True), "/etc/passwd", "visual") == Shape(
        "mesh", (1, 1, 1), Pose()
    )


def test_the_sdf_reader_may_ask_for_a_mesh_with_its_colour(source: Source, home: Path) -> None:
    tag, red = read_xml("<mesh/>", "model.sdf"), (1.0, 0.0, 0.0, 1.0)
    found = mesh_shape(tag, "box.stl", Pose((0, 0, 1)), "visual", source, red)
    assert found == Shape("mesh", (1, 1, 1), Pose((0, 0, 1)), home / "box.stl", red)
    assert mesh_shape(tag, "gone.stl", Pose(), "visual", source, red).color == red
