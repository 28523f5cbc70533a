"""The physics engine behind a small interface.

Metres, kilograms, seconds; quaternions are x, y, z, w; positions and velocities are those of the world frame.
"""

from typing import TypeVar

from holozen.robot import rigid
from holozen.robot.errors import RobotError
from holozen.robot.model import RobotModel, WorldSpec
from holozen.robot.rigid import assemble

from .body import Body
from .dynamics import FRICTION
from .engine import UPRIGHT, Rotation, Shapes, Vector, bullet
from .jointed import MAX_JOINTS, JointedBody
from .planar import Field, PlanarBody

Added = TypeVar("Added", PlanarBody, JointedBody)


class World:
    """One world of bodies. `step` advances it by `spec.step` seconds; `time` is the simulated time."""

    def __init__(self, spec: WorldSpec) -> None:
        self.spec = spec
        self.id: int = bullet.connect(bullet.DIRECT)
        self._shapes = Shapes(self.id)
        self._floating: list[Body] = []
        bullet.setGravity(*spec.gravity, physicsClientId=self.id)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=spec.step,
            enableFileCaching=0,
            deterministicOverlappingPairs=1,
            # With the cone a slipping wheel's grip depends on its heading in the world; with Gazebo's pyramid far less.
            enableConeFriction=0,
            physicsClientId=self.id,
        )
        level: int | None = None
        if spec.ground:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=self.id)
            ground = bullet.createMultiBody(0, plane, physicsClientId=self.id)
            bullet.changeDynamics(ground, -1, lateralFriction=FRICTION, physicsClientId=self.id)
            level = None if any(spec.gravity[:2]) or spec.gravity[2] >= 0 else ground
        self._field = Field(self.id, spec.step, level)

    @property
    def steps(self) -> int:
        """Steps since the start."""
        return self._field.steps

    @property
    def time(self) -> float:
        """Simulated seconds since the start; from the count of steps, so that no error accumulates."""
        return self._field.time

    def step(self) -> None:
        """Advance the world by one step."""
        self._floating = [body for body in self._floating if not body.is_removed]
        for body in self._floating:
            body.cancel_gravity(self.spec.gravity)
        if not self._field.rests:
            bullet.stepSimulation(self.id)
        self._field.stepped()

    def add(self, body: rigid.Body, at: Vector, rotation: Rotation = UPRIGHT) -> PlanarBody:
        """Add a planar base, its root frame at `at`."""
        return self._added(PlanarBody(self._field, self._shapes, body, at, rotation))

    def add_jointed(
        self, model: RobotModel, at: Vector, rotation: Rotation = UPRIGHT, wheels: frozenset[str] = frozenset()
    ) -> JointedBody:
        """Add a robot with motors in its joints, or an object. `wheels` names the joints of the wheels that drive it.
        Raises RobotError if it has too many joints, or no mass.
        """
        parts = assemble(model)
        if parts[0].body.mass < rigid.SMALLEST_MASS and not model.static:
            solid = next((link.name for link in model.links.values() if link.collisions), parts[0].link)
            problem = f"{model.name[:80]!r} has no mass: neither {parts[0].link!r} nor what is fixed to it has any"
            raise RobotError(f"{problem}; give {solid!r} an <inertial>")
        if len(parts) > MAX_JOINTS:
            raise RobotError(
                f"{model.name!r} has {len(parts) - 1} moving joints; at most {MAX_JOINTS - 1} are simulated"
            )
        body = self._added(JointedBody(self.id, self._shapes, parts, at, rotation, wheels, model.static))
        if not model.static or len(parts) > 1:
            self._field.others.append(body)
        return body

    def _added(self, body: Added) -> Added:
        if body.weightless:
            self._floating.append(body)
        return body

    def close(self) -> None:
        """Free the engine."""
        bullet.disconnect(self.id)
