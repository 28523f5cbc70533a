"""STL files, binary and ASCII -> the corners of their triangles."""

import re
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from holozen.robot.errors import RobotError
from holozen.robot.rotation import Array

HEAD = 84  # bytes: 80 of any text, then the number of triangles
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
AT_ONCE = 50_000  # triangles; a giant file never stands in memory as a whole
BLOCK = 4_000_000  # bytes of text at once

_VERTEX = re.compile(rb"vertex\s+(\S+\s+\S+\s+\S+)")


def read(file: BinaryIO, size: int, place: str) -> Iterator[Array]:
    """Corners (n, 3), a part of the file at a time. `size` is the file's in bytes. Raises RobotError."""
    head = file.read(HEAD)
    count = int.from_bytes(head[80:HEAD], "little")
    whole = HEAD + count * TRIANGLE.itemsize
    # A binary file may start with "solid" too, so its size decides.
    if size != whole and head.lstrip().lower().startswith(b"solid"):
        yield from _ascii(file, head, place)
    elif len(head) < HEAD or size < whole:
        told = f"{count} triangles take {whole}" if len(head) == HEAD else f"the head alone takes {HEAD}"
        raise RobotError(f"{place}: is cut off: it has {size} bytes, and {told}; export it again as STL")
    else:
        yield from _binary(file, count)


def write(points: Array) -> bytes:
    """A binary STL with these points (n, 3) as corners, the last one repeated. Its triangles are no surface."""
    missing = -len(points) % 3
    triangles = np.zeros((len(points) + missing) // 3, TRIANGLE)
    triangles["corners"] = np.vstack([points, points[-1:].repeat(missing, axis=0)]).reshape(-1, 3, 3)
    return bytes(HEAD - 4) + len(triangles).to_bytes(4, "little") + triangles.tobytes()


def _binary(file: BinaryIO, count: int) -> Iterator[Array]:
    for start in range(0, count, AT_ONCE):
        part = np.frombuffer(file.read(min(AT_ONCE, count - start) * TRIANGLE.itemsize), TRIANGLE)
        yield part["corners"].reshape(-1, 3).astype(np.float64)


def _ascii(file: BinaryIO, head: bytes, place: str) -> Iterator[Array]:
    count, rest = 0, head.lower()
    while block := file.read(BLOCK).lower():
        done, facet, rest = (rest + block).rpartition(b"endfacet")
        if not facet and len(rest) > 2 * BLOCK:
            break  # no STL, and no need to gather it all
        part = _corners(done, place)
        count += len(part)
        if len(part):
            yield part
    if count % 3 or b"endsolid" not in rest:
        raise RobotError(f"{place}: is cut off: it does not end with 'endsolid'; export it again as STL")


def _corners(text: bytes, place: str) -> Array:
    words = b" ".join(_VERTEX.findall(text)).split()
    try:
        return np.fromiter(map(float, words), np.float64, len(words)).reshape(-1, 3)
    except ValueError as error:
        raise RobotError(f"{place}: a vertex holds no number: {str(error)[:200]}") from None
