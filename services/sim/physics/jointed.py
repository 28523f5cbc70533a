"""A robot made of parts, with motors in the joints between them; or an object that nothing
drives.
"""

import math

from holozen.command.motion import AppliedForce, JointMotion
from holozen.limits import Planar, clamp
from holozen.robot.model import Force, Joint, Pose, RobotModel
from holozen.robot.rigid import Frame, Part, in_parts
from holozen.rotation import XYZ, XYZW, multiply, rotate

from .body import Body, Moved
from .dynamics import contact_of, load_on
from .engine import UPRIGHT, Engine, JointStates

MAX_EFFORT = 1e3  # N m or N, of a joint without an effort limit
MAX_RATE = 1e3  # rad/s or m/s
CLOSING = 0.1  # s; time constant of a joint that moves to a position
FOLLOWING = 0.02  # s; the same for a joint that mimics another


class JointedBody(Body):
    """A body of the parts of `assemble`, the root's first. Joints are called by their names; units
    are rad, rad/s and N m, or m, m/s and N.

    `wheels` names the joints of the driven wheels. More than two of them have to slide along their
    axles, and other parts slide on the ground too, unless the file sets their friction. `omni`
    wheels have none along their axles.
    """

    def __init__(
        self,
        engine: Engine,
        dt: float,
        parts: list[Part],
        at: XYZ,
        rotation: XYZW = UPRIGHT,
        wheels: frozenset[str] = frozenset(),
        static: bool = False,
        omni: bool = False,
    ) -> None:
        load = load_on(parts, len(wheels)) if len(wheels) > 2 else 0.0
        yields = load_on(parts, 1) if len(wheels) == 2 and not omni else 0.0
        contacts = []
        for part in parts:
            drives = part.joint is not None and part.joint.name in wheels
            drags = bool(wheels) and not drives
            soft = yields if drags else 0.0
            contacts.append(
                contact_of(part, dt, load if drives else 0.0, drags, omni and drives, soft)
            )
        number = engine.add(parts, contacts, at, rotation, static)
        super().__init__(engine, number, parts[0].body.centre)
        self._dt = dt
        self._joints = {
            part.joint.name: (index, part.joint) for index, part in enumerate(parts) if part.joint
        }
        self._efforts: dict[int, float] = {}  # that `push` applies, by the index of the part
        self.names = [*self._joints]
        joints = [joint for _, joint in self._joints.values()]
        self._mimics = {
            joint.name: joint.mimic
            for joint in joints
            if joint.mimic and joint.mimic.joint in self._joints
        }
        for name in self.names:
            self.release(name)

    def states(self) -> JointStates:
        """The states of the joints, in the order of `names`. The effort is that of motor and
        friction.
        """
        positions, rates, efforts = self._engine.joints(self.number)
        joints = zip(self._joints.values(), efforts, strict=True)
        return (
            positions,
            rates,
            [self._efforts.get(number, effort) for (number, _), effort in joints],
        )

    def wrench(self, part: int, at: Frame, along: bool, force: XYZ, torque: XYZ) -> None:
        """Apply a force (N) and a torque (N m) during the next step, at the origin of the frame
        `at` in a part. `along`: they are in the axes of that frame, else of the world. `part` is an
        index of `assemble`.
        """
        place, rotation = self._engine.frame(self.number, part) if part else self.pose()
        x, y, z = rotate(rotation, at.xyz)
        if along:
            axes = multiply(rotation, at.quaternion)
            force, torque = rotate(axes, force), rotate(axes, torque)
        self._engine.wrench(
            self.number, part, force, torque, (place[0] + x, place[1] + y, place[2] + z)
        )

    def release(self, name: str, friction: float | None = None) -> None:
        """Let a joint turn freely, against its friction (default: the file's)."""
        number, joint = self._joints[name]
        self._turn(number, 0.0, joint.friction if friction is None else friction)

    def roll(self, name: str, rate: float, effort: float) -> None:
        """Turn a wheel at a rate. The drive's limits apply, not the joint's: exporters write 0 for
        unknown limits.
        """
        number, _ = self._joints[name]
        self._turn(number, rate, min(effort, MAX_EFFORT))

    def turn(self, name: str, rate: float, effort: float = math.inf) -> None:
        """Turn a joint at a rate, within its limits. Call it before each step for a joint with
        position limits.
        """
        number, joint = self._joints[name]
        self._turn(number, self._within_limits(number, joint, rate), _effort(joint, effort))

    def go(self, name: str, position: float, closing: float = CLOSING) -> None:
        """Move a joint to a position, within its limits, with a time constant of `closing`
        seconds.
        """
        number, joint = self._joints[name]
        position = max(joint.limits.lower, min(joint.limits.upper, position))
        rate = min(joint.limits.velocity, MAX_RATE)
        self._efforts.pop(number, None)
        self._engine.go(self.number, number, position, closing, _effort(joint), rate)

    def push(self, name: str, effort: float, most: float = math.inf) -> None:
        """Apply an effort to a joint for the next step, within its limits. `release` it first."""
        number, joint = self._joints[name]
        effort = clamp(effort, _effort(joint, most))
        if math.isfinite(joint.limits.velocity):
            _, rate = self._engine.joint(self.number, number)
            if abs(rate) >= joint.limits.velocity and rate * effort > 0:
                effort = 0.0
        self._engine.push(self.number, number, effort)
        self._efforts[number] = effort

    def mimic(self) -> None:
        """Move mimic joints to the positions of the joints that they follow. Call it before each
        step.
        """
        if not self._mimics:
            return
        positions = dict(zip(self.names, self.states()[0], strict=True))
        for name, mimic in self._mimics.items():
            self.go(name, mimic.multiplier * positions[mimic.joint] + mimic.offset, FOLLOWING)

    def _within_limits(self, number: int, joint: Joint, rate: float) -> float:
        """The `rate` at which the joint does not leave its limits in the next step: a strong motor
        would overcome those of the engine. A joint that is already beyond its limits may only move
        back.
        """
        limits = joint.limits
        rate = clamp(rate, limits.velocity)
        if not rate or not (math.isfinite(limits.lower) and math.isfinite(limits.upper)):
            return rate
        position, _ = self._engine.joint(self.number, number)
        if rate < 0:
            return max(rate, min(0.0, (limits.lower - position) / self._dt))
        return min(rate, max(0.0, (limits.upper - position) / self._dt))

    def _turn(self, number: int, rate: float, effort: float) -> None:
        self._efforts.pop(number, None)
        self._engine.turn(self.number, number, rate, effort)


def _effort(joint: Joint, effort: float = math.inf) -> float:
    return min(effort, joint.limits.effort, MAX_EFFORT)


class JointedMover:
    """A robot or object without a drive, which subclasses add. Joint commands may move its
    joints.
    """

    def __init__(
        self,
        body: JointedBody,
        wheels: frozenset[str] = frozenset(),
        reserved: frozenset[str] = frozenset(),
    ) -> None:
        self.body, self.names, self.wheels, self.reserved = body, body.names, wheels, reserved

    def move(self, velocity: Planar, dt: float) -> None:
        """Do nothing: it has no drive."""

    def moved(self, time: float, dt: float) -> Moved:
        """The true pose."""
        return *self.body.pose(), self.body.planar()

    def states(self) -> JointStates:
        """The states of the joints."""
        return self.body.states()


class Motors:
    """The motors of some joints of a body, with at most `effort` in N m or N each. A joint that is
    no longer commanded holds still. With `together`, as for the wheels of one base, all others hold
    still while one is commanded.
    """

    def __init__(
        self,
        body: JointedBody,
        names: frozenset[str],
        effort: float = math.inf,
        together: bool = False,
    ) -> None:
        self._body, self.names, self._effort, self._together = body, names, effort, together
        self._held: frozenset[str] = frozenset()
        self._last: JointMotion | None = None

    def apply(self, motion: JointMotion | None) -> None:
        """Apply the motion of the next step; None: hold the joints that were moved before."""
        commanded = frozenset(name for name, _ in motion.values) if motion else frozenset[str]()
        if motion and motion != self._last:
            for name in commanded:
                self._body.release(name)
        self._last = motion
        self._held |= self.names if motion and self._together else commanded
        for name in self._held - commanded:
            self._body.turn(name, 0.0, self._effort)
        if motion:
            self._move(motion)

    def brake(self, names: frozenset[str], on: bool) -> None:
        """Hold these joints still while they are not commanded, or let them turn freely."""
        self._held, self._last = (self._held | names if on else self._held - names), None
        for name in names if not on else ():
            self._body.release(name)

    def forget(self) -> None:
        """Release them: something else moves them from now on."""
        self._held, self._last = frozenset(), None

    def _move(self, motion: JointMotion) -> None:
        for name, value in motion.values:
            if motion.kind == "position":
                self._body.go(name, value)
            elif motion.kind == "velocity":
                self._body.turn(name, value, self._effort)
            else:
                self._body.push(name, value, self._effort)


class Forces:
    """The forces that commands apply to a model's body. While no source commands any, the wheels
    brake, unless a drive turns them.
    """

    def __init__(
        self,
        body: JointedBody,
        forces: dict[str, list[Force]],
        model: RobotModel,
        brakes: Motors | None,
    ) -> None:
        """`forces` are by the keys of their commands."""
        parts = in_parts(model)
        self._body, self._brakes = body, brakes
        self._places: dict[str, list[tuple[int, Frame, bool]]] = {
            key: [
                (*_centre(model, *parts[force.link], force.link), force.in_link) for force in same
            ]
            for key, same in forces.items()
        }
        self._turning = frozenset(
            joint.name for joint in model.joints.values() if joint.kind == "continuous"
        )
        self._rolls: bool | None = None

    def apply(self, pushes: list[AppliedForce] | None) -> None:
        """Apply forces during the next step; None: no source drives."""
        rolls = pushes is not None
        if self._brakes and rolls != self._rolls:
            self._brakes.brake(self._turning & self._brakes.names, on=not rolls)
        self._rolls = rolls
        for key, (fx, fy, fz, *torque), _ in pushes or ():
            for part, at, in_link in self._places[key]:
                self._body.wrench(
                    part, at, in_link, (fx, fy, fz), (torque[0], torque[1], torque[2])
                )


def _centre(model: RobotModel, part: int, link: Frame, name: str) -> tuple[int, Frame]:
    """A link's part, and the link's centre of mass in the frame of that part, with the link's
    axes.
    """
    inertial = model.links[name].inertial
    inside = Frame.of(Pose(inertial.pose.xyz)) if inertial else Frame.of(Pose())
    return part, link @ inside
