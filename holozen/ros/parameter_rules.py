"""Which values a parameter takes, by its descriptor."""

from typing import Any

from holozen.ros.parameter import Parameter

NEAR = 1e-9  # of a range's step: as near to a step as binary fractions get


def fault(parameter: Parameter, descriptor: Any) -> str:
    """Why a parameter may not be set to that; empty if it may."""
    if descriptor.read_only:
        return f"{parameter.name} is read-only"
    if reason := range_fault(parameter, descriptor):
        return f"{parameter.name}: {parameter.value}: {reason}"
    return type_fault(parameter, descriptor)


def type_fault(parameter: Parameter, descriptor: Any) -> str:
    """Why its type is not that of the descriptor; empty if it is, or if any is taken."""
    if descriptor.dynamic_typing:
        return ""
    wanted, got = Parameter.Type(descriptor.type), parameter.type_
    if got == wanted or (got != Parameter.Type.NOT_SET and wanted.check(parameter.value)):
        return ""
    if got == Parameter.Type.NOT_SET:
        return f"{parameter.name} takes {wanted.name}, and not no value"
    hint = f"; write {parameter.value}.0" if (got.name, wanted.name) == ("INTEGER", "DOUBLE") else ""
    return f"{parameter.name} takes {wanted.name}, and {parameter.value!r} is {got.name}{hint}"


def range_fault(parameter: Parameter, descriptor: Any) -> str:
    """What numbers are in the descriptor's range; empty if its own is, or if there is no range."""
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
        if abs(steps - round(steps)) > NEAR * max(1.0, abs(steps)):
            return f"{within} in steps of {step}"
    return ""
