"""ROS's words on a command line."""

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from holozen.ros.rclpy import arguments
from holozen.ros.rclpy.exceptions import RCLInvalidROSArgsError, UnknownROSArgsError
from holozen.ros.rclpy.logging import LoggingSeverity


def parse(*words: str) -> arguments.Arguments:
    return arguments.parse(["script.py", *words])


def test_the_script_keeps_its_own_words() -> None:
    given = [
        "script.py",
        "--fast",
        "--ros-args",
        "-r",
        "a:=b",
        "--",
        "goal",
        "--ros-args",
        "-p",
        "x:=1",
    ]
    assert arguments.parse(given).unparsed == ["script.py", "--fast", "goal"]
    assert arguments.remove_ros_args(given) == ["script.py", "--fast", "goal"]


def test_without_words_those_of_the_process_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["script.py", "x", "--ros-args", "-r", "__node:=tom"])
    found = arguments.parse()
    assert (found.unparsed, found.node_name("n")) == (["script.py", "x"], "tom")


def test_nodes_get_their_names() -> None:
    found = parse("--ros-args", "-r", "talker:__node:=tom", "--remap", "__ns:=/lab")
    assert found.node_name("talker") == "tom"
    assert found.node_name("listener") == "listener"
    assert found.namespace("/", "tom") == "/lab"


def test_the_first_rule_for_a_name_counts_and_is_seen_from_the_node() -> None:
    found = parse("--ros-args", "-r", "tom:chat:=~/talk", "-r", "chat:=/b", "-r", "/ns/odom:=pose")
    assert found.remap("/ns/chat", "tom", "/ns") == "/ns/tom/talk"
    assert found.remap("/ns/chat", "anna", "/ns") == "/b"
    assert found.remap("/chat", "anna", "/ns") == "/chat"
    assert found.remap("/ns/odom", "anna", "/ns") == "/ns/pose"


def test_a_node_has_rules_of_its_own_before_those_of_all() -> None:
    of_all = parse("--ros-args", "-r", "a:=b", "-p", "x:=1", "-p", "y:=1")
    merged = of_all.merged(parse("--ros-args", "-r", "a:=c", "-p", "x:=2"))
    assert merged.remap("/a", "tom", "/") == "/c"
    assert merged.parameters_for("/tom") == {"x": 2, "y": 1}


def test_a_value_has_the_type_that_yaml_gives_it() -> None:
    rows = [
        ("1", 1),
        ("-7", -7),
        ("0x10", 16),
        ("1.0", 1.0),
        ("1e3", 1000.0),
        ("-.5", -0.5),
        (".inf", float("inf")),
        ("true", True),
        ("off", False),
        ("y", True),
        ("square", "square"),
        ("1:30", "1:30"),
        ("2026-11-21",) * 2,
        ("'1'", "1"),
        ('"true"', "true"),
        ("[1, 2]", [1, 2]),
        ("[0.5, 1.0]", [0.5, 1.0]),
        ("[a, 'b c']", ["a", "b c"]),
        ("[true, no]", [True, False]),
        ("[]", []),
        ("", ""),
        ("a b", "a b"),
        ("/dev/ttyUSB0", "/dev/ttyUSB0"),
    ]
    for word, value in rows:
        found = parse("--ros-args", "-p", f"x:={word}").parameters_for("/tom")
        assert found == {"x": value}
        assert type(found["x"]) is type(value)


def test_a_map_is_parameters_with_dots() -> None:
    assert parse("--ros-args", "-p", "pid:={p: 1.0, i: {low: 2}}").parameters_for("/tom") == {
        "pid.p": 1.0,
        "pid.i.low": 2,
    }


def test_a_value_may_be_for_one_node() -> None:
    found = parse("--ros-args", "-p", "x:=1", "-p", "tom:x:=2", "-p", "/ns/anna:x:=3")
    assert [
        found.parameters_for(name)["x"] for name in ("/tom", "/anna", "/ns/anna", "/ns/tom")
    ] == [2, 1, 3, 1]


def test_of_a_file_and_a_word_the_later_counts(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("/**:\n  ros__parameters:\n    x: 5\n")
    assert parse("--ros-args", "-p", "x:=1", "--params-file", str(file)).parameters_for("/tom") == {
        "x": 5
    }
    assert parse("--ros-args", "--params-file", str(file), "-p", "x:=1").parameters_for("/tom") == {
        "x": 1
    }


def test_levels_are_for_all_loggers_or_for_one() -> None:
    found = parse("--ros-args", "--log-level", "warn", "--log-level", "tom:=DEBUG")
    assert found.levels == [("", LoggingSeverity.WARN), ("tom", LoggingSeverity.DEBUG)]


def test_what_ros_takes_and_means_nothing_here_is_taken() -> None:
    found = parse(
        "--ros-args",
        "-e",
        "/x",
        "--log-file-name",
        "a",
        "--disable-rosout-logs",
        "--disable-stdout-logs",
    )
    assert (found.unparsed, found.quiet) == (["script.py"], True)


def test_what_cannot_be_read_is_reported_in_one_line() -> None:
    for words, message in [
        (["-r"], "-r needs a value"),
        (["-r", "--"], "-r needs a value"),
        (["-r", "chat"], "-r chat: write FROM:=TO"),
        (["-r", "a b:=c"], "invalid topic name 'a b'"),
        (["-p", "x"], "NAME:=VALUE"),
        (["-p", ":x:=1"], "NAME:=VALUE"),
        (["-p", "x:=[1, 2.5]"], "write 1.0 for 1"),
        (["-p", "x:=[1, a]"], "all values of a list must have one type, not int, str"),
        (["-p", "x:=[[1]]"], "a parameter cannot be a list of lists"),
        (["-p", "x:=[1"], "invalid YAML"),
        (["-p", "x:=99999999999999999999"], "64-bit"),
        (["-p", "x:=" + "[" * 1000], "nested"),
        (["--params-file", "/nowhere.yaml"], "--params-file: cannot read /nowhere.yaml"),
        (["--log-level", "loud"], "use one of unset, debug, info"),
    ]:
        with pytest.raises(RCLInvalidROSArgsError) as error:
            parse("--ros-args", *words)
        assert message in str(error.value)
        assert "\n" not in str(error.value)


def test_an_unknown_flag_is_reported_with_the_nearest() -> None:
    with pytest.raises(UnknownROSArgsError, match=r"'--params' \(did you mean '--param"):
        parse("--ros-args", "--params", "x")
    with pytest.raises(UnknownROSArgsError, match="end the ROS arguments with --"):
        parse("--ros-args", "goal.txt")
    with pytest.raises(TypeError, match="a list of str"):
        arguments.parse([5])  # type: ignore[list-item]
    with pytest.raises(
        TypeError,
        match=r"^args='-p x:=1' is one text; write a list of words: args=\['-p', 'x:=1'\]$",
    ):
        arguments.parse("-p x:=1")


WORDS = (
    "--ros-args",
    "-r",
    "-p",
    "--",
    "--log-level",
    "a:=b",
    "/a:=~/b",
    "x:=[1,2]",
    "x:={a: 1}",
    "t:__node:=n",
    "a:b:=c",
)


@given(st.lists(st.sampled_from(WORDS) | st.text(max_size=20), max_size=8))
@example(["--ros-args", "-r", "a\nb"])
@example(["--ros-args", "-p", "x:=" + "1" * 5000])
def test_any_words_are_taken_or_refused_in_one_line(words: list[str]) -> None:
    try:
        found = arguments.parse(words)
    except (RCLInvalidROSArgsError, UnknownROSArgsError) as error:
        assert "\n" not in str(error)
    else:
        name = found.node_name("n")
        assert found.namespace("/", name).startswith("/")
        assert found.remap("/x/a", name, "/x").startswith("/")
        assert isinstance(found.parameters_for("/x/n"), dict)
