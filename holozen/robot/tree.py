"""The tree that links and joints have to form."""

from collections.abc import Iterator, Mapping

from holozen.robot.errors import cut, listed
from holozen.robot.parts import Joint
from holozen.robot.tag import Tag


def root_of(robot: Tag, links: Mapping[str, object], joints: Mapping[str, Joint]) -> str:
    """The one link that is no joint's child. Raises RobotError unless links and joints are one tree."""
    tags = {tag.word("name"): tag for tag in robot.all("joint")}
    _check_ends(tags, links, joints)
    parents = _parents(tags, joints)
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        raise robot.wrong(f"has {len(roots)} root links: {listed(roots)}; hang all but one on another with a joint")
    reached = set(descend(roots[0], joints)) if roots else set()
    lost = [name for name in links if name not in reached]
    if lost:
        raise robot.wrong(f"has joints that go in a circle through the links {listed(lost)}; take one joint away")
    return roots[0]


def descend(root: str, joints: Mapping[str, Joint]) -> Iterator[str]:
    """`root` and the links below it, every parent before its children."""
    children: dict[str, list[str]] = {}
    for joint in joints.values():
        children.setdefault(joint.parent, []).append(joint.child)
    waiting = [root]
    while waiting:
        name = waiting.pop()
        yield name
        waiting += children.get(name, [])


def _check_ends(tags: Mapping[str, Tag], links: Mapping[str, object], joints: Mapping[str, Joint]) -> None:
    for joint in joints.values():
        for end, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in links:
                known = listed(list(links))
                raise tags[joint.name].wrong(f"names the {end} link {cut(name)}; the links there are: {known}")


def _parents(tags: Mapping[str, Tag], joints: Mapping[str, Joint]) -> dict[str, str]:
    """Child link -> the joint that holds it."""
    parents: dict[str, str] = {}
    for joint in joints.values():
        other = parents.setdefault(joint.child, joint.name)
        if other != joint.name:
            raise tags[joint.name].wrong(f"has the child link {cut(joint.child)}, which joint {cut(other)} has already")
    return parents
