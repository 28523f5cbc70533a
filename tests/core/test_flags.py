"""Values of flags are checked, and refused in one line that names what is allowed."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from holozen import flags


def refusal(parse: Callable[[str], Any], text: str) -> str:
    with pytest.raises(argparse.ArgumentTypeError) as error:
        parse(text)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(("text", "value"), [("0.5", 0.5), ("1e0", 1.0), ("-1", -1.0), ("2", 2.0)])
def test_a_number_within_its_range_is_taken(text: str, value: float) -> None:
    assert flags.number(-1, 2)(text) == value


def test_any_other_number_is_refused_with_its_range_and_unit() -> None:
    for text in ["", "fast", "nan", "inf", "-inf", "2.1", "-1.1", "1,5", "\n"]:
        assert (
            refusal(flags.number(-1, 2, "m/s"), text) == f"{text!r}: use a number from -1 to 2 m/s"
        )


def test_a_count_is_a_whole_number() -> None:
    assert flags.count()("0") == 0
    assert flags.count(2)("12") == 12
    for text in ("1", "-3", "2.0", "", "two", "²"):
        assert refusal(flags.count(2), text) == f"{text!r}: use a whole number from 2 up"
    assert flags.port("65535") == 65535
    assert refusal(flags.port, "65536") == "'65536': use a whole number from 0 to 65535"


def test_a_key_loses_the_slash_that_ros_puts_first() -> None:
    assert flags.key("/cmd_vel") == "cmd_vel"
    assert flags.key("Fred/odom") == "Fred/odom"
    assert "70000 characters; a key has at most 1000" in refusal(flags.key, 70_000 * "a")


def test_a_robot_has_a_legal_name_or_none() -> None:
    assert flags.robot("") == ""
    assert flags.robot("Fred") == "Fred"
    assert "'*'" in refusal(flags.robot, "*")


def test_a_package_is_a_name_and_a_folder(tmp_path: Path) -> None:
    assert flags.package(f"holo={tmp_path}") == ("holo", tmp_path)
    assert flags.package("holo=~")[1] == Path.home()
    assert "there is no folder" in refusal(flags.package, f"holo={tmp_path / 'none'}")
    for text in ("holo", "=x", "holo=", ""):
        assert "write NAME=DIR" in refusal(flags.package, text)


def test_a_robot_file_may_bring_a_name(tmp_path: Path) -> None:
    odd = tmp_path / "a=b.urdf"
    odd.touch()
    assert flags.robot_file("my.urdf") == (Path("my.urdf"), "")
    assert flags.robot_file("my.urdf=Fred") == (Path("my.urdf"), "Fred")
    assert flags.robot_file(str(odd)) == (odd, "")
    assert flags.robot_file(f"{odd}=Fred") == (odd, "Fred")
    assert "'a/b'" in refusal(flags.robot_file, "my.urdf=a/b")
