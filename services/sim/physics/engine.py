"""The interface of a physics engine, and what a body is made of.

`bullet.py` and `mujoco.py` implement it, and only they import an engine. Metres, kilograms,
seconds; quaternions are x, y, z, w; positions, velocities and forces are in the world frame. A body
is identified by the number that `add` returns, its parts by their indices, the root's first.
"""

from collections.abc import Collection, Iterator, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from holozen.robot.rigid import Part, PlacedShape
from holozen.rotation import XYZ, XYZW

Box = tuple[XYZ, XYZ]
"""The low and the high corner."""
JointStates = tuple[list[float], list[float], list[float]]
"""Positions, rates and efforts: rad, rad/s, N m or m, m/s, N."""
Array = npt.NDArray[np.float64]

UPRIGHT: XYZW = (0.0, 0.0, 0.0, 1.0)


class Contact(Struct, frozen=True):
    """The contact parameters of a part's shapes: the coefficient of friction, which is multiplied
    by that of the other surface, and the share of it along the part's axle. `stiffness` in N/m and
    `damping` in N s/m; 0: the engine's own. `yields`: the part is softer than the wheels beside it.
    """

    friction: float
    along_axle: float = 1.0
    stiffness: float = 0.0
    damping: float = 0.0
    yields: bool = False


class Engine(Protocol):
    """One world of bodies. `ground` is the number of its ground, if it has one."""

    ground: int | None

    def add(
        self,
        parts: Sequence[Part],
        contacts: Sequence[Contact],
        at: XYZ,
        rotation: XYZW,
        static: bool,
    ) -> int:
        """Add a body at rest, its root frame at a pose and its joints at zero; a `static` one is
        fixed there. Gravity does not act on the weightless share of a part's mass. Returns its
        number.
        """
        ...

    def remove(self, number: int) -> None:
        """Take a body out of the world."""
        ...

    def step(self) -> None:
        """Advance by one step. Raises ValueError or ArithmeticError if the numbers of a body are
        not finite.
        """
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
        """Take a body of one part out of all dynamics and contacts; it can still be placed."""
        ...

    def thaw(self, number: int) -> None:
        """Undo `freeze`."""
        ...

    def box(self, number: int) -> Box:
        """A body's bounding box, along the axes of the world."""
        ...

    def near(self, box: Box) -> set[int]:
        """The bodies whose bounding boxes overlap a box."""
        ...

    def gap(self, one: int, other: int, within: float) -> float:
        """The distance (m) between two bodies, negative where they overlap; at most `within`."""
        ...

    def touched(self, number: int) -> set[int]:
        """The bodies that a body was in contact with in the last step."""
        ...

    def is_plane(self, number: int) -> bool:
        """Whether a body is an infinite plane."""
        ...

    def joints(self, number: int) -> JointStates:
        """The states of a body's joints, in the order of its parts. The efforts are those of motors
        and friction.
        """
        ...

    def joint(self, number: int, part: int) -> tuple[float, float]:
        """The position and rate of a part's joint."""
        ...

    def turn(self, number: int, part: int, rate: float, effort: float) -> None:
        """From now on, let the motor of a part's joint keep a rate, with at most an effort; rate 0
        is friction.
        """
        ...

    def go(
        self, number: int, part: int, position: float, closing: float, effort: float, rate: float
    ) -> None:
        """From now on, let the motor of a part's joint move it to a position, with a time constant
        of `closing` seconds and at most an effort and a rate.
        """
        ...

    def push(self, number: int, part: int, effort: float) -> None:
        """Apply an effort to a part's joint in the next step, in addition to that of its motor."""
        ...

    def frame(self, number: int, part: int) -> tuple[XYZ, XYZW]:
        """The pose of a part's frame."""
        ...

    def wrench(self, number: int, part: int, force: XYZ, torque: XYZ, point: XYZ) -> None:
        """Apply a force at a point, and a torque, to a part in the next step."""
        ...


class Rays(Protocol):
    """A world of shapes for rays and contact queries, without dynamics. `ground`: a level plane at
    z = 0.
    """

    def __init__(self, ground: bool) -> None: ...

    def add(self, shapes: tuple[PlacedShape, ...]) -> int:
        """Add shapes that are placed together, first at the origin. Returns their number."""
        ...

    def remove(self, number: int) -> None:
        """Remove shapes."""
        ...

    def place(self, number: int, at: XYZ, rotation: XYZW) -> None:
        """Move shapes."""
        ...

    def cast(self, origin: XYZ, directions: Array, near: float, far: float, own: int) -> Array:
        """The distances (n,) to the first hits between `near` and `far` (m) of rays along unit
        vectors (n, 3); infinite without a hit. Rays pass through the shapes `own`.
        """
        ...

    def touched(
        self, number: int, within: float, but: Collection[int]
    ) -> Iterator[tuple[int, XYZ, XYZ, float]]:
        """The contacts of some shapes with others, except those in `but`, that are nearer than
        `within` (m). Of each: the number of the others (0: the ground), a point on them, the unit
        normal out of them, and the distance, negative if they overlap.
        """
        ...

    def close(self) -> None:
        """Free everything."""
        ...
