"""What a simulator starts with: physics, ground, models and lights."""

from dataclasses import dataclass

from holozen.robot.model import RobotModel
from holozen.robot.parts import Color, Pose
from holozen.robot.tag import Vector

STEP = 1 / 240  # s
GRAVITY = (0.0, 0.0, -9.8)  # m/s^2; Gazebo's default


@dataclass(frozen=True, slots=True)
class Light:
    """A light; `kind` is point, directional or spot, `pose` in the world and `direction` in the light's own frame.

    Nothing here is lit by it; it is kept for who draws the world.
    """

    name: str
    kind: str
    pose: Pose
    direction: Vector
    diffuse: Color = (1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class WorldSpec:
    """A world: physics step in s, gravity in m/s^2, real-time factor, and warnings.

    `ground` is a level plane at z = 0. `models` are everything else: each stands at its own `pose` in the world, and a
    plane that is tilted or at another height is a static one of them.
    """

    name: str = "default"
    step: float = STEP
    gravity: Vector = GRAVITY
    rtf: float = 1.0
    ground: bool = False
    warnings: tuple[str, ...] = ()
    models: tuple[RobotModel, ...] = ()
    lights: tuple[Light, ...] = ()
