"""Mass and inertia: the moments of solid shapes, what is impossible or absurd of a tensor, and
links without mass.
"""

from collections.abc import Iterable, Mapping

import numpy as np
from msgspec.structs import replace

from holozen.robot.model import Joint, Link, Moments, Shape, descend, solid
from holozen.robot.rotation import Array, matrix_of

# Moments of inertia of solid shapes, per mass: kg m^2 per kg.


ABSURD = 64.0  # times smaller than those of the solid shape: an eighth of its radius of gyration

Placed = tuple[Shape, Array, Array]
"""A shape; its frame's position (3,) in metres, and rotation (3, 3) whose columns are the frame's
axes.
"""


def moments(placed: Iterable[Placed]) -> Array | None:
    """The tensor (3, 3) in m^2 about the centre of all shapes, solid and of equal density; None
    without any.

    A mesh or a hull counts as its bounding box. Planes and missing meshes are ignored.
    """
    found = [
        part
        for shape, position, rotation in placed
        if (part := _part(solid(shape), position, rotation))
    ]
    whole = sum(volume for volume, _, _ in found)
    if not found:
        return None
    centre = sum((volume * middle for volume, middle, _ in found), np.zeros(3)) / whole
    total = np.zeros((3, 3))
    for volume, middle, tensor in found:
        away = middle - centre
        total += volume / whole * (tensor + away @ away * np.eye(3) - np.outer(away, away))
    return total


def is_absurd(tensor: Array, mass: float, least: Array) -> bool:
    """Whether a tensor in kg m^2 is far below that of a solid body, `least` in m^2, about any of
    its axes.
    """
    given, own = np.linalg.eigvalsh(tensor), np.linalg.eigvalsh(least)
    return bool((given * ABSURD < mass * own).any())


def _part(shape: Shape, position: Array, rotation: Array) -> tuple[float, Array, Array] | None:
    """Volume in m^3, centre (3,) in metres and tensor (3, 3) per mass of one shape; None if it has
    no volume.
    """
    middle, (x, y, z), volume = np.zeros(3), (0.0, 0.0, 0.0), 0.0
    if shape.kind == "box":
        x, y, z = (edge * edge / 12 for edge in shape.size)
        volume = float(np.prod(shape.size))
    elif shape.kind == "hull":
        low, high = np.min(shape.points, axis=0), np.max(shape.points, axis=0)
        middle, (x, y, z), volume = (
            (low + high) / 2,
            (high - low) ** 2 / 12,
            float(np.prod(high - low)),
        )
    elif shape.kind == "cylinder":
        radius, length = shape.size
        x, y, z = radius * radius / 4, radius * radius / 4, length * length / 12
        volume = float(np.pi) * radius * radius * length
    elif shape.kind == "sphere":
        x = y = z = shape.size[0] ** 2 / 5
        volume = 4 / 3 * float(np.pi) * shape.size[0] ** 3
    if not volume:
        return None
    tensor = rotation @ np.diag([y + z, x + z, x + y]) @ rotation.T
    return volume, position + rotation @ middle, tensor


def positive_definite(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float) -> bool:
    """Sylvester's criterion: the leading minors are above zero."""
    minor = xx * yy - xy * xy
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    return xx > 0 and minor > 0 and determinant > 0


ROUNDING = 0.01  # of the trace: numbers are written with few digits


def impossible(inertia: Moments) -> str:
    """Why no body can have these moments, in kg m^2; empty if one can."""
    xx, xy, xz, yy, yz, zz = inertia
    if not positive_definite(xx, xy, xz, yy, yz, zz):
        return "is zero or not positive definite"
    # The triangle inequality, for any axes: the second moments of mass, half the trace minus the
    # tensor, are not negative (P. Wensing et al., "Linear matrix inequalities for physically
    # consistent inertial parameter identification", IEEE Robotics and Automation Letters 3, 2018).
    half = (xx + yy + zz) * (0.5 + ROUNDING)
    if not positive_definite(half - xx, -xy, -xz, half - yy, -yz, half - zz):
        return f"has one moment above the sum of the other two (ixx={xx:g}, iyy={yy:g}, izz={zz:g})"
    return ""


# Moments that a file omits, or that no body of the link's shapes can have.


NO_INERTIA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def of_shapes(link: Link) -> Moments | None:
    """The moments per mass of a link's solid collision shapes, (ixx, ixy, ixz, iyy, iyz, izz) in
    m^2 about their centre, in the link's axes; None without any.
    """
    if not link.collisions:
        return None
    placed = (
        (shape, np.array(shape.pose.xyz), matrix_of(shape.pose.rpy)) for shape in link.collisions
    )
    found = moments(placed)
    if found is None:
        return None
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = found.tolist()
    return xx, xy, xz, yy, yz, zz


# Links without mass. Gazebo Classic drops them, and so do we, by the rule of sdformat's
# src/parser_urdf.cc (CreateSDF): links connected by fixed joints are one body; a body without mass
# is dropped, with its joint and everything attached to it.


LIGHTEST = 1e-6  # kg; treated as zero by ignition::math::equal


def massless(links: Mapping[str, Link], joints: Mapping[str, Joint], root: str) -> dict[str, str]:
    """Each link to drop -> the topmost link of its dropped branch.

    A robot without any mass keeps all its links: it can be displayed but not driven.
    """
    order = [*descend(root, joints)]
    masses = lumped(links, order)
    if all(mass <= LIGHTEST for mass in masses.values()):
        return {}
    lost: dict[str, str] = {}
    for joint in order:
        if joint.parent in lost:
            lost[joint.child] = lost[joint.parent]
        elif joint.kind != "fixed" and masses[joint.child] <= LIGHTEST:
            lost[joint.child] = joint.child
    return lost


def lumped(links: Mapping[str, Link], order: list[Joint]) -> dict[str, float]:
    """Link -> its mass plus that of everything fixed to it. `order` is that of `descend`."""
    masses = {name: link.inertial.mass if link.inertial else 0.0 for name, link in links.items()}
    for joint in reversed(order):
        if joint.kind == "fixed":
            masses[joint.parent] += masses[joint.child]
    return masses


def without(
    links: Mapping[str, Link], joints: Mapping[str, Joint], lost: Mapping[str, str]
) -> tuple[dict[str, Link], dict[str, Joint]]:
    """The links and joints without the `lost` ones; mimics of removed joints are cleared."""
    kept = {name: joint for name, joint in joints.items() if joint.child not in lost}
    free = {
        name: replace(joint, mimic=None) if joint.mimic and joint.mimic.joint not in kept else joint
        for name, joint in kept.items()
    }
    return {name: link for name, link in links.items() if name not in lost}, free
