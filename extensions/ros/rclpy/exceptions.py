"""The exceptions of rclpy, under ROS's names."""

from collections.abc import Sequence
from functools import partialmethod
from typing import Any

__all__ = [
    "InvalidHandle",
    "InvalidNamespaceException",
    "InvalidNodeNameException",
    "InvalidParameterException",
    "InvalidParameterTypeException",
    "InvalidParameterValueException",
    "InvalidServiceNameException",
    "InvalidTopicNameException",
    "NameValidationException",
    "NoImportTypeSupportException",
    "NoTypeSupportImportedException",
    "NodeNameNonExistentError",
    "NotInitializedException",
    "ParameterAlreadyDeclaredException",
    "ParameterException",
    "ParameterImmutableException",
    "ParameterNotDeclaredException",
    "ParameterUninitializedException",
    "RCLError",
    "RCLInvalidROSArgsError",
    "ROSInterruptException",
    "TimerCancelledError",
    "UnknownROSArgsError",
]


class NotInitializedException(Exception):
    """Something was used before `rclpy.init()`, or after `rclpy.shutdown()`."""

    __init__ = partialmethod(
        Exception.__init__, "call rclpy.init() first; rclpy is not running, or was shut down"
    )

    def __str__(self) -> str:
        return "; ".join(map(str, self.args))


class NoTypeSupportImportedException(Exception):
    """A type that is neither a message nor a service."""

    __init__ = partialmethod(Exception.__init__, "no type support imported")


class NoImportTypeSupportException(Exception):
    """A type of an interface package that cannot be imported."""

    __init__ = partialmethod(Exception.__init__, "no type support to import")


class ROSInterruptException(Exception):
    """A sleep ended because rclpy was shut down."""

    def __init__(self) -> None:
        super().__init__("rclpy was shut down")


class RCLError(RuntimeError):
    """An error that ROS's C library would return."""


class RCLInvalidROSArgsError(RCLError):
    """Words after --ros-args that cannot be parsed."""


class UnknownROSArgsError(RuntimeError):
    """Unknown flags after --ros-args."""


class NodeNameNonExistentError(RCLError):
    """A node of that name is not in the graph."""


class TimerCancelledError(RCLError):
    """A cancelled timer was called."""


class InvalidHandle(Exception):
    """A node, publisher, subscription, client, service or timer was used after it was destroyed."""


class NameValidationException(Exception):
    """A name that ROS rejects, with the position in it."""

    def __init__(self, name_type: str, name: str, error_msg: str, invalid_index: int) -> None:
        self.name_type, self.name, self.error_msg, self.invalid_index = (
            name_type,
            name,
            error_msg,
            invalid_index,
        )
        super().__init__(
            f"invalid {name_type} {name!r}, at character {invalid_index + 1}: {error_msg}"
        )


class InvalidNamespaceException(NameValidationException):
    """A namespace that ROS rejects."""

    __init__ = partialmethod(NameValidationException.__init__, "namespace")


class InvalidNodeNameException(NameValidationException):
    """A node name that ROS rejects."""

    __init__ = partialmethod(NameValidationException.__init__, "node name")


class InvalidTopicNameException(NameValidationException):
    """A topic name that ROS rejects."""

    __init__ = partialmethod(NameValidationException.__init__, "topic name")


class InvalidServiceNameException(NameValidationException):
    """A service name that ROS rejects."""

    __init__ = partialmethod(NameValidationException.__init__, "service name")


class ParameterException(Exception):
    """Something is wrong with one or more parameters, which `parameters` names."""

    def __init__(self, error_msg: str, parameters: str | Sequence[str] = (), *args: object) -> None:
        names = [parameters] if isinstance(parameters, str) else list(parameters)
        self.parameters = names
        super().__init__(
            f"parameter {', '.join(map(str, names))}: {error_msg}" if names else error_msg, *args
        )


class ParameterNotDeclaredException(ParameterException):
    """Parameters that were not declared, of a node that does not allow it."""

    __init__ = partialmethod(
        ParameterException.__init__, "not declared; call declare_parameter() first"
    )


class ParameterAlreadyDeclaredException(ParameterException):
    """Parameters that are declared already."""

    __init__ = partialmethod(ParameterException.__init__, "declared twice")


class InvalidParameterException(ParameterException):
    """A parameter with an invalid name."""

    __init__ = partialmethod(ParameterException.__init__, "not a valid parameter name")


class InvalidParameterTypeException(ParameterException):
    """A value of another type than the parameter's."""

    def __init__(self, desired_parameter: Any, expected_type: str) -> None:
        name = getattr(desired_parameter, "name", desired_parameter)
        got = getattr(getattr(desired_parameter, "type_", None), "name", "unknown")
        value = getattr(desired_parameter, "value", None)
        hint = f"; write {value}.0" if (got, expected_type) == ("INTEGER", "DOUBLE") else ""
        super().__init__(f"parameter {name!r} takes {expected_type}, and {value!r} is {got}{hint}")
        self.parameters = [name]


class InvalidParameterValueException(ParameterException):
    """A value that the parameter, or one of its callbacks, rejects."""

    def __init__(self, parameter: str, value: object, reason: str = "") -> None:
        super().__init__(f"parameter {parameter!r} rejects {value!r}: {reason}")
        self.parameters = [parameter]


class ParameterImmutableException(ParameterException):
    """An attempt to change a read-only parameter."""

    __init__ = partialmethod(ParameterException.__init__, "it is read-only")


class ParameterUninitializedException(ParameterException):
    """A parameter that was declared by its type only was read before it got a value."""

    __init__ = partialmethod(
        ParameterException.__init__, "it has no value yet; set it, or give it a default"
    )
