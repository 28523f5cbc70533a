"""Two wheels that hold a body upright while they drive it, as wheely_boi's plugin does."""

import math

import numpy as np
from msgspec import Struct

from holozen.limits import Planar, clamp
from holozen.robot.errors import RobotError
from holozen.robot.model import Balancing, RobotModel
from holozen.robot.rigid import assemble, joint_axes, round_radius
from holozen.robot.rotation import Array
from holozen.rotation import rotate
from holozen.rotation import yaw as yaw_of

from .dynamics import GRAVITY
from .jointed import JointedBody, JointedMover
from .wheels import forward_sign

LEAN, LEAN_RATE, SPEED, DISTANCE, EFFORT = 0.2, 1.0, 0.1, 0.1, 0.1
"""The largest acceptable deviations in rad, rad/s, m/s, m and N m; the weights are their inverse
squares (Bryson).
"""

Gains = tuple[float, float, float, float]


class Pendulum(Struct, frozen=True):
    """A body on wheels, in SI units: the masses of the body and of all wheels, the wheels' radius,
    the height of the body's centre of mass above the axle, the height of the axle in the root
    frame, and the inertias of the body and of all wheels about the direction of the axle.
    """

    body_mass: float
    wheel_mass: float
    radius: float
    height: float
    axle: float
    body_inertia: float
    wheel_inertia: float

    @property
    def inertia(self) -> Array:
        """The mass matrix (2, 2) for (distance, lean) of the upright body."""
        along, mixed = (
            self.body_mass + self.wheel_mass + self.wheel_inertia / self.radius**2,
            self._moment,
        )
        return np.array([[along, mixed], [mixed, self.body_inertia + mixed * self.height]])

    @property
    def lean_per_acceleration(self) -> float:
        """The lean in rad for a steady acceleration of 1 m/s^2."""
        (along, mixed), _ = self.inertia
        return float(self.radius * along + mixed) / (self._moment * GRAVITY)

    @property
    def lag(self) -> float:
        """The distance in m, per rad of lean, of the axle behind the point whose acceleration is
        that of the lean.
        """
        (along, mixed), (_, about) = self.inertia
        return float((self.radius * mixed + about) / (self.radius * along + mixed))

    @property
    def _moment(self) -> float:
        return self.body_mass * self.height


def gains(pendulum: Pendulum, dt: float) -> Gains:
    """The torque in N m on the wheels per rad of lean, rad/s of lean rate, m/s of speed error and m
    of distance error.

    They are those of a linear quadratic regulator for the pendulum, linearised upright, in steps of
    `dt` seconds.
    Source of the model: Kim, Kim and Kwak, "Dynamic analysis of a nonholonomic two-wheeled inverted
    pendulum robot", J. Intell. Robot. Syst. 44, 2005; of the iteration: Anderson and Moore, Optimal
    Control, 1990, section 2.4.
    """
    step, push = _motion(pendulum, dt)
    weights = np.diag([1 / LEAN**2, 1 / LEAN_RATE**2, 1 / SPEED**2, 1 / DISTANCE**2])
    cost: Array = weights
    found: Array = np.zeros((1, 4))
    for _ in range(5000):
        before, found = found, push.T @ cost @ step / (1 / EFFORT**2 + push.T @ cost @ push)
        cost = weights + step.T @ cost @ (step - push @ found)
        if np.allclose(found, before, rtol=1e-6):
            break
    lean, rate, speed, distance = (float(value) for value in found[0])
    return lean, rate, speed, distance


def _motion(p: Pendulum, dt: float) -> tuple[Array, Array]:
    """The discrete state space of (lean, lean rate, speed, distance): the matrices (4, 4) of the
    state, and (4, 1) of a torque that drives the wheels forward.
    """
    falling = np.linalg.solve(p.inertia, [0.0, p.body_mass * GRAVITY * p.height])
    pushed = np.linalg.solve(p.inertia, [1 / p.radius, -1.0])
    rates = np.zeros((4, 4))
    rates[0, 1] = rates[3, 2] = 1.0
    rates[1, 0], rates[2, 0] = falling[1], falling[0]
    push = np.array([[0.0], [pushed[1]], [pushed[0]], [0.0]])
    return np.eye(4) + rates * dt, push * dt


SOON, SOONER, SOONEST = 4.0, 10.0, 20.0  # 1/s: how fast speed, acceleration and jerk converge


class VelocityProfile:
    """A smooth speed (m/s) with its acceleration, jerk and snap. `max_acceleration` is in m/s^2."""

    def __init__(self, max_acceleration: float) -> None:
        self._max_acceleration = max_acceleration
        self.speed = self.acceleration = self.jerk = self.snap = 0.0

    def step(self, wanted: float, dt: float) -> None:
        """Approach the wanted speed for `dt` seconds."""
        pull = clamp(SOON * (wanted - self.speed), self._max_acceleration)
        self.snap = SOONEST * (SOONER * (pull - self.acceleration) - self.jerk)
        self.jerk += self.snap * dt
        self.acceleration += self.jerk * dt
        self.speed += self.acceleration * dt

    def follow(self, speed: float, tolerance: float) -> None:
        """Move the profile to within `tolerance` (m/s) of the true `speed`, for a robot that was
        pushed.
        """
        self.speed = speed + clamp(self.speed - speed, tolerance)


FALLEN = 1.0  # rad of lean that no wheel can correct; beyond, the motors are off
MAX_LEAN = 0.45  # rad, to speed up or to slow down
TURN = 8.0  # rad/s^2 of yaw
STRAY = 0.3  # m/s of speed error that it corrects; a harder push shifts the profile
MAX_AHEAD = 0.1  # m; limit of the integrated position error
GRIP = 0.7  # the share of the wheels' friction that is used: a wheel that slips does not steer
STILL = 0.01  # m/s; a slower profile means standing
NEAR = 0.01  # m of position error that decays while it stands
FORGETS = 0.3  # s; time constant of that
ASTRAY = 0.3  # rad; limit of the integrated heading error
YAW_GAIN = 12.0  # 1/s; gain of the turn rate's error
YAW_TIME = 0.3  # s; time constant in which a heading error is corrected


class BalanceMover(JointedMover):
    """A body on two wheels. It leans to speed up and to slow down, so a stop takes some tenths of a
    second.
    """

    def __init__(
        self, body: JointedBody, model: RobotModel, mechanism: Balancing, dt: float
    ) -> None:
        self._sides = (mechanism.left, mechanism.right)
        super().__init__(body, reserved=frozenset(self._sides))
        self._signs = [forward_sign(model, name) for name in self._sides]
        self._pendulum = pendulum_of(model, self._sides)
        self._gains = gains(self._pendulum, dt)
        self._most, self._yaw_gain = _strengths(model, self._sides, self._pendulum)
        self._max_acceleration = MAX_LEAN / self._pendulum.lean_per_acceleration
        self._rest()
        for name in self._sides:
            # Gazebo's plugin sets it to zero, whatever the file has
            body.release(name, friction=0.0)

    def _rest(self) -> None:
        self._profile = VelocityProfile(self._max_acceleration)
        self._ahead = 0.0  # m of position error
        self._turn = 0.0  # rad/s; the commanded turn rate, ramped
        self._behind = 0.0  # rad of heading error

    def move(self, velocity: Planar, dt: float) -> None:
        """Drive the wheels for the next step. It cannot move sideways."""
        x, _, turn = velocity
        state = lean, _, speed, turning = self._state()
        if abs(lean) > FALLEN:
            self._rest()
            return self._push(0.0, 0.0)
        self._profile.follow(speed, STRAY)
        self._profile.step(x, dt)
        self._turn += clamp(turn - self._turn, TURN * dt)
        slow = self._turn - turning
        self._behind = clamp(self._behind + slow * dt, ASTRAY)
        if not (x or turn or self._turn) and abs(self._profile.speed) < STILL:
            # At a stop it forgets its heading error, and a small position error: else it would
            # oscillate for ever, as its wheels stick and slip.
            self._behind = 0.0
            if abs(self._ahead) < NEAR:
                self._ahead *= 1 - dt / FORGETS
        drive = clamp(self._effort(state[:3], dt) / 2, self._most)
        # Balance has priority: turning gets the remaining torque.
        steer = clamp(self._yaw_gain * (slow + self._behind / YAW_TIME), self._most - abs(drive))
        return self._push(drive - steer, drive + steer)

    def _effort(self, state: tuple[float, float, float], dt: float) -> float:
        """The torque (N m) of both wheels together: feedforward of the profile, and feedback of the
        errors.
        """
        profile, pendulum, leaning = (
            self._profile,
            self._pendulum,
            self._pendulum.lean_per_acceleration,
        )
        lean, rate, speed = state
        bend = leaning * profile.snap  # the lean's second derivative
        fast = speed - (profile.speed - pendulum.lag * leaning * profile.jerk)
        self._ahead = clamp(self._ahead + fast * dt, MAX_AHEAD)
        errors = (
            lean - leaning * profile.acceleration,
            rate - leaning * profile.jerk,
            fast,
            self._ahead,
        )
        feedback = sum(gain * error for gain, error in zip(self._gains, errors, strict=True))
        along, mixed = pendulum.inertia[0]
        feedforward = pendulum.radius * float(
            along * (profile.acceleration - pendulum.lag * bend) + mixed * bend
        )
        return feedforward - feedback

    def _push(self, left: float, right: float) -> None:
        for name, sign, effort in zip(self._sides, self._signs, (left, right), strict=True):
            self.body.push(name, sign * effort)

    def _state(self) -> tuple[float, float, float, float]:
        """Lean (rad, forward), its rate, the axle's speed forward (m/s) and the turn rate
        (rad/s).
        """
        _, rotation = self.body.pose()
        linear, angular = self.body.twist()
        yaw = yaw_of(rotation)
        cosine, sine = math.cos(yaw), math.sin(yaw)
        up = rotate(rotation, (0.0, 0.0, 1.0))
        lean = math.atan2(up[0] * cosine + up[1] * sine, up[2])
        rate = angular[1] * cosine - angular[0] * sine
        speed = linear[0] * cosine + linear[1] * sine + self._pendulum.axle * rate
        return lean, rate, speed, angular[2]


def pendulum_of(model: RobotModel, wheels: tuple[str, str]) -> Pendulum:
    """The robot as a pendulum. Raises RobotError if its body does not stand on its wheels."""
    parts, axes = assemble(model), joint_axes(model)
    body = parts[0].body
    turning = [part for part in parts if part.joint and part.joint.name in wheels]
    axle = axes[wheels[0]].xyz[2]
    radius = round_radius(model.links[model.joints[wheels[0]].child])
    if len(turning) != 2 or not radius or body.centre[2] <= axle:
        raise RobotError(
            f"{model.name!r} cannot balance on {' and '.join(wheels)}: it needs two round wheels "
            "with mass,"
            " and a body whose centre of mass is above their axle"
        )
    return Pendulum(
        body_mass=body.mass,
        wheel_mass=sum(part.body.mass for part in turning),
        radius=radius,
        height=body.centre[2] - axle,
        axle=axle,
        body_inertia=parts[0].body.moment((0.0, 1.0, 0.0)),
        wheel_inertia=sum(part.body.moment(part.joint.axis) for part in turning if part.joint),
    )


def _strengths(
    model: RobotModel, wheels: tuple[str, str], pendulum: Pendulum
) -> tuple[float, float]:
    """The largest torque (N m) at which a wheel does not slip, and the gain from a turn rate error
    to torque.
    """
    mass = pendulum.body_mass + pendulum.wheel_mass
    mu = model.links[model.joints[wheels[0]].child].surface.mu1
    grip = GRIP * (1.0 if mu is None else mu) * mass * GRAVITY / 2
    axes = joint_axes(model)
    half = abs(axes[wheels[0]].xyz[1] - axes[wheels[1]].xyz[1]) / 2
    return grip * pendulum.radius, YAW_GAIN * mass * half * pendulum.radius / 2
