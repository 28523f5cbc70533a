"""A robot's body, and what moves it: its drive, the motors of its joints, and forces."""

import math
from collections.abc import Sequence

from holozen.command.motion import AppliedForce, JointMotion
from holozen.limits import STOP, Planar
from holozen.robot.model import Differential, RobotModel

from .identity import Identity
from .link_states import LinkState, LinkStates, link_tree
from .physics.body import Body
from .physics.jointed import Forces, JointedBody, Motors
from .physics.movers import Limited, Mover
from .physics.planar import PlanarMover


class Actuators:
    """What moves one robot. It turns commanded motions into those of its body.

    Attributes:
        mover: The body with its drive.
        wheels: The motors of the wheels; None if joint commands turn none.
        joints: The motors of the other joints; None if joint commands move none.
    """

    def __init__(self, identity: Identity, mover: Mover) -> None:
        self._identity = identity
        self._links = link_tree(identity.model)
        self.install(mover)

    def install(self, mover: Mover) -> None:
        """Go on with a new body, which stands."""
        model, forces = self._identity.model, self._identity.forces
        self.mover = mover
        self.wheels = _wheel_motors(mover, model)
        self.joints = _joint_motors(mover)
        self._profile = Limited(model.drive) if model.drive else None
        self._jointed = mover.body if isinstance(mover.body, JointedBody) else None
        self._planar = mover if isinstance(mover, PlanarMover) and forces else None
        self._forces: Forces | None = None
        if self._planar:
            self._planar.let_push(model, forces)
        if self._jointed and forces:
            brakes = None if self._identity.drives else self.joints
            self._forces = Forces(self._jointed, forces, model, brakes)

    @property
    def body(self) -> Body:
        """The body."""
        return self.mover.body

    @property
    def base_is_pushed(self) -> bool:
        """Whether forces push the whole base, in place of its drive."""
        return self._planar is not None

    @property
    def has_forces(self) -> bool:
        """Whether forces act on its links."""
        return self._forces is not None

    def drive(self, velocity: Planar, dt: float) -> bool:
        """Drive the base in the next step of `dt` seconds, within the limits of the robot's file.
        Returns whether it goes on so by itself.
        """
        assert self._profile is not None, "a robot that drives has a drive"
        if self.wheels:
            self.wheels.forget()
        self.mover.move(self._profile.follow(velocity, dt), dt)
        return self._profile.is_reached

    def turn_wheels(self, motion: JointMotion, dt: float) -> None:
        """Turn the wheels one by one in the next step of `dt` seconds."""
        self._rest_drive(dt)
        if self.wheels:
            self.wheels.apply(motion)

    def push_base(self, pushes: Sequence[AppliedForce], dt: float) -> None:
        """Push the base in the next step of `dt` seconds."""
        self._rest_drive(dt)
        if self._planar:
            self._planar.push(pushes, dt)

    def _rest_drive(self, dt: float) -> None:
        if self._profile:
            self._profile.follow(STOP, dt)

    def push_links(self, pushes: list[AppliedForce] | None) -> None:
        """Push its links in the next step; None: no source commands forces."""
        if self._forces:
            self._forces.apply(pushes)

    def move_joints(self, motion: JointMotion | None) -> None:
        """Move the joints that are no wheels in the next step; those that are not commanded hold
        still.
        """
        if self.joints:
            self.joints.apply(motion)

    def mimic(self) -> None:
        """Let joints that follow others do so in the next step."""
        if self._jointed:
            self._jointed.mimic()

    def link_states(self) -> LinkStates:
        """The states of its links."""
        states, names = self.mover.states(), self.mover.names
        positions, rates = (dict(zip(names, values, strict=True)) for values in states[:2])
        root = LinkState(*self.body.pose(), *self.body.twist())
        return self._links.states(root, positions, rates)


def _wheel_motors(mover: Mover, model: RobotModel) -> Motors | None:
    if not isinstance(mover.body, JointedBody) or not mover.wheels:
        return None
    mechanism = model.drive.mechanism if model.drive else None
    torque = mechanism.torque if isinstance(mechanism, Differential) else math.inf
    return Motors(mover.body, mover.wheels, torque, together=True)


def _joint_motors(mover: Mover) -> Motors | None:
    free = frozenset(mover.names) - mover.wheels - mover.reserved
    return Motors(mover.body, free) if isinstance(mover.body, JointedBody) and free else None
