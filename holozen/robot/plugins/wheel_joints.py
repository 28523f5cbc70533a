"""The joints that a plugin names as wheels."""

from collections.abc import Mapping

from holozen.robot.errors import cut, listed
from holozen.robot.parts import Joint
from holozen.robot.plugins.settings import Settings
from holozen.robot.source import Source
from holozen.robot.tag import Tag

TURNING = ("continuous", "revolute")


def wheel_joint(settings: Settings, joints: Mapping[str, Joint], source: Source, default: str, *names: str) -> str:
    """The joint that the first of the tags `names` names, else `default`. Raises RobotError as `turning` does."""
    tag = settings.tag(*names)
    if not tag.value() and default not in joints:
        raise settings.owner.wrong(f"has no <{names[0]}>; the joints there are: {listed(list(joints))}")
    return turning(tag, tag.value() or default, joints, source)


def wheel_joints(
    settings: Settings, joints: Mapping[str, Joint], source: Source, default: str, *names: str
) -> tuple[str, ...]:
    """All joints that tags called one of `names` name, each one or several with spaces between; else `default`.

    Raises RobotError as `turning` does.
    """
    told = [(tag, name) for tag in settings.each(*names) for name in _split(tag.value(), joints)]
    if not told:
        return (wheel_joint(settings, joints, source, default, *names),)
    return tuple(turning(tag, name, joints, source) for tag, name in told)


def turning(tag: Tag, name: str, joints: Mapping[str, Joint], source: Source) -> str:
    """`name`. Raises RobotError with what there is for one that is no joint, or a joint that does not turn."""
    if name not in joints:
        near = source.nearest(name, joints)
        told = f"names the joint {cut(name)}, which is not there{near}"
        raise tag.wrong(f"{told}; the joints there are: {listed(list(joints))}")
    if joints[name].kind not in TURNING:
        raise tag.wrong(f"names the joint {cut(name)}, which is {joints[name].kind}; a wheel's joint is continuous")
    return name


def _split(words: str, joints: Mapping[str, Joint]) -> list[str]:
    return [words] if words in joints else words.split()
