"""CDR of Structs.

A class that was made from a definition (holozen.ros) has it as `__interface__`.
"""

import struct
import typing
from functools import cache, partial
from typing import Any

import msgspec
from msgspec import StructMeta

from holozen.messages import CodecError
from holozen.messages.cdr import Codec, Shape
from holozen.messages.definitions import INTEGERS, Field, Interface, completed
from holozen.messages.message import Message, listed
from holozen.messages.registry import Registry

_REGISTRY = Registry()
_HALVES = {"Request": "_Request", "Reply": "_Response"}
# raised by wrong values
_WRONG = (ArithmeticError, AttributeError, TypeError, ValueError, struct.error)


def ros_name(kind: type[Message]) -> str:
    """The full ROS name of a message, such as `std_srvs/srv/Trigger_Request`."""
    if made := getattr(kind, "__interface__", None):
        return str(made.name)
    halves = (half for end, half in _HALVES.items() if kind.__name__.endswith(end))
    is_half = "/srv/" in kind.ROS or kind.ROS.endswith(("_SendGoal", "_GetResult"))
    return kind.ROS + (next(halves, "") if is_half else "")


def interface(kind: type[Message]) -> Interface:
    """The definition of a message."""
    made: Interface | None = getattr(kind, "__interface__", None)
    return made or _REGISTRY.find(ros_name(kind))


@cache
def codec(kind: type[Message]) -> Codec:
    """The codec of a message."""
    return Codec(interface(kind), Structs(kind), kind.__name__)


def write(message: Message) -> tuple[bytes, bool]:
    """The bytes of a message, and whether its numbers are certainly finite. Raises CodecError."""
    try:
        return codec(type(message)).write(message)
    except UnicodeEncodeError:
        raise  # reported by the codec for all wires alike
    except _WRONG as error:
        raise CodecError(f"{type(message).__name__}: {_reason(message) or error}") from None


def _reason(message: Message) -> str:
    try:
        completed(interface(type(message)), msgspec.to_builtins(message, enc_hook=listed))
    except _WRONG as error:
        return str(error)
    return ""


class Structs(Shape):
    """Values are Structs. A `dict` stands for a sequence of pairs, as ROS has no mappings."""

    def __init__(self, kind: type[Message]) -> None:
        super().__init__()
        self.arrays = hasattr(kind, "__interface__")
        self._classes: dict[str, type[Message]] = {}
        self._makers: dict[str, str] = {}  # type -> the name of its maker
        self._add(kind)

    def made(self, interface: Interface, values: list[str]) -> str:
        """A Struct, or the tuple of the fields of a type without one."""
        kind = self._classes.get(interface.name)
        if kind is None:
            return f"({', '.join(values)})"
        hints = typing.get_type_hints(kind, include_extras=True)
        fields = zip(interface.fields, values, strict=True)
        maker = self._makers[interface.name]
        return f"{maker}({', '.join(self._value(hints[field.name], field, value) for field, value in fields)})"  # noqa: E501

    def part(self, interface: Interface, field: Field, owner: str) -> str:
        """An attribute of a Struct, or an item of a tuple."""
        kind = self._classes.get(interface.name)
        if kind is None:
            return f"{owner}[{interface.fields.index(field)}]"
        hint = typing.get_type_hints(kind)[field.name]
        return (
            f"list({owner}.{field.name}.items())"
            if typing.get_origin(hint) is dict
            else f"{owner}.{field.name}"
        )

    def _add(self, kind: type[Message]) -> None:
        name, maker = ros_name(kind), f"make_{len(self._makers)}"
        self._classes[name], self._makers[name] = kind, maker
        # Skip the checks of classes made for scripts: the reader has checked the values.
        self.names[maker] = kind if type(kind) is StructMeta else partial(StructMeta.__call__, kind)
        for hint in typing.get_type_hints(kind).values():
            for inner in (hint, *typing.get_args(hint)):
                if (
                    isinstance(inner, type)
                    and issubclass(inner, Message)
                    and ros_name(inner) not in self._classes
                ):
                    self._add(inner)

    def _value(self, hint: Any, field: Field, value: str) -> str:
        if typing.get_origin(getattr(hint, "__origin__", hint)) is dict:
            return f"dict({value})"
        metas = [
            meta for meta in getattr(hint, "__metadata__", ()) if isinstance(meta, msgspec.Meta)
        ]
        for meta in metas if field.type in INTEGERS and not field.array else []:
            low, high = INTEGERS[field.type]
            least = low if meta.ge is None else int(meta.ge)
            most = (
                int(meta.le)
                if meta.le is not None
                else int(meta.lt) - 1
                if meta.lt is not None
                else high
            )
            if least > low or most < high:
                limited = f"limited_{len(self.names)}"
                self.names[limited] = partial(_limited, field.name, least, most)
                return f"{limited}({value})"
        return value


def _limited(name: str, least: int, most: int, value: int) -> int:
    if least <= value <= most:
        return value
    raise ValueError(f"{name} of {value}; use a number from {least} to {most}")
