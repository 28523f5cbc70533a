"""A mesh is found however the robot file calls it."""

from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.uris import resolve_uri


@pytest.fixture
def start(home: Path) -> Path:
    """The robot file of a package `holo` with two meshes, next to a package `wheels` with one."""
    for name in ("holo", "wheels"):
        (home / name / "meshes").mkdir(parents=True)
        (home / name / "package.xml").write_text(f"<package><name>{name}</name></package>")
    (home / "holo" / "urdf").mkdir()
    (home / "holo" / "meshes" / "base.dae").touch()
    (home / "holo" / "meshes" / "my base.dae").touch()
    (home / "wheels" / "meshes" / "wheel.stl").touch()
    return home / "holo" / "urdf" / "hb_bot.urdf"


@pytest.mark.parametrize(
    ("uri", "file"),
    [
        ("package://holo/meshes/base.dae", "holo/meshes/base.dae"),
        ("package://holo//meshes/base.dae", "holo/meshes/base.dae"),
        ("model://holo/meshes/base.dae", "holo/meshes/base.dae"),
        ("PACKAGE://holo/meshes/base.dae", "holo/meshes/base.dae"),
        (" package://holo/meshes/base.dae ", "holo/meshes/base.dae"),
        ("package://wheels/meshes/wheel.stl", "wheels/meshes/wheel.stl"),
        ("package://holo/meshes/my%20base.dae", "holo/meshes/my base.dae"),
        ("package://holo/meshes/my base.dae", "holo/meshes/my base.dae"),
        ("../meshes/base.dae", "holo/meshes/base.dae"),
        ("../meshes/my%20base.dae", "holo/meshes/my base.dae"),
        ("meshes/base.dae", "holo/meshes/base.dae"),
        ("file://meshes/base.dae", "holo/meshes/base.dae"),
    ],
)
def test_a_mesh_is_found_by_package_and_by_relative_path(start: Path, home: Path, uri: str, file: str) -> None:
    assert resolve_uri(uri, start) == home / file


def test_an_absolute_path_is_taken_as_it_stands(start: Path, home: Path) -> None:
    mesh = home / "holo" / "meshes" / "my base.dae"
    encoded = str(mesh).replace(" ", "%20")
    for uri in (str(mesh), f"file://{mesh}", f"file://localhost{mesh}", f"file://{encoded}", encoded):
        assert resolve_uri(uri, start) == mesh


def test_a_file_with_a_real_percent_sign_in_its_name_is_found(start: Path, home: Path) -> None:
    mesh = home / "holo" / "meshes" / "a%20b.dae"
    mesh.touch()
    assert resolve_uri("package://holo/meshes/a%20b.dae", start) == mesh


def test_a_given_package_is_used(start: Path, home: Path) -> None:
    assert resolve_uri("package://x/meshes/wheel.stl", start, {"x": home / "wheels"}).name == "wheel.stl"


@pytest.mark.parametrize(
    "uri",
    [
        "/home/asha/catkin_ws/src/hb/meshes/wheel.stl",
        "file:///home/asha/catkin_ws/src/hb/meshes/wheel.stl",
        r"C:\Users\asha\hb\meshes\wheel.stl",
        "file:///C:/Users/asha/hb/meshes/wheel.stl",
    ],
)
def test_a_path_of_another_machine_is_found_again_by_its_file_name(start: Path, home: Path, uri: str) -> None:
    assert resolve_uri(uri, start) == home / "wheels" / "meshes" / "wheel.stl"


def test_of_several_files_with_that_name_the_one_that_shares_most_of_the_path_is_taken(start: Path, home: Path) -> None:
    for folder in ("a/visual", "b/collision", "c/visual"):
        (home / "holo" / folder).mkdir(parents=True)
        (home / "holo" / folder / "arm.stl").touch()
    assert resolve_uri("/home/asha/hb/b/collision/arm.stl", start) == home / "holo/b/collision/arm.stl"
    assert resolve_uri("/home/asha/hb/c/visual/arm.stl", start) == home / "holo/c/visual/arm.stl"


def test_a_path_of_another_machine_is_not_looked_for_in_hidden_folders(start: Path, home: Path) -> None:
    (home / "holo" / ".git").mkdir()
    (home / "holo" / ".git" / "lost.stl").touch()
    with pytest.raises(RobotError, match="no such file"):
        resolve_uri("/home/asha/lost.stl", start)


def test_a_missing_file_is_told_with_the_places_it_was_looked_for(start: Path, home: Path) -> None:
    with pytest.raises(RobotError) as error:
        resolve_uri("package://holo/meshes/gone.dae", start)
    expected = f"no such file 'package://holo/meshes/gone.dae'; looked for {home}/holo/meshes/gone.dae"
    assert str(error.value) == expected


@pytest.mark.parametrize("uri", ["", "package://holo", "meshes", "package://holo/%00", "x" * 5000, "~/base.dae"])
def test_what_is_no_file_is_told(start: Path, uri: str) -> None:
    with pytest.raises(RobotError, match="no such file"):
        resolve_uri(uri, start)


def test_an_unknown_package_is_told(home: Path) -> None:
    with pytest.raises(RobotError, match="there is no package 'hollo'; packages found: holo;"):
        (home / "holo").mkdir()
        (home / "holo" / "package.xml").write_text("<package><name>holo</name></package>")
        resolve_uri("package://hollo/meshes/base.dae", home / "alone.urdf")


@pytest.mark.parametrize("uri", ["http://example.org/base.dae", "data://x", "https://x/meshes/base.dae"])
def test_nothing_is_fetched_from_elsewhere(start: Path, uri: str) -> None:
    with pytest.raises(RobotError, match="is not fetched; write package://"):
        resolve_uri(uri, start)


def test_a_package_uri_has_to_name_its_package(start: Path) -> None:
    with pytest.raises(RobotError, match="'' is no package name"):
        resolve_uri("package:///meshes/base.dae", start)
