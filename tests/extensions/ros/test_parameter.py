"""Parameter: its types, and the messages that carry it."""

import array
from pathlib import Path

import numpy as np
import pytest

from holozen.ros.generated import find
from holozen.ros.rclpy.parameter import (
    Parameter,
    get_parameter_value,
    parameter_dict_from_yaml_file,
    parameter_value_to_python,
)

Type = Parameter.Type

VALUES = [
    (None, Type.NOT_SET),
    (True, Type.BOOL),
    (7, Type.INTEGER),
    (1.5, Type.DOUBLE),
    ("a", Type.STRING),
    ([b"a", b"\xff"], Type.BYTE_ARRAY),
    ([True, False], Type.BOOL_ARRAY),
    ([1, 2], Type.INTEGER_ARRAY),
    ([1.5], Type.DOUBLE_ARRAY),
    (["a", "b"], Type.STRING_ARRAY),
]


def test_the_type_is_that_of_the_value() -> None:
    for value, kind in VALUES:
        parameter = Parameter("x", value=value)
        assert (parameter.name, parameter.type_, parameter.value) == ("x", kind, value)
        assert Parameter("x", kind, value) == parameter
        assert kind.check(value)
        assert kind.value == getattr(
            find("rcl_interfaces/msg/ParameterType"), f"PARAMETER_{kind.name}"
        )


def test_it_goes_through_a_message() -> None:
    for value, kind in VALUES:
        parameter = Parameter("x", value=value)
        message = parameter.to_parameter_msg()
        assert (type(message), message.name, message.value.type) == (
            find("rcl_interfaces/msg/Parameter"),
            "x",
            kind.value,
        )
        assert Parameter.from_parameter_msg(message) == parameter
        assert parameter_value_to_python(parameter.get_parameter_value()) == value


def test_values_of_other_libraries_are_taken_as_pythons_own() -> None:
    for value, plain in (
        (np.float64(0.5), 0.5),
        (np.int64(3), 3),
        (np.array([1.0, 2.0]), [1.0, 2.0]),
        (array.array("i", [1, 2]), [1, 2]),
        ((1, 2), [1, 2]),
        (b"ab", [b"a", b"b"]),
    ):
        assert Parameter("x", value=value).value == plain
        assert type(Parameter("x", value=value).value) is type(plain)


def test_an_empty_list_is_one_of_any_type() -> None:
    assert Parameter("x", Type.DOUBLE_ARRAY, []).type_ == Type.DOUBLE_ARRAY
    assert not Type.DOUBLE.check([])


def test_what_no_parameter_has_is_a_type_error() -> None:
    for value in [{"a": 1}, [1, 2.5], [[1]], object(), [None], {1}]:
        with pytest.raises(
            TypeError, match="cannot be the value of a parameter: use a bool, int, float or str"
        ):
            Parameter("x", value=value)


def test_type_and_value_must_agree() -> None:
    with pytest.raises(ValueError, match="parameter 'x': 1 is INTEGER, but its type is DOUBLE"):
        Parameter("x", Type.DOUBLE, 1)
    with pytest.raises(ValueError, match="True is BOOL"):
        Parameter("x", Type.INTEGER, True)
    with pytest.raises(TypeError, match=r"type_ must be a Parameter\.Type, not an int"):
        Parameter("x", 3, 1.0)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="must be a str"):
        Parameter(5)  # type: ignore[arg-type]


def test_words_become_values() -> None:
    for word, value in (
        ("1", 1),
        ("[0.5, 2.0]", [0.5, 2.0]),
        ("off", False),
        ("[1", "[1"),
        ("{a: 1}", "{a: 1}"),
    ):
        assert parameter_value_to_python(get_parameter_value(word)) == value
    with pytest.raises(RuntimeError, match="77 is not a parameter type"):
        parameter_value_to_python(find("rcl_interfaces/msg/ParameterValue")(type=77))


def test_a_file_becomes_messages(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("/**: {ros__parameters: {x: 1, y: a}}\n/tom: {ros__parameters: {x: 2.0}}\n")
    found = parameter_dict_from_yaml_file(str(file), use_wildcard=True, target_nodes=["/tom"])
    assert {name: Parameter.from_parameter_msg(each).value for name, each in found.items()} == {
        "x": 2.0,
        "y": "a",
    }
    assert set(parameter_dict_from_yaml_file(str(file), namespace="n")) == {"n.x"}
    with pytest.raises(RuntimeError, match=r"no section for /anna; sections: /\*\*, /tom"):
        parameter_dict_from_yaml_file(str(file), target_nodes=["/anna"])
    with pytest.raises(RuntimeError, match="cannot read"):
        parameter_dict_from_yaml_file(str(tmp_path / "none.yaml"))
