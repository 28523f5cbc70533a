"""The physics engine behind few verbs.

Metres, kilograms, seconds; quaternions are x, y, z, w; positions and velocities are those of the world frame.
"""

from holozen.robot import rigid
from holozen.robot.assembly import assemble
from holozen.robot.errors import RobotError
from holozen.robot.model import RobotModel

from .dynamics import FRICTION
from .engine import UPRIGHT, Rotation, Shapes, Vector, bullet
from .jointed import MOST_JOINTS, JointedBody
from .planar import PlanarBody
from .worldfile import WorldSpec


class World:
    """One world of bodies. `step` moves it on by `spec.step` seconds; `time` is what has passed."""

    def __init__(self, spec: WorldSpec) -> None:
        self.spec = spec
        self.steps = 0
        self._id: int = bullet.connect(bullet.DIRECT)
        self._shapes = Shapes(self._id)
        bullet.setGravity(*spec.gravity, physicsClientId=self._id)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=spec.step,
            enableFileCaching=0,
            deterministicOverlappingPairs=1,
            # Its cone gives a wheel that slips grip by its heading in the world; the pyramid, as Gazebo's, far less.
            enableConeFriction=0,
            physicsClientId=self._id,
        )
        if spec.ground:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=self._id)
            ground = bullet.createMultiBody(0, plane, physicsClientId=self._id)
            bullet.changeDynamics(ground, -1, lateralFriction=FRICTION, physicsClientId=self._id)

    @property
    def time(self) -> float:
        """Simulated seconds since the start; from the count of steps, so that nothing adds up."""
        return self.steps * self.spec.step

    def step(self) -> None:
        """Move the world on by one step."""
        bullet.stepSimulation(self._id)
        self.steps += 1

    def add(self, body: rigid.Body, at: Vector, rotation: Rotation = UPRIGHT) -> PlanarBody:
        """Put a planar base into the world, its root frame at `at`."""
        return PlanarBody(self._id, self._shapes, body, at, rotation)

    def add_jointed(
        self, model: RobotModel, at: Vector, rotation: Rotation = UPRIGHT, wheels: frozenset[str] = frozenset()
    ) -> JointedBody:
        """Put a robot with motors in its joints, or an object, into the world. `wheels` names the
        joints of those that drive it. Raises RobotError if it is too large.
        """
        parts = assemble(model)
        if parts[0].body.mass < rigid.SMALLEST_MASS and not model.static:
            solid = next((link.name for link in model.links.values() if link.collisions), parts[0].link)
            problem = f"{model.name[:80]!r} has no mass: neither {parts[0].link!r} nor what is fixed to it has any"
            raise RobotError(f"{problem}; give {solid!r} an <inertial>")
        if len(parts) > MOST_JOINTS:
            raise RobotError(
                f"{model.name!r} has {len(parts) - 1} moving joints; at most {MOST_JOINTS - 1} are simulated"
            )
        return JointedBody(self._id, self._shapes, parts, at, rotation, wheels, model.static)

    def close(self) -> None:
        """Free the engine."""
        bullet.disconnect(self._id)
