"""Wheels: on the ground, on their axles, and clear of the rest."""

import math
from collections.abc import Iterator
from itertools import combinations
from statistics import median_low

from holozen.check.finding import Mistake
from holozen.check.placed import Placed, along, dot, minus
from holozen.check.resting import Ground, stand
from holozen.check.subject import Subject
from holozen.check.wheels import Wheel, is_called_wheel
from holozen.robot.errors import RobotError
from holozen.robot.rigid import lump

ALIGNED = math.cos(math.radians(5))
LEAN = math.sin(math.radians(3))
SLACK = 0.1  # of a wheel's radius
LEAST = 0.002  # m


def wheel_collisions(subject: Subject) -> Iterator[Mistake]:
    """Wheels without a collision shape, on a robot that is meant to be simulated."""
    if subject.model is None or not any(link.collisions or link.inertial for link in subject.model.links.values()):
        return
    driven = {name for _, name in subject.plugin_joints}
    for name, joint in subject.model.joints.items():
        called = joint.kind == "continuous" and is_called_wheel(name, joint.child)
        if (called or name in driven) and not _solid(joint.child, subject):
            mend = "add a <collision> with a <cylinder> (a URDF cylinder stands along z)"
            yield Mistake(subject.links[joint.child], f"wheel {joint.child!r} has no <collision>", mend)


def wheel_axes(subject: Subject) -> Iterator[Mistake]:
    """Wheels that do not turn about their cylinder's axis."""
    for wheel in subject.wheels:
        if wheel.shape.shape.kind == "cylinder" and abs(dot(wheel.axis, wheel.shape.axes[2])) < ALIGNED:
            problem = f"joint {wheel.joint.name!r} turns about {_told(wheel.axis)}"
            problem += f", the cylinder of {wheel.joint.child!r} lies along {_told(wheel.shape.axes[2])}"
            mend = "turn the cylinder by its <origin rpy>, or set the joint's <axis>"
            yield Mistake(subject.joints[wheel.joint.name], problem, f"{mend} (directions in the root frame)")


def wheel_heights(subject: Subject) -> Iterator[Mistake]:
    """Wheels that are off the ground when the robot stands, or deeper than the others."""
    wheels = [wheel for wheel in subject.wheels if wheel.rolls and wheel.sure]
    ground = _ground(subject, wheels)
    if ground is None or all(_touches(wheel, ground) and _is_level(wheel, ground) for wheel in wheels):
        return
    bottoms = [wheel.bottom for wheel in wheels]
    middle = median_low(bottoms)
    odd = [wheel for wheel in wheels if abs(wheel.bottom - middle) > _slack(wheel)]
    for wheel in odd:
        way = "above" if wheel.bottom > middle else "below"
        problem = f"wheel {wheel.joint.child!r} is {_length(abs(wheel.bottom - middle))} {way} the other wheels"
        yield Mistake(subject.joints[wheel.joint.name], problem, "set the z of its joint's <origin>, or its radius")
    if not odd:
        yield from _off_ground(subject, wheels, ground)


def overlaps(subject: Subject) -> Iterator[Mistake]:
    """Wheels inside each other, or as a whole inside the body."""
    solid = [wheel for wheel in subject.wheels if wheel.shape.use == "collision" and not subject.guessed]
    for one, other in combinations(solid, 2):
        if _meet(one, other):
            problem = f"wheels {one.joint.child!r} and {other.joint.child!r} are inside each other"
            yield Mistake(subject.joints[other.joint.name], problem, "move one, or make them smaller")
    rest = [shape for shape in subject.placed if shape.use == "collision" and shape.shape.kind != "mesh"]
    links = {wheel.joint.child for wheel in subject.wheels}
    for wheel in solid:
        for shape in rest:
            if shape.link not in links and _swallows(shape, wheel):
                problem = f"wheel {wheel.joint.child!r} is inside the collision shape of {shape.link!r}"
                yield Mistake(subject.joints[wheel.joint.name], problem, "move the wheel out, or make the body smaller")
                break


def _solid(link: str, subject: Subject) -> bool:
    assert subject.model is not None
    fixed = [joint.child for joint in subject.model.joints.values() if joint.parent == link]
    return any(subject.model.links[name].collisions for name in (link, *fixed))


def _ground(subject: Subject, wheels: list[Wheel]) -> Ground | None:
    """The ground under the robot's collision shapes; a level one for a robot that balances."""
    solid = [shape for shape in subject.placed if shape.use == "collision"]
    if (
        subject.model is None
        or subject.guessed
        or not wheels
        or any(wheel.shape.use != "collision" for wheel in wheels)
    ):
        return None
    try:
        centre = lump(subject.model).centre
    except RobotError:
        return None
    ground = stand(solid, centre)
    lowest = min(shape.farthest((0.0, 0.0, -1.0))[2] for shape in solid)
    return Ground(0.0, 0.0, lowest, True) if ground.tips or not _stands(ground, wheels) else ground


def _stands(ground: Ground, wheels: list[Wheel]) -> bool:
    """Whether it stands on what it is meant to; a balancing robot that fell over does not."""
    return ground.up[2] > math.cos(math.radians(15)) or any(_touches(wheel, ground) for wheel in wheels[2:])


def _touches(wheel: Wheel, ground: Ground) -> bool:
    return ground.above(wheel.shape) <= _slack(wheel)


def _is_level(wheel: Wheel, ground: Ground) -> bool:
    """Whether its axle leans over the ground as it does in the file: a robot may stand nose up, but not on its side."""
    return abs(abs(dot(ground.up, wheel.axis)) - abs(wheel.axis[2])) < LEAN


def _off_ground(subject: Subject, wheels: list[Wheel], ground: Ground) -> Iterator[Mistake]:
    others = [s for s in subject.placed if s.use == "collision" and all(s.link != w.joint.child for w in wheels)]
    lowest = min(others, key=ground.above, default=None)
    under = f"; the robot stands on {lowest.link!r}" if lowest and ground.above(lowest) < LEAST else ""
    for wheel in wheels:
        if not _touches(wheel, ground):
            problem = f"wheel {wheel.joint.child!r} hangs {_length(ground.above(wheel.shape))} above the ground{under}"
            yield Mistake(subject.joints[wheel.joint.name], problem, "lower the wheel, or lift what stands below it")


def _meet(one: Wheel, other: Wheel) -> bool:
    away = minus(other.shape.centre, one.shape.centre)
    slack = _slack(one) + _slack(other)
    if abs(dot(one.axis, other.axis)) < ALIGNED:
        return math.hypot(*away) < slack
    side = abs(dot(away, one.axis))
    across = math.hypot(*along(away, one.axis, -dot(away, one.axis)))
    return side < _width(one) + _width(other) - LEAST and across < _radius(one) + _radius(other) - slack


def _swallows(shape: Placed, wheel: Wheel) -> bool:
    ends = [along(wheel.shape.centre, wheel.axis, side * _width(wheel)) for side in (-1, 1)]
    return all(shape.holds(end) for end in ends)


def _width(wheel: Wheel) -> float:
    """Half its width, from the centre along the axle."""
    return dot(minus(wheel.shape.farthest(wheel.axis), wheel.shape.centre), wheel.axis)


def _radius(wheel: Wheel) -> float:
    return max(dot(minus(wheel.shape.farthest(axis), wheel.shape.centre), axis) for axis in _across(wheel))


def _across(wheel: Wheel) -> list[tuple[float, float, float]]:
    return [axis for axis in wheel.shape.axes if abs(dot(axis, wheel.axis)) < 0.5] or list(wheel.shape.axes)


def _slack(wheel: Wheel) -> float:
    return max(LEAST, SLACK * _radius(wheel))


def _length(metres: float) -> str:
    return f"{metres * 1000:.0f} mm" if metres < 0.1 else f"{metres:.2f} m"


def _told(way: tuple[float, float, float]) -> str:
    return "(" + " ".join(f"{value + 0.0:.2g}" for value in (round(value, 3) for value in way)) + ")"
