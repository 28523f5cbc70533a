"""What SDF writes as the text of an element: numbers, vectors, flags, names and poses."""

import math
from dataclasses import dataclass

from holozen.robot.errors import cut
from holozen.robot.parts import Pose
from holozen.robot.rigid import Frame
from holozen.robot.rotation import matrix_of_quaternion, rpy_of
from holozen.robot.tag import LARGEST, Tag, Vector, number

ENDLESS = 1e16  # SDF's own number for a joint without a limit
SHORTEST = 1e-6  # of a direction


@dataclass(frozen=True, slots=True)
class Placed:
    """A pose, and the name of the frame that it is told in, empty for the one that is usual for its element."""

    pose: Pose
    within: str


def word(tag: Tag, name: str, default: str = "") -> str:
    """The text of the child called `name`."""
    child = tag.first(name)
    return default if child is None else child.text.strip()


def empty(tag: Tag) -> Tag:
    """An element with nothing in it, whose messages are about `tag`."""
    return Tag(tag.name, tag.attributes, tag.place, tag.parent)


def numbers(tag: Tag, count: int, most: float = LARGEST) -> tuple[float, ...]:
    """The `count` numbers that are the text of `tag`, from -`most` to `most`. Raises RobotError."""
    words = tag.text.split()
    values = tuple(_number(tag, word, most) for word in words)
    if len(values) != count:
        raise tag.wrong(f"has {len(values)} numbers instead of {count}: {cut(tag.text.strip())}")
    return values


def value(tag: Tag, name: str, default: float, most: float = LARGEST) -> float:
    """The one number in the child called `name`. Raises RobotError."""
    child = tag.first(name)
    return default if child is None else numbers(child, 1, most)[0]


def vector(tag: Tag, name: str, default: Vector) -> Vector:
    """The three numbers in the child called `name`. Raises RobotError."""
    child = tag.first(name)
    if child is None:
        return default
    x, y, z = numbers(child, 3)
    return x, y, z


def direction(tag: Tag, name: str) -> Vector:
    """The unit vector in the child called `name`; without one it is z, as everywhere in SDF. Raises RobotError."""
    x, y, z = vector(tag, name, (0.0, 0.0, 1.0))
    length = math.hypot(x, y, z)
    if length < SHORTEST:
        raise (tag.first(name) or tag).wrong("has no direction; straight up is 0 0 1")
    return x / length, y / length, z / length


def flag(tag: Tag, name: str, default: bool) -> bool:
    """True or false in the child called `name`. Raises RobotError."""
    child = tag.first(name)
    if child is None:
        return default
    text = child.text.strip().lower()
    if text not in ("true", "1", "false", "0"):
        raise child.wrong(f"is {cut(text)}; it has to be true or false")
    return text in ("true", "1")


def read_pose(tag: Tag) -> Placed:
    """The `<pose>` of an element, zero without one. Raises RobotError."""
    pose = tag.first("pose")
    if pose is None:
        return Placed(Pose(), "")
    # SDF 1.5 and 1.6 called it frame.
    within = pose.attributes.get("relative_to", pose.attributes.get("frame", "")).strip()
    return Placed(_pose(pose), within)


def compose(outer: Pose, inner: Pose) -> Pose:
    """`inner`, which is told in the frame `outer`, in the frame that `outer` is told in."""
    if outer == Pose():
        return inner
    return outer if inner == Pose() else (Frame.of(outer) @ Frame.of(inner)).pose


def _pose(tag: Tag) -> Pose:
    if not tag.text.strip():
        return Pose()
    if tag.attributes.get("rotation_format", "euler_rpy") == "quat_xyzw":
        return _with_quaternion(tag)
    x, y, z, *turns = numbers(tag, 6)
    if tag.attributes.get("degrees", "false").strip().lower() in ("true", "1"):
        turns = [math.radians(turn) for turn in turns]
    roll, pitch, yaw = turns
    return Pose((x, y, z), (roll, pitch, yaw))


def _with_quaternion(tag: Tag) -> Pose:
    x, y, z, *turn = numbers(tag, 7)
    length = math.hypot(*turn)
    if length < SHORTEST:
        raise tag.wrong("has a quaternion of length 0; no turn at all is 0 0 0 1")
    a, b, c, w = (part / length for part in turn)
    return Pose((x, y, z), rpy_of(matrix_of_quaternion((a, b, c, w))))


def _number(tag: Tag, word: str, most: float) -> float:
    value = number(word)
    if value is None:
        raise tag.wrong(f"has {cut(word)}, which is no finite number")
    if abs(value) > most:
        raise tag.wrong(f"has {cut(word)}, which is beyond {most:g}; use metres, kilograms and radians")
    return value
