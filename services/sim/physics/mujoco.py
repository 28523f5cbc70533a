"""`Engine` and `Rays` in MuJoCo.

The model is recompiled when a body is added or removed, which takes 7 ms, and 2 ms more for each
robot that there is.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import count
from typing import Any

import mujoco as mj
import numpy as np
import numpy.typing as npt
from msgspec import Struct, field

from holozen.console import report
from holozen.kinematics import velocity_at
from holozen.robot.errors import RobotError
from holozen.robot.model import WorldSpec
from holozen.robot.rigid import Part, PlacedShape
from holozen.robot.rotation import triple
from holozen.rotation import XYZ, XYZW, conjugate, rotate

from .concave import convex_pieces
from .dynamics import FRICTION, damping_of
from .engine import UPRIGHT, Array, Box, Contact, Engine, JointStates, Rays

KINDS = {
    "box": mj.mjtGeom.mjGEOM_BOX,
    "cylinder": mj.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mj.mjtGeom.mjGEOM_SPHERE,
}
ENDLESS = 1e6  # m; half the width of a plane's bounding box
THIN = 1e-4  # m; the least thickness of a hull: the engine takes no flat ones
MEMORY = 1 << 28  # bytes of address space for contacts; only what is used takes memory
EXCLUDED = 1  # of a contact: it has no force
# impedance of motors and joint limits, the highest that the engine allows
RIGID = (0.9999, 0.9999, 0.001, 0.5, 2.0)
FIRM = (0.95, 0.99, 0.001, 0.5, 2.0)  # impedance of contacts
STEPS = 2.0  # time constant of motors in steps, the shortest that the engine allows
# 1/s; how fast contacts, and joint limits, recover from penetration
FIRM_BACK, GENTLE_BACK = (20.0, 9.0)
# shares of the stiffness and the damping of contacts, of casters beside two wheels
SOFT, SOFT_DAMPING = (0.03, 0.3)
# the least sine of the angle between a wheel's axle and the normal of a contact on its rim
RIM = 0.7
# the least cosine of the angle between the axle and the axis of a cylinder that is a wheel
PARALLEL = 0.99
# the least friction; the solver does not converge if it differs too much along and across the axle
LEAST = 1e-3


Indices = npt.NDArray[np.intp]


# else it writes a log file
mj.set_mju_user_warning(lambda text: report(f"sim: warning: mujoco: {text}"))


class _Kept(Struct, eq=False):
    """A body, and its indices in the compiled model."""

    parts: tuple[Part, ...]
    contacts: tuple[Contact, ...]
    static: bool
    bodies: list[mj.MjsBody]  # of its parts
    motors: list[tuple[float, float]]  # rate and effort of the parts' motors
    goals: dict[int, tuple[float, float, float]] = {}  # by part: position, closing, rate
    frozen: bool = False
    ids: list[int] = []  # of the parts' bodies
    geoms: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    at: int = 0  # the root's index in qpos
    speed: int = 0  # the root's index in qvel
    joints_at: list[int] = []
    joints_speed: list[int] = []


class MuJoCo(Engine):
    """A world in MuJoCo: see `Engine`.

    A joint's motor is its dry friction, about the commanded rate instead of about rest: the solver
    finds its effort together with all contacts, and bounds it. The friction of two surfaces is
    multiplied, and wheels have less of it along their axles: MuJoCo has neither, so both are set
    between collision detection and the
        solver.
    """

    def __init__(self, spec: WorldSpec) -> None:
        self._spec = mj.MjSpec()
        self._spec.memory = MEMORY
        self._spec.compiler.balanceinertia, self._spec.compiler.degree = True, False
        option = self._spec.option
        option.timestep, option.gravity = spec.step, spec.gravity
        option.integrator, option.cone = mj.mjtIntegrator.mjINT_IMPLICIT, mj.mjtCone.mjCONE_ELLIPTIC
        option.impratio = 10.0  # friction yields less than support does
        self._dt = spec.step
        self._firm, self._gentle = (
            (-back / spec.step, -1 / spec.step) for back in (FIRM_BACK, GENTLE_BACK)
        )
        self._soft = -FIRM_BACK * SOFT / spec.step, -SOFT_DAMPING / spec.step
        self._all: dict[int, _Kept] = {}
        self._numbers = count(1)
        self.ground: int | None = None
        if spec.ground:
            self.ground = 0
            geom = self._spec.worldbody.add_geom(type=mj.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
            self._touching(geom, Contact(FRICTION))
        self._model = self._spec.compile()
        self._data = mj.MjData(self._model)
        self._compiled()

    def add(
        self,
        parts: Sequence[Part],
        contacts: Sequence[Contact],
        at: XYZ,
        rotation: XYZW,
        static: bool,
    ) -> int:
        made: list[mj.MjsBody] = []
        motors = []
        for index, (part, contact) in enumerate(zip(parts, contacts, strict=True)):
            if part.parent is None:
                body = self._spec.worldbody.add_body(pos=at, quat=_wxyz(rotation))
                if not static:
                    body.add_freejoint()
            else:
                body = made[part.parent].add_body(pos=part.xyz, quat=_wxyz(part.rotation))
                self._add_joint(body, part, damping_of(parts, index, self._dt, implicit=True))
            motors.append((0.0, 0.0))
            made.append(body)
            if part.joint or not static:
                body.explicitinertial = True
                body.mass, body.ipos, body.iquat = (
                    part.body.mass,
                    part.body.centre,
                    _wxyz(part.body.axes),
                )
                body.inertia = part.body.inertia
                body.gravcomp = part.body.weightless / part.body.mass
            for shape in part.body.collisions:
                for geom in _add_shape(self._spec, body, shape):
                    self._touching(geom, contact)
        number = next(self._numbers)
        self._all[number] = _Kept(tuple(parts), tuple(contacts), static, made, motors)
        try:
            self._compile()
        except ValueError as error:
            self._spec.delete(made[0])
            del self._all[number]
            self._compile()
            raise RobotError(f"MuJoCo cannot simulate it: {error}") from None
        return number

    def _add_joint(self, body: mj.MjsBody, part: Part, damping: float) -> None:
        assert part.joint is not None
        slides, limits = part.joint.kind == "prismatic", part.joint.limits
        joint = body.add_joint(
            type=mj.mjtJoint.mjJNT_SLIDE if slides else mj.mjtJoint.mjJNT_HINGE,
            axis=part.joint.axis,
        )
        joint.damping = [damping, 0.0, 0.0] if np.ndim(joint.damping) else damping
        joint.frictionloss, joint.solref_friction, joint.solimp_friction = (
            1.0,
            (STEPS * self._dt, 1.0),
            RIGID,
        )
        joint.solref_limit, joint.solimp_limit = self._gentle, RIGID
        if (
            math.isfinite(limits.lower)
            and math.isfinite(limits.upper)
            and limits.lower < limits.upper
        ):
            joint.limited, joint.range = mj.mjtLimited.mjLIMITED_TRUE, (limits.lower, limits.upper)
        else:
            joint.limited = mj.mjtLimited.mjLIMITED_FALSE

    def _touching(self, geom: mj.MjsGeom, contact: Contact) -> None:
        geom.solref, geom.solimp = self._soft if contact.yields else self._firm, FIRM
        geom.priority = int(contact.yields)  # else the firmer of two surfaces counts
        geom.friction = [contact.friction, 0.0, 0.0]
        geom.condim = 3
        if not contact.friction:  # there is none, whatever the other surface has
            geom.condim, geom.priority = 1, 1

    def _compile(self) -> None:
        # The bodies keep their poses and velocities.
        self._model, self._data = self._spec.recompile(self._model, self._data)
        self._compiled()

    def _compiled(self) -> None:
        model = self._model
        self._owner = np.zeros(model.nbody, np.intp)  # our number of each of the model's bodies
        self._turns = np.zeros(model.ngeom, bool)  # whether a shape turns on an axle
        self._along = np.ones(model.ngeom)  # share of the friction along the axle
        self._axles = np.zeros((model.ngeom, 3))  # in the frame of the shape's body
        self._rates = np.zeros(model.nv)
        self._mu = model.geom_friction[:, 0].copy()
        for number, kept in self._all.items():
            kept.ids = [body.id for body in kept.bodies]
            self._owner[kept.ids] = number
            kept.geoms = np.flatnonzero(np.isin(model.geom_bodyid, kept.ids))
            first = kept.ids[0]
            kept.at = int(model.jnt_qposadr[model.body_jntadr[first]]) if not kept.static else -1
            kept.speed = int(model.body_dofadr[first]) if not kept.static else -1
            kept.joints_speed = [int(model.body_dofadr[index]) for index in kept.ids[1:]]
            kept.joints_at = [
                int(model.jnt_qposadr[model.body_jntadr[index]]) for index in kept.ids[1:]
            ]
            for body, part, contact in zip(kept.ids, kept.parts, kept.contacts, strict=True):
                if part.joint and part.joint.kind == "continuous":
                    geoms = np.flatnonzero(model.geom_bodyid == body)
                    self._turns[geoms], self._along[geoms] = True, contact.along_axle
                    self._axles[geoms] = part.joint.axis
            for index, motor in enumerate(kept.motors[1:], 1):
                self._set_motor(kept, index, *motor)
            if kept.frozen:
                self._freeze(kept)
        self._has_wheels = bool(self._turns.any())
        ends = np.array(
            [rotate(_xyzw(turn), (0.0, 0.0, 1.0)) for turn in model.geom_quat.tolist()]
        ).reshape(-1, 3)
        round_ = model.geom_type == mj.mjtGeom.mjGEOM_CYLINDER
        # cylinders that are wheels
        self._flat = round_ & (np.abs(np.sum(ends * self._axles, axis=1)) > PARALLEL)
        self._efforts = np.zeros(model.nv)
        self._planes = model.geom_type == mj.mjtGeom.mjGEOM_PLANE
        self._located()

    def _located(self) -> None:
        mj.mj_fwdKinematics(self._model, self._data)
        self._is_fresh = True

    def remove(self, number: int) -> None:
        self._spec.delete(self._all.pop(number).bodies[0])
        self._compile()

    def step(self) -> None:
        """One step of the world: the calls of `mj_step`, in its order, with changes to the solver's
        arrays in between.

        The friction of a contact is here the product of both surfaces' and differs along and across
        an axle, and the contacts within a robot are excluded. All that has to be set after
        `mj_collision`, which makes the contacts, and before `mj_makeConstraint`, which uses them.
        No callback of MuJoCo's comes there: `mjcb_contactfilter` sees pairs of shapes that have no
        contact yet, and `mjcb_control` comes when the constraints are made. And callbacks are
        global, for all worlds of the process.

        A motor is MuJoCo's dry friction of its joint, which has a bounded effort and holds as no
        actuator does, but brakes towards rest. `mj_fwdVelocity` calculates the reference
        acceleration that does so; the wanted rate is added to that before `mj_fwdConstraint` solves
        for the efforts.
        """
        model, data = self._model, self._data
        if not math.isfinite(float(data.qpos.sum() + data.qvel.sum())):
            raise ValueError("a pose or velocity is not finite")
        if not self._is_fresh:
            self._located()
        for kept in self._all.values():
            for part, (position, closing, rate) in kept.goals.items():
                wanted = (position - float(data.qpos[kept.joints_at[part - 1]])) / closing
                self._rates[kept.joints_speed[part - 1]] = max(-rate, min(rate, wanted))
        mj.mj_makeM(model, data)
        mj.mj_factorM(model, data)
        mj.mj_collision(model, data)
        if data.ncon:
            self._set_contacts()
        mj.mj_makeConstraint(model, data)
        mj.mj_island(model, data)
        mj.mj_transmission(model, data)
        mj.mj_projectConstraint(model, data)
        mj.mj_fwdVelocity(model, data)
        rows = np.flatnonzero(data.efc_type == mj.mjtConstraint.mjCNSTR_FRICTION_DOF)
        motors = data.efc_id[rows]
        data.efc_aref[rows] += data.efc_KBIP[rows, 1] * self._rates[motors]
        mj.mj_fwdActuation(model, data)
        mj.mj_fwdAcceleration(model, data)
        mj.mj_fwdConstraint(model, data)
        self._efforts[:] = 0.0
        self._efforts[motors] = data.efc_force[rows]
        mj.mj_implicit(model, data)
        data.qfrc_applied[:] = 0.0
        self._located()

    def _set_contacts(self) -> None:
        """Multiply the friction of both surfaces, exclude contacts within one body, and correct
        those of wheels.
        """
        contacts, model = self._data.contact, self._model
        pairs = contacts.geom
        owners = self._owner[model.geom_bodyid[pairs]]
        contacts.exclude[owners[:, 0] == owners[:, 1]] = EXCLUDED
        contacts.friction[:, :2] = np.maximum(
            self._mu[pairs[:, :1]] * self._mu[pairs[:, 1:]], LEAST
        )
        for geoms in pairs.T if self._has_wheels else ():
            if len(chosen := np.flatnonzero(self._turns[geoms])):
                self._set_wheels(chosen, geoms[chosen])

    def _set_wheels(self, chosen: Indices, geoms: Indices) -> None:
        """Correct the contacts `chosen` of the wheels `geoms`. On the rim of a cylinder they move
        to its middle, since its edges would scrub as it turns about the vertical; and friction
        differs along and across the axle.
        """
        contacts, model, data = self._data.contact, self._model, self._data
        turns = data.xmat[model.geom_bodyid[geoms]].reshape(-1, 3, 3)
        axles = np.einsum("nij,nj->ni", turns, self._axles[geoms])
        normals = contacts.frame[chosen, :3]
        level = axles - np.sum(axles * normals, axis=1, keepdims=True) * normals
        lengths = np.linalg.norm(level, axis=1)
        on_rim = lengths > RIM
        aside = (
            np.sum((contacts.pos[chosen] - data.geom_xpos[geoms]) * axles, axis=1)
            * self._flat[geoms]
        )
        contacts.pos[chosen[on_rim]] -= (aside[:, None] * axles)[on_rim]
        slides = on_rim & (self._along[geoms] < 1)
        if slides.any():
            index, across = chosen[slides], level[slides] / lengths[slides, None]
            contacts.frame[index, 3:6], contacts.frame[index, 6:9] = (
                across,
                np.cross(normals[slides], across),
            )
            mu = contacts.friction[index, 0] * self._along[geoms[slides]]
            contacts.friction[index, 0] = np.maximum(mu, LEAST)

    def close(self) -> None:
        del self._model, self._data, self._spec

    def centre(self, number: int) -> tuple[XYZ, XYZW]:
        kept, data = self._all[number], self._data
        if kept.static:
            body = kept.ids[0]
            x, y, z = self._model.body_pos[body].tolist()
            w, i, j, k = self._model.body_quat[body].tolist()
        else:
            x, y, z, w, i, j, k = data.qpos[kept.at : kept.at + 7].tolist()
        rotation = (i, j, k, w)
        cx, cy, cz = rotate(rotation, kept.parts[0].body.centre)
        return (x + cx, y + cy, z + cz), rotation

    def place(self, number: int, centre: XYZ, rotation: XYZW) -> None:
        kept = self._all[number]
        cx, cy, cz = rotate(rotation, kept.parts[0].body.centre)
        at = (centre[0] - cx, centre[1] - cy, centre[2] - cz)
        if kept.static:
            for body in (self._model.body(kept.ids[0]), kept.bodies[0]):
                body.pos, body.quat = at, _wxyz(rotation)
        else:
            self._data.qpos[kept.at : kept.at + 7] = (*at, *_wxyz(rotation))
        self._is_fresh = False

    def velocity(self, number: int) -> tuple[XYZ, XYZ]:
        kept = self._all[number]
        if kept.static:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        x, y, z, *turning = self._data.qvel[kept.speed : kept.speed + 6].tolist()
        _, rotation = self.centre(number)
        angular = rotate(rotation, (turning[0], turning[1], turning[2]))
        return velocity_at(rotate(rotation, kept.parts[0].body.centre), (x, y, z), angular), angular

    def move(self, number: int, linear: XYZ, angular: XYZ) -> None:
        kept = self._all[number]
        if kept.static:
            return
        _, rotation = self.centre(number)
        cx, cy, cz = rotate(rotation, kept.parts[0].body.centre)
        at_root = velocity_at((-cx, -cy, -cz), linear, angular)
        self._data.qvel[kept.speed : kept.speed + 6] = (
            *at_root,
            *rotate(conjugate(rotation), angular),
        )

    def freeze(self, number: int) -> None:
        self._all[number].frozen = True
        self._freeze(self._all[number])

    def _freeze(self, kept: _Kept) -> None:
        body = kept.ids[0]
        self._model.geom_contype[kept.geoms] = self._model.geom_conaffinity[kept.geoms] = 0
        self._data.qvel[kept.speed : kept.speed + 6] = 0.0
        self._data.xfrc_applied[body, :3] = -self._model.body_mass[body] * self._model.opt.gravity

    def thaw(self, number: int) -> None:
        kept = self._all[number]
        kept.frozen = False
        self._model.geom_contype[kept.geoms] = self._model.geom_conaffinity[kept.geoms] = 1
        self._data.xfrc_applied[kept.ids[0]] = 0.0

    def box(self, number: int) -> Box:
        geoms = self._all[number].geoms
        if not len(geoms):
            at, _ = self.centre(number)
            return at, at
        low, high = self._boxes(geoms)
        (x, y, z), (x2, y2, z2) = low.min(axis=0).tolist(), high.max(axis=0).tolist()
        return (x, y, z), (x2, y2, z2)

    def _boxes(self, geoms: "Indices | slice") -> tuple[Array, Array]:
        """The low corners (n, 3) and the high corners (n, 3) of the bounding boxes of shapes."""
        if not self._is_fresh:
            self._located()
        turns = self._data.geom_xmat[geoms].reshape(-1, 3, 3)
        bounds = self._model.geom_aabb[geoms]
        middle = self._data.geom_xpos[geoms] + np.einsum("nij,nj->ni", turns, bounds[:, :3])
        half = np.einsum("nij,nj->ni", np.abs(turns), bounds[:, 3:])
        half[self._planes[geoms]] = ENDLESS
        return middle - half, middle + half

    def near(self, box: Box) -> set[int]:
        low, high = self._boxes(slice(None))
        hit = (low <= box[1]).all(axis=1) & (high >= box[0]).all(axis=1)
        return set(self._owner[self._model.geom_bodyid[hit]].tolist())

    def gap(self, one: int, other: int, within: float) -> float:
        mine, theirs = self._geoms(one), self._geoms(other)
        (low, high), (low2, high2) = self._boxes(mine), self._boxes(theirs)
        apart = np.maximum(low[:, None] - high2, low2 - high[:, None]).max(axis=2)
        points = np.zeros(6)
        least = within
        # the box of a plane is far from it
        for i, j in np.argwhere((apart < within + 1e-9) | self._planes[theirs]):
            pair = int(mine[i]), int(theirs[j])
            # With a limit of 0 the engine reports no depth.
            least = min(
                least, mj.mj_geomDistance(self._model, self._data, *pair, max(within, 1e-6), points)
            )
        return least

    def _geoms(self, number: int) -> Indices:
        return self._all[number].geoms if number else np.zeros(1, np.intp)

    def touched(self, number: int) -> set[int]:
        contacts = self._data.contact
        owners = self._owner[self._model.geom_bodyid[contacts.geom[contacts.exclude != EXCLUDED]]]
        first, second = owners.T
        return {*second[first == number].tolist(), *first[second == number].tolist()}

    def is_plane(self, number: int) -> bool:
        return bool(self._planes[self._geoms(number)].any())

    def joints(self, number: int) -> JointStates:
        kept, data = self._all[number], self._data
        at, speed = kept.joints_at, kept.joints_speed
        return data.qpos[at].tolist(), data.qvel[speed].tolist(), self._efforts[speed].tolist()

    def joint(self, number: int, part: int) -> tuple[float, float]:
        kept = self._all[number]
        at, speed = kept.joints_at[part - 1], kept.joints_speed[part - 1]
        return float(self._data.qpos[at]), float(self._data.qvel[speed])

    def turn(self, number: int, part: int, rate: float, effort: float) -> None:
        kept = self._all[number]
        kept.goals.pop(part, None)
        self._set_motor(kept, part, rate, effort)

    def go(
        self, number: int, part: int, position: float, closing: float, effort: float, rate: float
    ) -> None:
        kept = self._all[number]
        self._set_motor(kept, part, 0.0, effort)
        kept.goals[part] = (position, max(closing, self._dt), rate)

    def _set_motor(self, kept: _Kept, part: int, rate: float, effort: float) -> None:
        kept.motors[part] = (rate, effort)
        speed = kept.joints_speed[part - 1]
        self._rates[speed], self._model.dof_frictionloss[speed] = rate, effort

    def push(self, number: int, part: int, effort: float) -> None:
        self._data.qfrc_applied[self._all[number].joints_speed[part - 1]] += effort

    def frame(self, number: int, part: int) -> tuple[XYZ, XYZW]:
        if not self._is_fresh:
            self._located()
        body = self._all[number].ids[part]
        x, y, z = self._data.xpos[body].tolist()
        w, i, j, k = self._data.xquat[body].tolist()
        return (x, y, z), (i, j, k, w)

    def wrench(self, number: int, part: int, force: XYZ, torque: XYZ, point: XYZ) -> None:
        if not self._is_fresh:
            self._located()
        data, body = self._data, self._all[number].ids[part]
        mj.mj_applyFT(
            self._model,
            data,
            np.array(force),
            np.array(torque),
            np.array(point),
            body,
            data.qfrc_applied,
        )


class MuJoCoRays(Rays):
    """A world in MuJoCo that is never stepped: see `Rays`."""

    def __init__(self, ground: bool) -> None:
        self._spec = mj.MjSpec()
        self._bodies: dict[int, mj.MjsBody] = {}
        self._numbers = count(1)
        if ground:
            self._spec.worldbody.add_geom(type=mj.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
        self._compiled: tuple[mj.MjModel, mj.MjData] | None = None
        self._places: dict[int, tuple[XYZ, XYZW]] = {}
        self._is_fresh = False

    def add(self, shapes: tuple[PlacedShape, ...]) -> int:
        number = next(self._numbers)
        body = self._bodies[number] = self._spec.worldbody.add_body()
        for shape in shapes:
            _add_shape(self._spec, body, shape)
        self._places[number] = (0.0, 0.0, 0.0), UPRIGHT
        self._compiled = None
        return number

    def remove(self, number: int) -> None:
        self._spec.delete(self._bodies.pop(number))
        del self._places[number]
        self._compiled = None

    def place(self, number: int, at: XYZ, rotation: XYZW) -> None:
        self._places[number] = at, rotation
        self._is_fresh = False

    def cast(self, origin: XYZ, directions: Array, near: float, far: float, own: int) -> Array:
        model, data = self._placed()
        start, ways = np.array(origin), np.ascontiguousarray(directions)
        found, geoms = np.empty(len(ways)), np.empty(len(ways), np.int32)
        body = self._bodies[own].id
        mj.mj_multiRay(
            model, data, start, ways.ravel(), None, True, body, geoms, found, None, len(ways), far
        )
        for index in np.flatnonzero((found >= 0) & (found < near)):  # look behind what is too near
            beyond = mj.mj_ray(
                model, data, start + near * ways[index], ways[index], None, True, body, None
            )
            found[index] = near + beyond if beyond >= 0 else -1.0
        return np.where((found < 0) | (found > far), np.inf, found)

    def touched(
        self, number: int, within: float, but: Collection[int]
    ) -> Iterator[tuple[int, XYZ, XYZ, float]]:
        model, data = self._placed()
        owners = {body.id: owner for owner, body in self._bodies.items()}
        bodies, fromto = [owners.get(body, 0) for body in model.geom_bodyid.tolist()], np.zeros(6)
        for own in (geom for geom, owner in enumerate(bodies) if owner == number):
            for other, owner in enumerate(bodies):
                if owner == number or owner in but:
                    continue
                # 0 of a plane, which has no end
                reach = within + model.geom_rbound[own] + model.geom_rbound[other]
                if (
                    model.geom_rbound[other]
                    and math.dist(data.geom_xpos[own], data.geom_xpos[other]) > reach
                ):
                    continue
                distance = mj.mj_geomDistance(model, data, own, other, within, fromto)
                if distance >= within:
                    continue
                away = (fromto[:3] - fromto[3:]) * math.copysign(1.0, distance)
                # they only just touch: the line between both points has no direction
                if np.linalg.norm(away) < THIN:
                    plane = data.geom_xmat[other][2::3]
                    away = (
                        data.geom_xpos[own] - data.geom_xpos[other]
                        if model.geom_rbound[other]
                        else plane
                    )
                yield owner, triple(fromto[3:]), triple(away / np.linalg.norm(away)), distance

    def _placed(self) -> tuple[mj.MjModel, mj.MjData]:
        if self._compiled is None:
            model = self._spec.compile()
            self._compiled, self._is_fresh = (model, mj.MjData(model)), False
        model, data = self._compiled
        if not self._is_fresh:
            for number, (at, rotation) in self._places.items():
                body = self._bodies[number].id
                model.body_pos[body], model.body_quat[body] = at, _wxyz(rotation)
            mj.mj_kinematics(model, data)
            self._is_fresh = True
        return self._compiled

    def close(self) -> None:
        del self._spec
        self._compiled = None


def _add_shape(spec: mj.MjSpec, body: mj.MjsBody, placed: PlacedShape) -> list[mj.MjsGeom]:
    """Add a collision shape to a body: one that is not convex as convex pieces. Returns nothing for
    a kind that has no collisions.
    """
    shape, at = placed.shape, {"pos": placed.xyz, "quat": _wxyz(placed.quaternion)}
    if shape.kind in KINDS:
        x, y, z = (*shape.size, 0.0, 0.0)[:3]
        sizes = {"box": (x / 2, y / 2, z / 2), "cylinder": (x, y / 2, 0.0), "sphere": (x, 0.0, 0.0)}
        return [body.add_geom(type=KINDS[shape.kind], size=sizes[shape.kind], **at)]
    if shape.kind == "plane":
        return [body.add_geom(type=mj.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], **at)]
    if shape.kind != "hull":
        return []
    pieces = convex_pieces(shape) if shape.triangles else (shape.points,)
    return [_add_hull(spec, body, points, at) for points in pieces]


def _add_hull(
    spec: mj.MjSpec, body: mj.MjsBody, points: tuple[XYZ, ...], at: dict[str, Any]
) -> mj.MjsGeom:
    # equal hulls share a mesh, which stays when their bodies are removed
    name = f"hull {hash(points)}"
    if spec.mesh(name) is None:
        inertia = mj.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        spec.add_mesh(name=name, uservert=_thick(np.array(points)).ravel(), inertia=inertia)
    return body.add_geom(type=mj.mjtGeom.mjGEOM_MESH, meshname=name, **at)


def _thick(points: Array) -> Array:
    """The points (n, 3) of a hull. If they are in a plane, those (2 n, 3) of a hull as thin as the
    engine allows.
    """
    middle = points - points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(middle, full_matrices=False)
    if len(points) < 4 or sizes[-1] < THIN:
        return np.concatenate([points + THIN * axis * sign for axis in axes for sign in (-1, 1)])
    return points


def _xyzw(rotation: Sequence[float]) -> XYZW:
    w, x, y, z = rotation
    return x, y, z, w


def _wxyz(rotation: XYZW) -> tuple[float, float, float, float]:
    x, y, z, w = rotation
    return w, x, y, z
