"""Wheels: on the ground, on their axles, and carrying the robot."""

import math
from collections.abc import Iterator
from statistics import median_low

from holozen.check.finding import Mistake
from holozen.check.inertias import groups
from holozen.check.placed import Placed, dot
from holozen.check.resting import Ground, stand
from holozen.check.subject import Subject
from holozen.check.wheels import ALIGNED, LEAST, Wheel, is_called_caster, is_called_wheel
from holozen.robot.drives import Planar
from holozen.robot.errors import RobotError
from holozen.robot.parts import Link
from holozen.robot.rigid import lump
from holozen.robot.tag import Vector

LEAN = math.sin(math.radians(3))
TOUCHING = 0.0005  # m
SAME = math.cos(math.radians(0.5))
ROUGH = 0.2  # friction of a part that drags


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
    odd = [wheel for wheel in wheels if abs(wheel.bottom - middle) > wheel.slack]
    for wheel in odd:
        way = "above" if wheel.bottom > middle else "below"
        problem = f"wheel {wheel.joint.child!r} is {_length(abs(wheel.bottom - middle))} {way} the other wheels"
        yield Mistake(subject.joints[wheel.joint.name], problem, "set the z of its joint's <origin>, or its radius")
    if not odd:
        yield from _off_ground(subject, wheels, ground)


def dragging(subject: Subject) -> Iterator[Mistake]:
    """Parts of the body that touch the ground beside wheels that would carry it, or in place of wheels."""
    wheels = [wheel for wheel in subject.wheels if wheel.rolls and wheel.sure]
    ground = _ground(subject, wheels)
    centre = _centre(subject)
    if not (ground and centre) or _slides(subject) or next(wheel_heights(subject), None):
        return
    rough = [shape for shape in _body(subject) if ground.above(shape) < TOUCHING]
    if rough and (_carries(rough, wheels, centre) or not _needs(rough, subject, centre, ground)):
        lowest = min(rough, key=lambda shape: shape.farthest((0.0, 0.0, -1.0))[2])
        problem = f"the collision shape of {lowest.link!r} is as low as the wheels and stands on the ground beside them"
        mend = "lower the wheels or make them larger, or give a part that has to slide friction (mu1, mu2) 0"
        yield Mistake(subject.links[lowest.link], problem, mend)


def _slides(subject: Subject) -> bool:
    """Whether the wheels are only seen, and the drive moves the whole robot."""
    assert subject.model is not None
    return subject.model.drive is not None and isinstance(subject.model.drive.mechanism, Planar)


def _body(subject: Subject) -> list[Placed]:
    """The collision shapes that neither turn, nor are round, smooth or called a caster."""
    assert subject.model is not None
    body = next(group for group in groups(subject) if subject.model.root in group)
    joints = {joint.child: joint.name for joint in subject.model.joints.values()}
    smooth = [name for name in body if _friction(subject.model.links[name]) < ROUGH]
    smooth += [name for name in body if is_called_caster(name, joints.get(name, ""))]
    solid = [shape for shape in subject.placed if shape.use == "collision" and shape.link in body]
    return [shape for shape in solid if shape.shape.kind != "sphere" and shape.link not in smooth]


def _friction(link: Link) -> float:
    mu1, mu2 = link.surface.mu1, link.surface.mu2
    return min(1.0 if mu1 is None else mu1, 1.0 if mu2 is None else mu2)


def _carries(rough: list[Placed], wheels: list[Wheel], centre: Vector) -> bool:
    """Whether the robot stands on these parts alone, and its wheels reach no deeper."""
    ground = stand(rough, centre)
    return not ground.tips and all(ground.above(wheel.shape) > -TOUCHING for wheel in wheels)


def _needs(rough: list[Placed], subject: Subject, centre: Vector, ground: Ground) -> bool:
    """Whether the robot tips or leans without these parts."""
    others = [shape for shape in subject.placed if shape.use == "collision" and shape not in rough]
    if not others:
        return True
    without = stand(others, centre)
    return without.tips or dot(without.up, ground.up) < SAME


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
    centre = _centre(subject)
    if centre is None:
        return None
    ground = stand(solid, centre)
    lowest = min(shape.farthest((0.0, 0.0, -1.0))[2] for shape in solid)
    return Ground(0.0, 0.0, lowest, True) if ground.tips or not _stands(ground, wheels) else ground


def _centre(subject: Subject) -> Vector | None:
    """The centre of mass in the root frame; None for a robot without mass."""
    try:
        return lump(subject.model).centre if subject.model else None
    except RobotError:
        return None


def _stands(ground: Ground, wheels: list[Wheel]) -> bool:
    """Whether it stands on what it is meant to; a balancing robot that fell over does not."""
    return ground.up[2] > math.cos(math.radians(15)) or any(_touches(wheel, ground) for wheel in wheels[2:])


def _touches(wheel: Wheel, ground: Ground) -> bool:
    return ground.above(wheel.shape) <= wheel.slack


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


def _length(metres: float) -> str:
    return f"{metres * 1000:.0f} mm" if metres < 0.1 else f"{metres:.2f} m"


def _told(way: tuple[float, float, float]) -> str:
    return "(" + " ".join(f"{value + 0.0:.2g}" for value in (round(value, 3) for value in way)) + ")"
