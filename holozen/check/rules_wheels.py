"""Wheels: on the ground, on their axles, carrying the robot, clear of other parts, and as configured in the drive."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import fmean, median_low

from holozen.check.engine import Mistake, Subject, rule
from holozen.check.geometry import (
    ALIGNED,
    LEAST,
    Placed,
    Wheel,
    along,
    dot,
    fixed_bodies,
    is_called_caster,
    is_called_wheel,
    minus,
)
from holozen.robot.elements import Tag, Vector
from holozen.robot.errors import RobotError
from holozen.robot.gazebo_plugins import DRIVES, kind_of
from holozen.robot.model import Differential, Link, Mecanum, Planar
from holozen.robot.rigid import joint_axes, link_frames, lump

# How a robot rests on level ground under its weight.


STEEPEST = math.tan(math.radians(20))  # a robot that leans more falls or balances
ROUNDS = 40


@dataclass(frozen=True, slots=True)
class Ground:
    """The plane z = a x + b y + c of the ground in the root frame; `tips`: the robot leans by more than
    20 degrees.
    """

    a: float
    b: float
    c: float
    tips: bool

    @property
    def up(self) -> Vector:
        """The unit normal."""
        length = math.hypot(self.a, self.b, 1.0)
        return -self.a / length, -self.b / length, 1 / length

    def above(self, shape: Placed) -> float:
        """The height of a shape above the ground, metres."""
        x, y, z = self.up
        lowest = shape.farthest((-x, -y, -z))
        return dot(self.up, lowest) - self.c * z


def stand(shapes: Sequence[Placed], centre: Vector) -> Ground:
    """The ground under shapes whose centre of mass is `centre`.

    Of all planes below the shapes it is the one that is highest under the centre of mass: there the weight is lowest.
    Found by cutting planes: solve for some points, add the shape's lowest point below the plane, and repeat. `shapes`
    must not be empty.
    """
    low = min(shape.farthest((0.0, 0.0, -1.0))[2] for shape in shapes)
    far = 1e3 * max(1.0, *(abs(value) for shape in shapes for value in shape.centre))
    rim = [_rim(low, far, eighth * math.pi / 4) for eighth in range(8)]
    points = list(rim)
    for _ in range(ROUNDS):
        a, b, c, touched = _highest(points, centre)
        ground = Ground(a, b, c, any(points[i] in rim for i in touched))
        deepest = min(shapes, key=ground.above)
        if ground.above(deepest) > -1e-6:
            break
        x, y, z = ground.up
        points.append(deepest.farthest((-x, -y, -z)))
    return ground


def _rim(low: float, far: float, angle: float) -> Vector:
    return far * math.cos(angle), far * math.sin(angle), low + far * STEEPEST


def _highest(points: Sequence[Vector], centre: Vector) -> tuple[float, float, float, tuple[int, ...]]:
    """The plane below all points that is highest at the centre, and the three points that it goes through."""
    best = (-math.inf, (0.0, 0.0, min(point[2] for point in points)), (0,))
    for trio in combinations(range(len(points)), 3):
        plane = _through(*(points[i] for i in trio))
        if plane is None:
            continue
        a, b, c = plane
        height = a * centre[0] + b * centre[1] + c
        if height > best[0] and all(z - (a * x + b * y + c) > -1e-7 * (1 + abs(x) + abs(y)) for x, y, z in points):
            best = height, plane, trio  # type: ignore[assignment]
    return *best[1], best[2]


def _through(p: Vector, q: Vector, r: Vector) -> Vector | None:
    """a, b, c of z = a x + b y + c through three points; None for an upright plane or three points in line."""
    ux, uy, uz = (q[i] - p[i] for i in range(3))
    vx, vy, vz = (r[i] - p[i] for i in range(3))
    area = ux * vy - uy * vx
    if abs(area) < 1e-12:
        return None
    a, b = (uz * vy - uy * vz) / area, (ux * vz - uz * vx) / area
    return a, b, p[2] - a * p[0] - b * p[1]


# Wheels and the ground.


LEAN = math.sin(math.radians(3))
TOUCHING = 0.0005  # m
SAME = math.cos(math.radians(0.5))
ROUGH = 0.2  # friction of a part that drags


@rule("wheel-collision", "error", "a wheel without collision shape", "it sinks into the floor")
def wheel_collisions(subject: Subject) -> Iterator[Mistake]:
    """Wheels without a collision shape, on a robot meant to be simulated."""
    if subject.model is None or not any(link.collisions or link.inertial for link in subject.model.links.values()):
        return
    driven = {name for _, name in subject.plugin_joints}
    for name, joint in subject.model.joints.items():
        called = joint.kind == "continuous" and is_called_wheel(name, joint.child)
        if (called or name in driven) and not _touching(joint.child, subject):
            fix = "add a <collision> with a <cylinder> (a URDF cylinder stands along z)"
            yield Mistake(subject.links[joint.child], f"wheel {joint.child!r} has no <collision>", fix)


@rule("wheel-axis", "error", "a wheel that does not turn about its cylinder's axis", "it tumbles instead of rolling")
def wheel_axes(subject: Subject) -> Iterator[Mistake]:
    """Wheels that do not turn about their cylinder's axis."""
    for wheel in subject.wheels:
        if wheel.shape.shape.kind == "cylinder" and abs(dot(wheel.axis, wheel.shape.axes[2])) < ALIGNED:
            problem = f"joint {wheel.joint.name!r} turns about {_direction(wheel.axis)}"
            problem += f", the cylinder of {wheel.joint.child!r} lies along {_direction(wheel.shape.axes[2])}"
            fix = "turn the cylinder by its <origin rpy>, or set the joint's <axis>"
            yield Mistake(subject.joints[wheel.joint.name], problem, f"{fix} (directions in the root frame)")


@rule(
    "wheel-height",
    "warning",
    "a wheel above the ground, or lower than the others",
    "it does not drive, or the robot leans",
)
def wheel_heights(subject: Subject) -> Iterator[Mistake]:
    """Wheels off the ground when the robot rests, or lower than the others."""
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


@rule(
    "wheel-load",
    "warning",
    "a part of the body that is as low as the wheels",
    "it drags on the ground, and the wheels slip",
)
def dragging(subject: Subject) -> Iterator[Mistake]:
    """Parts of the body that touch the ground next to wheels that would carry it, or instead of wheels."""
    wheels = [wheel for wheel in subject.wheels if wheel.rolls and wheel.sure]
    ground = _ground(subject, wheels)
    centre = _centre(subject)
    if not (ground and centre) or _slides(subject) or any(wheel_heights.find(subject)):
        return
    rough = [shape for shape in _body(subject) if ground.above(shape) < TOUCHING]
    if rough and (_carries(rough, wheels, centre) or not _needs(rough, subject, centre, ground)):
        lowest = min(rough, key=lambda shape: shape.farthest((0.0, 0.0, -1.0))[2])
        problem = f"the collision shape of {lowest.link!r} is as low as the wheels and touches the ground"
        fix = "lower the wheels or make them larger, or give a part that is meant to slide friction (mu1, mu2) 0"
        yield Mistake(subject.links[lowest.link], problem, fix)


def _slides(subject: Subject) -> bool:
    """Whether the wheels are only visual, and the drive moves the whole robot."""
    assert subject.model is not None
    return subject.model.drive is not None and isinstance(subject.model.drive.mechanism, Planar)


def _body(subject: Subject) -> list[Placed]:
    """The collision shapes that neither turn, nor are round, smooth or called a caster."""
    assert subject.model is not None
    body = next(group for group in fixed_bodies(subject.model) if subject.model.root in group)
    joints = {joint.child: joint.name for joint in subject.model.joints.values()}
    smooth = [name for name in body if _friction(subject.model.links[name]) < ROUGH]
    smooth += [name for name in body if is_called_caster(name, joints.get(name, ""))]
    solid = [shape for shape in subject.placed if shape.use == "collision" and shape.link in body]
    return [shape for shape in solid if shape.shape.kind != "sphere" and shape.link not in smooth]


def _friction(link: Link) -> float:
    mu1, mu2 = link.surface.mu1, link.surface.mu2
    return min(1.0 if mu1 is None else mu1, 1.0 if mu2 is None else mu2)


def _carries(rough: list[Placed], wheels: list[Wheel], centre: Vector) -> bool:
    """Whether the robot rests on these parts alone, and its wheels are no lower."""
    ground = stand(rough, centre)
    return not ground.tips and all(ground.above(wheel.shape) > -TOUCHING for wheel in wheels)


def _needs(rough: list[Placed], subject: Subject, centre: Vector, ground: Ground) -> bool:
    """Whether the robot tips or leans without these parts."""
    others = [shape for shape in subject.placed if shape.use == "collision" and shape not in rough]
    if not others:
        return True
    without = stand(others, centre)
    return without.tips or dot(without.up, ground.up) < SAME


def _touching(wheel: str, subject: Subject) -> bool:
    """Whether a wheel has collision shapes, or rollers that have."""
    assert subject.model is not None
    rollers = [joint.child for joint in subject.model.joints.values() if joint.parent == wheel]
    return any(_solid(link, subject) for link in (wheel, *rollers))


def _solid(link: str, subject: Subject) -> bool:
    assert subject.model is not None
    body = next(body for body in fixed_bodies(subject.model) if link in body)
    return any(subject.model.links[name].collisions for name in body)


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
    """Whether it rests on its intended parts; a balancing robot that fell over does not."""
    return ground.up[2] > math.cos(math.radians(15)) or any(_touches(wheel, ground) for wheel in wheels[2:])


def _touches(wheel: Wheel, ground: Ground) -> bool:
    return ground.above(wheel.shape) <= wheel.slack


def _is_level(wheel: Wheel, ground: Ground) -> bool:
    """Whether its axle leans as in the file: a robot may rest nose up, but not on its side."""
    return abs(abs(dot(ground.up, wheel.axis)) - abs(wheel.axis[2])) < LEAN


def _off_ground(subject: Subject, wheels: list[Wheel], ground: Ground) -> Iterator[Mistake]:
    others = [s for s in subject.placed if s.use == "collision" and all(s.link not in w.links for w in wheels)]
    lowest = min(others, key=ground.above, default=None)
    under = f"; the robot stands on {lowest.link!r}" if lowest and ground.above(lowest) < LEAST else ""
    for wheel in wheels:
        if not _touches(wheel, ground):
            problem = f"wheel {wheel.joint.child!r} hangs {_length(ground.above(wheel.shape))} above the ground{under}"
            yield Mistake(subject.joints[wheel.joint.name], problem, "lower the wheel, or lift what stands below it")


def _length(metres: float) -> str:
    return f"{metres * 1000:.0f} mm" if metres < 0.1 else f"{metres:.2f} m"


def _direction(way: tuple[float, float, float]) -> str:
    return "(" + " ".join(f"{value + 0.0:.2g}" for value in (round(value, 3) for value in way)) + ")"


# Wheels inside each other, or inside the body.


HIDDEN = 0.5  # of a wheel; less may be inside a box that approximates a body with wheel arches
STATIONS = (-0.8, -0.4, 0.0, 0.4, 0.8)  # of half the width
RINGS = tuple(math.sqrt((ring + 0.5) / 6) for ring in range(6))  # of the radius; each represents the same area
SPOKES = tuple(spoke * math.pi / 6 for spoke in range(12))


@rule(
    "overlap",
    "warning",
    "a wheel inside another, or more than half of it inside the body",
    "impossible on a real robot",
)
def overlaps(subject: Subject) -> Iterator[Mistake]:
    """Wheels inside each other, and wheels of which more than half is inside one other link; all in one finding."""
    wheels = [wheel for wheel in subject.wheels if wheel.shape.use == "collision" and not subject.guessed]
    pairs = [(one, other) for one, other in combinations(wheels, 2) if _meet(one, other)]
    if pairs:
        names = ", ".join(f"{one.joint.child!r} and {other.joint.child!r}" for one, other in pairs)
        tag = subject.joints[pairs[0][1].joint.name]
        yield Mistake(tag, f"wheels {names} are inside each other", "move them apart, or make them smaller")
    links = {link for wheel in subject.wheels for link in wheel.links}
    rest = [shape for shape in subject.placed if shape.use == "collision" and shape.shape.kind != "mesh"]
    for link in dict.fromkeys(shape.link for shape in rest if shape.link not in links):
        shapes = [shape for shape in rest if shape.link == link]
        hidden = [wheel for wheel in wheels if _inside(wheel, shapes) > HIDDEN]
        if hidden:
            names = ", ".join(repr(wheel.joint.child) for wheel in hidden)
            problem = f"more than half of {names} is inside the collision shape of {link!r}"
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
    """The fraction of a wheel that is inside, from 0 to 1."""
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


# The dimensions of the drive plugin, and those of the robot.


OFF = 0.2  # of the robot's own dimension
SKID = 2.5  # times its own: a skid-steer is deliberately given a wider base
ACROSS = 0.01  # m; minimum offset to the wrong side
Wheels = Differential | Mecanum


@rule(
    "wheel-side",
    "error",
    "a left wheel on the right side, or the other way round",
    "it turns the wrong way: the plugin's tags define the sides",
)
def sides(subject: Subject) -> Iterator[Mistake]:
    """Wheels that a plugin names as left but that are on the right, or vice versa."""
    drive = _driven(subject)
    if drive is None or not _level(drive, subject):
        return
    places = {name: _lateral(name, subject)[0] for name in (*drive.left, *drive.right)}
    middle = fmean(places.values())
    wrong = [name for name in drive.left if places[name] < middle - ACROSS]
    wrong += [name for name in drive.right if places[name] > middle + ACROSS]
    if wrong:
        names = ", ".join(f"{name!r} (a {_side(name, drive)} joint, at y={places[name]:.3g} m)" for name in wrong)
        at = next((tag for tag, name in subject.plugin_joints if name == wrong[0]), subject.joints[wrong[0]])
        yield Mistake(at, f"on the opposite side of its tag: {names}; left is where y is larger", "swap them")


@rule(
    "wheel-measure",
    "warning",
    "a plugin's wheel separation or diameter that differs by 20 % from the robot's",
    "it turns or drives faster or slower than commanded",
)
def measures(subject: Subject) -> Iterator[Mistake]:
    """A wheel separation or diameter that differs from the robot's."""
    drive = _driven(subject)
    if drive is None:
        return
    tag = _tag(subject, "wheelseparation")
    if drive.separation and tag and _level(drive, subject):
        found = _separations(drive, subject)
        most = SKID if len(drive.left) > 1 else 1 + OFF
        if not any(1 - OFF <= drive.separation / one <= most for one in found if one > 0):
            problem = f"<{tag.name}> is {drive.separation:.3g} m, and the wheels are {found[0]:.3g} m apart"
            yield Mistake(tag, problem, f"write {found[0]:.3g}")
    tag = _tag(subject, "wheeldiameter", "wheelradius")
    radii = _radii(drive.left[0], subject)
    if drive.radius and tag and radii and all(abs(drive.radius / radius - 1) > OFF for radius in radii):
        twice = 2 if "diameter" in tag.name.lower() else 1
        child = _child(drive.left[0], subject)
        problem = f"<{tag.name}> is {drive.radius * twice:.3g} m, and that of {child!r} is {radii[0] * twice:.3g} m"
        yield Mistake(tag, problem, f"write {radii[0] * twice:.3g}")


def _driven(subject: Subject) -> Wheels | None:
    mechanism = subject.model.drive.mechanism if subject.model and subject.model.drive else None
    return mechanism if isinstance(mechanism, Wheels) else None


def _level(drive: Wheels, subject: Subject) -> bool:
    """Whether the axles lie along y: a robot that drives along another axis has other sides."""
    assert subject.model is not None
    axes = joint_axes(subject.model)
    return all(abs(dot(axes[name].direction, (0.0, 1.0, 0.0))) > 0.9 for name in (*drive.left, *drive.right))


def _separations(drive: Wheels, subject: Subject) -> list[float]:
    """The distance in metres between the sides' wheels, and between their joints."""
    left, right = ([_lateral(name, subject) for name in names] for names in (drive.left, drive.right))
    return [abs(fmean(a) - fmean(b)) for a, b in zip(zip(*left, strict=True), zip(*right, strict=True), strict=True)]


def _lateral(joint: str, subject: Subject) -> tuple[float, float]:
    """y in metres, in the root frame, of a wheel's shape and of its joint."""
    assert subject.model is not None
    origin = link_frames(subject.model)[_child(joint, subject)].xyz[1]
    shapes = _shapes(joint, subject)
    return (shapes[0].centre[1] if shapes else origin), origin


def _radii(joint: str, subject: Subject) -> list[float]:
    round_shapes = [shape for shape in _shapes(joint, subject) if shape.shape.kind in ("cylinder", "sphere")]
    return [shape.half[0] for shape in round_shapes]


def _shapes(joint: str, subject: Subject) -> list[Placed]:
    """The shapes of a wheel, collision shapes first."""
    assert subject.model is not None
    body = next(body for body in fixed_bodies(subject.model) if _child(joint, subject) in body)
    own = [shape for shape in subject.placed if shape.link in body]
    return sorted(own, key=lambda shape: shape.use)


def _child(joint: str, subject: Subject) -> str:
    assert subject.model is not None
    return subject.model.joints[joint].child


def _side(joint: str, drive: Wheels) -> str:
    return "left" if joint in drive.left else "right"


def _tag(subject: Subject, *names: str) -> Tag | None:
    """The setting of the drive plugin."""
    driving = [plugin for plugin in subject.plugins if kind_of(plugin) in DRIVES]
    tags = [tag for plugin in driving[:1] for tag in plugin.children]
    return next((tag for tag in tags if tag.name.lower().replace("_", "") in names), None)
