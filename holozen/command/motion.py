"""Commanded motions: a planar velocity, values for joints, or forces."""

from collections.abc import Iterator
from typing import NamedTuple

from msgspec import Struct

from holozen.limits import STOP, Planar
from holozen.messages import JointState


class JointMotion(Struct, frozen=True):
    """Values for joints by name: `kind` is "position" (rad, m), "velocity" (rad/s, m/s) or "effort"
    (N m, N).
    """

    kind: str
    values: tuple[tuple[str, float], ...]

    @property
    def stops(self) -> bool:
        """Whether it moves no joint."""
        return self.kind != "position" and not any(value for _, value in self.values)

    def only(self, names: frozenset[str]) -> "JointMotion | None":
        """The part of it for some joints; None if it has none of them."""
        values = tuple((name, value) for name, value in self.values if name in names)
        return JointMotion(self.kind, values) if values else None


class AppliedForce(NamedTuple):
    """The wrench of one topic, sent at `sent` (s) at the earliest: force x, y, z in N, then torque
    x, y, z in N m.
    """

    key: str
    wrench: tuple[float, float, float, float, float, float]
    sent: float


class AppliedForces(Struct, frozen=True):
    """The wrenches of one source, one for each topic."""

    pushes: tuple[AppliedForce, ...]

    @property
    def stops(self) -> bool:
        """Whether it pushes nothing."""
        return not any(any(push.wrench) for push in self.pushes)

    def since(self, time: float) -> Iterator[AppliedForce]:
        """The wrenches sent since `time` (s)."""
        return (push for push in self.pushes if push.sent >= time)

    def without(self, key: str) -> tuple[AppliedForce, ...]:
        """The wrenches of all topics but `key`."""
        return tuple(push for push in self.pushes if push.key != key)


Motion = Planar | JointMotion | AppliedForces


def is_stop(motion: Motion) -> bool:
    """Whether a motion commands the robot to stand."""
    return motion == STOP if isinstance(motion, tuple) else motion.stops


def motion_of(command: JointState) -> JointMotion:
    """The motion that a joint command asks for. Raises ValueError with the reason."""
    given = {"position": command.position, "velocity": command.velocity, "effort": command.effort}
    kinds = [kind for kind, values in given.items() if values]
    if len(kinds) != 1:
        raise ValueError(
            f"give one of position, velocity and effort; {' and '.join(kinds) or 'none'} has values"
        )
    if len(command.name) != len(given[kinds[0]]):
        names, values = len(command.name), len(given[kinds[0]])
        raise ValueError(
            f"name has length {names}, {kinds[0]} has {values}; give each joint one value"
        )
    if len(set(command.name)) != len(command.name):
        raise ValueError("a joint is named twice")
    return JointMotion(kinds[0], tuple(zip(command.name, given[kinds[0]], strict=True)))
