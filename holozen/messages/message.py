"""The base of all messages, the integer types of ROS, and the numbers and arrays within a
message.
"""

import math
import struct
from array import array
from collections.abc import Callable, Sequence
from typing import Annotated, Any, ClassVar

import msgspec
from msgspec import Meta, Struct

from holozen import limits

# `ros` is the type in the definition; a plain int is an int64, a float a float64.
Byte = Annotated[int, Meta(ge=0, lt=2**8, extra={"ros": "byte"})]
Int8 = Annotated[int, Meta(ge=-(2**7), lt=2**7, extra={"ros": "int8"})]
Int16 = Annotated[int, Meta(ge=-(2**15), lt=2**15, extra={"ros": "int16"})]
UInt16 = Annotated[int, Meta(ge=0, lt=2**16, extra={"ros": "uint16"})]
UInt32 = Annotated[int, Meta(ge=0, lt=2**32, extra={"ros": "uint32"})]
Float32 = Annotated[float, Meta(extra={"ros": "float32"})]
UInt8 = Annotated[int, Meta(ge=0, lt=2**8, extra={"ros": "uint8"})]
Int32 = Annotated[int, Meta(ge=-(2**31), lt=2**31, extra={"ros": "int32"})]
UInt64 = Annotated[int, Meta(ge=0, extra={"ros": "uint64"})]


# they make no cycles for the collector to look for
class Message(Struct, forbid_unknown_fields=True, gc=False):
    """A message of ROS, field for field. A field left out is zero.

    The name in ROS follows from the module and the class, with the ending Request or Reply for the
    two halves of a service.
    """

    ROS: ClassVar[str] = ""
    # checks the fields before the message is written
    SETTLE: ClassVar[Callable[[Any], None] | None] = None
    # whether a NaN or an infinity is sent (as CDR) instead of refused
    ANY_NUMBER: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        package, name = cls.__module__.rpartition(".")[2], cls.__name__
        service = name.removesuffix("Request").removesuffix("Reply")
        cls.ROS = f"{package}/msg/{name}" if service == name else f"{package}/srv/{service}"


def packed(code: str, values: Sequence[Any]) -> "array[Any]":
    """A list of numbers as an array. Raises OverflowError for one beyond a float32, struct.error
    for an integer.
    """
    if code == "B":
        return array(code, bytes(values))
    made: array[Any] = array(code)
    made.frombytes(struct.pack(f"={len(values)}{code}", *values))
    return made


def listed(value: Any) -> Any:
    """An array as a list, and a number of numpy as one of Python, which the wire carries instead.
    Raises TypeError for anything else.
    """
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a message cannot hold a {type(value).__name__}")


def not_finite(message: Message) -> str:
    """The path of the first number in `message` that is NaN or infinite, such as `linear.x`; else
    empty.
    """
    return limits.not_finite(msgspec.to_builtins(message, enc_hook=_suspects))


def _suspects(value: Any) -> Any:
    """As `listed`, but an array is an empty list unless one of its numbers may not be finite.
    Raises TypeError.
    """
    if isinstance(value, array) and (value.typecode not in "fd" or math.isfinite(sum(value))):
        return []
    return listed(value)
