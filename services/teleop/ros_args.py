"""Converts arguments of teleop_twist_keyboard, in ROS 1 and ROS 2, to the flags of this teleop. Pure."""

import re
from collections.abc import Iterator

from holozen.suggest import shorten
from holozen.wire import is_robot_name

from .toml_file import InputError, cut, one_of

# In ROS 1 there are all of these; in ROS 2 speed, turn, stamped and frame_id.
PARAMETERS = ("speed", "turn", "speed_limit", "turn_limit", "repeat_rate", "key_timeout", "stamped", "frame_id")
# The node names that may precede a parameter's name in ROS 2.
NODES = ("teleop_twist_keyboard", "/teleop_twist_keyboard", "teleop", "/teleop", "*", "/*", "**", "/**")
TRUE, FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")
ROS_2 = {"-p": "-p", "--param": "-p", "-r": "-r", "--remap": "-r"}
_NAME = r"[A-Za-z_][A-Za-z0-9_-]*"
_NODE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_TOPIC = re.compile(rf"/?{_NAME}(?:/{_NAME})*")

RosArgument = tuple[str, str, str, str]
"""`-p` for a parameter or `-r` for a remap, its name, its value, and the argument as written."""


def ros_arguments(words: list[str]) -> list[str]:
    """`words` with ROS arguments converted to flags, which come first; other words are unchanged. Raises InputError.

    A remap of cmd_vel to `Fred/cmd_vel` becomes `--robot=Fred`, one to another key `--cmd-vel=KEY`, and a node name
    `--name=x`.
    """
    others: list[str] = []
    arguments = list(_split(words, others))
    parameters = {name: _parameter(name, value, word) for kind, name, value, word in arguments if kind == "-p"}
    remaps = [(name, value, word) for kind, name, value, word in arguments if kind == "-r"]
    return [*parameters.values(), *_node(remaps), *_topic(remaps), *others]


def _split(words: list[str], others: list[str]) -> Iterator[RosArgument]:
    """The ROS arguments among the words; all other words go to `others`."""
    waiting, in_ros = iter(words), False
    for word in waiting:
        if in_ros and word not in ("--", "--ros-args"):
            yield _ros_2(word, next(waiting, None))
        elif word == "--ros-args" or in_ros:
            in_ros = word == "--ros-args"
        elif word == "--":
            others += [word, *waiting]
        elif ":=" in word and not word.startswith("-"):
            yield _ros_1(word)
        else:
            others.append(word)


def _ros_1(word: str) -> RosArgument:
    name, _, value = word.partition(":=")
    if name.startswith("_") and not name.startswith("__"):
        return "-p", name[1:], value, word
    if name in PARAMETERS:
        raise _wrong(word, f"is a remap in ROS; write _{word}, or --{name.replace('_', '-')} {value}")
    return "-r", name, value, word


def _ros_2(flag: str, word: str | None) -> RosArgument:
    if flag not in ROS_2:
        raise _wrong(flag, "not a ROS argument; -- ends those, which are -p NAME:=VALUE and -r NAME:=NAME")
    left, given, value = (word or "").partition(":=")
    if not given:
        raise _wrong(f"{flag} {word or ''}".strip(), "write NAME:=VALUE after it, such as -p speed:=0.9")
    node, colon, name = left.rpartition(":")
    if colon and node not in NODES:
        raise _wrong(f"{flag} {word}", f"is meant for the node {cut(node)}; leave that out")
    return ROS_2[flag], name, value, f"{flag} {word}"


def _parameter(name: str, value: str, word: str) -> str:
    """The flag that sets a parameter. Numbers are checked with the flags."""
    if name not in PARAMETERS:
        raise _wrong(word, f"there is no parameter {cut(name)}{one_of(name, [*PARAMETERS])}")
    flag = f"--{name.replace('_', '-')}"
    if len(value) > 1 and value[0] == value[-1] and value[0] in "'\"":  # YAML's quotes
        value = value[1:-1]
    if name != "stamped":
        return f"{flag}={value}"
    if value.lower() in TRUE:
        return flag
    if value.lower() in FALSE:
        return f"--no-{name}"
    raise _wrong(word, "write true or false")


def _node(remaps: list[tuple[str, str, str]]) -> list[str]:
    names = [(value, word) for name, value, word in remaps if name in ("__node", "__name")]
    for value, word in names:
        if not _NODE_NAME.fullmatch(value):
            raise _wrong(word, f"{cut(value)} is not a valid node name; use a letter, then letters, digits or '_'")
    return [f"--name={names[-1][0]}"] if names else []


def _topic(remaps: list[tuple[str, str, str]]) -> list[str]:
    """The flags for the key of cmd_vel, with namespaces as in ROS: names without a leading slash are relative."""
    inside = "/"
    for name, value, word in remaps:
        if name == "__ns":
            inside = value if value == "/" else f"{_legal(value, word).rstrip('/')}/"
    own = goes = _resolved("cmd_vel", inside)
    for name, value, word in remaps:
        if name in ("__node", "__name", "__ns"):
            continue
        if _resolved(name, inside) != own:
            raise _wrong(word, f"there is nothing to remap but {own.removeprefix('/')}")
        goes = _resolved(_legal(value, word), inside)
    robot, _, last = goes[1:].rpartition("/")
    if goes == "/cmd_vel":
        return []
    return [f"--robot={robot}"] if last == "cmd_vel" and is_robot_name(robot) else [f"--cmd-vel={goes[1:]}"]


def _resolved(name: str, inside: str) -> str:
    full = name if name.startswith("/") else inside + name
    return full if full.startswith("/") else f"/{full}"


def _legal(name: str, word: str) -> str:
    if not _TOPIC.fullmatch(name):
        raise _wrong(word, f"{cut(name)} is not a ROS name; use letters, digits and '_', such as Fred/cmd_vel")
    return name


def _wrong(word: str, text: str) -> InputError:
    return InputError(f"{shorten(word, 60)}: {text}")
