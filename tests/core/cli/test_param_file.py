"""Parameters as people write them: words, and files as ROS 2 has them."""

import io
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from holozen.cli.param import file_lines as lines
from holozen.cli.param import read_file as read
from holozen.cli.param import typed
from holozen.parameter_yaml import LARGEST
from holozen.transport.errors import BusError

WRITTEN = """
/sim:
  ros__parameters:
    max_linear: 0.5
    Fred:
      command_timeout: 1
/**:
  ros__parameters: {shape: square, max_linear: 3.0}
Bob:
  controller:
    ros__parameters: {gain: 1e-3}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "file.yaml"
    path.write_text(WRITTEN)
    return path


def test_a_word_is_the_value_that_it_looks_like() -> None:
    rows = [
        ("1", 1),
        ("-1", -1),
        ("1.5", 1.5),
        ("1e-3", 0.001),
        (".5", 0.5),
        ("true", True),
        ("False", False),
        ("square", "square"),
        ("nan", "nan"),
        (".inf", ".inf"),
        ("1_000", "1_000"),
        ("", ""),
        ("a: b", "a: b"),
        ("[1, 2]", [1, 2]),
        ("[0.5, 1e3]", [0.5, 1000.0]),
        ("[a, b]", ["a", "b"]),
        ("[1, a]", "[1, a]"),
        ("[1", "[1"),
        ("9" * 20, "9" * 20),
    ]
    for word, value in rows:
        assert (
            typed(word) == pytest.approx(value)
            if isinstance(value, float)
            else typed(word) == value
        )
        assert type(typed(word)) is type(value)


def test_a_file_sets_values_for_a_node_for_all_and_for_namespaces(file: Path) -> None:
    assert read(str(file), "sim") == {
        "max_linear": 0.5,
        "Fred.command_timeout": 1,
        "shape": "square",
    }
    assert read(str(file), "sim", wildcards=False) == {"max_linear": 0.5, "Fred.command_timeout": 1}
    assert read(str(file), "Bob/controller", wildcards=False) == {"gain": 0.001}


def test_a_file_may_come_from_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO('{"sim": {"ros__parameters": {"max_linear": 2}}}'))
    assert read("-", "sim") == {"max_linear": 2}


def test_a_missing_file_is_one_error_line(tmp_path: Path) -> None:
    for text, reason in [
        ("", "it has no section for the node 'sim'; sections: none with ros__parameters"),
        ("5", "it has no names with values"),
        ("a: [", "invalid YAML: "),
        ("{}", "it has no section for the node 'sim'; sections: none with ros__parameters"),
        (
            "/other: {ros__parameters: {a: 1}}",
            "it has no section for the node 'sim'; sections: /other",
        ),
        (
            "sim: {max_linear: 1}",
            "section /sim has a value for 'max_linear' outside of ros__parameters",
        ),
        ("sim: {ros__parameters: 1}", "ros__parameters of /sim has no names with values"),
        ("sim: {ros__parameters: {}}", "it has no parameter for the node 'sim'"),
        (
            "sim: {ros__parameters: {a: [1, b]}}",
            "line 1: all values of a list must have one type, not int, str",
        ),
        ("sim: {ros__parameters: {a: [[1]]}}", "line 1: a parameter cannot be a list of lists"),
        ("sim: {ros__parameters: {a: .inf}}", "a is inf; write a finite number"),
        ("sim: {ros__parameters: {a: [1.0, .nan]}}", "a is [1.0, nan]; write a finite number"),
        ("[\n" * 50_000, "it is nested too deeply"),
        ("x" * (LARGEST + 1), f"it is longer than {LARGEST} characters"),
    ]:
        path = tmp_path / "wrong.yaml"
        path.write_text(text)
        with pytest.raises(BusError) as error:
            read(str(path), "sim")
        assert str(error.value).startswith(f"{path}: {reason}")
        assert "\n" not in str(error.value)


def test_an_unreadable_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(BusError, match="No such file"):
        read(str(tmp_path / "none.yaml"), "sim")
    (tmp_path / "bytes").write_bytes(b"\xff\xfe")
    with pytest.raises(BusError, match="not UTF-8"):
        read(str(tmp_path / "bytes"), "sim")


NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9_-]{0,6}(\.[a-z]+)?", fullmatch=True)
KINDS = (
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(),
)
VALUES = st.one_of(*KINDS, *(st.lists(kind, max_size=3) for kind in KINDS))


@given(st.dictionaries(NAMES, VALUES, max_size=5))
def test_any_values_survive_a_dump_also_for_other_readers_of_yaml(values: dict[str, Any]) -> None:
    text = "\n".join(lines("sim", values))
    assert yaml.safe_load(text) == {"/sim": {"ros__parameters": values}}
