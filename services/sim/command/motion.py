"""Commanded motions: a planar velocity, or values for joints."""

from dataclasses import dataclass

from holozen.limits import STOP, Planar
from holozen.messages import JointState


@dataclass(frozen=True, slots=True)
class JointMotion:
    """Values for joints by name: `kind` is "position" (rad, m), "velocity" (rad/s, m/s) or "effort" (N m, N)."""

    kind: str
    values: tuple[tuple[str, float], ...]

    @property
    def stops(self) -> bool:
        """Whether it moves nothing."""
        return self.kind != "position" and not any(value for _, value in self.values)

    def only(self, names: frozenset[str]) -> "JointMotion | None":
        """The part for some joints, if there is one."""
        values = tuple((name, value) for name, value in self.values if name in names)
        return JointMotion(self.kind, values) if values else None


Motion = Planar | JointMotion


def is_stop(motion: Motion) -> bool:
    """Whether it commands the robot to stand."""
    return motion.stops if isinstance(motion, JointMotion) else motion == STOP


def motion_of(command: JointState) -> JointMotion:
    """The motion of a command. Raises ValueError, which says what is wrong."""
    given = {"position": command.position, "velocity": command.velocity, "effort": command.effort}
    kinds = [kind for kind, values in given.items() if values]
    if len(kinds) != 1:
        raise ValueError(f"give one of position, velocity and effort; {' and '.join(kinds) or 'none'} has values")
    if len(command.name) != len(given[kinds[0]]):
        raise ValueError(f"{len(command.name)} names and {len(given[kinds[0]])} values of {kinds[0]}; give as many")
    if len(set(command.name)) != len(command.name):
        raise ValueError("a joint is named twice")
    return JointMotion(kinds[0], tuple(zip(command.name, given[kinds[0]], strict=True)))
