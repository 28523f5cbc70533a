"""Suggestions for misspelt names, and how short they stay."""

from pathlib import Path

import pytest

from holozen.cli import main
from holozen.suggest import article, cut, last_part, listed, suggest


def test_a_hint_names_what_is_there() -> None:
    assert suggest("whel", ["arm", "wheel"]) == " (did you mean 'wheel'?)"
    assert suggest("arm", ["wheel", "left_arm_link"]) == " (did you mean 'left_arm_link'?)"
    assert suggest("odo", ["cmd_vel", "ODOM"]) == " (did you mean 'ODOM'?)"
    assert suggest("jLF", ["jBL", "jFL"]) == " (did you mean 'jFL'?)"
    assert suggest("zzz", ["wheel"]) == suggest("zzz", []) == suggest("", ["wheel"]) == ""


def test_a_package_makes_types_no_more_similar() -> None:
    known = ["geometry_msgs/msg/Twist", "geometry_msgs/msg/Pose"]
    assert suggest("geometry_msgs/msg/Foo", known) != ""
    assert suggest("geometry_msgs/msg/Foo", known, last_part) == ""
    assert (
        suggest("geometry_msgs/msg/Twsit", known, last_part)
        == " (did you mean 'geometry_msgs/msg/Twist'?)"
    )


def test_a_missing_robot_file_gets_the_closest_in_its_folder_or_among_ours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "my_bot.urdf.xacro"
    mine.touch()
    for other in ("my_bto.txt", "my_bot.urdf"):
        (tmp_path / other).touch()
    for name, near in (
        ("my_bto.urdf.xacro", mine),
        ("my_bto.xacro", mine),
        ("my_bto.urdf", tmp_path / "my_bot.urdf"),
        ("hb_bot", "urdf/hb_bot.urdf.xacro"),
    ):
        word = str(tmp_path / name)
        for verb in (["spawn"], ["xacro"], ["sim", "--robot"]):
            assert main([*verb, word]) == 1
            message = "".join(capsys.readouterr())
            assert (
                "No such file or directory (did you mean '" in message and f"{near}'?)" in message
            ), f"{verb}"
        with pytest.raises(SystemExit):
            main(["up", "--robot", word])
        assert f"{near}'?)" in capsys.readouterr().err
    assert main(["xacro", "zzz"]) == 1
    assert capsys.readouterr().err == "holozen xacro: zzz: No such file or directory\n"


def test_messages_stay_short() -> None:
    long = "x" * 300_000
    assert len(suggest(long[:-1] + "y", [long])) < 120
    assert len(cut(long)) < 90
    assert listed(str(n) for n in range(100)).endswith(" and 88 more")
    assert listed([]) == "none"


def test_a_class_has_its_article() -> None:
    names = ("int", "uint8", "Odometry", "Twist")
    assert [article(name) for name in names] == ["an int", "a uint8", "an Odometry", "a Twist"]
