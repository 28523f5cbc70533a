"""Packages, and the files that URIs name, are found on a machine without ROS, and errors name the
places searched.
"""

import os
from pathlib import Path

import pytest

from holozen.data import find
from holozen.packages import MODEL_PATHS, find_named, find_package, folders_above
from holozen.robot.errors import RobotError
from holozen.robot.files.uris import resolve_uri


def package(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "package.xml").write_text(f"<package><name> {name} </name></package>")
    return folder


def robot_file(package: Path) -> Path:
    (package / "urdf").mkdir(parents=True, exist_ok=True)
    file = package / "urdf" / "hb_bot.urdf.xacro"
    file.write_text("<robot/>")
    return file


def test_a_given_folder_wins_over_everything_else(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = robot_file(package(home / "src" / "holo", "holo"))
    given = home / "elsewhere"
    given.mkdir()
    (home / "opt" / "share" / "holo").mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(home / "opt"))
    assert find_package("holo", start, {"holo": given}) == given


def test_a_given_folder_that_does_not_exist_is_reported(home: Path) -> None:
    with pytest.raises(RobotError, match=r"--package holo=.*gone: there is no such folder"):
        find_package("holo", robot_file(home), {"holo": home / "gone"})


def test_the_ament_prefix_comes_before_ros_package_path(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = home / "opt" / "share" / "holo"
    share.mkdir(parents=True)
    workspace = package(home / "src" / "some_folder", "holo")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{home / 'nowhere'}:{home / 'src'}")
    start = robot_file(home / "mine")
    assert find_package("holo", start) == workspace
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{home / 'nowhere'}:{home / 'opt'}")
    assert find_package("holo", start) == share


def test_ros_package_path_comes_before_the_folders_above(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = robot_file(package(home / "mine", "holo"))
    other = package(home / "other", "holo")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(other))
    assert find_package("holo", start) == other


def test_a_package_xml_above_the_file_names_the_package_whatever_its_folder_is_called(
    home: Path,
) -> None:
    folder = package(home / "hb_task_1b-main", "hb_task_1b")
    assert find_package("hb_task_1b", robot_file(folder)) == folder


def test_a_package_next_to_the_robots_own_is_found(home: Path) -> None:
    start = robot_file(package(home / "src" / "holo", "holo"))
    neighbour = package(home / "src" / "wheels-2", "wheels")
    assert find_package("wheels", start) == neighbour


def test_of_two_packages_with_one_name_the_nearer_one_is_taken(home: Path) -> None:
    package(home / "holo_old", "holo")
    near = package(home / "src" / "holo", "holo")
    assert find_package("holo", robot_file(near)) == near


def test_a_package_xml_wins_over_a_nearer_urdf_folder(home: Path) -> None:
    named = package(home / "holo", "holo")
    start = robot_file(named / "robots" / "deep")
    assert find_package("holo", start) == named


def test_without_any_package_xml_the_nearest_folder_with_urdf_in_it_is_the_package(
    home: Path,
) -> None:
    start = robot_file(home / "clone-42")
    (home / "urdf").mkdir()
    assert find_package("holo", start) == home / "clone-42"
    assert find_named("holo", start) is None


def test_a_start_that_does_not_exist_yet_has_its_folders_searched_all_the_same(home: Path) -> None:
    folder = package(home / "holo", "holo")
    assert find_package("holo", folder / "gone" / "robot.urdf") == folder


def test_a_folder_may_be_the_start(home: Path) -> None:
    folder = package(home / "holo", "holo")
    assert find_package("holo", folder) == folder


def test_a_relative_start_is_seen_from_the_working_folder(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot_file(package(home / "holo", "holo"))
    monkeypatch.chdir(home / "holo" / "urdf")
    assert find_package("holo", Path("hb_bot.urdf.xacro")) == home / "holo"


def test_a_broken_package_xml_names_nothing(home: Path) -> None:
    for broken in ["<package><name>holo</nam", "", "<package/>", "\x00"]:
        folder = home / "holo"
        start = robot_file(folder)
        (folder / "package.xml").write_text(broken)
        assert find_named("holo", start) is None


def test_a_package_xml_that_is_no_file_of_a_sensible_size_names_nothing(home: Path) -> None:
    start = robot_file(home / "holo")
    xml = home / "holo" / "package.xml"
    os.mkfifo(xml)
    assert find_named("holo", start) is None
    xml.unlink()
    xml.write_text(f"<package><name>holo</name>{' ' * 1_000_000}</package>")
    assert find_named("holo", start) is None


def test_a_missing_package_is_named_with_those_found_and_the_places_searched(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = package(home / "src" / "holo", "holo") / "robot.xacro"
    package(home / "src" / "wheels", "wheels")
    package(home / "src" / ".trash", "hidden")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(package(home / "opt" / "ros", "from_ros")))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(home / "opt" / "ament"))
    with pytest.raises(RobotError) as error:
        find_package("hollo", start, {"given": home})
    searched = ("opt/ament", "opt/ros", "src/holo", "src", "")
    assert str(error.value) == (
        f"{start}: there is no package 'hollo'; packages found: from_ros, given, holo, wheels; "
        "looked in"
        f" {', '.join(str(home / folder) for folder in searched)}; give its folder: --package "
        "hollo=DIR"
        " (did you mean 'holo'?)"
    )


def test_of_many_packages_found_the_first_dozen_are_named(home: Path) -> None:
    for i in range(14):
        package(home / f"p{i:02}", f"p{i:02}")
    with pytest.raises(RobotError, match=r"packages found: p00, .*p11 and 2 more; looked in"):
        find_package("hollo", home)


def test_a_name_that_would_leave_the_folder_is_refused(home: Path) -> None:
    for name in ["", "..", "../../etc", "a/b", "a b", "*", "x" + "\n"]:
        with pytest.raises(RobotError, match="is not a package name"):
            find_package(name, robot_file(home))


def test_what_others_put_into_a_shared_folder_is_no_package_of_the_robot(home: Path) -> None:
    shared = home / "shared"
    package(shared / "trap", "holo")
    start = robot_file(shared / "mine")
    for mode in (0o755, 0o777, 0o1755):
        shared.chmod(mode)
        assert find_package("holo", start) == shared / "trap"
    shared.chmod(0o1777)
    assert find_package("holo", start) == shared / "mine"
    assert folders_above(start) == [shared / "mine" / "urdf", shared / "mine"]


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


def test_a_mesh_is_found_by_package_and_by_relative_path(start: Path, home: Path) -> None:
    for uri, file in [
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
    ]:
        assert resolve_uri(uri, start) == home / file


def test_an_absolute_path_is_taken_as_it_stands(start: Path, home: Path) -> None:
    mesh = home / "holo" / "meshes" / "my base.dae"
    encoded = str(mesh).replace(" ", "%20")
    for uri in (
        str(mesh),
        f"file://{mesh}",
        f"file://localhost{mesh}",
        f"file://{encoded}",
        encoded,
    ):
        assert resolve_uri(uri, start) == mesh


def test_a_file_with_a_real_percent_sign_in_its_name_is_found(start: Path, home: Path) -> None:
    mesh = home / "holo" / "meshes" / "a%20b.dae"
    mesh.touch()
    assert resolve_uri("package://holo/meshes/a%20b.dae", start) == mesh


def test_a_given_package_is_used(start: Path, home: Path) -> None:
    assert (
        resolve_uri("package://x/meshes/wheel.stl", start, {"x": home / "wheels"}).name
        == "wheel.stl"
    )


def test_a_path_of_another_machine_is_found_again_by_its_file_name(start: Path, home: Path) -> None:
    for uri in [
        "/home/asha/catkin_ws/src/hb/meshes/wheel.stl",
        "file:///home/asha/catkin_ws/src/hb/meshes/wheel.stl",
        r"C:\Users\asha\hb\meshes\wheel.stl",
        "file:///C:/Users/asha/hb/meshes/wheel.stl",
    ]:
        assert resolve_uri(uri, start) == home / "wheels" / "meshes" / "wheel.stl"


def test_of_several_files_with_that_name_the_one_that_shares_most_of_the_path_is_taken(
    start: Path, home: Path
) -> None:
    for folder in ("a/visual", "b/collision", "c/visual"):
        (home / "holo" / folder).mkdir(parents=True)
        (home / "holo" / folder / "arm.stl").touch()
    assert (
        resolve_uri("/home/asha/hb/b/collision/arm.stl", start) == home / "holo/b/collision/arm.stl"
    )
    assert resolve_uri("/home/asha/hb/c/visual/arm.stl", start) == home / "holo/c/visual/arm.stl"


def test_a_path_of_another_machine_is_not_looked_for_in_hidden_folders(
    start: Path, home: Path
) -> None:
    (home / "holo" / ".git").mkdir()
    (home / "holo" / ".git" / "lost.stl").touch()
    with pytest.raises(RobotError, match="no such file"):
        resolve_uri("/home/asha/lost.stl", start)


def test_a_missing_file_is_reported_with_the_places_it_was_looked_for(
    start: Path, home: Path
) -> None:
    with pytest.raises(RobotError) as error:
        resolve_uri("package://holo/meshes/gone.dae", start)
    expected = (
        f"no such file 'package://holo/meshes/gone.dae'; looked for {home}/holo/meshes/gone.dae"
    )
    assert str(error.value) == expected


def test_what_is_no_file_is_reported(start: Path) -> None:
    for uri in ["", "package://holo", "meshes", "package://holo/%00", "x" * 5000, "~/base.dae"]:
        with pytest.raises(RobotError, match="no such file"):
            resolve_uri(uri, start)


def test_an_unknown_package_is_reported(home: Path) -> None:
    with pytest.raises(RobotError, match="there is no package 'hollo'; packages found: holo;"):
        (home / "holo").mkdir()
        (home / "holo" / "package.xml").write_text("<package><name>holo</name></package>")
        resolve_uri("package://hollo/meshes/base.dae", home / "alone.urdf")


def test_nothing_is_fetched_from_elsewhere(start: Path) -> None:
    for uri in ["http://example.org/base.dae", "data://x", "https://x/meshes/base.dae"]:
        with pytest.raises(RobotError, match="is not fetched; write package://"):
            resolve_uri(uri, start)


def test_a_package_uri_has_to_name_its_package(start: Path) -> None:
    with pytest.raises(RobotError, match="'' is not a package name"):
        resolve_uri("package:///meshes/base.dae", start)


@pytest.mark.parametrize("variable", MODEL_PATHS)
def test_a_model_is_found_in_the_folders_that_gazebo_is_reported(
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


def test_what_was_taken_for_another_file_is_reported(start: Path, home: Path) -> None:
    message: list[str] = []
    found = resolve_uri("/home/asha/wheel.stl", start, warn=message.append)
    write = "package://wheels/meshes/wheel.stl"
    assert message == [
        f"there is no file '/home/asha/wheel.stl'; {found}, which has the same name, is used; "
        f"write {write}"
    ]
    resolve_uri(str(found), start, warn=message.append)
    assert len(message) == 1


def confined(uri: str, start: Path, given: Path) -> Path | None:
    """What a text that came over the wire finds when the package `holo` is given."""
    try:
        return resolve_uri(uri, start, {"holo": given}, confined=True)
    except RobotError as error:
        message = (
            "send the mesh itself (holozen spawn does)",
            "the sim does not know the package",
            "is not a package name",
        )
        assert any(words in str(error) for words in message)
        return None


def test_a_confined_text_finds_files_of_known_packages(start: Path, home: Path) -> None:
    mesh = home / "holo" / "meshes" / "base.dae"
    for uri in (
        "package://holo/meshes/base.dae",
        "model://holo/meshes/base.dae",
        str(mesh),
        f"file://{mesh}",
    ):
        assert confined(uri, start, home / "holo") == mesh


@pytest.mark.parametrize("variable", ["ROS_PACKAGE_PATH", "GZ_SIM_RESOURCE_PATH"])
def test_a_confined_text_finds_files_of_the_environment_s_packages(
    start: Path, home: Path, variable: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(variable, str(home))
    assert (
        resolve_uri("package://wheels/meshes/wheel.stl", start, confined=True).name == "wheel.stl"
    )


def test_a_confined_text_finds_the_meshes_that_holozen_has(start: Path) -> None:
    mesh = find("meshes", "wheel.stl")
    assert resolve_uri(f"file://{mesh}", start, confined=True) == mesh


def test_a_confined_text_finds_nothing_else(start: Path, home: Path) -> None:
    (home / "holo" / "meshes" / "out.stl").symlink_to(home / "wheels" / "meshes" / "wheel.stl")
    for uri in [
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
    ]:
        assert confined(uri, start, home / "holo") is None


def test_a_relative_path_means_nothing_to_a_confined_text(start: Path, home: Path) -> None:
    with pytest.raises(
        RobotError, match="is a relative path, which cannot be resolved here; send the mesh itself"
    ):
        resolve_uri(
            f"{home}/holo/meshes/base.dae"[1:], start, {"holo": home / "holo"}, confined=True
        )


def test_a_package_beside_another_with_a_longer_name_is_outside_of_it(
    start: Path, home: Path
) -> None:
    (home / "holo2").mkdir()
    (home / "holo2" / "a.stl").touch()
    assert confined(f"{home}/holo2/a.stl", start, home / "holo") is None


def test_the_whole_disk_is_no_known_folder(start: Path) -> None:
    assert confined("/etc/passwd", start, Path("/")) is None


def test_a_package_that_the_sim_does_not_know_is_reported_with_what_to_do(home: Path) -> None:
    with pytest.raises(RobotError) as error:
        resolve_uri("package://holo/meshes/base.dae", home / "robot.urdf", confined=True)
    assert str(error.value) == (
        "'package://holo/meshes/base.dae': the sim does not know the package 'holo'; start it "
        "with --package holo=DIR,"
        " or use `holozen spawn FILE`, which sends meshes along"
    )
