"""Parameter: a name with a typed value, and the parameters of a node with their descriptors,
callbacks and services.
"""

import array
import threading
from collections.abc import Callable, Iterable, Sequence
from copy import deepcopy
from enum import Enum
from functools import partial
from typing import Any

from holozen import parameter_yaml
from holozen.ros.generated import find
from holozen.ros.rclpy.exceptions import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
)
from holozen.ros.rclpy.names import join, key, text_of
from holozen.ros.rclpy.qos import qos_profile_parameters
from holozen.ros.rclpy.service import Refusal
from holozen.suggest import article, shorten
from holozen.transport.parameters import ELSE, MAX_NAMES, unknown

__all__ = [
    "PARAMETER_SEPARATOR_STRING",
    "Parameter",
    "get_parameter_value",
    "parameter_dict_from_yaml_file",
    "parameter_value_to_python",
]

PARAMETER_SEPARATOR_STRING = "."


class Parameter:
    """A parameter. Its type is that of its value unless it is given.

    Raises TypeError for a value that no parameter can have, ValueError for a value of another type
    than `type_`.
    """

    class Type(Enum):
        """The types, numbered as in rcl_interfaces/msg/ParameterType."""

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
            """The type of a value. Raises TypeError for one that no parameter can have."""
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
                f"{shorten(repr(parameter_value))} cannot be the value of a parameter: use a "
                "bool, int, float or str, "
                "or a list of one of them"
            )

        def check(self, parameter_value: object) -> bool:
            """Whether a value is of this type."""
            if self == Parameter.Type.NOT_SET:
                return parameter_value is None
            # An empty list fits any array type.
            if isinstance(parameter_value, list | tuple | array.array) and not parameter_value:
                return self.name.endswith("ARRAY")
            return Parameter.Type.from_parameter_value(parameter_value) == self

    def __init__(self, name: str, type_: "Parameter.Type | None" = None, value: Any = None) -> None:
        text_of(name, "the name of a parameter")
        value = _plain(value)
        if type_ is None:
            type_ = Parameter.Type.from_parameter_value(value)
        if not isinstance(type_, Parameter.Type):
            raise TypeError(
                f"parameter {name!r}: type_ must be a Parameter.Type, not "
                f"{article(type(type_).__name__)}"
            )
        if not type_.check(value):
            got = Parameter.Type.from_parameter_value(value)
            raise ValueError(
                f"parameter {name!r}: {shorten(repr(value))} is {got.name}, but its type is "
                f"{type_.name}"
            )
        self._name, self._type_, self._value = name, type_, value

    @classmethod
    def from_parameter_msg(cls, param_msg: Any) -> "Parameter":
        """From a rcl_interfaces.msg.Parameter."""
        value = parameter_value_to_python(param_msg.value)
        return cls(param_msg.name, cls.Type(param_msg.value.type), value)

    @property
    def name(self) -> str:
        """Its name; dots separate the parts."""
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
        made = find("rcl_interfaces/msg/ParameterValue")(type=self._type_.value)
        if self._type_ != Parameter.Type.NOT_SET:
            setattr(made, f"{self._type_.name.lower()}_value", self._value)
        return made

    def to_parameter_msg(self) -> Any:
        """As a rcl_interfaces.msg.Parameter."""
        return find("rcl_interfaces/msg/Parameter")(
            name=self._name, value=self.get_parameter_value()
        )

    def __repr__(self) -> str:
        return f"Parameter(name={self._name!r}, type_={self._type_.name}, value={self._value!r})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Parameter):
            return NotImplemented
        return (self._name, self._type_, self._value) == (other._name, other._type_, other._value)

    def __hash__(self) -> int:
        return hash((self._name, self._type_))


SCALARS: dict[type, str] = {bool: "BOOL", int: "INTEGER", float: "DOUBLE", str: "STRING"}
LISTS: dict[type, str] = {bytes: "BYTE_ARRAY"} | {
    kind: f"{name}_ARRAY" for kind, name in SCALARS.items()
}


def get_parameter_value(string_value: str) -> Any:
    """The rcl_interfaces.msg.ParameterValue of a word, or a list, in YAML; what is not YAML is a
    string.
    """
    try:
        return Parameter("value", value=parameter_yaml.parse(string_value)).get_parameter_value()
    except (TypeError, ValueError):
        return Parameter("value", Parameter.Type.STRING, string_value).get_parameter_value()


def parameter_value_to_python(parameter_value: Any) -> Any:
    """The value in a rcl_interfaces.msg.ParameterValue; None if not set. Raises RuntimeError for an
    unknown type.
    """
    try:
        kind = Parameter.Type(parameter_value.type)
    except ValueError:
        raise RuntimeError(
            f"{parameter_value.type} is not a parameter type; they go from 0 to 9"
        ) from None
    if kind == Parameter.Type.NOT_SET:
        return None
    value = getattr(parameter_value, f"{kind.name.lower()}_value")
    if kind == Parameter.Type.BYTE_ARRAY:
        return [each if isinstance(each, bytes) else bytes([each]) for each in value]
    return list(value) if kind.name.endswith("ARRAY") else value


def parameter_dict_from_yaml_file(
    parameter_file_path: str,
    use_wildcard: bool = False,
    target_nodes: Sequence[str] | None = None,
    namespace: str = "",
) -> dict[str, Any]:
    """The rcl_interfaces.msg.Parameter of each name in a file, for all its nodes or for some.

    Raises RuntimeError if the file cannot be read, or has no section for them.
    """
    try:
        sections = parameter_yaml.read(parameter_file_path)
    except ValueError as error:
        raise RuntimeError(str(error)) from None
    wanted = [section for section in sections if use_wildcard or "*" not in section.place]
    if target_nodes:
        nodes = ["/" + node.strip("/") for node in target_nodes]
        wanted = [section for section in wanted if any(section.is_for(node) for node in nodes)]
    if not wanted:
        existing = ", ".join(section.place for section in sections) or "none"
        targets = ", ".join(target_nodes or ["a node"])
        raise RuntimeError(f"{parameter_file_path}: no section for {targets}; sections: {existing}")
    prefix = f"{namespace}." if namespace else ""
    values = {prefix + name: value for section in wanted for name, value in section.values.items()}
    return {name: Parameter(name, value=value).to_parameter_msg() for name, value in values.items()}


def _plain(value: Any) -> Any:
    """A number or array of numpy, a tuple, an array or bytes as a plain Python value."""
    if hasattr(value, "tolist") and not isinstance(value, list):
        value = value.tolist()
    if isinstance(value, bytes | bytearray):
        return [bytes([each]) for each in value]
    return list(value) if isinstance(value, tuple) else value


def _is_a(value: object, kind: type) -> bool:
    return isinstance(value, kind) and (kind is bool or not isinstance(value, bool))


TOLERANCE = 1e-9  # of the steps of a range: decimal fractions are not exact in binary


def _wrong_type(parameter: Parameter, descriptor: Any) -> str:
    """Why the type does not fit the descriptor; empty if it does."""
    if descriptor.dynamic_typing:
        return ""
    wanted, got = Parameter.Type(descriptor.type), parameter.type_
    if got == wanted or (got != Parameter.Type.NOT_SET and wanted.check(parameter.value)):
        return ""
    if got == Parameter.Type.NOT_SET:
        return f"{parameter.name} takes {wanted.name}, and cannot be without a value"
    hint = (
        f"; write {parameter.value}.0" if (got.name, wanted.name) == ("INTEGER", "DOUBLE") else ""
    )
    return f"{parameter.name} takes {wanted.name}, and {parameter.value!r} is {got.name}{hint}"


def _out_of_range(parameter: Parameter, descriptor: Any) -> str:
    """The range of the descriptor, if the value is outside; empty if it is inside, or if there is
    no range.
    """
    value = parameter.value
    if parameter.type_ == Parameter.Type.INTEGER and descriptor.integer_range:
        limits = descriptor.integer_range[0]
    elif parameter.type_ == Parameter.Type.DOUBLE and descriptor.floating_point_range:
        limits = descriptor.floating_point_range[0]
    else:
        return ""
    low, high, step = limits.from_value, limits.to_value, limits.step
    within = f"use a number from {low} to {high}"
    if not low <= value <= high:
        return within
    if step and value not in (low, high):
        steps = (value - low) / step
        if abs(steps - round(steps)) > TOLERANCE * max(1.0, abs(steps)):
            return f"{within} in steps of {step}"
    return ""


Callback = Callable[[list[Parameter]], Any]


class ParameterStore:
    """The parameters of one node. `overrides` are values that replace the declared defaults."""

    def __init__(self, overrides: dict[str, Parameter], allow_undeclared: bool) -> None:
        self.overrides, self.allow_undeclared = overrides, allow_undeclared
        self.values: dict[str, Parameter] = {}
        self.descriptors: dict[str, Any] = {}
        # The newest callback is called first.
        self.pre: list[Callback] = []
        self.on: list[Callback] = []
        self.post: list[Callback] = []
        self.lock = threading.RLock()

    def declare(self, name: str, value: Any, descriptor: Any, ignore_override: bool) -> Parameter:
        """Add a parameter: `value` is its default, or its Parameter.Type. Raises as
        `Node.declare_parameter`.
        """
        descriptor = deepcopy(descriptor)
        descriptor.name = name
        kind = value if isinstance(value, Parameter.Type) else Parameter(name, value=value).type_
        value = None if isinstance(value, Parameter.Type) else value
        if descriptor.dynamic_typing and value is None and kind != Parameter.Type.NOT_SET:
            raise ValueError(
                f"parameter {name!r}: give its type, or dynamic_typing=True, and not both"
            )
        if not descriptor.dynamic_typing and kind == Parameter.Type.NOT_SET:
            raise ValueError(
                f"parameter {name!r}: give it a default, a Parameter.Type, or dynamic_typing=True"
            )
        descriptor.type = 0 if descriptor.dynamic_typing else kind.value
        given = None if ignore_override else self.overrides.get(name)
        parameter = given or Parameter(name, value=value)
        if parameter.type_ != Parameter.Type.NOT_SET:
            parameter = self._typed(parameter, descriptor)
            if reason := _out_of_range(parameter, descriptor) or self._refusal([parameter]):
                raise InvalidParameterValueException(name, parameter.value, reason)
        self.values[name], self.descriptors[name] = parameter, descriptor
        return parameter

    def check_new(self, names: list[str]) -> None:
        """Raises for names that are invalid, or declared already."""
        for name in names:
            if not text_of(name, "the name of a parameter"):
                raise InvalidParameterException(name)
        if there := [name for name in names if name in self.values]:
            raise ParameterAlreadyDeclaredException(there)

    def check_known(self, names: Iterable[str]) -> None:
        """Raises ParameterNotDeclaredException for undeclared names, unless they are allowed."""
        missing = [name for name in names if name not in self.values]
        if missing and not self.allow_undeclared:
            raise ParameterNotDeclaredException(missing)

    def check_changeable(self, name: str) -> None:
        """Raises ParameterNotDeclaredException, ParameterImmutableException."""
        if name not in self.values:
            raise ParameterNotDeclaredException(name)
        if self.descriptors[name].read_only:
            raise ParameterImmutableException(name)

    def set(self, parameters: list[Parameter]) -> str:
        """Set all or none; the reason of a rejection, empty if all were set. Raises
        ParameterNotDeclaredException.
        """
        with self.lock:
            for callback in list(self.pre):
                parameters = callback(parameters)
                if not isinstance(parameters, list) or not all(
                    isinstance(each, Parameter) for each in parameters
                ):
                    raise TypeError(
                        f"{_name(callback)} returned {parameters!r}; it must return a list of "
                        "Parameter"
                    )
            self.check_known(each.name for each in parameters)
            reason = next(filter(None, map(self.rejection, parameters)), "") or self._refusal(
                parameters
            )
            if reason:
                return reason
            for each in parameters:
                self._keep(each)
            for callback in list(self.post):
                callback(parameters)
        return ""

    def rejection(self, parameter: Parameter) -> str:
        """Why the descriptor does not allow a value; empty if it does."""
        descriptor = self.descriptors.get(parameter.name)
        if descriptor is None:
            return ""
        if descriptor.read_only:
            return f"{parameter.name} is read-only"
        if reason := _out_of_range(parameter, descriptor):
            return f"{parameter.name}: {parameter.value}: {reason}"
        return _wrong_type(parameter, descriptor)

    def describe(self, name: str, descriptor: Any, parameter: Parameter) -> None:
        """Replace the descriptor of a parameter, and its value. Raises as `Node.set_descriptor`."""
        new = deepcopy(descriptor)
        new.name, new.type = name, 0 if new.dynamic_typing else parameter.type_.value
        if reason := _out_of_range(parameter, new):
            raise InvalidParameterValueException(name, parameter.value, reason)
        self.values[name], self.descriptors[name] = parameter, new

    def forget(self, name: str) -> None:
        """Remove a parameter."""
        del self.values[name], self.descriptors[name]

    def _keep(self, parameter: Parameter) -> None:
        name = parameter.name
        if parameter.type_ == Parameter.Type.NOT_SET:
            if name in self.values:
                self.forget(name)
            return
        if name not in self.descriptors:
            self.descriptors[name] = empty_descriptor(name, dynamic_typing=True)
        self.values[name] = self._typed(parameter, self.descriptors[name])

    def _typed(self, parameter: Parameter, descriptor: Any) -> Parameter:
        """The parameter in its declared type. Raises InvalidParameterTypeException."""
        kind = Parameter.Type(descriptor.type)
        if descriptor.dynamic_typing or parameter.type_ == kind:
            return parameter
        if not kind.check(parameter.value):
            raise InvalidParameterTypeException(parameter, kind.name)
        return Parameter(parameter.name, kind, parameter.value)  # an empty list fits any array type

    def _refusal(self, parameters: list[Parameter]) -> str:
        """The reason of the first callback that rejects; empty if none does."""
        for callback in list(self.on):
            result = callback(parameters)
            if not isinstance(getattr(result, "successful", None), bool):
                raise TypeError(
                    f"{_name(callback)} returned {result!r}; return a "
                    "SetParametersResult(successful=True)"
                )
            if not result.successful:
                return result.reason or f"{_name(callback)} rejected it without a reason"
        return ""


def empty_descriptor(name: str, dynamic_typing: bool = False) -> Any:
    """A rcl_interfaces.msg.ParameterDescriptor without limits."""
    return find("rcl_interfaces/msg/ParameterDescriptor")(name=name, dynamic_typing=dynamic_typing)


def _name(callback: Callback) -> str:
    return getattr(callback, "__qualname__", repr(callback))


def set_result(reason: str) -> Any:
    """The SetParametersResult of a rejection with that reason, or of a success if it is empty."""
    return find("rcl_interfaces/msg/SetParametersResult")(successful=not reason, reason=reason)


class ParameterServices:
    """A node's parameter services, under ROS's names: `<node>/get_parameters` and so on. Answered
    while it is spun.
    """

    def __init__(self, node: Any, full_name: str, store: ParameterStore) -> None:
        self._node, self._key, self._store = node, key(full_name), store
        answers = {
            "describe_parameters": self._describe,
            "get_parameter_types": self._types,
            "get_parameters": self._get,
            "set_parameters": self._set,
            "set_parameters_atomically": self._set_atomically,
            # Last: once it is in the graph the others are as well.
            "list_parameters": self._list,
        }
        for name, answer in answers.items():
            kind = find(f"rcl_interfaces/srv/{name.title().replace('_', '')}")
            callback = partial(self._checked, answer)
            node.create_service(
                kind, join(full_name, name), callback, qos_profile=qos_profile_parameters
            )

    def _checked(self, answer: Callable[[Any, Any], None], request: Any, response: Any) -> Any:
        """Refuse requests with too many parameters or with unknown ones, and let `answer` fill in
        the response.
        """
        requested: list[Any] = getattr(request, "names", None) or getattr(request, "parameters", [])
        if len(requested) > MAX_NAMES:
            raise Refusal(f"{len(requested)} parameters in one request; at most {MAX_NAMES}")
        for name in getattr(request, "names", ()):
            if reason := self._unknown(name):
                raise Refusal(reason)
        answer(request, response)
        return response

    def _unknown(self, name: str) -> str:
        """The reason to refuse a parameter that the node neither has nor allows; empty for any
        other.
        """
        is_allowed = name in self._store.values or self._store.allow_undeclared
        return "" if is_allowed else unknown(self._key, name, self._store.values)

    def _describe(self, request: Any, response: Any) -> None:
        response.descriptors = self._node.describe_parameters(request.names)

    def _types(self, request: Any, response: Any) -> None:
        response.types = [kind.value for kind in self._node.get_parameter_types(request.names)]

    def _get(self, request: Any, response: Any) -> None:
        """A parameter without a value has the type NOT_SET."""
        values = self._store.values
        response.values = [
            (values.get(name) or Parameter(name)).get_parameter_value() for name in request.names
        ]

    def _list(self, request: Any, response: Any) -> None:
        response.result = self._node.list_parameters(request.prefixes, request.depth)

    def _set(self, request: Any, response: Any) -> None:
        """Set all or none, as every holozen node does."""
        reasons = self._rejections(request.parameters)
        if not any(reasons):
            reason = self._store.set(
                [Parameter.from_parameter_msg(each) for each in request.parameters]
            )
            reasons = [reason, *[reason and ELSE] * len(reasons[1:])] if reasons else []
        elif len(reasons) > 1:
            reasons = [reason or ELSE for reason in reasons]
        response.results = [set_result(reason) for reason in reasons]

    def _set_atomically(self, request: Any, response: Any) -> None:
        reason = next(filter(None, self._rejections(request.parameters)), "")
        response.result = set_result(
            reason
            or self._store.set([Parameter.from_parameter_msg(each) for each in request.parameters])
        )

    def _rejections(self, requested: Any) -> list[str]:
        """Rejections found before user callbacks run, one for each parameter; empty for those that
        may be set.
        """
        reasons, seen = [], set()
        for each in requested:
            reason = (
                f"{each.name!r} is set twice in one request"
                if each.name in seen
                else self._unknown(each.name)
            )
            seen.add(each.name)
            try:
                reason = reason or self._store.rejection(Parameter.from_parameter_msg(each))
            except (TypeError, ValueError, RuntimeError) as error:
                reason = str(error)
            reasons.append(reason)
        return reasons
