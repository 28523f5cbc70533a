"""Mesh files -> the points of a convex hull, in metres in the link's frame. Each file is read once a process."""

import base64
import binascii
import io
import os
import re
import stat
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO, TypeVar

from holozen.robot.errors import RobotError, cut
from holozen.robot.mesh import collada, hulls, obj, stl
from holozen.robot.rotation import Array, triple
from holozen.robot.tag import Vector

T = TypeVar("T")
UNSCALED = (1.0, 1.0, 1.0)
MOST_DATA = 1_000_000  # characters of a data: URI; the hull of any mesh takes 6000
POINTER = b"version https://git-lfs.github.com/spec/v1"  # what stands in place of a file that was not fetched

Reader = Callable[[BinaryIO, int, str], Iterator[Array]]
READERS: dict[str, tuple[Reader, int]] = {
    ".dae": (collada.read, 100_000_000),
    ".obj": (obj.read, 80_000_000),
    ".stl": (stl.read, 300_000_000),
}
"""By the end of a file's name: its reader, and the most bytes that are read: what a slow machine does in 10 s."""

_DATA = re.compile(r"data:(model|application)/[a-z.+-]*stl[a-z.+-]*;base64,", re.IGNORECASE)


def hull(path: Path, scale: Vector = UNSCALED) -> tuple[Vector, ...]:
    """The points whose convex hull stands for a mesh, at most 512; how well, `hulls` says.

    `scale` is the URDF's, applied to what the file says in metres. Raises RobotError that names the file.
    """
    return _told(_scaled(*_identity(path), scale))


def bounds(path: Path, scale: Vector = UNSCALED) -> tuple[Vector, Vector]:
    """The lowest and the highest x, y, z of a mesh in metres. Raises RobotError."""
    coordinates = list(zip(*hull(path, scale), strict=True))
    return triple(map(min, coordinates)), triple(map(max, coordinates))


def data_uri(path: Path) -> str:
    """The unscaled hull of a mesh as text, in place of the file's name. Raises RobotError."""
    found = _told(_extremes(*_identity(path)))
    return "data:model/stl;base64," + base64.b64encode(stl.write(found)).decode()


def data_hull(uri: str, scale: Vector = UNSCALED) -> tuple[Vector, ...]:
    """The hull of the STL that a `data:` URI holds, as `hull`. Raises RobotError."""
    if len(uri) > MOST_DATA:
        raise RobotError(f"a data: URI of {len(uri)} characters; at most {MOST_DATA} are read")
    head = _DATA.match(uri.lstrip())
    if head is None:
        raise RobotError(f"{cut(uri)} is not read; write data:model/stl;base64,...")
    try:
        data = base64.b64decode("".join(uri.lstrip()[head.end() :].split()), validate=True)
    except (binascii.Error, ValueError):
        raise RobotError(f"{cut(uri)} is no base64") from None
    return _solid(_farthest(stl.read(io.BytesIO(data), len(data), "data: URI"), "data: URI"), scale, "data: URI")


def _identity(path: Path) -> tuple[str, int, int]:
    """What tells one state of a file from another. Nothing but a regular file is ever opened: a FIFO would wait."""
    try:
        state = os.stat(path)
    except (OSError, ValueError) as error:
        raise RobotError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(state.st_mode):
        raise RobotError(f"{path}: is no file that could hold a mesh")
    return str(path), state.st_mtime_ns, state.st_size


def _told(found: T | str) -> T:
    if isinstance(found, str):
        raise RobotError(found)
    return found


# What is wrong with a file is kept as text: a bad one is read once as well.


@lru_cache(maxsize=1024)
def _scaled(path: str, mtime: int, size: int, scale: Vector) -> tuple[Vector, ...] | str:
    try:
        return _solid(_told(_extremes(path, mtime, size)), scale, path)
    except RobotError as error:
        return str(error)


@lru_cache(maxsize=1024)
def _extremes(path: str, _mtime: int, size: int) -> Array | str:
    try:
        return _read(path, size)
    except RobotError as error:
        return str(error)


def _read(path: str, size: int) -> Array:
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in READERS:
        raise RobotError(f"{path}: is no mesh that is read; use a {', '.join(READERS)} file")
    reader, most = READERS[suffix]
    if size == 0:
        raise RobotError(f"{path}: is empty (0 bytes)")
    if size > most:
        raise RobotError(f"{path}: has {size / 1e6:.0f} MB, at most {most / 1e6:.0f} MB are read; simplify the mesh")
    try:
        with open(path, "rb") as file:
            if file.read(len(POINTER)) == POINTER:
                raise RobotError(f"{path}: is a Git LFS pointer and no mesh; run: git lfs pull")
            file.seek(0)
            return _farthest(reader(file, size, path), path)
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror}") from None


def _farthest(parts: Iterator[Array], place: str) -> Array:
    found = hulls.extremes(parts, place)
    if not len(found):
        raise RobotError(f"{place}: has no faces")
    return found


def _solid(points: Array, scale: Vector, place: str) -> tuple[Vector, ...]:
    return tuple(triple(point) for point in hulls.solid(points * scale, place))
