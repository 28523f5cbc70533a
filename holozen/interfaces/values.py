"""Values of a type as plain dicts, lists, numbers and strings."""

import math
from typing import Any

from holozen.interfaces.definition import FLOATS, INTEGERS, TEXTS, Field, Interface, InterfaceError
from holozen.interfaces.registry import closest

FLOAT32 = 3.4028235677973366e38  # from here up a number rounds to infinity as a float32 (IEEE 754)


def prototype(interface: Interface) -> dict[str, Any]:
    """A message with every field at its default: the definition's, else zero, empty or false."""
    return {field.name: _default(field) for field in interface.fields}


def completed(interface: Interface, value: Any, path: str = "") -> dict[str, Any]:
    """`value` with the fields that it leaves out at their defaults.

    Raises InterfaceError with the path of the first field that does not exist (and the closest that does) or whose
    value has another type, range or length. NaN and infinities are numbers. A list of pairs may be a mapping.
    """
    if not isinstance(value, dict):
        raise InterfaceError(f"{path or interface.name}: {_told(value)} is no mapping of fields")
    names = [field.name for field in interface.fields]
    for name in value:
        if name not in names:
            where = f"{path}.{name}" if path else f"{name}"
            raise InterfaceError(
                f"{interface.name} has no field {where[:80]!r}{closest(str(name), names) or _listed(names)}"
            )
    return {
        field.name: _checked(field, value[field.name], f"{path}.{field.name}".lstrip("."))
        if field.name in value
        else _default(field)
        for field in interface.fields
    }


def _listed(names: list[str]) -> str:
    return f"; it has {', '.join(names)}" if names else "; it has none"


def _default(field: Field) -> Any:
    if field.default is not None:
        return list(field.default) if isinstance(field.default, list) else field.default
    if field.array:
        return [_zero(field) for _ in range(field.bound if field.array == "fixed" else 0)]
    return _zero(field)


def _zero(field: Field) -> Any:
    if field.nested:
        return prototype(field.nested)
    if field.type in TEXTS:
        return ""
    return False if field.type == "bool" else 0.0 if field.type in FLOATS else 0


def _checked(field: Field, value: Any, path: str) -> Any:
    if not field.array:
        return _element(field, value, path)
    if isinstance(value, dict) and (names := _pair(field)):
        value = [dict(zip(names, item, strict=True)) for item in value.items()]
    if not isinstance(value, list | tuple):
        raise InterfaceError(f"{path}: {_told(value)} is no list")
    wrong = len(value) != field.bound if field.array == "fixed" else 0 < field.bound < len(value)
    if wrong:
        raise InterfaceError(f"{path}: {len(value)} values for {field.spelled()}")
    return [_element(field, inner, f"{path}[{index}]") for index, inner in enumerate(value)]


def _pair(field: Field) -> list[str]:
    names = [inner.name for inner in field.nested.fields] if field.nested else []
    return names if len(names) == 2 else []


def _element(field: Field, value: Any, path: str) -> Any:
    if field.nested:
        return completed(field.nested, value, path)
    if _fits(field, value):
        return float(value) if field.type in FLOATS else value
    raise InterfaceError(f"{path}: {_told(value)} is no {field._replace(array='').spelled()}")


def _fits(field: Field, value: Any) -> bool:
    if field.type == "bool" or isinstance(value, bool):
        return field.type == "bool" and isinstance(value, bool)
    if field.type in TEXTS:
        return isinstance(value, str) and _is_unicode(value) and not 0 < field.longest < len(value.encode())
    if field.type in FLOATS:
        return isinstance(value, float | int) and _is_number(field.type, value)
    low, high = INTEGERS[field.type]
    return isinstance(value, int) and low <= value <= high


def _is_number(kind: str, value: float) -> bool:
    try:
        number = float(value)
    except OverflowError:  # a whole number beyond all floats
        return False
    return kind == "float64" or not math.isfinite(number) or abs(number) < FLOAT32


def _is_unicode(text: str) -> bool:
    return not any("\ud800" <= letter <= "\udfff" for letter in text)


def _told(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:80]}..."
