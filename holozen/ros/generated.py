"""ROS's message and service classes, made from their definitions when they are first asked for.

They are Structs, read and written by the one codec (JSON, msgpack, CDR) as our own messages are. What scripts assign is
checked as ROS does; what is read was checked by its reader, so reading costs no more than reading our own.
"""

import keyword
import re
import threading
from array import array
from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import Any, ClassVar

import msgspec
from msgspec import Struct, StructMeta

from holozen.interfaces import Field, Interface, InterfaceError, Registry
from holozen.interfaces.definition import FLOATS, TEXTS
from holozen.interfaces.registry import closest
from holozen.messages import Message
from holozen.ros import arrays, fields

_build = StructMeta.__call__  # makes a message of values that are known to be right
_store = Struct.__setattr__
_made: dict[Interface, type["RosMessage"]] = {}
_kinds: dict[tuple[Any, ...], type["RosMessage"]] = {}  # by what the definition says: another registry parses it anew
_services: dict[tuple[str, Any, Any], type["RosService"]] = {}
_registry = Registry()
_lock = threading.RLock()  # callbacks of several threads may ask first


class RosMeta(StructMeta):
    """Makes messages as ROS does: of named fields only, each checked."""

    def __call__(cls, *positions: Any, **given: Any) -> Any:
        if positions:
            raise TypeError(f"{cls.__module__}.{cls.__name__} takes its fields by name: {_example(cls)}")
        message, checks = _build(cls), getattr(cls, "__checks__")  # noqa: B009
        for name, value in given.items():
            if name not in checks:
                raise AssertionError(f"Invalid arguments passed to constructor: {_lacks(cls, name)}")
            _store(message, name, checks[name](value))
        return message


class RosMessage(Message, metaclass=RosMeta):
    """What every generated message is."""

    ANY_NUMBER: ClassVar[bool] = True  # an infinite range of a LaserScan is nothing wrong
    __interface__: ClassVar[Interface]
    __checks__: ClassVar[dict[str, fields.Check]] = {}

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """The type of each field, by its name, as ROS spells it: `{'x': 'double'}`."""
        return {field.name: fields.spelled(field) for field in cls.__interface__.fields}

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self.__checks__:
            raise AttributeError(_lacks(type(self), name))
        _store(self, name, self.__checks__[name](value))

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={_shown(getattr(self, name))!r}" for name in self.__struct_fields__)
        return f"{type(self).__module__}.{type(self).__name__}({values})"

    def __deepcopy__(self, memo: dict[int, Any]) -> "RosMessage":
        return _restored(type(self), [deepcopy(getattr(self, name), memo) for name in self.__struct_fields__])

    def __reduce__(self) -> tuple[Any, ...]:
        return _found, (self.__interface__.name, [getattr(self, name) for name in self.__struct_fields__])


class RosService:
    """What every generated service is: the name of its two messages."""

    ROS: ClassVar[str] = ""
    Request: ClassVar[Any]
    Response: ClassVar[Any]

    def __init__(self) -> None:
        raise NotImplementedError(f"a service has no values; make a {type(self).__name__}.Request()")


def use(registry: Registry) -> None:
    """Find types in this registry from now on."""
    global _registry
    _registry = registry


def find(name: str) -> Any:
    """The class of `geometry_msgs/msg/Twist`, `std_srvs/srv/Trigger` or `std_srvs/srv/Trigger_Request`.

    Raises InterfaceError, with the closest name there is.
    """
    with _lock:
        interface = _registry.find(name)
        return make_service(interface) if interface.kind == "srv" else make(interface)


def make(interface: Interface) -> type[RosMessage]:
    """The class of a message: one for each definition. Raises InterfaceError for a name that no class can have."""
    if interface not in _made:
        nested = {field.name: make(field.nested) for field in interface.fields if field.nested}
        said = ((*each[:6], nested.get(each.name)) for each in interface.fields)
        key = (interface.name, repr(interface.constants), *((repr(words), kind) for *words, kind in said))
        if key not in _kinds:
            _kinds[key] = _make(interface, nested)
        _made[interface] = _kinds[key]
    return _made[interface]


def make_service(interface: Interface) -> type[RosService]:
    """The class of a service: one for each definition. Raises InterfaceError."""
    if not (interface.request and interface.response):
        raise InterfaceError(f"{interface.name} is no service")
    request, response = make(interface.request), make(interface.response)
    key = (interface.name, request, response)
    if key not in _services:
        names = {"__module__": _module(interface), "ROS": interface.name, "Request": request, "Response": response}
        _services[key] = type(_last(interface), (RosService,), names)
    return _services[key]


def _make(interface: Interface, nested: dict[str, type[RosMessage]]) -> type[RosMessage]:
    for name in (*(field.name for field in interface.fields), *(each.name for each in interface.constants)):
        if keyword.iskeyword(name) or hasattr(RosMessage, name):
            raise InterfaceError(f"{interface.name}: {name!r} is a word of Python's, or of every message; rename it")
    hints = {field.name: fields.hint(field, nested.get(field.name)) for field in interface.fields}
    names: dict[str, Any] = {"__annotations__": hints, "__module__": _module(interface), "__doc__": interface.name}
    for field in interface.fields:
        names[field.name] = msgspec.field(default_factory=_default(field, nested.get(field.name)))
    if codes := {field.name: arrays.code(field) for field in interface.fields if arrays.code(field)}:
        names["__post_init__"] = _filler(codes)
    kind: Any = RosMeta(_last(interface), (RosMessage,), names)
    kind.ROS = re.sub("_(Request|Response)$", "", interface.name) if "/srv/" in interface.name else interface.name
    kind.__interface__ = interface
    owner = f"{kind.__module__}.{kind.__name__}"
    kind.__checks__ = {field.name: fields.check(owner, field, nested.get(field.name)) for field in interface.fields}
    kind.SETTLE = _settle(kind.__name__, interface, nested)
    for field in interface.fields:
        setattr(kind, f"_{field.name}", kind.__dict__[field.name])
    kind.__slots__ = [f"_{field.name}" for field in interface.fields]
    for constant in interface.constants:
        setattr(kind, constant.name, constant.value)
    made: type[RosMessage] = kind
    return made


def _default(field: Field, nested: type | None) -> Callable[[], Any]:
    one: Callable[[], Any] = partial(_build, nested) if nested else partial(_same, _zero(field))
    if code := arrays.code(field):
        return partial(array, code, field.default or ())
    if isinstance(field.default, list):
        return partial(list, tuple(field.default))
    if not field.array or field.array != "fixed":
        return list if field.array else one
    return partial(_row, one, field.bound) if nested else partial(list, (one(),) * field.bound)


def _filler(codes: dict[str, str]) -> Callable[[Any], None]:
    """Makes arrays of the lists that a reader gave."""
    each = tuple(codes.items())

    def fill(self: Any) -> None:
        for name, code in each:
            values = getattr(self, name)
            if type(values) is not array:
                _store(self, name, arrays.filled(name, code, values))

    return fill


def _shown(value: Any) -> Any:
    """What stands in a repr: of an array its numbers, as in ROS."""
    return value.tolist() if type(value) is array else value


def _zero(field: Field) -> Any:
    if field.default is not None:
        return field.default
    return "" if field.type in TEXTS else 0.0 if field.type in FLOATS else False if field.type == "bool" else 0


def _same(value: Any) -> Any:
    return value


def _row(one: Callable[[], Any], many: int) -> list[Any]:
    return [one() for _ in range(many)]


def _settle(owner: str, interface: Interface, nested: dict[str, type[RosMessage]]) -> Any:
    """Checks the lists of a message, and those within it, before it is written; None where there are none."""
    lists = [
        (field.name, fields.settled(owner, field, nested.get(field.name)))
        for field in interface.fields
        if field.array and not (field.array == "sequence" and arrays.code(field))
    ]
    inner = [(field.name, field.array) for field in interface.fields if field.nested and nested[field.name].SETTLE]

    def settle(self: Any) -> None:
        for name, check in lists:
            _store(self, name, check(getattr(self, name)))
        for name, many in inner:
            for part in getattr(self, name) if many else (getattr(self, name),):
                part.SETTLE()

    return settle if lists or inner else None


def _module(interface: Interface) -> str:
    package, kind, _ = interface.name.split("/")
    return f"{package}.{kind}"


def _last(interface: Interface) -> str:
    return interface.name.rpartition("/")[2]


def _lacks(kind: Any, name: str) -> str:
    known = kind.__struct_fields__
    hint = closest(name, known) or (f"; it has {', '.join(known)}" if known else "; it has none")
    return f"{kind.__module__}.{kind.__name__} has no field {name!r}{hint}"


def _example(kind: Any) -> str:
    return f"{kind.__name__}({', '.join(f'{name}=...' for name in kind.__struct_fields__[:3])})"


def _restored(kind: type[RosMessage], values: list[Any]) -> RosMessage:
    made: RosMessage = _build(kind, *values)
    return made


def _found(name: str, values: list[Any]) -> RosMessage:
    return _restored(find(name), values)
