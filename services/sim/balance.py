"""Two wheels that hold a body upright while they drive it, as wheely_boi's plugin does."""

import math

import numpy as np

from holozen.limits import Planar, clamp
from holozen.robot.assembly import Part, assemble
from holozen.robot.drives import Balancing
from holozen.robot.errors import RobotError
from holozen.robot.model import RobotModel
from holozen.robot.rigid import joint_axes
from holozen.robot.rotation import matrix_of_quaternion

from .engine import Rotation, Vector, turned, yaw_of
from .jointed import JointedBody
from .pendulum import GRAVITY, Pendulum, gains
from .plan import Plan
from .wheels import forward_sign, radius_of

FALLEN = 1.0  # rad of lean from which no wheel brings it back: the motors are off
LEAN = 0.45  # rad to which it leans at most to speed up, or to slow down
TURN = 8.0  # rad/s^2 by which its turn speeds up
STRAY = 0.3  # m/s from its plan that it tries to mend at once; a harder push makes a new plan
FARTHEST = 0.1  # m that it remembers to be behind, or ahead
GRIP = 0.7  # of the friction of its wheels is used; a wheel that slips steers nobody
STILL = 0.01  # m/s; a plan slower than this is to stand
NEAR = 0.01  # m
FORGETS = 0.3  # s
ASTRAY = 0.3  # rad that it remembers to have turned too little, or too far
YAW_GAIN = 12.0  # 1/s: how fast a wrong turn rate is mended
YAW_TIME = 0.3  # s: and a wrong heading


class BalanceMover:
    """A body on two wheels. It leans to speed up and to slow down, so that a stop takes it some tenths of a second."""

    def __init__(self, body: JointedBody, model: RobotModel, mechanism: Balancing, dt: float) -> None:
        self.body, self.names = body, body.names
        self.wheels, self.kept = frozenset[str](), frozenset((mechanism.left, mechanism.right))
        self._sides = (mechanism.left, mechanism.right)
        self._signs = [forward_sign(model, name) for name in self._sides]
        self._pendulum = pendulum_of(model, self._sides)
        self._gains = gains(self._pendulum, dt)
        self._most, self._yaw_gain = _strengths(model, self._sides, self._pendulum)
        self._hardest = LEAN / self._pendulum.lean_per_acceleration
        self._behind = 0.0  # rad that it has turned too little
        self._rest()
        for name in self._sides:
            body.release(name, friction=0.0)  # the plugin takes it away, whatever the file says

    def move(self, velocity: Planar, dt: float) -> None:
        """Push the wheels for the next step. Sideways it cannot go."""
        x, _, turn = velocity
        state = lean, _, speed, turning = self._state()
        if abs(lean) > FALLEN:
            self._rest()
            return self._push(0.0, 0.0)
        self._plan.keep_near(speed, STRAY)
        self._plan.step(x, dt)
        self._turn += clamp(turn - self._turn, TURN * dt)
        slow = self._turn - turning
        self._behind = clamp(self._behind + slow * dt, ASTRAY)
        if not (x or turn or self._turn) and abs(self._plan.speed) < STILL:
            # Told to stand, it forgets its heading, and its place when it is near: its wheels stick and slip, and it
            # would hunt for ever.
            self._behind = 0.0
            if abs(self._ahead) < NEAR:
                self._ahead *= 1 - dt / FORGETS
        drive = clamp(self._effort(state[:3], dt) / 2, self._most)
        # Balance comes first: the turn gets what strength is left.
        steer = clamp(self._yaw_gain * (slow + self._behind / YAW_TIME), self._most - abs(drive))
        return self._push(drive - steer, drive + steer)

    def _rest(self) -> None:
        self._plan = Plan(self._hardest)
        self._ahead: float = 0.0  # m that it is too far
        self._turn: float = 0.0  # rad/s that it is to turn at now
        self._behind = 0.0

    def _effort(self, state: tuple[float, float, float], dt: float) -> float:
        """The torque of both wheels: what the plan needs, and what mends the errors."""
        plan, pendulum, leaning = self._plan, self._pendulum, self._pendulum.lean_per_acceleration
        lean, rate, speed = state
        bend = leaning * plan.snap  # the lean's second derivative
        fast = speed - (plan.speed - pendulum.lag * leaning * plan.jerk)
        self._ahead = clamp(self._ahead + fast * dt, FARTHEST)
        errors = (lean - leaning * plan.acceleration, rate - leaning * plan.jerk, fast, self._ahead)
        mending = sum(gain * error for gain, error in zip(self._gains, errors, strict=True))
        along, mixed = pendulum.inertia[0]
        needed = pendulum.radius * float(along * (plan.acceleration - pendulum.lag * bend) + mixed * bend)
        return needed - mending

    def moved(self, time: float, dt: float) -> tuple[Vector, Rotation, Planar]:
        """The true pose."""
        return *self.body.pose(), self.body.planar()

    def states(self) -> tuple[list[float], list[float]]:
        """Positions and rates of the joints."""
        return self.body.states()

    def _push(self, left: float, right: float) -> None:
        for name, sign, effort in zip(self._sides, self._signs, (left, right), strict=True):
            self.body.push(name, sign * effort)

    def _state(self) -> tuple[float, float, float, float]:
        """Lean (rad, forward), its rate, the axle's speed forward (m/s) and the turn rate (rad/s)."""
        _, rotation = self.body.pose()
        linear, angular = self.body.twist()
        yaw = yaw_of(rotation)
        cosine, sine = math.cos(yaw), math.sin(yaw)
        up = turned(rotation, (0.0, 0.0, 1.0))
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
    radius = radius_of(model, model.joints[wheels[0]].child)
    if len(turning) != 2 or not radius or body.centre[2] <= axle:
        raise RobotError(
            f"{model.name!r} cannot balance on {' and '.join(wheels)}: it needs two round wheels with mass,"
            " and a body whose centre of mass is above their axle"
        )
    return Pendulum(
        body_mass=body.mass,
        wheel_mass=sum(part.body.mass for part in turning),
        radius=radius,
        height=body.centre[2] - axle,
        axle=axle,
        body_inertia=_about(parts[0], (0.0, 1.0, 0.0)),
        wheel_inertia=sum(_about(part, part.joint.axis) for part in turning if part.joint),
    )


def _about(part: Part, axis: Vector) -> float:
    """A part's moment of inertia about an axis through its centre of mass."""
    along = matrix_of_quaternion(part.body.axes).T @ np.array(axis)
    return float(np.array(part.body.inertia) @ along**2)


def _strengths(model: RobotModel, wheels: tuple[str, str], pendulum: Pendulum) -> tuple[float, float]:
    """The torque in N m that a wheel can bring to the ground, and the gain from a wrong turn rate to a torque."""
    mass = pendulum.body_mass + pendulum.wheel_mass
    mu = model.links[model.joints[wheels[0]].child].surface.mu1
    grip = GRIP * (1.0 if mu is None else mu) * mass * GRAVITY / 2
    axes = joint_axes(model)
    half = abs(axes[wheels[0]].xyz[1] - axes[wheels[1]].xyz[1]) / 2
    return grip * pendulum.radius, YAW_GAIN * mass * half * pendulum.radius / 2
