"""The joints of a planar base: they turn only visually, as wheels that roll without slipping."""

import math

from holozen.kinematics import Wheel, mecanum_rates, wheel_rate
from holozen.limits import Planar
from holozen.robot.model import Mecanum, RobotModel
from holozen.robot.rigid import Axis, joint_axes

FLAT = 0.1  # sine of the axle's angle to the ground; a steeper joint is not a wheel


class Wheels:
    """Angles (rad) and rates (rad/s) of the moving joints, in the order of `names`; those of no wheel stay at 0."""

    def __init__(self, model: RobotModel) -> None:
        axes = joint_axes(model)
        self.names = list(axes)
        self._wheels = [_wheel(model, name, axes[name]) for name in self.names]
        self.angles = [0.0] * len(self.names)
        self.rates = [0.0] * len(self.names)

    def roll(self, velocity: Planar, dt: float) -> None:
        """Roll for `dt` seconds at the body-frame `velocity`."""
        self.rates = [wheel_rate(velocity, wheel) if wheel else 0.0 for wheel in self._wheels]
        self.angles = [angle + rate * dt for angle, rate in zip(self.angles, self.rates, strict=True)]


class MecanumWheels:
    """As Wheels, for four wheels with rollers at 45 degrees; other joints stay at 0."""

    def __init__(self, model: RobotModel, mechanism: Mecanum) -> None:
        axes = joint_axes(model)
        self.names = list(axes)
        self._driven = (mechanism.front_left, mechanism.front_right, mechanism.back_left, mechanism.back_right)
        fl, fr, bl, _ = (axes[name].xyz for name in self._driven)
        self._arm = ((mechanism.separation or abs(fl[1] - fr[1])) + (mechanism.wheelbase or abs(fl[0] - bl[0]))) / 2
        self._radius = mechanism.radius or radius_of(model, model.joints[self._driven[0]].child)
        self._signs = [forward_sign(model, name) for name in self._driven]
        self.angles = [0.0] * len(self.names)
        self.rates = [0.0] * len(self.names)

    def roll(self, velocity: Planar, dt: float) -> None:
        """Roll for `dt` seconds at the body-frame `velocity`."""
        turning = mecanum_rates(velocity, self._arm, self._radius)
        rates = {name: sign * rate for name, sign, rate in zip(self._driven, self._signs, turning, strict=True)}
        self.rates = [rates.get(name, 0.0) for name in self.names]
        self.angles = [angle + rate * dt for angle, rate in zip(self.angles, self.rates, strict=True)]


def forward_sign(model: RobotModel, joint: str) -> float:
    """1 where a positive rate of a wheel rolls the robot forward, so its axis points left; else -1."""
    return -1.0 if joint_axes(model)[joint].direction[1] < 0 else 1.0


def _wheel(model: RobotModel, name: str, axis: Axis) -> Wheel | None:
    joint = model.joints[name]
    radius = radius_of(model, joint.child)
    length = math.hypot(axis.direction[0], axis.direction[1])
    if joint.kind != "continuous" or not radius or abs(axis.direction[2]) > FLAT:
        return None
    ax, ay = axis.direction[0] / length, axis.direction[1] / length
    return Wheel(name, axis.xyz[0], axis.xyz[1], ax, ay, radius)


def radius_of(model: RobotModel, link: str) -> float:
    """The radius in metres of a link's first round collision shape; 0 if it has none."""
    round_shapes = (shape for shape in model.links[link].collisions if shape.kind in ("cylinder", "sphere"))
    return next((shape.size[0] for shape in round_shapes), 0.0)
