"""What a robot is made of: links, their shapes and inertias, and joints."""

import math
from dataclasses import dataclass
from pathlib import Path

from holozen.robot.tag import Vector


@dataclass(frozen=True, slots=True)
class Pose:
    """A frame in its parent frame: metres, and radians of roll, pitch, yaw about the parent's fixed x, y, z."""

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass in kg and `(ixx, ixy, ixz, iyy, iyz, izz)` in kg m^2 about the centre of mass, in the axes of
    `pose`.

    `pose` is the inertial frame in the link's. The tensor is positive definite, or all zero for a point mass.
    """

    pose: Pose
    mass: float
    inertia: tuple[float, float, float, float, float, float]


Color = tuple[float, float, float, float]
"""Red, green, blue, alpha, each from 0 to 1."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A visual or collision shape; `pose` is its frame in the link's.

    `size` in metres by `kind`: "box" x, y, z; "cylinder" radius, length (along z); "sphere" radius; "plane" x, y (its
    normal is z); "mesh" the three scale factors; "hull" nothing. `path` is a mesh's file, None when it was not found.
    `points` in metres are those whose convex hull a "hull" is.
    """

    kind: str
    size: tuple[float, ...]
    pose: Pose
    path: Path | None = None
    color: Color | None = None
    points: tuple[Vector, ...] = ()


@dataclass(frozen=True, slots=True)
class Surface:
    """How a link's collision shapes touch: friction coefficients (mu2 across mu1), stiffness in N/m and damping in
    N s/m of the contact. None: the simulator's own.
    """

    mu1: float | None = None
    mu2: float | None = None
    kp: float | None = None
    kd: float | None = None
    self_collide: bool = False


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid part. Without an `inertial` it has no mass."""

    name: str
    inertial: Inertial | None
    visuals: tuple[Shape, ...]
    collisions: tuple[Shape, ...]
    surface: Surface = Surface()
    gravity: bool = True


@dataclass(frozen=True, slots=True)
class Limits:
    """Effort in N or N m, velocity in m/s or rad/s, position in m or rad; infinite if the file sets none."""

    effort: float = math.inf
    velocity: float = math.inf
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another one: multiplier * position + offset."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """`kind` is one of `JOINT_KINDS`. `pose` is the child link's frame in the parent's at joint position
    zero; `axis` is a unit vector in the child's frame, (1, 0, 0) where the kind has none. `friction` is Coulomb's, in
    N m or N; `damping` in N m s/rad or N s/m.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose
    axis: Vector
    limits: Limits
    friction: float = 0.0
    damping: float = 0.0
    mimic: Mimic | None = None


@dataclass(frozen=True, slots=True)
class Sensor:
    """A sensor on a link. `kind` as the file says, such as "imu" or "camera"; `rate` in Hz, 0: every step."""

    name: str
    kind: str
    link: str
    rate: float = 0.0
    topic: str = ""


@dataclass(frozen=True, slots=True)
class Transmission:
    """What ros_control knows of an actuator: its joints and their hardware interfaces."""

    name: str
    kind: str
    joints: tuple[str, ...]
    interfaces: tuple[str, ...]
    reduction: float = 1.0


JOINT_KINDS = ("continuous", "revolute", "prismatic", "fixed", "floating", "planar")
