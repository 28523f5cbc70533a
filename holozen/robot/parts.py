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


@dataclass(frozen=True, slots=True)
class Shape:
    """A visual or collision shape; `pose` is its frame in the link's.

    `size` in metres by `kind`: "box" x, y, z; "cylinder" radius, length (along z); "sphere" radius; "mesh"
    the three scale factors. `path` is a mesh's file, None when it was not found.
    """

    kind: str
    size: tuple[float, ...]
    pose: Pose
    path: Path | None = None


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid part. Without an `inertial` it has no mass."""

    name: str
    inertial: Inertial | None
    visuals: tuple[Shape, ...]
    collisions: tuple[Shape, ...]


@dataclass(frozen=True, slots=True)
class Limits:
    """Effort in N or N m, velocity in m/s or rad/s, position in m or rad; infinite if the file sets none."""

    effort: float = math.inf
    velocity: float = math.inf
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(frozen=True, slots=True)
class Joint:
    """`kind` is one of `JOINT_KINDS`. `pose` is the child link's frame in the parent's at joint position
    zero; `axis` is a unit vector in the child's frame, (1, 0, 0) where the kind has none.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose
    axis: Vector
    limits: Limits


JOINT_KINDS = ("continuous", "revolute", "prismatic", "fixed", "floating", "planar")
