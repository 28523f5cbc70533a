"""Which parts of a robot are wheels."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from holozen.check.placed import UP, Placed, dot, minus
from holozen.robot.model import RobotModel
from holozen.robot.parts import Joint
from holozen.robot.rigid import joint_axes
from holozen.robot.tag import Tag, Vector

ALIGNED = math.cos(math.radians(5))
SLACK = 0.1  # of a wheel's radius
LEAST = 0.002  # m
MOVING = ("continuous", "revolute", "prismatic", "floating", "planar")

_NAMED = re.compile(r"wheel|tyre|tire(?!d)|(^|_)w[FBRL][LR]?$", re.IGNORECASE)
_NOT_ROLLING = re.compile(r"steer|caster|castor|swivel|roller|rotor|prop", re.IGNORECASE)
_CASTER = re.compile(r"caster|castor|ball|swivel|roller", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Wheel:
    """A link that turns on a continuous joint and rolls. `shape` is its collision shape, else its visual one."""

    joint: Joint
    axis: Vector
    shape: Placed
    sure: bool

    @property
    def rolls(self) -> bool:
        """Whether the axle is level enough for the wheel to stand on the ground."""
        return abs(dot(self.axis, UP)) < 0.5

    @property
    def bottom(self) -> float:
        """The height of its lowest point in the root frame, metres."""
        return self.shape.farthest((0.0, 0.0, -1.0))[2]

    @property
    def half_width(self) -> float:
        """From the centre along the axle, metres."""
        return self._reach(self.axis)

    @property
    def radius(self) -> float:
        """From the axle, metres."""
        across = [axis for axis in self.shape.axes if abs(dot(axis, self.axis)) < 0.5]
        return max(map(self._reach, across or self.shape.axes))

    @property
    def slack(self) -> float:
        """How far off it may be without being wrong, metres."""
        return max(LEAST, SLACK * self.radius)

    def _reach(self, way: Vector) -> float:
        return dot(minus(self.shape.farthest(way), self.shape.centre), way)


def find_wheels(model: RobotModel, placed: Iterable[Placed], named: Iterable[tuple[Tag, str]]) -> list[Wheel]:
    """Wheels are on continuous joints that hang on the body, have nothing movable on them, and are named by a plugin,
    called a wheel, or (not `sure`) are cylinders no longer than wide.
    """
    axes, shapes = joint_axes(model), _by_link(placed)
    driven = {name for _, name in named}
    wheels = []
    for joint in model.joints.values():
        shape = shapes.get(joint.child)
        if joint.kind == "continuous" and shape and _is_free(joint, model):
            sure = joint.name in driven or is_called_wheel(joint.name, joint.child)
            if sure or _is_disc(joint, shape):
                wheels.append(Wheel(joint, axes[joint.name].direction, shape, sure))
    return wheels


def is_called_wheel(*names: str) -> bool:
    """Whether one of the names says that the part is a wheel that rolls on the ground."""
    return any(_NAMED.search(name) for name in names) and not any(_NOT_ROLLING.search(name) for name in names)


def is_called_caster(*names: str) -> bool:
    """Whether one of the names says that the part rolls or slides under the robot."""
    return any(_CASTER.search(name) for name in names)


def _by_link(placed: Iterable[Placed]) -> dict[str, Placed]:
    """A collision shape before a visual one, and what is round before what is not."""
    ranks = {("collision", True): 3, ("collision", False): 2, ("visual", True): 1, ("visual", False): 0}
    best: dict[str, tuple[int, Placed]] = {}
    for shape in placed:
        rank = ranks[shape.use, shape.shape.kind in ("cylinder", "sphere")]
        if rank > best.get(shape.link, (-1, shape))[0]:
            best[shape.link] = rank, shape
    return {link: shape for link, (_, shape) in best.items()}


def _is_free(joint: Joint, model: RobotModel) -> bool:
    """No other joint moves above it or below it: casters, rollers and suspensions are left alone."""
    above = {other.child: other for other in model.joints.values()}
    below = [other for other in model.joints.values() if other.parent == joint.child]
    if any(other.kind in MOVING for other in below):
        return False
    other = above.get(joint.parent)
    while other is not None and other.kind == "fixed":
        other = above.get(other.parent)
    return other is None or other.kind == "floating"


def _is_disc(joint: Joint, shape: Placed) -> bool:
    other = _NOT_ROLLING.search(f"{joint.name} {joint.child}")
    return not other and shape.shape.kind == "cylinder" and shape.half[2] <= shape.half[0]
