"""Joints that follow other joints."""

from collections.abc import Mapping

from holozen.robot.errors import RobotError, cut, listed
from holozen.robot.parts import Joint
from holozen.robot.source import Source
from holozen.robot.tag import Tag


def check_mimics(robot: Tag, joints: Mapping[str, Joint], source: Source) -> None:
    """Raises RobotError for a joint that follows one which is not there, or itself, be it by way of others."""
    followed = {joint.name: joint.mimic.joint for joint in joints.values() if joint.mimic}
    for name, other in followed.items():
        if other not in joints:
            near = source.nearest(other, joints)
            told = f"follows the joint {cut(other)}, which is not there{near}"
            raise _wrong(robot, name, f"{told}; the joints there are: {listed(list(joints))}")
    done: set[str] = set()
    for start in followed:
        path: dict[str, None] = {}
        name = start
        while name in followed and name not in done:
            if name in path:
                circle = list(path)[list(path).index(name) :]
                raise _wrong(robot, name, f"follows itself, in a circle through the joints {listed(circle)}")
            path[name] = None
            name = followed[name]
        done.update(path)


def _wrong(robot: Tag, name: str, problem: str) -> RobotError:
    joint = next(tag for tag in robot.all("joint") if tag.word("name") == name)
    return (joint.first("mimic") or joint).wrong(problem)
