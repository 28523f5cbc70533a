"""How a balancing robot's speed is to change: smoothly enough to lean in time. No clock, no engine; SI units."""

from holozen.limits import clamp

SOON, SOONER, SOONEST = 4.0, 10.0, 20.0  # 1/s: how fast speed, acceleration and jerk come to what is wanted


class Plan:
    """A speed (m/s) with its acceleration, jerk and snap. `hardest` in m/s^2 is the most that it accelerates."""

    def __init__(self, hardest: float) -> None:
        self._hardest = hardest
        self.speed = self.acceleration = self.jerk = self.snap = 0.0

    def step(self, wanted: float, dt: float) -> None:
        """Come nearer to the wanted speed for `dt` seconds."""
        pull = clamp(SOON * (wanted - self.speed), self._hardest)
        self.snap = SOONEST * (SOONER * (pull - self.acceleration) - self.jerk)
        self.jerk += self.snap * dt
        self.acceleration += self.jerk * dt
        self.speed += self.acceleration * dt

    def keep_near(self, speed: float, most: float) -> None:
        """Plan anew from not farther than `most` from a speed, for one that was pushed away from the plan."""
        self.speed = speed + clamp(self.speed - speed, most)
