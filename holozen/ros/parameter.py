"""Parameter: a name with a typed value, and the messages of rcl_interfaces that carry it."""

import array
from collections.abc import Sequence
from enum import Enum
from typing import Any

from holozen.ros import parameter_file, yaml_values

__all__ = [
    "PARAMETER_SEPARATOR_STRING", "Parameter", "get_parameter_value", "parameter_dict_from_yaml_file",
    "parameter_value_to_python",
]  # fmt: skip

PARAMETER_SEPARATOR_STRING = "."


class Parameter:
    """A parameter. Its type is that of its value unless it is given.

    Raises TypeError for a value that no parameter has, ValueError for a value of another type than `type_`.
    """

    class Type(Enum):
        """The types, with the numbers of rcl_interfaces/msg/ParameterType."""

        NOT_SET = 0
        BOOL = 1
        INTEGER = 2
        DOUBLE = 3
        STRING = 4
        BYTE_ARRAY = 5
        BOOL_ARRAY = 6
        INTEGER_ARRAY = 7
        DOUBLE_ARRAY = 8
        STRING_ARRAY = 9

        @classmethod
        def from_parameter_value(cls, parameter_value: object) -> "Parameter.Type":
            """The type of a value. Raises TypeError for one that no parameter has."""
            if parameter_value is None:
                return cls.NOT_SET
            for kind, name in SCALARS.items():
                if isinstance(parameter_value, kind):
                    return cls[name]
            if isinstance(parameter_value, bytes | bytearray):
                return cls.BYTE_ARRAY
            if isinstance(parameter_value, list | tuple | array.array):
                for kind, name in LISTS.items():
                    if all(_is_a(each, kind) for each in parameter_value):
                        return cls[name]
            raise TypeError(
                f"{_short(parameter_value)} is no value of a parameter: use a bool, int, float or str, "
                "or a list of one of them"
            )

        def check(self, parameter_value: object) -> bool:
            """Whether a value is of this type."""
            if self == Parameter.Type.NOT_SET:
                return parameter_value is None
            # An empty list is one of any type.
            if isinstance(parameter_value, list | tuple | array.array) and not parameter_value:
                return self.name.endswith("ARRAY")
            return Parameter.Type.from_parameter_value(parameter_value) == self

    def __init__(self, name: str, type_: "Parameter.Type | None" = None, value: Any = None) -> None:
        if not isinstance(name, str):
            raise TypeError(f"a parameter's name is a str, and {name!r} is a {type(name).__name__}")
        value = _plain(value)
        if type_ is None:
            type_ = Parameter.Type.from_parameter_value(value)
        if not isinstance(type_, Parameter.Type):
            raise TypeError(f"parameter {name!r}: type_ is a Parameter.Type, and {type_!r} is a {type(type_).__name__}")
        if not type_.check(value):
            got = Parameter.Type.from_parameter_value(value)
            raise ValueError(f"parameter {name!r}: {_short(value)} is {got.name}, and its type {type_.name}")
        self._name, self._type_, self._value = name, type_, value

    @classmethod
    def from_parameter_msg(cls, param_msg: Any) -> "Parameter":
        """Of a rcl_interfaces.msg.Parameter."""
        value = parameter_value_to_python(param_msg.value)
        return cls(param_msg.name, cls.Type(param_msg.value.type), value)

    @property
    def name(self) -> str:
        """Its name; parts are divided by dots."""
        return self._name

    @property
    def type_(self) -> "Parameter.Type":
        """Its type."""
        return self._type_

    @property
    def value(self) -> Any:
        """Its value; None if it has none."""
        return self._value

    def get_parameter_value(self) -> Any:
        """The value as a rcl_interfaces.msg.ParameterValue."""
        made = _message("ParameterValue")(type=self._type_.value)
        if self._type_ != Parameter.Type.NOT_SET:
            setattr(made, f"{self._type_.name.lower()}_value", self._value)
        return made

    def to_parameter_msg(self) -> Any:
        """As a rcl_interfaces.msg.Parameter."""
        return _message("Parameter")(name=self._name, value=self.get_parameter_value())

    def __repr__(self) -> str:
        return f"Parameter(name={self._name!r}, type_={self._type_.name}, value={self._value!r})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Parameter):
            return NotImplemented
        return (self._name, self._type_, self._value) == (other._name, other._type_, other._value)

    def __hash__(self) -> int:
        return hash((self._name, self._type_))


SCALARS: dict[type, str] = {bool: "BOOL", int: "INTEGER", float: "DOUBLE", str: "STRING"}
LISTS: dict[type, str] = {
    bytes: "BYTE_ARRAY", bool: "BOOL_ARRAY", int: "INTEGER_ARRAY", float: "DOUBLE_ARRAY", str: "STRING_ARRAY",
}  # fmt: skip


def get_parameter_value(string_value: str) -> Any:
    """The rcl_interfaces.msg.ParameterValue that a word, or a list in YAML, means. What is no YAML is a text."""
    try:
        return Parameter("value", value=yaml_values.value(string_value)).get_parameter_value()
    except (TypeError, ValueError):
        return Parameter("value", Parameter.Type.STRING, string_value).get_parameter_value()


def parameter_value_to_python(parameter_value: Any) -> Any:
    """The value in a rcl_interfaces.msg.ParameterValue; None if there is none. Raises RuntimeError for no type."""
    try:
        kind = Parameter.Type(parameter_value.type)
    except ValueError:
        raise RuntimeError(f"{parameter_value.type} is no type of a parameter; they go from 0 to 9") from None
    if kind == Parameter.Type.NOT_SET:
        return None
    value = getattr(parameter_value, f"{kind.name.lower()}_value")
    if kind == Parameter.Type.BYTE_ARRAY:
        return [each if isinstance(each, bytes) else bytes([each]) for each in value]
    return list(value) if kind.name.endswith("ARRAY") else value


def parameter_dict_from_yaml_file(
    parameter_file_path: str, use_wildcard: bool = False, target_nodes: Sequence[str] | None = None, namespace: str = ""
) -> dict[str, Any]:
    """The rcl_interfaces.msg.Parameter of each name in a file, for all nodes of it or for some.

    Raises RuntimeError for a file that cannot be read, or that has nothing for them.
    """
    try:
        sections = parameter_file.read(parameter_file_path)
    except ValueError as error:
        raise RuntimeError(str(error)) from None
    wanted = [section for section in sections if use_wildcard or "*" not in section.place]
    if target_nodes:
        nodes = ["/" + node.strip("/") for node in target_nodes]
        wanted = [section for section in wanted if any(section.is_for(node) for node in nodes)]
    if not wanted:
        there = ", ".join(section.place for section in sections) or "none"
        whom = ", ".join(target_nodes or ["a node"])
        raise RuntimeError(f"{parameter_file_path}: it has no section for {whom}; sections: {there}")
    prefix = f"{namespace}." if namespace else ""
    values = {prefix + name: value for section in wanted for name, value in section.values.items()}
    return {name: Parameter(name, value=value).to_parameter_msg() for name, value in values.items()}


def _message(name: str) -> Any:
    from holozen.ros.generated import find

    return find(f"rcl_interfaces/msg/{name}")


def _plain(value: Any) -> Any:
    """A value that scripts have, as one of Python's own: numpy's numbers and arrays, tuples, arrays, bytes."""
    if hasattr(value, "tolist") and not isinstance(value, list):
        value = value.tolist()
    if isinstance(value, bytes | bytearray):
        return [bytes([each]) for each in value]
    return list(value) if isinstance(value, tuple) else value


def _is_a(value: object, kind: type) -> bool:
    return isinstance(value, kind) and (kind is bool or not isinstance(value, bool))


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:80]} ..."
