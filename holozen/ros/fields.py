"""What the fields of a generated message take, hold and say: ROS's checks at every assignment."""

import math
import operator
import struct
from collections.abc import Callable, Sequence, Set
from typing import Annotated, Any

from msgspec import Meta

from holozen.cdr import CodecError
from holozen.interfaces import Field
from holozen.interfaces.definition import FLOATS, INTEGERS, TEXTS
from holozen.interfaces.values import FLOAT32
from holozen.ros import arrays

Check = Callable[[Any], Any]
"""Takes what is assigned to a field and gives what is stored, or raises AssertionError."""

LONGEST = 60  # characters of a value in an error
_IDL = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double"}
_CLASSES = {"bool": bool, **dict.fromkeys(INTEGERS, int), **dict.fromkeys(FLOATS, float), **dict.fromkeys(TEXTS, str)}


def hint(field: Field, nested: type | None) -> Any:
    """The type of a field for msgspec, with its range and its length: what may come over the wire."""
    one: Any = nested or _CLASSES[field.type]
    if field.type in INTEGERS:
        low, high = INTEGERS[field.type]
        # What a signed word of 64 bits cannot hold is no limit that msgspec knows; it reads no more than 64 bits.
        one = Annotated[int, Meta(ge=low, le=high if high < 2**63 else None)]
    elif field.longest:
        one = Annotated[str, Meta(max_length=field.longest)]
    if not field.array:
        return one
    least = field.bound if field.array == "fixed" else None
    return Annotated[list[one], Meta(min_length=least, max_length=field.bound or None)]


def spelled(field: Field) -> str:
    """The type as ROS's `get_fields_and_field_types` writes it, such as `sequence<geometry_msgs/Point>`."""
    one = field.type.replace("/msg/", "/") if field.nested else _IDL.get(field.type, field.type)
    one += f"<{field.longest}>" if field.longest else ""
    if field.array == "fixed":
        return f"{one}[{field.bound}]"
    return f"sequence<{one}{f', {field.bound}' if field.bound else ''}>" if field.array else one


def check(owner: str, field: Field, nested: type | None) -> Check:
    """The check of a field of the message called `owner`."""
    one = _element(field, nested)
    if field.array:
        listed = _of_list(owner, field, nested, one)
        return arrays.check(field, listed) if arrays.code(field) else listed
    exact = nested or (float if field.type == "float64" else bool if field.type == "bool" else None)

    def checked(value: Any) -> Any:
        if type(value) is exact:
            return value
        try:
            return one(value)
        except _Wrong:
            raise AssertionError(_told(owner, field, nested, value)) from None

    return checked


def settled(owner: str, field: Field, nested: type | None) -> Check:
    """The check of a list before it is written, as anything may have been put into it. Raises CodecError.

    Numbers of another class are taken as an array of them would: a whole number for a float, those of numpy.
    """
    if arrays.code(field):
        return arrays.settled(owner, field)
    exact, one = nested or _CLASSES[field.type], _element(field, nested, _LOOSE.get(field.type, _same))

    def of(values: Any) -> list[Any]:
        where = ""
        try:
            if _is_length(field, len(values)) and _is_plain(field, values, exact):
                return list(values) if type(values) is not list else values
            made = []
            for index, value in enumerate(values):
                where = f"[{index}]: {_short(value)} of type '{_name(value)}'"
                made.append(one(value))
            where = f": {len(values)} values"
            if _is_length(field, len(values)):
                return made
        except _REFUSED:
            pass
        raise CodecError(f"{owner}.{field.name}{where} is not what a {field.spelled()} holds") from None

    return of


class _Wrong(Exception):
    """A value that is none of the field's."""


_REFUSED = (_Wrong, TypeError, ValueError, ArithmeticError)


def _same(value: Any) -> Any:
    return value


def _to_float(value: Any) -> Any:
    return value if isinstance(value, str) else float(value)


def _to_bool(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


_LOOSE: dict[str, Check] = {
    "bool": _to_bool,
    **dict.fromkeys(FLOATS, _to_float),
    **{kind: operator.index for kind in INTEGERS if kind != "byte"},
}


def _element(field: Field, nested: type | None, first: Check = _same) -> Check:
    """The check of one value, after `first`. Raises _Wrong."""
    kind: type = nested or _CLASSES[field.type]
    low, high = INTEGERS.get(field.type, (0, 0))

    def of(value: Any) -> Any:
        value = first(value)
        if field.type == "byte" and isinstance(value, bytes | bytearray) and len(value) == 1:
            return value[0]
        if not isinstance(value, kind):
            raise _Wrong
        if nested or kind is bool:
            return value
        value = kind(value) if kind is not str else str.__str__(value)  # a subclass, such as numpy's float64
        if kind is int and not low <= value <= high:
            raise _Wrong
        if field.type == "float32" and math.isfinite(value) and abs(value) >= FLOAT32:
            raise _Wrong
        if field.longest and len(value) > field.longest:
            raise _Wrong
        return value

    return of


def _of_list(owner: str, field: Field, nested: type | None, one: Check) -> Check:
    exact = nested or _CLASSES[field.type]
    kept = exact is str or nested  # as in ROS, where a list of these is the one that was assigned

    def checked(given: Any) -> list[Any]:
        values = _listed(given)
        if values is None or not _is_length(field, len(values)):
            raise AssertionError(_told(owner, field, nested, given))
        if _is_plain(field, values, exact):
            return values if kept or values is not given else list(values)
        made = []
        for index, value in enumerate(values):
            try:
                made.append(one(value))
            except _Wrong:
                raise AssertionError(_told(owner, field, nested, value, f"[{index}]")) from None
        return made

    return checked


def _listed(value: Any) -> list[Any] | None:
    """A list, a tuple, an array, bytes or a set as a list; None if it is none of these."""
    if type(value) is list:
        return value
    if hasattr(value, "tolist"):  # of array and of numpy
        values = value.tolist()
        return values if isinstance(values, list) else None
    return list(value) if isinstance(value, Sequence | Set) and not isinstance(value, str) else None


def _is_length(field: Field, many: int) -> bool:
    return many == field.bound if field.array == "fixed" else not field.bound or many <= field.bound


def _is_plain(field: Field, values: list[Any], exact: type) -> bool:
    """Whether all values are seen at once to be right: of the exact class and in its range."""
    if not values:
        return True
    if field.longest or not set(map(type, values)) <= {exact}:
        return False
    if field.type == "float32":
        return _are_float32(values)
    if exact is int:
        low, high = INTEGERS[field.type]
        return bool(low <= min(values) and max(values) <= high)
    return True


def _are_float32(values: list[float]) -> bool:
    try:
        struct.pack(f"={len(values)}f", *values)
    except OverflowError:
        return False
    return True


def _told(owner: str, field: Field, nested: type | None, value: Any, place: str = "") -> str:
    wanted = nested.__name__ if nested else _CLASSES[field.type].__name__
    one = f"a sub message of type '{wanted}'" if nested else f"of type '{wanted}'"
    if field.array and not place:
        many = {"fixed": f"exactly {field.bound}", "bounded": f"at most {field.bound}"}.get(field.array, "")
        one = f"a sequence of {many + ' values' if many else 'values'} {one.removeprefix('a ')}"
        if (values := _listed(value)) is not None:
            return f"The '{field.name}' field of {owner} must be {one}, not of {len(values)} values"
    given = f"'{_name(value)}' ({_short(value)})"
    text = f"The '{field.name}{place}' field of {owner} must be {one}{_limits(field)}, not {given}"
    return text + _remedy(field, wanted, value, place)


def _limits(field: Field) -> str:
    if field.type in INTEGERS:
        low, high = INTEGERS[field.type]
        return f" in [{low}, {high}]"
    if field.longest:
        return f" of at most {field.longest} characters"
    return " within a float32" if field.type == "float32" else ""


def _remedy(field: Field, wanted: str, value: Any, place: str) -> str:
    """How to write it, where that is plain."""
    if field.nested and hasattr(value, "to_msg"):
        return "; write .to_msg() behind it"
    if field.nested or (field.array and not place):
        return ""
    if wanted == "float" and type(value) is int:
        return f"; write {_short(value)}.0, or float(...)"
    return f"; write {wanted}(...)" if hasattr(value, "item") or (wanted == "int" and isinstance(value, float)) else ""


def _name(value: Any) -> str:
    return type(value).__name__


def _short(value: Any) -> str:
    text = repr(value).replace("\n", " ")
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
