"""What the made functions call: texts, sequences, and the layouts of a run.

Readers take the bytes, where to begin and where they end, and give the value and where it ended; writers append to
`out`. Lengths are checked against the bytes that are left before anything is made.
"""

import struct
import sys
from array import array
from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any

START = 4  # bytes before the first field; alignment is counted from here
SIZES = {code: struct.calcsize(f"<{code}") for code in "?bBhHiIqQfd"}
NATIVE = "<" if sys.byteorder == "little" else ">"
MANY = 2**32 - 1  # the largest count

Read = Callable[[bytes, int, int], tuple[Any, int]]
Write = Callable[[Any, int, list[bytes], list[Any]], int]
Run = list[tuple[str, int]]  # struct codes and how many of each; x is a byte that says nothing


def layouts(order: str, run: Run) -> list[struct.Struct]:
    """The run as it lies when it begins at p, for each `p & 7`."""
    return [struct.Struct(order + _layout(place - START, run)) for place in range(8)]


def _layout(at: int, run: Run) -> str:
    layout = ""
    for code, many in run:
        size = SIZES.get(code, 1)
        layout += f"{-at % size}x{many}{code}"
        at += -at % size + many * size
    return layout


def pad(at: int, size: int) -> int:
    """Bytes until the next place for something of `size` bytes."""
    return (START - at) % size


def read_count(order: str, b: bytes, p: int) -> tuple[int, int]:
    """A length."""
    p += pad(p, 4)
    return int.from_bytes(_cut(b, p, 4), "big" if order == ">" else "little"), p + 4


def read_text(order: str, longest: int, b: bytes, p: int, e: int) -> tuple[str, int]:
    """A text: its length with the NUL that ends it, then UTF-8."""
    n, p = read_count(order, b, p)
    if n == 0:
        return "", p  # some write no NUL for an empty text
    if n > e - p or b[p + n - 1]:
        raise ValueError(
            f"a text of {n} bytes {'that does not end in NUL' if n <= e - p else f'where {e - p} are left'}"
        )
    if longest and n > longest + 1:
        raise ValueError(f"a text of {n - 1} bytes; at most {longest}")
    return b[p : p + n - 1].decode(), p + n


def read_numbers(order: str, code: str, bound: int, b: bytes, p: int, e: int) -> tuple[list[Any], int]:
    """A sequence of numbers."""
    n, p, end = _read_span(order, code, bound, b, p, e)
    if code == "B":
        return list(_cut(b, p, n)), end
    return list(struct.unpack_from(f"{order}{n}{code}", b, p)), end


def read_array(order: str, code: str, bound: int, b: bytes, p: int, e: int) -> tuple["array[Any]", int]:
    """A sequence of numbers, as an array."""
    _, p, end = _read_span(order, code, bound, b, p, e)
    made: array[Any] = array(code)
    made.frombytes(_cut(b, p, end - p))
    if order != NATIVE:
        made.byteswap()
    return made, end


def read_many(order: str, read: Read, least: int, bound: int, b: bytes, p: int, e: int) -> tuple[list[Any], int]:
    """A sequence of texts or messages."""
    n, p = _read_length(order, bound, least, b, p, e)
    return read_row(read, n, b, p, e)


def read_row(read: Read, n: int, b: bytes, p: int, e: int) -> tuple[list[Any], int]:
    """So many texts or messages."""
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


def write_numbers(code: str, bound: int, values: Sequence[Any], p: int, out: list[bytes], odd: list[Any]) -> int:
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


def write_many(write: Write, bound: int, values: Sequence[Any], p: int, out: list[bytes], odd: list[Any]) -> int:
    """A sequence of texts or messages, and where it ended."""
    return write_row(write, len(values), values, _write_length(bound, values, p, out), out, odd)


def write_row(write: Write, n: int, values: Sequence[Any], p: int, out: list[bytes], odd: list[Any]) -> int:
    """So many texts or messages, and where they ended."""
    for value in sized(values, n):
        p = write(value, p, out, odd)
    return p


def sized(values: Sequence[Any], n: int) -> Sequence[Any]:
    """`values` if they are so many, else ValueError."""
    if len(values) != n:
        raise ValueError
    return values


def _write_length(bound: int, values: Sequence[Any], p: int, out: list[bytes]) -> int:
    if len(values) > (bound or MANY):
        raise ValueError
    gap = pad(p, 4)
    out.append(b"\0" * gap + len(values).to_bytes(4, "little"))
    return p + gap + 4
