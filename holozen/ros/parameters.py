"""The parameters of a node, as its script sees them."""

import sys
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from holozen.parameters import is_below
from holozen.ros.exceptions import (
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from holozen.ros.parameter import PARAMETER_SEPARATOR_STRING, Parameter
from holozen.ros.parameter_store import Callback, Store, no_descriptor
from holozen.ros.time_source import USE_SIM_TIME

if TYPE_CHECKING:
    from holozen.ros.node_core import Core

__all__ = ["NodeParameters"]

_OURS = __file__.removesuffix("parameters.py")


class NodeParameters:
    """What a Node can do with parameters. Unknown names raise ParameterNotDeclaredException unless they are allowed."""

    _holozen: "Core"

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        """Add a parameter with its default, or its Parameter.Type; the value of the command line or a file goes first.

        Raises ParameterAlreadyDeclaredException, InvalidParameterException for an empty name,
        InvalidParameterTypeException for a value given from outside of another type than the default's,
        InvalidParameterValueException for one beyond the descriptor's range or refused by a callback.
        """
        entry = (name,) if value is None and descriptor is None else (name, value, descriptor)
        return self.declare_parameters("", [entry], ignore_override)[0]

    def declare_parameters(
        self, namespace: str, parameters: Sequence[tuple[Any, ...]], ignore_override: bool = False
    ) -> list[Parameter]:
        """Add parameters, each of (name), (name, value) or (name, value, descriptor). Raises as `declare_parameter`."""
        entries = [_entry(each, namespace) for each in parameters]
        with self._holozen.store.lock:
            self._holozen.store.check_new([name for name, _, _ in entries])
            return [self._holozen.store.declare(*entry, ignore_override) for entry in entries]

    def undeclare_parameter(self, name: str) -> None:
        """Remove a parameter. Raises ParameterNotDeclaredException, ParameterImmutableException."""
        with self._holozen.store.lock:
            if not self.has_parameter(name):
                raise ParameterNotDeclaredException(name)
            if self._holozen.store.descriptors[name].read_only:
                raise ParameterImmutableException(name)
            self._holozen.store.forget(name)

    def has_parameter(self, name: str) -> bool:
        """Whether it is declared."""
        return name in self._holozen.store.values

    def get_parameter(self, name: str) -> Parameter:
        """A parameter. Raises ParameterUninitializedException where only its type was declared, and no value given."""
        # Without the lock: a callback that is asked whether to set one may wait for a thread that reads another.
        self._holozen.store.check_known([name])
        found, descriptor = self._holozen.store.values.get(name), self._holozen.store.descriptors.get(name)
        if found and found.value is None and descriptor and not descriptor.dynamic_typing:
            raise ParameterUninitializedException(name)
        return found or Parameter(name)

    def get_parameters(self, names: Sequence[str]) -> list[Parameter]:
        """Some parameters, see `get_parameter`."""
        if isinstance(names, str) or not all(isinstance(name, str) for name in names):
            raise TypeError(f"names are a list of str, and not {names!r}")
        return [self.get_parameter(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """A parameter, or the other one where it is not declared or has no value."""
        found = self._holozen.store.values.get(name)
        return found if found and found.value is not None else alternative_value or Parameter(name)

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        """The parameters below `prefix`, by the rest of their names; all for an empty one."""
        start = prefix + PARAMETER_SEPARATOR_STRING if prefix else ""
        names = [name for name in list(self._holozen.store.values) if name.startswith(start)]
        return {name.removeprefix(start): self.get_parameter(name) for name in names}

    def get_parameter_type(self, name: str) -> Parameter.Type:
        """The type of a parameter."""
        return self.get_parameter_types([name])[0]

    def get_parameter_types(self, names: Sequence[str]) -> list[Parameter.Type]:
        """The types of some parameters."""
        self._holozen.store.check_known(names)
        return [(self._holozen.store.values.get(name) or Parameter(name)).type_ for name in names]

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[Any]:
        """Set each by itself: a SetParametersResult for each, with the reason why not."""
        parameters = _parameters(parameter_list)
        self._holozen.store.check_known(each.name for each in parameters)
        return [result(self._holozen.store.set([each])) for each in parameters]

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        """Set all or none: one SetParametersResult."""
        return result(self._holozen.store.set(_parameters(parameter_list)))

    def list_parameters(self, prefixes: Sequence[str], depth: int) -> Any:
        """The ListParametersResult of the names below `prefixes` with at most `depth` parts after them (0: any)."""
        names = [name for name in list(self._holozen.store.values) if is_below(name, list(prefixes), depth)]
        places = sorted({name.rpartition(PARAMETER_SEPARATOR_STRING)[0] for name in names} - {""})
        return _message("ListParametersResult")(names=names, prefixes=places)

    def describe_parameter(self, name: str) -> Any:
        """The ParameterDescriptor of a parameter."""
        return self.describe_parameters([name])[0]

    def describe_parameters(self, names: Sequence[str]) -> list[Any]:
        """The ParameterDescriptor of each."""
        self._holozen.store.check_known(names)
        return [self._holozen.store.descriptors.get(name) or no_descriptor(name) for name in names]

    def set_descriptor(self, name: str, descriptor: Any, alternative_value: Any = None) -> Any:
        """Change what a parameter takes; its ParameterValue then, which is `alternative_value` if one is given.

        Raises InvalidParameterValueException for a value that it does not take, ParameterImmutableException.
        """
        with self._holozen.store.lock:
            if not self.has_parameter(name):
                raise ParameterNotDeclaredException(name)
            if self._holozen.store.descriptors[name].read_only:
                raise ParameterImmutableException(name)
            new = self.get_parameter(name)
            if alternative_value is not None:
                new = Parameter.from_parameter_msg(_message("Parameter")(name=name, value=alternative_value))
            self._holozen.store.describe(name, descriptor, new)
        return new.get_parameter_value()

    def add_pre_set_parameters_callback(self, callback: Callback) -> None:
        """Call with a list of Parameter before it is set; what it returns is set instead."""
        self._holozen.store.pre.insert(0, callback)

    def add_on_set_parameters_callback(self, callback: Callback) -> None:
        """Call with a list of Parameter that is to be set; it returns a SetParametersResult."""
        self._holozen.store.on.insert(0, callback)

    def add_post_set_parameters_callback(self, callback: Callback) -> None:
        """Call with a list of Parameter that was set."""
        self._holozen.store.post.insert(0, callback)

    def remove_pre_set_parameters_callback(self, callback: Callback) -> None:
        """Raises ValueError for one that was not added."""
        self._holozen.store.pre.remove(callback)

    def remove_on_set_parameters_callback(self, callback: Callback) -> None:
        """Raises ValueError for one that was not added."""
        self._holozen.store.on.remove(callback)

    def remove_post_set_parameters_callback(self, callback: Callback) -> None:
        """Raises ValueError for one that was not added."""
        self._holozen.store.post.remove(callback)


def begin(
    node: NodeParameters,
    overrides: Sequence[Parameter] | None = None,
    allow_undeclared: bool = False,
    automatic: bool = False,
    start_services: bool = True,
) -> None:
    """Take the values that a node was given, declare `use_sim_time`, and serve all."""
    core = node._holozen
    given = core.arguments.parameters_for(core.fqn)
    found = {name: Parameter(name, value=value) for name, value in given.items()}
    found |= {each.name: each for each in _parameters(overrides or ())}
    core.store = Store(found, allow_undeclared)
    if automatic:
        node.declare_parameters("", [(name, each.value) for name, each in found.items()], ignore_override=True)
    if USE_SIM_TIME not in core.store.values:
        node.declare_parameter(USE_SIM_TIME, False)
    if start_services:
        from holozen.ros import parameter_service

        parameter_service.serve(node, core.fqn)


def _entry(entry: tuple[Any, ...], namespace: str) -> tuple[str, Any, Any]:
    """(name, value, descriptor) of what `declare_parameters` was given."""
    if not isinstance(entry, tuple | list) or not 1 <= len(entry) <= 3:
        raise TypeError(f"{entry!r} declares no parameter; write (name, value), or (name, value, descriptor)")
    name, *rest = entry
    if not isinstance(name, str):
        raise TypeError(f"a parameter's name is a str, and {name!r} is a {type(name).__name__}")
    full = f"{namespace}{PARAMETER_SEPARATOR_STRING}{name}" if namespace and name else name
    value, descriptor = [*rest, None, None][:2]
    if not rest:
        told = f"parameter {name!r} takes any type: give it a default, or a Parameter.Type"
        warnings.warn(told, stacklevel=_to_the_script())
        return full, None, no_descriptor(full, dynamic_typing=True)
    if descriptor is None:
        descriptor = no_descriptor(full)
    elif getattr(descriptor, "ROS", "") != "rcl_interfaces/msg/ParameterDescriptor":
        raise TypeError(f"parameter {name!r}: {descriptor!r} is no ParameterDescriptor of rcl_interfaces.msg")
    return full, value, descriptor


def _to_the_script() -> int:
    """How many frames above its caller the script's own is, as `warnings.warn` counts them."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_OURS):
        frame, level = frame.f_back, level + 1
    return level


def _parameters(given: Sequence[Parameter]) -> list[Parameter]:
    found = list(given)
    for each in found:
        if not isinstance(each, Parameter):
            raise TypeError(f"use a list of rclpy.parameter.Parameter; {each!r} is a {type(each).__name__}")
    return found


def result(reason: str) -> Any:
    """The SetParametersResult of what was refused for a reason, or done where that is empty."""
    return _message("SetParametersResult")(successful=not reason, reason=reason)


def _message(name: str) -> Any:
    from holozen.ros.generated import find

    return find(f"rcl_interfaces/msg/{name}")
