"""SDF joints -> those of a robot."""

import math

from holozen.robot.errors import cut
from holozen.robot.parts import Joint, Limits, Mimic
from holozen.robot.rigid import Frame
from holozen.robot.rotation import triple
from holozen.robot.sdf.values import ENDLESS, direction, empty, flag, value
from holozen.robot.tag import Tag, Vector

KINDS = ("continuous", "revolute", "prismatic", "fixed")
AS_FIXED = ("ball", "universal", "screw", "revolute2")
ROLLING = ("ball", "universal")  # of those; a caster on one rolls every way
GEARBOX = "gearbox"  # couples two other joints; it holds nothing together

NOISE = 1e-12  # of a rotated unit vector


def read_joint(tag: Tag, name: str, ends: tuple[str, str], frames: tuple[Frame, Frame], axis: Vector) -> Joint:
    """A `<joint>` from a parent to a child link whose frames in the world are `frames`; `axis` is a unit vector there.

    Raises RobotError.
    """
    (parent, child), (outer, inner) = ends, frames
    kind, pose = kind_of(tag), (outer.inverse @ inner).pose
    if kind == "fixed":
        return Joint(name, kind, parent, child, pose, (1.0, 0.0, 0.0), Limits())
    limits = _limits(tag)
    if kind == "revolute" and (limits.lower, limits.upper) == (-math.inf, math.inf):
        kind = "continuous"
    if kind == "continuous":
        limits = Limits(limits.effort, limits.velocity)
    turned = _clean(triple(inner.inverse.rotation @ axis))
    return Joint(name, kind, parent, child, pose, turned, limits, *_dynamics(tag), _mimic(tag))


def has_spring(tag: Tag) -> bool:
    """Whether a joint is pulled back to a position. Raises RobotError."""
    dynamics = _axis(tag).first("dynamics")
    return dynamics is not None and value(dynamics, "spring_stiffness", 0.0, most=math.inf) != 0


def kind_of(tag: Tag) -> str:
    """One of KINDS, AS_FIXED counted as fixed. Raises RobotError."""
    kind = tag.word("type").strip()
    if kind not in (*KINDS, *AS_FIXED, GEARBOX):
        known = ", ".join((*KINDS, *AS_FIXED, GEARBOX))
        raise tag.wrong(f"has the unknown type {cut(kind)}; known are {known}")
    return "fixed" if kind in AS_FIXED else kind


def rolls(tag: Tag) -> bool:
    """Whether a joint leaves its link free to roll every way, and yet is taken as fixed."""
    return tag.attributes.get("type", "").strip() in ROLLING


def axis_of(tag: Tag, version: tuple[int, ...]) -> tuple[Vector, str]:
    """The unit vector a joint turns about or slides on, and the name of the frame it is told in, empty for the
    joint's own. Raises RobotError.
    """
    axis = _axis(tag)
    xyz = axis.first("xyz")
    within = "" if xyz is None else xyz.attributes.get("expressed_in", "").strip()
    # Up to SDF 1.4 an axis was told in the model's frame, in 1.5 and 1.6 where it says so.
    if flag(axis, "use_parent_model_frame", version < (1, 5)):
        within = within or "__model__"
    return direction(axis, "xyz"), within


def _axis(tag: Tag) -> Tag:
    return tag.first("axis") or empty(tag)


def _limits(tag: Tag) -> Limits:
    limit = _axis(tag).first("limit") or empty(tag)
    effort, velocity = (value(limit, name, -1.0, most=math.inf) for name in ("effort", "velocity"))
    lower = value(limit, "lower", -ENDLESS, most=math.inf)
    upper = value(limit, "upper", ENDLESS, most=math.inf)
    if lower > upper:
        raise limit.wrong(f"has lower {lower} above upper {upper}")
    return Limits(
        effort=math.inf if effort < 0 else effort,
        velocity=math.inf if velocity < 0 else velocity,
        lower=-math.inf if lower <= -ENDLESS else lower,
        upper=math.inf if upper >= ENDLESS else upper,
    )


def _dynamics(tag: Tag) -> tuple[float, float]:
    """Friction and damping."""
    dynamics = _axis(tag).first("dynamics") or empty(tag)
    friction, damping = (value(dynamics, name, 0.0) for name in ("friction", "damping"))
    if min(friction, damping) < 0:
        raise dynamics.wrong(f"has friction {friction} and damping {damping}; neither can be below zero")
    return friction, damping


def _mimic(tag: Tag) -> Mimic | None:
    mimic = _axis(tag).first("mimic")
    if mimic is None:
        return None
    multiplier = value(mimic, "multiplier", 1.0)
    offset = value(mimic, "offset", 0.0) - multiplier * value(mimic, "reference", 0.0)
    return Mimic(mimic.word("joint"), multiplier, offset)


def _clean(axis: Vector) -> Vector:
    x, y, z = (0.0 if abs(part) < NOISE else part for part in axis)
    return x, y, z
