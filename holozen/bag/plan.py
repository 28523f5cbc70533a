"""What of a bag is played, and where to. Nothing moves a robot unless it was asked for, or speaks in another's name."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from holozen.bag.errors import BagError
from holozen.bag.reader import Channel
from holozen.graph import Endpoint, includes, on_key

COMMANDS = ("cmd_vel", "joint_command")
COMMAND_TYPES = {"geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"}


class Plan(NamedTuple):
    """Channels and the keys they are played to; `commands` are those of these keys that move robots."""

    targets: dict[Channel, str]
    commands: set[str]
    left_out: dict[str, str]  # key in the bag -> why


def plan(
    channels: Iterable[Channel],
    endpoints: list[Endpoint],
    *,
    topics: list[str] | None = None,
    remap: Mapping[str, str] = {},
    commands: bool = False,
) -> Plan:
    """What to play. `topics` are keys or key expressions of the bag; `endpoints` those of everybody else.

    Raises BagError when a key was asked for that is not there, or that must not be played.
    """
    channels = sorted(channels)
    _check_known(topics or [], remap, channels)
    made = Plan({}, set(), {})
    for channel in channels:
        asked = channel.key in (topics or ()) or channel.key in remap
        if topics and not any(includes(one, channel.key) for one in topics):
            continue
        target = remap.get(channel.key, channel.key)
        is_command = _is_command(channel, target, endpoints)
        if why := _why_not(target, is_command, commands, endpoints):
            if asked:
                raise BagError(f"{channel.key}{f' as {target}' if target != channel.key else ''}: {why}")
            made.left_out[channel.key] = why
            continue
        made.targets[channel] = target
        if is_command:
            made.commands.add(target)
    return made


def _check_known(topics: list[str], remap: Mapping[str, str], channels: list[Channel]) -> None:
    for one in (*topics, *remap):
        if not any(includes(one, channel.key) for channel in channels):
            known = ", ".join(sorted({channel.key for channel in channels})) or "nothing"
            raise BagError(f"there is no {one!r} in the bag; there is {known}")


def _is_command(channel: Channel, target: str, endpoints: list[Endpoint]) -> bool:
    """Whether somebody may move for it: by its name there or here, its type, or what listens on the key."""
    names = {key.rpartition("/")[2] for key in (channel.key, target)}
    listeners = {endpoint.type for endpoint in on_key(endpoints, target, "sub")}
    return bool(names & set(COMMANDS)) or channel.type in COMMAND_TYPES or bool(listeners & COMMAND_TYPES)


def _why_not(target: str, is_command: bool, commands: bool, endpoints: list[Endpoint]) -> str:
    if not target or set(target) & set("*$?#") or target.startswith(("/", "@")) or "" in target.split("/"):
        return "this is no key to publish on"
    if is_command:
        return "" if commands else "it moves robots; --commands plays it too"
    writers = sorted({endpoint.node for endpoint in on_key(endpoints, target, "pub")})
    return f"{', '.join(writers)} publishes it now; --remap {target}:=NEW plays it elsewhere" if writers else ""
