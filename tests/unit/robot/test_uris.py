"""A mesh is found however the robot file calls it."""

from pathlib import Path

import pytest

from holozen.data import find
from holozen.robot.errors import RobotError
from holozen.robot.uris import MODEL_PATHS, resolve_uri


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


@pytest.mark.parametrize("variable", MODEL_PATHS)
def test_a_model_is_found_in_the_folders_that_gazebo_is_told(
    start: Path, home: Path, variable: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = home / "models" / "cafe" / "meshes" / "cafe.dae"
    mesh.parent.mkdir(parents=True)
    mesh.touch()
    monkeypatch.setenv(variable, f":relative:{home}/nowhere:{home}/models")
    assert resolve_uri("model://cafe/meshes/cafe.dae", start) == mesh


@pytest.mark.parametrize("mark", ["model.config", "package.xml", "meshes/"])
@pytest.mark.parametrize("beside", ["", "holo/"])
def test_a_model_is_found_beside_the_folders_that_the_robot_lies_in(
    start: Path, home: Path, beside: str, mark: str
) -> None:
    mesh = home / f"{beside}cafe" / "dae" / "cafe.dae"
    mesh.parent.mkdir(parents=True)
    mesh.touch()
    with pytest.raises(RobotError, match="no such file"):
        resolve_uri("model://cafe/dae/cafe.dae", start)
    sign = home / f"{beside}cafe" / mark
    sign.mkdir() if mark.endswith("/") else sign.write_text("<package><name>other</name></package>")
    for scheme in ("model", "package"):
        assert resolve_uri(f"{scheme}://cafe/dae/cafe.dae", start) == mesh


def test_what_was_taken_for_another_file_is_told(start: Path, home: Path) -> None:
    told: list[str] = []
    found = resolve_uri("/home/asha/wheel.stl", start, tell=told.append)
    assert told == [f"there is no file '/home/asha/wheel.stl'; {found} is taken, which has its name"]
    resolve_uri(str(found), start, tell=told.append)
    assert len(told) == 1


def confined(uri: str, start: Path, given: Path) -> Path | None:
    """What a text that came over the wire finds when the package `holo` is given."""
    try:
        return resolve_uri(uri, start, {"holo": given}, confined=True)
    except RobotError as error:
        told = ("send the mesh itself (holozen spawn does)", "the sim does not know the package", "is no package name")
        assert any(words in str(error) for words in told)
        return None


def test_a_confined_text_finds_files_of_known_packages(start: Path, home: Path) -> None:
    mesh = home / "holo" / "meshes" / "base.dae"
    for uri in ("package://holo/meshes/base.dae", "model://holo/meshes/base.dae", str(mesh), f"file://{mesh}"):
        assert confined(uri, start, home / "holo") == mesh


@pytest.mark.parametrize("variable", ["ROS_PACKAGE_PATH", "GZ_SIM_RESOURCE_PATH"])
def test_a_confined_text_finds_files_of_the_environment_s_packages(
    start: Path, home: Path, variable: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(variable, str(home))
    assert resolve_uri("package://wheels/meshes/wheel.stl", start, confined=True).name == "wheel.stl"


def test_a_confined_text_finds_the_meshes_that_holozen_has(start: Path) -> None:
    mesh = find("meshes", "wheel.stl")
    assert resolve_uri(f"file://{mesh}", start, confined=True) == mesh


@pytest.mark.parametrize(
    "uri",
    [
        "/etc/passwd",
        "file:///etc/passwd",
        "package://holo/../wheels/meshes/wheel.stl",
        "package://holo/..%2Fwheels/meshes/wheel.stl",
        "package://holo/meshes/out.stl",
        "package://holo/%00",
        "package://holo//etc/passwd",
        "package://../wheels/meshes/wheel.stl",
        "package://wheels/meshes/wheel.stl",
        "package://holozen/nothing.stl",
        "model://../x",
        "../meshes/base.dae",
        "meshes/base.dae",
        "file://meshes/base.dae",
        "C:/holo/meshes/base.dae",
        "/home/asha/base.dae",
        "/",
        "",
    ],
)
def test_a_confined_text_finds_nothing_else(start: Path, home: Path, uri: str) -> None:
    (home / "holo" / "meshes" / "out.stl").symlink_to(home / "wheels" / "meshes" / "wheel.stl")
    assert confined(uri, start, home / "holo") is None


def test_a_relative_path_means_nothing_to_a_confined_text(start: Path, home: Path) -> None:
    with pytest.raises(RobotError, match="is a path that means nothing here; send the mesh itself"):
        resolve_uri(f"{home}/holo/meshes/base.dae"[1:], start, {"holo": home / "holo"}, confined=True)


def test_a_package_beside_another_with_a_longer_name_is_outside_of_it(start: Path, home: Path) -> None:
    (home / "holo2").mkdir()
    (home / "holo2" / "a.stl").touch()
    assert confined(f"{home}/holo2/a.stl", start, home / "holo") is None


def test_the_whole_disk_is_no_known_folder(start: Path) -> None:
    assert confined("/etc/passwd", start, Path("/")) is None


def test_a_package_that_the_sim_does_not_know_is_told_with_what_to_do(home: Path) -> None:
    with pytest.raises(RobotError) as error:
        resolve_uri("package://holo/meshes/base.dae", home / "robot.urdf", confined=True)
    assert str(error.value) == (
        "'package://holo/meshes/base.dae': the sim does not know the package 'holo'; start it with --package holo=DIR,"
        " or use `holozen spawn FILE`, which sends meshes along"
    )
