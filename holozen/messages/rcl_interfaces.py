"""The messages of ROS 2's rcl_interfaces that read and set the parameters of a node."""

import math
from typing import Annotated, ClassVar

from msgspec import Meta, field

from holozen.messages.message import Byte, Message, UInt8, UInt64

Value = bool | int | float | str | list[bool] | list[int] | list[float] | list[str]

NOT_SET, BOOL, INTEGER, DOUBLE, STRING, BYTE_ARRAY, BOOL_ARRAY = range(7)
WORDS = (
    "not set",
    "boolean",
    "integer",
    "double",
    "string",
    "byte array",
    "boolean array",
    "integer array",
    "double array",
    "string array",
)
"""Names of the types of ParameterType, in their order."""


class ParameterValue(Message):
    """A value, in the field for its `type`: the fields are in the order of the types."""

    type: UInt8 = NOT_SET
    bool_value: bool = False
    integer_value: int = 0
    double_value: float = 0.0
    string_value: str = ""
    byte_array_value: list[Byte] = field(default_factory=list)
    bool_array_value: list[bool] = field(default_factory=list)
    integer_array_value: list[int] = field(default_factory=list)
    double_array_value: list[float] = field(default_factory=list)
    string_array_value: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, value: Value) -> "ParameterValue":
        """The message that holds `value`; the values of a list have one type."""
        if isinstance(value, list):
            kind = BYTE_ARRAY if not value else BOOL_ARRAY + cls.of(value[0]).type - BOOL
            made = cls(kind)
            setattr(made, cls.__struct_fields__[kind], value)
            return made
        if isinstance(value, bool):
            return cls(BOOL, bool_value=value)
        if isinstance(value, int):
            return cls(INTEGER, integer_value=value)
        if isinstance(value, float):
            return cls(DOUBLE, double_value=value)
        return cls(STRING, string_value=value)

    def plain(self) -> object:
        """The value; None if there is none."""
        fields = self.__struct_fields__
        return getattr(self, fields[self.type]) if NOT_SET < self.type < len(fields) else None


class Parameter(Message):
    name: str = ""
    value: ParameterValue = field(default_factory=ParameterValue)


class FloatingPointRange(Message):
    from_value: float = 0.0
    to_value: float = 0.0
    step: float = 0.0


class IntegerRange(Message):
    from_value: int = 0
    to_value: int = 0
    step: UInt64 = 0


class ParameterDescriptor(Message):
    """Describes a parameter and its valid values. The ranges have at most one entry."""

    name: str = ""
    type: UInt8 = NOT_SET
    description: str = ""
    additional_constraints: str = ""
    read_only: bool = False
    dynamic_typing: bool = False
    floating_point_range: Annotated[list[FloatingPointRange], Meta(max_length=1)] = field(
        default_factory=list
    )
    integer_range: Annotated[list[IntegerRange], Meta(max_length=1)] = field(default_factory=list)


class ListParametersResult(Message):
    names: list[str] = field(default_factory=list)
    prefixes: list[str] = field(default_factory=list)


class SetParametersResult(Message):
    successful: bool = False
    reason: str = ""


class ListParametersRequest(Message):
    """Asks for the names below `prefixes` (empty: all), with at most `depth` parts after the prefix
    (0: any).
    """

    DEPTH_RECURSIVE: ClassVar[UInt64] = 0

    prefixes: list[str] = field(default_factory=list)
    depth: UInt64 = 0


class ListParametersReply(Message):
    result: ListParametersResult = field(default_factory=ListParametersResult)


class GetParametersRequest(Message):
    names: list[str] = field(default_factory=list)


class GetParametersReply(Message):
    values: list[ParameterValue] = field(default_factory=list)


class SetParametersRequest(Message):
    parameters: list[Parameter] = field(default_factory=list)


class SetParametersReply(Message):
    """One result for each parameter in the request."""

    results: list[SetParametersResult] = field(default_factory=list)


class DescribeParametersRequest(Message):
    names: list[str] = field(default_factory=list)


class DescribeParametersReply(Message):
    descriptors: list[ParameterDescriptor] = field(default_factory=list)


def number_range(low: float, high: float) -> list[FloatingPointRange]:
    """The range of a number; empty without finite limits."""
    return [FloatingPointRange(low, high)] if math.isfinite(low) and math.isfinite(high) else []
