"""Warnings are kept up to a number, and a misspelt name is met with the one it is most like."""

from pathlib import Path

from holozen.robot.source import MOST_GUESSES, MOST_WARNINGS, Source
from holozen.robot.tag import Tag


def test_more_warnings_than_anyone_reads_are_cut() -> None:
    source, tag = Source(Path("r.urdf"), {}), Tag("a", {}, "f, line 3")
    for index in range(MOST_WARNINGS + 5):
        source.warn(tag, f"is wrong {index}")
    assert len(source.warnings) == MOST_WARNINGS + 1
    assert source.warnings[0] == "f, line 3: <a> is wrong 0"
    assert source.warnings[-1] == f"f, line 3: there are more than {MOST_WARNINGS} warnings; the rest is not told"


def test_the_nearest_name_is_told_whatever_its_case() -> None:
    source = Source(Path("r.urdf"), {})
    assert source.nearest("chasis", ["wheel", "chassis"]) == "; the nearest is 'chassis'"
    assert source.nearest("WHEEL", ["wheel", "chassis"]) == "; the nearest is 'wheel'"
    assert source.nearest("xyz", ["wheel", "chassis"]) == ""


def test_what_names_have_in_common_makes_them_no_nearer() -> None:
    source, known = Source(Path("r.urdf"), {}), ["gazebo_ros_imu", "gazebo_ros_planar_move"]
    assert source.nearest("gazebo_ros_foo", known) == "; the nearest is 'gazebo_ros_imu'"
    assert source.nearest("gazebo_ros_foo", known, "gazebo_ros_", alike=0.8) == ""
    found = source.nearest("gazebo_ros_planarmove", known, "gazebo_ros_", alike=0.8)
    assert found == "; the nearest is 'gazebo_ros_planar_move'"


def test_guessing_ends_in_a_file_of_nothing_but_mistakes() -> None:
    source = Source(Path("r.urdf"), {})
    told = [source.nearest("whel", ["wheel"]) for _ in range(MOST_GUESSES + 1)]
    assert told == ["; the nearest is 'wheel'"] * MOST_GUESSES + [""]
