"""A robot as rigid bodies: frames, lumped masses and shapes, moving parts, and its height above the
ground.
"""

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from msgspec import Struct

from holozen.robot.errors import RobotError
from holozen.robot.inertia import is_absurd, moments
from holozen.robot.model import (
    HERE,
    MOVING,
    Balancing,
    Differential,
    Inertial,
    Joint,
    Link,
    Mecanum,
    Planar,
    Pose,
    RobotModel,
    Shape,
    Surface,
    Vector,
    descend,
    sides_of,
    solid,
)
from holozen.robot.rotation import (
    Array,
    matrix_of,
    principal,
    quaternion_of,
    rpy_of,
    symmetric,
    triple,
)
from holozen.rotation import XYZ, XYZW, conjugate, from_axis_angle, multiply, rotate
from holozen.suggest import cut

SMALLEST_MASS = 1e-6  # kg; an engine divides by the mass
SMALLEST_GYRATION = 1e-3  # m; and by the moments of inertia, of which a point mass would have none
# parts of a robot, each with a joint or the root; pybullet silently stops at 127 joints
MAX_JOINTS = 120
MAX_SHAPES = 500  # of one entity: each that touches the ground costs the engine 50 us at every step
FALLS = "has no collision shape and falls through the ground"
FLEETS = 8  # models whose results are cached, for all their copies


class Frame(Struct, frozen=True, eq=False):
    """A frame in another one: `position` (3,) in metres, `rotation` (3, 3) whose columns are its
    axes.
    """

    position: Array
    rotation: Array

    @classmethod
    def of(cls, pose: Pose) -> "Frame":
        """The frame of a URDF pose."""
        return cls(np.array(pose.xyz), matrix_of(pose.rpy))

    def __matmul__(self, inner: "Frame") -> "Frame":
        """The composition: `inner`, relative to this frame, in this frame's parent."""
        return Frame(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)

    @property
    def inverse(self) -> "Frame":
        """The inverse: the parent frame in this one."""
        back = self.rotation.T
        return Frame(-(back @ self.position), back)

    @property
    def pose(self) -> Pose:
        """The frame as a URDF pose."""
        return Pose(self.xyz, rpy_of(self.rotation))

    @property
    def xyz(self) -> Vector:
        """The position in metres."""
        return triple(self.position)

    @property
    def quaternion(self) -> XYZW:
        """The rotation as x, y, z, w."""
        return quaternion_of(self.rotation)


def compose(outer: Pose, inner: Pose) -> Pose:
    """The pose `inner`, which is relative to `outer`, in the frame that `outer` is relative to."""
    if outer == HERE:
        return inner
    return outer if inner == HERE else (Frame.of(outer) @ Frame.of(inner)).pose


class Axis(Struct, frozen=True):
    """A joint at zero in the root frame: its origin in metres and the unit vector it turns about or
    slides along.
    """

    xyz: Vector
    direction: Vector


class PlacedShape(Struct, frozen=True):
    """A collision shape of `link`; position in metres and quaternion x, y, z, w in the root
    frame.
    """

    link: str
    shape: Shape
    xyz: Vector
    quaternion: XYZW


class Body(Struct, frozen=True):
    """One rigid body in the root frame.

    `mass` in kg, `centre` of mass in metres, principal moments `inertia` in kg m^2 about it, and
    their axes as the quaternion x, y, z, w `axes`, which rotates the principal frame into the root
    frame. `weightless` is the part of the mass in kg that gravity does not pull.
    """

    mass: float
    centre: Vector
    inertia: Vector
    axes: XYZW
    collisions: tuple[PlacedShape, ...]
    weightless: float = 0.0

    def moment(self, axis: Vector) -> float:
        """The moment of inertia in kg m^2 about an axis through the centre of mass, a unit vector
        in the root frame.
        """
        a, b, c = rotate(conjugate(self.axes), axis)
        x, y, z = self.inertia
        return x * a * a + y * b * b + z * c * c


def link_frames(model: RobotModel) -> dict[str, Frame]:
    """Link name -> its frame in the root frame, parents first."""
    frames = {model.root: Frame.of(HERE)}
    for joint in descend(model.root, model.joints):
        frames[joint.child] = frames[joint.parent] @ Frame.of(joint.pose)
    return frames


@lru_cache(FLEETS)
def joint_axes(model: RobotModel) -> Mapping[str, Axis]:
    """Joint name -> its axis in the root frame, for the joints that turn or slide."""
    frames = link_frames(model)
    moving = [joint for joint in model.joints.values() if joint.kind in MOVING]
    return {
        joint.name: Axis(
            frames[joint.child].xyz, triple(frames[joint.child].rotation @ np.array(joint.axis))
        )
        for joint in moving
    }


@lru_cache(FLEETS)
def lump(model: RobotModel) -> Body:
    """All links as one body, as Gazebo lumps links over fixed joints.

    A link without mass only contributes its shapes. Raises RobotError for a robot without mass.
    """
    body = lump_links(model, link_frames(model))
    if body.mass < SMALLEST_MASS and not model.static:
        problem = f"robot {cut(model.name)} has a mass of {body.mass} kg"
        raise RobotError(
            f"{problem}; give a link an <inertial> with a <mass> of {SMALLEST_MASS} kg or more"
        )
    return body


def lump_links(model: RobotModel, frames: Mapping[str, Frame]) -> Body:
    """The links in `frames` as one body, in the frame that `frames` are relative to. Moments of
    inertia far below those of its solid shapes are replaced by theirs: in an engine such a body
    would spin.
    """
    links = [model.links[name] for name in frames]
    parts = [
        (frames[link.name] @ Frame.of(link.inertial.pose), link.inertial)
        for link in links
        if link.inertial
    ]
    mass, centre, inertia = _sum(parts)
    placed = [
        (link, shape, frames[link.name] @ Frame.of(shape.pose))
        for link in links
        for shape in link.collisions
    ]
    least = moments((shape, frame.position, frame.rotation) for _, shape, frame in placed)
    if least is not None and is_absurd(inertia, mass, least):
        inertia = mass * least
    principals, axes = principal(inertia)
    principals = np.maximum(principals, mass * SMALLEST_GYRATION**2)
    collisions = tuple(placed_shape(link.name, shape, frame) for link, shape, frame in placed)
    weightless = sum(link.inertial.mass for link in links if link.inertial and not link.gravity)
    return Body(
        mass, triple(centre), triple(principals), quaternion_of(axes), collisions, weightless
    )


def placed_shape(link: str, shape: Shape, frame: Frame) -> PlacedShape:
    """A collision shape of a link as it is simulated, with its frame in the root frame."""
    return PlacedShape(link, solid(shape), frame.xyz, frame.quaternion)


def _sum(parts: list[tuple[Frame, Inertial]]) -> tuple[float, Array, Array]:
    """Mass, centre (3,) and tensor (3, 3) about it, by the parallel axis theorem."""
    mass = sum((part.mass for _, part in parts), 0.0)
    moment = sum((part.mass * frame.position for frame, part in parts), np.zeros(3))
    centre = moment / mass if mass > 0 else moment
    inertia = np.zeros((3, 3))
    for frame, part in parts:
        away = frame.position - centre
        inertia += frame.rotation @ symmetric(part.inertia) @ frame.rotation.T
        inertia += part.mass * (away @ away * np.eye(3) - np.outer(away, away))
    return mass, centre, inertia


# Moving parts: links connected by fixed joints are one part.


class Part(Struct, frozen=True):
    """Links that move together, in the frame of the topmost, `link`.

    `joint` moves it, and `parent` is the index of the part that carries it; both are None for the
    root's part.
    `xyz` in metres and the quaternion x, y, z, w `rotation` are its pose in that part's frame, with
    its joint at zero.
    """

    link: str
    body: Body
    surface: Surface
    joint: Joint | None = None
    parent: int | None = None
    xyz: Vector = (0.0, 0.0, 0.0)
    rotation: XYZW = (0.0, 0.0, 0.0, 1.0)


def assemble(model: RobotModel) -> list[Part]:
    """The parts, every parent before its children, the root's first. A joint that moves no mass is
    treated as fixed.
    """
    above = {joint.child: joint for joint in model.joints.values()}
    tops, within = _grouped(model)
    order, parts = list(within), list[Part]()
    for top, links in within.items():
        body, surface = lump_links(model, links), _surface(model, links)
        if top == model.root:
            parts.append(Part(top, body, surface))
            continue
        joint = above[top]
        carrier = tops[joint.parent]
        frame = within[carrier][joint.parent] @ Frame.of(joint.pose)
        parts.append(
            Part(top, body, surface, joint, order.index(carrier), frame.xyz, frame.quaternion)
        )
    return parts


def advised_drive(model: RobotModel) -> str:
    """What `--drive` should be for a robot without a drive: omni if its wheels are omni or mecanum
    wheels, with rollers or with axles in different directions, else planar_move.
    """
    rims = {joint.child for joint in model.joints.values() if joint.kind == "continuous"}
    carriers = {
        joint.parent
        for joint in model.joints.values()
        if joint.kind == "continuous" and joint.parent in rims
    }
    if len(carriers) >= 3:
        return "omni"
    wheels = [
        joint.name
        for joint in model.joints.values()
        if joint.kind == "continuous" and joint.parent not in rims
    ]
    axles = [np.array(joint_axes(model)[name].direction) for name in wheels]
    level = [axle for axle in axles if abs(axle[2]) < 0.1]
    crossed = any(float(np.linalg.norm(np.cross(axle, level[0]))) > 0.2 for axle in level[1:])
    return "omni" if len(level) >= 3 and crossed else "planar_move"


def in_parts(model: RobotModel) -> dict[str, tuple[int, Frame]]:
    """Link name -> the index of its part among those of `assemble`, and its frame in that
    part's.
    """
    _, within = _grouped(model)
    return {
        link: (index, frame)
        for index, links in enumerate(within.values())
        for link, frame in links.items()
    }


def _grouped(model: RobotModel) -> tuple[dict[str, str], dict[str, dict[str, Frame]]]:
    """The topmost link of each link's part, and for each of those the frames of its part's
    links.
    """
    moving = _moving(model)
    tops, within = {model.root: model.root}, {model.root: {model.root: Frame.of(HERE)}}
    for joint in descend(model.root, model.joints):
        if (name := joint.child) in moving:
            tops[name], within[name] = name, {name: Frame.of(HERE)}
        else:
            top = tops[name] = tops[joint.parent]
            within[top][name] = within[top][joint.parent] @ Frame.of(joint.pose)
    return tops, within


def moved_by(joint: Joint, at: XYZ, rotation: XYZW, position: float) -> tuple[XYZ, XYZW]:
    """The pose of a joint's child in its parent (m, quaternion) at a joint `position` in rad, or in
    m for a prismatic joint; `at` and `rotation` are the pose at zero.
    """
    if joint.kind == "prismatic":
        (x, y, z), (dx, dy, dz) = at, rotate(rotation, joint.axis)
        return (x + position * dx, y + position * dy, z + position * dz), rotation
    return at, multiply(rotation, from_axis_angle(joint.axis, position))


def simulated_parts(model: RobotModel) -> list[Part]:
    """The parts of a robot that an engine can simulate. Raises RobotError for no mass, or too many
    joints.
    """
    parts = assemble(model)
    if parts[0].body.mass < SMALLEST_MASS and not model.static:
        solid = next((link.name for link in model.links.values() if link.collisions), parts[0].link)
        problem = (
            f"{cut(model.name)} has no mass: neither {parts[0].link!r} nor any link fixed "
            "to it has one"
        )
        raise RobotError(f"{problem}; give {solid!r} an <inertial>")
    if len(parts) > MAX_JOINTS:
        problem = f"{cut(model.name)} has {len(parts) - 1} moving joints"
        raise RobotError(f"{problem}; at most {MAX_JOINTS - 1} are simulated")
    return parts


def check_simulated(model: RobotModel) -> None:
    """Raise RobotError for a robot that an engine cannot simulate: without mass, or with too many
    parts.
    """
    check_shapes(model)
    if model.drive and not model.static and isinstance(model.drive.mechanism, Planar | Mecanum):
        lump(model)
    else:
        simulated_parts(model)


def check_shapes(model: RobotModel) -> None:
    """Raise RobotError for more than MAX_SHAPES collision shapes."""
    if (shapes := sum(len(link.collisions) for link in model.links.values())) > MAX_SHAPES:
        raise RobotError(
            f"{cut(model.name)} has {shapes} collision shapes; at most {MAX_SHAPES} are simulated"
        )


def falls_through(model: RobotModel) -> bool:
    """Whether gravity pulls a robot that has no collision shape to stand on."""
    links = model.links.values()
    return (
        not model.static
        and not any(link.collisions for link in links)
        and any(link.gravity for link in links)
    )


def _moving(model: RobotModel) -> set[str]:
    """The links that a joint moves. A massless link may still carry others with mass."""
    masses = {
        name: link.inertial.mass if link.inertial else 0.0 for name, link in model.links.items()
    }
    found = set()
    for joint in reversed([*descend(model.root, model.joints)]):
        if joint.kind in MOVING and masses[joint.child] >= SMALLEST_MASS:
            found.add(joint.child)
        else:
            masses[joint.parent] += masses[joint.child]
    return found


def _surface(model: RobotModel, links: dict[str, Frame]) -> Surface:
    """The surface of the first link with a surface and collision shapes: an engine has one surface
    per part.
    """
    touching = [model.links[name] for name in links if model.links[name].collisions]
    return next((link.surface for link in touching if link.surface != Surface()), Surface())


# Height above the ground.


LEVEL = (0.0, 0.0, 0.0)
DOWN = np.array((0.0, 0.0, -1.0))


def farthest(shape: Shape, way: Array) -> Array | None:
    """The point (3,) of a shape that is farthest along a unit vector, both in its own frame; None
    for a shape without extent: a plane, or a missing mesh.
    """
    x, y, z = way.tolist()
    match shape.kind:
        case "box":
            return np.copysign(shape.size, way) / 2
        case "cylinder":
            (radius, length), across = shape.size, math.hypot(x, y)
            share = radius / across if across > 1e-9 else 0.0
            return np.array((x * share, y * share, math.copysign(length / 2, z)))
        case "sphere":
            return shape.size[0] * way
        case "hull" if shape.points:
            return np.array(
                max(shape.points, key=lambda point: point[0] * x + point[1] * y + point[2] * z)
            )
    return None


def reach_along(frame: Frame, shape: Shape, way: Array) -> float:
    """How far in metres a shape in a frame reaches along a unit vector; minus infinity for one
    without extent.
    """
    found = farthest(shape, way @ frame.rotation)
    return -math.inf if found is None else float((frame.position + frame.rotation @ found) @ way)


def lowest(model: RobotModel, rpy: Vector = LEVEL) -> float:
    """z in metres of the lowest collision point under the root frame, with all joints at zero and
    the root turned by `rpy` in radians; 0 without collision shapes.
    """
    down, frames = Frame.of(Pose(rpy=rpy)).rotation.T @ DOWN, link_frames(model)
    shapes = [
        (frames[link.name], shape) for link in model.links.values() for shape in link.collisions
    ]
    depth = max(
        (reach_along(frame @ Frame.of(shape.pose), solid(shape), down) for frame, shape in shapes),
        default=0.0,
    )
    return 0.0 - depth if math.isfinite(depth) else 0.0  # 0 and not -0, for printing


def reach(part: PlacedShape) -> float:
    """The distance in m from the root frame to the farthest point of a shape, or an upper bound."""
    if part.shape.points:
        return max(
            math.dist(part.xyz, rotate(part.quaternion, (-x, -y, -z)))
            for x, y, z in part.shape.points
        )
    if part.shape.kind == "cylinder":
        radius, length = part.shape.size
        x, y, z = rotate(conjugate(part.quaternion), part.xyz)
        return math.hypot(math.hypot(x, y) + radius, abs(z) + length / 2)
    return math.hypot(*part.xyz) + math.hypot(*part.shape.size) / (
        2 if part.shape.kind == "box" else 1
    )


AROUND = 64  # directions in which a footprint is measured


@lru_cache(FLEETS)
def turning_point(model: RobotModel) -> Vector:
    """The point (m, root frame) that a robot turns about on the spot: the middle of the wheels of a
    differential or balancing drive, else the origin.
    """
    mechanism = model.drive.mechanism if model.drive else None
    if not isinstance(mechanism, Differential | Balancing):
        return 0.0, 0.0, 0.0
    frames, sides = link_frames(model), sides_of(mechanism)
    middles = [
        np.mean([frames[model.joints[name].child].position for name in side], axis=0)
        for side in sides
    ]
    return triple((middles[0] + middles[1]) / 2)


@lru_cache(FLEETS)
def footprint_radius(model: RobotModel) -> float:
    """The radius (m) of a circle on the ground, around the `turning_point`, that holds all
    collision shapes, with all joints at zero; 0 without shapes.
    """
    frames, centre = link_frames(model), np.array(turning_point(model))
    shapes = [
        (frames[link.name] @ Frame.of(shape.pose), solid(shape))
        for link in model.links.values()
        for shape in link.collisions
    ]
    angles = (math.tau * index / AROUND for index in range(AROUND))
    ways = [np.array((math.cos(angle), math.sin(angle), 0.0)) for angle in angles]
    reach = max(
        (reach_along(*one, way) - centre @ way for one in shapes for way in ways), default=0
    )
    return float(reach / math.cos(math.pi / AROUND)) if 0 < reach < math.inf else 0.0


ROUND = ("cylinder", "sphere")
MEASURABLE = ("box", *ROUND)  # kinds of visual shapes


def radius_across(link: Link, axle: Vector) -> float:
    """Half of the link's larger extent across its axle, a unit vector in the link's frame, in
    metres; 0 without shapes.

    Measured on the collision shapes, else on visual shapes other than meshes.
    """
    shapes = link.collisions or [shape for shape in link.visuals if shape.kind in MEASURABLE]
    placed = [(Frame.of(shape.pose), solid(shape)) for shape in shapes]
    along = np.array(axle)
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.linalg.norm(aside)
    ways = (aside, -aside), (np.cross(along, aside), np.cross(aside, along))
    reaches = [
        [max((reach_along(*part, way) for part in placed), default=0.0) for way in both]
        for both in ways
    ]
    return max(0.0, *map(sum, reaches)) / 2


def round_radius(link: Link) -> float:
    """The radius of the first round collision shape in metres; 0 without one."""
    return next((shape.size[0] for shape in link.collisions if shape.kind in ROUND), 0.0)
