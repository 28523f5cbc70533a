"""The physics engine behind few verbs. Only this folder imports pybullet, and only this file names it.

Metres, kilograms, seconds; quaternions are x, y, z, w; positions and velocities are those of the world frame.
"""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from holozen.drive import to_body, to_world
from holozen.limits import Planar
from holozen.robot.rigid import Body, PlacedShape

from .worldfile import WorldSpec

Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]


@contextmanager
def _quiet() -> Iterator[None]:
    """pybullet prints its build time from C while it loads; no flag stops it."""
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


with _quiet():
    import pybullet as engine

_UPRIGHT: Rotation = (0.0, 0.0, 0.0, 1.0)


class World:
    """One world of bodies. `step` moves it on by `spec.step` seconds; `time` is what has passed."""

    def __init__(self, spec: WorldSpec) -> None:
        self.spec = spec
        self.steps = 0
        self._id: int = engine.connect(engine.DIRECT)
        engine.setGravity(*spec.gravity, physicsClientId=self._id)
        engine.setPhysicsEngineParameter(
            fixedTimeStep=spec.step,
            enableFileCaching=0,
            deterministicOverlappingPairs=1,
            physicsClientId=self._id,
        )
        if spec.ground:
            plane = engine.createCollisionShape(engine.GEOM_PLANE, physicsClientId=self._id)
            engine.createMultiBody(0, plane, physicsClientId=self._id)

    @property
    def time(self) -> float:
        """Simulated seconds since the start; from the count of steps, so that nothing adds up."""
        return self.steps * self.spec.step

    def step(self) -> None:
        """Move the world on by one step."""
        engine.stepSimulation(self._id)
        self.steps += 1

    def add(self, body: Body, at: Vector) -> "PlanarBody":
        """Put a planar base into the world, its root frame at `at`."""
        return PlanarBody(self._id, body, at)

    def close(self) -> None:
        """Free the engine."""
        engine.disconnect(self._id)


class PlanarBody:
    """A rigid base that is moved over the plane, as Gazebo's planar_move does: the drive sets its speed over ground and
    its turn, the engine keeps gravity, tilt and contacts. Its contacts have no friction: wheels that roll do not brake.
    """

    def __init__(self, world: int, body: Body, at: Vector) -> None:
        self._world = world
        self._centre = body.centre
        self._tilted = max(map(abs, body.axes[:3])) > 1e-9  # principal axes that are not the root's
        self._axes_back = engine.invertTransform((0, 0, 0), body.axes)[1]
        # An engine's base is placed by its inertial frame, which is where its centre of mass is.
        self._body: int = engine.createMultiBody(
            body.mass,
            _compound(world, body.collisions),
            basePosition=at,
            baseOrientation=_UPRIGHT,
            baseInertialFramePosition=body.centre,
            baseInertialFrameOrientation=body.axes,
            physicsClientId=world,
        )
        engine.changeDynamics(
            self._body,
            -1,
            localInertiaDiagonal=body.inertia,
            lateralFriction=0,
            linearDamping=0,
            angularDamping=0,
            physicsClientId=world,
        )

    def drive(self, velocity: Planar, dt: float) -> None:
        """Set the body-frame velocity for the next step of `dt` seconds; what gravity and contacts do is left alone."""
        _, rotation, centre = self._root()
        (_, _, falling), (roll, pitch, _) = engine.getBaseVelocity(self._body, self._world)
        vx, vy = to_world(velocity, _yaw(rotation), dt)
        turn = velocity[2]
        # The centre goes round the root; as with the heading, the middle of the step keeps it on its circle.
        cx, cy = to_world((centre[0], centre[1], turn), 0.0, dt)
        linear = (vx - turn * cy, vy + turn * cx, falling)
        engine.resetBaseVelocity(self._body, linear, (roll, pitch, turn), self._world)

    def pose(self) -> tuple[Vector, Rotation]:
        """Position and rotation of the root frame in the world."""
        position, rotation, centre = self._root()
        return (position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]), rotation

    def velocity(self, dt: float) -> Planar:
        """The root frame's planar velocity during the last step of `dt` seconds, as seen from the body's heading."""
        _, rotation, centre = self._root()
        (vx, vy, _), (_, _, turn) = engine.getBaseVelocity(self._body, self._world)
        cx, cy = to_world((centre[0], centre[1], -turn), 0.0, dt)
        x, y = to_body(vx + turn * cy, vy - turn * cx, _yaw(rotation) - turn * dt / 2)
        return x, y, turn

    def _root(self) -> tuple[Vector, Rotation, Vector]:
        """The centre of mass, the root frame's rotation, and the way from the root to the centre, in the world."""
        position, rotation = engine.getBasePositionAndOrientation(self._body, self._world)
        if self._tilted:
            rotation = engine.multiplyTransforms((0, 0, 0), rotation, (0, 0, 0), self._axes_back)[1]
        return position, rotation, _turned(rotation, self._centre)


def _compound(world: int, placed: tuple[PlacedShape, ...]) -> int:
    """One collision shape of many, in the root frame. Meshes are left out."""
    shapes = [part for part in placed if part.shape.kind in SHAPES]
    arguments: dict[str, Any] = {
        "shapeTypes": [SHAPES[part.shape.kind] for part in shapes],
        "radii": [part.shape.size[0] for part in shapes],
        "lengths": [part.shape.size[-1] for part in shapes],
        "halfExtents": [[edge / 2 for edge in (*part.shape.size, 0, 0)[:3]] for part in shapes],
        "collisionFramePositions": [part.xyz for part in shapes],
        "collisionFrameOrientations": [part.quaternion for part in shapes],
    }
    return int(engine.createCollisionShapeArray(**arguments, physicsClientId=world))


SHAPES = {"box": engine.GEOM_BOX, "cylinder": engine.GEOM_CYLINDER, "sphere": engine.GEOM_SPHERE}


def _yaw(q: Rotation) -> float:
    x, y, z, w = q
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _turned(q: Rotation, v: Vector) -> Vector:
    """`v` rotated by `q`: v + 2 w (u x v) + 2 u x (u x v) with u the vector part of q."""
    x, y, z, w = q
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )
