"""Links that no inertia moves. Gazebo Classic leaves them out: so does this.

The rule of sdformat's src/parser_urdf.cc (CreateSDF): what fixed joints hold together is one body first; a body whose
mass is zero is then left out, with its joint and all that hangs on it.
"""

from collections.abc import Mapping
from dataclasses import replace

from holozen.robot.drives import Drive, Planar, joints_of
from holozen.robot.errors import cut, listed
from holozen.robot.parts import Joint, Link
from holozen.robot.source import Source
from holozen.robot.tag import Tag
from holozen.robot.tree import descend

LIGHTEST = 1e-6  # kg; what ignition::math::equal takes for zero


def massless(links: Mapping[str, Link], joints: Mapping[str, Joint], root: str) -> dict[str, str]:
    """Link to leave out -> the one at which its branch ends: itself, or one above it.

    A robot without any mass keeps all its links: it is no robot to drive, but one to look at.
    """
    above = {joint.child: joint for joint in joints.values()}
    order = list(descend(root, joints))
    masses = _lumped(links, above, order)
    if all(mass <= LIGHTEST for mass in masses.values()):
        return {}
    lost: dict[str, str] = {}
    for name in order[1:]:
        joint = above[name]
        if joint.parent in lost:
            lost[name] = lost[joint.parent]
        elif joint.kind != "fixed" and masses[name] <= LIGHTEST:
            lost[name] = name
    return lost


def _lumped(links: Mapping[str, Link], above: Mapping[str, Joint], order: list[str]) -> dict[str, float]:
    """Link -> its mass and that of all that fixed joints hang on it."""
    masses = {name: inertial.mass if (inertial := links[name].inertial) else 0.0 for name in order}
    for name in reversed(order[1:]):
        if above[name].kind == "fixed":
            masses[above[name].parent] += masses[name]
    return masses


def tell_massless(
    robot: Tag, links: Mapping[str, Link], joints: Mapping[str, Joint], lost: Mapping[str, str], source: Source
) -> None:
    """A warning for each branch that is left out, and for each link that says itself that it has no mass."""
    above = {joint.child: joint.name for joint in joints.values()}
    branches: dict[str, list[str]] = {}
    for name, top in lost.items():
        branches.setdefault(top, []).append(name)
    for tag in robot.all("link"):
        name = tag.word("name")
        inertial = links[name].inertial
        if name in branches:
            below = [other for other in branches[name] if other != name]
            also = f" and the links below it: {listed(below)}" if below else ""
            told = f"has no mass, so it is left out, as in Gazebo, with the joint {cut(above[name])}{also}"
            source.warn(tag, f"{told}; give it an <inertial>")
        elif name not in lost and inertial is not None and inertial.mass == 0:
            source.warn(tag.first("inertial") or tag, "has no mass; the link is taken as massless, with no inertia")


def check_drive(
    robot: Tag,
    drive: Drive | None,
    links: Mapping[str, Link],
    joints: Mapping[str, Joint],
    root: str,
    lost: Mapping[str, str],
    source: Source,
) -> None:
    """Raises RobotError where a drive needs a joint that is left out, or wheels have to push a root without mass.

    A root without mass that nothing has to push is a warning.
    """
    tags = {tag.word("name"): tag for tag in robot.all("link")}
    for name in joints_of(drive.mechanism) if drive else ():
        child = joints[name].child
        if child in lost:
            told = f"has no mass, so the joint {cut(name)} is left out, as in Gazebo, and the drive needs it"
            raise tags[lost[child]].wrong(f"{told}; give it an <inertial>")
    masses = _lumped(links, {joint.child: joint for joint in joints.values()}, list(descend(root, joints)))
    if masses[root] <= LIGHTEST and any(mass > LIGHTEST for mass in masses.values()):
        told = "is the root and has no mass, nor have the links fixed to it; Gazebo leaves such a robot out"
        if drive is not None and not isinstance(drive.mechanism, Planar):
            raise tags[root].wrong(f"{told}: give it an <inertial>")
        source.warn(tags[root], f"{told}, here it is kept: give it an <inertial>")


def without(
    links: Mapping[str, Link], joints: Mapping[str, Joint], lost: Mapping[str, str]
) -> tuple[dict[str, Link], dict[str, Joint]]:
    """The links and joints that are left, when no joint follows one that is gone."""
    kept = {name: joint for name, joint in joints.items() if joint.child not in lost}
    free = {
        name: replace(joint, mimic=None) if joint.mimic and joint.mimic.joint not in kept else joint
        for name, joint in kept.items()
    }
    return {name: link for name, link in links.items() if name not in lost}, free
