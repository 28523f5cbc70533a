"""Wavefront OBJ files -> the corners of their faces."""

from array import array
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from holozen.robot.errors import RobotError
from holozen.robot.rotation import Array

VERTEX = (b"v ", b"v\t")
FACE = (b"f ", b"f\t")


def read(file: BinaryIO, size: int, place: str) -> Iterator[Array]:
    """The vertices (n, 3) that faces use. Raises RobotError with the line."""
    vertices, used = array("d"), array("q")
    for number, line in enumerate(file, 1):
        try:
            if line.startswith(VERTEX):
                vertices.extend(_vertex(line.split()[1:4]))
            elif line.startswith(FACE):
                used.extend(_corners(line.split()[1:], len(vertices) // 3))
        except OverflowError:
            raise RobotError(f"{place}, line {number}: a face names a vertex that is not there") from None
        except ValueError as error:
            raise RobotError(f"{place}, line {number}: {str(error)[:200]}") from None
    if used:
        yield _chosen(np.array(vertices).reshape(-1, 3), np.array(used), place)


def _vertex(words: list[bytes]) -> tuple[float, ...]:
    values = tuple(map(float, words))
    if len(values) != 3:
        raise ValueError(f"a vertex with {len(values)} numbers instead of 3")
    return values


def _corners(words: list[bytes], count: int) -> list[int]:
    """Indexes from 0. The file counts from 1, or back from the newest vertex: -1."""
    numbers = [int(word.partition(b"/")[0]) for word in words]
    return [number - 1 if number > 0 else count + number for number in numbers]


def _chosen(vertices: Array, used: npt.NDArray[np.int64], place: str) -> Array:
    low, high = int(used.min()), int(used.max())
    if low < 0 or high >= len(vertices):
        raise RobotError(f"{place}: a face names vertex {(low if low < 0 else high) + 1} of {len(vertices)}")
    chosen = np.zeros(len(vertices), bool)
    chosen[used] = True
    return vertices[chosen]
