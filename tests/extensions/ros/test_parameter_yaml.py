"""Files of parameters, of the form that ROS has."""

import sys
from pathlib import Path

import pytest

from holozen import parameter_yaml
from holozen.ros.rclpy import arguments
from holozen.ros.rclpy.exceptions import RCLInvalidROSArgsError


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "params.yaml"


def given(file: Path, text: str, node: str) -> object:
    file.write_text(text)
    return arguments.parse(["--ros-args", "--params-file", str(file)]).parameters_for(node)


def test_a_section_is_for_the_nodes_its_name_takes(file: Path) -> None:
    for place, nodes in [
        ("/tom", ["/tom"]),
        ("tom", ["/tom"]),
        ("/**", ["/tom", "/lab/tom", "/lab", "/a/b/c"]),
        ("/*", ["/tom", "/lab"]),
        ("/*/tom", ["/lab/tom"]),
        ("/**/tom", ["/tom", "/lab/tom"]),
        ("/lab/**", ["/lab/tom", "/lab"]),
        ("/to*", ["/tom"]),
    ]:
        text = f"'{place}':\n  ros__parameters:\n    x: 1\n"
        all_nodes = ["/tom", "/lab/tom", "/lab", "/a/b/c"]
        found = [node for node in all_nodes if given(file, text, node)]
        assert found == [node for node in all_nodes if node in nodes]


def test_a_node_has_the_last_word_over_wildcards(file: Path) -> None:
    text = """
        tom: {ros__parameters: {x: 1, own: a}}
        /**: {ros__parameters: {x: 2, all: true}}
        lab: {tom: {ros__parameters: {x: 3}}}
    """
    assert given(file, text, "/tom") == {"x": 1, "own": "a", "all": True}
    assert given(file, text, "/lab/tom") == {"x": 3, "all": True}


def test_parameters_are_nested_by_dots(file: Path) -> None:
    text = "tom:\n  ros__parameters:\n    pid: {p: 1.0}\n    pid.i: 2\n    words: [a, b]\n"
    assert given(file, text, "/tom") == {"pid.p": 1.0, "pid.i": 2, "words": ["a", "b"]}


def test_an_empty_file_has_no_findings(file: Path) -> None:
    assert given(file, "", "/tom") == {}
    assert given(file, "tom:\n  ros__parameters:\n", "/tom") == {}


def test_a_wrong_file_is_reported_in_one_line(file: Path) -> None:
    for text, message in [
        ("tom:\n  x: 1\n", "section /tom has a value for 'x' outside of ros__parameters"),
        ("x: 1\n", "the file has a value for 'x' outside of ros__parameters"),
        ("[1, 2]", "it has no names with values"),
        ("tom: {ros__parameters: 5}", "ros__parameters of /tom has no names"),
        ("tom: [", "invalid YAML"),
        ("tom:\n\tx: 1", "start any token (line 2, column 1); write spaces instead of tabs"),
        ("tom: {ros__parameters: {x: [1, a]}}", "line 1: all values of a list must have one type"),
        ("? [a]\n: 1", "a name must be a word"),
        (
            "a: &a [x, x]\n" + "".join(f"b{i}: &b{i} {{x: *a, y: *a}}\n" for i in range(3)),
            "outside of",
        ),
    ]:
        file.write_text(text)
        with pytest.raises(ValueError, match=r"params\.yaml: ") as error:
            parameter_yaml.read(str(file))
        assert message in str(error.value)
        assert "\n" not in str(error.value)


def test_a_few_lines_cannot_stand_for_millions_of_values(file: Path) -> None:
    lines = ["v0: &v0 {a: 1, b: 2}"] + [
        f"v{i}: &v{i} {{a: *v{i - 1}, b: *v{i - 1}}}" for i in range(1, 19)
    ]
    file.write_text("\n".join(lines))
    with pytest.raises(ValueError, match="100000 values"):
        parameter_yaml.read(str(file))


def test_a_file_that_is_no_text_is_reported(file: Path) -> None:
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(RCLInvalidROSArgsError, match="not UTF-8"):
        arguments.parse(["--ros-args", "--params-file", str(file)])
    with pytest.raises(RCLInvalidROSArgsError, match="cannot read"):
        arguments.parse(["--ros-args", "--params-file", str(file.parent)])
    file.write_text("#" * 1_000_001)
    with pytest.raises(RCLInvalidROSArgsError, match="longer than 1000000"):
        arguments.parse(["--ros-args", "--params-file", str(file)])


def test_scalars_need_no_yaml_library_and_lists_report_that_they_do(
    monkeypatch: pytest.MonkeyPatch, file: Path
) -> None:
    monkeypatch.setitem(sys.modules, "yaml", None)
    assert parameter_yaml.assigned("x:=1.5").values == {"x": 1.5}
    assert parameter_yaml.assigned("x:=/dev/ttyUSB0").values == {"x": "/dev/ttyUSB0"}
    with pytest.raises(ValueError, match="pip install pyyaml"):
        parameter_yaml.assigned("x:=[1, 2]")
    file.write_text("tom: {ros__parameters: {x: 1}}")
    with pytest.raises(
        ValueError, match=r"params\.yaml: reading it needs YAML: pip install pyyaml"
    ):
        parameter_yaml.read(str(file))
