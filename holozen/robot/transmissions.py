"""`<transmission>` elements, in the old spelling of pr2 and in that of ros_control."""

from collections.abc import Mapping

from holozen.robot.errors import cut
from holozen.robot.parts import Joint, Transmission
from holozen.robot.source import Source
from holozen.robot.tag import Tag, number


def read_transmissions(robot: Tag, joints: Mapping[str, Joint], source: Source) -> tuple[Transmission, ...]:
    """Those whose joints are there; the others make warnings, since nothing here is driven by them."""
    found = []
    for tag in robot.all("transmission"):
        names = tuple(joint.attributes.get("name", "").strip() for joint in tag.all("joint"))
        unknown = [name for name in names if name not in joints]
        if unknown:
            near = source.nearest(unknown[0], joints)
            source.warn(tag, f"names the joint {cut(unknown[0])}, which is not there{near}; it is left out")
        elif not names:
            source.warn(tag, "names no joint; it is left out")
        else:
            found.append(Transmission(_name(tag), _kind(tag), names, _interfaces(tag), _reduction(tag, source)))
    return tuple(found)


def _name(tag: Tag) -> str:
    return tag.attributes.get("name", "").strip()


def _kind(tag: Tag) -> str:
    told = tag.first("type")
    return told.value() if told else tag.attributes.get("type", "")


def _interfaces(tag: Tag) -> tuple[str, ...]:
    """Of the joints; older files give them to the actuators."""
    for parts in (tag.all("joint"), tag.all("actuator")):
        found = tuple(inside.value() for part in parts for inside in part.all("hardwareInterface"))
        if found:
            return found
    return ()


def _reduction(tag: Tag, source: Source) -> float:
    told = next(tag.below("mechanicalReduction"), None)
    if told is None:
        return 1.0
    value = number(told.value())
    if not value:
        source.warn(told, f"is {cut(told.value())}; 1 is used")
    return value or 1.0
