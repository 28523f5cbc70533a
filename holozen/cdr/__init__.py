"""CDR, the bytes of ROS 2: the classic encoding of DDS (XCDR1), little endian when written, either when read.

Two bytes say the byte order, two are spare, then come the fields, each aligned to its own size counted from there (OMG
DDSI-RTPS 2.5, 10.2; OMG CORBA 3.4 part 2, 9.3). An empty message takes one byte, as ROS 2 fills it.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from holozen.interfaces import Interface


class CodecError(ValueError):
    """Bytes that are no such message, or a message that has no bytes. The text is one line."""


def read(interface: "Interface", payload: bytes) -> dict[str, Any]:
    """The message in `payload` as plain values. Raises CodecError."""
    from holozen.cdr.codec import plain

    value: dict[str, Any] = plain(interface).read(payload)
    return value


def write(interface: "Interface", value: Any) -> bytes:
    """The bytes of a message given as plain values; fields left out are at their defaults. Raises CodecError."""
    from holozen.cdr.codec import plain
    from holozen.interfaces import InterfaceError
    from holozen.interfaces.values import completed

    try:
        return plain(interface).write(completed(interface, value))[0]
    except InterfaceError as error:
        raise CodecError(str(error)) from None
