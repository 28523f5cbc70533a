"""`holozen xacro` prints what a file expands to, or one line."""

import json
from pathlib import Path

import pytest

from holozen.cli import main
from holozen.robot.files.loading import parse

FILE = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="name" default="base"/><link name="$(arg name)_${'li' + 'nk'}"/></robot>"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.xacro"
    path.write_text(FILE)
    return path


def test_a_file_is_expanded_to_standard_output(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["xacro", "--inorder", str(file)]) == 0
    model = parse(capsys.readouterr().out, file)
    assert (model.name, model.root) == ("r", "base_link")


def test_arguments_and_an_output_file_are_taken(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = file.with_name("robot.urdf")
    assert main(["xacro", str(file), "name:=Fred", "-o", str(out)]) == 0
    assert capsys.readouterr() == ("", "")
    assert parse(out.read_text(), out).root == "Fred_link"


def test_as_json_it_is_one_object(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["xacro", str(file), "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert (shown["file"], parse(shown["urdf"], file).root) == (str(file), "base_link")
    out = file.with_name("robot.urdf")
    assert main(["xacro", str(file), "-o", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(file), "output": str(out)}
    assert parse(out.read_text(), out).root == "base_link"


def test_what_fails_is_one_line(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, expected in [
        (["no/such.xacro"], "holozen xacro: no/such.xacro: "),
        (["."], "holozen xacro: .: Is a directory\n"),
        (["FILE", "-o", "."], "holozen xacro: cannot write .: Is a directory\n"),
        (["FILE", "-o", "FILE"], "holozen xacro: -o "),
        (
            ["FILE", "-o", "no/such/folder/x"],
            "holozen xacro: cannot write no/such/folder/x: No such file or directory\n",
        ),
    ]:
        assert main(["xacro", *(str(file) if word == "FILE" else word for word in words)]) == 1
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith(expected)
        assert err.count("\n") == 1


def test_values_may_stand_on_both_sides_of_the_flags(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = file.with_name("robot.urdf")
    assert main(["xacro", str(file), "other:=1", "-o", str(out), " name := Fred "]) == 0
    assert parse(out.read_text(), out).root == "Fred_link"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (
            b"",
            "robot.xacro, line 1: broken XML: the file is empty; `holozen new robot NAME` writes "
            "one to start from",
        ),
        (
            b'<robot name="r"><xacro:property name="x" value="1"/></robot>',
            "robot.xacro, line 1: broken XML: unbound prefix; "
            'add xmlns:xacro="http://www.ros.org/wiki/xacro" to <robot>, '
            "or that of another prefix",
        ),
        (
            b"\x7fELF\xff\x00",
            "robot.xacro, line 1: byte 4 is not UTF-8 text; save the file as UTF-8",
        ),
        (
            b"\x00\x00",
            "robot.xacro, line 1: broken XML: not well-formed (invalid token); "
            'write each element as <name attribute="value"> and close it',
        ),
    ],
)
def test_a_file_of_something_else_is_one_line(
    file: Path, content: bytes, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file.write_bytes(content)
    assert main(["xacro", str(file)]) == 1
    assert capsys.readouterr() == ("", f"holozen xacro: {file.parent}/{expected}\n")


def test_a_plain_urdf_goes_through_the_library_too(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf = file.with_name("robot.urdf")
    urdf.write_text('<robot name="r"><link name="${1+1}"/></robot>')
    assert main(["xacro", str(urdf)]) == 0
    assert '<link name="2"/>' in capsys.readouterr().out


def test_text_that_is_not_ascii_comes_out_as_utf_8(
    file: Path, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    file.write_text('<robot name="é"/>', encoding="utf-8")
    assert main(["xacro", str(file)]) == 0
    assert 'name="é"'.encode() in capsysbinary.readouterr().out
