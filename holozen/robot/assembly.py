"""A robot as rigid parts with moving joints between them: what fixed joints hold together is one part."""

from dataclasses import dataclass

from holozen.robot.model import HERE, RobotModel
from holozen.robot.parts import Joint, Surface
from holozen.robot.rigid import SMALLEST_MASS, Body, Frame, lump_links
from holozen.robot.rotation import Quaternion
from holozen.robot.tag import Vector
from holozen.robot.tree import descend

MOVING = ("continuous", "revolute", "prismatic")


@dataclass(frozen=True, slots=True)
class Part:
    """Links that move as one, in the frame of the topmost, `link`.

    `joint` moves it, None for the root's part; `parent` is the index of the part that carries it. `xyz` in metres and
    the quaternion x, y, z, w `rotation` are where it is in that part's frame, its joint at zero.
    """

    link: str
    body: Body
    surface: Surface
    joint: Joint | None = None
    parent: int = -1
    xyz: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)


def assemble(model: RobotModel) -> list[Part]:
    """The parts, every parent before its children, the root's first. A joint that moves no mass is taken as fixed."""
    above = {joint.child: joint for joint in model.joints.values()}
    moving = _moving(model, above)
    tops: dict[str, str] = {}  # link -> the topmost link of its part
    within: dict[str, dict[str, Frame]] = {}  # topmost link -> the frames of its part's links
    for name in descend(model.root, model.joints):
        if name == model.root or name in moving:
            tops[name], within[name] = name, {name: Frame.of(HERE)}
        else:
            top = tops[name] = tops[above[name].parent]
            within[top][name] = within[top][above[name].parent] @ Frame.of(above[name].pose)
    order = list(within)
    return [_part(model, top, within, tops, order, above) for top in order]


def _moving(model: RobotModel, above: dict[str, Joint]) -> set[str]:
    """The links that a joint moves. What hangs on a massless link may still give it mass."""
    masses = {name: link.inertial.mass if link.inertial else 0.0 for name, link in model.links.items()}
    found = set()
    for name in reversed(list(descend(model.root, model.joints))):
        if name == model.root:
            continue
        if above[name].kind in MOVING and masses[name] >= SMALLEST_MASS:
            found.add(name)
        else:
            masses[above[name].parent] += masses[name]
    return found


def _part(
    model: RobotModel,
    top: str,
    within: dict[str, dict[str, Frame]],
    tops: dict[str, str],
    order: list[str],
    above: dict[str, Joint],
) -> Part:
    body, surface = lump_links(model, within[top]), _surface(model, within[top])
    if top == model.root:
        return Part(top, body, surface)
    joint = above[top]
    carrier = tops[joint.parent]
    frame = within[carrier][joint.parent] @ Frame.of(joint.pose)
    return Part(top, body, surface, joint, order.index(carrier), frame.xyz, frame.quaternion)


def _surface(model: RobotModel, links: dict[str, Frame]) -> Surface:
    """That of the first link that has one and touches anything: an engine knows one surface a part."""
    touching = [model.links[name] for name in links if model.links[name].collisions]
    return next((link.surface for link in touching if link.surface != Surface()), Surface())
