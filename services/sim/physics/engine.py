"""What a physics engine does for the sim: the verbs of one world of bodies, and what a body is made of.

`bullet.py` and `mujoco.py` have them, and only they import an engine. Metres, kilograms, seconds; quaternions are
x, y, z, w; positions, velocities and forces are along the axes of the world. A body is called by the number that `add`
gives, its parts by their indices, the root's first.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from holozen.robot.rigid import Part, PlacedShape
from holozen.rotation import XYZ, XYZW

Box = tuple[XYZ, XYZ]
"""Its corners."""
JointStates = tuple[list[float], list[float], list[float]]
"""Positions, rates and efforts: rad, rad/s, N m or m, m/s, N."""
Array = npt.NDArray[np.float64]

UPRIGHT: XYZW = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Contact:
    """How a part's shapes touch others: their coefficient of friction, which is multiplied by the others', and the
    share of it along the part's axle. `stiffness` in N/m and `damping` in N s/m; 0: the engine's own.
    """

    friction: float
    along_axle: float = 1.0
    stiffness: float = 0.0
    damping: float = 0.0


class Engine(Protocol):
    """One world of bodies. `ground` is the number of its ground, if it has one."""

    ground: int | None

    def add(self, parts: Sequence[Part], contacts: Sequence[Contact], at: XYZ, rotation: XYZW, static: bool) -> int:
        """A body that stands with its joints at zero, its root frame at a pose; a `static` one is fixed there. Gravity
        does not pull the weightless share of a part. Returns its number.
        """
        ...

    def remove(self, number: int) -> None:
        """Take a body out of the world."""
        ...

    def step(self) -> None:
        """Advance by one step. Raises ValueError or ArithmeticError if the numbers of a body are not finite."""
        ...

    def close(self) -> None:
        """Free everything."""
        ...

    def centre(self, number: int) -> tuple[XYZ, XYZW]:
        """The root part's centre of mass, and the rotation of the root frame."""
        ...

    def place(self, number: int, centre: XYZ, rotation: XYZW) -> None:
        """Move a body: the root part's centre of mass, and the rotation of the root frame."""
        ...

    def velocity(self, number: int) -> tuple[XYZ, XYZ]:
        """The velocity of the root part's centre of mass, and its rotation rate."""
        ...

    def move(self, number: int, linear: XYZ, angular: XYZ) -> None:
        """Set the velocity of the root part's centre of mass, and its rotation rate."""
        ...

    def freeze(self, number: int) -> None:
        """Let a body of one part neither move nor touch anything; it can be placed."""
        ...

    def thaw(self, number: int) -> None:
        """Let it move and touch again."""
        ...

    def box(self, number: int) -> Box:
        """A box around a body, along the axes of the world."""
        ...

    def near(self, box: Box) -> set[int]:
        """The bodies whose boxes overlap this one."""
        ...

    def gap(self, one: int, other: int, within: float) -> float:
        """The distance between two bodies, negative where they overlap; `within` if it is larger."""
        ...

    def touched(self, number: int) -> set[int]:
        """The bodies that it had contacts with in the last step."""
        ...

    def is_plane(self, number: int) -> bool:
        """Whether a body is an endless plane."""
        ...

    def joints(self, number: int) -> JointStates:
        """The states of a body's joints, in the order of its parts. The effort is that of motor and friction."""
        ...

    def joint(self, number: int, part: int) -> tuple[float, float]:
        """The position and rate of a part's joint."""
        ...

    def turn(self, number: int, part: int, rate: float, effort: float) -> None:
        """Let the motor of a part's joint keep a rate from now on, with at most an effort; at rate 0 it is friction."""
        ...

    def go(self, number: int, part: int, position: float, closing: float, effort: float, rate: float) -> None:
        """Let the motor move a part's joint to a position from now on, with a time constant of `closing` seconds, at
        most an effort and a rate.
        """
        ...

    def push(self, number: int, part: int, effort: float) -> None:
        """Apply an effort to a part's joint in the next step, besides its motor's."""
        ...

    def frame(self, number: int, part: int) -> tuple[XYZ, XYZW]:
        """The pose of a part's frame."""
        ...

    def wrench(self, number: int, part: int, force: XYZ, torque: XYZ, point: XYZ) -> None:
        """Push a part in the next step with a force at a point, and with a torque."""
        ...


class Rays(Protocol):
    """A world of shapes that rays hit, and nothing else. `ground`: a level plane at z = 0."""

    def __init__(self, ground: bool) -> None: ...

    def add(self, shapes: tuple[PlacedShape, ...]) -> int:
        """Shapes that are placed together, at the origin at first. Returns their number."""
        ...

    def remove(self, number: int) -> None:
        """Remove shapes."""
        ...

    def place(self, number: int, at: XYZ, rotation: XYZW) -> None:
        """Move shapes."""
        ...

    def cast(self, origin: XYZ, directions: Array, near: float, far: float, own: int) -> Array:
        """The distances (n,) to what is hit first between `near` and `far` by rays along unit vectors (n, 3); infinite
        for nothing. The shapes `own` are not hit.
        """
        ...

    def touched(self, number: int, within: float, but: Collection[int]) -> Iterator[tuple[int, XYZ, XYZ, float]]:
        """What is nearer than `within` (m) to some shapes, the shapes `but` excepted: their number, 0 for the ground, a
        point on them, the unit vector from there out of them, and the distance, below 0 in them.
        """
        ...

    def close(self) -> None:
        """Free everything."""
        ...
