"""A rigid base that is moved over the plane, as Gazebo's planar_move does."""

import math
from dataclasses import dataclass

from holozen.kinematics import to_body, to_world, travelled
from holozen.limits import STOP, Planar
from holozen.robot import rigid
from holozen.rotation import rotate, yaw

from .body import Body, Links
from .engine import NOTHING, UPRIGHT, Rotation, Shapes, Vector, bullet

HOLD_GAIN = 0.1  # share of the distance to its place that it recovers in a step
HOLD_LIMIT = 0.005  # m; pushed farther, it holds its new place
LOST = 0.1  # share of its speed lost in a step that means an obstacle: more than at the foot of a slope of 15 degrees
PUSH = 3.0  # m/s^2 with which it pushes an obstacle
LOOK = 12  # steps between two looks of a body around itself
SKIN = 0.03  # m; what is closer counts as near, however slow
BRISK = 1.0  # m/s that parts of other robots may be faster than their bodies
SETTLED = 1e-5  # m and rad by which a body that has settled moves up or tilts between two looks
STEADY = 1e-3  # m/s and rad/s by which it moves otherwise than it was told


class Field:
    """The planar bodies of a world, by the engine's numbers. `level` is the number of a level ground below them, if the
    world has one; `steps` counts those of the world, of `step` seconds.
    """

    def __init__(self, world: int, step: float, level: int | None) -> None:
        self.world, self.step, self.level = world, step, level
        self.steps = 0
        self.bodies: dict[int, PlanarBody] = {}
        self._turns: list[dict[int, PlanarBody]] = [{} for _ in range(LOOK)]  # who looks around at which step
        self._fastest = 0.0  # m/s
        self.others: list[Body] = []  # what moves in the engine besides
        self.gliding = 0  # how many of `bodies` do

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.steps * self.step

    @property
    def rests(self) -> bool:
        """Whether nothing moves in the engine."""
        return not self.others and self.gliding == len(self.bodies)

    def add(self, body: "PlanarBody") -> None:
        """Let a body look around from time to time."""
        self.bodies[body.number] = self._turns[body.number % LOOK][body.number] = body

    def remove(self, body: "PlanarBody") -> None:
        """Forget a body."""
        del self.bodies[body.number], self._turns[body.number % LOOK][body.number]

    def stepped(self) -> None:
        """Count a step of the world, and let those bodies look around whose turn it is."""
        self.steps += 1
        turn = self.steps % LOOK
        if not turn:
            self.others = [body for body in self.others if not body.is_removed]
            speeds = [BRISK + math.hypot(*body.twist()[0]) for body in self.others]
            self._fastest = max((*speeds, *(body.speed for body in self.bodies.values())), default=0.0)
        for body in list(self._turns[turn].values()):
            body.look()

    def margin(self, speed: float) -> float:
        """The distance in m at which a body with this speed (m/s) has to beware of others until its next look."""
        self._fastest = max(self._fastest, speed)
        # The others may have moved since their own last looks.
        return SKIN + (speed + 2 * self._fastest) * LOOK * self.step


@dataclass(frozen=True, slots=True)
class Glide:
    """A motion at a constant body-frame velocity over level ground, from a pose of the root frame at time `start`."""

    start: float
    position: Vector
    rotation: Rotation
    velocity: Planar

    def pose(self, time: float) -> tuple[Vector, Rotation]:
        """The pose of the root frame; its height and tilt stay as they are."""
        seconds, (x, y, z), (i, j, k, w) = time - self.start, self.position, self.rotation
        dx, dy = travelled(self.velocity, yaw(self.rotation), seconds)
        half = self.velocity[2] * seconds / 2
        c, s = math.cos(half), math.sin(half)
        return (x + dx, y + dy, z), (c * i - s * j, c * j + s * i, c * k + s * w, c * w - s * k)


class PlanarBody(Body):
    """The drive sets its speed over ground and its turn; the engine keeps gravity, tilt and contacts. Its contacts have
    no friction: rolling wheels do not brake. At a stop it holds its place, also on a slope.

    Where it has settled on level ground and nothing is near, contacts have nothing to tell: it glides, outside of the
    engine's steps and in closed form, until something comes near or it is moved by other than its drive.
    """

    def __init__(
        self, field: Field, shapes: Shapes, body: rigid.Body, at: Vector, rotation: Rotation = UPRIGHT
    ) -> None:
        world = field.world
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
        self.number, self._field, self._inertia = number, field, (body.mass, body.inertia)
        self._may_glide = field.level is not None and not self.weightless
        self._glide: Glide | None = None
        self._told = STOP  # the last velocity of the drive
        self.speed = 0.0  # m/s that any point of it may have at that
        self._stood: tuple[float, ...] = ()  # height and upward axis at the last look
        self._held: tuple[float, float] | None = None  # the place to hold
        self._driven: tuple[float, float] | None = None  # the velocity of the centre that was set for the last step
        self._is_blocked = False
        self._links = range(-1, len(links))
        for link in self._links:
            bullet.changeDynamics(
                number, link, lateralFriction=0, linearDamping=0, angularDamping=0, physicsClientId=world
            )
        bullet.changeDynamics(number, -1, localInertiaDiagonal=body.inertia, physicsClientId=world)
        self._reach = math.dist(*self._box()) / 2
        field.add(self)

    def look(self) -> None:
        """Wake whatever glides near it, and glide if nothing is near."""
        near = self._near()
        stood, self._stood = self._stood, self._standing() if not near and not self._glide else ()
        if not near and stood and self._stood and math.dist(stood, self._stood) < SETTLED:
            self._glide_on()

    def _near(self) -> bool:
        """Whether anything but the ground is near. Then no planar body there glides any more, nor this one."""
        if self._glide:  # the engine's body is where the last look was
            self._place(*self.pose())
        margin = self._field.margin(self.speed)
        (x, y, z), (x2, y2, z2) = self._box()
        low, high = (x - margin, y - margin, z - margin), (x2 + margin, y2 + margin, z2 + margin)
        others = {number for number, _ in bullet.getOverlappingObjects(low, high, self._world) or ()}
        others -= {self.number, self._field.level}
        near = [n for n in others if bullet.getClosestPoints(self.number, n, margin, physicsClientId=self._world)]
        for number in near:
            if other := self._field.bodies.get(number):
                other.wake()
        if near:
            self.wake()
        return bool(near)

    def _box(self) -> tuple[Vector, Vector]:
        """The corners of the box around it in the engine, along the axes of the world."""
        if len(self._links) == 1:
            box: tuple[Vector, Vector] = bullet.getAABB(self.number, -1, self._world)
            return box
        boxes = [bullet.getAABB(self.number, link, self._world) for link in self._links]
        low, high = (zip(*corners, strict=True) for corners in zip(*boxes, strict=True))
        return tuple(map(min, low)), tuple(map(max, high))

    def _standing(self) -> tuple[float, ...]:
        """Its height and its upward axis, if it only touches the level ground, does not tilt, and moves as told."""
        contacts = bullet.getContactPoints(self.number, physicsClientId=self._world)
        _, (rolling, pitching, _) = bullet.getBaseVelocity(self.number, self._world)
        if not self._may_glide or self._is_blocked or {contact[2] for contact in contacts} != {self._field.level}:
            return ()
        if max(abs(rolling), abs(pitching), math.dist(self.velocity(self._field.step), self._told)) > STEADY:
            return ()
        (_, _, z), rotation = self.pose()
        return z, *rotate(rotation, (0.0, 0.0, 1.0))

    def _glide_on(self) -> None:
        """Glide from here at the drive's velocity; the engine keeps a body that neither moves nor touches anything."""
        self._glide, self.glides = Glide(self._field.time, *self.pose(), self._told), True
        self._field.gliding += 1
        bullet.changeDynamics(self.number, -1, mass=0, physicsClientId=self._world)
        for link in self._links:
            bullet.setCollisionFilterGroupMask(self.number, link, 0, 0, physicsClientId=self._world)

    def wake(self) -> None:
        """Return to the engine, where it is and as it moves; from the next step on it has contacts again."""
        if self._glide is None:
            return
        (position, rotation), (linear, angular) = self.pose(), self.twist()
        self._glide, self.glides = None, False
        self._field.gliding -= 1
        mass, inertia = self._inertia
        bullet.changeDynamics(self.number, -1, mass=mass, physicsClientId=self._world)
        bullet.changeDynamics(self.number, -1, localInertiaDiagonal=inertia, physicsClientId=self._world)
        for link in self._links:
            bullet.setCollisionFilterGroupMask(self.number, link, 1, -1, physicsClientId=self._world)
        self.put(position, rotation, linear, angular)

    def pose(self) -> tuple[Vector, Rotation]:
        """Position and rotation of the root frame in the world."""
        return self._glide.pose(self._field.time) if self._glide else super().pose()

    def twist(self) -> tuple[Vector, Vector]:
        """The root frame's velocity and rotation rate in the world."""
        if not self._glide:
            return super().twist()
        x, y, turn = self._glide.velocity
        vx, vy = to_world((x, y, 0.0), yaw(self.pose()[1]), 0.0)
        return (vx, vy, 0.0), (0.0, 0.0, turn)

    def drive(self, velocity: Planar, dt: float) -> None:
        """Set the body-frame velocity for the next step of `dt` seconds; gravity and contacts keep their effects."""
        if velocity != self._told:
            self._told = velocity
            self.speed = math.hypot(velocity[0], velocity[1]) + abs(velocity[2]) * self._reach
            self._near()
            if self._glide:
                self._glide = Glide(self._field.time, *self.pose(), velocity)
        if not self._glide:
            self._drive(velocity, dt)

    def _drive(self, velocity: Planar, dt: float) -> None:
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
        self.wake()
        self._stood = ()
        self._held, self._driven, self._is_blocked = None, None, False
        super().put(position, rotation, linear, angular)

    def _back(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """The velocity towards the place that is held; a strong push moves the hold point."""
        if self._held is None or math.dist(self._held, (x, y)) > HOLD_LIMIT:
            self._held = x, y
        return (self._held[0] - x) * HOLD_GAIN / dt, (self._held[1] - y) * HOLD_GAIN / dt

    @property
    def time(self) -> float:
        """Simulated seconds since the start of the world."""
        return self._field.time

    @property
    def told(self) -> Planar:
        """The velocity that the drive set last."""
        return self._told

    def velocity(self, dt: float) -> Planar:
        """The root frame's planar velocity during the last step of `dt` seconds, in the body frame."""
        if self._glide:
            return self._glide.velocity
        _, rotation, centre = self._root()
        (vx, vy, _), (_, _, turn) = bullet.getBaseVelocity(self._body, self._world)
        cx, cy = to_world((centre[0], centre[1], -turn), 0.0, dt)
        x, y = to_body(vx + turn * cy, vy - turn * cx, yaw(rotation) - turn * dt / 2)
        return x, y, turn

    def remove(self) -> None:
        """Remove it from the world."""
        self.wake()
        self._field.remove(self)
        super().remove()
