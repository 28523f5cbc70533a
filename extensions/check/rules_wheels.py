"""Wheels: on the ground, on their axles, carrying the robot, clear of other parts, and as the drive
plugin says.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from statistics import fmean, median_low

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from holozen.check.geometry import (
    ALIGNED,
    DOWN,
    LEAST,
    UP,
    Placed,
    Wheel,
    body_of,
    is_called_caster,
    is_called_wheel,
)
from holozen.check.mistake import Mistake
from holozen.check.rule import rule
from holozen.check.rules_meshes import too_large
from holozen.check.subject import Subject
from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Tag
from holozen.robot.model import Differential, Link, Mecanum, Planar, Vector
from holozen.robot.rigid import joint_axes, link_frames, lump
from holozen.robot.rotation import Array, triple

# How a robot rests on level ground under its weight.


EIGHTHS = [eighth * math.pi / 4 for eighth in range(8)]
STEEPEST = math.tan(math.radians(20))  # a robot that leans more falls or balances
ROUNDS = 40


class Ground(Struct, frozen=True):
    """The plane z = a x + b y + c of the ground in the root frame, in metres; `tips`: the robot
    leans by more than 20 degrees on it.
    """

    a: float
    b: float
    c: float
    tips: bool

    @property
    def up(self) -> Array:
        """The unit normal."""
        return np.array((-self.a, -self.b, 1.0)) / math.hypot(self.a, self.b, 1.0)

    def above(self, shape: Placed) -> float:
        """The height in metres of the lowest point of a shape above the ground."""
        return float(self.up @ shape.farthest(-self.up) - self.c * self.up[2])


def stand(shapes: Sequence[Placed], centre: Vector) -> Ground:
    """The level ground on which shapes rest, at least one, whose centre of mass is `centre`.

    Of all planes below the shapes it is the highest under the centre of mass: the body rests where
    its centre of mass is lowest. Found by cutting planes: solve for some points, add the deepest
    point below that plane, and repeat.
    """
    far = 1e3 * max(1.0, *(float(np.abs(shape.centre).max()) for shape in shapes))
    rim = [
        (far * math.cos(turn), far * math.sin(turn), _lowest(shapes) + far * STEEPEST)
        for turn in EIGHTHS
    ]
    points = np.array(rim)
    for _ in range(ROUNDS):
        (a, b, c), touched = _highest(points, np.array(centre))
        ground = Ground(a, b, c, bool((touched < len(rim)).any()))
        deepest = min(shapes, key=ground.above)
        if ground.above(deepest) > -1e-6:
            break
        points = np.vstack([points, deepest.farthest(-ground.up)])
    return ground


def _lowest(shapes: Iterable[Placed]) -> float:
    return float(min(shape.farthest(DOWN)[2] for shape in shapes))


def _highest(points: Array, centre: Array) -> tuple[Vector, npt.NDArray[np.intp]]:
    """The plane below all points (n, 3) that is highest at the centre, as a, b, c of z = a x + b y
    + c, and the indices of the three points on it.
    """
    trios = np.array(list(combinations(range(len(points)), 3)))
    level = np.c_[points[:, :2], np.ones(len(points))]
    # the others lie in a vertical plane
    trios = trios[np.abs(np.linalg.det(level[trios])) >= 1e-12]
    planes = np.linalg.solve(level[trios], points[trios][:, :, 2:])[:, :, 0]
    gaps = points[:, 2] - planes @ level.T
    below = (gaps > -1e-7 * (1 + np.abs(points[:, :2]).sum(axis=1))).all(axis=1)
    heights = np.where(below, planes @ (centre[0], centre[1], 1.0), -np.inf)
    best = heights.argmax()
    return triple(planes[best]), trios[best]


# Wheels and the ground.


LEAN = math.sin(math.radians(3))
TOUCHING = 0.0005  # m
LEVEL = 0.0003  # m; a caster that is higher leaves the load to the wheels
SAME = math.cos(math.radians(0.5))
ROUGH = 0.2  # friction of a part that drags


@rule("wheel-collision", "error", "a wheel without collision shape", "it sinks into the floor")
def _wheel_collisions(subject: Subject) -> Iterator[Mistake]:
    """Only on robots with any collision shape or mass."""
    if subject.model is None or not any(
        link.collisions or link.inertial for link in subject.model.links.values()
    ):
        return
    driven = {name for _, name in subject.plugin_joints}
    for name, joint in subject.model.joints.items():
        called = joint.kind == "continuous" and is_called_wheel(name, joint.child)
        if (called or name in driven) and not _touching(joint.child, subject):
            fix = "add a <collision> with a <cylinder> (a URDF cylinder stands along z)"
            yield Mistake(
                subject.links[joint.child], f"wheel {joint.child!r} has no <collision>", fix
            )


@rule(
    "wheel-axis",
    "error",
    "a wheel that does not turn about its cylinder's axis",
    "it tumbles instead of rolling",
)
def _wheel_axes(subject: Subject) -> Iterator[Mistake]:
    for wheel in subject.wheels:
        along = wheel.shape.frame.rotation[:, 2]
        if wheel.shape.shape.kind == "cylinder" and abs(wheel.axis @ along) < ALIGNED:
            problem = f"joint {wheel.joint.name!r} turns about {_direction(wheel.axis)}"
            problem += f", the cylinder of {wheel.joint.child!r} lies along {_direction(along)}"
            fix = "turn the cylinder by its <origin rpy>, or set the joint's <axis>"
            yield Mistake(
                subject.joints[wheel.joint.name], problem, f"{fix} (directions in the root frame)"
            )


@rule(
    "wheel-height",
    "warning",
    "a wheel above the ground, or lower than the others",
    "it does not drive, or the robot leans",
)
def _wheel_heights(subject: Subject) -> Iterator[Mistake]:
    """Off the ground when the robot rests, or higher or lower than the others."""
    wheels = [wheel for wheel in subject.wheels if wheel.rolls and wheel.sure]
    ground = _ground(subject, wheels)
    if ground is None or all(
        _touches(wheel, ground) and _is_level(wheel, ground) for wheel in wheels
    ):
        return
    bottoms = [wheel.bottom for wheel in wheels]
    middle = median_low(bottoms)
    odd = [wheel for wheel in wheels if abs(wheel.bottom - middle) > wheel.slack]
    for wheel in odd:
        way = "above" if wheel.bottom > middle else "below"
        problem = (
            f"wheel {wheel.joint.child!r} is {_length(abs(wheel.bottom - middle))} {way} "
            "the other wheels"
        )
        yield Mistake(
            subject.joints[wheel.joint.name],
            problem,
            "set the z of its joint's <origin>, or its radius",
        )
    if not odd:
        yield from _off_ground(subject, wheels, ground)


@rule(
    "wheel-load",
    "warning",
    "a part of the body that is as low as the wheels",
    "it drags on the ground, and the wheels slip",
)
def _dragging(subject: Subject) -> Iterator[Mistake]:
    """A part that touches the ground next to wheels that would carry the robot, or instead of
    wheels.
    """
    wheels = [wheel for wheel in subject.wheels if wheel.rolls and wheel.sure]
    ground = _ground(subject, wheels)
    centre = _centre(subject)
    if not (ground and centre) or _slides(subject) or any(_wheel_heights.find(subject)):
        return
    if caster := _level_caster(subject, ground):
        problem = (
            f"the caster {caster!r} and the one opposite are as low as the two wheels, and "
            "carry some of their load"
        )
        yield Mistake(
            subject.links[caster],
            problem,
            "raise the casters by 0.5 mm, or give them friction (mu1, mu2) 0",
        )
        return
    rough = [shape for shape in _body(subject) if ground.above(shape) < TOUCHING]
    if rough and (_carries(rough, wheels, centre) or not _needs(rough, subject, centre, ground)):
        lowest = min(rough, key=lambda shape: shape.farthest(DOWN)[2])
        problem = (
            f"the collision shape of {lowest.link!r} is as low as the wheels and touches the ground"
        )
        fix = (
            "lower the wheels or make them larger, or give a part that is meant to slide "
            "friction (mu1, mu2) 0"
        )
        yield Mistake(subject.links[lowest.link], problem, fix)


def _level_caster(subject: Subject, ground: Ground) -> str:
    """The first of two casters, before and behind a differential drive's two wheels, that touch the
    ground with friction; empty without two. One caster carries what the wheels do not; with two the
    body rests on four points.
    """
    model, drive = subject.loaded, subject.loaded.drive
    if (
        drive is None
        or not isinstance(drive.mechanism, Differential)
        or len(drive.mechanism.left) > 1
    ):
        return ""
    body, axle = body_of(model.root, model), joint_axes(model)[drive.mechanism.left[0]].xyz[0]
    touching = [
        shape
        for shape in subject.placed
        if shape.use == "collision"
        and shape.link in body
        and shape.shape.kind == "sphere"
        and ground.above(shape) < LEVEL
        and _friction(model.links[shape.link]) >= ROUGH
    ]
    ahead = [shape.centre[0] > axle for shape in touching]
    return touching[0].link if any(ahead) and not all(ahead) else ""


def _slides(subject: Subject) -> bool:
    """Whether the drive moves the robot as a whole, so that its wheels carry nothing."""
    drive = subject.loaded.drive
    return drive is not None and isinstance(drive.mechanism, Planar)


def _body(subject: Subject) -> list[Placed]:
    """The collision shapes of the root's body that would drag: not spheres, nor smooth parts, nor
    casters.
    """
    model = subject.loaded
    body = body_of(model.root, model)
    joints = {joint.child: joint.name for joint in model.joints.values()}
    smooth = [name for name in body if _friction(model.links[name]) < ROUGH]
    smooth += [name for name in body if is_called_caster(name, joints.get(name, ""))]
    solid = [shape for shape in subject.placed if shape.use == "collision" and shape.link in body]
    return [shape for shape in solid if shape.shape.kind != "sphere" and shape.link not in smooth]


def _friction(link: Link) -> float:
    mu1, mu2 = link.surface.mu1, link.surface.mu2
    return min(1.0 if mu1 is None else mu1, 1.0 if mu2 is None else mu2)


def _carries(rough: list[Placed], wheels: list[Wheel], centre: Vector) -> bool:
    """Whether the robot can rest on these parts alone, with its wheels no lower."""
    ground = stand(rough, centre)
    return not ground.tips and all(ground.above(wheel.shape) > -TOUCHING for wheel in wheels)


def _needs(rough: list[Placed], subject: Subject, centre: Vector, ground: Ground) -> bool:
    """Whether the robot tips or leans without these parts."""
    others = [shape for shape in subject.placed if shape.use == "collision" and shape not in rough]
    if not others:
        return True
    without = stand(others, centre)
    return without.tips or bool(without.up @ ground.up < SAME)


def _touching(wheel: str, subject: Subject) -> bool:
    """Whether a wheel or one of its rollers has a collision shape."""
    model = subject.loaded
    rollers = [joint.child for joint in model.joints.values() if joint.parent == wheel]
    return any(
        model.links[name].collisions for link in (wheel, *rollers) for name in body_of(link, model)
    )


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
    return (
        Ground(0.0, 0.0, _lowest(solid), True)
        if ground.tips or not _stands(ground, wheels)
        else ground
    )


def _centre(subject: Subject) -> Vector | None:
    """The centre of mass in the root frame; None for a robot without mass."""
    try:
        return lump(subject.model).centre if subject.model else None
    except RobotError:
        return None


def _stands(ground: Ground, wheels: list[Wheel]) -> bool:
    """Whether the robot rests on its intended parts; a balancing robot that fell over does not."""
    return ground.up[2] > math.cos(math.radians(15)) or any(
        _touches(wheel, ground) for wheel in wheels[2:]
    )


def _touches(wheel: Wheel, ground: Ground) -> bool:
    return ground.above(wheel.shape) <= wheel.slack


def _is_level(wheel: Wheel, ground: Ground) -> bool:
    """Whether a wheel's axle leans no more than in the file: a robot may rest nose up, but not on
    its side.
    """
    return bool(abs(abs(ground.up @ wheel.axis) - abs(wheel.axis[2])) < LEAN)


def _off_ground(subject: Subject, wheels: list[Wheel], ground: Ground) -> Iterator[Mistake]:
    others = [
        s
        for s in subject.placed
        if s.use == "collision" and all(s.link not in w.links for w in wheels)
    ]
    lowest = min(others, key=ground.above, default=None)
    under = (
        f"; the robot stands on {lowest.link!r}" if lowest and ground.above(lowest) < LEAST else ""
    )
    for wheel in wheels:
        if not _touches(wheel, ground):
            problem = (
                f"wheel {wheel.joint.child!r} hangs {_length(ground.above(wheel.shape))} "
                f"above the ground{under}"
            )
            yield Mistake(
                subject.joints[wheel.joint.name],
                problem,
                "lower the wheel, or lift what stands below it",
            )


def _length(metres: float) -> str:
    return f"{metres * 1000:.0f} mm" if metres < 0.1 else f"{metres:.2f} m"


def _direction(way: Array) -> str:
    return (
        "(" + " ".join(f"{value + 0.0:.2g}" for value in (round(value, 3) for value in way)) + ")"
    )


# Wheels inside each other, or inside the body.


HIDDEN = 0.5  # of a wheel; less may be inside a box that approximates a body with wheel arches
STATIONS = (-0.8, -0.4, 0.0, 0.4, 0.8)  # of half the width
RINGS = np.sqrt((np.arange(6) + 0.5) / 6)  # of the radius; each represents the same area
SPOKES = np.arange(12) * math.pi / 6


@rule(
    "overlap",
    "warning",
    "a wheel inside another, or more than half of it inside the body",
    "impossible on a real robot",
)
def _overlaps(subject: Subject) -> Iterator[Mistake]:
    """Wheels inside each other, in one finding; and wheels of which more than half is inside one
    other link.
    """
    wheels = [
        wheel for wheel in subject.wheels if wheel.shape.use == "collision" and not subject.guessed
    ]
    pairs = [(one, other) for one, other in combinations(wheels, 2) if _meet(one, other)]
    if pairs:
        names = ", ".join(f"{one.joint.child!r} and {other.joint.child!r}" for one, other in pairs)
        tag = subject.joints[pairs[0][1].joint.name]
        yield Mistake(
            tag, f"wheels {names} are inside each other", "move them apart, or make them smaller"
        )
    links = {link for wheel in subject.wheels for link in wheel.links}
    rest = [
        shape for shape in subject.placed if shape.use == "collision" and shape.shape.kind != "mesh"
    ]
    for link in dict.fromkeys(shape.link for shape in rest if shape.link not in links):
        shapes = [shape for shape in rest if shape.link == link]
        hidden = [wheel for wheel in wheels if _inside(wheel, shapes) > HIDDEN]
        if hidden:
            names = ", ".join(repr(wheel.joint.child) for wheel in hidden)
            problem = f"more than half of {names} is inside the collision shape of {link!r}"
            yield Mistake(
                subject.joints[hidden[0].joint.name],
                problem,
                "move the wheels out, or make the body smaller",
            )


def _meet(one: Wheel, other: Wheel) -> bool:
    away = other.shape.centre - one.shape.centre
    slack = one.slack + other.slack
    if abs(one.axis @ other.axis) < ALIGNED:
        return math.hypot(*away) < slack
    side = abs(float(away @ one.axis))
    across = math.hypot(*(away - away @ one.axis * one.axis))
    return (
        side < one.half_width + other.half_width - LEAST
        and across < one.radius + other.radius - slack
    )


def _inside(wheel: Wheel, shapes: list[Placed]) -> float:
    """The fraction of a wheel that is inside shapes, from 0 to 1."""
    points = _points(wheel)
    return float(np.any([shape.holds(points) for shape in shapes], axis=0).mean())


def _points(wheel: Wheel) -> Array:
    """Points (n, 3) that fill a wheel evenly."""
    one = np.cross(wheel.axis, UP if abs(wheel.axis[2]) < 0.7 else (1.0, 0.0, 0.0))
    one /= np.linalg.norm(one)
    axes = np.stack(
        [
            wheel.axis * wheel.half_width,
            one * wheel.radius,
            np.cross(wheel.axis, one) * wheel.radius,
        ]
    )
    station, ring, spoke = (part.ravel() for part in np.meshgrid(STATIONS, RINGS, SPOKES))
    return (
        wheel.shape.centre
        + np.stack([station, ring * np.cos(spoke), ring * np.sin(spoke)], axis=1) @ axes
    )


# The dimensions of the drive plugin, and those of the robot.


OFF = 0.2  # of the robot's own dimension
SKID = 2.5  # times the robot's own: a skid-steer is deliberately given a larger one
ACROSS = 0.01  # m; minimum offset to the wrong side
Wheels = Differential | Mecanum


@rule(
    "wheel-side",
    "error",
    "a left wheel on the right side, or the other way round",
    "it turns the wrong way: the plugin's tags define the sides",
)
def _sides(subject: Subject) -> Iterator[Mistake]:
    drive = _driven(subject)
    if drive is None or not _level(drive, subject):
        return
    places = {name: _lateral(name, subject)[0] for name in (*drive.left, *drive.right)}
    middle = fmean(places.values())
    wrong = [name for name in drive.left if places[name] < middle - ACROSS]
    wrong += [name for name in drive.right if places[name] > middle + ACROSS]
    if wrong:
        own = {name: "left" if name in drive.left else "right" for name in wrong}
        names = ", ".join(
            f"{name!r} (a {side} joint, at y={places[name]:.3g} m)" for name, side in own.items()
        )
        at = next(
            (tag for tag, name in subject.plugin_joints if name == wrong[0]),
            subject.joints[wrong[0]],
        )
        yield Mistake(
            at, f"on the opposite side of its tag: {names}; left is where y is larger", "swap them"
        )


@rule(
    "wheel-forward",
    "warning",
    "a wheel whose axis points to the right",
    "Gazebo turns it backwards",
)
def _backward(subject: Subject) -> Iterator[Mistake]:
    """Here a wheel drives forward whatever its sign."""
    drive = _driven(subject)
    axes = joint_axes(subject.loaded) if drive else {}
    for name in (*drive.left, *drive.right) if drive and _level(drive, subject) else ():
        if axes[name].direction[1] < 0:
            way = _direction(np.array(axes[name].direction))
            problem = f"joint {name!r} turns about {way}; forward is about (0 1 0)"
            yield Mistake(
                subject.joints[name], problem, "negate its <axis> (directions in the root frame)"
            )


@rule(
    "wheel-measure",
    "warning",
    "a plugin's wheel separation or diameter that differs by 20 % from the robot's",
    "it turns or drives faster or slower than commanded",
)
def _measures(subject: Subject) -> Iterator[Mistake]:
    """Without advice to copy a measure that is wrong itself: of wheels on the wrong sides, or in
    millimetres.
    """
    drive = _driven(subject)
    if drive is None or too_large(subject):
        return
    tag = _tag(subject, "wheelseparation")
    found = _separations(drive, subject)
    if (
        drive.separation
        and tag
        and _level(drive, subject)
        and found[0] > ACROSS
        and not any(_sides.find(subject))
    ):
        most = SKID if len(drive.left) > 1 else 1 + OFF
        if not any(1 - OFF <= drive.separation / one <= most for one in found if one > 0):
            problem = (
                f"<{tag.name}> is {drive.separation:.3g} m, and the wheels are "
                f"{found[0]:.3g} m apart"
            )
            yield Mistake(tag, problem, f"write {found[0]:.3g}")
    tag = _tag(subject, "wheeldiameter", "wheelradius")
    radii = _radii(drive.left[0], subject)
    if (
        drive.radius
        and tag
        and radii
        and all(abs(drive.radius / radius - 1) > OFF for radius in radii)
    ):
        twice = 2 if "diameter" in tag.name.lower() else 1
        child = _child(drive.left[0], subject)
        problem = (
            f"<{tag.name}> is {drive.radius * twice:.3g} m, and that of {child!r} is "
            f"{radii[0] * twice:.3g} m"
        )
        yield Mistake(tag, problem, f"write {radii[0] * twice:.3g}")


def _driven(subject: Subject) -> Wheels | None:
    mechanism = subject.model.drive.mechanism if subject.model and subject.model.drive else None
    return mechanism if isinstance(mechanism, Wheels) else None


def _level(drive: Wheels, subject: Subject) -> bool:
    """Whether the axles lie along y: a robot that drives along another axis has other sides."""
    axes = joint_axes(subject.loaded)
    return all(abs(axes[name].direction[1]) > 0.9 for name in (*drive.left, *drive.right))


def _separations(drive: Wheels, subject: Subject) -> list[float]:
    """The distances in metres between the left and the right wheels: by their shapes, and by their
    joints.
    """
    left, right = (
        [_lateral(name, subject) for name in names] for names in (drive.left, drive.right)
    )
    return [
        abs(fmean(a) - fmean(b))
        for a, b in zip(zip(*left, strict=True), zip(*right, strict=True), strict=True)
    ]


def _lateral(joint: str, subject: Subject) -> tuple[float, float]:
    """y in metres, in the root frame, of a wheel's shape and of its joint."""
    origin = link_frames(subject.loaded)[_child(joint, subject)].xyz[1]
    shapes = _shapes(joint, subject)
    return (float(shapes[0].centre[1]) if shapes else origin), origin


def _radii(joint: str, subject: Subject) -> list[float]:
    round_shapes = [
        shape for shape in _shapes(joint, subject) if shape.shape.kind in ("cylinder", "sphere")
    ]
    return [float(shape.half[0]) for shape in round_shapes]


def _shapes(joint: str, subject: Subject) -> list[Placed]:
    """The shapes of a wheel, collision shapes first."""
    body = body_of(_child(joint, subject), subject.loaded)
    own = [shape for shape in subject.placed if shape.link in body]
    return sorted(own, key=lambda shape: shape.use)


def _child(joint: str, subject: Subject) -> str:
    return subject.loaded.joints[joint].child


def _tag(subject: Subject, *names: str) -> Tag | None:
    """The first setting of the drive plugin with one of these names, in lower case and without
    underscores.
    """
    tags = [tag for plugin in subject.drives[:1] for tag in plugin.children]
    return next((tag for tag in tags if tag.name.lower().replace("_", "") in names), None)
