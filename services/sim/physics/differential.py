"""Wheels on two sides, driven by motors; contacts with the ground move the robot."""

import math

from holozen.limits import Planar, clamp
from holozen.robot.model import Differential, RobotModel
from holozen.robot.rigid import joint_axes

from .body import Moved
from .engine import JointStates
from .jointed import JointedBody
from .wheels import Odometer, forward_sign, radius_of

SLACK = 0.1  # m/s by which a rim may lag behind its command


class WheelMover:
    """A differential or skid-steered base. Forward is along x, whatever the direction of a wheel's axis."""

    def __init__(self, body: JointedBody, model: RobotModel, mechanism: Differential) -> None:
        self.body, self._mechanism = body, mechanism
        self.names = body.names
        self.wheels, self.kept = frozenset((*mechanism.left, *mechanism.right)), frozenset[str]()
        self._signs = {name: forward_sign(model, name) for name in self.wheels}
        self._separation = mechanism.separation or separation_of(model, mechanism)
        self._radius = mechanism.radius or radius_of(model, model.joints[mechanism.left[0]].child)
        self._odometer = Odometer()
        self._rims = (0.0, 0.0)  # m/s commanded to the left and right wheels

    def move(self, velocity: Planar, dt: float) -> None:
        """Drive the wheels. It cannot move sideways."""
        x, _, turn = velocity
        half = turn * self._separation / 2
        self._rims = self._ramped((x - half, x + half), self._mechanism.acceleration * dt)
        for names, speed in zip((self._mechanism.left, self._mechanism.right), self._rims, strict=True):
            for name in names:
                self.body.roll(name, self._signs[name] * speed / self._radius, self._mechanism.torque)

    def _ramped(self, wanted: tuple[float, float], most: float) -> tuple[float, float]:
        """The speeds of both sides' rims for the next step, in which they change by no more than `most`, in m/s. A stop
        is immediate, whatever the file has.
        """
        if math.isinf(most) or not any(wanted):
            return wanted
        now = self._sides(dict(zip(self.names, self.body.states()[1], strict=True)))
        # Resistance also holds the ramp back; but small differences would turn the robot.
        left, right = (n + clamp(rim - n, SLACK) for n, rim in zip(now, self._rims, strict=True))
        return left + clamp(wanted[0] - left, most), right + clamp(wanted[1] - right, most)

    def moved(self, time: float, dt: float) -> Moved:
        """The true pose, or the one from wheel encoders if the file asks for that."""
        if not self._mechanism.encoder:
            return *self.body.pose(), self.body.planar()
        positions, rates, _ = self.body.states()
        angles, speeds = dict(zip(self.names, positions, strict=True)), dict(zip(self.names, rates, strict=True))
        position, rotation = self._odometer.update(self._planar(*self._sides(angles)))
        return position, rotation, self._planar(*self._sides(speeds))

    def states(self) -> JointStates:
        """The states of the joints."""
        return self.body.states()

    def _planar(self, left: float, right: float) -> Planar:
        """The motion of the base, from those of its sides."""
        return (left + right) / 2, 0.0, (right - left) / self._separation

    def _sides(self, values: dict[str, float]) -> tuple[float, float]:
        """The mean distance (m) or speed (m/s) of the left and of the right wheels."""
        sides = (self._mechanism.left, self._mechanism.right)
        left, right = (sum(self._signs[name] * values[name] for name in names) / len(names) for names in sides)
        return left * self._radius, right * self._radius


def separation_of(model: RobotModel, mechanism: Differential) -> float:
    """The distance in metres between the two sides' wheels, by their links."""
    axes = joint_axes(model)
    left, right = (sum(axes[n].xyz[1] for n in names) / len(names) for names in (mechanism.left, mechanism.right))
    return abs(left - right)
