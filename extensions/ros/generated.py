"""ROS's message, service and action classes, generated from their definitions on first use.

They are Structs, encoded and decoded by the same codec (JSON, CDR) as our own messages.
Values assigned by scripts are checked as in ROS; a decoder checks what it reads, so reading costs
no more than for our own messages.
"""

import keyword
import math
import operator
import re
import struct
import threading
from array import array
from collections.abc import Callable, Sequence, Set
from copy import deepcopy
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import msgspec
from msgspec import Meta, Struct, StructMeta

from holozen.messages import CodecError, Message
from holozen.messages.definitions import (
    FLOAT32,
    FLOATS,
    INTEGERS,
    TEXTS,
    TYPECODES,
    Field,
    Interface,
    InterfaceError,
    field_hint,
    fits_length,
    zero,
)
from holozen.messages.message import packed
from holozen.messages.registry import Registry
from holozen.suggest import shorten

Check = Callable[[Any], Any]
"""Takes the value assigned to a field and returns what is stored, or raises AssertionError."""

_construct = StructMeta.__call__  # constructs a message from values known to be valid
_store = Struct.__setattr__
MADE: dict[Interface, Any] = {}
_kinds: dict[tuple[Any, ...], Any] = {}  # by content: another registry parses the same file again
_registry = Registry()
_lock = threading.RLock()  # callbacks in several threads may ask first


class RosMeta(StructMeta):
    """Constructs messages as ROS does: from keyword arguments only, each checked."""

    def __call__(cls, *positions: Any, **given: Any) -> Any:
        if positions:
            example = ", ".join(f"{name}=..." for name in getattr(cls, "__struct_fields__")[:3])  # noqa: B009
            raise TypeError(
                f"{cls.__module__}.{cls.__name__} takes its fields by name: "
                f"{cls.__name__}({example})"
            )
        message, checks = _construct(cls), getattr(cls, "__checks__")  # noqa: B009
        for name, value in given.items():
            if name not in checks:
                raise AssertionError(
                    f"Invalid arguments passed to constructor: {_no_field(cls, name)}"
                )
            _store(message, name, checks[name](value))
        return message


class RosMessage(Message, metaclass=RosMeta):
    """The base class of all generated messages."""

    ANY_NUMBER: ClassVar[bool] = True  # an infinite range in a LaserScan is valid
    __interface__: ClassVar[Interface]
    __checks__: ClassVar[dict[str, Check]] = {}

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """The type of each field, by its name, in ROS's spelling: `{'x': 'double'}`."""
        return {field.name: _spelled(field) for field in cls.__interface__.fields}

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self.__checks__:
            raise AttributeError(_no_field(type(self), name))
        _store(self, name, self.__checks__[name](value))

    if not TYPE_CHECKING:  # a type checker would take any field as valid

        def __getattr__(self, name: str) -> Any:
            # An empty name keeps Python from adding a guess of its own.
            raise AttributeError(_no_field(type(self), name), name="")

    def __repr__(self) -> str:
        values = []
        for name in self.__struct_fields__:
            value = getattr(self, name)
            values.append(f"{name}={value.tolist() if type(value) is array else value!r}")
        return f"{type(self).__module__}.{type(self).__name__}({', '.join(values)})"

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        return _construct(
            type(self), *(deepcopy(getattr(self, name), memo) for name in self.__struct_fields__)
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (
            self.__interface__.name,
            [getattr(self, name) for name in self.__struct_fields__],
        )


class RosInterface:
    """The base class of all generated services and actions, which only name their messages. `Impl`
    of an action has those that travel.
    """

    ROS: ClassVar[str] = ""

    def __init__(self) -> None:
        what, part = ("an action", "Goal") if hasattr(self, "Goal") else ("a service", "Request")
        raise NotImplementedError(
            f"{what} type has no instances; create a {type(self).__name__}.{part}()"
        )


def use(registry: Registry) -> None:
    """Look up types in this registry from now on."""
    global _registry
    _registry = registry


def find(name: str) -> Any:
    """The class of `geometry_msgs/msg/Twist`, `std_srvs/srv/Trigger`,
    `std_srvs/srv/Trigger_Request` or `example_interfaces/action/Fibonacci`.

    Raises InterfaceError, with the closest name that exists.
    """
    with _lock:
        return make(_registry.find(name))


def make(interface: Interface) -> Any:
    """The class of a message, a service or an action, one per definition. Raises InterfaceError for
    names that no class can have.
    """
    if interface not in MADE:
        nested = {field.name: make(field.nested) for field in interface.fields if field.nested}
        parts = {part.name.rpartition("_")[2]: make(part) for part in interface.parts}
        described = ((*each[:6], nested.get(each.name)) for each in interface.fields)
        content = ((repr(words), kind) for *words, kind in described)
        key = (interface.name, repr(interface.constants), *content, *parts.values())
        if key not in _kinds:
            _kinds[key] = (
                _message(interface, nested) if interface.kind == "msg" else _owner(interface, parts)
            )
        MADE[interface] = _kinds[key]
    return MADE[interface]


def _owner(interface: Interface, parts: dict[str, Any]) -> type[RosInterface]:
    """The class of a service or an action, from the classes of its parts."""
    if interface.kind == "action":
        travels = {
            "SendGoalService": parts.pop("SendGoal"),
            "GetResultService": parts.pop("GetResult"),
            "FeedbackMessage": parts.pop("FeedbackMessage"),
            "CancelGoalService": find("action_msgs/srv/CancelGoal"),
            "GoalStatusMessage": find("action_msgs/msg/GoalStatusArray"),
        }
        parts["Impl"] = type("Impl", (), travels)
    return type(
        _last(interface),
        (RosInterface,),
        {"__module__": _module(interface), "ROS": interface.name, **parts},
    )


def _message(interface: Interface, nested: dict[str, type[RosMessage]]) -> Any:
    for name in (
        *(field.name for field in interface.fields),
        *(each.name for each in interface.constants),
    ):
        if keyword.iskeyword(name) or hasattr(RosMessage, name):
            raise InterfaceError(
                f"{interface.name}: {name!r} is reserved by Python or by all messages; rename it"
            )
    hints = {field.name: _hint(field, nested.get(field.name)) for field in interface.fields}
    names: dict[str, Any] = {
        "__annotations__": hints,
        "__module__": _module(interface),
        "__doc__": interface.name,
    }
    for field in interface.fields:
        names[field.name] = msgspec.field(default_factory=_default(field, nested.get(field.name)))
    if codes := {field.name: _typecode(field) for field in interface.fields if _typecode(field)}:
        names["__post_init__"] = _array_filler(codes)
    kind: Any = RosMeta(_last(interface), (RosMessage,), names)
    is_half = re.search("/srv/|_(SendGoal|GetResult)_", interface.name)
    kind.ROS = re.sub("_(Request|Response)$", "", interface.name) if is_half else interface.name
    kind.__interface__ = interface
    owner = f"{kind.__module__}.{kind.__name__}"
    kind.__checks__ = {
        field.name: _check(owner, field, nested.get(field.name)) for field in interface.fields
    }
    kind.SETTLE = _settle(owner, interface, nested)
    for field in interface.fields:
        setattr(kind, f"_{field.name}", kind.__dict__[field.name])
    kind.__slots__ = [f"_{field.name}" for field in interface.fields]
    for constant in interface.constants:
        setattr(kind, constant.name, constant.value)
    return kind


def _settle(owner: str, interface: Interface, nested: dict[str, type[RosMessage]]) -> Any:
    """Checks the sequences of a message, and those inside it, before it is encoded; None if there
    are none.
    """
    lists = [
        (field.name, _settled(owner, field, nested.get(field.name)))
        for field in interface.fields
        if field.array and not (field.array == "sequence" and _typecode(field))
    ]
    inner = [
        (field.name, field.array)
        for field in interface.fields
        if field.nested and nested[field.name].SETTLE
    ]

    def settle(self: Any) -> None:
        for name, check in lists:
            _store(self, name, check(getattr(self, name)))
        for name, many in inner:
            for part in getattr(self, name) if many else (getattr(self, name),):
                part.SETTLE()

    return settle if lists or inner else None


def _default(field: Field, nested: type | None) -> Callable[[], Any]:
    value = zero(field) if field.default is None else field.default
    one: Callable[[], Any] = partial(_construct, nested) if nested else partial(_same, value)
    if code := _typecode(field):
        return partial(array, code, field.default or ())
    if isinstance(field.default, list):
        return partial(list, tuple(field.default))
    if field.array != "fixed":
        return list if field.array else one
    return lambda: [one() for _ in range(field.bound)]


def _same(value: Any) -> Any:
    return value


def _module(interface: Interface) -> str:
    package, kind, _ = interface.name.split("/")
    return f"{package}.{kind}"


def _last(interface: Interface) -> str:
    return interface.name.rpartition("/")[2]


def _no_field(kind: Any, name: str) -> str:
    return (
        f"{kind.__module__}.{kind.__name__} has no field "
        f"{name!r}{field_hint(name, kind.__struct_fields__)}"
    )


def _unpickled(name: str, values: list[Any]) -> Any:
    return _construct(find(name), *values)


# Fields: their types for the decoder, and ROS's checks at every assignment

_LONGEST = 60  # characters of a value in an error
_IDL = {
    "bool": "boolean",
    "byte": "octet",
    "char": "uint8",
    "float32": "float",
    "float64": "double",
}
_CLASSES = {
    "bool": bool,
    **dict.fromkeys(INTEGERS, int),
    **dict.fromkeys(FLOATS, float),
    **dict.fromkeys(TEXTS, str),
}


class _Invalid(Exception):
    """A value that a field cannot hold."""


def _hint(field: Field, nested: type | None) -> Any:
    """The type of a field for msgspec, with its range and its length: what may arrive on the
    wire.
    """
    one: Any = nested or _CLASSES[field.type]
    if field.type in INTEGERS:
        low, high = INTEGERS[field.type]
        # msgspec accepts no limit above a signed 64-bit integer; it reads no more than 64 bits
        # anyway.
        one = Annotated[int, Meta(ge=low, le=high if high < 2**63 else None)]
    elif field.longest:
        one = Annotated[str, Meta(max_length=field.longest)]
    if not field.array:
        return one
    least = field.bound if field.array == "fixed" else None
    return Annotated[list[one], Meta(min_length=least, max_length=field.bound or None)]


def _spelled(field: Field) -> str:
    """The type as ROS's `get_fields_and_field_types` writes it, such as
    `sequence<geometry_msgs/Point>`.
    """
    one = (
        re.sub("/(msg|action)/", "/", field.type)
        if field.nested
        else _IDL.get(field.type, field.type)
    )
    one += f"<{field.longest}>" if field.longest else ""
    if field.array == "fixed":
        return f"{one}[{field.bound}]"
    return f"sequence<{one}{f', {field.bound}' if field.bound else ''}>" if field.array else one


def _check(owner: str, field: Field, nested: type | None) -> Check:
    """The check of a field in the message called `owner`."""
    one = _element_check(field, nested)
    if field.array:
        # as in ROS, which stores the very list that was assigned
        is_kept = nested is not None or field.type in TEXTS
        listed = _list_check(owner, field, nested, one, is_kept)
        return _array_check(field, listed) if _typecode(field) else listed
    exact = nested or (float if field.type == "float64" else bool if field.type == "bool" else None)

    def check(value: Any) -> Any:
        if type(value) is exact:
            return value
        try:
            return one(value)
        except _Invalid:
            raise AssertionError(_rejection(owner, field, nested, value)) from None

    return check


def _settled(owner: str, field: Field, nested: type | None) -> Check:
    """The check of a sequence before it is encoded, since anything may have been appended. Raises
    CodecError.

    Numbers of other classes are converted as an array would: an int for a float, and numpy's.
    """
    one, code = _element_check(field, nested, _LENIENT.get(field.type, _same)), _typecode(field)
    listed = _list_check(owner, field, nested, one, is_kept=True)

    def check(values: Any) -> Any:
        if code and fits_length(field, len(values)):
            return values  # an array, which holds nothing but numbers in range
        try:
            return listed(values)
        except AssertionError as error:
            raise CodecError(str(error)) from None

    return check


_LENIENT: dict[str, Check] = {
    "bool": lambda value: value.item() if hasattr(value, "item") else value,
    **dict.fromkeys(FLOATS, lambda value: value if isinstance(value, str) else float(value)),
    **{kind: operator.index for kind in INTEGERS if kind != "byte"},
}


def _element_check(field: Field, nested: type | None, convert: Check = _same) -> Check:
    """The check of one value, after `convert`. Raises _Invalid."""
    kind: type = nested or _CLASSES[field.type]
    low, high = INTEGERS.get(field.type, (0, 0))

    def check(value: Any) -> Any:
        value = convert(value)
        if field.type == "byte" and isinstance(value, bytes | bytearray) and len(value) == 1:
            return value[0]
        if not isinstance(value, kind):
            raise _Invalid
        if nested or kind is bool:
            return value
        # a subclass, such as numpy's float64
        value = kind(value) if kind is not str else str.__str__(value)
        if kind is int and not low <= value <= high:
            raise _Invalid
        if field.type == "float32" and math.isfinite(value) and abs(value) >= FLOAT32:
            raise _Invalid
        if field.longest and len(value) > field.longest:
            raise _Invalid
        return value

    return check


def _list_check(owner: str, field: Field, nested: type | None, one: Check, is_kept: bool) -> Check:
    """The check of a sequence whose elements `one` checks. If `is_kept`, a list that is right is
    not copied.
    """
    exact = nested or _CLASSES[field.type]

    def check(given: Any) -> list[Any]:
        values = _as_list(given)
        if values is None or not fits_length(field, len(values)):
            raise AssertionError(_rejection(owner, field, nested, given))
        if _all_exact(field, values, exact):
            return values if is_kept or values is not given else list(values)
        made = []
        for index, value in enumerate(values):
            try:
                made.append(one(value))
            except (_Invalid, TypeError, ValueError, ArithmeticError):
                raise AssertionError(
                    _rejection(owner, field, nested, value, f"[{index}]")
                ) from None
        return made

    return check


def _as_list(value: Any) -> list[Any] | None:
    """A list, tuple, array, bytes or set as a list; None for anything else."""
    if type(value) is list:
        return value
    if hasattr(value, "tolist"):  # array.array and numpy
        values = value.tolist()
        return values if isinstance(values, list) else None
    return list(value) if isinstance(value, Sequence | Set) and not isinstance(value, str) else None


def _all_exact(field: Field, values: list[Any], exact: type) -> bool:
    """Whether all values are of the exact class and in range: a quick test for the usual case."""
    if not values:
        return True
    if field.longest or not set(map(type, values)) <= {exact}:
        return False
    if field.type == "float32":
        return _fits("f", values)
    if exact is int:
        low, high = INTEGERS[field.type]
        return bool(low <= min(values) and max(values) <= high)
    return True


# Arrays: sequences of all numbers but bool and byte are `array.array`, as in ROS

# The format that numpy gives for 64-bit integers depends on the machine.
_LONGS = dict(zip("lL", "qQ" if struct.calcsize("l") == 8 else "iI", strict=True))


def _typecode(field: Field) -> str:
    """The typecode of a field's array; empty for a field that holds no array."""
    return TYPECODES.get(field.type, "") if field.array in ("sequence", "bounded") else ""


def _array_check(field: Field, listed: Callable[[Any], list[Any]]) -> Check:
    """The check of an array field. As in ROS an array with its typecode is stored itself; all else
    is copied.

    `listed` turns anything else into a list of valid values, or raises.
    """
    code, most = _typecode(field), field.bound

    def check(given: Any) -> Any:
        values = given if type(given) is array and given.typecode == code else _copied(code, given)
        if values is None or 0 < most < len(values):
            return packed(code, listed(given))
        return values

    return check


def _array_filler(codes: dict[str, str]) -> Callable[[Any], None]:
    """Turns the lists from a decoder into arrays."""
    each = tuple(codes.items())

    def fill(self: Any) -> None:
        for name, code in each:
            values = getattr(self, name)
            if type(values) is not array:
                _store(self, name, _filled(name, code, values))

    return fill


def _filled(name: str, code: str, values: list[Any]) -> "array[Any]":
    """The array of the list that a decoder gave for the field `name`. Raises ValueError, which
    decoders report.
    """
    try:
        return packed(code, values)
    except (OverflowError, struct.error):
        index = next(index for index, value in enumerate(values) if not _fits(code, [value]))
        raise ValueError(f"{name}[{index}] of {values[index]!r} is too large") from None


def _fits(code: str, values: Sequence[Any]) -> bool:
    try:
        struct.pack(f"={len(values)}{code}", *values)
    except (OverflowError, struct.error):
        return False
    return True


def _copied(code: str, given: Any) -> "array[Any] | None":
    """An array of the same numbers, from anything with that layout in memory (bytes, numpy); None
    for all else.
    """
    if type(given) is list:
        return None
    try:
        view = memoryview(given)
    except (TypeError, ValueError):
        return None
    if view.ndim != 1 or _LONGS.get(view.format, view.format) != code:
        return None
    made: array[Any] = array(code)
    made.frombytes(view.tobytes())
    return made


# Error messages for rejected values


def _rejection(owner: str, field: Field, nested: type | None, value: Any, place: str = "") -> str:
    wanted = nested.__name__ if nested else _CLASSES[field.type].__name__
    one = f"a sub message of type '{wanted}'" if nested else f"of type '{wanted}'"
    if field.array and not place:
        many = {"fixed": f"exactly {field.bound}", "bounded": f"at most {field.bound}"}.get(
            field.array, ""
        )
        one = f"a sequence of {many + ' values' if many else 'values'} {one.removeprefix('a ')}"
        if (values := _as_list(value)) is not None:
            return f"The '{field.name}' field of {owner} must be {one}, not of {len(values)} values"
    given = f"'{type(value).__name__}' ({_short(value)})"
    text = f"The '{field.name}{place}' field of {owner} must be {one}{_limits(field)}, not {given}"
    return text + _remedy(field, wanted, value, place)


def _limits(field: Field) -> str:
    if field.type in INTEGERS:
        return " in [{}, {}]".format(*INTEGERS[field.type])
    if field.longest:
        return f" of at most {field.longest} characters"
    return " within a float32" if field.type == "float32" else ""


def _remedy(field: Field, wanted: str, value: Any, place: str) -> str:
    """How to write it, where that is obvious."""
    if field.nested and hasattr(value, "to_msg"):
        return "; append .to_msg()"
    if field.nested and isinstance(value, list | tuple) and len(value) == len(field.nested.fields):
        return f"; write {wanted}({', '.join(f'{part.name}=...' for part in field.nested.fields)})"
    if field.nested or (field.array and not place):
        return ""
    if wanted == "float" and type(value) is int:
        return f"; write {_short(value)}.0, or float(...)"
    return (
        f"; write {wanted}(...)"
        if hasattr(value, "item") or (wanted == "int" and isinstance(value, float))
        else ""
    )


def _short(value: Any) -> str:
    return shorten(repr(value).replace("\n", " "), _LONGEST)
