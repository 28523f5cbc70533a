"""How hard it is to turn solid bodies of the shapes of links: moments of inertia by mass, kg m^2 a kg."""

from collections.abc import Iterable

import numpy as np

from holozen.robot.parts import Shape
from holozen.robot.rotation import Array
from holozen.robot.shapes import solid

LEAST = 64.0  # times a solid body's: a radius of gyration of an eighth, which for a cube is 1/20 of its edge

Placed = tuple[Shape, Array, Array]
"""A shape; its frame's position (3,) in metres, and rotation (3, 3) whose columns are the frame's axes."""


def moments(placed: Iterable[Placed]) -> Array | None:
    """The tensor (3, 3) in m^2 about the centre of all shapes, each solid and all of one density; None without any.

    A mesh or a hull counts as its bounding box. Planes, and meshes that were not found, do not count.
    """
    found = [part for shape, position, rotation in placed if (part := _part(solid(shape), position, rotation))]
    whole = sum(volume for volume, _, _ in found)
    if not found:
        return None
    centre = sum((volume * middle for volume, middle, _ in found), np.zeros(3)) / whole
    total = np.zeros((3, 3))
    for volume, middle, tensor in found:
        away = middle - centre
        total += volume / whole * (tensor + away @ away * np.eye(3) - np.outer(away, away))
    return total


def is_absurd(tensor: Array, mass: float, least: Array) -> bool:
    """Whether a tensor in kg m^2 is far below that of a solid body, `least` in m^2, about any of its axes."""
    given, own = np.linalg.eigvalsh(tensor), np.linalg.eigvalsh(least)
    return bool((given * LEAST < mass * own).any())


def _part(shape: Shape, position: Array, rotation: Array) -> tuple[float, Array, Array] | None:
    """Volume, centre and tensor of one shape."""
    middle, (x, y, z), volume = np.zeros(3), (0.0, 0.0, 0.0), 0.0
    if shape.kind == "box":
        x, y, z = (edge * edge / 12 for edge in shape.size)
        volume = float(np.prod(shape.size))
    elif shape.kind == "hull":
        low, high = np.min(shape.points, axis=0), np.max(shape.points, axis=0)
        middle, (x, y, z), volume = (low + high) / 2, (high - low) ** 2 / 12, float(np.prod(high - low))
    elif shape.kind == "cylinder":
        radius, length = shape.size
        x, y, z = radius * radius / 4, radius * radius / 4, length * length / 12
        volume = float(np.pi) * radius * radius * length
    elif shape.kind == "sphere":
        x = y = z = shape.size[0] ** 2 / 5
        volume = 4 / 3 * float(np.pi) * shape.size[0] ** 3
    if not volume:
        return None
    tensor = rotation @ np.diag([y + z, x + z, x + y]) @ rotation.T
    return volume, position + rotation @ middle, tensor
