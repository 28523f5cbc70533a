"""A rigid base that is moved over the plane, as Gazebo's planar_move does."""

import math

from holozen.drive import to_body, to_world
from holozen.limits import STOP, Planar
from holozen.robot import rigid

from .body import Body, Links
from .engine import NOTHING, UPRIGHT, Rotation, Shapes, Vector, bullet, yaw_of

HOLDS = 0.1  # of the way back to its place is made in a step
YIELDS = 0.005  # m


class PlanarBody(Body):
    """The drive sets its speed over ground and its turn; the engine keeps gravity, tilt and contacts. Its contacts have
    no friction: wheels that roll do not brake. Told to stand, it holds its place, also on a slope.
    """

    def __init__(self, world: int, shapes: Shapes, body: rigid.Body, at: Vector, rotation: Rotation = UPRIGHT) -> None:
        links, (first, *others) = Links(shapes.unseen), shapes.of(body.collisions) or [NOTHING]
        links.carry(-1, others)
        # An engine's base is placed by its inertial frame, which is where its centre of mass is.
        number: int = bullet.createMultiBody(
            body.mass,
            first,
            shapes.unseen,
            basePosition=at,
            baseOrientation=rotation,
            baseInertialFramePosition=body.centre,
            baseInertialFrameOrientation=body.axes,
            physicsClientId=world,
            **links.arguments,
        )
        super().__init__(world, number, body.centre, body.axes)
        self._held: tuple[float, float] | None = None  # the place it is to keep
        for link in range(-1, len(links)):
            bullet.changeDynamics(
                number, link, lateralFriction=0, linearDamping=0, angularDamping=0, physicsClientId=world
            )
        bullet.changeDynamics(number, -1, localInertiaDiagonal=body.inertia, physicsClientId=world)

    def drive(self, velocity: Planar, dt: float) -> None:
        """Set the body-frame velocity for the next step of `dt` seconds; what gravity and contacts do is left alone."""
        position, rotation, centre = self._root()
        (_, _, falling), (roll, pitch, _) = bullet.getBaseVelocity(self._body, self._world)
        if velocity == STOP:
            vx, vy = self._back(position[0] - centre[0], position[1] - centre[1], dt)
        else:
            vx, vy = to_world(velocity, yaw_of(rotation), dt)
            self._held = None
        turn = velocity[2]
        # The centre goes round the root; as with the heading, the middle of the step keeps it on its circle.
        cx, cy = to_world((centre[0], centre[1], turn), 0.0, dt)
        linear = (vx - turn * cy, vy + turn * cx, falling)
        bullet.resetBaseVelocity(self._body, linear, (roll, pitch, turn), self._world)

    def put(self, position: Vector, rotation: Rotation, linear: Vector, angular: Vector) -> None:
        """Place the root frame in the world, with its velocity and rotation rate there."""
        self._held = None
        super().put(position, rotation, linear, angular)

    def _back(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """The velocity towards the place that is held; whoever is pushed hard holds the next one."""
        if self._held is None or math.dist(self._held, (x, y)) > YIELDS:
            self._held = x, y
        return (self._held[0] - x) * HOLDS / dt, (self._held[1] - y) * HOLDS / dt

    def velocity(self, dt: float) -> Planar:
        """The root frame's planar velocity during the last step of `dt` seconds, as seen from the body's heading."""
        _, rotation, centre = self._root()
        (vx, vy, _), (_, _, turn) = bullet.getBaseVelocity(self._body, self._world)
        cx, cy = to_world((centre[0], centre[1], -turn), 0.0, dt)
        x, y = to_body(vx + turn * cy, vy - turn * cx, yaw_of(rotation) - turn * dt / 2)
        return x, y, turn
