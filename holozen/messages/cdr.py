"""CDR, the bytes of ROS 2: the classic encoding of DDS (XCDR1), written in little endian and read
in both byte orders.

Two bytes give the byte order and two are unused; then come the fields, each aligned to its own
size, counted from there (OMG DDSI-RTPS 2.5, 10.2; OMG CORBA 3.4 part 2, 9.3). An empty message
takes one byte, as in ROS 2.

The functions that read and write a type are generated. Fields of fixed size form runs, each one
call of `struct`; a text or a sequence ends a run. As the alignment of a run is known only at run
time, it has eight layouts, one for each position within eight bytes.
"""

import struct
import sys
from array import array
from collections.abc import Callable, Sequence
from functools import cache, partial
from itertools import count
from math import isfinite
from typing import Any

from holozen.messages import CodecError
from holozen.messages.definitions import (
    TYPECODES,
    Field,
    Interface,
    InterfaceError,
    completed,
    element_size,
)
from holozen.suggest import article

HEADER = b"\x00\x01\x00\x00"  # classic CDR, little endian
ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}
PADDING = 3  # bytes; DDS fills a payload up to a multiple of 4
CODES = {"bool": "?", "byte": "B", **TYPECODES}
START = 4  # bytes before the first field; alignment is counted from here
SIZES = {code: struct.calcsize(f"<{code}") for code in "?bBhHiIqQfd"}
NATIVE = "<" if sys.byteorder == "little" else ">"
MANY = 2**32 - 1  # the largest count

Read = Callable[[bytes, int, int], tuple[Any, int]]
Write = Callable[[Any, int, list[bytes], list[Any]], int]
Run = list[tuple[str, int]]  # struct codes and how many of each; x is a padding byte


def read(interface: Interface, payload: bytes) -> dict[str, Any]:
    """The message in `payload` as plain values. Raises CodecError."""
    value: dict[str, Any] = plain(interface).read(payload)
    return value


def write(interface: Interface, value: Any) -> bytes:
    """The bytes of a message given as plain values; missing fields are at their defaults. Raises
    CodecError.
    """
    try:
        return plain(interface).write(completed(interface, value))[0]
    except InterfaceError as error:
        raise CodecError(str(error)) from None


class Shape:
    """How generated code accesses values: by default a message is a dict. `names` are used by its
    expressions.

    With `arrays`, sequences of numbers are read as arrays, else as lists.
    """

    def __init__(self) -> None:
        self.arrays = False
        self.names: dict[str, Any] = {}

    def made(self, interface: Interface, values: list[str]) -> str:
        """The expression that makes a message of the expressions `values` of its fields."""
        pairs = zip(interface.fields, values, strict=True)
        return "{" + ", ".join(f"{field.name!r}: {value}" for field, value in pairs) + "}"

    def part(self, interface: Interface, field: Field, owner: str) -> str:
        """The expression that gets a field of the message `owner`."""
        return f"{owner}[{field.name!r}]"


class Codec:
    """Reads and writes one type, as values of a `shape`. Its code is generated on first use."""

    def __init__(self, interface: Interface, shape: Shape, name: str = "") -> None:
        if interface.kind != "msg":
            what = "a service" if interface.kind == "srv" else "an action"
            names = " and ".join(part.name for part in interface.parts if part.kind == "msg")
            raise CodecError(f"{interface.name} is {what}; its messages are {names}")
        self.interface, self._shape, self._name = interface, shape, name or interface.name
        self._readers: dict[str, Any] = {}
        self._writer: Any = None

    def read(self, payload: bytes) -> Any:
        """The value in `payload`. Raises CodecError."""
        order = ORDERS.get(payload[:2])
        if order is None or len(payload) < len(HEADER):
            start = (
                f"{len(payload)} bytes that begin with {payload[:2].hex(' ')}"
                if payload
                else "no bytes"
            )
            raise CodecError(
                f"not {article(self._name)}: {start}; CDR begins with 00 00 or 00 01 and two more "
                "bytes"
            )
        if len(payload) == len(HEADER) and not self.interface.fields:
            payload += b"\0"  # other libraries write no byte for an empty message
        try:
            if order not in self._readers:
                self._readers[order] = reader(self.interface, self._shape, order)
            value, end = self._readers[order](payload, len(HEADER), len(payload))
        except struct.error:
            raise CodecError(
                f"not {article(self._name)}: cut off after {len(payload)} bytes"
            ) from None
        except UnicodeDecodeError as error:
            raise CodecError(
                f"not {article(self._name)}: a text is not UTF-8: {error.reason}"
            ) from None
        except ValueError as error:
            raise CodecError(f"not {article(self._name)}: {error}") from None
        if len(payload) - end > PADDING:
            raise CodecError(f"not {article(self._name)}: {len(payload) - end} bytes too many")
        return value

    def write(self, value: Any) -> tuple[bytes, bool]:
        """The bytes of `value`, and whether its numbers are certainly finite.

        A wrong value raises whatever Python raises for it; `completed` then names the field.
        """
        if self._writer is None:
            self._writer = writer(self.interface, self._shape)
        parts: list[bytes] = [HEADER]
        odd: list[Any] = []
        self._writer(value, len(HEADER), parts, odd)
        return b"".join(parts), not odd


@cache
def plain(interface: Interface) -> Codec:
    """The codec of a type as dicts."""
    return Codec(interface, Shape())


def reader(interface: Interface, shape: Shape, order: str) -> Read:
    """A function that reads a message in the byte order "<" or ">" of struct.

    It raises struct.error where the bytes are cut off, else ValueError.
    """
    made: Read = _Reading(shape, order).function(interface)
    return made


def writer(interface: Interface, shape: Shape) -> Write:
    """A function that appends the parts of a message to `out`, and to `odd` the values that may not
    be finite.
    """
    made: Write = _Writing(shape, "<").function(interface)
    return made


class _Body:
    """The lines of a generated function, and the current run, for the next call of struct."""

    def __init__(self, shape: Shape, order: str) -> None:
        self.shape, self.order = shape, order
        self.lines: list[str] = []
        self.run: Run = []
        self._names: dict[str, Any] = {"isfinite": isfinite, "sized": sized}
        self._numbers = count()

    def compiled(self, interface: Interface, arguments: str, result: str) -> Any:
        lines = [
            f"def made({arguments}):",
            *(f" {line}" for line in self.lines),
            f" return {result}",
        ]
        names = {**self._names, **self.shape.names}
        exec(compile("\n".join(lines), f"<CDR of {interface.name}>", "exec"), names)
        return names["made"]

    def fresh(self) -> str:
        """An unused name."""
        return f"_{next(self._numbers)}"

    def named(self, value: Any) -> str:
        """A name for an object that the lines use."""
        name = self.fresh()
        self._names[name] = value
        return name

    def fill(self, interface: Interface) -> None:
        """Add the one byte of a message without fields."""
        if not interface.fields:
            self.run.append(("x", 1))

    def in_run(self, field: Field) -> bool:
        """Whether a field has a fixed size, so that it was added to the run."""
        if field.type == "wstring":
            raise InterfaceError(
                f"{field.name}: the implementations of ROS 2 do not agree on how to write a wstring"
            )
        if field.type not in CODES or field.array not in ("", "fixed"):
            return False
        self.run.append((CODES[field.type], field.bound or 1))
        return True


class _Reading(_Body):
    """Generates a reader. Methods return the expressions of values that the lines read."""

    def function(self, interface: Interface) -> Any:
        self._values = self.fresh()  # the tuple of the current run
        value = self.message(interface)
        self.end_run()
        return self.compiled(interface, "b, p, e", f"{value}, p")

    def message(self, interface: Interface) -> str:
        self.fill(interface)
        return self.shape.made(interface, [self.field(field) for field in interface.fields])

    def field(self, field: Field) -> str:
        if not field.array and field.nested:
            return self.message(field.nested)
        at = sum(many for code, many in self.run if code != "x")
        if self.in_run(field):
            return (
                f"list({self._values}[{at}:{at + field.bound}])"
                if field.array
                else f"{self._values}[{at}]"
            )
        self.end_run()
        value = self.fresh()
        self.lines.append(f"{value}, p = {self.named(self.call(field))}(b, p, e)")
        return value

    def call(self, field: Field) -> Any:
        if field.type in CODES:
            if self.shape.arrays and field.type in TYPECODES:
                return partial(read_array, self.order, CODES[field.type], field.bound)
            return partial(read_numbers, self.order, CODES[field.type], field.bound)
        text = partial(read_text, self.order, field.longest)
        one = reader(field.nested, self.shape, self.order) if field.nested else text
        if field.array == "fixed":
            return partial(read_row, one, field.bound)
        return (
            partial(read_many, self.order, one, element_size(field), field.bound)
            if field.array
            else one
        )

    def end_run(self) -> None:
        if self.run:
            table = [(layout.unpack_from, layout.size) for layout in layouts(self.order, self.run)]
            self.lines += [
                f"u, n = {self.named(table)}[p & 7]",
                f"{self._values} = u(b, p)",
                "p += n",
            ]
            self.run, self._values = [], self.fresh()


class _Writing(_Body):
    """Generates a writer of the message `o`."""

    def function(self, interface: Interface) -> Any:
        self._items: list[str] = []  # the values of the current run
        self.message(interface, "o")
        self.end_run()
        return self.compiled(interface, "o, p, out, odd", "p")

    def message(self, interface: Interface, owner: str) -> None:
        self.fill(interface)
        for field in interface.fields:
            self.field(field, self.shape.part(interface, field, owner))

    def field(self, field: Field, part: str) -> None:
        if not field.array and field.nested:
            owner = self.fresh()
            self.lines.append(f"{owner} = {part}")
            self.message(field.nested, owner)
        elif self.in_run(field):
            self._items.append(f"*sized({part}, {field.bound})" if field.array else part)
        else:
            self.end_run()
            self.lines.append(f"p = {self.named(self.call(field))}({part}, p, out, odd)")

    def call(self, field: Field) -> Any:
        if field.type in CODES:
            return partial(write_numbers, CODES[field.type], field.bound)
        one = (
            writer(field.nested, self.shape) if field.nested else partial(write_text, field.longest)
        )
        if field.array == "fixed":
            return partial(write_row, one, field.bound)
        return partial(write_many, one, field.bound) if field.array else one

    def end_run(self) -> None:
        if self.run:
            table = [(layout.pack, layout.size) for layout in layouts("<", self.run)]
            items = "".join(f"{item}, " for item in self._items)
            self.lines += [
                f"u, n = {self.named(table)}[p & 7]",
                f"v = ({items})",
                "out.append(u(*v))",
                "p += n",
            ]
            if any(code in "fd" for code, _ in self.run):
                self.lines.append("isfinite(sum(v)) or odd.append(v)")
            self.run, self._items = [], []


def layouts(order: str, run: Run) -> list[struct.Struct]:
    """The layouts of a run that begins at p, for each `p & 7`."""
    return [struct.Struct(order + _layout(place - START, run)) for place in range(8)]


def _layout(at: int, run: Run) -> str:
    layout = ""
    for code, many in run:
        size = SIZES.get(code, 1)
        layout += f"{-at % size}x{many}{code}"
        at += -at % size + many * size
    return layout


def pad(at: int, size: int) -> int:
    """Padding bytes before a value of `size` bytes."""
    return (START - at) % size


def read_count(order: str, b: bytes, p: int) -> tuple[int, int]:
    """A length."""
    p += pad(p, 4)
    return int.from_bytes(_cut(b, p, 4), "big" if order == ">" else "little"), p + 4


def read_text(order: str, longest: int, b: bytes, p: int, e: int) -> tuple[str, int]:
    """A text: its length with the NUL that ends it, then UTF-8."""
    n, p = read_count(order, b, p)
    if n == 0:
        return "", p  # some libraries write no NUL for an empty text
    if n > e - p or b[p + n - 1]:
        raise ValueError(
            f"a text of {n} bytes "
            f"{'that does not end in NUL' if n <= e - p else f'where {e - p} are left'}"
        )
    if longest and n > longest + 1:
        raise ValueError(f"a text of {n - 1} bytes; at most {longest}")
    return b[p : p + n - 1].decode(), p + n


def read_numbers(
    order: str, code: str, bound: int, b: bytes, p: int, e: int
) -> tuple[list[Any], int]:
    """A sequence of numbers."""
    n, p, end = _read_span(order, code, bound, b, p, e)
    if code == "B":
        return list(_cut(b, p, n)), end
    return list(struct.unpack_from(f"{order}{n}{code}", b, p)), end


def read_array(
    order: str, code: str, bound: int, b: bytes, p: int, e: int
) -> tuple["array[Any]", int]:
    """A sequence of numbers, as an array."""
    _, p, end = _read_span(order, code, bound, b, p, e)
    made: array[Any] = array(code)
    made.frombytes(_cut(b, p, end - p))
    if order != NATIVE:
        made.byteswap()
    return made, end


def read_many(
    order: str, read: Read, least: int, bound: int, b: bytes, p: int, e: int
) -> tuple[list[Any], int]:
    """A sequence of texts or messages."""
    n, p = _read_length(order, bound, least, b, p, e)
    return read_row(read, n, b, p, e)


def read_row(read: Read, n: int, b: bytes, p: int, e: int) -> tuple[list[Any], int]:
    """`n` texts or messages."""
    values = []
    for _ in range(n):
        value, p = read(b, p, e)
        values.append(value)
    return values, p


def _read_span(order: str, code: str, bound: int, b: bytes, p: int, e: int) -> tuple[int, int, int]:
    """How many numbers, where they begin and where they end."""
    size = SIZES[code]
    n, p = _read_length(order, bound, size, b, p, e)
    p += pad(p, size) if n else 0
    return n, p, p + n * size


def _read_length(order: str, bound: int, least: int, b: bytes, p: int, e: int) -> tuple[int, int]:
    n, p = read_count(order, b, p)
    if n * least > e - p:
        raise ValueError(f"a sequence of {n} where {e - p} bytes are left")
    if 0 < bound < n:
        raise ValueError(f"a sequence of {n}; at most {bound}")
    return n, p


def _cut(b: bytes, p: int, n: int) -> bytes:
    found = b[p : p + n]
    if len(found) < n:
        raise struct.error
    return found


def write_text(longest: int, text: str, p: int, out: list[bytes], _odd: list[Any]) -> int:
    """A text, and where it ended."""
    data = text.encode()
    if longest and len(data) > longest:
        raise ValueError
    gap = pad(p, 4)
    out.append(b"\0" * gap + (len(data) + 1).to_bytes(4, "little") + data + b"\0")
    return p + gap + len(data) + 5


def write_numbers(
    code: str, bound: int, values: Sequence[Any], p: int, out: list[bytes], odd: list[Any]
) -> int:
    """A sequence of numbers, and where it ended."""
    p, n, size = _write_length(bound, values, p, out), len(values), SIZES[code]
    gap = pad(p, size) if n else 0
    out.append(b"\0" * gap + _packed(code, values))
    if code in "fd" and not isfinite(sum(values)):
        odd.append(values)
    return p + gap + n * size


def _packed(code: str, values: Sequence[Any]) -> bytes:
    if isinstance(values, array) and values.typecode == code and NATIVE == "<":
        return values.tobytes()
    return struct.pack(f"<{len(values)}{code}", *values)


def write_many(
    write: Write, bound: int, values: Sequence[Any], p: int, out: list[bytes], odd: list[Any]
) -> int:
    """A sequence of texts or messages, and where it ended."""
    return write_row(write, len(values), values, _write_length(bound, values, p, out), out, odd)


def write_row(
    write: Write, n: int, values: Sequence[Any], p: int, out: list[bytes], odd: list[Any]
) -> int:
    """`n` texts or messages, and where they ended."""
    for value in sized(values, n):
        p = write(value, p, out, odd)
    return p


def sized(values: Sequence[Any], n: int) -> Sequence[Any]:
    """`values` if there are `n` of them, else ValueError."""
    if len(values) != n:
        raise ValueError
    return values


def _write_length(bound: int, values: Sequence[Any], p: int, out: list[bytes]) -> int:
    if len(values) > (bound or MANY):
        raise ValueError
    gap = pad(p, 4)
    out.append(b"\0" * gap + len(values).to_bytes(4, "little"))
    return p + gap + 4
