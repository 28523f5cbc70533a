"""A robot of parts with joints between them, moved by motors in the joints; or an object that nothing moves."""

import math
from typing import Any

from holozen.robot.assembly import Part
from holozen.robot.parts import Joint, Surface

from .body import Body, Links
from .engine import NOTHING, UPRIGHT, Rotation, Shapes, Vector, bullet

JOINTS = {"continuous": bullet.JOINT_REVOLUTE, "revolute": bullet.JOINT_REVOLUTE, "prismatic": bullet.JOINT_PRISMATIC}
FRICTION = 1.0  # Gazebo's default for mu and mu2
MOST_FRICTION = 10.0  # the engine multiplies the two surfaces'; students write 100 where they mean "does not slip"
SIDEWAYS = 0.1  # of that is a skid-steer's friction along its axles, unless its file says otherwise
STRONGEST = 1e3  # N m or N; what a joint without an effort limit may give
MOST_JOINTS = 120  # pybullet stops at 127 without a word


class JointedBody(Body):
    """The parts of `assemble`, the root's first. Joints are called by their names; rad, rad/s, N m or m, m/s, N.

    The wheels on the joints named `sideways` have to slide along their axles.
    """

    def __init__(
        self,
        world: int,
        shapes: Shapes,
        parts: list[Part],
        at: Vector,
        rotation: Rotation = UPRIGHT,
        sideways: frozenset[str] = frozenset(),
        static: bool = False,
    ) -> None:
        root, links = parts[0].body, Links()
        own = [shapes.of(part.body.collisions) or [NOTHING] for part in parts]
        indices = [-1]  # of the links that parts become
        for part, (first, *_) in zip(parts[1:], own[1:], strict=True):
            indices.append(_add(links, part, indices[part.parent], first))
        carriers = [links.carry(index, others) for index, (_, *others) in zip(indices, own, strict=True)]
        number: int = bullet.createMultiBody(
            0.0 if static else root.mass,
            own[0][0],
            basePosition=at,
            baseOrientation=rotation,
            baseInertialFramePosition=root.centre,
            baseInertialFrameOrientation=root.axes,
            physicsClientId=world,
            **links.arguments,
        )
        super().__init__(world, number, root.centre, root.axes)
        numbers = links.numbers(number, world)
        self._joints: dict[str, tuple[int, Joint]] = {}
        for part, index, more in zip(parts, indices, carriers, strict=True):
            _set_dynamics(world, number, numbers[index], part, static)
            ratio = SIDEWAYS if part.joint and part.joint.name in sideways else 1.0
            for link in (index, *more):
                _set_surface(world, number, numbers[link], part, ratio)
            if part.joint:
                self._joints[part.joint.name] = (numbers[index], part.joint)
        self.names = list(self._joints)
        mimics = {name: joint.mimic for name, (_, joint) in self._joints.items()}
        self._mimics = {name: mimic for name, mimic in mimics.items() if mimic and mimic.joint in self._joints}
        self._numbers = [number for number, _ in self._joints.values()]
        for name in self.names:
            self.release(name)

    def states(self) -> tuple[list[float], list[float]]:
        """Positions and rates of the joints, in the order of `names`."""
        states = bullet.getJointStates(self._body, self._numbers, self._world) if self._numbers else ()
        return [state[0] for state in states], [state[1] for state in states]

    def release(self, name: str, friction: float | None = None) -> None:
        """Let a joint turn by itself, against its friction (default: the file's)."""
        number, joint = self._joints[name]
        self._motor(
            number, bullet.VELOCITY_CONTROL, targetVelocity=0, force=joint.friction if friction is None else friction
        )

    def turn(self, name: str, rate: float, effort: float = math.inf) -> None:
        """Turn a joint at a rate, within its limits."""
        number, joint = self._joints[name]
        rate = max(-joint.limits.velocity, min(joint.limits.velocity, rate))
        self._motor(number, bullet.VELOCITY_CONTROL, targetVelocity=rate, force=_effort(joint, effort))

    def go(self, name: str, position: float) -> None:
        """Move a joint to a position, within its limits."""
        number, joint = self._joints[name]
        position = max(joint.limits.lower, min(joint.limits.upper, position))
        fastest = min(joint.limits.velocity, 1e3)
        self._motor(number, bullet.POSITION_CONTROL, targetPosition=position, force=_effort(joint), maxVelocity=fastest)

    def push(self, name: str, effort: float) -> None:
        """Give a joint a torque or force for the next step, within its limits. `release` it once before."""
        number, joint = self._joints[name]
        effort = max(-_effort(joint), min(_effort(joint), effort))
        self._motor(number, bullet.TORQUE_CONTROL, force=effort)

    def mimic(self) -> None:
        """Have the joints that follow others go where those are. Once before each step."""
        if not self._mimics:
            return
        positions = dict(zip(self.names, self.states()[0], strict=True))
        for name, mimic in self._mimics.items():
            self.go(name, mimic.multiplier * positions[mimic.joint] + mimic.offset)

    def _motor(self, number: int, mode: int, **values: float) -> None:
        bullet.setJointMotorControl2(self._body, number, mode, physicsClientId=self._world, **values)


def _add(links: Links, part: Part, parent: int, shape: int) -> int:
    joint = part.joint
    assert joint is not None, "only the root's part has none"
    return links.add(
        parent,
        shape,
        JOINTS[joint.kind],
        joint.axis,
        (part.xyz, part.rotation),
        part.body.mass,
        (part.body.centre, part.body.axes),
    )


def _set_dynamics(world: int, body: int, number: int, part: Part, static: bool) -> None:
    joint = part.joint
    settings = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": joint.damping if joint else 0.0}
    if joint and math.isfinite(joint.limits.lower) and math.isfinite(joint.limits.upper):
        settings |= {"jointLowerLimit": joint.limits.lower, "jointUpperLimit": joint.limits.upper}
    bullet.changeDynamics(body, number, **settings, physicsClientId=world)
    if joint or not static:
        bullet.changeDynamics(body, number, localInertiaDiagonal=part.body.inertia, physicsClientId=world)


def _set_surface(world: int, body: int, link: int, part: Part, sideways: float) -> None:
    surface = part.surface
    mu, across = _friction(surface, sideways)
    settings: dict[str, Any] = {"lateralFriction": min(mu, MOST_FRICTION)}
    if part.joint and mu and across < mu:
        # The axle keeps its direction while the wheel turns, so the link's own axes will do.
        turns = [abs(component) for component in part.joint.axis]
        axle = turns.index(max(turns))
        settings["anisotropicFriction"] = [across / mu if index == axle else 1.0 for index in range(3)]
    if surface.kp and surface.kd:
        settings |= {"contactStiffness": surface.kp, "contactDamping": surface.kd}
    bullet.changeDynamics(body, link, **settings, physicsClientId=world)


def _friction(surface: Surface, sideways: float) -> tuple[float, float]:
    """Friction as a wheel rolls, and along its axle."""
    along = FRICTION if surface.mu1 is None else surface.mu1
    across = along if surface.mu2 is None else surface.mu2
    return (along, across * sideways) if along == across else (along, across)


def _effort(joint: Joint, effort: float = math.inf) -> float:
    return min(effort, joint.limits.effort, STRONGEST)
