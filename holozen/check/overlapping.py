"""Wheels inside each other, or inside the body."""

import math
from collections.abc import Iterator
from itertools import combinations

from holozen.check.finding import Mistake
from holozen.check.placed import Placed, along, dot, minus
from holozen.check.subject import Subject
from holozen.check.wheels import ALIGNED, LEAST, Wheel
from holozen.robot.tag import Vector

HIDDEN = 0.5  # of a wheel; less of it may well be in a box that stands for a body with wheel arches
STATIONS = (-0.8, -0.4, 0.0, 0.4, 0.8)  # of half the width
RINGS = tuple(math.sqrt((ring + 0.5) / 6) for ring in range(6))  # of the radius; each stands for the same area
SPOKES = tuple(spoke * math.pi / 6 for spoke in range(12))


def overlaps(subject: Subject) -> Iterator[Mistake]:
    """Wheels inside each other, and wheels of which more than half is inside one other link; all in one finding."""
    wheels = [wheel for wheel in subject.wheels if wheel.shape.use == "collision" and not subject.guessed]
    pairs = [(one, other) for one, other in combinations(wheels, 2) if _meet(one, other)]
    if pairs:
        told = ", ".join(f"{one.joint.child!r} and {other.joint.child!r}" for one, other in pairs)
        tag = subject.joints[pairs[0][1].joint.name]
        yield Mistake(tag, f"wheels {told} are inside each other", "move them apart, or make them smaller")
    links = {wheel.joint.child for wheel in subject.wheels}
    rest = [shape for shape in subject.placed if shape.use == "collision" and shape.shape.kind != "mesh"]
    for link in dict.fromkeys(shape.link for shape in rest if shape.link not in links):
        shapes = [shape for shape in rest if shape.link == link]
        hidden = [wheel for wheel in wheels if _inside(wheel, shapes) > HIDDEN]
        if hidden:
            told = ", ".join(repr(wheel.joint.child) for wheel in hidden)
            problem = f"more than half of {told} is inside the collision shape of {link!r}"
            yield Mistake(
                subject.joints[hidden[0].joint.name], problem, "move the wheels out, or make the body smaller"
            )


def _meet(one: Wheel, other: Wheel) -> bool:
    away = minus(other.shape.centre, one.shape.centre)
    slack = one.slack + other.slack
    if abs(dot(one.axis, other.axis)) < ALIGNED:
        return math.hypot(*away) < slack
    side = abs(dot(away, one.axis))
    across = math.hypot(*along(away, one.axis, -dot(away, one.axis)))
    return side < one.half_width + other.half_width - LEAST and across < one.radius + other.radius - slack


def _inside(wheel: Wheel, shapes: list[Placed]) -> float:
    """How much of a wheel is inside, from 0 to 1."""
    points = list(_points(wheel))
    return sum(any(shape.holds(point) for shape in shapes) for point in points) / len(points)


def _points(wheel: Wheel) -> Iterator[Vector]:
    """Points that fill a wheel evenly."""
    one = _across(wheel.axis)
    other = _cross(wheel.axis, one)
    for station in STATIONS:
        middle = along(wheel.shape.centre, wheel.axis, station * wheel.half_width)
        for ring in RINGS:
            far = ring * wheel.radius
            for spoke in SPOKES:
                yield along(along(middle, one, far * math.cos(spoke)), other, far * math.sin(spoke))


def _across(way: Vector) -> Vector:
    """A unit vector at right angles to another."""
    other = (0.0, 0.0, 1.0) if abs(way[2]) < 0.7 else (1.0, 0.0, 0.0)
    x, y, z = _cross(way, other)
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
