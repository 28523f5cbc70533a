"""A package is found by what is given, by the environment, by package.xml, and last by its place."""

import os
from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.packages import find_named, find_package, folders_above


def package(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "package.xml").write_text(f"<package><name> {name} </name></package>")
    return folder


def robot_file(package: Path) -> Path:
    (package / "urdf").mkdir(parents=True, exist_ok=True)
    file = package / "urdf" / "hb_bot.urdf.xacro"
    file.write_text("<robot/>")
    return file


def test_a_given_folder_wins_over_everything_else(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    start = robot_file(package(home / "src" / "holo", "holo"))
    given = home / "elsewhere"
    given.mkdir()
    (home / "opt" / "share" / "holo").mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(home / "opt"))
    assert find_package("holo", start, {"holo": given}) == given


def test_a_given_folder_that_does_not_exist_is_told(home: Path) -> None:
    with pytest.raises(RobotError, match=r"--package holo=.*gone: there is no such folder"):
        find_package("holo", robot_file(home), {"holo": home / "gone"})


def test_the_ament_prefix_comes_before_ros_package_path(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    share = home / "opt" / "share" / "holo"
    share.mkdir(parents=True)
    workspace = package(home / "src" / "some_folder", "holo")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{home / 'nowhere'}:{home / 'src'}")
    start = robot_file(home / "mine")
    assert find_package("holo", start) == workspace
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{home / 'nowhere'}:{home / 'opt'}")
    assert find_package("holo", start) == share


def test_ros_package_path_comes_before_the_folders_above(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    start = robot_file(package(home / "mine", "holo"))
    other = package(home / "other", "holo")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(other))
    assert find_package("holo", start) == other


def test_a_package_xml_above_the_file_names_the_package_whatever_its_folder_is_called(home: Path) -> None:
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


def test_without_any_package_xml_the_nearest_folder_with_urdf_in_it_is_the_package(home: Path) -> None:
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


def test_a_relative_start_is_seen_from_the_working_folder(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot_file(package(home / "holo", "holo"))
    monkeypatch.chdir(home / "holo" / "urdf")
    assert find_package("holo", Path("hb_bot.urdf.xacro")) == home / "holo"


@pytest.mark.parametrize("broken", ["<package><name>holo</nam", "", "<package/>", "\x00"])
def test_a_broken_package_xml_names_nothing(home: Path, broken: str) -> None:
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
        f"{start}: there is no package 'hollo'; packages found: from_ros, given, holo, wheels; looked in"
        f" {', '.join(str(home / folder) for folder in searched)}; say where it is: --package hollo=DIR;"
        " did you mean 'holo'?"
    )


def test_of_many_packages_found_the_first_dozen_are_named(home: Path) -> None:
    for i in range(14):
        package(home / f"p{i:02}", f"p{i:02}")
    with pytest.raises(RobotError, match=r"packages found: p00, .*p11 and 2 more; looked in"):
        find_package("hollo", home)


@pytest.mark.parametrize("name", ["", "..", "../../etc", "a/b", "a b", "*", "x" + "\n"])
def test_a_name_that_would_leave_the_folder_is_refused(home: Path, name: str) -> None:
    with pytest.raises(RobotError, match="is no package name"):
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
