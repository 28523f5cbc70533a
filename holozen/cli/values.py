"""What a person wrote, as a checked message and as bytes."""

import json
import sys
import time
from typing import Any

from msgspec import to_builtins

from holozen import codec, wire
from holozen import messages as m
from holozen.cdr import CodecError
from holozen.flags import nearest
from holozen.messages import Message

LARGEST = 1_000_000  # bytes of a value
Kinds = tuple[type[Message], ...]


def kinds_named(name: str) -> Kinds:
    """Our type of a ROS name, such as geometry_msgs/msg/Twist or geometry_msgs/Twist; empty if it is none of ours."""
    package, _, last = name.replace("/msg/", "/").partition("/")
    ours = [kind for kind in vars(m).values() if isinstance(kind, type) and issubclass(kind, Message)]
    ours += [kind for row in wire.TOPICS for kind in row.types]
    return tuple({kind: 0 for kind in ours if f"{package}/msg/{last}" == kind.ROS})


def kinds_of(types: set[str]) -> Kinds:
    """Our types for what somebody reads: all that the table's row takes, if there is one."""
    row = next((row for row in wire.TOPICS if {kind.ROS for kind in row.types} & types), None)
    return row.types if row else next((found for name in sorted(types) if (found := kinds_named(name))), ())


def read_message(text: str, kinds: Kinds) -> Message:
    """The message that `text` (JSON or YAML, or - for standard input) describes. Raises ValueError with the reason."""
    message = draft(text, kinds)
    codec.encode(message)  # what cannot be sent is told now
    return message


def draft(text: str, kinds: Kinds) -> Message:
    """`read_message` that lets numbers pass which are not finite."""
    return message(plain(text), kinds)


def message(value: Any, kinds: Kinds) -> Message:
    """`draft` of a plain value."""
    try:
        return codec.convert(value, kinds)
    except CodecError as error:
        raise ValueError(f"{error}{_meant(str(error), value, kinds)}") from None


def forced(message: Message, name: str) -> bytes:
    """The bytes of a message with numbers that are not finite, which `codec.encode` refuses."""
    if name == "json":
        return json.dumps(to_builtins(message)).encode()
    import msgspec

    if name == "msgpack":
        return msgspec.msgpack.encode(message)
    from holozen import cdr
    from holozen.interfaces import Registry

    return cdr.write(Registry().find(message.ROS), to_builtins(message))


def plain(text: str) -> Any:
    """The value that JSON or YAML describes; - reads standard input. Raises ValueError."""
    if text == "-":
        text = sys.stdin.read(LARGEST + 1)
    if len(text) > LARGEST:
        raise ValueError(f"the value is longer than {LARGEST} bytes")
    try:
        value = _read(text)
        return _timed(value) if tells_time(text) else value
    except RecursionError:
        raise ValueError("the value is nested too deeply") from None


def tells_time(text: str) -> bool:
    """Whether a value may say `header: auto` or `stamp: now`, which is another time whenever it is read."""
    return "auto" in text or "now" in text


def _read(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError as error:
        return _yaml(text, error)


def _timed(value: Any) -> Any:
    """A value with the time of now where it says so, as `ros2 topic pub` fills it in."""
    if isinstance(value, list):
        return [_timed(inner) for inner in value]
    if not isinstance(value, dict):
        return value
    sec, nanosec = divmod(time.time_ns(), 1_000_000_000)
    stamp = {"sec": sec, "nanosec": nanosec}
    filled = {("header", "auto"): {"stamp": stamp}, ("stamp", "now"): stamp}
    return {
        name: filled[name, inner] if isinstance(inner, str) and (name, inner) in filled else _timed(inner)
        for name, inner in value.items()
    }


def _yaml(text: str, why_no_json: ValueError) -> Any:
    try:
        import yaml
    except ModuleNotFoundError:
        raise ValueError(f"no JSON: {why_no_json}; to write YAML: pip install pyyaml") from None
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"neither JSON nor YAML: {' '.join(str(error).split())}") from None


def _meant(reason: str, value: Any, kinds: Kinds) -> str:
    """The right names for an unknown field that `reason` tells of, the closest first."""
    word = reason.partition("unknown field `")[2].partition("`")[0]
    if not word:
        return ""
    place = reason.partition(" - at `$.")[2].partition("`")[0]
    known: Any = {}
    for kind in kinds:
        known = to_builtins(kind())
        for name in filter(None, place.split(".")):
            known = known.get(name, {}) if isinstance(known, dict) else {}
        if known:
            break
    names = list(known) if isinstance(known, dict) else []
    return f"{nearest(word, names)}; there are {', '.join(names) or 'none'}"
