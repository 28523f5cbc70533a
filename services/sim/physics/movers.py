"""The mechanisms of drives: commanded velocities to the engine, and states back to odometry."""

import math
from typing import Protocol

from holozen.limits import Planar, clamp_speed, ramp
from holozen.robot.model import Balancing, Differential, Drive, Mecanum, Omni, RobotModel
from holozen.robot.model import Planar as PlanarDrive
from holozen.robot.rigid import lump
from holozen.rotation import XYZ, XYZW

from .balance import BalanceMover
from .body import Body, Moved
from .engine import UPRIGHT, JointStates
from .jointed import JointedMover
from .planar import PlanarMover
from .rolling import DifferentialMover, OmniMover, omni_wheels
from .wheels import MecanumWheels, Wheels, has_rollers
from .world import World


class Mover(Protocol):
    """A robot's body with its drive. `names` are its joints, `wheels` those that both the drive and
    joint commands may turn, `reserved` those that joint commands may not turn.
    """

    @property
    def body(self) -> Body:
        """The body."""
        ...

    names: list[str]
    wheels: frozenset[str]
    reserved: frozenset[str]

    def move(self, velocity: Planar, dt: float) -> None:
        """Drive the body at `velocity` for the next step of `dt` seconds."""
        ...

    def moved(self, time: float, dt: float) -> Moved:
        """The state for odometry at the sim time `time`, after a step of `dt` seconds."""
        ...

    def states(self) -> JointStates:
        """The states of the joints."""
        ...


class Limited:
    """Limits velocity and acceleration to those of the robot's file. A stop is immediate, whatever
    they are.
    """

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        limits = (
            drive.max_linear,
            drive.max_angular,
            drive.max_linear_acceleration,
            drive.max_angular_acceleration,
        )
        self._unlimited = all(math.isinf(limit) for limit in limits)
        self._now: Planar = (0.0, 0.0, 0.0)
        self.is_reached = True  # whether the last velocity returned is the wanted one

    def follow(self, wanted: Planar, dt: float) -> Planar:
        """Go on towards a velocity. Returns that of the next step of `dt` seconds."""
        drive = self._drive
        if self._unlimited:
            return wanted
        wanted = clamp_speed(wanted, drive.max_linear, drive.max_angular)
        slower = all(
            abs(w) <= abs(n) and w * n >= 0 for w, n in zip(wanted, self._now, strict=True)
        )
        limits = (drive.max_linear_acceleration, drive.max_angular_acceleration)
        self._now = wanted if slower else ramp(self._now, wanted, *limits, dt)
        self.is_reached = self._now == wanted
        return self._now


def mover_for(world: World, model: RobotModel, at: XYZ, rotation: XYZW = UPRIGHT) -> Mover:
    """Put a robot into the world, with its root frame at `at`. A static one is not driven. Raises
    RobotError if the engine cannot simulate it, and then leaves nothing behind.
    """
    mechanism = model.drive.mechanism if model.drive and not model.static else None
    if isinstance(mechanism, PlanarDrive | Mecanum):
        rolling = (
            MecanumWheels(model, mechanism) if isinstance(mechanism, Mecanum) else Wheels(model)
        )
        return PlanarMover(world.add(lump(model), at, rotation), rolling)
    if isinstance(mechanism, Omni):
        omni = omni_wheels(model)
        spheres = [wheel for wheel in omni if not has_rollers(model, wheel)]
        return OmniMover(
            world.add_jointed(model, at, rotation, omni=spheres), model, mechanism, omni
        )
    wheels = (*mechanism.left, *mechanism.right) if isinstance(mechanism, Differential) else ()
    body = world.add_jointed(model, at, rotation, frozenset(wheels))
    try:
        if isinstance(mechanism, Differential):
            return DifferentialMover(body, model, mechanism)
        if isinstance(mechanism, Balancing):
            return BalanceMover(body, model, mechanism, world.spec.step)
        return JointedMover(body)
    except Exception:
        body.remove()
        raise
