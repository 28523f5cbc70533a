"""A world of bodies in a physics engine.

Metres, kilograms, seconds; quaternions are x, y, z, w; positions and velocities are in the world
frame.
"""

import math
from collections.abc import Callable, Sequence

from holozen.engines import choose
from holozen.kinematics import Wheel
from holozen.robot import rigid
from holozen.robot.model import RobotModel, WorldSpec
from holozen.rotation import XYZ, XYZW

from .body import Body
from .engine import UPRIGHT, Engine, Rays
from .jointed import JointedBody
from .planar import Field, PlanarBody
from .ray_caster import RayCaster
from .wheels import on_spheres

# m by which bodies may overlap when they are placed; the engine throws apart what overlaps far more
OVERLAP = 0.01
# m by which they may be in the ground: soft wheels press in by some cm, what is 0.2 m deep is
# thrown out
SUNK = 0.05
HIGHEST_FLOOR = 0.5  # m; the most by which a body is lifted onto a floor that it is in
MAX_LIFTS = 100  # steps in which a free height is searched for, each as long as the overlap is deep
SIDES = 8  # directions in which a way out is searched for
RINGS = 8  # of places around a taken one that are searched for a free one


def _classes(engine: str) -> tuple[Callable[[WorldSpec], Engine], type[Rays]]:
    """The classes of an engine, given by name. The other engine is not loaded."""
    if engine == "mujoco":
        from .mujoco import MuJoCo, MuJoCoRays

        return MuJoCo, MuJoCoRays
    from .bullet import Bullet, BulletRays

    return Bullet, BulletRays


class World:
    """One world of bodies in an engine: pybullet or mujoco. `step` advances it by `spec.step`
    seconds.

    Without the name of an engine it is the one that is the default here. Raises Failure if none is
    installed.
    """

    def __init__(self, spec: WorldSpec, engine: str = "") -> None:
        self.spec, self._engine_name = spec, engine or choose().engine
        # added to the steps of the field, which begins at 0 after each `clear`
        self._steps_before = 0
        self._begin()

    def _begin(self) -> None:
        spec = self.spec
        self.engine = _classes(self._engine_name)[0](spec)
        level = None if any(spec.gravity[:2]) or spec.gravity[2] >= 0 else self.engine.ground
        self._field = Field(self.engine, spec.step, level, spec.gravity)

    def ray_caster(self) -> RayCaster:
        """A new ray caster, in the same kind of engine."""
        return RayCaster(_classes(self._engine_name)[1](self.spec.ground))

    @property
    def steps(self) -> int:
        """Steps since the start, or since the time was set to zero."""
        return self._field.steps + self._steps_before

    @property
    def time(self) -> float:
        """Simulated seconds: the time of these steps, so that no rounding error accumulates."""
        return self.steps * self.spec.step

    def rewind(self) -> None:
        """Set the time to zero; nothing else changes."""
        self._steps_before = -self._field.steps

    def clear(self) -> None:
        """Remove all bodies; the time goes on. The engine is a new one, in which the same bodies
        move as in the first one, to the last bit.
        """
        self._steps_before = self.steps
        self.close()
        self._begin()

    def step(self) -> None:
        """Advance the world by one step. Raises ValueError or ArithmeticError after the step if the
        numbers of a body are not finite.
        """
        if not self._field.rests:
            self.engine.step()
        self._field.stepped()

    def add(self, body: rigid.Body, at: XYZ, rotation: XYZW = UPRIGHT) -> PlanarBody:
        """Add a planar base, its root frame at `at`."""
        return PlanarBody(self._field, body, at, rotation)

    def add_jointed(
        self,
        model: RobotModel,
        at: XYZ,
        rotation: XYZW = UPRIGHT,
        wheels: frozenset[str] = frozenset(),
        omni: Sequence[Wheel] = (),
    ) -> JointedBody:
        """Add a robot with motors in its joints, or an object. `wheels` are the joints of the
        driven wheels; `omni` wheels, which become spheres, take their place. Raises RobotError if
        it has too many joints, or no mass.
        """
        parts = on_spheres(rigid.simulated_parts(model), omni)
        names = frozenset(wheel.joint for wheel in omni) or wheels
        body = JointedBody(
            self.engine, self.spec.step, parts, at, rotation, names, model.static, omni=bool(omni)
        )
        if not model.static or len(parts) > 1:
            self._field.others.append(body)
        self._field.hasten()
        return body

    def overlapped(self, body: Body) -> list[int]:
        """The engine's numbers of other bodies that `body` overlaps by more than OVERLAP, the
        deepest first. Planes do not count.
        """
        depths = self._depths(body)
        return sorted(depths, key=lambda number: (-depths[number], number))

    def _depths(self, body: Body) -> dict[int, float]:
        """How deep (m) a body is in others, by the engine's numbers of those in which it is by more
        than OVERLAP.
        """
        depths = {}
        for number in self._field.near(body, 0.0):
            if other := self._field.bodies.get(number):
                other.locate()
            depth = -self.engine.gap(body.number, number, 0.0)
            if depth > OVERLAP and not self.engine.is_plane(number):
                depths[number] = depth
        return depths

    def sunk(self, body: Body) -> float:
        """How deep (m) a body is in the ground: 0 if by no more than SUNK, or if the world has no
        ground.
        """
        ground = self.engine.ground
        depth = 0.0 if ground is None else -self.engine.gap(body.number, ground, 0.0)
        return depth if depth > SUNK else 0.0

    def lift(self, body: Body, taken: Callable[[], object]) -> float | None:
        """Move `body` straight up to where its place is no longer `taken`. Returns the height of
        its root frame there; None if it finds none.
        """
        for _ in range(MAX_LIFTS):
            if not taken():
                return body.pose()[0][2]
            self._shift(body, 0.0, 0.0, max(self._depths(body).values(), default=OVERLAP))
        return None

    def is_floor(self, body: Body, height: float, taken: Callable[[], object]) -> bool:
        """Whether a body that had to be lifted by `height` (m) to be free was in a floor: up was
        the shortest way out. Out of a wall it is shorter to a side, and out of what is higher than
        HIGHEST_FLOOR nothing is lifted.
        """
        if height > HIGHEST_FLOOR:
            return False
        for step in range(SIDES):
            x, y = (height * way(2 * math.pi * step / SIDES) for way in (math.cos, math.sin))
            self._shift(body, x, y, -height)
            is_free = not taken()
            self._shift(body, -x, -y, height)
            if is_free:
                return False
        return True

    def _shift(self, body: Body, x: float, y: float, z: float) -> None:
        at, rotation = body.pose()
        body.put((at[0] + x, at[1] + y, at[2] + z), rotation, *body.twist())

    def free_place(self, body: Body) -> XYZ | None:
        """Move `body` to the nearest free position on a grid around it, and return that; None if
        all are taken.
        """
        ((x, y, z), rotation), (low, high) = body.pose(), body.box()
        step = max(high[0] - low[0], high[1] - low[1], 0.1) / 2
        grid = range(-RINGS, RINGS + 1)
        around = sorted(
            ((i, j) for i in grid for j in grid), key=lambda at: (math.hypot(*at), -at[0], -at[1])
        )
        for i, j in around:
            place = (round(x + i * step, 2), round(y + j * step, 2), z)
            body.put(place, rotation, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            if not self.overlapped(body):
                return place
        return None

    def put(self, body: Body, place: tuple[XYZ, XYZW], linear: XYZ, angular: XYZ) -> None:
        """Place the root frame of a body in the world, with its velocity and rotation rate
        there.
        """
        body.put(*place, linear, angular)
        self._field.hasten()

    def close(self) -> None:
        """Free the engine."""
        self.engine.close()
