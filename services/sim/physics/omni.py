"""Omni and mecanum wheels, driven by motors; contacts with the ground move the robot any way.

A wheel's rollers are those of its file, links that turn on it; without such it touches the ground as a sphere without
friction along its axle.
"""

import math

import numpy as np

from holozen.kinematics import Wheel, wheel_rate
from holozen.limits import Planar
from holozen.robot.errors import RobotError
from holozen.robot.model import Omni, RobotModel
from holozen.robot.rotation import triple
from holozen.suggest import listed

from .body import Moved
from .engine import JointStates
from .jointed import JointedBody
from .wheels import Odometer, has_rollers, rolling_wheels

WORST = 100.0  # condition of the wheels' kinematics: beyond, some motion takes far more of a wheel than others
UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class OmniMover:
    """A base on three omni wheels or more. A wheel's rate and effort stay within the limits of its joint; 0 is what
    exporters write for an unknown one.
    """

    def __init__(self, body: JointedBody, model: RobotModel, mechanism: Omni, wheels: list[Wheel]) -> None:
        self.body, self.names, self._encoder = body, body.names, mechanism.encoder
        self.wheels, self.kept = frozenset(wheel.joint for wheel in wheels), frozenset[str]()
        self._limits = [(wheel, model.joints[wheel.joint].limits) for wheel in wheels]
        self._order = [body.names.index(wheel.joint) for wheel in wheels]
        self._back = np.linalg.pinv(_matrix(wheels))
        self._odometer = Odometer()

    def move(self, velocity: Planar, dt: float) -> None:
        """Drive the wheels; where one of them cannot turn as fast, all turn slower, and the direction is kept."""
        rates = [(wheel_rate(velocity, wheel), limits) for wheel, limits in self._limits]
        share = min((limits.velocity / abs(rate) for rate, limits in rates if rate and limits.velocity), default=1.0)
        for (wheel, _), (rate, limits) in zip(self._limits, rates, strict=True):
            self.body.roll(wheel.joint, rate * min(share, 1.0), limits.effort or math.inf)

    def moved(self, time: float, dt: float) -> Moved:
        """The true pose, or the one from wheel encoders if the file asks for that."""
        if not self._encoder:
            return *self.body.pose(), self.body.planar()
        angles, rates, _ = self.body.states()
        return *self._odometer.update(self._planar(angles)), self._planar(rates)

    def states(self) -> JointStates:
        """The states of the joints."""
        return self.body.states()

    def _planar(self, values: list[float]) -> Planar:
        """The motion of the base, from those of its joints: the least squares of all wheels."""
        return triple(self._back @ [values[index] for index in self._order])


def omni_wheels(model: RobotModel) -> list[Wheel]:
    """The wheels of a model. Raises RobotError if they cannot move it any way."""
    wheels = rolling_wheels(model)
    wheels = [wheel for wheel in wheels if has_rollers(model, wheel)] or wheels
    names = listed(wheel.joint for wheel in wheels)
    arm = max((math.hypot(wheel.x, wheel.y) for wheel in wheels), default=0.0)
    if len(wheels) < 3 or not arm or np.linalg.cond(_matrix(wheels) / (1.0, 1.0, arm)) > WORST:
        raise RobotError(
            f"{model.name!r} cannot drive any way on omni wheels (its wheels: {names}); it"
            " needs three continuous joints or more with level axles in different directions, each with a <cylinder>"
            " or <sphere>"
        )
    return wheels


def _matrix(wheels: list[Wheel]) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    """The rates (rad/s) of the wheels for 1 m/s forward, 1 m/s left, and 1 rad/s: (n, 3)."""
    return np.array([[wheel_rate(unit, wheel) for unit in UNITS] for wheel in wheels])
