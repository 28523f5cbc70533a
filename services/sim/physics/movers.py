"""The mechanisms of drives: from the commanded velocity to the engine, and back to odometry."""

import math
from typing import Protocol

from holozen.limits import Planar, clamp_speed, ramp
from holozen.robot import model as drives
from holozen.robot.model import Balancing, Differential, Drive, Mecanum, Omni, RobotModel
from holozen.robot.rigid import lump
from holozen.rotation import XYZ, XYZW

from .balance import BalanceMover
from .body import Body, Moved
from .differential import WheelMover
from .engine import UPRIGHT, JointStates
from .jointed import JointedBody
from .omni import OmniMover, omni_wheels
from .planar import PlanarMover
from .wheels import MecanumWheels, Wheels, has_rollers
from .world import World


class Mover(Protocol):
    """A robot's body with its drive. `names` are its joints, `wheels` those that both the drive and joint commands may
    turn, `kept` those that joint commands may not.
    """

    @property
    def body(self) -> Body:
        """The body."""
        ...

    names: list[str]
    wheels: frozenset[str]
    kept: frozenset[str]

    def move(self, velocity: Planar, dt: float) -> None:
        """Drive the body at `velocity` for the next step of `dt` seconds."""
        ...

    def moved(self, time: float, dt: float) -> Moved:
        """The state for odometry, at sim time `time`, after a step of `dt` seconds."""
        ...

    def states(self) -> JointStates:
        """The states of the joints."""
        ...


class FreeMover:
    """A robot or an object that nothing drives; joint commands may move its joints."""

    def __init__(self, body: JointedBody) -> None:
        self.body, self.names = body, body.names
        self.wheels = self.kept = frozenset[str]()

    def move(self, velocity: Planar, dt: float) -> None:
        """Nothing: it has no drive."""

    def moved(self, time: float, dt: float) -> Moved:
        """The true pose."""
        return *self.body.pose(), self.body.planar()

    def states(self) -> JointStates:
        """The states of the joints."""
        return self.body.states()


class Limited:
    """The limits of a drive from the robot's file. A stop is immediate, whatever they are."""

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        limits = (drive.max_linear, drive.max_angular, drive.max_linear_acceleration, drive.max_angular_acceleration)
        self._unlimited = all(math.isinf(limit) for limit in limits)
        self._now: Planar = (0.0, 0.0, 0.0)
        self.is_reached = True  # whether the velocity that is wanted is that of the next step

    def __call__(self, wanted: Planar, dt: float) -> Planar:
        """The velocity of the next step of `dt` seconds."""
        drive = self._drive
        if self._unlimited:
            return wanted
        wanted = clamp_speed(wanted, drive.max_linear, drive.max_angular)
        slower = all(abs(w) <= abs(n) and w * n >= 0 for w, n in zip(wanted, self._now, strict=True))
        limits = (drive.max_linear_acceleration, drive.max_angular_acceleration)
        self._now = wanted if slower else ramp(self._now, wanted, *limits, dt)
        self.is_reached = self._now == wanted
        return self._now


def mover_for(world: World, model: RobotModel, at: XYZ, rotation: XYZW = UPRIGHT) -> Mover:
    """The robot in the world, its root frame at `at`; nothing drives a static one. Raises RobotError if the engine
    cannot simulate it, and then leaves nothing behind.
    """
    mechanism = model.drive.mechanism if model.drive and not model.static else None
    if isinstance(mechanism, drives.Planar | Mecanum):
        rolling = MecanumWheels(model, mechanism) if isinstance(mechanism, Mecanum) else Wheels(model)
        return PlanarMover(world.add(lump(model), at, rotation), rolling)
    if isinstance(mechanism, Omni):
        omni = omni_wheels(model)
        spheres = [wheel for wheel in omni if not has_rollers(model, wheel)]
        return OmniMover(world.add_jointed(model, at, rotation, omni=spheres), model, mechanism, omni)
    wheels = (*mechanism.left, *mechanism.right) if isinstance(mechanism, Differential) else ()
    body = world.add_jointed(model, at, rotation, frozenset(wheels))
    try:
        if isinstance(mechanism, Differential):
            return WheelMover(body, model, mechanism)
        if isinstance(mechanism, Balancing):
            return BalanceMover(body, model, mechanism, world.spec.step)
        return FreeMover(body)
    except Exception:
        body.remove()
        raise
