"""The gains that hold a wheeled inverted pendulum upright. Pure mathematics, SI units."""

from dataclasses import dataclass

import numpy as np

from holozen.robot.rotation import Array

GRAVITY = 9.8  # m/s^2
LEAN, LEAN_RATE, SPEED, DISTANCE, EFFORT = 0.2, 1.0, 0.1, 0.1, 0.1
"""What one thinks large, in rad, rad/s, m/s, m and N m (Bryson's rule): the squares' inverses weigh them."""

Gains = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Pendulum:
    """A body on wheels, in SI units: masses of the body and of all wheels, the wheels' radius, the height of the body's
    centre of mass over the axle, the height of the axle in the root frame, and the inertias of the body and of all
    wheels about the axle's direction.
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
        """The mass matrix (2, 2) of (way, lean), upright."""
        along, mixed = self.body_mass + self.wheel_mass + self.wheel_inertia / self.radius**2, self._moment
        return np.array([[along, mixed], [mixed, self.body_inertia + mixed * self.height]])

    @property
    def lean_per_acceleration(self) -> float:
        """The lean in rad that a steady 1 m/s^2 needs."""
        (along, mixed), _ = self.inertia
        return float(self.radius * along + mixed) / (self._moment * GRAVITY)

    @property
    def lag(self) -> float:
        """How far in m the axle is behind the point that accelerates as the body leans, for 1 rad of lean."""
        (along, mixed), (_, about) = self.inertia
        return float((self.radius * mixed + about) / (self.radius * along + mixed))

    @property
    def _moment(self) -> float:
        return self.body_mass * self.height


def gains(pendulum: Pendulum, dt: float) -> Gains:
    """The torque in N m on the wheels for each rad of lean, rad/s of leaning, m/s too fast and m too far.

    Linear quadratic regulator of the pendulum linearised upright, for steps of `dt` seconds. Source of the model: Kim,
    Kim and Kwak, "Dynamic analysis of a nonholonomic two-wheeled inverted pendulum robot", J. Intell. Robot. Syst. 44,
    2005; of the iteration: Anderson and Moore, Optimal Control, 1990, section 2.4.
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
    """The discrete motion of (lean, lean rate, speed, distance) with a torque that drives the wheels forward."""
    falling = np.linalg.solve(p.inertia, [0.0, p.body_mass * GRAVITY * p.height])
    pushed = np.linalg.solve(p.inertia, [1 / p.radius, -1.0])
    rates = np.zeros((4, 4))
    rates[0, 1] = rates[3, 2] = 1.0
    rates[1, 0], rates[2, 0] = falling[1], falling[0]
    push = np.array([[0.0], [pushed[1]], [pushed[0]], [0.0]])
    return np.eye(4) + rates * dt, push * dt
