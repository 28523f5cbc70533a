"""A planar base that forces push: Newton's laws over the plane, and the friction of its wheels.
Pure functions.

Gazebo's planar_move writes its velocity once an update period, and forces act in between. So here:
forces begin each period with the velocity of the drive, which is zero, since it is not the drive
that is commanded.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from msgspec import Struct

from holozen.command.motion import AppliedForce
from holozen.kinematics import to_body
from holozen.limits import STOP, Planar
from holozen.robot.model import PLANAR, Force, RobotModel, solid
from holozen.robot.model import Planar as PlanarDrive
from holozen.robot.rigid import Frame, joint_axes, link_frames, lump, reach_along
from holozen.rotation import XYZ, XYZW, rotate, yaw

from .dynamics import FRICTION, MAX_FRICTION
from .wheels import FLAT

# m; links whose lowest point is higher than this over the lowest of all do not touch the ground
CLEARANCE = 0.005
SWEEPS = 20  # over all contacts in a step; three wheels settle within a few
SETTLED = 1e-9  # N s


class Grip(Struct, frozen=True):
    """Where a link slides on the ground, `x`, `y` m from the centre of mass in the base's axes,
    carrying `load` kg.

    `along` and `across` are its coefficients of friction. `along` is that on the horizontal axis
    (`ax`, `ay`): the axle of a wheel that turns freely, which has 0 `across` it.
    """

    x: float
    y: float
    load: float
    ax: float
    ay: float
    along: float
    across: float


def grips(model: RobotModel) -> tuple[Grip, ...]:
    """Where a model touches level ground, with its joints at zero."""
    frames, down, body = link_frames(model), np.array((0.0, 0.0, -1.0)), lump(model)
    free = {model.joints[name].child: axis for name, axis in joint_axes(model).items()}
    lows: dict[str, tuple[float, float, float]] = {}  # depth, and the place (x, y)
    for link in model.links.values():
        for shape in link.collisions:
            frame = frames[link.name] @ Frame.of(shape.pose)
            depth = reach_along(frame, solid(shape), down)
            if math.isfinite(depth) and depth > lows.get(link.name, (-math.inf,))[0]:
                x, y, _ = frame.xyz
                lows[link.name] = depth, x - body.centre[0], y - body.centre[1]
    lowest = max((depth for depth, *_ in lows.values()), default=0.0)
    places = {name: (x, y) for name, (depth, x, y) in lows.items() if depth > lowest - CLEARANCE}
    found = []
    for (name, (x, y)), load in zip(
        places.items(), _loads(list(places.values()), body.mass), strict=True
    ):
        surface, axis = model.links[name].surface, free.get(name)
        rolling, axle = (
            FRICTION if mu is None else min(mu, MAX_FRICTION) for mu in (surface.mu1, surface.mu2)
        )
        axle = rolling if surface.mu2 is None else axle
        if axis is not None and abs(axis.direction[2]) < FLAT:
            size = math.hypot(axis.direction[0], axis.direction[1])
            found.append(
                Grip(x, y, load, axis.direction[0] / size, axis.direction[1] / size, axle, 0.0)
            )
        else:
            found.append(Grip(x, y, load, 1.0, 0.0, rolling, rolling))
    return tuple(found)


def _loads(places: Sequence[tuple[float, float]], mass: float) -> list[float]:
    """The mass in kg on each of some places around the centre of mass: what balances it, as even as
    can be.
    """
    if not places:
        return []
    xy = np.array(places).T
    even = np.full(len(places), mass / len(places))
    shares = even - np.linalg.pinv(np.vstack([np.ones(len(places)), xy])) @ np.array(
        [0.0, *(xy @ even)]
    )
    return [max(0.0, float(share)) for share in shares]


class Pushing:
    """How a model's forces push its planar base. `gravity` is in m/s^2; `forces` are by the keys of
    their commands.
    """

    def __init__(
        self, model: RobotModel, forces: Mapping[str, Sequence[Force]], gravity: float, dt: float
    ) -> None:
        body, frames = lump(model), link_frames(model)
        self._mass, self._moment = body.mass, body.moment((0.0, 0.0, 1.0))
        self._centre = body.centre
        self._grips = (
            [(grip, grip.load * gravity * dt) for grip in grips(model)]
            if body.weightless == 0
            else []
        )
        self._places = {
            key: [self._place(model, frames[one.link], one) for one in same]
            for key, same in forces.items()
        }
        mechanism = model.drive.mechanism if model.drive else PLANAR
        rate = mechanism.update_rate if isinstance(mechanism, PlanarDrive) else PLANAR.update_rate
        self._period = max(1, round(1 / (rate * dt))) if rate else 1  # steps
        self._steps = 0  # since the last update of the drive

    def _place(self, model: RobotModel, frame: Frame, force: Force) -> tuple[XYZ, XYZW | None]:
        """The link's centre of mass in the root frame, and the link's axes there if the force is
        along those.
        """
        inertial = model.links[force.link].inertial
        at = frame.position + frame.rotation @ np.array(
            inertial.pose.xyz if inertial else (0.0, 0.0, 0.0)
        )
        return (
            float(at[0]),
            float(at[1]),
            float(at[2]),
        ), frame.quaternion if force.in_link else None

    def rest(self) -> None:
        """Nothing pushes it: the next force begins a period."""
        self._steps = 0

    def velocity(
        self, pushes: Sequence[AppliedForce], pose: XYZW, twist: tuple[XYZ, XYZ], dt: float
    ) -> Planar:
        """The body-frame velocity for the next step of `dt` seconds, from the root's rotation and
        its velocity and rate in the world.
        """
        heading = yaw(pose)
        (vx, vy, _), (_, _, turn) = twist
        cx, cy, _ = rotate(pose, self._centre)
        vx, vy = vx - turn * cy, vy + turn * cx
        if self._steps == 0:
            vx, vy, turn = STOP
        self._steps = (self._steps + 1) % self._period
        fx, fy, moment = self._sum(pushes, pose, (cx, cy))
        moved = (
            vx + fx / self._mass * dt,
            vy + fy / self._mass * dt,
            turn + moment / self._moment * dt,
        )
        vx, vy, turn = slowed(moved, heading, self._grips, self._mass, self._moment)
        # As `PlanarBody.drive` takes it: that of the root, in the axes of mid-step.
        x, y = to_body(vx, vy, heading + turn * dt / 2)
        return x + turn * self._centre[1], y - turn * self._centre[0], turn

    def _sum(
        self, pushes: Sequence[AppliedForce], pose: XYZW, centre: tuple[float, float]
    ) -> Planar:
        """The horizontal force (N) and the moment (N m) about the vertical through the centre of
        mass, in the world.
        """
        x = y = moment = 0.0
        for key, wrench, _ in pushes:
            for at, axes in self._places[key]:
                force, torque = (wrench[0], wrench[1], wrench[2]), (wrench[3], wrench[4], wrench[5])
                if axes is not None:
                    force, torque = (
                        rotate(pose, rotate(axes, vector)) for vector in (force, torque)
                    )
                px, py, _ = rotate(pose, at)
                x, y = x + force[0], y + force[1]
                moment += (px - centre[0]) * force[1] - (py - centre[1]) * force[0] + torque[2]
        return x, y, moment


def slowed(
    velocity: Planar,
    heading: float,
    grips: Sequence[tuple[Grip, float]],
    mass: float,
    moment: float,
) -> Planar:
    """A velocity of the centre of mass in the world (m/s, rad/s) after a step's Coulomb friction at
    `grips`, each with the momentum (N s) of its load in that step. Friction slows what slides, and
    pushes nothing.
    """
    (vx, vy, turn), (c, s) = velocity, (math.cos(heading), math.sin(heading))
    rows = []
    for grip, load in grips:
        x, y = grip.x * c - grip.y * s, grip.x * s + grip.y * c
        ax, ay = grip.ax * c - grip.ay * s, grip.ax * s + grip.ay * c
        for most, dx, dy in ((grip.along * load, ax, ay), (grip.across * load, -ay, ax)):
            if most:
                arm = x * dy - y * dx
                rows.append([most, dx, dy, arm, 1 / (1 / mass + arm * arm / moment), 0.0])
    for _ in range(SWEEPS):
        changed = 0.0
        for row in rows:
            most, dx, dy, arm, inert, before = row
            after = min(most, max(-most, before - (vx * dx + vy * dy + turn * arm) * inert))
            change = after - before
            if change:
                row[5] = after
                vx, vy, turn = (
                    vx + change * dx / mass,
                    vy + change * dy / mass,
                    turn + change * arm / moment,
                )
                changed = max(changed, abs(change))
        if changed < SETTLED:
            break
    return vx, vy, turn
