"""`Engine` and `Rays` in pybullet, which is loaded without its greeting. Shapes and bodies are made
once and reused.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from holozen.process import quiet
from holozen.robot.model import WorldSpec
from holozen.robot.rigid import Part, PlacedShape
from holozen.rotation import XYZ, XYZW, conjugate, multiply, rotate

from .concave import corners_of
from .dynamics import FRICTION, damping_of
from .engine import UPRIGHT, Array, Box, Contact, Engine, JointStates, Rays

__all__ = ["MAX_KEPT", "Bullet", "BulletRays", "bullet"]

MAX_IN_ONE = 16  # pybullet's MAX_COMPOUND_COLLISION_SHAPES; it silently drops the rest
NOTHING = -1  # pybullet's number for no shape
MAX_KEPT = 64  # removed bodies that are kept for reuse; each takes 0.6 us a step
MAX_SEEN = 1000  # the same in the world of rays, which is never stepped
HERE = (0.0, 0.0, 0.0), UPRIGHT
# m; what is farther from a concave mesh is not measured: each of its triangles is a search
CLOSE = 0.01
FAR_AWAY: XYZ = (0.0, 0.0, 1e6)
# pybullet's flags: sleeping enabled and asleep; sleeping disabled and awake
ASLEEP, AWAKE = (1 | 8, 2 | 4)
# the engine's collision groups and masks, of free bodies and of fixed bases
FREE, FIXED = ((1, -1), (2, ~2))
# groups for rays: 1024, which the engine does not use, are shapes that they do not hit
OTHERS, OWN, ALL = (1, 1024, -1)


with quiet():  # it prints its build time from C while it loads; no flag stops it
    import pybullet as bullet

# wheels do not bump against the edges inside a floor
INTERNAL_EDGES = bullet.GEOM_CONCAVE_INTERNAL_EDGE
KINDS = {"box": bullet.GEOM_BOX, "cylinder": bullet.GEOM_CYLINDER, "sphere": bullet.GEOM_SPHERE}
JOINTS = {
    "continuous": bullet.JOINT_REVOLUTE,
    "revolute": bullet.JOINT_REVOLUTE,
    "prismatic": bullet.JOINT_PRISMATIC,
}


class Bullet(Engine):
    """A world in pybullet: see `Engine`."""

    def __init__(self, spec: WorldSpec) -> None:
        self._gravity, self._dt = spec.gravity, spec.step
        self.id: int = bullet.connect(bullet.DIRECT)
        self._bodies = Bodies(self.id)
        self._links: dict[int, list[int]] = {}  # by body: the engine's link of each part
        self._masses: dict[int, tuple[float, XYZ]] = {}  # by body: mass and inertia of the root
        # by body: the root's principal axes, if not those of its frame
        self._axes: dict[int, tuple[XYZW, XYZW]] = {}
        self._floating: dict[int, dict[int, float]] = {}  # kg that gravity does not pull, by link
        self._concave = set[int]()  # bodies with a mesh that is not convex
        bullet.setGravity(*spec.gravity, physicsClientId=self.id)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=spec.step,
            enableFileCaching=0,
            deterministicOverlappingPairs=1,
            # With a friction cone, the grip of a slipping wheel depends on its heading in the
            # world; with a pyramid, as Gazebo has, far less.
            enableConeFriction=0,
            physicsClientId=self.id,
        )
        self.ground: int | None = None
        if spec.ground:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=self.id)
            self.ground = bullet.createMultiBody(0, plane, physicsClientId=self.id)
            bullet.changeDynamics(
                self.ground, -1, lateralFriction=FRICTION, physicsClientId=self.id
            )

    def add(
        self,
        parts: Sequence[Part],
        contacts: Sequence[Contact],
        at: XYZ,
        rotation: XYZW,
        static: bool,
    ) -> int:
        root, links = parts[0].body, Links(self._bodies.shapes.unseen)
        first, carrying = _link(links, self._bodies.shapes, parts)
        number = self._bodies.add(
            (tuple(parts), tuple(contacts), static),
            (at, rotation),
            0.0 if static else root.mass,
            first,
            (root.centre, root.axes),
            flags=bullet.URDF_GLOBAL_VELOCITIES_MB,  # without it a tumbling body turns ever faster
            **links.arguments,
        )
        numbers = links.numbers(number, self.id)
        if any(shape.shape.triangles for part in parts for shape in part.body.collisions):
            self._concave.add(number)
        self._links[number] = [numbers[own] for own, *_ in carrying]
        self._masses[number] = (root.mass, root.inertia)
        if max(map(abs, root.axes[:3])) > 1e-9:
            self._axes[number] = (root.axes, bullet.invertTransform((0, 0, 0), root.axes)[1])
        for index, (part, contact, (own, *more)) in enumerate(
            zip(parts, contacts, carrying, strict=True)
        ):
            self._set_surface(number, [numbers[link] for link in (own, *more)], part, contact)
            if part.joint or not static:
                self._set_joint(number, numbers[own], part, damping_of(parts, index, self._dt))
        floating = {
            numbers[own]: part.body.weightless
            for part, (own, *_) in zip(parts, carrying, strict=True)
        }
        if not static and any(floating.values()):
            self._floating[number] = {link: mass for link, mass in floating.items() if mass}
        return number

    def _set_joint(self, number: int, link: int, part: Part, damping: float) -> None:
        """Set the part's inertia, the limits of its joint, and the joint's damping in N m s/rad or
        N s/m. The engine's own damping is off.
        """
        settings: dict[str, Any] = {
            "linearDamping": 0.0,
            "angularDamping": 0.0,
            "jointDamping": damping,
        }
        limits = part.joint.limits if part.joint else None
        if limits and math.isfinite(limits.lower) and math.isfinite(limits.upper):
            settings |= {"jointLowerLimit": limits.lower, "jointUpperLimit": limits.upper}
        bullet.changeDynamics(number, link, **settings, physicsClientId=self.id)
        # In a separate call: the engine recomputes inertias when other values change.
        bullet.changeDynamics(
            number, link, localInertiaDiagonal=part.body.inertia, physicsClientId=self.id
        )

    def _set_surface(self, number: int, links: Iterable[int], part: Part, contact: Contact) -> None:
        """Set the contact parameters of a part's shapes, which are in `links`."""
        settings: dict[str, Any] = {"lateralFriction": contact.friction}
        if part.joint and contact.along_axle < 1:
            # The axle keeps its direction while the wheel turns, so the link's own axes suffice.
            turns = [
                abs(component) for component in rotate(conjugate(part.body.axes), part.joint.axis)
            ]
            axle = turns.index(max(turns))
            settings["anisotropicFriction"] = [
                contact.along_axle if index == axle else 1.0 for index in range(3)
            ]
        if contact.stiffness:
            settings |= {"contactStiffness": contact.stiffness, "contactDamping": contact.damping}
        for link in links:
            bullet.changeDynamics(number, link, **settings, physicsClientId=self.id)

    def remove(self, number: int) -> None:
        self._bodies.remove(number)
        self._concave.discard(number)
        for kept in (self._links, self._masses, self._axes, self._floating):
            kept.pop(number, None)

    def step(self) -> None:
        for number, floating in self._floating.items():
            for link, mass in floating.items():  # the engine has no flag for it
                if link < 0:
                    centre = bullet.getBasePositionAndOrientation(number, self.id)[0]
                else:
                    centre = bullet.getLinkState(number, link, physicsClientId=self.id)[0]
                force = [-mass * part for part in self._gravity]
                bullet.applyExternalForce(number, link, force, centre, bullet.WORLD_FRAME, self.id)
        bullet.stepSimulation(self.id)

    def close(self) -> None:
        bullet.disconnect(self.id)

    def centre(self, number: int) -> tuple[XYZ, XYZW]:
        position, rotation = bullet.getBasePositionAndOrientation(number, self.id)
        if number in self._axes:
            rotation = bullet.multiplyTransforms(
                (0, 0, 0), rotation, (0, 0, 0), self._axes[number][1]
            )[1]
        return position, rotation

    def place(self, number: int, centre: XYZ, rotation: XYZW) -> None:
        axes = multiply(rotation, self._axes[number][0]) if number in self._axes else rotation
        bullet.resetBasePositionAndOrientation(number, centre, axes, self.id)

    def velocity(self, number: int) -> tuple[XYZ, XYZ]:
        return bullet.getBaseVelocity(number, self.id)  # type: ignore[no-any-return]

    def move(self, number: int, linear: XYZ, angular: XYZ) -> None:
        bullet.resetBaseVelocity(number, linear, angular, self.id)

    def freeze(self, number: int) -> None:
        bullet.changeDynamics(number, -1, mass=0, physicsClientId=self.id)
        self._touch(number, 0, 0)

    def thaw(self, number: int) -> None:
        mass, inertia = self._masses[number]
        bullet.changeDynamics(number, -1, mass=mass, physicsClientId=self.id)
        bullet.changeDynamics(number, -1, localInertiaDiagonal=inertia, physicsClientId=self.id)
        self._touch(number, 1, -1)

    def _touch(self, number: int, group: int, mask: int) -> None:
        for link in range(-1, bullet.getNumJoints(number, self.id)):
            bullet.setCollisionFilterGroupMask(number, link, group, mask, physicsClientId=self.id)

    def box(self, number: int) -> Box:
        if not (links := bullet.getNumJoints(number, self.id)):
            box: Box = bullet.getAABB(number, -1, self.id)
            return box
        boxes = [bullet.getAABB(number, link, self.id) for link in range(-1, links)]
        low, high = (zip(*corners, strict=True) for corners in zip(*boxes, strict=True))
        return tuple(map(min, low)), tuple(map(max, high))

    def near(self, box: Box) -> set[int]:
        return {number for number, _ in bullet.getOverlappingObjects(*box, self.id) or ()}

    def gap(self, one: int, other: int, within: float) -> float:
        if other in self._concave or one in self._concave:
            within = min(within, CLOSE)
        points = bullet.getClosestPoints(one, other, within, physicsClientId=self.id)
        return min((point[8] for point in points), default=within)

    def touched(self, number: int) -> set[int]:
        return {contact[2] for contact in bullet.getContactPoints(number, physicsClientId=self.id)}

    def is_plane(self, number: int) -> bool:
        shapes = bullet.getCollisionShapeData(number, -1, physicsClientId=self.id)
        return any(shape[2] == bullet.GEOM_PLANE for shape in shapes)

    def joints(self, number: int) -> JointStates:
        links = self._links[number][1:]  # all but the root's have a joint
        states = bullet.getJointStates(number, links, self.id) if links else ()
        return (
            [state[0] for state in states],
            [state[1] for state in states],
            [state[3] for state in states],
        )

    def joint(self, number: int, part: int) -> tuple[float, float]:
        state = bullet.getJointState(number, self._links[number][part], self.id)
        return state[0], state[1]

    def turn(self, number: int, part: int, rate: float, effort: float) -> None:
        self._motor(number, part, bullet.VELOCITY_CONTROL, targetVelocity=rate, force=effort)

    def go(
        self, number: int, part: int, position: float, closing: float, effort: float, rate: float
    ) -> None:
        gain = min(1.0, self._dt / closing)
        self._motor(
            number,
            part,
            bullet.POSITION_CONTROL,
            targetPosition=position,
            positionGain=gain,
            force=effort,
            maxVelocity=rate,
        )

    def push(self, number: int, part: int, effort: float) -> None:
        self._motor(number, part, bullet.TORQUE_CONTROL, force=effort)

    def _motor(self, number: int, part: int, mode: int, **values: float) -> None:
        bullet.setJointMotorControl2(
            number, self._links[number][part], mode, physicsClientId=self.id, **values
        )

    def frame(self, number: int, part: int) -> tuple[XYZ, XYZW]:
        state = bullet.getLinkState(
            number,
            self._links[number][part],
            computeForwardKinematics=True,
            physicsClientId=self.id,
        )
        return state[4], state[5]

    def wrench(self, number: int, part: int, force: XYZ, torque: XYZ, point: XYZ) -> None:
        link = self._links[number][part]
        bullet.applyExternalForce(number, link, force, point, bullet.WORLD_FRAME, self.id)
        bullet.applyExternalTorque(number, link, torque, bullet.WORLD_FRAME, self.id)


class BulletRays(Rays):
    """A world in pybullet that is never stepped: see `Rays`."""

    def __init__(self, ground: bool) -> None:
        self._world: int = bullet.connect(bullet.DIRECT)
        self._made = Bodies(self._world, MAX_SEEN)
        self._bodies: dict[int, list[int]] = {}
        self._owners: dict[int, int] = {}  # the engine's body -> the number of its shapes
        self._added = 0
        if ground:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=self._world)
            body = bullet.createMultiBody(
                0, plane, self._made.shapes.unseen, physicsClientId=self._world
            )
            self._owners[body] = 0

    def add(self, shapes: tuple[PlacedShape, ...]) -> int:
        self._added += 1
        self._bodies[self._added] = [
            self._made.add(shape, HERE, 0.0, shape) for shape in self._made.shapes.of(shapes)
        ]
        self._owners |= dict.fromkeys(self._bodies[self._added], self._added)
        return self._added

    def remove(self, number: int) -> None:
        for body in self._bodies.pop(number):
            del self._owners[body]
            self._made.remove(body)

    def place(self, number: int, at: XYZ, rotation: XYZW) -> None:
        for body in self._bodies[number]:
            bullet.resetBasePositionAndOrientation(body, at, rotation, self._world)

    def cast(self, origin: XYZ, directions: Array, near: float, far: float, own: int) -> Array:
        start = np.array(origin)
        self._group(own, OWN)
        hits = bullet.rayTestBatch(
            start + near * directions,
            start + far * directions,
            collisionFilterMask=~OWN,
            physicsClientId=self._world,
        )
        self._group(own, OTHERS)
        bodies_hit, fractions = np.array([(hit[0], hit[2]) for hit in hits]).reshape(-1, 2).T
        return np.where(bodies_hit < 0, np.inf, near + fractions * (far - near))

    def touched(
        self, number: int, within: float, but: Collection[int]
    ) -> Iterator[tuple[int, XYZ, XYZ, float]]:
        for body in self._bodies[number]:
            low, high = bullet.getAABB(body, -1, self._world)
            box = [value - within for value in low], [value + within for value in high]
            for other in sorted(
                {other for other, _ in bullet.getOverlappingObjects(*box, self._world) or ()}
            ):
                if (owner := self._owners.get(other, number)) not in (number, *but):
                    for point in bullet.getClosestPoints(
                        body, other, within, physicsClientId=self._world
                    ):
                        yield owner, point[6], point[7], point[8]

    def _group(self, number: int, group: int) -> None:
        for body in self._bodies[number]:
            bullet.setCollisionFilterGroupMask(body, -1, group, ALL, self._world)

    def close(self) -> None:
        bullet.disconnect(self._world)


class Shapes:
    """The collision shapes of one world. The engine never frees one, so equal shapes are shared."""

    def __init__(self, world: int) -> None:
        self._world = world
        self._made: dict[Any, int] = {}
        # Without a visual shape the engine makes one from each collision shape: 0.5 ms and 14 KB
        # each.
        self.unseen: int = bullet.createVisualShape(
            bullet.GEOM_BOX, halfExtents=[1e-3] * 3, physicsClientId=world
        )

    def of(self, placed: tuple[PlacedShape, ...]) -> list[int]:
        """The engine's ids of the shapes `placed` in the frame of their part, joined to as few as
        possible.
        """
        simple = [part for part in placed if part.shape.kind in KINDS]
        chunks = [simple[start : start + MAX_IN_ONE] for start in range(0, len(simple), MAX_IN_ONE)]
        single = [part for part in placed if part.shape.kind in ("hull", "plane")]
        return [self._shared(chunk) for chunk in chunks] + [self._shared([part]) for part in single]

    def _shared(self, placed: list[PlacedShape]) -> int:
        key = tuple(
            (p.shape.kind, p.shape.size, p.shape.points, p.shape.triangles, p.xyz, p.quaternion)
            for p in placed
        )
        if key not in self._made:
            self._made[key] = (
                _compound(self._world, placed)
                if placed[0].shape.kind in KINDS
                else self._one(placed[0])
            )
        return self._made[key]

    def _one(self, part: PlacedShape) -> int:
        if part.shape.kind == "plane":
            normal = rotate(part.quaternion, (0.0, 0.0, 1.0))
            return int(
                bullet.createCollisionShape(
                    bullet.GEOM_PLANE, planeNormal=normal, physicsClientId=self._world
                )
            )
        mesh: dict[str, Any] = {"vertices": part.shape.points}
        if part.shape.triangles:  # with indices it is no hull
            points, triangles = corners_of(part.shape)
            mesh = {
                "vertices": points.tolist(),
                "indices": triangles.ravel().tolist(),
                "flags": INTERNAL_EDGES,
            }
        return int(
            bullet.createCollisionShape(
                bullet.GEOM_MESH,
                **mesh,
                collisionFramePosition=part.xyz,
                collisionFrameOrientation=part.quaternion,
                physicsClientId=self._world,
            )
        )


def _compound(world: int, placed: list[PlacedShape]) -> int:
    arguments: dict[str, Any] = {
        "shapeTypes": [KINDS[part.shape.kind] for part in placed],
        "radii": [part.shape.size[0] for part in placed],
        "lengths": [part.shape.size[-1] for part in placed],
        "halfExtents": [[edge / 2 for edge in (*part.shape.size, 0, 0)[:3]] for part in placed],
        "collisionFramePositions": [part.xyz for part in placed],
        "collisionFrameOrientations": [part.quaternion for part in placed],
    }
    return int(bullet.createCollisionShapeArray(**arguments, physicsClientId=world))


class Bodies:
    """The bodies of one world. For each body that the engine removes it keeps 1 to 4 KB for ever.
    So a removed body is only put to sleep, far away and without contacts, until a like one is
    added; up to `most` of them are kept.
    """

    def __init__(self, world: int, most: int = MAX_KEPT) -> None:
        self.world, self.shapes, self._most = world, Shapes(world), most
        self._kinds: dict[int, object] = {}  # number -> kind of the present bodies
        # number -> kind of removed bodies, the first removed first
        self._kept: dict[int, object] = {}

    def add(
        self,
        kind: object,
        place: tuple[XYZ, XYZW],
        mass: float,
        shape: int,
        inertial: tuple[XYZ, XYZW] = HERE,
        **arguments: Any,
    ) -> int:
        """Add a body at rest, its root frame at `place`, and its inertial frame at `inertial` in
        the root frame; the rest are arguments of createMultiBody. Bodies of equal `kind` have to be
        made, and have their dynamics set, in the same way. Returns the engine's number.
        """
        number = next((number for number, kept in self._kept.items() if kept == kind), None)
        if number is None:
            number = int(
                bullet.createMultiBody(
                    mass,
                    shape,
                    self.shapes.unseen,
                    basePosition=place[0],
                    baseOrientation=place[1],
                    baseInertialFramePosition=inertial[0],
                    baseInertialFrameOrientation=inertial[1],
                    physicsClientId=self.world,
                    **arguments,
                )
            )
        else:
            del self._kept[number]
            ((x, y, z), rotation), (centre, axes) = place, inertial
            cx, cy, cz = rotate(rotation, centre)
            self._place(number, (x + cx, y + cy, z + cz), multiply(rotation, axes))
            self._touch(number, FREE if mass else FIXED, FREE)
            bullet.changeDynamics(number, -1, activationState=AWAKE, physicsClientId=self.world)
        self._kinds[number] = kind
        return number

    def remove(self, number: int) -> None:
        """Take a body out of the world."""
        self._touch(number, (0, 0), (0, 0))
        self._place(number, FAR_AWAY, UPRIGHT)
        bullet.changeDynamics(number, -1, activationState=ASLEEP, physicsClientId=self.world)
        self._kept[number] = self._kinds.pop(number)
        if len(self._kept) > self._most:
            oldest = next(iter(self._kept))
            del self._kept[oldest]
            bullet.removeBody(oldest, self.world)

    def _place(self, number: int, at: XYZ, rotation: XYZW) -> None:
        """Put the centre of mass at a pose and the joints at zero, all at rest."""
        bullet.resetBasePositionAndOrientation(number, at, rotation, self.world)
        bullet.resetBaseVelocity(number, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), self.world)
        for joint in range(bullet.getNumJoints(number, self.world)):
            bullet.resetJointState(number, joint, 0.0, 0.0, self.world)

    def _touch(self, number: int, base: tuple[int, int], links: tuple[int, int]) -> None:
        """Set the collision groups and masks of a body's base and of its links."""
        bullet.setCollisionFilterGroupMask(number, -1, *base, self.world)
        for link in range(bullet.getNumJoints(number, self.world)):
            bullet.setCollisionFilterGroupMask(number, link, *links, self.world)


class Links:
    """The arguments of `createMultiBody` for the links below the base, all with the visual shape
    `visual`. Links without a joint only carry shapes.
    """

    def __init__(self, visual: int) -> None:
        self._visual = visual
        self.arguments: dict[str, list[object]] = {name: [] for name in _NAMES}

    def __len__(self) -> int:
        return len(self.arguments["linkMasses"])

    def add(
        self,
        parent: int,
        shape: int,
        joint: int = bullet.JOINT_FIXED,
        axis: XYZ = (0.0, 0.0, 1.0),
        at: tuple[XYZ, XYZW] = HERE,
        mass: float = 0.0,
        inertial: tuple[XYZ, XYZW] = HERE,
    ) -> int:
        """Add a link to link `parent` (-1: the base), its frame `at` in the parent's. Returns its
        index.
        """
        values = (mass, shape, self._visual, *at, *inertial, parent + 1, joint, axis)
        for name, value in zip(_NAMES, values, strict=True):
            self.arguments[name].append(value)
        return len(self) - 1

    def numbers(self, body: int, world: int) -> dict[int, int]:
        """Our index -> the engine's, which counts depth first; -1, the base, is the same in
        both.
        """
        infos = (bullet.getJointInfo(body, number, world) for number in range(len(self)))
        return {-1: -1} | {int(info[12].removeprefix(b"link")) - 1: info[0] for info in infos}


_NAMES = (
    "linkMasses",
    "linkCollisionShapeIndices",
    "linkVisualShapeIndices",
    "linkPositions",
    "linkOrientations",
    "linkInertialFramePositions",
    "linkInertialFrameOrientations",
    "linkParentIndices",
    "linkJointTypes",
    "linkJointAxis",
)


def _link(links: Links, shapes: Shapes, parts: Sequence[Part]) -> tuple[int, list[list[int]]]:
    """Add the links of all parts. Returns the base's shape, and the links of each part: its own,
    then those that only carry more shapes.
    """
    own = [shapes.of(part.body.collisions) or [NOTHING] for part in parts]
    indices = [-1]
    for part, (first, *_) in zip(parts[1:], own[1:], strict=True):
        joint, body = part.joint, part.body
        assert joint is not None and part.parent is not None, "only the root's part has none"
        at, inertial = (part.xyz, part.rotation), (body.centre, body.axes)
        indices.append(
            links.add(
                indices[part.parent], first, JOINTS[joint.kind], joint.axis, at, body.mass, inertial
            )
        )
    others = [
        [links.add(index, shape) for shape in more]
        for index, (_, *more) in zip(indices, own, strict=True)
    ]
    return own[0][0], [[index, *more] for index, more in zip(indices, others, strict=True)]
