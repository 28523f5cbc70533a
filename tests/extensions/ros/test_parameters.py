"""The parameters of a node: declared, read, described and set; each as ROS does, or refused."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy import exceptions as e
from holozen.ros.rclpy.node import Node
from holozen.ros.rclpy.parameter import Parameter, set_result

Type = Parameter.Type
Descriptor = find("rcl_interfaces/msg/ParameterDescriptor")
IntegerRange = find("rcl_interfaces/msg/IntegerRange")
FloatRange = find("rcl_interfaces/msg/FloatingPointRange")


pytestmark = pytest.mark.usefixtures("ros")


class Tom(Node):
    """A node in the namespace /lab, with parameters from the command line."""

    def __init__(self, *words: str, overrides: Sequence[Parameter] = (), **options: Any) -> None:
        super().__init__(
            "tom",
            namespace="/lab",
            cli_args=["--ros-args", *words],
            parameter_overrides=list(overrides),
            start_parameter_services=False,
            **options,
        )

    def set(self, **values: Any) -> list[str]:
        results = self.set_parameters(
            [Parameter(name, value=value) for name, value in values.items()]
        )
        assert all(each.successful != bool(each.reason) for each in results)
        return [each.reason for each in results]

    def values(self, *names: str) -> list[Any]:
        return [each.value for each in self.get_parameters(names)]


def refuse(_parameters: list[Parameter]) -> Any:
    return set_result("not today")


def test_a_default_is_the_value_unless_another_one_was_given() -> None:
    node = Tom("-p", "speed:=0.5", "-p", "speed2:=0.5", "-p", "tom:size:=9")
    assert node.declare_parameter("speed", 1.0).value == 0.5
    assert node.declare_parameter("size", 3).value == 3, "that one was for /tom"
    assert node.declare_parameter("speed2", 1.0, ignore_override=True).value == 1.0
    assert node.values("speed", "size", "use_sim_time") == [0.5, 3, False]


def test_values_of_the_script_go_before_those_of_the_command_line() -> None:
    node = Tom("-p", "speed:=0.5", overrides=[Parameter("speed", value=0.7)])
    assert node.declare_parameter("speed", 1.0).value == 0.7
    with pytest.raises(TypeError, match="list of rclpy"):
        Tom(overrides=[0.7])  # type: ignore[list-item]


def test_one_that_is_given_and_that_no_node_declares_is_reported_once(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    ours, others = (tmp_path / name for name in ("ours.yaml", "others.yaml"))
    ours.write_text(
        "/lab/tom: {ros__parameters: {spede: 1.0, qos_overrides: true}}\n/ann: {ros__parameters: "
        "{speed: 1.0}}"
    )
    others.write_text("tom: {ros__parameters: {speed: 1.0}}")
    files = ("--params-file", str(ours), "--params-file", str(others))
    node, other = Tom("-p", "sped:=0.5", "-p", "size:=9", *files), Tom()
    node.declare_parameter("speed", 1.0)
    other.declare_parameter("size", 3)
    for _ in range(2):
        rclpy.spin_once(node, timeout_sec=0)
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition("]: ")[2] for line in lines] == [
        "parameter 'sped' is given, but not declared (did you mean 'speed'?)",
        "parameter 'spede' is given, but not declared (did you mean 'speed'?)",
        f"{others} has no parameters for /lab/tom; it has some for /tom",
    ]


def test_many_are_declared_with_a_prefix() -> None:
    node = Tom("-p", "pid.i:=2.0")
    made = node.declare_parameters(
        "pid", [("p", 1.0), ("i", 0.0, Descriptor(description="integral")), ("n", Type.STRING)]
    )
    assert [(each.name, each.value) for each in made] == [
        ("pid.p", 1.0),
        ("pid.i", 2.0),
        ("pid.n", None),
    ]
    assert node.describe_parameter("pid.i").description == "integral"
    found = node.get_parameters_by_prefix("pid") if node.set(**{"pid.n": "a"}) == [""] else {}
    assert {name: each.value for name, each in found.items()} == {"p": 1.0, "i": 2.0, "n": "a"}
    assert node.list_parameters(["pid"], 0).names == ["pid.p", "pid.i", "pid.n"]
    assert node.list_parameters([], 1).names == ["use_sim_time"]


def test_a_declared_type_needs_a_value_before_it_is_read() -> None:
    node = Tom("-p", "there:=1")
    node.declare_parameters("", [("there", Type.INTEGER), ("later", Type.INTEGER)])
    assert node.values("there") == [1]
    with pytest.raises(e.ParameterUninitializedException, match="later: it has no value yet"):
        node.get_parameter("later")
    assert node.get_parameter_or("later", Parameter("x", value=5)).value == 5
    assert node.set(later="a") == ["later takes INTEGER, and 'a' is STRING"]
    assert node.set(later=6) == [""]
    assert node.values("later") == [6]


def test_declaring_by_name_alone_is_warned_of() -> None:
    node = Tom("-p", "x:=[1, 2]")
    with pytest.warns(UserWarning, match="'.' accepts any type: give it a default") as message:
        assert node.declare_parameter("x").value == [1, 2]
        node.declare_parameters("", [("y",)])
    assert [each.filename for each in message] == [__file__] * 2
    assert node.set(x="a") == [""]
    assert node.describe_parameter("x").dynamic_typing


def test_what_cannot_be_declared_is_reported() -> None:
    rows: list[tuple[Any, type[Exception], str]] = [
        (("a", 1), e.ParameterAlreadyDeclaredException, "a: declared twice"),
        (("", 1), e.InvalidParameterException, "not a valid parameter name"),
        ((5, 1), TypeError, "must be a str"),
        (
            ("x", None, Descriptor()),
            ValueError,
            "give it a default, a Parameter.Type, or dynamic_typing",
        ),
        (("x", Type.INTEGER, Descriptor(dynamic_typing=True)), ValueError, "and not both"),
        (("x", 1, "what it is"), TypeError, "'what it is' is not a ParameterDescriptor"),
        (("x", {"a": 1}), TypeError, "cannot be the value of a parameter"),
        (
            ("word", 1.0),
            e.InvalidParameterTypeException,
            "'word' takes DOUBLE, and 'fast' is STRING",
        ),
        (
            ("whole", 1.0),
            e.InvalidParameterTypeException,
            "'whole' takes DOUBLE, and 1 is INTEGER; write 1.0",
        ),
        (
            ("whole", 7, Descriptor(integer_range=[IntegerRange(from_value=2, to_value=8)])),
            e.InvalidParameterValueException,
            "'whole' rejects 1: use a number from 2 to 8",
        ),
    ]
    for declare, error, message in rows:
        node = Tom("-p", "word:=fast", "-p", "whole:=1")
        node.declare_parameter("a", 1)
        with pytest.raises(error) as found:
            node.declare_parameter(*declare)
        assert message in str(found.value)
        assert (
            not isinstance(declare[0], str)
            or declare[0] == "a"
            or not node.has_parameter(declare[0])
        )


def test_what_is_no_entry_is_reported() -> None:
    for wrong in ("speed", (), ("a", 1, None, None)):
        with pytest.raises(TypeError, match="does not declare a parameter"):
            Tom().declare_parameters("", [wrong])  # type: ignore[list-item]


def test_an_undeclared_one_is_refused_unless_that_is_allowed() -> None:
    strict, free = Tom(), Tom(allow_undeclared_parameters=True)
    accesses: list[Callable[[Node], Any]] = [
        lambda node: node.get_parameter("x"),
        lambda node: node.set_parameters([Parameter("x", value=1)]),
        lambda node: node.set_parameters_atomically([Parameter("x", value=1)]),
        lambda node: node.describe_parameter("x"),
        lambda node: node.get_parameter_type("x"),
    ]
    for access in accesses:
        with pytest.raises(e.ParameterNotDeclaredException, match="parameter x: not declared"):
            access(strict)
        access(free)
    assert free.values("x", "y") == [1, None]
    assert (free.set(x="a"), free.values("x"), free.get_parameter_type("x")) == (
        [""],
        ["a"],
        Type.STRING,
    )
    assert strict.get_parameter_or("x").value is None
    with pytest.raises(TypeError, match="list of str"):
        strict.get_parameters("x")


def test_all_that_was_given_can_be_declared_by_itself() -> None:
    node = Tom(
        "-p",
        "a:=1",
        "-p",
        "b.c:=x",
        "-p",
        "use_sim_time:=true",
        automatically_declare_parameters_from_overrides=True,
    )
    assert node.values("a", "b.c", "use_sim_time") == [1, "x", True]


def test_each_is_set_by_itself_or_all_or_none() -> None:
    node = Tom()
    node.declare_parameters(
        "", [("a", 1), ("b", 1.0), ("c", 1, Descriptor(read_only=True)), ("d", [1.0])]
    )
    assert node.set(a=2, b=3, c=4, d=[]) == [
        "",
        "b takes DOUBLE, and 3 is INTEGER; write 3.0",
        "c is read-only",
        "",
    ]
    assert node.values("a", "b", "c", "d") == [2, 1.0, 1, []]
    assert node.get_parameter_type("d") == Type.DOUBLE_ARRAY
    outcome = node.set_parameters_atomically([Parameter("a", value=5), Parameter("b", value="x")])
    assert (outcome.successful, outcome.reason) == (False, "b takes DOUBLE, and 'x' is STRING")
    assert node.values("a") == [2]
    assert node.set_parameters_atomically(
        [Parameter("a", value=5), Parameter("b", value=0.5)]
    ).successful
    assert node.values("a", "b") == [5, 0.5]
    with pytest.raises(TypeError, match=r"use a list of rclpy\.parameter\.Parameter; \('a', 1\)"):
        node.set_parameters([("a", 1)])  # type: ignore[list-item]


def test_a_number_stays_within_its_range_and_on_its_steps() -> None:
    rows = [
        (0.0, ""),
        (1.0, ""),
        (0.3, ""),
        (0.95, "0.95: use a number from 0.0 to 1.0 in steps of 0.1"),
        (1.1, "1.1: use a number from 0.0 to 1.0"),
        (float("nan"), "nan: use a number from 0.0 to 1.0"),
    ]
    for value, reason in rows:
        node = Tom()
        limits = [FloatRange(from_value=0.0, to_value=1.0, step=0.1)]
        node.declare_parameter("x", 0.5, Descriptor(floating_point_range=limits))
        assert node.set(x=value) == [f"x: {reason}" if reason else ""]


def test_callbacks_change_refuse_and_hear_what_is_set() -> None:
    node, heard = Tom(), list[Any]()
    node.declare_parameter("x", 1)

    def double(parameters: list[Parameter]) -> list[Parameter]:
        return [Parameter(each.name, value=each.value * 2) for each in parameters]

    def check(parameters: list[Parameter]) -> Any:
        heard.append(("on", parameters[0].value, node.values("x")))
        return set_result("" if parameters[0].value < 10 else "too many")

    def message(parameters: list[Parameter]) -> None:
        heard.append(("post", parameters[0].value, node.values("x")))

    node.add_pre_set_parameters_callback(double)
    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(message)
    assert (node.set(x=2), node.set(x=7)) == ([""], ["too many"])
    assert heard == [("on", 4, [1]), ("post", 4, [4]), ("on", 14, [4])]
    node.remove_pre_set_parameters_callback(double)
    node.remove_on_set_parameters_callback(check)
    node.remove_post_set_parameters_callback(message)
    assert (node.set(x=70), node.values("x"), len(heard)) == ([""], [70], 3)
    with pytest.raises(ValueError, match="not in list"):
        node.remove_on_set_parameters_callback(check)


def test_others_read_while_a_callback_is_asked() -> None:
    node, seen = Tom(), list[Any]()
    node.declare_parameter("x", 1)

    def check(_parameters: list[Parameter]) -> Any:
        reader = threading.Thread(target=lambda: seen.extend(node.values("x")), daemon=True)
        reader.start()
        reader.join(10)
        return set_result("")

    node.add_on_set_parameters_callback(check)
    assert node.set(x=2) == [""]
    assert seen == [1]


def test_a_callback_refuses_a_declaration_too() -> None:
    node = Tom()
    node.add_on_set_parameters_callback(refuse)
    with pytest.raises(e.InvalidParameterValueException, match="'x' rejects 1: not today"):
        node.declare_parameter("x", 1)
    assert not node.has_parameter("x")


def test_a_callback_that_returns_nothing_is_reported() -> None:
    node = Tom(allow_undeclared_parameters=True)
    node.add_on_set_parameters_callback(lambda _parameters: None)
    with pytest.raises(
        TypeError, match=r"<lambda> returned None; return a SetParametersResult\(successful=True\)"
    ):
        node.set(x=1)
    node.add_pre_set_parameters_callback(lambda _parameters: 5)
    with pytest.raises(TypeError, match="returned 5; it must return a list of Parameter"):
        node.set(x=1)


def test_one_is_undeclared() -> None:
    node = Tom()
    node.declare_parameters(
        "",
        [
            ("x", 1),
            ("fixed", 1, Descriptor(read_only=True)),
            ("any", 1, Descriptor(dynamic_typing=True)),
        ],
    )
    node.undeclare_parameter("x")
    assert not node.has_parameter("x")
    with pytest.raises(e.ParameterNotDeclaredException):
        node.undeclare_parameter("x")
    with pytest.raises(e.ParameterImmutableException, match="fixed: it is read-only"):
        node.undeclare_parameter("fixed")
    assert node.set(any=None) == [""]
    assert not node.has_parameter("any")
    assert node.set(fixed=None) == ["fixed is read-only"]
    assert node.set(use_sim_time=None) == ["use_sim_time takes BOOL, and cannot be without a value"]


def test_what_it_takes_can_be_changed() -> None:
    node = Tom()
    node.declare_parameter("x", 5)
    tight = Descriptor(integer_range=[IntegerRange(from_value=0, to_value=3)], description="new")
    with pytest.raises(
        e.InvalidParameterValueException, match="'x' rejects 5: use a number from 0 to 3"
    ):
        node.set_descriptor("x", tight)
    assert (
        node.set_descriptor("x", tight, Parameter("x", value=2).get_parameter_value()).integer_value
        == 2
    )
    found = node.describe_parameter("x")
    assert (found.name, found.type, found.description, node.values("x")) == ("x", 2, "new", [2])
    node.set_descriptor("x", Descriptor(read_only=True))
    with pytest.raises(e.ParameterImmutableException):
        node.set_descriptor("x", Descriptor())
    with pytest.raises(e.ParameterNotDeclaredException):
        node.set_descriptor("y", Descriptor())
