"""Bases on motor-driven wheels, whose contacts with the ground move the robot.

A differential base has wheels on two sides. Omni and mecanum wheels move it in any direction: their
rollers are links of the robot's file; a wheel without rollers touches the ground as a sphere
without friction along its axle.
"""

import math
from collections.abc import Iterable

import numpy as np

from holozen.kinematics import Wheel, travelled, wheel_rate
from holozen.limits import STOP, Planar, clamp
from holozen.robot.errors import RobotError
from holozen.robot.model import Differential, Omni, RobotModel
from holozen.robot.rotation import triple
from holozen.rotation import XYZ, XYZW
from holozen.suggest import listed

from .body import Moved
from .jointed import JointedBody, JointedMover
from .wheels import forward_sign, has_rollers, rolling_wheels


class Odometer:
    """Planar odometry from wheel encoders, integrated over exact arcs. It starts at zero."""

    def __init__(self) -> None:
        self._x = self._y = self._yaw = 0.0
        self._seen = STOP

    def update(self, rolled: Planar) -> tuple[XYZ, XYZW]:
        """The pose once the wheels have `rolled` this far in total: forward and left (m),
        counter-clockwise (rad).
        """
        x, y, turn = (now - before for now, before in zip(rolled, self._seen, strict=True))
        self._seen = rolled
        dx, dy = travelled((x, y, turn), self._yaw, 1.0)
        self._x, self._y, self._yaw = self._x + dx, self._y + dy, self._yaw + turn
        return (self._x, self._y, 0.0), (0.0, 0.0, math.sin(self._yaw / 2), math.cos(self._yaw / 2))


class RollingMover(JointedMover):
    """A base on wheels, given by the names of their joints. With an `encoder` its odometry is that
    of the wheels.
    """

    def __init__(self, body: JointedBody, wheels: Iterable[str], encoder: bool) -> None:
        super().__init__(body, frozenset(wheels))
        self._odometer = Odometer() if encoder else None

    def moved(self, time: float, dt: float) -> Moved:
        """The true pose, or the one from wheel encoders if the file asks for that."""
        if self._odometer is None:
            return super().moved(time, dt)
        positions, rates, _ = self.body.states()
        return *self._odometer.update(self._planar(positions)), self._planar(rates)

    def _planar(self, values: list[float]) -> Planar:
        """The motion of the base from the positions or rates of its joints, in the order of
        `names`.
        """
        raise NotImplementedError


SLACK = 0.1  # m/s by which a rim may lag behind its command


class DifferentialMover(RollingMover):
    """A differential or skid-steered base. Forward is along x, whatever the direction of a wheel's
    axis.
    """

    def __init__(self, body: JointedBody, model: RobotModel, mechanism: Differential) -> None:
        super().__init__(body, (*mechanism.left, *mechanism.right), mechanism.encoder)
        self._mechanism = mechanism
        self._signs = {name: forward_sign(model, name) for name in self.wheels}
        self._rims = (0.0, 0.0)  # m/s commanded to the left and right wheels

    def move(self, velocity: Planar, dt: float) -> None:
        """Drive the wheels. It cannot move sideways."""
        x, _, turn = velocity
        half = turn * self._mechanism.separation / 2
        self._rims = self._ramped((x - half, x + half), self._mechanism.acceleration * dt)
        for names, speed in zip(
            (self._mechanism.left, self._mechanism.right), self._rims, strict=True
        ):
            for name in names:
                self.body.roll(
                    name, self._signs[name] * speed / self._mechanism.radius, self._mechanism.torque
                )

    def _ramped(self, wanted: tuple[float, float], most: float) -> tuple[float, float]:
        """The speeds (m/s) of both sides' rims for the next step, in which they change by at most
        `most`. A stop is immediate, whatever the file says.
        """
        if math.isinf(most) or not any(wanted):
            return wanted
        # The ramp starts from the measured speeds; but not from small differences, which would turn
        # the robot.
        now = self._sides(self.body.states()[1])
        left, right = (n + clamp(rim - n, SLACK) for n, rim in zip(now, self._rims, strict=True))
        return left + clamp(wanted[0] - left, most), right + clamp(wanted[1] - right, most)

    def _planar(self, values: list[float]) -> Planar:
        left, right = self._sides(values)
        return (left + right) / 2, 0.0, (right - left) / self._mechanism.separation

    def _sides(self, values: list[float]) -> tuple[float, float]:
        """The mean distance (m) or speed (m/s) of the left and of the right wheels."""
        by_name = dict(zip(self.names, values, strict=True))
        sides = (self._mechanism.left, self._mechanism.right)
        left, right = (
            sum(self._signs[name] * by_name[name] for name in names) / len(names) for names in sides
        )
        return left * self._mechanism.radius, right * self._mechanism.radius


# condition number of the wheels' kinematics; beyond, some motions need far faster wheels than
# others
WORST = 100.0
UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class OmniMover(RollingMover):
    """A base on three omni or mecanum wheels or more. A wheel's rate and effort stay within the
    limits of its joint; a limit of 0 counts as none, since exporters write that for an unknown one.
    """

    def __init__(
        self, body: JointedBody, model: RobotModel, mechanism: Omni, wheels: list[Wheel]
    ) -> None:
        super().__init__(body, (wheel.joint for wheel in wheels), mechanism.encoder)
        self._limits = [(wheel, model.joints[wheel.joint].limits) for wheel in wheels]
        self._order = [body.names.index(wheel.joint) for wheel in wheels]
        self._back = np.linalg.pinv(_matrix(wheels))

    def move(self, velocity: Planar, dt: float) -> None:
        """Drive the wheels. If one cannot turn that fast, all turn slower, so that the direction is
        kept.
        """
        rates = [(wheel_rate(velocity, wheel), limits) for wheel, limits in self._limits]
        share = min(
            (limits.velocity / abs(rate) for rate, limits in rates if rate and limits.velocity),
            default=1.0,
        )
        for (wheel, _), (rate, limits) in zip(self._limits, rates, strict=True):
            self.body.roll(wheel.joint, rate * min(share, 1.0), limits.effort or math.inf)

    def _planar(self, values: list[float]) -> Planar:
        """The least-squares motion of all wheels."""
        return triple(self._back @ [values[index] for index in self._order])


def omni_wheels(model: RobotModel) -> list[Wheel]:
    """The omni wheels of a model. Raises RobotError if they cannot move it in any direction."""
    wheels = rolling_wheels(model)
    wheels = [wheel for wheel in wheels if has_rollers(model, wheel)] or wheels
    names = listed(wheel.joint for wheel in wheels)
    arm = max((math.hypot(wheel.x, wheel.y) for wheel in wheels), default=0.0)
    if len(wheels) < 3 or not arm or np.linalg.cond(_matrix(wheels) / (1.0, 1.0, arm)) > WORST:
        raise RobotError(
            f"{model.name!r} cannot drive any way on omni wheels (its wheels: {names}); it"
            " needs three continuous joints or more with level axles in different directions, "
            "each with a <cylinder>"
            " or <sphere>"
        )
    return wheels


def _matrix(wheels: list[Wheel]) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    """The rates (rad/s) of the wheels for 1 m/s forward, 1 m/s left, and 1 rad/s: (n, 3)."""
    return np.array([[wheel_rate(unit, wheel) for unit in UNITS] for wheel in wheels])
