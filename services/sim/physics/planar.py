"""A rigid base that is moved over the plane, as Gazebo's planar_move does."""

import math

from holozen.kinematics import to_body, to_world
from holozen.limits import STOP, Planar
from holozen.robot import rigid
from holozen.rotation import yaw

from .body import Body, Links
from .engine import NOTHING, UPRIGHT, Rotation, Shapes, Vector, bullet

HOLD_GAIN = 0.1  # share of the distance to its place that it recovers in a step
HOLD_LIMIT = 0.005  # m; pushed farther, it holds its new place
LOST = 0.1  # share of its speed lost in a step that means an obstacle: more than at the foot of a slope of 15 degrees
PUSH = 3.0  # m/s^2 with which it pushes an obstacle


class PlanarBody(Body):
    """The drive sets its speed over ground and its turn; the engine keeps gravity, tilt and contacts. Its contacts have
    no friction: rolling wheels do not brake. At a stop it holds its place, also on a slope.
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
        super().__init__(world, number, body.centre, body.axes, {-1: body.weightless})
        self._held: tuple[float, float] | None = None  # the place to hold
        self._driven: tuple[float, float] | None = None  # the velocity of the centre that was set for the last step
        self._is_blocked = False
        for link in range(-1, len(links)):
            bullet.changeDynamics(
                number, link, lateralFriction=0, linearDamping=0, angularDamping=0, physicsClientId=world
            )
        bullet.changeDynamics(number, -1, localInertiaDiagonal=body.inertia, physicsClientId=world)

    def drive(self, velocity: Planar, dt: float) -> None:
        """Set the body-frame velocity for the next step of `dt` seconds; gravity and contacts keep their effects."""
        position, rotation, centre = self._root()
        (x, y, falling), (roll, pitch, _) = bullet.getBaseVelocity(self._body, self._world)
        if velocity == STOP:
            vx, vy = self._back(position[0] - centre[0], position[1] - centre[1], dt)
        else:
            vx, vy = to_world(velocity, yaw(rotation), dt)
            self._held = None
        turn = velocity[2]
        # The centre orbits the root; evaluated at mid-step, as the heading, so that it stays on its circle.
        cx, cy = to_world((centre[0], centre[1], turn), 0.0, dt)
        vx, vy = vx - turn * cy, vy + turn * cx
        if velocity == STOP:
            self._driven, self._is_blocked = None, False
        else:
            vx, vy = self._driven = self._pushed((x, y), (vx, vy), dt)
        bullet.resetBaseVelocity(self._body, (vx, vy, falling), (roll, pitch, turn), self._world)

    def _pushed(self, now: tuple[float, float], wanted: tuple[float, float], dt: float) -> tuple[float, float]:
        """The velocity of the centre for the next step. An obstacle takes speed from the robot within a step; from
        then on it pushes no harder than wheels with grip could, until it regains its speed: a robot that is forced
        against an edge would tip over it.
        """
        if self._driven is not None and math.dist(self._driven, now) > LOST * math.hypot(*self._driven):
            self._is_blocked = True
        missing = math.dist(wanted, now)
        if not self._is_blocked or missing <= PUSH * dt:
            self._is_blocked = False
            return wanted
        share = PUSH * dt / missing
        return now[0] + (wanted[0] - now[0]) * share, now[1] + (wanted[1] - now[1]) * share

    def put(self, position: Vector, rotation: Rotation, linear: Vector, angular: Vector) -> None:
        """Place the root frame in the world, with its velocity and rotation rate there."""
        self._held, self._driven, self._is_blocked = None, None, False
        super().put(position, rotation, linear, angular)

    def _back(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """The velocity towards the place that is held; a strong push moves the hold point."""
        if self._held is None or math.dist(self._held, (x, y)) > HOLD_LIMIT:
            self._held = x, y
        return (self._held[0] - x) * HOLD_GAIN / dt, (self._held[1] - y) * HOLD_GAIN / dt

    def velocity(self, dt: float) -> Planar:
        """The root frame's planar velocity during the last step of `dt` seconds, in the body frame."""
        _, rotation, centre = self._root()
        (vx, vy, _), (_, _, turn) = bullet.getBaseVelocity(self._body, self._world)
        cx, cy = to_world((centre[0], centre[1], -turn), 0.0, dt)
        x, y = to_body(vx + turn * cy, vy - turn * cx, yaw(rotation) - turn * dt / 2)
        return x, y, turn
