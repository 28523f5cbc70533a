"""`<inertial>` of links, read and checked: what is missing, impossible or absurd is replaced, with
a warning.
"""

from collections.abc import Mapping
from itertools import chain

from msgspec.structs import replace

from holozen.robot.files.elements import Source, Tag
from holozen.robot.inertia import LIGHTEST, NO_INERTIA, impossible, is_absurd, lumped, of_shapes
from holozen.robot.model import Drive, Joint, Link, Moments, Planar, Pose, descend, sides_of
from holozen.robot.rotation import symmetric
from holozen.suggest import cut, listed


def read_inertia(inertial: Tag) -> Moments:
    """The tensor of an `<inertial>` in kg m^2; NO_INERTIA for an impossible one: rejecting those
    would stop many students' robots. Raises RobotError.
    """
    given = inertial.child("inertia")
    tensor = _tensor(given)
    xx, _, _, yy, _, zz = tensor
    if min(xx, yy, zz) < 0:
        raise given.wrong(
            f"has ixx={xx}, iyy={yy}, izz={zz}; a moment of inertia is never negative"
        )
    return NO_INERTIA if impossible(tensor) else tensor


def _tensor(given: Tag) -> Moments:
    """The tensor of an `<inertia>`. Omitted values are 0, in SDF 1 on the diagonal."""
    xx, yy, zz = (given.number(name, 1.0 if given.sdf else 0.0) for name in ("ixx", "iyy", "izz"))
    xy, xz, yz = (given.number(name, 0.0) for name in ("ixy", "ixz", "iyz"))
    return xx, xy, xz, yy, yz, zz


def with_moments(link: Link, inertial: Tag | None, source: Source, silent: bool = False) -> Link:
    """The link; with the moments of inertia of its solid collision shapes if its own are NO_INERTIA
    or absurdly small, and a warning unless `silent`. A link without such shapes is unchanged:
    without inertia it is a point mass.
    """
    part = link.inertial
    if (
        inertial is None
        or part is None
        or not part.mass
        or not (link.collisions or part.inertia == NO_INERTIA)
    ):
        return link
    least = of_shapes(link)
    if part.inertia != NO_INERTIA and (
        least is None or not is_absurd(symmetric(part.inertia), part.mass, symmetric(least))
    ):
        return link
    if not silent:
        _warn(link, inertial, least is not None, source)
    if least is None:
        return link
    xx, xy, xz, yy, yz, zz = (part.mass * value for value in least)
    return replace(
        link, inertial=replace(part, pose=Pose(part.pose.xyz), inertia=(xx, xy, xz, yy, yz, zz))
    )


def _warn(link: Link, inertial: Tag, shaped: bool, source: Source) -> None:
    given, part = inertial.first("inertia"), link.inertial
    if part and part.inertia != NO_INERTIA:
        wrong = "is absurdly small for the size of the link's collision shapes"
    elif given is None:
        wrong = "has no <inertia>"
    else:
        wrong = f"{impossible(_tensor(given))}, which is impossible"
    taken = (
        "the inertia of its solid collision shapes is used"
        if shaped
        else "the link is treated as a point mass"
    )
    source.warn(given or inertial, f"{wrong}; {taken}")


def warn_massless(
    robot: Tag,
    links: Mapping[str, Link],
    joints: Mapping[str, Joint],
    lost: Mapping[str, str],
    source: Source,
) -> None:
    """Warn about each branch that is left out, and each link whose <inertial> has no mass."""
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
            problem = (
                "has no mass, so it is left out, as in Gazebo, with the joint "
                f"{cut(above[name])}{also}"
            )
            source.warn(tag, f"{problem}; give it an <inertial>")
        elif name not in lost and inertial is not None and inertial.mass == 0:
            source.warn(
                tag.first("inertial") or tag,
                "has no mass; the link is treated as massless, with no inertia",
            )


def check_drive(
    robot: Tag,
    drive: Drive | None,
    links: Mapping[str, Link],
    joints: Mapping[str, Joint],
    root: str,
    lost: Mapping[str, str],
    source: Source,
) -> None:
    """Raise RobotError if a drive needs a joint that is left out, or wheels have to push a root
    without mass.

    A root without mass that no wheels push only causes a warning.
    """
    tags = {tag.word("name"): tag for tag in robot.all("link")}
    for name in chain(*sides_of(drive.mechanism)) if drive else ():
        child = joints[name].child
        if child in lost:
            problem = (
                f"has no mass, so the joint {cut(name)} is left out, as in Gazebo, but the "
                "drive needs it"
            )
            raise tags[lost[child]].wrong(f"{problem}; give it an <inertial>")
    masses = lumped(links, [*descend(root, joints)])
    if masses[root] <= LIGHTEST and any(mass > LIGHTEST for mass in masses.values()):
        problem = (
            "is the root and has no mass, nor have the links fixed to it; Gazebo drops such a robot"
        )
        if drive is not None and not isinstance(drive.mechanism, Planar):
            raise tags[root].wrong(f"{problem}: give it an <inertial>")
        source.warn(tags[root], f"{problem}, but it is kept here: give it an <inertial>")
