"""Reads and writes the messages of one type."""

import struct
from functools import cache
from typing import Any

from holozen.cdr import CodecError
from holozen.cdr.source import Shape, reader, writer
from holozen.interfaces.definition import Interface

HEADER = b"\x00\x01\x00\x00"  # classic CDR, little endian
ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}
PADDING = 3  # bytes; DDS fills a payload up to a multiple of 4


class Codec:
    """Reads and writes one type, as values of a `shape`. The code for it is made on the first use."""

    def __init__(self, interface: Interface, shape: Shape, name: str = "") -> None:
        if interface.kind == "srv":
            raise CodecError(f"{interface.name} is a service; its messages are {interface.name}_Request and _Response")
        self.interface, self._shape, self._name = interface, shape, name or interface.name
        self._readers: dict[str, Any] = {}
        self._writer: Any = None

    def read(self, payload: bytes) -> Any:
        """The value in `payload`. Raises CodecError."""
        order = ORDERS.get(payload[:2])
        if order is None or len(payload) < len(HEADER):
            raise CodecError(
                f"not a {self._name}: {_start(payload)}; CDR begins with 00 00 or 00 01 and two bytes more"
            )
        if len(payload) == len(HEADER) and not self.interface.fields:
            payload += b"\0"  # other libraries write nothing for nothing
        try:
            value, end = self._reader(order)(payload, len(HEADER), len(payload))
        except struct.error:
            raise CodecError(f"not a {self._name}: cut off after {len(payload)} bytes") from None
        except UnicodeDecodeError as error:
            raise CodecError(f"not a {self._name}: a text that is not UTF-8: {error.reason}") from None
        except ValueError as error:
            raise CodecError(f"not a {self._name}: {error}") from None
        if len(payload) - end > PADDING:
            raise CodecError(f"not a {self._name}: {len(payload) - end} bytes too many")
        return value

    def write(self, value: Any) -> tuple[bytes, bool]:
        """The bytes of `value`, and whether all its numbers may be finite (False: look closer). Raises what a field
        does that holds a wrong value: `holozen.interfaces.values.completed` tells which.
        """
        if self._writer is None:
            self._writer = writer(self.interface, self._shape)
        parts: list[bytes] = [HEADER]
        odd: list[Any] = []
        self._writer(value, len(HEADER), parts, odd)
        return b"".join(parts), not odd

    def _reader(self, order: str) -> Any:
        if order not in self._readers:
            self._readers[order] = reader(self.interface, self._shape, order)
        return self._readers[order]


@cache
def plain(interface: Interface) -> Codec:
    """Reads and writes a type as dicts."""
    return Codec(interface, Shape())


def _start(payload: bytes) -> str:
    return f"{len(payload)} bytes that begin with {payload[:2].hex(' ')}" if payload else "no bytes"
