"""`holozen xacro` prints what a file expands to, or one line."""

from pathlib import Path

import pytest

from holozen.cli import main
from holozen.robot.model import parse

FILE = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="name" default="base"/><link name="$(arg name)_${'li' + 'nk'}"/></robot>"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.xacro"
    path.write_text(FILE)
    return path


def test_a_file_is_expanded_to_standard_output(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["xacro", str(file)]) == 0
    model = parse(capsys.readouterr().out, file)
    assert (model.name, model.root) == ("r", "base_link")


def test_arguments_and_an_output_file_are_taken(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = file.with_name("robot.urdf")
    assert main(["xacro", str(file), "name:=Fred", "-o", str(out)]) == 0
    assert capsys.readouterr() == ("", "")
    assert parse(out.read_text(), out).root == "Fred_link"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["no/such.xacro"], "holozen xacro: no/such.xacro: "),
        (["FILE", "name=Fred"], "holozen xacro: 'name=Fred': write name:=value\n"),
        (["FILE", ":=Fred"], "holozen xacro: ':=Fred': write name:=value\n"),
        (
            ["FILE", "-o", "no/such/folder/x"],
            "holozen xacro: [Errno 2] No such file or directory: 'no/such/folder/x'\n",
        ),
    ],
)
def test_what_fails_is_one_line(file: Path, words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["xacro", *(str(file) if word == "FILE" else word for word in words)]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(told)
    assert err.count("\n") == 1
