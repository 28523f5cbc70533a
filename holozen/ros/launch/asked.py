"""Which launch arguments what is yet to be done asks for, as far as that shows before it is done."""

from collections.abc import Iterator
from typing import Any

from holozen.ros.launch.actions import IncludeLaunchDescription, OpaqueFunction
from holozen.ros.launch.settings import DeclareLaunchArgument
from holozen.ros.launch.substitutions import LaunchConfiguration
from holozen.ros.launch.text import shown

ANY = "*"  # only doing it tells which


def names(thing: Any, seen: set[int]) -> Iterator[str]:
    """The names of the arguments in actions, substitutions, and lists and dicts of them; ANY where a function or
    another launch file may ask. `seen` are the ids of those that need no look.
    """
    if id(thing) in seen or isinstance(thing, str):
        return
    seen.add(id(thing))
    if callable(thing) or isinstance(thing, OpaqueFunction | IncludeLaunchDescription):
        yield ANY
    elif isinstance(thing, LaunchConfiguration):
        yield shown(thing.variable_name)
    elif isinstance(thing, DeclareLaunchArgument):
        yield thing.name
    for part in _parts(thing):
        yield from names(part, seen)


def _parts(thing: Any) -> list[Any]:
    if isinstance(thing, dict):
        return [*thing, *thing.values()]
    if isinstance(thing, list | tuple | set):
        return list(thing)
    if not type(thing).__module__.startswith(__package__ or ""):
        return []
    return [part for name, part in getattr(thing, "__dict__", {}).items() if not name.startswith("_")]
