"""A body in the engine: its pose and velocity, and how it is placed or removed."""

from collections.abc import Callable

from holozen.kinematics import to_body, velocity_at
from holozen.limits import Planar
from holozen.rotation import XYZ, XYZW, rotate, yaw

from .engine import Box, Engine

Placement = tuple[XYZ, XYZW]
"""Position (m) and rotation of a root frame in the world."""

Moved = tuple[XYZ, XYZW, Planar]
"""Position (m), rotation and body-frame velocity (m/s, rad/s) for odometry."""


class Body:
    """A body in the engine, in terms of its root frame. The engine uses the centre of mass, which
    is at `centre` in the root frame, and calls the body by its `number`.
    """

    def __init__(self, engine: Engine, number: int, centre: XYZ) -> None:
        self._engine, self.number, self._centre = engine, number, centre
        self.is_removed = False
        self.woken: Callable[[], None] = lambda: None  # called when it stops gliding
        # whether it keeps a velocity that was set once; others are set at each step
        self.glides = False

    def pose(self) -> tuple[XYZ, XYZW]:
        """Position and rotation of the root frame in the world."""
        position, rotation, centre = self._root()
        return (position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]), rotation

    def twist(self) -> tuple[XYZ, XYZ]:
        """The root frame's velocity and rotation rate in the world."""
        _, _, centre = self._root()
        linear, angular = self._engine.velocity(self.number)
        return velocity_at((-centre[0], -centre[1], -centre[2]), linear, angular), angular

    def planar(self) -> Planar:
        """The planar velocity of the root frame, in the body frame."""
        (vx, vy, _), (_, _, turn) = self.twist()
        x, y = to_body(vx, vy, yaw(self.pose()[1]))
        return x, y, turn

    def box(self) -> Box:
        """The corners of its bounding box in the engine, along the axes of the world."""
        return self._engine.box(self.number)

    def put(self, position: XYZ, rotation: XYZW, linear: XYZ, angular: XYZ) -> None:
        """Place the root frame in the world, with its velocity and rotation rate there."""
        centre = self._place(position, rotation)
        self._engine.move(self.number, velocity_at(centre, linear, angular), angular)

    def _place(self, position: XYZ, rotation: XYZW) -> XYZ:
        """Place the root frame in the world. Returns the offset from it to the centre of mass, in
        the world.
        """
        (x, y, z), (cx, cy, cz) = position, rotate(rotation, self._centre)
        self._engine.place(self.number, (x + cx, y + cy, z + cz), rotation)
        return cx, cy, cz

    def remove(self) -> None:
        """Remove it from the world."""
        self.is_removed = True
        self._engine.remove(self.number)

    def _root(self) -> tuple[XYZ, XYZW, XYZ]:
        """The centre of mass, the root frame's rotation, and the offset from the root to the
        centre, in the world.
        """
        position, rotation = self._engine.centre(self.number)
        return position, rotation, rotate(rotation, self._centre)
