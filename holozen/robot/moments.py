"""Moments of inertia that a file leaves out, or that no body of the link's shapes has: taken from the shapes."""

from dataclasses import replace

from holozen.robot.parts import Link, Pose
from holozen.robot.source import Source
from holozen.robot.tag import Tag

NO_INERTIA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def with_moments(link: Link, inertial: Tag | None, source: Source, silent: bool = False) -> Link:
    """The link, its moments of inertia those of its collision shapes, each solid, where its own are NO_INERTIA or far
    below; a warning says so unless `silent`. A link without shapes stays as it is: a point mass, if it has no inertia.
    """
    part = link.inertial
    if inertial is None or part is None or not part.mass or not (link.collisions or part.inertia == NO_INERTIA):
        return link
    least = _of_shapes(link)
    if part.inertia != NO_INERTIA and (least is None or not _is_absurd(link, least)):
        return link
    if not silent:
        _tell(link, inertial, least is not None, source)
    if least is None:
        return link
    xx, xy, xz, yy, yz, zz = (part.mass * value for value in least)
    return replace(link, inertial=replace(part, pose=Pose(part.pose.xyz), inertia=(xx, xy, xz, yy, yz, zz)))


def _tell(link: Link, inertial: Tag, shaped: bool, source: Source) -> None:
    given, part = inertial.first("inertia"), link.inertial
    wrong = "is zero or not positive definite, which no body has"
    if part and part.inertia != NO_INERTIA:
        wrong = "is absurdly small for the size of the link's collision shapes"
    elif given is None:
        wrong = "has no <inertia>"
    taken = "that of solid bodies of its collision shapes is taken" if shaped else "the link is taken as a point mass"
    source.warn(given or inertial, f"{wrong}; {taken}")


def _of_shapes(link: Link) -> tuple[float, float, float, float, float, float] | None:
    """m^2, in the link's axes."""
    if not link.collisions:
        return None
    import numpy as np  # most verbs load no robot

    from holozen.robot.rotation import matrix_of
    from holozen.robot.solids import moments

    placed = ((shape, np.array(shape.pose.xyz), matrix_of(shape.pose.rpy)) for shape in link.collisions)
    found = moments(placed)
    if found is None:
        return None
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = found.tolist()
    return xx, xy, xz, yy, yz, zz


def _is_absurd(link: Link, least: tuple[float, float, float, float, float, float]) -> bool:
    assert link.inertial is not None, "it has been looked at"
    from holozen.robot.rotation import symmetric
    from holozen.robot.solids import is_absurd

    return is_absurd(symmetric(link.inertial.inertia), link.inertial.mass, symmetric(least))
