"""The parameters that a node declared: their values, what they take, and who is asked and told when they are set."""

import threading
from collections.abc import Callable, Iterable
from copy import deepcopy
from typing import Any

from holozen.ros import parameter_rules
from holozen.ros.exceptions import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterNotDeclaredException,
)
from holozen.ros.parameter import Parameter

Callback = Callable[[list[Parameter]], Any]


class Store:
    """The parameters of one node. `overrides` are the values that are taken instead of the declared defaults."""

    def __init__(self, overrides: dict[str, Parameter], allow_undeclared: bool) -> None:
        self.overrides, self.allow_undeclared = overrides, allow_undeclared
        self.values: dict[str, Parameter] = {}
        self.descriptors: dict[str, Any] = {}
        # The newest is asked first.
        self.pre: list[Callback] = []
        self.on: list[Callback] = []
        self.post: list[Callback] = []
        self.lock = threading.RLock()

    def declare(self, name: str, value: Any, descriptor: Any, ignore_override: bool) -> Parameter:
        """Add a parameter: `value` is its default, or its Parameter.Type. Raises what `declare_parameter` does."""
        descriptor = deepcopy(descriptor)
        descriptor.name = name
        kind = value if isinstance(value, Parameter.Type) else Parameter(name, value=value).type_
        value = None if isinstance(value, Parameter.Type) else value
        if descriptor.dynamic_typing and value is None and kind != Parameter.Type.NOT_SET:
            raise ValueError(f"parameter {name!r}: give its type, or dynamic_typing=True, and not both")
        if not descriptor.dynamic_typing and kind == Parameter.Type.NOT_SET:
            raise ValueError(f"parameter {name!r}: give it a default, a Parameter.Type, or dynamic_typing=True")
        descriptor.type = 0 if descriptor.dynamic_typing else kind.value
        given = None if ignore_override else self.overrides.get(name)
        parameter = given or Parameter(name, value=value)
        if parameter.type_ != Parameter.Type.NOT_SET:
            parameter = self._typed(parameter, descriptor)
            if reason := parameter_rules.range_fault(parameter, descriptor) or self._refused([parameter]):
                raise InvalidParameterValueException(name, parameter.value, reason)
        self.values[name], self.descriptors[name] = parameter, descriptor
        return parameter

    def check_new(self, names: list[str]) -> None:
        """Raises for names that are none, or that are declared already."""
        for name in names:
            if not isinstance(name, str):
                raise TypeError(f"a parameter's name is a str, and {name!r} is a {type(name).__name__}")
            if not name:
                raise InvalidParameterException(name)
        if there := [name for name in names if name in self.values]:
            raise ParameterAlreadyDeclaredException(there)

    def check_known(self, names: Iterable[str]) -> None:
        """Raises ParameterNotDeclaredException for those that are not, unless that is allowed."""
        missing = [name for name in names if name not in self.values]
        if missing and not self.allow_undeclared:
            raise ParameterNotDeclaredException(missing)

    def set(self, parameters: list[Parameter]) -> str:
        """Set all, or none; why not, empty if it was done. Raises ParameterNotDeclaredException."""
        with self.lock:
            for callback in list(self.pre):
                parameters = _listed(callback(parameters), callback)
            self.check_known(each.name for each in parameters)
            reason = next(filter(None, map(self.fault, parameters)), "") or self._refused(parameters)
            if reason:
                return reason
            for each in parameters:
                self._keep(each)
            for callback in list(self.post):
                callback(parameters)
        return ""

    def fault(self, parameter: Parameter) -> str:
        """Why a value cannot be set, by its descriptor alone; empty if it can."""
        known = self.descriptors.get(parameter.name)
        return parameter_rules.fault(parameter, known) if known is not None else ""

    def describe(self, name: str, descriptor: Any, parameter: Parameter) -> None:
        """Change what a parameter takes, and its value. Raises what `set_descriptor` does."""
        new = deepcopy(descriptor)
        new.name, new.type = name, 0 if new.dynamic_typing else parameter.type_.value
        if reason := parameter_rules.range_fault(parameter, new):
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
            self.descriptors[name] = no_descriptor(name, dynamic_typing=True)
        self.values[name] = self._typed(parameter, self.descriptors[name])

    def _typed(self, parameter: Parameter, descriptor: Any) -> Parameter:
        """The parameter in its declared type. Raises InvalidParameterTypeException."""
        kind = Parameter.Type(descriptor.type)
        if descriptor.dynamic_typing or parameter.type_ == kind:
            return parameter
        if not kind.check(parameter.value):
            raise InvalidParameterTypeException(parameter, kind.name)
        return Parameter(parameter.name, kind, parameter.value)  # an empty list is one of any type

    def _refused(self, parameters: list[Parameter]) -> str:
        """Why a callback refuses; empty if none does."""
        for callback in list(self.on):
            result = callback(parameters)
            if not isinstance(getattr(result, "successful", None), bool):
                raise TypeError(f"{_name(callback)} returned {result!r}; return a SetParametersResult(successful=True)")
            if not result.successful:
                return result.reason or f"{_name(callback)} refused it, without a reason"
        return ""


def no_descriptor(name: str, dynamic_typing: bool = False) -> Any:
    """A rcl_interfaces.msg.ParameterDescriptor that says nothing."""
    from holozen.ros.generated import find

    return find("rcl_interfaces/msg/ParameterDescriptor")(name=name, dynamic_typing=dynamic_typing)


def _listed(parameters: Any, callback: Callback) -> list[Parameter]:
    if not isinstance(parameters, list) or not all(isinstance(each, Parameter) for each in parameters):
        raise TypeError(f"{_name(callback)} returned {parameters!r}; return a list of Parameter")
    return parameters


def _name(callback: Callback) -> str:
    return getattr(callback, "__qualname__", repr(callback))
