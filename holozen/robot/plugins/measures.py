"""The wheels that a plugin names, and those of their measures that it does not tell: the robot's links have them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from holozen.robot.drives import Balancing, Differential, Drive, Mecanum, Planar
from holozen.robot.errors import RobotError, cut
from holozen.robot.parts import Joint, Link
from holozen.robot.plugins.names import kind_of
from holozen.robot.plugins.settings import SMALLEST
from holozen.robot.tag import Tag

ROUND = ("cylinder", "sphere")


@dataclass(frozen=True, slots=True)
class Robot:
    """What the wheels belong to."""

    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    root: str


def measured(drive: Drive, plugin: Tag, robot: Robot) -> Drive:
    """The drive, with the radius of wheels that have no round collision shape as their other shapes have it. That of
    round ones stays 0: the links have it.

    Raises RobotError at `plugin` for a joint that is two wheels, and for wheels whose radius or distance from each
    other is neither told nor to be seen.
    """
    wheels = drive.mechanism
    if isinstance(wheels, Planar):
        return drive
    left, right = _sides(wheels)
    _check_once(left, right, plugin)
    if any(robot.joints[name].child not in robot.links for name in (*left, *right)):
        return drive  # such a wheel has no mass; `check_drive` tells that
    if isinstance(wheels, Balancing):
        _check_round((*left, *right), plugin, robot)
        return drive
    _check_apart(wheels, plugin, robot)
    if wheels.radius:
        return drive
    link, radius = _first_radius(left[0], plugin, robot)
    return drive if _round(link) else replace(drive, mechanism=replace(wheels, radius=radius))


def _sides(wheels: Differential | Mecanum | Balancing) -> tuple[tuple[str, ...], tuple[str, ...]]:
    match wheels:
        case Differential():
            return wheels.left, wheels.right
        case Mecanum():
            return (wheels.front_left, wheels.back_left), (wheels.front_right, wheels.back_right)
        case Balancing():
            return (wheels.left,), (wheels.right,)


def _check_once(left: tuple[str, ...], right: tuple[str, ...], plugin: Tag) -> None:
    for name in left:
        if name in right:
            told = f"has the joint {cut(name)} on the left and on the right"
            raise plugin.wrong(f"{told}; each wheel turns on a joint of its own")
    for side, names in (("left", left), ("right", right)):
        for name in names:
            if names.count(name) > 1:
                raise plugin.wrong(f"has the joint {cut(name)} twice on the {side}; each wheel turns on its own")


def _check_round(names: tuple[str, ...], plugin: Tag, robot: Robot) -> None:
    for name in names:
        link = robot.links[robot.joints[name].child]
        if _round(link) < SMALLEST:
            told = f"balances on the wheel {cut(link.name)}, whose collision shapes are not round"
            raise plugin.wrong(f"{told}; give it a <cylinder> with a radius of {SMALLEST:g} m or more")


def _check_apart(wheels: Differential | Mecanum, plugin: Tag, robot: Robot) -> None:
    left, right = _sides(wheels)
    if not wheels.separation and _apart(left, right, 1, robot) < SMALLEST:
        raise _untold(plugin, "wheel_separation", "its left and right wheels are at the same y")
    if isinstance(wheels, Mecanum) and not wheels.wheelbase:
        front, back = (wheels.front_left, wheels.front_right), (wheels.back_left, wheels.back_right)
        if _apart(front, back, 0, robot) < SMALLEST:
            raise _untold(plugin, "wheelbase", "its front and back wheels are at the same x")


def _apart(some: tuple[str, ...], others: tuple[str, ...], axis: int, robot: Robot) -> float:
    """Metres between the means of two groups of wheels, along an axis of the root frame."""
    from holozen.robot.model import RobotModel  # which loads this
    from holozen.robot.rigid import link_frames

    frames = link_frames(RobotModel("", robot.root, robot.links, robot.joints, None))
    places = [[frames[robot.joints[name].child].xyz[axis] for name in names] for names in (some, others)]
    one, other = (sum(values) / len(values) for values in places)
    return abs(one - other)


def _first_radius(name: str, plugin: Tag, robot: Robot) -> tuple[Link, float]:
    """The wheel on the joint `name`, and its radius in metres."""
    from holozen.robot.plugins.radius import radius_across

    joint = robot.joints[name]
    link = robot.links[joint.child]
    radius = _round(link) or radius_across(link, joint.axis)
    if radius < SMALLEST:
        told = f"its wheel {cut(link.name)} has no shape with a radius of {SMALLEST:g} m or more"
        raise _untold(plugin, "wheel_radius" if kind_of(plugin).startswith("gz:") else "wheel_diameter", told)
    return link, radius


def _round(link: Link) -> float:
    """The radius of the first round collision shape in metres; 0 without one."""
    return next((shape.size[0] for shape in link.collisions if shape.kind in ROUND), 0.0)


def _untold(plugin: Tag, tag: str, seen: str) -> RobotError:
    """`tag` as gz-sim and ROS 2 spell it."""
    head, *rest = tag.split("_")
    either = "" if kind_of(plugin).startswith("gz:") else f", or <{head}{''.join(map(str.title, rest))}> in ROS 1"
    return plugin.wrong(f"has no <{tag}>, and {seen}; give <{tag}>{either}, in metres")
