"""A rigid base that is moved over the plane, as Gazebo's planar_move does."""

import math
from collections.abc import Iterable, Mapping, Sequence

from msgspec import Struct

from holozen.command.motion import AppliedForce
from holozen.kinematics import to_body, to_world, travelled
from holozen.limits import STOP, Planar
from holozen.robot import rigid
from holozen.robot.model import Force, RobotModel, Surface
from holozen.rotation import XYZ, XYZW, from_axis_angle, rotate, yaw

from .body import Body, Moved
from .dynamics import GRAVITY
from .engine import UPRIGHT, Contact, Engine, JointStates
from .pushing import Pushing
from .wheels import Wheels

HOLD_GAIN = 0.1  # share of the distance to its place that it recovers in a step
HOLD_LIMIT = 0.005  # m; pushed farther, it holds its new place
# share of its speed lost in a step that means an obstacle: more than at the foot of a slope of 15
# degrees
LOST = 0.1
PUSH = 3.0  # m/s^2; the most with which it pushes an obstacle
# rad/s; an obstacle that tips it faster takes the load, and so the grip, off its wheels
TIPPING = 0.2
UPRIGHT_PUSH = 0.3  # share of the acceleration at its centre of mass that would begin to tip it
PROXIMITY_PERIOD = 12  # steps between two checks of a body for neighbours
# steps; that of a gliding body if nothing can come near it before
LONGEST_PERIOD = 8 * PROXIMITY_PERIOD
SKIN = 0.03  # m; what is closer counts as near, however slow it is
BRISK = 1.0  # m/s by which parts of other robots may be faster than their bodies
# m/s; the fastest speed is rounded up to a multiple, since each rise lets all bodies look again
GRADE = 0.1
SETTLED = 1e-5  # m and rad; a body that has settled rises or tilts less than this between two looks
STEEP = 0.7  # z component of its upward axis; tilted farther, it turns about the vertical
LANDED = 0.2  # m/s along its upward axis; faster, it falls or jumps
STEADY = 1e-3  # m/s and rad/s; the largest deviation from the commanded velocity


class Field:
    """The planar bodies of a world, by the engine's numbers. `level` is the number of a level
    ground, if the world has one; `steps` counts the world's steps, of `step` seconds each.
    `gravity` is in m/s^2.
    """

    def __init__(self, engine: Engine, step: float, level: int | None, gravity: XYZ) -> None:
        self.engine, self.step, self.level, self.gravity = engine, step, level, gravity
        self.steps = 0
        self.bodies: dict[int, PlanarBody] = {}
        # step -> the bodies that check for neighbours then
        self._checks: dict[int, list[PlanarBody]] = {}
        self._fastest = 0.0  # m/s; an upper bound of the speeds of all that moves
        self.others: list[Body] = []  # the other bodies that move in the engine
        self.gliding = 0  # how many of `bodies` glide

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.steps * self.step

    @property
    def rests(self) -> bool:
        """Whether nothing moves in the engine."""
        return not self.others and self.gliding == len(self.bodies)

    def add(self, body: "PlanarBody") -> None:
        """Add a body, which checks for neighbours from time to time."""
        self.bodies[body.number] = body
        self.schedule_check(body, PROXIMITY_PERIOD)
        self.hasten()

    def remove(self, body: "PlanarBody") -> None:
        """Remove a body."""
        del self.bodies[body.number]

    def stepped(self) -> None:
        """Count a step of the world, and let the bodies that are due look around. Raises ValueError
        or ArithmeticError if the numbers of a body are not finite.
        """
        self.steps += 1
        due = self._checks.pop(self.steps, ())
        try:
            self._check(due)
        except (ValueError, ArithmeticError):
            for body in self.bodies.values():
                if body.check_at <= self.steps:  # it may have missed its check
                    self.schedule_check(body, PROXIMITY_PERIOD)
            raise

    def _check(self, due: Iterable["PlanarBody"]) -> None:
        if not self.steps % PROXIMITY_PERIOD:
            self.others = [body for body in self.others if not body.is_removed]
            speeds = [BRISK + math.hypot(*body.twist()[0]) for body in self.others]
            self._fastest = _graded(
                max((*speeds, *(body.speed for body in self.bodies.values())), default=0.0)
            )
            if not math.isfinite(sum(speeds)):
                raise ValueError(f"a speed of {sum(speeds)} m/s")
        for body in due:
            if body.check_at == self.steps and not body.is_removed:
                body.check_neighbours()

    def schedule_check(self, body: "PlanarBody", steps: int) -> None:
        """Let a body check for neighbours within that many steps, PROXIMITY_PERIOD or more. The
        checks of all bodies are spread over the steps.
        """
        at = self.steps + steps - (self.steps + steps - body.number) % PROXIMITY_PERIOD
        if body.check_at != at:
            body.check_at = at
            self._checks.setdefault(at, []).append(body)

    def hasten(self) -> None:
        """Let all bodies check within PROXIMITY_PERIOD steps: something may be nearer or faster
        than they assume.
        """
        for body in self.bodies.values():
            if body.check_at > self.steps + PROXIMITY_PERIOD:
                self.schedule_check(body, PROXIMITY_PERIOD)

    def closing(self, speed: float) -> float:
        """The greatest speed (m/s) at which a body with this speed and another one can approach
        each other.
        """
        if speed > self._fastest:
            self._fastest = _graded(speed)
            self.hasten()
        return speed + self._fastest

    def margin(self, speed: float) -> float:
        """The distance (m) within which others may come near a body with this speed (m/s) before
        its next look. It also covers gliding ones, which the engine still has where they last
        looked.
        """
        return SKIN + (self.closing(speed) + self._fastest) * LONGEST_PERIOD * self.step

    def near(self, body: Body, speed: float) -> set[int]:
        """The engine's numbers of the others that are within the `margin` of a body with this speed
        (m/s).
        """
        ((x, y, z), (x2, y2, z2)), margin = body.box(), self.margin(speed)
        low, high = (x - margin, y - margin, z - margin), (x2 + margin, y2 + margin, z2 + margin)
        return self.engine.near((low, high)) - {body.number}


def _within(distance: float, way: float) -> int:
    """The number of steps in which something covers a distance (m), `way` metres a step; at most
    LONGEST_PERIOD.
    """
    return int(min(LONGEST_PERIOD, max(0.0, distance) / way))


def _graded(speed: float) -> float:
    return GRADE * math.ceil(speed / GRADE)


class Glide(Struct, frozen=True):
    """A motion over level ground at a constant body-frame velocity. The root frame is at a pose at
    time `start` (s).
    """

    start: float
    position: XYZ
    rotation: XYZW
    velocity: Planar
    heading: float  # rad, at the start

    def at(self, time: float) -> XYZ:
        """The position of the root frame at a time (s), at a constant height."""
        x, y, z = self.position
        dx, dy = travelled(self.velocity, self.heading, time - self.start)
        return x + dx, y + dy, z

    def pose(self, time: float) -> tuple[XYZ, XYZW]:
        """The pose of the root frame at a time (s), with a constant tilt."""
        i, j, k, w = self.rotation
        half = self.velocity[2] * (time - self.start) / 2
        c, s = math.cos(half), math.sin(half)
        return self.at(time), (c * i - s * j, c * j + s * i, c * k + s * w, c * w - s * k)


class PlanarBody(Body):
    """A body whose drive sets its velocity over the ground and its turn rate; the engine adds
    gravity, tilt and contacts. These have no friction, since rolling wheels do not brake. At a stop
    it holds its place, also on a slope.

    When it has settled on level ground and nothing is near, contacts change nothing. Then it
    glides: its motion is computed in closed form, without the engine, until something comes near or
    anything but its drive moves it.
    """

    def __init__(self, field: Field, body: rigid.Body, at: XYZ, rotation: XYZW = UPRIGHT) -> None:
        part = rigid.Part("", body, Surface())
        number = field.engine.add([part], [Contact(friction=0.0)], at, rotation, static=False)
        super().__init__(field.engine, number, body.centre)
        self._field, self._floats = field, body.weightless > 0
        self._may_glide = field.level is not None and not self._floats
        self._glide: Glide | None = None
        self._commanded = STOP  # the last velocity of the drive
        self.speed = 0.0  # m/s; the greatest speed of any of its points since its last look
        self.check_at = field.steps  # the step at which it checks for neighbours next
        self._stood: tuple[float, ...] = ()  # height and upward axis at the last look
        self._held: tuple[float, float] | None = None  # the place to hold
        # the velocity of the centre that was set for the last step
        self._driven: tuple[float, float] | None = None
        self._is_blocked = False
        low, high = self.box()
        # m from the root frame to any point
        self._reach = max(map(rigid.reach, body.collisions), default=0.0)
        x, y, z = (place + centre for place, centre in zip(at, body.centre, strict=True))
        # m to the edge of its support
        edge = max(0.0, min(x - low[0], high[0] - x, y - low[1], high[1] - y))
        self._push = min(PUSH, UPRIGHT_PUSH * GRAVITY * edge / max(z - low[2], 1e-3))
        field.add(self)

    def check_neighbours(self) -> None:
        """Wake all gliding bodies near it, or if nothing is near, glide. Check again before
        anything can come near.
        """
        self.speed = self._speed_of(self._commanded)
        clear = self._wake_near()
        stood, self._stood = (
            self._stood,
            self._standing() if clear >= PROXIMITY_PERIOD and not self._glide else (),
        )
        if (
            clear >= PROXIMITY_PERIOD
            and stood
            and self._stood
            and math.dist(stood, self._stood) < SETTLED
        ):
            self._begin_to_glide()
        self._schedule_check(clear)

    def _schedule_check(self, clear: int) -> None:
        """Check again before the `clear` steps are over."""
        self._field.schedule_check(
            self, clear if self._glide and not self._field.others else PROXIMITY_PERIOD
        )

    def _speed_of(self, velocity: Planar) -> float:
        """An upper bound (m/s) of the speeds of its points at a velocity, rounded up so that few
        changes exceed it.
        """
        return _graded(math.hypot(velocity[0], velocity[1]) + abs(velocity[2]) * self._reach)

    def _wake_near(self) -> int:
        """Look for neighbours. Returns the number of steps, at most LONGEST_PERIOD, in which
        nothing but the ground can come near it. If that is less than PROXIMITY_PERIOD, something is
        near, and this body and the planar bodies there have been woken.
        """
        here = self.locate()
        if not self._glide:
            self.speed = max(self.speed, math.hypot(*super().twist()[0]))
        around = self._field.near(self, self.speed) - {self._field.level}
        steps = {number: self._steps_to(number, here) for number in around}
        near = [number for number, clear in steps.items() if clear < PROXIMITY_PERIOD]
        for number in near:
            if other := self._field.bodies.get(number):
                other.wake()
        if near:
            self.wake()
        return min(steps.values(), default=LONGEST_PERIOD)

    def _steps_to(self, number: int, here: XYZ) -> int:
        """The number of steps, at most LONGEST_PERIOD, in which another body of the engine cannot
        come near this one, whose root frame is `here`.
        """
        field, other = self._field, self._field.bodies.get(number)
        way = max(field.closing(self.speed) * field.step, 1e-9)  # m in a step
        if other and other._glide:
            apart = math.dist(here, other._glide.at(field.time)) - self._reach - other._reach
            if (steps := _within(apart - SKIN, way)) >= PROXIMITY_PERIOD:
                return steps
            other.locate()
        return _within(self._engine.gap(self.number, number, field.margin(self.speed)) - SKIN, way)

    def locate(self) -> XYZ:
        """Move the engine's body, which stays at the place of the last look while this one glides,
        to its true place. Returns the position of the root frame.
        """
        position, rotation = self.pose()
        if self._glide:
            self._place(position, rotation)
        return position

    def _standing(self) -> tuple[float, ...]:
        """Its height and upward axis if it touches only the level ground, is not tilting, and moves
        as commanded.
        """
        _, (rolling, pitching, _) = self._engine.velocity(self.number)
        if (
            not self._may_glide
            or self._is_blocked
            or self._engine.touched(self.number) != {self._field.level}
        ):
            return ()
        if (
            max(
                abs(rolling),
                abs(pitching),
                math.dist(self.velocity(self._field.step), self._commanded),
            )
            > STEADY
        ):
            return ()
        (_, _, z), rotation = self.pose()
        return z, *rotate(rotation, (0.0, 0.0, 1.0))

    def _begin_to_glide(self) -> None:
        """Glide from here at the drive's velocity. The engine's body is frozen meanwhile."""
        self._glide_from(self._commanded)
        self.glides = True
        self._field.gliding += 1
        self._engine.freeze(self.number)

    def _glide_from(self, velocity: Planar) -> None:
        position, rotation = self.pose()
        self._glide = Glide(self._field.time, position, rotation, velocity, yaw(rotation))

    def wake(self) -> None:
        """Stop gliding: hand its pose and velocity to the engine, where it has contacts from the
        next step on.
        """
        if self._glide is None:
            return
        (position, rotation), (linear, angular) = self.pose(), self.twist()
        self._glide, self.glides = None, False
        self._field.gliding -= 1
        self.woken()
        if self.check_at > self._field.steps + PROXIMITY_PERIOD:
            self._field.schedule_check(self, PROXIMITY_PERIOD)
        self._engine.thaw(self.number)
        self._stood = ()
        self._held, self._driven, self._is_blocked = None, None, False
        super().put(position, rotation, linear, angular)

    def pose(self) -> tuple[XYZ, XYZW]:
        """Position and rotation of the root frame in the world."""
        return self._glide.pose(self._field.time) if self._glide else super().pose()

    def twist(self) -> tuple[XYZ, XYZ]:
        """The root frame's velocity and rotation rate in the world."""
        if not self._glide:
            return super().twist()
        x, y, turn = self._glide.velocity
        vx, vy = to_world((x, y, 0.0), yaw(self.pose()[1]), 0.0)
        return (vx, vy, 0.0), (0.0, 0.0, turn)

    def drive(self, velocity: Planar, dt: float) -> None:
        """Set the body-frame velocity for the next step of `dt` seconds; gravity and contacts keep
        their effects.
        """
        if velocity != self._commanded:
            self._commanded = velocity
            if (speed := self._speed_of(velocity)) > self.speed:
                self.speed = speed
                self._schedule_check(self._wake_near())
            if self._glide:
                self._glide_from(velocity)
        if not self._glide:
            self._drive(velocity, dt)

    def _drive(self, velocity: Planar, dt: float) -> None:
        position, rotation, centre = self._root()
        (x, y, falling), (roll, pitch, spin) = self._engine.velocity(self.number)
        if velocity == STOP:
            vx, vy = self._back(position[0] - centre[0], position[1] - centre[1], dt)
        else:
            vx, vy = to_world(velocity, yaw(rotation), dt)
            self._held = None
        up, axis = _axes(rotation)
        if (
            axis is up
            and abs(vx * up[0] + vy * up[1] + falling * up[2]) < LANDED
            and not self._floats
        ):
            # On a slope, gravity and contact would take it downhill within the step: its wheels
            # prevent that.
            gravity = self._field.gravity
            into = sum(g * u for g, u in zip(gravity, up, strict=True))
            vx, vy = vx - (gravity[0] - into * up[0]) * dt, vy - (gravity[1] - into * up[1]) * dt
        turn = velocity[2]
        ox, oy = _orbit(axis, turn, centre, dt)
        vx, vy = vx + ox, vy + oy
        more = turn - roll * axis[0] - pitch * axis[1] - spin * axis[2]
        roll, pitch, spin = roll + more * axis[0], pitch + more * axis[1], spin + more * axis[2]
        if velocity == STOP:
            self._driven, self._is_blocked = None, False
        else:
            tipping = math.hypot(roll - turn * axis[0], pitch - turn * axis[1])
            vx, vy = self._driven = self._pushed((x, y), (vx, vy), tipping, dt)
        self._engine.move(self.number, (vx, vy, falling), (roll, pitch, spin))

    def _pushed(
        self, now: tuple[float, float], wanted: tuple[float, float], tipping: float, dt: float
    ) -> tuple[float, float]:
        """The velocity of the centre for the next step. A robot that loses speed within a step has
        met an obstacle. From then on, until it regains its speed, it pushes no harder than wheels
        could by their grip: forced against an edge it would tip over it. While it tips (`tipping`
        in rad/s), it does not push.
        """
        if self._driven is not None and math.dist(self._driven, now) > LOST * math.hypot(
            *self._driven
        ):
            self._is_blocked = True
        if self._is_blocked and tipping > TIPPING:
            return now
        missing = math.dist(wanted, now)
        if not self._is_blocked or missing <= self._push * dt:
            self._is_blocked = False
            return wanted
        share = self._push * dt / missing
        return now[0] + (wanted[0] - now[0]) * share, now[1] + (wanted[1] - now[1]) * share

    def put(self, position: XYZ, rotation: XYZW, linear: XYZ, angular: XYZ) -> None:
        """Place the root frame in the world, with its velocity and rotation rate there."""
        self.wake()
        self._field.hasten()
        self._stood = ()
        self._held, self._driven, self._is_blocked = None, None, False
        super().put(position, rotation, linear, angular)

    def _back(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """The velocity towards the place that it holds; a strong push moves that place."""
        if self._held is None or math.dist(self._held, (x, y)) > HOLD_LIMIT:
            self._held = x, y
        return (self._held[0] - x) * HOLD_GAIN / dt, (self._held[1] - y) * HOLD_GAIN / dt

    @property
    def time(self) -> float:
        """Simulated seconds since the start of the world."""
        return self._field.time

    @property
    def step(self) -> float:
        """The world's step in s."""
        return self._field.step

    @property
    def weight(self) -> float:
        """The weight of a kilogram in N."""
        return max(0.0, -self._field.gravity[2])

    @property
    def commanded(self) -> Planar:
        """The velocity that the drive set last."""
        return self._commanded

    def velocity(self, dt: float) -> Planar:
        """The root frame's planar velocity during the last step of `dt` seconds, in the body
        frame.
        """
        if self._glide:
            return self._glide.velocity
        _, rotation, centre = self._root()
        (vx, vy, _), (roll, pitch, spin) = self._engine.velocity(self.number)
        _, axis = _axes(rotation)
        turn = roll * axis[0] + pitch * axis[1] + spin * axis[2]
        ox, oy = _orbit(axis, turn, centre, -dt)
        x, y = to_body(vx - ox, vy - oy, yaw(rotation) - turn * dt / 2)
        return x, y, turn

    def remove(self) -> None:
        """Remove it from the world."""
        self.wake()
        self._field.remove(self)
        super().remove()


def _axes(rotation: XYZW) -> tuple[XYZ, XYZ]:
    """The upward axis of a body, and the axis that it turns about: the same, unless it lies on its
    side.
    """
    up = rotate(rotation, (0.0, 0.0, 1.0))
    return up, up if up[2] > STEEP else (0.0, 0.0, 1.0)


def _orbit(axis: XYZ, turn: float, centre: XYZ, dt: float) -> tuple[float, float]:
    """The horizontal velocity of a body's centre of mass relative to its root, as it turns about
    `axis`. Like the heading it is that of mid-step, so that the body stays on its circle.
    """
    if not turn:
        return 0.0, 0.0
    x, y, z = rotate(from_axis_angle(axis, turn * dt / 2), centre)
    return turn * (axis[1] * z - axis[2] * y), turn * (axis[2] * x - axis[0] * z)


class PlanarMover:
    """Moves a whole body over the plane. Its wheels turn only visually."""

    def __init__(self, body: PlanarBody, wheels: Wheels) -> None:
        self.body = body
        self._wheels = wheels
        self.names = wheels.names
        self.wheels, self.reserved = frozenset[str](), frozenset(wheels.names)
        self._rolled = 0.0  # sim time up to which the wheels have turned
        self._pushing: Pushing | None = None

    def let_push(self, model: RobotModel, forces: Mapping[str, Sequence[Force]]) -> None:
        """Let a model's forces `push` it; they are by the keys of their commands."""
        self._pushing = Pushing(model, forces, self.body.weight, self.body.step)

    def push(self, pushes: Sequence[AppliedForce], dt: float) -> None:
        """Let forces act during the next step, in place of `move`."""
        assert self._pushing is not None, "the model has forces"
        self._set(self._pushing.velocity(pushes, self.body.pose()[1], self.body.twist(), dt), dt)

    def move(self, velocity: Planar, dt: float) -> None:
        """Set the body's velocity."""
        if self._pushing:
            self._pushing.rest()
        self._set(velocity, dt)

    def _set(self, velocity: Planar, dt: float) -> None:
        if velocity != self.body.commanded and self.body.glides:
            self._roll(self.body.commanded)
        self.body.drive(velocity, dt)

    def moved(self, time: float, dt: float) -> Moved:
        """The true pose."""
        velocity = self.body.velocity(dt)
        if not self.body.glides:  # else its wheels are rolled when their states are read
            self._roll(velocity)
        return *self.body.pose(), velocity

    def _roll(self, velocity: Planar) -> None:
        """Roll the wheels up to now."""
        self._wheels.roll(velocity, self.body.time - self._rolled)
        self._rolled = self.body.time

    def states(self) -> JointStates:
        """Angles and rates of the wheels as they would roll without slip. There are no efforts."""
        if self.body.glides:
            self._roll(self.body.commanded)
        return self._wheels.angles, self._wheels.rates, []
